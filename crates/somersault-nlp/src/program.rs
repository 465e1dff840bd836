//! A program as solvers see it: validated, counted, and with values that are finite.

use crate::error::SolverError;
use crate::nlp::{Bounds, EvaluationError, Nlp, Pattern, Structure};
use crate::report::{Counts, KktResiduals, Start, Status};
use std::time::{Duration, Instant};

/// A validated program that counts its evaluations and refuses values that are not finite.
pub(crate) struct Program<'a> {
    nlp: &'a mut dyn Nlp,
    pub(crate) structure: Structure,
    pub(crate) counts: Counts,
    /// After which there is no more evaluation.
    pub(crate) deadline: Option<Instant>,
    /// Evaluations of cost and constraints after which there is no more.
    pub(crate) max_evaluations: Option<usize>,
}

/// Why a program is not evaluated any more. In [`EvaluationError::Failed`] it ends a solve with the status of that reason, not with
/// an error.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum Exhausted {
    /// There is no time left.
    #[error("the limit of time was reached")]
    Time,
    /// There are no evaluations left.
    #[error("the limit of evaluations was reached")]
    Evaluations,
    /// It was asked to end.
    #[error("interrupted")]
    Interrupted,
}

impl Exhausted {
    /// How a solve ends by it.
    pub fn status(self) -> Status {
        match self {
            Self::Time => Status::TimeLimit,
            Self::Evaluations => Status::EvaluationLimit,
            Self::Interrupted => Status::Interrupted,
        }
    }
}

impl From<Exhausted> for EvaluationError {
    fn from(exhausted: Exhausted) -> Self {
        Self::Failed(Box::new(exhausted))
    }
}

/// Values at one z.
#[derive(Debug, Clone, Default)]
pub(crate) struct Point {
    pub(crate) z: Vec<f64>,
    pub(crate) cost: f64,
    pub(crate) constraints: Vec<f64>,
    pub(crate) gradient: Vec<f64>,
    pub(crate) jacobian: Vec<f64>,
}

/// Whether there is a deadline, and it is over.
pub(crate) fn is_past(deadline: Option<Instant>) -> bool {
    deadline.is_some_and(|deadline| Instant::now() >= deadline)
}

impl<'a> Program<'a> {
    /// Fails if bounds or patterns are contradictory.
    pub(crate) fn new(nlp: &'a mut dyn Nlp) -> Result<Self, SolverError> {
        let structure = nlp.structure().clone();
        let (n, m) = (structure.variables.lower.len(), structure.constraints.lower.len());
        check_bounds("variables", &structure.variables)?;
        check_bounds("constraints", &structure.constraints)?;
        check_pattern("jacobian", &structure.jacobian, m, n, false)?;
        check_pattern("hessian", &structure.hessian, n, n, true)?;
        Ok(Self { nlp, structure, counts: Counts::default(), deadline: None, max_evaluations: None })
    }

    /// The program itself, for another solver.
    pub(crate) fn nlp(&mut self) -> &mut dyn Nlp {
        self.nlp
    }

    pub(crate) fn n_variables(&self) -> usize {
        self.structure.variables.len()
    }

    pub(crate) fn n_constraints(&self) -> usize {
        self.structure.constraints.len()
    }

    pub(crate) fn curvature(&self) -> crate::nlp::Curvature {
        self.nlp.curvature()
    }

    /// The start, moved within the bounds.
    pub(crate) fn start(&self, start: &Start) -> Result<Point, SolverError> {
        let (n, m) = (self.n_variables(), self.n_constraints());
        check_vector("start.z", &start.z, n)?;
        if !start.constraint_multipliers.is_empty() {
            check_vector("start.constraint_multipliers", &start.constraint_multipliers, m)?;
        }
        let mut z = start.z.clone();
        self.project(&mut z);
        Ok(Point {
            z,
            cost: f64::NAN,
            constraints: vec![f64::NAN; m],
            gradient: vec![f64::NAN; n],
            jacobian: vec![f64::NAN; self.structure.jacobian.n_entries()],
        })
    }

    /// Moves z to the nearest point within its bounds.
    pub(crate) fn project(&self, z: &mut [f64]) {
        let bounds = &self.structure.variables;
        for (i, z) in z.iter_mut().enumerate() {
            *z = z.max(bounds.lower[i]).min(bounds.upper[i]);
        }
    }

    /// Limits the time of a solver that began then, by its own limit and by that of the program.
    pub(crate) fn limit_time(&mut self, began: Instant, limit: Option<Duration>) {
        let own = limit.and_then(|limit| began.checked_add(limit));
        self.deadline = own.into_iter().chain(self.nlp.deadline()).min();
    }

    pub(crate) fn is_late(&self) -> bool {
        is_past(self.deadline)
    }

