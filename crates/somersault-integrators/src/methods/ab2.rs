//! Two-step Adams-Bashforth, thesis (5.8), algorithm 11.
//!
//! v̄ = (3vₙ − vₙ₋₁)/2, q₊ = exp(h v̄) qₙ, v₊ = vₙ + h (3aₙ − aₙ₋₁)/2.
//!
//! Order 2 on ℝ³ and on SO(3).
//! 1 evaluation; 1 previous steps, started up by a [`StartUp`] of the user's choice. Large steps are unstable.

use crate::adams::{AdamsMemory, StartUp};
use crate::stepper::{MethodInfo, Orders, Scheme, StepError, Stepper};
use crate::system::{StateOf, System};

register! {
    70 thesis => Ab2: AdamsBashforth2 { start_up }, any;
    270 => Ab2L: AdamsBashforth2 { start_up },
        momentum("ab2_l", "Two-step Adams-Bashforth, angular momentum");
}

/// Two-step Adams-Bashforth method.
#[derive(Debug, Clone, Copy, Default)]
pub struct AdamsBashforth2 {
    /// How the first steps are made.
    pub start_up: StartUp,
}

impl Scheme for AdamsBashforth2 {
    const INFO: MethodInfo = MethodInfo {
        orders: Orders::all(2),
        evaluations: 1,
        history: 1,
        limitations: "unsuitable for large steps, at which it is unstable",
        ..MethodInfo::explicit(
            "ab2",
            "Two-step Adams-Bashforth",
            "F. Bashforth and J. C. Adams, An attempt to test the theories of capillary action (1883); Aguilar Mayans, algorithm 11",
            2,
        )
    };
}

impl<S: System> Stepper<S> for AdamsBashforth2 {
    type Memory = AdamsMemory<S, 2>;

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
