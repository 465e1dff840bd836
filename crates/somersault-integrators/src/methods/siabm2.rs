//! Two-step semi-implicit Adams-Bashforth-Moulton, thesis (5.10), algorithm 13.
//!
//! v₊ = vₙ + h (3aₙ − aₙ₋₁)/2, then q₊ = exp(h (v₊ + vₙ)/2) qₙ.
//!
//! Order 2 on ℝ³ and on SO(3).
//! 1 evaluation; 1 previous steps, started up by a [`StartUp`] of the user's choice. The energy of a free body grows at large steps.

use crate::adams::{AdamsMemory, StartUp};
use crate::stepper::{MethodInfo, Orders, Scheme, StepError, Stepper};
use crate::system::{StateOf, System};

register! {
    80 thesis => Siabm2: SemiImplicitAdams2 { start_up }, any;
}

/// Two-step semi-implicit Adams-Bashforth-Moulton method.
#[derive(Debug, Clone, Copy, Default)]
pub struct SemiImplicitAdams2 {
    /// How the first steps are made.
    pub start_up: StartUp,
}

impl Scheme for SemiImplicitAdams2 {
    const INFO: MethodInfo = MethodInfo {
        orders: Orders::all(2),
        evaluations: 1,
        history: 1,
        limitations: "unsuitable for large steps, at which it is unstable",
        ..MethodInfo::explicit(
            "siabm2",
            "Two-step semi-implicit Adams-Bashforth-Moulton",
            "Aguilar Mayans, (5.10), (5.11), algorithm 13",
            2,
        )
    };
}

impl<S: System> Stepper<S> for SemiImplicitAdams2 {
    type Memory = AdamsMemory<S, 2>;

    fn start(&self, system: &S, x: &StateOf<S>) -> Result<Self::Memory, StepError> {
        AdamsMemory::new(system, x)
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
        memory.step(system, self.start_up, false, t, x, h, out)
    }
}
