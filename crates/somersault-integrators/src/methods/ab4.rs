//! Four-step Adams-Bashforth, thesis (5.9), algorithm 12.
//!
//! v̄ = (55vₙ − 59vₙ₋₁ + 37vₙ₋₂ − 9vₙ₋₃)/24, q₊ = exp(h v̄) qₙ, and the same for v₊ from the
//! accelerations.
//!
//! Order 4 on ℝ³ but only 2 on SO(3), where adding velocities of different steps neglects a commutator
//! of third order.
//! 1 evaluation; 3 previous steps, started up by a [`StartUp`] of the user's choice. Large steps are unstable.

use crate::adams::{AdamsMemory, StartUp};
use crate::stepper::{MethodInfo, Orders, Scheme, StepError, Stepper};
use crate::system::{StateOf, System};

register! {
    110 thesis => Ab4: AdamsBashforth4 { start_up }, any;
    280 => Ab4L: AdamsBashforth4 { start_up },
        momentum("ab4_l", "Four-step Adams-Bashforth, angular momentum");
}

/// Four-step Adams-Bashforth method.
#[derive(Debug, Clone, Copy, Default)]
pub struct AdamsBashforth4 {
    /// How the first steps are made.
    pub start_up: StartUp,
}

impl Scheme for AdamsBashforth4 {
    const INFO: MethodInfo = MethodInfo {
        orders: Orders::split(4, 2),
        rate_orders: Orders::split(4, 2),
        evaluations: 1,
        history: 3,
        limitations: "unsuitable for rotations to an accuracy: order 2 on SO(3), and on ℝ³ where forces depend on the orientation",
        ..MethodInfo::explicit(
            "ab4",
            "Four-step Adams-Bashforth",
            "F. Bashforth and J. C. Adams, An attempt to test the theories of capillary action (1883); Aguilar Mayans, algorithm 12",
            4,
        )
    };
}

impl<S: System> Stepper<S> for AdamsBashforth4 {
    type Memory = AdamsMemory<S, 4>;

    fn start(&self, system: &S, x: &StateOf<S>) -> Result<Self::Memory, StepError> {
        AdamsMemory::new(system, x)
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
        memory.step(system, self.start_up, true, t, x, h, out)
    }
}
