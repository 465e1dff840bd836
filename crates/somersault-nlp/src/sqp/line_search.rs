//! How far to go along a step: backtracking, by the merit function f + ρ Σ violations or by the filter.

use super::{Failure, Globalisation, Run};
use crate::filter::Measures;
use crate::nlp::EvaluationError;
use crate::program::{Point, max_norm};
use crate::subproblem::{Origin, Subproblem};

/// Fraction of the predicted decrease that is enough.
const ARMIJO: f64 = 1e-4;
/// Fraction of the linearised decrease of the violation that the merit function must promise.
const PROMISE: f64 = 0.3;
/// Times that a penalty may be reduced which the multipliers no longer call for; a bound, so that it settles.
const REDUCTIONS: usize = 10;
/// Relative error that cost and constraints may have.
const ROUNDING: f64 = 1e-9;
/// Fraction of a step below which a larger shift is better, where only residuals tell.
const SHORT: f64 = 0.1;
/// Fraction of a step from an infeasible point below which the filter asks for restoration.
const RESTORE: f64 = 1e-3;

/// What is asked of the points along a step.
struct Demand {
    /// Where it begins.
    from: Measures,
    /// Of what falls along it.
    slope: f64,
    /// Rounding of what falls.
    slack: f64,
    /// Difference that may be rounding.
    rounding: f64,
    /// Whether the step promises no more than that.
    is_indistinct: bool,
    /// Fraction below which there is no point.
    shortest: f64,
}

