//! Programs that may be evaluated so often.

use somersault_nlp::{Curvature, EvaluationError, Exhausted, Nlp, Structure};

/// A program with the evaluations that are left of all that a search may make.
pub(crate) struct LimitedEvaluations<'a, N> {
    pub(crate) nlp: &'a mut N,
    pub(crate) left: &'a mut Option<usize>,
}

#[deny(clippy::missing_trait_methods)]
impl<N: Nlp> Nlp for LimitedEvaluations<'_, N> {
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
}
