//! Discrete Moser–Veselov, thesis (5.18)–(5.21).
//!
//! Ωᵀ D − D Ω = h hat(L_B), R₊ = R Ωᵀ, L_B₊ = Ω L_B in the principal frame, see [`crate::moser_veselov`];
//! r₊ = r + h v + h² a/2, v₊ = v + h (a + a₊)/2.
//!
//! Order 2 on ℝ³ and on SO(3), for bodies without torque; under a torque it is refused, and `dmv2s` takes
//! its place. 1 evaluation where forces do not depend on velocity, 2 where they do, none for a free body;
//! no start-up. Symplectic. Rotational energy and angular momentum are conserved to round-off at every step
//! size: |L| and the energy as invariants of the map (measured 4e-14 in 10⁷ steps), the world angular
//! momentum also by turning the orientation back onto it, which keeps its rounding from adding up.
//!
//! Not for large steps: beyond h |ω| = 1 the equation need not have a solution, which is a typed error. The phase
//! error is of order 2, for a turn of θ in a step 0.8 θ³ rad at most in each; `pmv4` … `pmv10` cost the same and have less.
//!
//! J. Moser, A. P. Veselov, Commun. Math. Phys. 139 (1991) 217.
//!
//! # Deviations
//! (5.18) is printed as Ω R, Ω is called skew-symmetric, and the indices of (5.21) are permuted; see
//! [`crate::moser_veselov`]. The thesis has no algorithm for it and leaves the translation open: velocity
//! Verlet.

use crate::stepper::{MethodInfo, Orders, Scheme, Scope, StepError, Stepper};
use crate::system::{RigidSystem, StateOf};
use crate::torque_free::TorqueFreeMemory;

register! {
    100 thesis => Dmv2: DiscreteMoserVeselov, world;
}

/// The discrete Moser–Veselov method.
#[derive(Debug, Clone, Copy, Default)]
pub struct DiscreteMoserVeselov;

impl Scheme for DiscreteMoserVeselov {
    const INFO: MethodInfo = MethodInfo {
        orders: Orders::all(2).without_torque(),
        rate_orders: Orders::all(2).without_torque(),
        evaluations: 1,
        scope: Scope::TorqueFree,
        implicit: true,
        angle_limit: Some(1.0),
        conserves: "energy and angular momentum of a free body to rounding",
        limitations: "unsuitable for torque, which is refused; h‖ω‖ beyond about 1 rad a step, where its equation has no solution: refused",
        ..MethodInfo::explicit(
            "dmv2",
            "Discrete Moser-Veselov",
            "J. Moser, A. P. Veselov, Commun. Math. Phys. 139 (1991) 217; Aguilar Mayans, (5.18)-(5.21)",
            2,
        )
    };
}

impl<S: RigidSystem> Stepper<S> for DiscreteMoserVeselov {
    type Memory = TorqueFreeMemory<S>;

    fn start(&self, system: &S, x: &StateOf<S>) -> Result<Self::Memory, StepError> {
        TorqueFreeMemory::new::<Self>(system, x)
    }

    fn restart(&self, memory: &mut Self::Memory) {
        memory.restart();
    }

    #[inline(always)]
    fn step(
        &self,
        system: &S,
        t: f64,
        x: &StateOf<S>,
        h: f64,
        memory: &mut Self::Memory,
        out: &mut StateOf<S>,
    ) -> Result<(), StepError> {
        memory.step::<Self>(None, system, t, x, h, out)
    }
}