    fn expect_in_time(&self) -> Result<(), EvaluationError> {
        if self.is_late() { Err(Exhausted::Time.into()) } else { Ok(()) }
    }

    /// Cost and constraints at `point.z`.
    pub(crate) fn evaluate(&mut self, point: &mut Point) -> Result<(), EvaluationError> {
        self.expect_in_time()?;
        if self.max_evaluations.is_some_and(|limit| self.counts.evaluations >= limit) {
            return Err(Exhausted::Evaluations.into());
        }
        let found = self.nlp.evaluate(&point.z, &mut point.constraints);
        let is_refused = matches!(&found, Err(EvaluationError::Failed(source)) if source.is::<Exhausted>());
        self.counts.evaluations += usize::from(!is_refused);
        point.cost = found?;
        finite("the cost", std::slice::from_ref(&point.cost))?;
        finite("a constraint", &point.constraints)
    }

    /// First derivatives at `point.z`, which has just been evaluated.
    pub(crate) fn differentiate(&mut self, point: &mut Point) -> Result<(), EvaluationError> {
        self.expect_in_time()?;
        self.counts.gradients += 1;
        self.nlp.differentiate(&point.z, &mut point.gradient, &mut point.jacobian)?;
        finite("the gradient of the cost", &point.gradient)?;
        finite("the Jacobian of the constraints", &point.jacobian)
    }

    /// Hessian of σ f + yᵀ c at z, which has just been differentiated.
    pub(crate) fn hessian(
        &mut self,
        z: &[f64],
        cost_factor: f64,
        y: &[f64],
        out: &mut [f64],
    ) -> Result<(), EvaluationError> {
        self.expect_in_time()?;
        self.counts.hessians += 1;
        self.nlp.hessian(z, cost_factor, y, out)?;
        finite("the Hessian of the Lagrangian", out)
    }

    /// Sum of the violations of the constraints (not of the bounds, which iterates keep).
    pub(crate) fn violation(&self, constraints: &[f64]) -> f64 {
        let bounds = &self.structure.constraints;
        (0..constraints.len())
            .map(|i| (bounds.lower[i] - constraints[i]).max(constraints[i] - bounds.upper[i]).max(0.0))
            .sum()
    }

    /// Half the sum of the squared violations of the constraints.
    pub(crate) fn squared_violation(&self, constraints: &[f64]) -> f64 {
        let bounds = &self.structure.constraints;
        let violation =
            |i: usize| (bounds.lower[i] - constraints[i]).max(constraints[i] - bounds.upper[i]).max(0.0);
        (0..constraints.len()).map(|i| 0.5 * violation(i) * violation(i)).sum()
    }

    /// Residuals at a point with multipliers y and y_z, whatever made them. A multiplier whose bound is not there counts
    /// as if that were at distance 1.
    pub(crate) fn residuals_of(
        &self,
        point: &Point,
        y: &[f64],
        y_z: &[f64],
        gradient_scale: f64,
        slope: &mut [f64],
    ) -> KktResiduals {
        let Structure { variables, constraints, jacobian, .. } = &self.structure;
        slope.copy_from_slice(&point.gradient);
        jacobian.add_transposed_product(&point.jacobian, y, slope);
        let mut residuals = KktResiduals::default();
        for (slope, y_z) in slope.iter().zip(y_z) {
            residuals.stationarity = residuals.stationarity.max((slope + y_z).abs());
        }
        let rows = [(variables, &point.z[..], y_z), (constraints, &point.constraints[..], y)];
        for (bounds, values, multipliers) in rows {
            for (i, (&value, &multiplier)) in values.iter().zip(multipliers).enumerate() {
                let (lower, upper) = (bounds.lower[i], bounds.upper[i]);
                residuals.feasibility = residuals
                    .feasibility
                    .max((lower - value) / lower.abs().max(1.0))
                    .max((value - upper) / upper.abs().max(1.0));
                if lower == upper || multiplier == 0.0 {
                    continue;
                }
                let bound = if multiplier > 0.0 { upper } else { lower };
                let distance = if bound.is_finite() { (value - bound).abs() } else { 1.0 };
                residuals.complementarity = residuals.complementarity.max(multiplier.abs() * distance);
            }
        }
        let scale = residual_scale(gradient_scale, y, y_z);
        residuals.stationarity /= scale;
        residuals.complementarity /= scale;
        residuals
    }

