//! Commutator-free method of order 4 of Celledoni, Marthinsen and Owren.
//!
//! ```text
//! q₂ = exp(h k₁/2) qₙ,   q₃ = exp(h k₂/2) qₙ,   q₄ = exp(h (k₃ − k₁/2)) q₂,
//! q₊ = exp(h (−k₁ + 2k₂ + 2k₃ + 3k₄)/12) exp(h (3k₁ + 2k₂ + 2k₃ − k₄)/12) qₙ
//! ```
//! with k_i the velocity at stage i; the rates take the stages of the classic Runge–Kutta method, which
//! the same sums give on a vector space.
//!
//! Order 4 on ℝ³ and on SO(3); 4 evaluations and 5 exponentials; no start-up. Conserves nothing
//! exactly. No brackets and no dexp⁻¹, hence no singular turn per step; on SO(3), where brackets are
//! cheap, `rkmk` does as well. Its body-frame twin `cf4_b` is cheaper.
//!
//! E. Celledoni, A. Marthinsen and B. Owren, Future Gener. Comput. Syst. 19 (2003) 341.
//!
//! # Deviations
//! None.

use crate::scratch::Scratch;
use crate::state::{Configuration, Rate};
use crate::stepper::{MethodInfo, Scheme, Stages, StepError, Stepper};
use crate::system::{RateOf, StateOf, System};
use crate::tableau::{ButcherTableau, COMMUTATOR_FREE_4, CommutatorFreeTableau, Tableau};

register! {
    370 => Cf4: CommutatorFree4, any;
    380 => Cf4B: CommutatorFree4, body("cf4_b", "Commutator-free, order 4, body frame");
}

/// Commutator-free method of order 4.
#[derive(Debug, Clone, Copy, Default)]
pub struct CommutatorFree4;

impl Scheme for CommutatorFree4 {
    const INFO: MethodInfo = MethodInfo::explicit(
        "cf4",
        "Commutator-free, order 4",
        "E. Celledoni, A. Marthinsen and B. Owren, Future Gener. Comput. Syst. 19 (2003) 341",
        4,
    );

    fn on_vectors(&self) -> Option<Tableau> {
        Some(Tableau::of(&COMMUTATOR_FREE_4.on_vectors))
    }
}

impl<S: System> Stepper<S> for CommutatorFree4 {
    type Memory = (Stages<S, 4>, Scratch<RateOf<S>>);

    fn start(&self, system: &S, x: &StateOf<S>) -> Result<Self::Memory, StepError> {
        Ok((Stages::new(system, x), Scratch::like(&x.rate)))
    }

    #[inline(always)]
    fn step(
        &self,
        system: &S,
        t: f64,
        x: &StateOf<S>,
        h: f64,
        (m, sum): &mut Self::Memory,
        out: &mut StateOf<S>,
    ) -> Result<(), StepError> {
        let ([v1, v2, v3, v4], [a1, a2, a3, a4]) = (&mut m.velocities, &mut m.accelerations);
        let (mut v1, mut v2, mut v3, mut v4) = (v1.lend(), v2.lend(), v3.lend(), v4.lend());
        let (mut a1, mut a2, mut a3, mut a4) = (a1.lend(), a2.lend(), a3.lend(), a4.lend());
        let (mut stage, mut sum) = (m.stage.lend(), sum.lend());
        let CommutatorFreeTableau { on_vectors: ButcherTableau { nodes, rows, weights }, stages, end } =
            COMMUTATOR_FREE_4;
        system.velocity(&mut m.workspace, t, x, &mut v1);
        system.acceleration(&mut m.workspace, t, x, &mut a1);
        out.assign(x);
        out.drift(&v1, stages[0].factors[0] * h);
        out.kick(&a1, rows[1][0] * h);
        system.velocity(&mut m.workspace, t + nodes[1] * h, out, &mut v2);
        system.acceleration(&mut m.workspace, t + nodes[1] * h, out, &mut a2);
        stage.assign(x);
        stage.drift(&v2, stages[1].factors[1] * h);
        stage.kick(&a2, rows[2][1] * h);
        system.velocity(&mut m.workspace, t + nodes[2] * h, &stage, &mut v3);
        system.acceleration(&mut m.workspace, t + nodes[2] * h, &stage, &mut a3);
        // The fourth stage continues from the second, which `out` holds, with the factor one of v₃.
        stage.configuration.assign(&out.configuration);
        sum.assign(&v3);
        sum.axpy(stages[2].factors[0], &v1);
        stage.drift(&sum, h);
        stage.rate.assign(&x.rate);
        stage.kick(&a3, rows[3][2] * h);
        system.velocity(&mut m.workspace, t + nodes[3] * h, &stage, &mut v4);
        system.acceleration(&mut m.workspace, t + nodes[3] * h, &stage, &mut a4);
        out.assign(x);
        for exponential in end {
            sum.set_zero();
            sum.axpy(exponential.numerators[0], &v1);
            sum.axpy(exponential.numerators[1], &v2);
            sum.axpy(exponential.numerators[2], &v3);
            sum.axpy(exponential.numerators[3], &v4);
            out.drift(&sum, h / exponential.denominator);
        }
        // The first numerator is one.
        a1.axpy(weights.numerators[1], &a2);
        a1.axpy(weights.numerators[2], &a3);
        a1.axpy(weights.numerators[3], &a4);
        out.kick(&a1, h / weights.denominator);
        Ok(())
    }
}
