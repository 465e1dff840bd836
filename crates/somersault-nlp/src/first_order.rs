//! What solvers from gradients alone share: a program without constraints but bounds, and the descent along the
//! projected path.

use crate::best::{Best, Outcome};
use crate::error::SolverError;
use crate::nlp::{EvaluationError, Nlp};
use crate::program::{Point, Program, check_positive, max_norm};
use crate::report::{Counts, Iteration, KktResiduals, Report, Start, Status};
use somersault_core::cancel::Flow;
use std::time::{Duration, Instant};

/// When a solver from gradients alone stops.
#[derive(Debug, Clone, PartialEq)]
pub struct Limits {
    /// Tolerance of [`KktResiduals::stationarity`] and [`KktResiduals::complementarity`].
    pub stationarity_tol: f64,
    /// Limit of steps.
    pub max_iterations: usize,
    /// Limit of evaluations of the cost.
    pub max_evaluations: Option<usize>,
    /// Limit of time, looked at after each step and before each evaluation, the first excepted.
    pub max_time: Option<Duration>,
    /// A cost below this proves the program unbounded.
    pub cost_floor: f64,
}

impl Default for Limits {
    fn default() -> Self {
        Self {
            stationarity_tol: 1e-6,
            max_iterations: 10_000,
            max_evaluations: None,
            max_time: None,
            cost_floor: -1e15,
        }
    }
}

/// How a direction and the first length along it come about.
pub(crate) trait Direction {
    /// Writes a direction of descent for the free variables and returns the length to try first. `free` tells
    /// which variables a bound does not hold.
    fn direction(&mut self, point: &Point, free: &[bool], direction: &mut [f64]) -> f64;
    /// Learns the step to `next`.
    fn learn(&mut self, point: &Point, next: &Point, length: f64);
    /// Forgets all; false if there was nothing to forget.
    fn forget(&mut self) -> bool;
}

/// Fraction of the slope that a step must yield.
const ARMIJO: f64 = 1e-4;

/// Descends until the projected gradient vanishes.
pub(crate) fn descend(
    name: &'static str,
    limits: &Limits,
    method: &mut dyn Direction,
    nlp: &mut dyn Nlp,
    start: &Start,
    on_iteration: &mut dyn FnMut(&Iteration<'_>) -> Flow,
) -> Result<Report, SolverError> {
    check_positive("stationarity_tol", limits.stationarity_tol)?;
    let mut program = Program::new(nlp)?;
    program.max_evaluations = limits.max_evaluations;
    if program.n_constraints() > 0 {
        return Err(SolverError::Constrained { solver: name, found: program.n_constraints() });
    }
    let point = program.start(start)?;
    let n = point.z.len();
    let mut run = Run {
        best: Best::new(&point, 0, 0.0),
        trial: point.clone(),
        point,
        program,
        limits,
        began: Instant::now(),
        residuals: KktResiduals::UNKNOWN,
        y_z: vec![0.0; n],
        free: vec![true; n],
        direction: vec![0.0; n],
        iterations: 0,
    };
    let outcome = run.run(method, on_iteration);
    let counts = Counts { ..run.program.counts };
    run.best.report(outcome, run.iterations, counts, None)
}

struct Run<'a> {
    program: Program<'a>,
    limits: &'a Limits,
    began: Instant,
    point: Point,
    trial: Point,
    best: Best,
    residuals: KktResiduals,
    y_z: Vec<f64>,
    free: Vec<bool>,
    direction: Vec<f64>,
    iterations: usize,
}