    /// Residuals at a point with multipliers y; writes the multipliers of the bounds. `gradient_scale` is
    /// ‖∇f(z₀)‖∞.
    pub(crate) fn residuals(
        &self,
        point: &Point,
        y: &[f64],
        gradient_scale: f64,
        bound_multipliers: &mut [f64],
    ) -> KktResiduals {
        let Structure { variables, constraints, jacobian, .. } = &self.structure;
        bound_multipliers.copy_from_slice(&point.gradient);
        jacobian.add_transposed_product(&point.jacobian, y, bound_multipliers);
        let mut residuals = KktResiduals::default();
        for (i, slope) in bound_multipliers.iter_mut().enumerate() {
            // A bound that is nearer than its multiplier is large holds the variable.
            let bound = if *slope > 0.0 { variables.lower[i] } else { variables.upper[i] };
            let distance = (point.z[i] - bound).abs();
            if distance < slope.abs() {
                residuals.complementarity = residuals.complementarity.max(slope.abs() * distance);
                *slope = -*slope;
            } else {
                residuals.stationarity = residuals.stationarity.max(slope.abs());
                *slope = 0.0;
            }
        }
        for (i, (&c, &y)) in point.constraints.iter().zip(y).enumerate() {
            let (lower, upper) = (constraints.lower[i], constraints.upper[i]);
            residuals.feasibility = residuals
                .feasibility
                .max((lower - c) / lower.abs().max(1.0))
                .max((c - upper) / upper.abs().max(1.0));
            if lower == upper || y == 0.0 {
                continue;
            }
            let bound = if y > 0.0 { upper } else { lower };
            let distance = if bound.is_finite() { (c - bound).abs() } else { 1.0 };
            residuals.complementarity = residuals.complementarity.max(y.abs() * distance);
        }
        let scale = residual_scale(gradient_scale, y, bound_multipliers);
        residuals.stationarity /= scale;
        residuals.complementarity /= scale;
        residuals
    }
}

/// The s of [`KktResiduals`].
fn residual_scale(gradient_scale: f64, y: &[f64], y_z: &[f64]) -> f64 {
    let sum: f64 = y.iter().chain(y_z.iter()).map(|y| y.abs()).sum();
    let mean = sum / (y.len() + y_z.len()).max(1) as f64;
    gradient_scale.max(mean).max(100.0) / 100.0
}

/// Largest absolute value.
pub(crate) fn max_norm(x: &[f64]) -> f64 {
    x.iter().fold(0.0, |m: f64, x| m.max(x.abs()))
}

fn finite(what: &str, values: &[f64]) -> Result<(), EvaluationError> {
    if values.iter().all(|v| v.is_finite()) {
        Ok(())
    } else {
        Err(EvaluationError::Undefined { what: what.into() })
    }
}

/// Fails unless a vector has `allowed` finite entries.
pub(crate) fn check_vector(argument: &'static str, x: &[f64], allowed: usize) -> Result<(), SolverError> {
    if x.len() != allowed {
        return Err(SolverError::Length { argument, found: x.len(), allowed });
    }
    match x.iter().position(|x| !x.is_finite()) {
        Some(index) => Err(SolverError::NotFinite { argument, index, found: x[index] }),
        None => Ok(()),
    }
}

/// Fails unless an option is positive and finite.
pub(crate) fn check_positive(argument: &'static str, found: f64) -> Result<(), SolverError> {
    if found > 0.0 && found.is_finite() {
        Ok(())
    } else {
        Err(SolverError::Setting { argument, found, allowed: "a positive finite number" })
    }
}

/// Fails where a pair of bounds has nothing between.
pub(crate) fn check_bounds(argument: &'static str, bounds: &Bounds) -> Result<(), SolverError> {
    if bounds.upper.len() != bounds.lower.len() {
        return Err(SolverError::Length { argument, found: bounds.upper.len(), allowed: bounds.lower.len() });
    }
    for (index, (&lower, &upper)) in bounds.lower.iter().zip(&bounds.upper).enumerate() {
        let sensible = lower <= upper && lower < f64::INFINITY && upper > f64::NEG_INFINITY;
        if !sensible {
            return Err(SolverError::Bounds { argument, index, lower, upper });
        }
    }
    Ok(())
}

fn check_pattern(
    argument: &'static str,
    pattern: &Pattern,
    n_rows: usize,
    n_columns: usize,
    upper: bool,
) -> Result<(), SolverError> {
    let fail = |found: String| Err(SolverError::Pattern { argument, found, n_rows, n_columns, upper });
    let Pattern { columns, rows, .. } = pattern;
    if pattern.n_rows != n_rows || columns.len() != n_columns + 1 {
        return fail(format!("is {} × {}", pattern.n_rows, columns.len().saturating_sub(1)));
    }
    if columns[0] != 0 || columns[n_columns] != rows.len() || columns.windows(2).any(|c| c[0] > c[1]) {
        return fail("has columns that do not partition its entries".into());
    }
    for j in 0..n_columns {
        let column = &rows[columns[j]..columns[j + 1]];
        let end = if upper { j + 1 } else { n_rows };
        if column.windows(2).any(|r| r[0] >= r[1]) || column.last().is_some_and(|&r| r >= end) {
            return fail(format!("has rows {column:?} in column {j}"));
        }
    }
    Ok(())
}
