//! A primal–dual interior-point method with a filter line search (Wächter & Biegler 2006).
//!
//! Rows with an inequality get a slack s, c(z) − s = 0; bounds of variables and slacks are replaced by −μ Σ ln distance, and
//! Newton's method is applied to the conditions of the barrier problem, whose μ falls as it is solved. See [`system`] for the
//! matrix, [`barrier`] for bounds and multipliers, [`line_search`] for what is accepted and corrections of second order,
//! [`restoration`] for where nothing is.

mod barrier;
mod line_search;
mod restoration;
mod system;

use crate::best::{Best, Outcome};
use crate::error::SolverError;
use crate::filter::Filter;
use crate::hessian::Hessian;
use crate::nlp::{Curvature, EvaluationError, Nlp};
use crate::program::{Point, Program, check_positive, max_norm};
use crate::report::{Iteration, KktResiduals, Report, Start, Status};
use crate::solver::NlpSolver;
use crate::sqp::HessianSource;
use barrier::{Multipliers, Walls};
use line_search::Search;
use somersault_core::cancel::Flow;
use std::time::{Duration, Instant};
use system::{Parts, Role, Step, System};

/// A primal–dual interior-point method with a filter line search.
///
/// Its work is one sparse factorisation for each step, whatever bounds are active: for programs with many bounds or
/// inequalities, and for those of tens of thousands of variables. Iterates stay strictly within the bounds of z, and a warm
/// start helps less than with [`Sqp`](crate::Sqp).
///
/// See [the module](super) for the method and references.
#[derive(Debug, Clone, PartialEq)]
pub struct InteriorPoint {
    /// Whose Hessian.
    pub hessian: HessianSource,
    /// Tolerance of [`KktResiduals::stationarity`].
    pub stationarity_tol: f64,
    /// Tolerance of [`KktResiduals::feasibility`].
    pub feasibility_tol: f64,
    /// Tolerance of [`KktResiduals::complementarity`].
    pub complementarity_tol: f64,
    /// The μ of a cold start.
    pub initial_barrier: f64,
    /// Limit of steps.
    pub max_iterations: usize,
    /// Limit of evaluations of cost and constraints.
    pub max_evaluations: Option<usize>,
    /// Limit of time, looked at after each step and before each evaluation, the first excepted.
    pub max_time: Option<Duration>,
    /// A feasible point whose cost is below this proves the program unbounded.
    pub cost_floor: f64,
}

impl Default for InteriorPoint {
    fn default() -> Self {
        Self {
            hessian: HessianSource::Offered,
            stationarity_tol: 1e-8,
            feasibility_tol: 1e-8,
            complementarity_tol: 1e-8,
            initial_barrier: 0.1,
            max_iterations: 1000,
            max_evaluations: None,
            max_time: None,
            cost_floor: -1e15,
        }
    }
}

/// Largest gradient of the cost, or of a row, that is left as it is; larger ones are scaled down to it.
const LARGEST_GRADIENT: f64 = 100.0;
/// μ falls to the lesser of these multiples and powers of itself.
const FALL: f64 = 0.2;
const FALL_POWER: f64 = 1.5;
/// Errors of the barrier problem, in units of μ, at which it counts as solved.
const SOLVED: f64 = 10.0;
/// Least fraction of the way to a bound that a step may go.
const KEPT: f64 = 0.99;
/// Largest multiplier of a row at the start.
const LARGEST_START: f64 = 1e3;
/// δ_c and the power of μ it falls with.
const DUAL_REGULARISATION: f64 = 1e-8;
const DUAL_POWER: f64 = 0.25;
/// Steps without a decrease of the residuals at the least μ before giving up.
const PATIENCE: usize = 15;
/// Attempts to repair a direction that leads nowhere at a feasible point.
const REPAIRS: usize = 4;
/// Restorations of one solve.
const RESTORATIONS: usize = 30;

