//! The best iterate of a solve.

use crate::error::SolverError;
use crate::nlp::EvaluationError;
use crate::program::{Exhausted, Point};
use crate::report::{Counts, KktResiduals, Report, Status};
use std::error::Error;

/// How a solve ended.
pub(crate) enum Outcome {
    Ended(Status),
    Failed(Box<dyn Error + Send + Sync>),
}

impl Outcome {
    /// For a program without a value at the start.
    pub(crate) fn at_start(error: EvaluationError) -> Self {
        match error {
            EvaluationError::Undefined { .. } => Self::Ended(Status::Undefined),
            EvaluationError::Failed(source) => Self::of_failure(source),
        }
    }

    /// For an evaluation that failed, or came too late.
    pub(crate) fn of_failure(source: Box<dyn Error + Send + Sync>) -> Self {
        match source.downcast_ref::<Exhausted>() {
            Some(Exhausted::Time) => Self::Ended(Status::TimeLimit),
            Some(Exhausted::Evaluations) => Self::Ended(Status::EvaluationLimit),
            None => Self::Failed(source),
        }
    }
}

/// A copy of the best iterate so far.
pub(crate) struct Best {
    z: Vec<f64>,
    y: Vec<f64>,
    y_z: Vec<f64>,
    cost: f64,
    residuals: KktResiduals,
    feasibility_tol: f64,
}

impl Best {
    pub(crate) fn new(start: &Point, n_constraints: usize, feasibility_tol: f64) -> Self {
        Self {
            z: start.z.clone(),
            y: vec![0.0; n_constraints],
            y_z: vec![0.0; start.z.len()],
            cost: f64::NAN,
            residuals: KktResiduals::UNKNOWN,
            feasibility_tol,
        }
    }

    /// Takes an iterate that is better: feasible before infeasible, then of less cost, or of less violation.
    pub(crate) fn offer(&mut self, point: &Point, y: &[f64], y_z: &[f64], residuals: KktResiduals) {
        let tolerance = self.feasibility_tol;
        let (now, before) = (residuals.feasibility, self.residuals.feasibility);
        let better = match (now <= tolerance, before <= tolerance) {
            (true, true) => point.cost < self.cost,
            (false, false) => before.is_nan() || now < before,
            (feasible, _) => feasible,
        };
        if better {
            self.take(point, y, y_z, residuals);
        }
    }

    /// Takes an iterate.
    pub(crate) fn take(&mut self, point: &Point, y: &[f64], y_z: &[f64], residuals: KktResiduals) {
        self.z.copy_from_slice(&point.z);
        self.y.copy_from_slice(y);
        self.y_z.copy_from_slice(y_z);
        self.cost = point.cost;
        self.residuals = residuals;
    }

    pub(crate) fn report(
        self,
        outcome: Outcome,
        iterations: usize,
        counts: Counts,
        hessian: Option<Vec<f64>>,
    ) -> Result<Report, SolverError> {
        let (status, source) = match outcome {
            Outcome::Ended(status) => (status, None),
            Outcome::Failed(source) => (Status::Failed, Some(source)),
        };
        let report = Report {
            status,
            z: self.z,
            constraint_multipliers: self.y,
            bound_multipliers: self.y_z,
            cost: self.cost,
            residuals: self.residuals,
            iterations,
            counts,
            hessian,
        };
        match source {
            None => Ok(report),
            Some(source) => Err(SolverError::Failed { source, report: Box::new(report) }),
        }
    }
}