impl Run<'_> {
    fn run(
        &mut self,
        method: &mut dyn Direction,
        on_iteration: &mut dyn FnMut(&Iteration<'_>) -> Flow,
    ) -> Outcome {
        let evaluated = self.program.evaluate(&mut self.point);
        if let Err(error) = evaluated.and_then(|()| self.program.differentiate(&mut self.point)) {
            return Outcome::at_start(error);
        }
        self.program.limit_time(self.began, self.limits.max_time);
        let gradient_scale = max_norm(&self.point.gradient);
        let mut step_length = 1.0;
        loop {
            self.residuals = self.program.residuals(&self.point, &[], gradient_scale, &mut self.y_z);
            // The cost never rises, so that the last iterate is the best one.
            self.best.take(&self.point, &[], &self.y_z, self.residuals);
            let flow = on_iteration(&Iteration {
                number: self.iterations,
                z: &self.point.z,
                cost: self.point.cost,
                residuals: self.residuals,
                step_length,
                shift: 0.0,
            });
            if let Some(status) = self.status(flow) {
                return Outcome::Ended(status);
            }
            self.find_free();
            let mut first = method.direction(&self.point, &self.free, &mut self.direction);
            loop {
                match self.search(first) {
                    Ok(Some(length)) => {
                        step_length = length;
                        break;
                    }
                    Ok(None) if method.forget() => {
                        first = method.direction(&self.point, &self.free, &mut self.direction);
                    }
                    Ok(None) => return Outcome::Ended(Status::Stalled),
                    Err(source) => return Outcome::of_failure(source),
                }
            }
            method.learn(&self.point, &self.trial, step_length);
            std::mem::swap(&mut self.point, &mut self.trial);
            self.iterations += 1;
        }
    }

    fn status(&self, flow: Flow) -> Option<Status> {
        if self.residuals.max() <= self.limits.stationarity_tol {
            Some(Status::Converged)
        } else if flow == Flow::Stop {
            Some(Status::Stopped)
        } else if self.point.cost < self.limits.cost_floor {
            Some(Status::Unbounded)
        } else if self.iterations >= self.limits.max_iterations {
            Some(Status::IterationLimit)
        } else if self.limits.max_time.is_some_and(|limit| self.began.elapsed() >= limit) {
            Some(Status::TimeLimit)
        } else {
            None
        }
    }

    /// A bound holds a variable that is at it, or nearly so, and is pushed against it (Bertsekas 1982).
    fn find_free(&mut self) {
        let bounds = &self.program.structure.variables;
        let near = self.residuals.stationarity.min(1e-8);
        for (i, free) in self.free.iter_mut().enumerate() {
            let (z, slope) = (self.point.z[i], self.point.gradient[i]);
            *free = !((slope > 0.0 && z <= bounds.lower[i] + near)
                || (slope < 0.0 && z >= bounds.upper[i] - near));
        }
    }

    /// Halves the length until the projected step decreases the cost enough. Leaves the new point in `trial`.
    fn search(&mut self, first: f64) -> Result<Option<f64>, Box<dyn std::error::Error + Send + Sync>> {
        let mut length = first;
        let reach = max_norm(&self.direction);
        let shortest = f64::EPSILON * max_norm(&self.point.z).max(1e-8) / reach.max(f64::MIN_POSITIVE);
        while length >= shortest && length.is_finite() {
            for (i, z) in self.trial.z.iter_mut().enumerate() {
                *z = self.point.z[i] + length * self.direction[i];
            }
            self.program.project(&mut self.trial.z);
            let slope: f64 = (0..self.trial.z.len())
                .map(|i| self.point.gradient[i] * (self.trial.z[i] - self.point.z[i]))
                .sum();
            match self.program.evaluate(&mut self.trial) {
                Ok(())
                    if slope < 0.0
                        && self.trial.cost < self.point.cost
                        && self.trial.cost <= self.point.cost + ARMIJO * slope =>
                {
                    match self.program.differentiate(&mut self.trial) {
                        Ok(()) => return Ok(Some(length)),
                        Err(EvaluationError::Undefined { .. }) => {}
                        Err(EvaluationError::Failed(source)) => return Err(source),
                    }
                }
                Ok(()) | Err(EvaluationError::Undefined { .. }) => {}
                Err(EvaluationError::Failed(source)) => return Err(source),
            }
            length *= 0.5;
        }
        Ok(None)
    }
}