impl NlpSolver for InteriorPoint {
    fn solve(
        &self,
        nlp: &mut dyn Nlp,
        start: &Start,
        on_iteration: &mut dyn FnMut(&Iteration<'_>) -> Flow,
    ) -> Result<Report, SolverError> {
        check_positive("stationarity_tol", self.stationarity_tol)?;
        check_positive("feasibility_tol", self.feasibility_tol)?;
        check_positive("complementarity_tol", self.complementarity_tol)?;
        check_positive("initial_barrier", self.initial_barrier)?;
        let began = Instant::now();
        let mut run = Run::new(self, nlp, start)?;
        let outcome = run.run(start, began, on_iteration);
        run.finish(outcome)
    }
}

/// State of one solve. Points and what the caller sees are those of the program; everything else is scaled.
struct Run<'a> {
    options: &'a InteriorPoint,
    program: Program<'a>,
    hessian: Hessian,
    system: System,
    walls: Walls,
    /// Of the cost, and of each row.
    cost_scale: f64,
    row_scales: Vec<f64>,
    point: Point,
    trial: Point,
    /// Variables and slacks.
    w: Vec<f64>,
    trial_w: Vec<f64>,
    /// Multipliers of rows and bounds.
    y: Vec<f64>,
    z: Multipliers,
    z_changes: Multipliers,
    mu: f64,
    filter: Filter,
    step: Step,
    /// A step with a correction of second order.
    corrected: Step,
    residuals: KktResiduals,
    /// ‖∇f‖∞ at the start.
    gradient_scale: f64,
    iterations: usize,
    /// Whether this run restores the feasibility of another.
    is_restoring: bool,
    restorations: usize,
    /// Factorisations of restorations.
    n_factorisations: usize,
    best: Best,
    /// Multipliers of the program: of constraints and bounds.
    report_y: Vec<f64>,
    report_z: Vec<f64>,
    scaled_y: Vec<f64>,
    scratch: Vec<f64>,
    curvature: Vec<f64>,
}

type Failure = Box<dyn std::error::Error + Send + Sync>;

enum Advance {
    Stepped { length: f64 },
    Ended(Status),
}

/// Sizes of what the conditions of a barrier problem leave.
struct Errors {
    stationarity: f64,
    violation: f64,
    /// Of stationarity and of complementarity: the mean multiplier, if it is large.
    scales: [f64; 2],
}

impl<'a> Run<'a> {
    fn new(options: &'a InteriorPoint, nlp: &'a mut dyn Nlp, start: &Start) -> Result<Self, SolverError> {
        let mut program = Program::new(nlp)?;
        program.max_evaluations = options.max_evaluations;
        let point = program.start(start)?;
        let (n, m) = (program.n_variables(), program.n_constraints());
        if !start.bound_multipliers.is_empty() {
            crate::program::check_vector("start.bound_multipliers", &start.bound_multipliers, n)?;
        }
        let curvature = match options.hessian {
            HessianSource::Offered => program.curvature(),
            HessianSource::QuasiNewton => Curvature::None,
        };
        let mut hessian = match curvature {
            Curvature::None => Hessian::quasi_newton(&program.structure.hessian),
            Curvature::Exact | Curvature::GaussNewton => Hessian::offered(&program.structure.hessian),
        };
        if let (Some(values), true) = (&start.hessian, hessian.is_quasi_newton()) {
            crate::program::check_vector("start.hessian", values, hessian.values.len())?;
            hessian.restore(values);
        }
        let row_scales = vec![1.0; m];
        let walls = Walls::new(&program.structure, &row_scales);
        let z = Multipliers::new(&walls, 1.0);
        Ok(Self {
            system: System::try_new(&hessian.pattern, &program.structure.jacobian)?,
            best: Best::new(&point, m, options.feasibility_tol),
            z_changes: z.clone(),
            z,
            walls,
            cost_scale: 1.0,
            row_scales,
            trial: point.clone(),
            point,
            w: vec![0.0; n + m],
            trial_w: vec![0.0; n + m],
            y: vec![0.0; m],
            mu: options.initial_barrier,
            filter: Filter::new(0.0, 1.0, 1.0),
            step: Step::new(n, m),
            corrected: Step::new(n, m),
            residuals: KktResiduals::UNKNOWN,
            gradient_scale: 0.0,
            iterations: 0,
            is_restoring: false,
            restorations: 0,
            n_factorisations: 0,
            report_y: vec![0.0; m],
            report_z: vec![0.0; n],
            scaled_y: vec![0.0; m],
            scratch: vec![0.0; n],
            curvature: vec![0.0; n + m],
            options,
            program,
            hessian,
        })
    }

