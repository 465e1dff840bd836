//! Restoration of feasibility: steps of Levenberg and Marquardt on half the sum of squared violations, within the bounds
//! of z.
//!
//! Squares, not violations themselves: where two constraints pull against each other the sum of violations often has a
//! corner in which it is least and the sum of squares has a slope.

use super::{Advance, Failure, Run};
use crate::report::Status;

/// Fraction of the violation where a restoration began below which it ends.
const ENOUGH: f64 = 0.1;
/// Relative change of the sum of squares that a step promises where it counts as stationary.
const STATIONARY: f64 = 1e-10;
/// Damping relative to the square of the Jacobian, at least.
const LEAST_DAMPING: f64 = 1e-12;
/// Relative decrease of the sum of squares for which a bold step is taken.
const WORTHWHILE: f64 = 1e-6;
/// Fraction of the promise below which a step is refused.
const KEPT: f64 = 1e-4;
/// Refused steps in a row, each four times as damped, before giving up.
const REFUSALS: usize = 40;

/// What a restoration remembers between its steps.
#[derive(Debug, Clone, Copy)]
pub(super) struct Restoration {
    /// Sum of violations where it began.
    began: f64,
    /// Levenberg and Marquardt's term.
    damping: f64,
    /// Square of the largest entry of the Jacobian: a step with this damping promises little only where the sum of squares
    /// has hardly a slope.
    size: f64,
}

/// What a step of some damping is.
enum Attempt {
    /// Not computed, or without a value at its end.
    None,
    /// Of no promise.
    Stationary,
    /// Of a sum of squares at its end, and the fraction of its promise that this keeps.
    Evaluated { after: f64, kept: f64 },
}

impl Run<'_> {
    /// Gives up the point and turns to feasibility alone: where this has been tried before, until it is reached.
    pub(super) fn begin_restoration(&mut self, violation: f64) -> Result<Advance, Failure> {
        let measures = self.measures(&self.point);
        let began = if self.filter.accepts(measures) { violation } else { 0.0 };
        self.filter.add(measures);
        let size = match self.point.jacobian.iter().fold(0.0, |s: f64, j| s.max(j * j)) {
            0.0 => 1.0,
            size => size,
        };
        let restoration = Restoration { began, damping: 1e-4 * size, size };
        self.restoration = Some(restoration);
        self.restore(restoration)
    }

    /// One step towards feasibility.
    pub(super) fn restore(&mut self, mut restoration: Restoration) -> Result<Advance, Failure> {
        let before = self.program.squared_violation(&self.point.constraints);
        for _ in 0..REFUSALS {
            match self.attempt(restoration, before)? {
                Attempt::Evaluated { kept, .. } if kept > KEPT && self.differentiate()? => {
                    if kept > 0.75 {
                        restoration.damping =
                            (0.1 * restoration.damping).max(LEAST_DAMPING * restoration.size);
                    } else if kept < 0.25 {
                        restoration.damping *= 4.0;
                    }
                    return Ok(self.restored(restoration));
                }
                Attempt::Stationary => return self.restore_boldly(restoration, before),
                Attempt::None | Attempt::Evaluated { .. } => restoration.damping *= 4.0,
            }
        }
        Ok(Advance::Ended(Status::Stalled))
    }

    /// Where damped steps promise nothing, a lever may be weak: longer steps, and the end where none removes anything.
    fn restore_boldly(&mut self, mut restoration: Restoration, before: f64) -> Result<Advance, Failure> {
        let most = restoration.damping;
        restoration.damping = LEAST_DAMPING * restoration.size;
        while restoration.damping < most {
            if let Attempt::Evaluated { after, .. } = self.attempt(restoration, before)?
                && before - after > WORTHWHILE * before
                && self.differentiate()?
            {
                return Ok(self.restored(restoration));
            }
            restoration.damping *= 100.0;
        }
        Ok(Advance::Ended(if self.is_feasible() { Status::Stalled } else { Status::Infeasible }))
    }

    /// Leaves the point of a step in `trial`.
    fn attempt(
        &mut self,
        Restoration { damping, size, .. }: Restoration,
        before: f64,
    ) -> Result<Attempt, Failure> {
        let Some(rest) = self.subproblem.restore(&self.point, damping) else { return Ok(Attempt::None) };
        let promise = before - rest.squared_violation;
        // With more damping than that it is as small as the damping is large.
        let undamped = promise * (damping / size).max(1.0);
        if undamped <= STATIONARY * before && rest.is_settled {
            return Ok(Attempt::Stationary);
        }
        self.step.copy_from_slice(&self.subproblem.p);
        if promise <= 0.0 || !self.try_step(1.0)? {
            return Ok(Attempt::None);
        }
        let after = self.program.squared_violation(&self.trial.constraints);
        Ok(Attempt::Evaluated { after, kept: (before - after) / promise })
    }

    /// Moves, and goes back to the program where enough of the violation is gone.
    fn restored(&mut self, restoration: Restoration) -> Advance {
        std::mem::swap(&mut self.point, &mut self.trial);
        let measures = self.measures(&self.point);
        let enough = (ENOUGH * restoration.began).max(self.options.feasibility_tol);
        if measures.violation <= enough && self.filter.accepts(measures) {
            self.restoration = None;
            self.subproblem.estimate_multipliers(&self.point, &mut self.y);
            self.subproblem.guess_set(&self.point, &self.y);
        } else {
            self.restoration = Some(restoration);
            self.y.fill(0.0);
        }
        Advance::Stepped { length: 1.0, decreased: true }
    }
}
