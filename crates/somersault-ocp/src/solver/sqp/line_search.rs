//! How far to go along a step: backtracking on the merit function f + ρ Σ violations.

use super::{Failure, Run};
use crate::nlp::EvaluationError;
use crate::solver::program::{Point, max_norm};
use crate::solver::subproblem::{Origin, Subproblem};

/// Share of the predicted decrease that is enough.
const ARMIJO: f64 = 1e-4;
/// Share of the linearised decrease of the violation that the merit function must promise.
const PROMISE: f64 = 0.3;
/// Times that a penalty may be reduced which the multipliers no longer call for; a bound, so that it settles.
const REDUCTIONS: usize = 10;
/// Relative error that cost and constraints may have.
const ROUNDING: f64 = 1e-9;
/// Fraction of a step below which a larger shift is better, where only residuals tell.
const SHORT: f64 = 0.1;

impl Run<'_> {
    pub(super) fn merit(&self, point: &Point) -> f64 {
        point.cost + self.penalty * self.program.violation(&point.constraints)
    }

    /// Raises the penalty until the step promises a decrease of the merit function, and returns the promise
    /// (Nocedal & Wright 2006, equation 18.36).
    pub(super) fn descent(&mut self, origin: Origin, violation: f64) -> f64 {
        let Subproblem { p, y, shift, curvature, weight, left_violation, .. } = &self.subproblem;
        let slope: f64 = self.point.gradient.iter().zip(p).map(|(g, p)| g * p).sum();
        let curvature = (curvature + shift * p.iter().map(|p| p * p).sum::<f64>()).max(0.0);
        let gain = (violation - left_violation).max(0.0);
        let exact = 2.0 * max_norm(&y[p.len()..]);
        if origin != Origin::Elastic && self.penalty > 10.0 * exact && self.reductions < REDUCTIONS {
            self.penalty = exact;
            self.reductions += 1;
        }
        if gain > 0.0 {
            let mut needed = (slope + 0.5 * curvature) / ((1.0 - PROMISE) * gain);
            if gain < self.options.feasibility_tol {
                // Both are rounding then; what an exact penalty needs is enough.
                needed = needed.min(exact);
            }
            if self.penalty < needed {
                self.penalty = 1.5 * needed;
            }
        }
        if origin == Origin::Elastic {
            self.penalty = self.penalty.max(*weight);
        }
        slope - self.penalty * gain
    }

    /// Leaves an evaluated and differentiated point in `trial` and returns the fraction of the step that leads
    /// there; none if there is no such fraction.
    pub(super) fn search(&mut self, origin: Origin, descent: f64) -> Result<Option<f64>, Failure> {
        let merit = self.merit(&self.point);
        let terms = self.point.cost.abs() + self.penalty * max_norm(&self.point.constraints);
        let slack = 10.0 * f64::EPSILON * terms.max(merit.abs());
        if descent.is_nan() || descent > slack {
            return Ok(None);
        }
        let descent = descent.min(0.0);
        let recent = self.recent.iter().map(|(cost, violation)| cost + self.penalty * violation);
        let reference = recent.fold(merit, f64::max);
        // Where cost and constraints agree in all digits they have, residuals must tell which point is better.
        let rounding = ROUNDING * terms;
        let indistinct = -descent <= rounding;
        self.step.copy_from_slice(&self.subproblem.p);
        let shortest =
            f64::EPSILON * max_norm(&self.point.z).max(1e-8) / max_norm(&self.step).max(f64::MIN_POSITIVE);
        let mut length = 1.0;
        loop {
            let mut next = 0.5 * length;
            if self.try_step(length)? {
                let trial = self.merit(&self.trial);
                let enough = |trial: f64| trial <= reference + ARMIJO * length * descent + slack;
                if indistinct {
                    let less = trial <= merit + ARMIJO * length * descent;
                    if trial - merit <= rounding && self.differentiate()? && (less || self.is_nearer(length))
                    {
                        return Ok(Some(length));
                    }
                    if length < SHORT && !self.hessian.is_definite() {
                        return Ok(None);
                    }
                } else if enough(trial) && self.differentiate()? {
                    return Ok(Some(length));
                }
                if length == 1.0 && origin == Origin::WorkingSet && self.curves_away() {
                    self.step_y.copy_from_slice(&self.subproblem.y);
                    if self.subproblem.correct(&self.point, &self.trial) {
                        self.scratch.copy_from_slice(&self.step);
                        self.step.copy_from_slice(&self.subproblem.p);
                        if self.try_step(1.0)? && enough(self.merit(&self.trial)) && self.differentiate()? {
                            return Ok(Some(1.0));
                        }
                        self.step.copy_from_slice(&self.scratch);
                    }
                    self.subproblem.y.copy_from_slice(&self.step_y);
                }
                if trial.is_finite() && trial > merit {
                    // Minimum of the parabola through both values and the slope.
                    let parabola = -0.5 * descent * length * length / (trial - merit - descent * length);
                    next = parabola.clamp(0.1 * length, 0.5 * length);
                }
            }
            length = next;
            if length < shortest {
                return Ok(None);
            }
        }
    }

    /// Whether the trial point, a fraction of the step away, has smaller residuals.
    fn is_nearer(&mut self, length: f64) -> bool {
        let n = self.point.z.len();
        for (i, y) in self.trial_y.iter_mut().enumerate() {
            *y = self.y[i] + length * (self.subproblem.y[n + i] - self.y[i]);
        }
        let trial =
            self.program.residuals(&self.trial, &self.trial_y, self.gradient_scale, &mut self.scratch);
        trial.max() < self.residuals.max()
    }

    /// Whether the constraints are worse at the trial point than where the step began.
    fn curves_away(&self) -> bool {
        let before = self.program.violation(&self.point.constraints);
        self.program.violation(&self.trial.constraints) > 0.5 * before
    }

    /// Evaluates at a fraction of the step; false where there is no value.
    fn try_step(&mut self, length: f64) -> Result<bool, Failure> {
        for (i, z) in self.trial.z.iter_mut().enumerate() {
            *z = self.point.z[i] + length * self.step[i];
        }
        self.program.project(&mut self.trial.z);
        defined(self.program.evaluate(&mut self.trial))
    }

    fn differentiate(&mut self) -> Result<bool, Failure> {
        defined(self.program.differentiate(&mut self.trial))
    }
}

/// False where the program has no value.
fn defined(result: Result<(), EvaluationError>) -> Result<bool, Failure> {
    match result {
        Ok(()) => Ok(true),
        Err(EvaluationError::Undefined { .. }) => Ok(false),
        Err(EvaluationError::Failed(source)) => Err(source),
    }
}
