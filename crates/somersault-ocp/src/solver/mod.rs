//! Solvers for [nonlinear programs](crate::nlp).

mod best;
mod error;
mod first_order;
mod gradient_descent;
mod hessian;
mod interior_point;
mod kkt;
mod lbfgs;
mod multi_start;
mod program;
mod report;
mod sqp;
mod subproblem;

pub use error::SolverError;
pub use first_order::Limits;
pub use gradient_descent::GradientDescent;
pub use lbfgs::Lbfgs;
pub use multi_start::{Failure, FailureCause, Minimum, MultiStart, MultiStartReport, samples};
pub use report::{Counts, Flow, Iteration, KktResiduals, Report, Start, Status};
pub use sqp::{HessianSource, Sqp};

use crate::nlp::Nlp;
use best::{Best, Outcome};

/// A method that improves a start until it is a solution.
pub trait NlpSolver {
    /// Solves. `on_iteration` sees the start and the point after each step, and may end the solve.
    ///
    /// Whatever happens to the solve is a [`Status`] in the report. Errors are misuse (lengths, bounds, patterns,
    /// options) and failures of the user's functions, which carry the report in [`SolverError::Failed`].
    fn solve(
        &self,
        nlp: &mut dyn Nlp,
        start: &Start,
        on_iteration: &mut dyn FnMut(&Iteration<'_>) -> Flow,
    ) -> Result<Report, SolverError>;
}
