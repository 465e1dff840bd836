//! Preprocessed discrete Moser–Veselov of orders 4, 6, 8 and 10.
//!
//! As `dmv2`, with moments of inertia modified by a series in h² that makes the map agree with the exact
//! motion to the order wanted, see [`crate::preprocessing`]. The modified moments belong to one motion and
//! one h and are computed in the first step after a start or restart.
//!
//! Order 4, 6, 8 or 10 on SO(3), 2 on ℝ³ (exact under uniform gravity), for bodies without torque; under a
//! torque it is refused. 1 evaluation where forces do not depend on velocity, 2 where they do, none for a
//! free body; no start-up. Energy and angular momentum are conserved to round-off at every step size, as by
//! `dmv2`: the map has the same invariants, whatever the moments. The modified moments depend on the motion
//! through its invariants, so that over all motions the map is symplectic only to its order.
//!
//! Not for large steps: the series in h |ω| is good to h |ω| = 1, and a step beyond it is a typed error. A step that turns
//! the body by θ is off by 0.04 θ⁵, 0.003 θ⁷, 2.5e-4 θ⁹ or 2e-5 θ¹¹ rad at most. Dense output is of order 4, as for all
//! methods without a curve of their own: between the ends of a step the higher orders are not seen.
//!
//! E. Hairer, G. Vilmart, J. Phys. A: Math. Gen. 39 (2006) 13225.
//!
//! # Deviations
//! The coefficients are not taken from the source but recomputed.

use crate::preprocessing::Preprocessing;
use crate::stepper::{MethodInfo, Orders, Scheme, Scope, StepError, Stepper};
use crate::system::{RigidSystem, StateOf};
use crate::torque_free::TorqueFreeMemory;

register! {
    150 => Pmv4: PreprocessedMoserVeselov<4>, world;
    160 => Pmv6: PreprocessedMoserVeselov<6>, world;
    170 => Pmv8: PreprocessedMoserVeselov<8>, world;
    180 => Pmv10: PreprocessedMoserVeselov<10>, world;
}

/// The preprocessed discrete Moser–Veselov method of order 4, 6, 8 or 10; a [`Scheme`] for these only.
#[derive(Debug, Clone, Copy, Default)]
pub struct PreprocessedMoserVeselov<const ORDER: u8>;

const fn info(order: u8, name: &'static str, title: &'static str) -> MethodInfo {
    MethodInfo {
        orders: Orders::split(2, order).without_torque(),
        rate_orders: Orders::split(2, order).without_torque(),
        evaluations: 1,
        scope: Scope::TorqueFree,
        implicit: true,
        angle_limit: Some(1.0),
        conserves: "energy and angular momentum of a free body to rounding",
        limitations: "unsuitable for torque, and steps beyond h‖ω‖ = 1 rad: both are refused; output between nodes, of order 4",
        ..MethodInfo::explicit(
            name,
            title,
            "E. Hairer, G. Vilmart, J. Phys. A: Math. Gen. 39 (2006) 13225",
            order,
        )
    }
}

impl Scheme for PreprocessedMoserVeselov<4> {
    const INFO: MethodInfo = info(4, "pmv4", "Preprocessed discrete Moser-Veselov of order 4");
}

impl Scheme for PreprocessedMoserVeselov<6> {
    const INFO: MethodInfo = info(6, "pmv6", "Preprocessed discrete Moser-Veselov of order 6");
}

impl Scheme for PreprocessedMoserVeselov<8> {
    const INFO: MethodInfo = info(8, "pmv8", "Preprocessed discrete Moser-Veselov of order 8");
}

impl Scheme for PreprocessedMoserVeselov<10> {
    const INFO: MethodInfo = info(10, "pmv10", "Preprocessed discrete Moser-Veselov of order 10");
}

impl<S: RigidSystem, const ORDER: u8> Stepper<S> for PreprocessedMoserVeselov<ORDER>
where
    Self: Scheme,
{
    type Memory = TorqueFreeMemory<S>;

    fn start(&self, system: &S, x: &StateOf<S>) -> Result<Self::Memory, StepError> {
        TorqueFreeMemory::new::<Self>(system, x)
    }

    fn restart(&self, memory: &mut Self::Memory) {
        memory.restart();
    }

    #[inline]
    fn step(
        &self,
        system: &S,
        t: f64,
        x: &StateOf<S>,
        h: f64,
        memory: &mut Self::Memory,
        out: &mut StateOf<S>,
    ) -> Result<(), StepError> {
        memory.step::<Self>(const { Preprocessing::of_order(ORDER) }, system, t, x, h, out)
    }
}
