//! Restoration of feasibility: the same method on the program of least violation near where the search is.
//!
//! ```text
//! minimise  ½ ‖p‖² + ½ ζ ‖D (z − z_R)‖²   subject to   l ≤ c(z) + p ≤ u
//! ```
//! Rows are scaled as in the program, and D is 1 / max(1, |z_R|). The search continues where the violation has shrunk and the
//! filter accepts the point. Where this program is solved first it is solved again without the pull ζ: then a point of locally
//! least violation is found. Squares, not violations themselves, for the reason that the restoration of
//! [`Sqp`](crate::Sqp) gives, and so that both solvers call the same points infeasible.

use super::barrier::{Multipliers, Walls};
use super::system::Role;
use super::{Advance, Failure, InteriorPoint, RESTORATIONS, Run};
use crate::error::SolverError;
use crate::filter::{Filter, Measures};
use crate::nlp::{Bounds, Curvature, EvaluationError, Nlp, NoHessian, Pattern, Structure};
use crate::program::{Point, Program};
use crate::report::{Iteration, KktResiduals, Start, Status};
use crate::sqp::HessianSource;
use somersault_core::cancel::Flow;
use std::cell::RefCell;
use std::time::Instant;

/// ζ over √μ.
const PULL: f64 = 1e-4;
/// Fraction of the violation that may be left.
const REDUCTION: f64 = 0.9;
/// Multipliers of bounds that are kept, at most.
const LARGEST_KEPT: f64 = 1e3;
/// Slope of the sum of squares, relative to the Jacobian and the violation, at which violations count as stationary.
const STATIONARY: f64 = 1e-6;
/// Solves of the program of least violation, each to a finer tolerance, before giving up.
const ROUNDS: i32 = 4;

/// The program of least violation.
struct Nearest<'p, 'a> {
    program: &'p mut Program<'a>,
    structure: Structure,
    curvature: Curvature,
    row_scales: &'p [f64],
    reference: &'p [f64],
    pull: f64,
    /// Values of the program at the z that was evaluated last.
    point: &'p RefCell<Point>,
    jacobian_at: Vec<usize>,
    slack_at: Vec<usize>,
    hessian_at: Vec<usize>,
    diagonal_at: Vec<usize>,
    hessian: Vec<f64>,
    scaled_y: Vec<f64>,
}

impl<'p, 'a> Nearest<'p, 'a> {
    fn new(
        program: &'p mut Program<'a>,
        curvature: Curvature,
        row_scales: &'p [f64],
        reference: &'p [f64],
        pull: f64,
        point: &'p RefCell<Point>,
    ) -> Self {
        let (n, m) = (program.n_variables(), program.n_constraints());
        let Structure { variables, constraints, jacobian, hessian } = &program.structure;
        let mut all = variables.clone();
        let mut rows = Bounds::default();
        for (i, scale) in row_scales.iter().enumerate() {
            rows.push(scale * constraints.lower[i], scale * constraints.upper[i]);
            all.push(f64::NEG_INFINITY, f64::INFINITY);
        }
        let moved = jacobian.entries().map(|(_, i, j)| (i, j)).collect();
        let slacks = (0..m).map(|i| (i, n + i)).collect();
        let (jacobian, [jacobian_at, slack_at]) = Pattern::with_places_of(m, n + m, [moved, slacks]);
        let second = hessian.entries().map(|(_, i, j)| (i, j)).collect();
        let coupled = match (curvature, hessian.n_entries()) {
            // a pattern without entries tells nothing: all variables may be coupled
            (Curvature::None, 0) => (0..n).flat_map(|j| (0..=j).map(move |i| (i, j))).collect(),
            _ => Vec::new(),
        };
        let diagonal = (0..n + m).map(|i| (i, i)).collect();
        let (pattern, [hessian_at, diagonal_at, _]) =
            Pattern::with_places_of(n + m, n + m, [second, diagonal, coupled]);
        Self {
            hessian: vec![0.0; hessian.n_entries()],
            structure: Structure { variables: all, constraints: rows, jacobian, hessian: pattern },
            program,
            curvature,
            row_scales,
            reference,
            pull,
            point,
            jacobian_at,
            slack_at,
            hessian_at,
            diagonal_at,
            scaled_y: vec![0.0; m],
        }
    }