impl Run<'_> {
    /// Raises the penalty until the step promises a decrease of the merit function, and returns the promise
    /// (Nocedal & Wright 2006, equation 18.36).
    fn descent(&mut self, origin: Origin, violation: f64) -> f64 {
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
    pub(super) fn search(&mut self, origin: Origin, violation: f64) -> Result<Option<f64>, Failure> {
        let Some(demand) = self.demand(origin, violation) else { return Ok(None) };
        self.step.copy_from_slice(&self.subproblem.p);
        let mut length = 1.0;
        loop {
            let mut next = 0.5 * length;
            if self.try_step(length)? {
                let trial = self.measures(&self.trial);
                if demand.is_indistinct {
                    if self.is_hardly_worse(&demand, trial)
                        && self.differentiate()?
                        && (self.falls(&demand, trial, length, 0.0) || self.is_nearer(length))
                    {
                        return Ok(Some(length));
                    }
                    if length < SHORT && !self.hessian.is_definite() {
                        return Ok(None);
                    }
                } else if self.is_enough(&demand, trial, length) && self.differentiate()? {
                    return Ok(Some(self.taken(&demand, length)));
                }
                if length == 1.0 && origin == Origin::WorkingSet && self.curves_away(violation, trial) {
                    self.step_y.copy_from_slice(&self.subproblem.y);
                    if self.subproblem.correct(&self.point, &self.trial) {
                        self.scratch.copy_from_slice(&self.step);
                        self.step.copy_from_slice(&self.subproblem.p);
                        if self.try_step(1.0)? {
                            let corrected = self.measures(&self.trial);
                            if self.is_enough(&demand, corrected, 1.0) && self.differentiate()? {
                                return Ok(Some(self.taken(&demand, 1.0)));
                            }
                        }
                        self.step.copy_from_slice(&self.scratch);
                    }
                    self.subproblem.y.copy_from_slice(&self.step_y);
                }
                let rise = self.value(trial) - self.value(demand.from);
                if rise > 0.0 && rise.is_finite() && self.must_fall(&demand, length) {
                    // Minimum of the parabola through both values and the slope.
                    let parabola = -0.5 * demand.slope * length * length / (rise - demand.slope * length);
                    next = parabola.clamp(0.1 * length, 0.5 * length);
                }
            }
            length = next;
            if length < demand.shortest {
                return Ok(None);
            }
        }
    }

    /// What is asked of the points along a step; none if the step is of no use.
    fn demand(&mut self, origin: Origin, violation: f64) -> Option<Demand> {
        let from = Measures { violation, cost: self.point.cost };
        let (slope, terms) = match self.options.globalisation {
            Globalisation::Merit => {
                let slope = self.descent(origin, violation);
                (slope, from.cost.abs() + self.penalty * max_norm(&self.point.constraints))
            }
            Globalisation::Filter => (
                self.point.gradient.iter().zip(&self.subproblem.p).map(|(g, p)| g * p).sum(),
                from.cost.abs(),
            ),
        };
        let slack = 10.0 * f64::EPSILON * terms.max(self.value(from).abs());
        let step = max_norm(&self.subproblem.p).max(f64::MIN_POSITIVE);
        let shortest = f64::EPSILON * max_norm(&self.point.z).max(1e-8) / step;
        // Where cost and constraints agree in all digits they have, residuals must tell which point is better.
        let rounding = ROUNDING * terms;
        match self.options.globalisation {
            Globalisation::Merit => {
                let slope = (slope <= slack).then_some(slope.min(0.0))?;
                Some(Demand { from, slope, slack, rounding, is_indistinct: -slope <= rounding, shortest })
            }
            Globalisation::Filter => {
                let is_feasible = violation <= self.options.feasibility_tol;
                let is_indistinct = is_feasible && slope.abs() <= rounding;
                // Creeping towards feasibility is what the restoration does better.
                let shortest = if is_feasible { shortest } else { shortest.max(RESTORE) };
                let demand = Demand { from, slope, slack, rounding, is_indistinct, shortest };
                slope.is_finite().then_some(demand)
            }
        }
    }

    pub(super) fn measures(&self, point: &Point) -> Measures {
        Measures { violation: self.program.violation(&point.constraints), cost: point.cost }
    }

    /// f + ρ Σ violations.
    pub(super) fn merit(&self, point: Measures) -> f64 {
        point.cost + self.penalty * point.violation
    }

    /// What falls along a step.
    fn value(&self, point: Measures) -> f64 {
        match self.options.globalisation {
            Globalisation::Merit => self.merit(point),
            Globalisation::Filter => point.cost,
        }
    }

    /// Whether enough of the slope is kept.
    fn falls(&self, demand: &Demand, to: Measures, length: f64, slack: f64) -> bool {
        self.value(to) <= self.value(demand.from) + ARMIJO * length * demand.slope + slack
    }

    /// Whether a step of this length has to keep some of the slope.
    fn must_fall(&self, demand: &Demand, length: f64) -> bool {
        match self.options.globalisation {
            Globalisation::Merit => true,
            Globalisation::Filter => self.filter.switches(demand.from.violation, demand.slope, length),
        }
    }

    fn is_enough(&self, demand: &Demand, to: Measures, length: f64) -> bool {
        let is_accepted = match self.options.globalisation {
            Globalisation::Merit => true,
            Globalisation::Filter => self.filter.accepts(to),
        };
        is_accepted
            && if self.must_fall(demand, length) {
                self.falls(demand, to, length, demand.slack)
            } else {
                self.filter.improves(demand.from, to, demand.slack)
            }
    }

    /// Whether a point is worse by rounding at most.
    fn is_hardly_worse(&self, demand: &Demand, to: Measures) -> bool {
        let is_feasible = match self.options.globalisation {
            Globalisation::Merit => true,
            Globalisation::Filter => to.violation <= self.options.feasibility_tol.max(demand.from.violation),
        };
        is_feasible && self.value(to) - self.value(demand.from) <= demand.rounding
    }

    /// Gives up the point that is left, unless its cost was what fell.
    fn taken(&mut self, demand: &Demand, length: f64) -> f64 {
        if !self.must_fall(demand, length) {
            self.filter.add(demand.from);
        }
        length
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

    /// Whether the constraints are so much worse at the end of the step that a correction is worth its cost.
    fn curves_away(&self, before: f64, trial: Measures) -> bool {
        let share = match self.options.globalisation {
            Globalisation::Merit => 0.5,
            Globalisation::Filter => 1.0,
        };
        trial.violation > share * before
    }

    /// Evaluates at a fraction of the step; false where there is no value.
    pub(super) fn try_step(&mut self, length: f64) -> Result<bool, Failure> {
        for (i, z) in self.trial.z.iter_mut().enumerate() {
            *z = self.point.z[i] + length * self.step[i];
        }
        self.program.project(&mut self.trial.z);
        defined(self.program.evaluate(&mut self.trial))
    }

    pub(super) fn differentiate(&mut self) -> Result<bool, Failure> {
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
