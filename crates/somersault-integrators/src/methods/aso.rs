//! Buss's augmented second order method, thesis (5.14)–(5.17), algorithm 15.
//!
//! r₊ = rₙ + h vₙ + h² aₙ/2, R₊ = exp(h ω̄) Rₙ with ω̄ = ωₙ + h αₙ/2 + h² (αₙ × ωₙ)/12;
//! v₊ = vₙ + h (3aₙ − aₙ₋₁)/2, L₊ = Lₙ + h (3Mₙ − Mₙ₋₁)/2, ω₊ = I₊⁻¹ L₊.
//!
//! Order 2 on ℝ³ and on SO(3). 1 evaluation; 1 earlier step, the first step made by `rkmk`. Angular
//! momentum is exact without torque, so the rotational energy is bounded by (6.4). A step of a free body
//! that turns by θ in it is off by 0.16 θ³ rad at most; being explicit, it is made however far that is.
//!
//! # Deviations
//! (5.14) prints ωₙ for ω̄ₙ of (5.16), whose commutator sign is right. The start-up is ours.

use super::rkmk::RungeKuttaMuntheKaas4;
use crate::augmented::advance;
use crate::body::angular_momentum;
use crate::state::{Poses, State, Twist};
use crate::stepper::{MethodInfo, Scheme, Scope, StepError, Stepper};
use crate::system::{RateOf, RigidSystem, StateOf, angular_velocity, world_acceleration};
use somersault_core::lie::so3;

register! {
    90 thesis => Aso: AugmentedSecondOrder, world;
}

/// Buss's augmented second order method.
#[derive(Debug, Clone, Copy, Default)]
pub struct AugmentedSecondOrder;

impl Scheme for AugmentedSecondOrder {
    const INFO: MethodInfo = MethodInfo {
        evaluations: 1,
        history: 1,
        scope: Scope::RigidBodies,
        conserves: MethodInfo::MOMENTUM_ONCE_STARTED,
        ..MethodInfo::explicit(
            "aso",
            "Buss's augmented second order",
            "S. R. Buss, J. Comput. Phys. 164 (2000) 377; Aguilar Mayans, algorithm 15",
            2,
        )
    };
}

/// The wrenches of the step before.
pub struct AugmentedMemory<S: RigidSystem> {
    before: RateOf<S>,
    now: RateOf<S>,
    started: bool,
    starter: <RungeKuttaMuntheKaas4 as Stepper<S>>::Memory,
}

impl<S: RigidSystem> Stepper<S> for AugmentedSecondOrder {
    type Memory = AugmentedMemory<S>;

    fn start(&self, system: &S, x: &StateOf<S>) -> Result<Self::Memory, StepError> {
        Ok(AugmentedMemory {
            before: x.rate.clone(),
            now: x.rate.clone(),
            started: false,
            starter: RungeKuttaMuntheKaas4.start(system, x)?,
        })
    }

    fn restart(&self, memory: &mut Self::Memory) {
        memory.started = false;
    }

    #[inline(always)]
    fn step(
        &self,
        system: &S,
        t: f64,
        x: &StateOf<S>,
        h: f64,
        m: &mut Self::Memory,
        out: &mut StateOf<S>,
    ) -> Result<(), StepError> {
        system.wrenches(t, x, &mut m.now);
        if m.started {
            for i in 0..x.configuration.count() {
                let body = system.body(i);
                let (pose, twist) = (x.configuration.pose(i), S::Configuration::twist(&x.rate, i));
                let now = S::Configuration::twist(&m.now, i);
                let before = S::Configuration::twist(&m.before, i);
                let slope = world_acceleration(body, &State { configuration: pose, rate: twist }, &now);
                let (omega, alpha) = (twist.angular, slope.angular);
                let turn = (omega + alpha * (0.5 * h) + alpha.cross(&omega) * (h * h / 12.0)) * h;
                let mut next = pose;
                next.position += twist.linear * h + slope.linear * (0.5 * h * h);
                next.orientation = so3::exp(&turn) * pose.orientation;
                let momentum =
                    angular_momentum(body, &pose, &omega) + (now.angular * 1.5 - before.angular * 0.5) * h;
                let rate = Twist {
                    linear: twist.linear + (now.linear * 1.5 - before.linear * 0.5) * (h / body.mass()),
                    angular: angular_velocity(body, &next, &momentum),
                };
                out.configuration.set_pose(i, next);
                S::Configuration::set_twist(&mut out.rate, i, rate);
            }
            let slopes = [(1.5 * h, &m.now), (-0.5 * h, &m.before)];
            advance::<S::Configuration>(&x.rate, &slopes, &mut out.rate);
        } else {
            RungeKuttaMuntheKaas4.step(system, t, x, h, &mut m.starter, out)?;
        }
        m.started = true;
        std::mem::swap(&mut m.before, &mut m.now);
        Ok(())
    }
}
