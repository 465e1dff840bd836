//! Crossover: the interior-point method solves the program, and the working set is that of its solution.
//!
//! Where many bounds begin to act at once, exchanging rows of the working set leads nowhere, and each of the quadratic programs
//! that are solved instead takes about as many factorisations as the whole program takes the interior-point method.

use super::{Advance, Failure, Run};
use crate::error::SolverError;
use crate::interior_point::InteriorPoint;
use crate::nlp::EvaluationError;
use crate::report::{Iteration, Start, Status};
use crate::solver::NlpSolver;
use somersault_core::cancel::Flow;
use std::time::Instant;

/// Residuals at which the solution is near enough to tell the working set, where the tolerances are not larger.
const NEAR: f64 = 1e-6;

/// Quadratic programs after which a warm start crosses over too, from where it is then.
pub(super) const FROM_A_WARM_START: usize = 30;

impl Run<'_> {
    /// Moves to the solution of the interior-point method. None if it has none: then the search continues where it is.
    pub(super) fn cross_over(
        &mut self,
        start: &Start,
        on_iteration: &mut dyn FnMut(&Iteration<'_>) -> Flow,
    ) -> Result<Option<Advance>, Failure> {
        let options = self.options;
        let evaluations = self.program.counts.evaluations;
        let interior = InteriorPoint {
            hessian: options.hessian,
            stationarity_tol: options.stationarity_tol.max(NEAR),
            feasibility_tol: options.feasibility_tol.max(NEAR),
            complementarity_tol: options.complementarity_tol.max(NEAR),
            max_iterations: options.max_iterations.saturating_sub(self.iterations),
            max_evaluations: options.max_evaluations.map(|limit| limit.saturating_sub(evaluations)),
            max_time: self
                .program
                .deadline
                .map(|deadline| deadline.saturating_duration_since(Instant::now())),
            cost_floor: options.cost_floor,
            ..InteriorPoint::default()
        };
        let here;
        let start = if start.constraint_multipliers.is_empty() {
            start
        } else {
            here = Start::from(self.point.z.as_slice());
            &here
        };
        let before = self.iterations;
        let mut flow = Flow::Continue;
        let mut numbered = |iteration: &Iteration<'_>| {
            flow = on_iteration(&Iteration { number: before + iteration.number, ..*iteration });
            flow
        };
        let (found, failure) = match interior.solve(self.program.nlp(), start, &mut numbered) {
            Ok(found) => (found, None),
            Err(SolverError::Failed { source, report }) => (*report, Some(source)),
            Err(error) => return Err(error.into()),
        };
        self.iterations += found.iterations;
        self.program.counts += found.counts;
        self.trial.z.copy_from_slice(&found.z);
        self.trial.cost = found.cost;
        self.best.offer(
            &self.trial,
            &found.constraint_multipliers,
            &found.bound_multipliers,
            found.residuals,
        );
        if let Some(source) = failure {
            return Err(source);
        }
        // also where the point is the solution already
        if flow == Flow::Stop {
            return Ok(Some(Advance::Ended(Status::Stopped)));
        }
        match found.status {
            Status::Converged => {}
            Status::Stalled | Status::Infeasible | Status::Undefined | Status::Failed => return Ok(None),
            Status::IterationLimit
            | Status::EvaluationLimit
            | Status::TimeLimit
            | Status::Unbounded
            | Status::Stopped
            | Status::Interrupted => return Ok(Some(Advance::Ended(found.status))),
        }
        match self
            .program
            .evaluate(&mut self.trial)
            .and_then(|()| self.program.differentiate(&mut self.trial))
        {
            Ok(()) => {}
            Err(EvaluationError::Undefined { .. }) => return Ok(None),
            Err(EvaluationError::Failed(source)) => return Err(source),
        }
        std::mem::swap(&mut self.point, &mut self.trial);
        self.y.copy_from_slice(&found.constraint_multipliers);
        self.subproblem.guess_set(&self.point, &self.y);
        self.empty_filter();
        Ok(Some(Advance::Stepped { length: 1.0, decreased: true }))
    }
}