    /// ζ D² of one variable.
    fn pull(&self, i: usize) -> f64 {
        let size = self.reference[i].abs().max(1.0);
        self.pull / (size * size)
    }
}

impl Nlp for Nearest<'_, '_> {
    fn structure(&self) -> &Structure {
        &self.structure
    }

    fn evaluate(&mut self, z: &[f64], constraints: &mut [f64]) -> Result<f64, EvaluationError> {
        let n = self.reference.len();
        let mut point = self.point.borrow_mut();
        point.z.copy_from_slice(&z[..n]);
        self.program.evaluate(&mut point)?;
        for (i, c) in constraints.iter_mut().enumerate() {
            *c = self.row_scales[i] * point.constraints[i] + z[n + i];
        }
        let violation: f64 = z[n..].iter().map(|p| 0.5 * p * p).sum();
        let distance: f64 = (0..n).map(|i| 0.5 * self.pull(i) * (z[i] - self.reference[i]).powi(2)).sum();
        Ok(violation + distance)
    }

    fn differentiate(
        &mut self,
        z: &[f64],
        gradient: &mut [f64],
        jacobian: &mut [f64],
    ) -> Result<(), EvaluationError> {
        let n = self.reference.len();
        let mut point = self.point.borrow_mut();
        point.z.copy_from_slice(&z[..n]);
        self.program.differentiate(&mut point)?;
        for i in 0..n {
            gradient[i] = self.pull(i) * (z[i] - self.reference[i]);
        }
        gradient[n..].copy_from_slice(&z[n..]);
        for ((k, i, _), &at) in self.program.structure.jacobian.entries().zip(&self.jacobian_at) {
            jacobian[at] = self.row_scales[i] * point.jacobian[k];
        }
        self.slack_at.iter().for_each(|&at| jacobian[at] = 1.0);
        Ok(())
    }

    fn curvature(&self) -> Curvature {
        self.curvature
    }

    fn hessian(
        &mut self,
        z: &[f64],
        cost_factor: f64,
        multipliers: &[f64],
        hessian: &mut [f64],
    ) -> Result<(), EvaluationError> {
        if self.curvature == Curvature::None {
            return Err(NoHessian.into());
        }
        let n = self.reference.len();
        for (scaled, (y, scale)) in self.scaled_y.iter_mut().zip(multipliers.iter().zip(self.row_scales)) {
            *scaled = y * scale;
        }
        self.program.hessian(&z[..n], 0.0, &self.scaled_y, &mut self.hessian)?;
        hessian.fill(0.0);
        for (value, &at) in self.hessian.iter().zip(&self.hessian_at) {
            hessian[at] += value;
        }
        for (i, &at) in self.diagonal_at.iter().enumerate() {
            hessian[at] += cost_factor * if i < n { self.pull(i) } else { 1.0 };
        }
        Ok(())
    }
}

/// Why a restoration ended before its program was solved.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Cut {
    /// A point from which the search continues.
    Restored,
    /// The caller's wish.
    Stopped,
}

/// How one solve of the program of least violation ended.
enum Ended {
    Cut(Cut),
    With(Status),
}

