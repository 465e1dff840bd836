//! Variational Lie–Verlet: the Hamilton–Pontryagin Lie group integrator with the Cayley map.
//!
//! v½ = v + h a/2, L½ = L + h M/2; r₊ = r + h v½, R₊ = R cay(h ξ) with
//! Rᵀ L½ = I ξ + (h/2) ξ × I ξ + (h²/4)(ξ·I ξ) ξ, see [`crate::variational_cayley`];
//! v₊ = v½ + h a₊/2, L₊ = L½ + h M₊/2, ω₊ = I₊⁻¹ L₊.
//!
//! Order 2 on ℝ³ and on SO(3), with or without torque. 1 evaluation where wrenches do not depend on the
//! rates, 2 where they do; no start-up. Symplectic where wrenches come from a potential: the energy error
//! stays bounded, of size h², also for a free body, whose energy `dmv2s` keeps to rounding. World angular
//! momentum is constant without torque, to round-off that does not add up. Takes full inertia tensors as they
//! are.
//!
//! The equation of a step has a solution for steps of any length, whose rotation falls ever further behind the body's: about
//! a principal axis it is 2 arctan g with g + g³ = h ω/2, π at most. Its series in h converges for h ω < 4/(3√3) = 0.77. The
//! rotation about the axis of least inertia feels the energy of the whole motion, so that the angle is counted at
//! √(2T/I_min), the fastest the body can turn with its kinetic energy T. Up to θ = h √(2T/I_min) = 0.77 a step of a
//! free body is off by 0.4 θ³ rad at most; a longer one is a typed error.
//!
//! N. Bou-Rabee, J. E. Marsden, Found. Comput. Math. 9 (2009) 197, the variational Lie–Verlet method.
//!
//! # Deviations
//! The second kick under wrenches that depend on the rates takes them at rates predicted by the first.

use crate::kick_drift_kick::KickDriftKickMemory;
use crate::stepper::{MethodInfo, Scheme, Scope, StepError, Stepper};
use crate::system::{RigidSystem, StateOf};
use crate::variational_cayley;

register! {
    190 => Lgvi: VariationalLieVerlet, world;
}

/// Largest h √(2T/I_min), 4/(3√3): the radius of convergence of the series of g + g³ = h ω/2.
const LIMIT: f64 = 0.769_800_358_919_501;

/// The variational Lie–Verlet method.
#[derive(Debug, Clone, Copy, Default)]
pub struct VariationalLieVerlet;

impl Scheme for VariationalLieVerlet {
    const INFO: MethodInfo = MethodInfo {
        evaluations: 1,
        scope: Scope::RigidBodies,
        implicit: true,
        angle_limit: Some(LIMIT),
        conserves: "angular momentum without torque to rounding; the energy error stays bounded",
        limitations: "unsuitable for steps of more than 0.77 rad at √(2T/I_min), the fastest the body can turn with its energy: refused",
        ..MethodInfo::explicit(
            "lgvi",
            "Variational Lie-Verlet",
            "N. Bou-Rabee, J. E. Marsden, Found. Comput. Math. 9 (2009) 197",
            2,
        )
    };
}

impl<S: RigidSystem> Stepper<S> for VariationalLieVerlet {
    type Memory = KickDriftKickMemory<S>;

    fn start(&self, _: &S, x: &StateOf<S>) -> Result<Self::Memory, StepError> {
        Ok(KickDriftKickMemory::new(x))
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
        memory.step(system, t, x, h, out, |i, momentum| {
            let inertia = system.body(i).inertia();
            // 2T/I_min: the square of the speed at which the body would turn about its axis of least inertia.
            let square = momentum.dot(&inertia.velocity(momentum)) / inertia.principal_moments().min();
            if h * h * square > LIMIT * LIMIT {
                Self::check_angle(t, h, square.sqrt())?;
            }
            variational_cayley::increment(inertia.tensor(), inertia.inverse(), momentum, h)
                .map(|increment| increment.rotation)
                .map_err(|e| e.of::<Self>(t, h, square.sqrt()))
        })
    }
}
