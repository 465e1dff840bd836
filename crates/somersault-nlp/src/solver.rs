//! What all solvers have in common.

use crate::error::SolverError;
use crate::nlp::Nlp;
use crate::report::{Iteration, Report, Start};
use somersault_core::cancel::Flow;

/// A method that improves a start until it is a solution.
pub trait NlpSolver {
    /// Solves. `on_iteration` sees the start and the point after each step, and may end the solve, whose
    /// report then has the best iterate and [`Status::Stopped`](crate::Status::Stopped).
    ///
    /// Whatever happens to the solve is a [`Status`](crate::Status) in the report. Errors are misuse (lengths, bounds, patterns,
    /// options) and failures of the user's functions, which carry the report in [`SolverError::Failed`].
    fn solve(
        &self,
        nlp: &mut dyn Nlp,
        start: &Start,
        on_iteration: &mut dyn FnMut(&Iteration<'_>) -> Flow,
    ) -> Result<Report, SolverError>;
}

impl<S: NlpSolver + ?Sized> NlpSolver for Box<S> {
    fn solve(
        &self,
        nlp: &mut dyn Nlp,
        start: &Start,
        on_iteration: &mut dyn FnMut(&Iteration<'_>) -> Flow,
    ) -> Result<Report, SolverError> {
        (**self).solve(nlp, start, on_iteration)
    }
}