    fn run(
        &mut self,
        start: &Start,
        began: Instant,
        on_iteration: &mut dyn FnMut(&Iteration<'_>) -> Flow,
    ) -> Outcome {
        let is_warm = !start.bound_multipliers.is_empty()
            && (self.y.is_empty() || !start.constraint_multipliers.is_empty());
        for i in 0..self.point.z.len() {
            self.point.z[i] = self.walls.push(i, self.point.z[i], is_warm);
        }
        let evaluated = self.program.evaluate(&mut self.point);
        if let Err(error) = evaluated.and_then(|()| self.program.differentiate(&mut self.point)) {
            return Outcome::at_start(error);
        }
        self.program.limit_time(began, self.options.max_time);
        self.set_out(start, is_warm);
        let mut step_length = 1.0;
        let mut idle = 0;
        let mut least_residual = f64::INFINITY;
        loop {
            self.measure();
            self.best.offer(&self.point, &self.report_y, &self.report_z, self.residuals);
            let flow = on_iteration(&Iteration {
                number: self.iterations,
                z: &self.point.z,
                cost: self.point.cost,
                residuals: self.residuals,
                step_length,
                shift: self.system.shift / self.cost_scale,
            });
            let least = self.least_barrier();
            if self.residuals.max() < 0.9 * least_residual || self.mu > least {
                least_residual = self.residuals.max().min(least_residual);
                idle = 0;
            } else {
                idle += 1;
            }
            if let Some(status) = self.status(flow, began, idle) {
                return self.end(status);
            }
            self.lower_barrier(least);
            let advance = self.refresh().and_then(|()| self.advance(began, on_iteration));
            match advance {
                Ok(Advance::Stepped { length }) => step_length = length,
                Ok(Advance::Ended(status)) => return self.end(status),
                Err(source) => return Outcome::of_failure(source),
            }
            self.iterations += 1;
        }
    }

    /// Scales, slacks, multipliers and μ at the start.
    fn set_out(&mut self, start: &Start, is_warm: bool) {
        let n = self.point.z.len();
        let scale = |largest: f64| (LARGEST_GRADIENT / largest.max(LARGEST_GRADIENT)).max(1e-8);
        self.gradient_scale = max_norm(&self.point.gradient);
        self.cost_scale = scale(self.gradient_scale);
        self.row_scales.fill(0.0);
        for (k, i, _) in self.program.structure.jacobian.entries() {
            self.row_scales[i] = self.row_scales[i].max(self.point.jacobian[k].abs());
        }
        self.row_scales.iter_mut().for_each(|largest| *largest = scale(*largest));
        self.walls = Walls::new(&self.program.structure, &self.row_scales);
        self.z = Multipliers::new(&self.walls, 1.0);
        self.z_changes = self.z.clone();
        self.w[..n].copy_from_slice(&self.point.z);
        self.set_slacks(is_warm);
        if is_warm {
            self.warm(start);
        }
        if start.constraint_multipliers.is_empty() {
            self.estimate_multipliers();
        } else {
            for (i, y) in self.y.iter_mut().enumerate() {
                *y = start.constraint_multipliers[i] * self.cost_scale / self.row_scales[i];
            }
        }
        for (i, y) in self.y.iter_mut().enumerate() {
            if self.walls.roles[n + i] == Role::Idle {
                *y = 0.0;
            }
        }
        let violation = self.violation(&self.point, &self.w);
        self.filter = Filter::new(violation, 1e4, 1.0);
    }

    /// Multipliers of the bounds from the start, and the μ they are nearest to.
    fn warm(&mut self, start: &Start) {
        let n = self.point.z.len();
        for (i, w) in self.w.iter().enumerate() {
            let multiplier = if i < n {
                self.cost_scale * start.bound_multipliers[i]
            } else {
                start
                    .constraint_multipliers
                    .get(i - n)
                    .map_or(0.0, |y| y * self.cost_scale / self.row_scales[i - n])
            };
            let least = |distance: f64| WARM_BARRIER / distance.max(WARM_BARRIER);
            if self.z.lower[i] > 0.0 {
                self.z.lower[i] = (-multiplier).max(least(self.walls.above(i, *w)));
            }
            if self.z.upper[i] > 0.0 {
                self.z.upper[i] = multiplier.max(least(self.walls.below(i, *w)));
            }
        }
        let mean = self.z.mean_complementarity(&self.walls, &self.w).unwrap_or(WARM_BARRIER);
        self.mu = mean.clamp(self.least_barrier(), self.options.initial_barrier);
    }

    fn set_slacks(&mut self, is_warm: bool) {
        let n = self.point.z.len();
        for (i, scale) in self.row_scales.iter().enumerate() {
            self.w[n + i] = self.walls.push(n + i, scale * self.point.constraints[i], is_warm);
        }
    }

    /// Multipliers of the rows by least squares, zero where they would be large.
    fn estimate_multipliers(&mut self) {
        let n = self.point.z.len();
        for i in 0..self.w.len() {
            let gradient = if i < n { self.cost_scale * self.point.gradient[i] } else { 0.0 };
            self.step.slope[i] = gradient - self.z.lower[i] + self.z.upper[i];
        }
        self.step.violation.fill(0.0);
        self.curvature.fill(1.0);
        let parts = Parts {
            hessian: None,
            jacobian: &self.point.jacobian,
            row_scales: &self.row_scales,
            curvature: &self.curvature,
            roles: &self.walls.roles,
            dual_regularisation: DUAL_REGULARISATION,
        };
        let solved = self.system.factor(&parts, 0.0) && self.system.solve(&self.walls.roles, &mut self.step);
        self.y.fill(0.0);
        if solved && max_norm(&self.step.dual) < LARGEST_START {
            self.y.copy_from_slice(&self.step.dual);
        }
    }

    /// The least μ that the tolerances need.
    fn least_barrier(&self) -> f64 {
        self.options.stationarity_tol.min(self.options.complementarity_tol) / (SOLVED + 1.0)
    }

    /// Residuals of the program, unscaled, with the multipliers as they are.
    fn measure(&mut self) {
        let n = self.point.z.len();
        for (i, y) in self.report_y.iter_mut().enumerate() {
            *y = self.y[i] * self.row_scales[i] / self.cost_scale;
        }
        for i in 0..n {
            self.report_z[i] = (self.z.upper[i] - self.z.lower[i]) / self.cost_scale;
        }
        self.scratch.copy_from_slice(&self.point.gradient);
        let jacobian = &self.program.structure.jacobian;
        jacobian.add_transposed_product(&self.point.jacobian, &self.report_y, &mut self.scratch);
        for i in (0..n).filter(|&i| self.walls.roles[i] == Role::Fixed) {
            self.report_z[i] = -self.scratch[i];
        }
        self.residuals = self.program.residuals_of(
            &self.point,
            &self.report_y,
            &self.report_z,
            self.gradient_scale,
            &mut self.scratch,
        );
    }

    fn end(&mut self, status: Status) -> Outcome {
        if matches!(status, Status::Converged | Status::Infeasible) {
            self.best.take(&self.point, &self.report_y, &self.report_z, self.residuals);
        }
        Outcome::Ended(status)
    }

    fn is_feasible(&self) -> bool {
        self.residuals.feasibility <= self.options.feasibility_tol
    }

    fn status(&self, flow: Flow, began: Instant, idle: usize) -> Option<Status> {
        let (options, residuals) = (self.options, &self.residuals);
        if self.is_feasible()
            && residuals.stationarity <= options.stationarity_tol
            && residuals.complementarity <= options.complementarity_tol
        {
            Some(Status::Converged)
        } else if flow == Flow::Stop {
            Some(Status::Stopped)
        } else if self.point.cost < options.cost_floor && self.is_feasible() {
            Some(Status::Unbounded)
        } else if idle >= PATIENCE {
            Some(Status::Stalled)
        } else if self.iterations >= options.max_iterations {
            Some(Status::IterationLimit)
        } else if options.max_time.is_some_and(|limit| began.elapsed() >= limit) {
            Some(Status::TimeLimit)
        } else {
            None
        }
    }

    /// Sum of |c − s| over all rows with bounds.
    fn violation(&self, point: &Point, w: &[f64]) -> f64 {
        let n = point.z.len();
        (0..self.row_scales.len()).map(|i| self.row_violation(point, w[n + i], i).abs()).sum()
    }

    /// c − s of one row.
    fn row_violation(&self, point: &Point, slack: f64, i: usize) -> f64 {
        match self.walls.roles[point.z.len() + i] {
            Role::Moving | Role::Fixed => self.row_scales[i] * point.constraints[i] - slack,
            Role::Idle => 0.0,
        }
    }

    /// The cost of the barrier problem.
    fn barrier_cost(&self, point: &Point, w: &[f64]) -> f64 {
        self.cost_scale * point.cost + self.walls.barrier(w, self.mu)
    }

    /// Errors of the conditions, all but complementarity.
    fn errors(&mut self) -> Errors {
        let n = self.point.z.len();
        self.lagrangian_slope();
        let mut stationarity: f64 = 0.0;
        for i in (0..self.w.len()).filter(|&i| self.walls.roles[i] == Role::Moving) {
            let slope = if i < n { self.scratch[i] } else { -self.y[i - n] };
            stationarity = stationarity.max((slope - self.z.lower[i] + self.z.upper[i]).abs());
        }
        let violation = (0..self.y.len())
            .fold(0.0, |v: f64, i| v.max(self.row_violation(&self.point, self.w[n + i], i).abs()));
        let (sum, count) = self.z.sum(&self.walls);
        let scale = |sum: f64, count: usize| (sum / count.max(1) as f64).max(100.0) / 100.0;
        let all = sum + self.y.iter().map(|y| y.abs()).sum::<f64>();
        Errors { stationarity, violation, scales: [scale(all, count + self.y.len()), scale(sum, count)] }
    }

    /// Leaves ∇f + Jᵀ y, scaled, in `scratch`.
    fn lagrangian_slope(&mut self) {
        for (scaled, (y, scale)) in self.scaled_y.iter_mut().zip(self.y.iter().zip(&self.row_scales)) {
            *scaled = y * scale;
        }
        for (slope, gradient) in self.scratch.iter_mut().zip(&self.point.gradient) {
            *slope = self.cost_scale * gradient;
        }
        let jacobian = &self.program.structure.jacobian;
        jacobian.add_transposed_product(&self.point.jacobian, &self.scaled_y, &mut self.scratch);
    }

    /// Lowers μ as often as its problem is solved, and begins a new filter.
    fn lower_barrier(&mut self, least: f64) {
        let errors = self.errors();
        while self.mu > least {
            let complementarity = self.z.complementarity(&self.walls, &self.w, self.mu);
            let error = (errors.stationarity / errors.scales[0])
                .max(errors.violation)
                .max(complementarity / errors.scales[1]);
            if error > SOLVED * self.mu {
                break;
            }
            self.mu = (FALL * self.mu).min(self.mu.powf(FALL_POWER)).max(least);
            self.filter = Filter::new(self.violation(&self.point, &self.w), 1e4, 1.0);
        }
    }

    /// Asks for the Hessian. Where it has no value the last one stays.
    fn refresh(&mut self) -> Result<(), Failure> {
        for (scaled, (y, scale)) in self.scaled_y.iter_mut().zip(self.y.iter().zip(&self.row_scales)) {
            *scaled = y * scale;
        }
        match self.hessian.refresh(&mut self.program, &self.point.z, self.cost_scale, &self.scaled_y) {
            Ok(()) => Ok(()),
            Err(EvaluationError::Undefined { .. }) if self.iterations > 0 => Ok(()),
            Err(EvaluationError::Undefined { .. }) => {
                self.hessian.reset();
                Ok(())
            }
            Err(EvaluationError::Failed(source)) => Err(source),
        }
    }

    /// One step.
    fn advance(
        &mut self,
        began: Instant,
        on_iteration: &mut dyn FnMut(&Iteration<'_>) -> Flow,
    ) -> Result<Advance, Failure> {
        let mut floor = 0.0;
        for _ in 0..REPAIRS {
            if self.direction(floor)? {
                match self.search()? {
                    Search::Found { length } => {
                        self.accept(length);
                        return Ok(Advance::Stepped { length });
                    }
                    Search::Tiny => {
                        if self.mu > self.least_barrier() {
                            self.mu = (FALL * self.mu).max(self.least_barrier());
                            self.filter = Filter::new(self.violation(&self.point, &self.w), 1e4, 1.0);
                            return Ok(Advance::Stepped { length: 0.0 });
                        }
                        return Ok(Advance::Ended(Status::Stalled));
                    }
                    Search::Refused => {}
                }
            }
            if !self.is_feasible() && !self.y.is_empty() {
                return self.restore(began, on_iteration);
            }
            if self.hessian.is_quasi_newton() {
                self.hessian.reset();
            }
            floor = (100.0 * self.system.shift).max(1e-4 * max_norm(&self.hessian.values)).max(1e-8);
        }
        Ok(Advance::Ended(Status::Stalled))
    }

    /// Newton's step for the barrier problem; false if there is none.
    fn direction(&mut self, floor: f64) -> Result<bool, Failure> {
        let n = self.point.z.len();
        self.lagrangian_slope();
        for i in 0..self.w.len() {
            let slope = if i < n { self.scratch[i] } else { -self.y[i - n] };
            self.step.slope[i] = slope + self.walls.slope(i, self.w[i], self.mu);
            self.curvature[i] = self.z.curvature(&self.walls, i, self.w[i]);
        }
        for i in 0..self.y.len() {
            self.step.violation[i] = self.row_violation(&self.point, self.w[n + i], i);
        }
        let mut floor = floor;
        for _ in 0..REPAIRS {
            let parts = Parts {
                hessian: Some(&self.hessian),
                jacobian: &self.point.jacobian,
                row_scales: &self.row_scales,
                curvature: &self.curvature,
                roles: &self.walls.roles,
                dual_regularisation: DUAL_REGULARISATION * self.mu.powf(DUAL_POWER),
            };
            if !self.system.factor(&parts, floor) {
                return Ok(false);
            }
            if self.system.solve(&self.walls.roles, &mut self.step) {
                return Ok(true);
            }
            floor = (100.0 * self.system.shift).max(1e-8);
        }
        Ok(false)
    }

    /// Moves to the trial point, which is differentiated.
    fn accept(&mut self, length: f64) {
        let n = self.point.z.len();
        let kept = KEPT.max(1.0 - self.mu);
        let Self { z, z_changes, walls, w, step, mu, .. } = self;
        z.advance(walls, w, &step.primal, *mu, kept, z_changes);
        for (y, dy) in self.y.iter_mut().zip(&self.step.dual) {
            *y += length * dy;
        }
        if self.hessian.is_quasi_newton() {
            self.lagrangian_slope();
            for i in 0..n {
                self.trial_w[i] -= self.w[i];
                self.scratch[i] = -(self.scratch[i] - self.cost_scale * self.point.gradient[i])
                    + self.cost_scale * (self.trial.gradient[i] - self.point.gradient[i]);
            }
            let jacobian = &self.program.structure.jacobian;
            jacobian.add_transposed_product(&self.trial.jacobian, &self.scaled_y, &mut self.scratch);
            self.hessian.update(&self.trial_w[..n], &mut self.scratch);
            self.trial_w[..n].copy_from_slice(&self.trial.z);
        }
        std::mem::swap(&mut self.point, &mut self.trial);
        std::mem::swap(&mut self.w, &mut self.trial_w);
        self.z.confine(&self.walls, &self.w, self.mu);
    }

    fn finish(mut self, outcome: Outcome) -> Result<Report, SolverError> {
        self.program.counts.factorisations = self.system.n_factorisations() + self.n_factorisations;
        let hessian = self.hessian.is_quasi_newton().then_some(self.hessian.values);
        self.best.report(outcome, self.iterations, self.program.counts, hessian)
    }
}

/// μ below which a warm start does not begin.
const WARM_BARRIER: f64 = 1e-7;
