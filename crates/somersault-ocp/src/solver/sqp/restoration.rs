//! Restoration of feasibility: steps of Levenberg and Marquardt on half the sum of squared violations, within the bounds
//! of z.
//!
//! Squares, not violations themselves: where two constraints pull against each other the sum of violations often has a
//! corner in which it is least and the sum of squares has a slope.

use super::{Advance, Failure, Run};
use crate::solver::report::Status;

/// Share of the violation where a restoration began below which it ends.
const ENOUGH: f64 = 0.1;
/// Relative change of the sum of squares that a step promises where it counts as stationary.
const STATIONARY: f64 = 1e-10;
/// Share of the promise below which a step is refused.
const KEPT: f64 = 1e-4;
/// Refused steps in a row, each four times as damped, before giving up.
const REFUSALS: usize = 40;

/// What a restoration remembers between its steps.
#[derive(Debug, Clone, Copy)]
pub(super) struct Restoration {
    /// Sum of violations where it began.
    began: f64,
    /// Levenberg and Marquardt's term, and the least it may become.
    damping: f64,
    least_damping: f64,
}

impl Run<'_> {
    /// Gives up the point and turns to feasibility alone. Where this has been tried before, the violation is least.
    pub(super) fn begin_restoration(&mut self, violation: f64) -> Result<Advance, Failure> {
        let measures = self.measures(&self.point);
        if !self.filter.accepts(measures) {
            return Ok(Advance::Ended(Status::Infeasible));
        }
        self.filter.add(measures);
        let size = self.point.jacobian.iter().fold(0.0, |s: f64, j| s.max(j * j));
        self.restore(Restoration { began: violation, damping: 1e-4 * size, least_damping: 1e-12 * size })
    }

    /// One step towards feasibility.
    pub(super) fn restore(&mut self, mut restoration: Restoration) -> Result<Advance, Failure> {
        let before = self.program.squared_violation(&self.point.constraints);
        for refusals in 0..REFUSALS {
            if let Some(rest) = self.subproblem.restore(&self.point, restoration.damping) {
                let promise = before - rest.squared_violation;
                // A promise is small as well where much damping had to be added.
                if refusals == 0 && promise <= STATIONARY * before && rest.is_settled {
                    return Ok(Advance::Ended(Status::Infeasible));
                }
                self.step.copy_from_slice(&self.subproblem.p);
                if promise > 0.0 && self.try_step(1.0)? {
                    let after = self.program.squared_violation(&self.trial.constraints);
                    let kept = (before - after) / promise;
                    if kept > KEPT && self.differentiate()? {
                        if kept > 0.75 {
                            restoration.damping = (0.1 * restoration.damping).max(restoration.least_damping);
                        } else if kept < 0.25 {
                            restoration.damping *= 4.0;
                        }
                        return Ok(self.restored(restoration));
                    }
                }
            }
            restoration.damping *= 4.0;
        }
        Ok(Advance::Ended(Status::Stalled))
    }

    /// Moves, and goes back to the program where enough of the violation is gone.
    fn restored(&mut self, restoration: Restoration) -> Advance {
        std::mem::swap(&mut self.point, &mut self.trial);
        let measures = self.measures(&self.point);
        if measures.violation <= ENOUGH * restoration.began && self.filter.accepts(measures) {
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
