//! The problem in the parameters of the cart alone.

use super::CartPendulumProblem;
use super::curvature::Tangents;
use super::passes::{Passes, finite, half_squares};
use crate::error::OcpError;
use somersault_nlp::{Bounds, Curvature, EvaluationError, Nlp, Pattern, Structure};

/// The problem of a [`CartPendulumProblem`] by single shooting: the parameters of the cart are its variables, and it has
/// neither bounds nor constraints. Its Hessian is exact.
///
/// This is the cost that a motion has, and what first-order methods take. [`SwingUp`](super::SwingUp) has the same minima
/// and is solved in a fraction of the steps.
#[derive(Debug, Clone)]
pub struct SingleShooting {
    passes: Passes,
    structure: Structure,
    tangents: Tangents,
    end: [f64; 2],
}

impl SingleShooting {
    pub(super) fn try_new(problem: &CartPendulumProblem) -> Result<Self, OcpError> {
        let passes = Passes::try_new(problem)?;
        let n = passes.tables.motion.n_parameters();
        let structure = Structure {
            variables: Bounds::free(n),
            constraints: Bounds::default(),
            jacobian: Pattern::dense(0, n),
            hessian: Pattern::upper_triangle(n),
        };
        Ok(Self { passes, structure, tangents: Tangents::new(n), end: [0.0; 2] })
    }
}

impl Nlp for SingleShooting {
    fn structure(&self) -> &Structure {
        &self.structure
    }

    fn evaluate(&mut self, z: &[f64], _constraints: &mut [f64]) -> Result<f64, EvaluationError> {
        let passes = &mut self.passes;
        passes.set_cart(z);
        let (cost, end) = passes.forward(0..passes.n_steps, passes.first_state());
        self.end = end;
        finite(cost + half_squares(&passes.terminal_weights, &passes.apart(passes.n_steps, end)))
    }

    fn differentiate(
        &mut self,
        _z: &[f64],
        gradient: &mut [f64],
        _jacobian: &mut [f64],
    ) -> Result<(), EvaluationError> {
        let passes = &mut self.passes;
        let n_steps = passes.n_steps;
        let apart = passes.apart(n_steps, self.end);
        passes.by_coefficients.fill(0.0);
        let by_end =
            passes.pull_state(n_steps, std::array::from_fn(|i| passes.terminal_weights[i] * apart[i]));
        passes.backward(0..n_steps, by_end, 1.0);
        gradient.fill(0.0);
        passes.tables.motion.pull_back(&passes.by_coefficients, gradient);
        Ok(())
    }

    fn curvature(&self) -> Curvature {
        Curvature::Exact
    }

    fn hessian(
        &mut self,
        _z: &[f64],
        cost_factor: f64,
        _multipliers: &[f64],
        hessian: &mut [f64],
    ) -> Result<(), EvaluationError> {
        let (passes, n) = (&self.passes, self.structure.variables.len());
        passes.curvature(0..passes.n_steps, 0..n, false, 1.0, &mut self.tangents, hessian);
        self.tangents.add_distance(passes.terminal_weights, 1.0, n, hessian);
        hessian.iter_mut().for_each(|h| *h *= cost_factor);
        Ok(())
    }
}
