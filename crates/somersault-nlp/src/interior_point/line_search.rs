//! How far to go along a step: backtracking by the filter, with corrections of second order.

use super::barrier::longest;
use super::{Failure, KEPT, Run};
use crate::filter::Measures;
use crate::nlp::EvaluationError;

/// Fraction of the slope that a step must yield.
const ARMIJO: f64 = 1e-8;
/// Corrections of second order for one step, and the fraction of the violation that each must leave at most.
const CORRECTIONS: usize = 4;
const CORRECTED: f64 = 0.99;
/// Relative length of a step that is rounding.
const TINY: f64 = 10.0 * f64::EPSILON;
/// Safety factor, and margins of the filter, in the least fraction of a step.
const SAFETY: f64 = 0.05;
const MARGIN: f64 = 1e-5;
const SLOPE_POWER: f64 = 2.3;
const VIOLATION_POWER: f64 = 1.1;

/// What a line search ends with.
pub(super) enum Search {
    /// An evaluated and differentiated point in `trial`, at this fraction of the step.
    Found { length: f64 },
    /// The whole step is rounding.
    Tiny,
    /// No fraction is acceptable.
    Refused,
}

impl Run<'_> {
    pub(super) fn search(&mut self) -> Result<Search, Failure> {
        let n = self.point.z.len();
        let from = Measures {
            violation: self.violation(&self.point, &self.w),
            cost: self.barrier_cost(&self.point, &self.w),
        };
        let relative = |(w, dw): (&f64, &f64)| dw.abs() / (1.0 + w.abs());
        let reach = self.w.iter().zip(&self.step.primal).map(relative).fold(0.0, f64::max);
        if reach <= TINY && from.violation <= 1e-4 {
            return Ok(Search::Tiny);
        }
        let mut slope = 0.0;
        for (i, dw) in self.step.primal.iter().enumerate() {
            let gradient = if i < n { self.cost_scale * self.point.gradient[i] } else { 0.0 };
            slope += (gradient + self.walls.slope(i, self.w[i], self.mu)) * dw;
        }
        if !slope.is_finite() {
            return Ok(Search::Refused);
        }
        let slack = 10.0 * f64::EPSILON * from.cost.abs();
        let first = longest(&self.walls, &self.w, &self.step.primal, KEPT.max(1.0 - self.mu));
        let shortest = self.shortest(from.violation, slope).max(TINY / reach.max(TINY));
        let mut length = first;
        while length >= shortest {
            if self.try_step(length, false)? {
                let to = self.measures_of_trial();
                if self.is_enough(from, to, slope, length, slack) && self.differentiate()? {
                    return Ok(self.taken(from, to, slope, length, slack));
                }
                if length == first
                    && to.violation >= from.violation
                    && let Some(found) = self.correct(from, to, slope, first, slack)?
                {
                    return Ok(found);
                }
            }
            length *= 0.5;
        }
        Ok(Search::Refused)
    }

    /// Steps of Newton for the rows as they are at the end of the step, linearised where it begins.
    fn correct(
        &mut self,
        from: Measures,
        first: Measures,
        slope: f64,
        length: f64,
        slack: f64,
    ) -> Result<Option<Search>, Failure> {
        let n = self.point.z.len();
        let mut last = first.violation;
        let mut reached = length;
        self.corrected.slope.copy_from_slice(&self.step.slope);
        self.corrected.violation.copy_from_slice(&self.step.violation);
        for _ in 0..CORRECTIONS {
            for i in 0..self.y.len() {
                self.corrected.violation[i] = reached * self.corrected.violation[i]
                    + self.row_violation(&self.trial, self.trial_w[n + i], i);
            }
            if !self.system.solve(&self.walls.roles, &mut self.corrected) {
                return Ok(None);
            }
            reached = longest(&self.walls, &self.w, &self.corrected.primal, KEPT.max(1.0 - self.mu));
            if !self.try_step(reached, true)? {
                return Ok(None);
            }
            let to = self.measures_of_trial();
            if self.is_enough(from, to, slope, length, slack) && self.differentiate()? {
                std::mem::swap(&mut self.step.primal, &mut self.corrected.primal);
                std::mem::swap(&mut self.step.dual, &mut self.corrected.dual);
                let taken = self.taken(from, to, slope, length, slack);
                return Ok(Some(match taken {
                    Search::Found { .. } => Search::Found { length: reached },
                    other => other,
                }));
            }
            if to.violation > CORRECTED * last {
                return Ok(None);
            }
            last = to.violation;
        }
        Ok(None)
    }

    /// The least fraction of a step that can be acceptable.
    fn shortest(&self, violation: f64, slope: f64) -> f64 {
        let mut least = MARGIN;
        if slope < 0.0 {
            least = least.min(MARGIN * violation / -slope);
            if violation <= self.filter.small {
                least = least.min(violation.powf(VIOLATION_POWER) / (-slope).powf(SLOPE_POWER));
            }
        }
        SAFETY * least
    }

    fn measures_of_trial(&self) -> Measures {
        Measures {
            violation: self.violation(&self.trial, &self.trial_w),
            cost: self.barrier_cost(&self.trial, &self.trial_w),
        }
    }

    fn is_enough(&self, from: Measures, to: Measures, slope: f64, length: f64, slack: f64) -> bool {
        to.cost.is_finite()
            && self.filter.accepts(to)
            && if self.filter.switches(from.violation, slope, length) {
                to.cost <= from.cost + ARMIJO * length * slope + slack
            } else {
                self.filter.improves(from, to, slack)
            }
    }

    /// Gives up the point that is left, unless its cost was what fell.
    fn taken(&mut self, from: Measures, to: Measures, slope: f64, length: f64, slack: f64) -> Search {
        let falls = to.cost <= from.cost + ARMIJO * length * slope + slack;
        if !(self.filter.switches(from.violation, slope, length) && falls) {
            self.filter.add(from);
        }
        Search::Found { length }
    }

    /// Evaluates at a fraction of the step, or of the corrected one; false where there is no value.
    fn try_step(&mut self, length: f64, is_corrected: bool) -> Result<bool, Failure> {
        let n = self.point.z.len();
        let step = if is_corrected { &self.corrected.primal } else { &self.step.primal };
        for (trial, (w, dw)) in self.trial_w.iter_mut().zip(self.w.iter().zip(step)) {
            *trial = w + length * dw;
        }
        self.trial.z.copy_from_slice(&self.trial_w[..n]);
        self.program.project(&mut self.trial.z);
        self.trial_w[..n].copy_from_slice(&self.trial.z);
        if !self.trial_w.iter().all(|w| w.is_finite()) {
            return Ok(false);
        }
        match self.program.evaluate(&mut self.trial) {
            Ok(()) => {
                for (i, scale) in self.row_scales.iter().enumerate() {
                    if self.walls.roles[n + i] == super::Role::Idle {
                        self.trial_w[n + i] = scale * self.trial.constraints[i];
                    }
                }
                Ok(true)
            }
            Err(EvaluationError::Undefined { .. }) => Ok(false),
            Err(EvaluationError::Failed(source)) => Err(source),
        }
    }

    fn differentiate(&mut self) -> Result<bool, Failure> {
        match self.program.differentiate(&mut self.trial) {
            Ok(()) => Ok(true),
            Err(EvaluationError::Undefined { .. }) => Ok(false),
            Err(EvaluationError::Failed(source)) => Err(source),
        }
    }
}
