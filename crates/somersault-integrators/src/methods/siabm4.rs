//! Four-step semi-implicit Adams-Bashforth-Moulton, thesis (5.12), algorithm 14.
//!
//! v₊ = vₙ + h (55aₙ − 59aₙ₋₁ + 37aₙ₋₂ − 9aₙ₋₃)/24, then
//! q₊ = exp(h (9v₊ + 19vₙ − 5vₙ₋₁ + vₙ₋₂)/24) qₙ.
//!
//! Order 4 on ℝ³ but only 2 on SO(3), for the reason given at `ab4`.
//! 1 evaluation; 3 previous steps, started up by a [`StartUp`] of the user's choice. Large steps are unstable.
//!
//! # Deviations
//! Line 5 of algorithm 14 prints −19/24; (5.13) and the order require +19/24. (5.12) is taken with
//! f(t, y, ẏ).

use crate::adams::{AdamsMemory, StartUp};
use crate::stepper::{MethodInfo, Orders, Scheme, StepError, Stepper};
use crate::system::{StateOf, System};

register! {
    120 thesis => Siabm4: SemiImplicitAdams4 { start_up }, any;
}

/// Four-step semi-implicit Adams-Bashforth-Moulton method.
#[derive(Debug, Clone, Copy, Default)]
pub struct SemiImplicitAdams4 {
    /// How the first steps are made.
    pub start_up: StartUp,
}

impl Scheme for SemiImplicitAdams4 {
    const INFO: MethodInfo = MethodInfo {
        orders: Orders::split(4, 2),
        rate_orders: Orders::split(4, 2),
        evaluations: 1,
        history: 3,
        limitations: "unsuitable for rotations to an accuracy: order 2 on SO(3), and on ℝ³ where forces depend on the orientation",
        ..MethodInfo::explicit(
            "siabm4",
            "Four-step semi-implicit Adams-Bashforth-Moulton",
            "Aguilar Mayans, (5.12), (5.13), algorithm 14",
            4,
        )
    };
}

impl<S: System> Stepper<S> for SemiImplicitAdams4 {
    type Memory = AdamsMemory<S, 4>;

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