impl Run<'_> {
    /// Turns to feasibility, and comes back where there is a point from which the search can continue.
    pub(super) fn restore(
        &mut self,
        began: Instant,
        on_iteration: &mut dyn FnMut(&Iteration<'_>) -> Flow,
    ) -> Result<Advance, Failure> {
        self.restorations += 1;
        if self.is_restoring || self.restorations > RESTORATIONS {
            return Ok(Advance::Ended(Status::Stalled));
        }
        let violation = self.violation(&self.point, &self.w);
        self.filter.add(Measures { violation, cost: self.barrier_cost(&self.point, &self.w) });
        for round in 0..ROUNDS {
            let pull = if round == 0 { PULL * self.mu.sqrt() } else { 0.0 };
            let status = match self.approach(violation, pull, round, began, on_iteration)? {
                Ended::Cut(Cut::Restored) => return Ok(Advance::Stepped { length: 1.0 }),
                Ended::Cut(Cut::Stopped) => return Ok(Advance::Ended(Status::Stopped)),
                Ended::With(status) => status,
            };
            if self.is_feasible() {
                let violation = self.violation(&self.point, &self.w);
                self.filter = Filter::new(violation, 1e4, 1.0);
                return Ok(Advance::Stepped { length: 1.0 });
            }
            match status {
                Status::TimeLimit | Status::EvaluationLimit | Status::IterationLimit => {
                    return Ok(Advance::Ended(status));
                }
                // any other end is tried again without the pull, and proves nothing before that
                Status::Converged
                | Status::Stalled
                | Status::Infeasible
                | Status::Unbounded
                | Status::Undefined
                | Status::Stopped
                | Status::Interrupted
                | Status::Failed => {
                    if pull == 0.0 && self.slope_of_violation() <= STATIONARY {
                        return Ok(Advance::Ended(Status::Infeasible));
                    }
                }
            }
        }
        Ok(Advance::Ended(Status::Stalled))
    }

    /// Solves the program of least violation from where the search is, until there is a point from which it can continue.
    fn approach(
        &mut self,
        before: f64,
        pull: f64,
        round: i32,
        began: Instant,
        on_iteration: &mut dyn FnMut(&Iteration<'_>) -> Flow,
    ) -> Result<Ended, Failure> {
        let (n, m) = (self.point.z.len(), self.row_scales.len());
        let finer = 1e-2f64.powi(round);
        let options = InteriorPoint {
            stationarity_tol: finer * self.options.stationarity_tol,
            complementarity_tol: finer * self.options.complementarity_tol,
            initial_barrier: if round == 0 { self.mu.clamp(1e-4, 0.1) } else { 1e-4 },
            max_iterations: self.options.max_iterations.saturating_sub(self.iterations),
            max_evaluations: None,
            max_time: None,
            cost_floor: f64::NEG_INFINITY,
            ..self.options.clone()
        };
        let constraints = &self.program.structure.constraints;
        let mut z = self.point.z.clone();
        z.extend((0..m).map(|i| {
            let (c, lower, upper) = (self.point.constraints[i], constraints.lower[i], constraints.upper[i]);
            self.row_scales[i] * (c.max(lower).min(upper) - c)
        }));
        let curvature = match self.options.hessian {
            HessianSource::Offered => self.program.curvature(),
            HessianSource::QuasiNewton => Curvature::None,
        };
        let point = RefCell::new(self.point.clone());
        let reference = self.point.z.clone();
        let row_scales = self.row_scales.clone();
        let mut w = vec![0.0; n + m];
        let (mut cut, mut steps) = (None, 0);
        let Self { program, walls, filter, mu, cost_scale, iterations, .. } = self;
        let mut watch = |iteration: &Iteration<'_>| {
            steps = iteration.number;
            if iteration.number == 0 {
                return Flow::Continue;
            }
            let point = point.borrow();
            let shown = Iteration {
                number: *iterations + iteration.number,
                z: &point.z,
                cost: point.cost,
                residuals: KktResiduals::UNKNOWN,
                ..*iteration
            };
            if on_iteration(&shown) == Flow::Stop {
                cut = Some(Cut::Stopped);
                return Flow::Stop;
            }
            let to = measures(walls, &row_scales, *cost_scale, *mu, &point, &mut w);
            if to.violation <= REDUCTION * before && filter.accepts(to) {
                cut = Some(Cut::Restored);
                return Flow::Stop;
            }
            Flow::Continue
        };
        let mut nearest = Nearest::new(program, curvature, &row_scales, &reference, pull, &point);
        let mut nested = Run::new(&options, &mut nearest, &Start::from(z)).map_err(Box::new)?;
        nested.is_restoring = true;
        let outcome = nested.run(&Start::default(), began, &mut watch);
        let z = nested.point.z[..n].to_vec();
        let multipliers: Vec<(f64, f64)> = (0..n).map(|i| (nested.z.lower[i], nested.z.upper[i])).collect();
        let report = match nested.finish(outcome) {
            Ok(report) => report,
            Err(SolverError::Failed { source, .. }) => return Err(source),
            Err(other) => return Err(Box::new(other)),
        };
        self.n_factorisations += report.counts.factorisations;
        self.iterations += steps;
        self.resume(&z, &multipliers)?;
        Ok(cut.map_or(Ended::With(report.status), Ended::Cut))
    }

    /// Slope of half the sum of squared violations where bounds do not hold it, over the largest entry of the Jacobian and
    /// the largest violation.
    fn slope_of_violation(&mut self) -> f64 {
        let Structure { variables, constraints, jacobian, .. } = &self.program.structure;
        let mut largest: f64 = 0.0;
        for (i, y) in self.scaled_y.iter_mut().enumerate() {
            let (c, lower, upper) = (self.point.constraints[i], constraints.lower[i], constraints.upper[i]);
            let scale = self.row_scales[i];
            let beyond = scale * (c - c.max(lower).min(upper));
            largest = largest.max(beyond.abs());
            *y = scale * beyond;
        }
        self.scratch.fill(0.0);
        jacobian.add_transposed_product(&self.point.jacobian, &self.scaled_y, &mut self.scratch);
        let size = jacobian.entries().fold(f64::MIN_POSITIVE, |s, (k, i, _)| {
            s.max((self.row_scales[i] * self.point.jacobian[k]).abs())
        });
        let mut slope: f64 = 0.0;
        for (i, pull) in self.scratch.iter().enumerate() {
            let bound = if *pull > 0.0 { variables.lower[i] } else { variables.upper[i] };
            let relative = pull.abs() / (size * largest.max(f64::MIN_POSITIVE));
            let distance = (self.point.z[i] - bound).abs() / bound.abs().max(1.0);
            slope = slope.max(relative.min(relative * distance));
        }
        slope
    }

    /// Continues from a point, with new slacks and multipliers.
    fn resume(&mut self, z: &[f64], found: &[(f64, f64)]) -> Result<(), Failure> {
        let n = z.len();
        self.trial.z.copy_from_slice(z);
        let evaluated = self.program.evaluate(&mut self.trial);
        match evaluated.and_then(|()| self.program.differentiate(&mut self.trial)) {
            Ok(()) => std::mem::swap(&mut self.point, &mut self.trial),
            Err(EvaluationError::Undefined { .. }) => return Ok(()),
            Err(EvaluationError::Failed(source)) => return Err(source),
        }
        self.w[..n].copy_from_slice(&self.point.z);
        self.set_slacks(true);
        self.z = Multipliers::new(&self.walls, 1.0);
        let largest = found.iter().fold(0.0, |l: f64, (lower, upper)| l.max(*lower).max(*upper));
        if largest <= LARGEST_KEPT {
            for (i, (lower, upper)) in found.iter().enumerate() {
                if self.z.lower[i] > 0.0 && *lower > 0.0 {
                    self.z.lower[i] = *lower;
                }
                if self.z.upper[i] > 0.0 && *upper > 0.0 {
                    self.z.upper[i] = *upper;
                }
            }
        }
        self.z.confine(&self.walls, &self.w, self.mu);
        self.estimate_multipliers();
        self.measure();
        Ok(())
    }
}

/// What the filter of the search sees of a point, with slacks as the search would set them.
fn measures(
    walls: &Walls,
    row_scales: &[f64],
    cost_scale: f64,
    mu: f64,
    point: &Point,
    w: &mut [f64],
) -> Measures {
    let n = point.z.len();
    w[..n].copy_from_slice(&point.z);
    let mut violation = 0.0;
    for (i, scale) in row_scales.iter().enumerate() {
        let c = scale * point.constraints[i];
        w[n + i] = walls.push(n + i, c, true);
        if walls.roles[n + i] != Role::Idle {
            violation += (c - w[n + i]).abs();
        }
    }
    Measures { violation, cost: cost_scale * point.cost + walls.barrier(w, mu) }
}
