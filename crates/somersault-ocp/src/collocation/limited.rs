//! Programs that may be evaluated so often and for so long.

use somersault_core::cancel::CancellationToken;
use somersault_nlp::{Curvature, EvaluationError, Exhausted, Nlp, Structure};
use std::time::Instant;

/// A program with the evaluations that are left of all that a search may make, and the end of its time.
pub(crate) struct Limited<'a, N> {
    pub(crate) nlp: &'a mut N,
    pub(crate) left: &'a mut Option<usize>,
    pub(crate) token: &'a CancellationToken,
}

#[deny(clippy::missing_trait_methods)]
impl<N: Nlp> Nlp for Limited<'_, N> {
    fn structure(&self) -> &Structure {
        self.nlp.structure()
    }

    fn evaluate(&mut self, z: &[f64], constraints: &mut [f64]) -> Result<f64, EvaluationError> {
        match self.left {
            Some(0) => return Err(Exhausted::Evaluations.into()),
            Some(left) => *left -= 1,
            None => {}
        }
        self.nlp.evaluate(z, constraints)
    }

    fn differentiate(
        &mut self,
        z: &[f64],
        gradient: &mut [f64],
        jacobian: &mut [f64],
    ) -> Result<(), EvaluationError> {
        self.nlp.differentiate(z, gradient, jacobian)
    }

    fn curvature(&self) -> Curvature {
        self.nlp.curvature()
    }

    fn hessian(
        &mut self,
        z: &[f64],
        cost_factor: f64,
        multipliers: &[f64],
        hessian: &mut [f64],
    ) -> Result<(), EvaluationError> {
        self.nlp.hessian(z, cost_factor, multipliers, hessian)
    }

    fn deadline(&self) -> Option<Instant> {
        self.nlp.deadline().into_iter().chain(self.token.deadline()).min()
    }
}
