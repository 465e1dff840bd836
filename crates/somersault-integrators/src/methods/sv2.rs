//! Störmer–Verlet with a velocity update of second order, the variant that the caption of algorithm 7
//! suggests.
//!
//! Position and orientation as `sv`; v₊ = vₙ + h (3aₙ − aₙ₋₁)/2, L₊ = Lₙ + h (3Mₙ − Mₙ₋₁)/2,
//! ω₊ = I₊⁻¹ L₊.
//!
//! Order 2 on ℝ³ and on SO(3), with or without torque. 1 evaluation; 1 earlier step, the first step
//! made by `rkmk`. Angular momentum is exact without torque. Rounding grows as 1/h.

use super::sv::VerletMemory;
use crate::stepper::{MethodInfo, Scheme, Scope, StepError, Stepper};
use crate::system::{RigidSystem, StateOf};

register! {
    200 => Sv2: StormerVerlet2, world;
}

/// Störmer–Verlet with a two-step Adams–Bashforth velocity update.
#[derive(Debug, Clone, Copy, Default)]
pub struct StormerVerlet2;

impl Scheme for StormerVerlet2 {
    const INFO: MethodInfo = MethodInfo {
        evaluations: 1,
        history: 1,
        scope: Scope::RigidBodies,
        conserves: MethodInfo::MOMENTUM_ONCE_STARTED,
        ..MethodInfo::explicit(
            "sv2",
            "Störmer-Verlet with second order velocity",
            "Aguilar Mayans, algorithm 7, caption",
            2,
        )
    };
}

impl<S: RigidSystem> Stepper<S> for StormerVerlet2 {
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
        memory.step(system, 1.5, t, x, h, out)
    }
}
