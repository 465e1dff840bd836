//! Steepest descent (thesis 2.4.2).

use crate::error::SolverError;
use crate::first_order::{Direction, Limits, descend};
use crate::nlp::Nlp;
use crate::program::{Point, max_norm};
use crate::report::{Iteration, Report, Start};
use crate::solver::NlpSolver;
use somersault_core::cancel::Flow;

/// z ← P(z − α ∇f), α halved from twice its last value until the cost falls enough.
///
/// P moves into the bounds. Linear convergence at a rate that is bad where the Hessian is ill-conditioned: for
/// comparison with the thesis rather than for use.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct GradientDescent {
    /// When to stop.
    pub limits: Limits,
}

impl NlpSolver for GradientDescent {
    fn solve(
        &self,
        nlp: &mut dyn Nlp,
        start: &Start,
        on_iteration: &mut dyn FnMut(&Iteration<'_>) -> Flow,
    ) -> Result<Report, SolverError> {
        descend("gradient descent", &self.limits, &mut Steepest { length: None }, nlp, start, on_iteration)
    }
}

struct Steepest {
    length: Option<f64>,
}

impl Direction for Steepest {
    fn direction(&mut self, point: &Point, free: &[bool], direction: &mut [f64]) -> f64 {
        for (i, d) in direction.iter_mut().enumerate() {
            *d = if free[i] { -point.gradient[i] } else { 0.0 };
        }
        self.length.unwrap_or_else(|| 1.0 / max_norm(direction).max(f64::MIN_POSITIVE))
    }

    fn learn(&mut self, _: &Point, _: &Point, length: f64) {
        self.length = Some(2.0 * length);
    }

    fn forget(&mut self) -> bool {
        self.length.take().is_some()
    }
}
