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
            Some(exhausted) => Self::Ended(exhausted.status()),
            None => Self::Failed(source),
        }
    }
}

/// The weight of violations from which on a minimum of cost and weighed violation is one of the program: Σ |y|, and one at least.
pub(crate) fn penalty(y: &[f64]) -> f64 {
    y.iter().map(|y| y.abs()).sum::<f64>().max(1.0)
}

/// Cost and weighed violation, which counts as none up to a tolerance.
pub(crate) fn merit(cost: f64, residuals: &KktResiduals, penalty: f64, tolerance: f64) -> f64 {
    let violation = residuals.feasibility;
    // a NaN stays one
    if violation <= tolerance { cost } else { cost + penalty * violation }
}

/// A copy of the best iterate so far.
pub(crate) struct Best {
    z: Vec<f64>,
    y: Vec<f64>,
    y_z: Vec<f64>,
    cost: f64,
    residuals: KktResiduals,
    feasibility_tol: f64,
    /// The largest sum of multipliers so far, which makes f + ρ · violation an exact merit function.
    penalty: f64,
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
            penalty: 0.0,
        }
    }

    /// Takes an iterate of less merit: a start is not the best one because it is feasible.
    pub(crate) fn offer(&mut self, point: &Point, y: &[f64], y_z: &[f64], residuals: KktResiduals) {
        self.penalty = self.penalty.max(penalty(y));
        let merit =
            |cost: f64, residuals: &KktResiduals| merit(cost, residuals, self.penalty, self.feasibility_tol);
        if self.cost.is_nan() || merit(point.cost, &residuals) < merit(self.cost, &self.residuals) {
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
