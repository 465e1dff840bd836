//! Störmer–Verlet, thesis (5.4), algorithm 7.
//!
//! r₊ = 2rₙ − rₙ₋₁ + h² aₙ, R₊ = exp(h (ωₙ₋½ + h αₙ)) Rₙ with ωₙ₋½ = (ωₙ + ωₙ₋₁)/2;
//! v₊ = vₙ + h aₙ, L₊ = Lₙ + h Mₙ, ω₊ = I₊⁻¹ L₊.
//!
//! Order 2 for the position under r̈ = f(r) and for the orientation of a free body, order 1 where the
//! velocity matters, under torque too: the velocity lines are Euler's, and the velocity itself is of order 1 under any force. `sv2` has them of second order.
//! 1 evaluation; 1 earlier step, the first step made by `rkmk`. The position under r̈ = f(r) is
//! symplectic; angular momentum is exact without torque. Rounding grows as 1/h, since the position is
//! a second difference.
//!
//! # Deviations
//! The start-up, which the thesis leaves open.

use super::rkmk::RungeKuttaMuntheKaas4;
use crate::augmented::advance;
use crate::body::angular_momentum;
use crate::state::{Poses, State, Twist};
use crate::stepper::{MethodInfo, Orders, Scheme, StepError, Stepper};
use crate::system::{RateOf, RigidSystem, StateOf, angular_velocity, world_acceleration};

register! {
    30 thesis => Sv: StormerVerlet, world;
}

/// Störmer–Verlet as algorithm 7 has it.
#[derive(Debug, Clone, Copy, Default)]
pub struct StormerVerlet;

impl Scheme for StormerVerlet {
    const INFO: MethodInfo = MethodInfo {
        orders: Orders { translation_with_velocity: 1, rotation_with_torque: Some(1), ..Orders::all(2) },
        rate_orders: Orders { rotation: 2, ..Orders::all(1) },
        evaluations: 1,
        history: 1,
        scope: crate::stepper::Scope::RigidBodies,
        conserves: MethodInfo::MOMENTUM_ONCE_STARTED,
        limitations: "unsuitable for velocities under any force, and positions where forces depend on the velocity or a torque acts: order 1",
        ..MethodInfo::explicit(
            "sv",
            "Störmer-Verlet",
            "L. Verlet, Phys. Rev. 159 (1967) 98; Aguilar Mayans, algorithm 7",
            2,
        )
    };
}

/// Memory of the Störmer–Verlet methods: the step before and its wrenches.
pub struct VerletMemory<S: RigidSystem> {
    before: Option<(StateOf<S>, RateOf<S>)>,
    spare: (StateOf<S>, RateOf<S>),
    starter: <RungeKuttaMuntheKaas4 as Stepper<S>>::Memory,
}

impl<S: RigidSystem> VerletMemory<S> {
    pub(super) fn new(system: &S, x: &StateOf<S>) -> Result<Self, StepError> {
        Ok(Self {
            before: None,
            spare: (x.clone(), x.rate.clone()),
            starter: RungeKuttaMuntheKaas4.start(system, x)?,
        })
    }

    pub(super) fn restart(&mut self) {
        if let Some(before) = self.before.take() {
            self.spare = before;
        }
    }

    /// One step whose velocities advance by h (newest · wrenchₙ + (1 − newest) · wrenchₙ₋₁).
    pub(super) fn step(
        &mut self,
        system: &S,
        newest: f64,
        t: f64,
        x: &StateOf<S>,
        h: f64,
        out: &mut StateOf<S>,
    ) -> Result<(), StepError> {
        let (state, wrenches) = &mut self.spare;
        state.assign(x);
        system.wrenches(t, x, wrenches);
        match &self.before {
            None => RungeKuttaMuntheKaas4.step(system, t, x, h, &mut self.starter, out)?,
            Some((before, wrenches_before)) => {
                for i in 0..x.configuration.count() {
                    let body = system.body(i);
                    let (pose, twist) = (x.configuration.pose(i), S::Configuration::twist(&x.rate, i));
                    let (pose_before, twist_before) =
                        (before.configuration.pose(i), S::Configuration::twist(&before.rate, i));
                    let wrench = S::Configuration::twist(wrenches, i);
                    let wrench_before = S::Configuration::twist(wrenches_before, i);
                    let slope =
                        world_acceleration(body, &State { configuration: pose, rate: twist }, &wrench);
                    let mut next = pose;
                    next.position = 2.0 * pose.position - pose_before.position + slope.linear * (h * h);
                    let half = 0.5 * (twist.angular + twist_before.angular) + slope.angular * h;
                    next.orientation = somersault_core::lie::so3::exp(&(half * h)) * pose.orientation;
                    let force = wrench.linear * newest + wrench_before.linear * (1.0 - newest);
                    let torque = wrench.angular * newest + wrench_before.angular * (1.0 - newest);
                    let momentum = angular_momentum(body, &pose, &twist.angular) + torque * h;
                    let rate = Twist {
                        linear: twist.linear + force * (h / body.mass()),
                        angular: angular_velocity(body, &next, &momentum),
                    };
                    out.configuration.set_pose(i, next);
                    S::Configuration::set_twist(&mut out.rate, i, rate);
                }
                let slopes = [(h * newest, &*wrenches), (h * (1.0 - newest), wrenches_before)];
                advance::<S::Configuration>(&x.rate, &slopes, &mut out.rate);
            }
        }
        match &mut self.before {
            Some(before) => std::mem::swap(before, &mut self.spare),
            None => self.before = Some(self.spare.clone()),
        }
        Ok(())
    }
}

impl<S: RigidSystem> Stepper<S> for StormerVerlet {
    type Memory = VerletMemory<S>;

    fn start(&self, system: &S, x: &StateOf<S>) -> Result<Self::Memory, StepError> {
        VerletMemory::new(system, x)
    }

    fn restart(&self, memory: &mut Self::Memory) {
        memory.restart();
    }

    fn step(
        &self,
        system: &S,
        t: f64,
        x: &StateOf<S>,
        h: f64,
        memory: &mut Self::Memory,
        out: &mut StateOf<S>,
    ) -> Result<(), StepError> {
        memory.step(system, 1.0, t, x, h, out)
    }
}
