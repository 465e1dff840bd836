//! Sequential quadratic programming.

mod crossover;
mod line_search;
mod restoration;

use crate::best::{Best, Outcome};
use crate::error::SolverError;
use crate::filter::Filter;
use crate::hessian::Hessian;
use crate::nlp::{Curvature, EvaluationError, Nlp};
use crate::program::{Point, Program, check_positive, max_norm};
use crate::report::{Iteration, KktResiduals, Report, Start, Status};
use crate::solver::NlpSolver;
use crate::subproblem::{Origin, Subproblem};
use restoration::Restoration;
use somersault_core::cancel::Flow;
use std::time::{Duration, Instant};

/// Whose Hessian the quadratic model has.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum HessianSource {
    /// The program's, or a quasi-Newton approximation where it offers none.
    Offered,
    /// A quasi-Newton approximation, whatever the program offers.
    QuasiNewton,
}

/// Which points along a step are progress.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Globalisation {
    /// Those of a smaller merit function f + ρ Σ violations. Cautious: a step that leads to much higher costs is
    /// shortened whatever it does for feasibility, which is what long integrations with strong penalties need.
    Merit,
    /// Those that reduce the cost or the violation, and that no point before dominates in both. Full steps along
    /// curved constraints are taken, which is what collocation needs: half the steps, and no dependence on a weight.
    Filter,
}

/// Sequential quadratic programming with a line search, and restoration of feasibility where that ends.
///
/// See [the module](super) for the method, the treatment of indefinite Hessians and references.
#[derive(Debug, Clone, PartialEq)]
pub struct Sqp {
    /// Whose Hessian.
    pub hessian: HessianSource,
    /// Tolerance of [`KktResiduals::stationarity`].
    pub stationarity_tol: f64,
    /// Tolerance of [`KktResiduals::feasibility`].
    pub feasibility_tol: f64,
    /// Tolerance of [`KktResiduals::complementarity`].
    pub complementarity_tol: f64,
    /// Which points along a step are progress.
    pub globalisation: Globalisation,
    /// With a filter, the sum of violations above which no point is accepted, in those of the start or in ones where these
    /// are less: 10⁴ as in IPOPT. With a small one what starts nearly feasible stays so.
    pub violation_limit: f64,
    /// Whether [`InteriorPoint`](crate::InteriorPoint) solves the program, and the method continues from its solution, once exchanging
    /// rows of the working set does not find the one of a step: from the start if that has no multipliers, else after thirty steps for which
    /// it did not, and from where the method is then. A quadratic program of many bounds, which would be solved instead, takes as much
    /// work as the whole program.
    pub crossover: bool,
    /// Limit of steps.
    pub max_iterations: usize,
    /// Limit of evaluations of cost and constraints.
    pub max_evaluations: Option<usize>,
    /// Limit of time, looked at after each step and before each evaluation, the first excepted, and in steps at each factorisation.
    pub max_time: Option<Duration>,
    /// A feasible point whose cost is below this proves the program unbounded.
    pub cost_floor: f64,
}

impl Default for Sqp {
    fn default() -> Self {
        Self {
            hessian: HessianSource::Offered,
            stationarity_tol: 1e-8,
            feasibility_tol: 1e-8,
            complementarity_tol: 1e-8,
            globalisation: Globalisation::Merit,
            violation_limit: 1e4,
            crossover: false,
            max_iterations: 500,
            max_evaluations: None,
            max_time: None,
            cost_floor: -1e15,
        }
    }
}

/// Attempts to repair a step that the line search refuses.
const REPAIRS: usize = 6;
/// Steps without a decrease beyond rounding, of merit function and residuals, before giving up.
const PATIENCE: usize = 10;
/// ‖Jᵀ y‖ / ‖y‖, and relative decrease, at which violations count as stationary.
const INFEASIBLE: f64 = 1e-6;

impl NlpSolver for Sqp {
    fn solve(
        &self,
        nlp: &mut dyn Nlp,
        start: &Start,
        on_iteration: &mut dyn FnMut(&Iteration<'_>) -> Flow,
    ) -> Result<Report, SolverError> {
        check_positive("stationarity_tol", self.stationarity_tol)?;
        check_positive("feasibility_tol", self.feasibility_tol)?;
        check_positive("complementarity_tol", self.complementarity_tol)?;
        check_positive("violation_limit", self.violation_limit)?;
        let began = Instant::now();
        let mut run = Run::new(self, nlp, start)?;
        let outcome = run.run(start, began, on_iteration);
        run.finish(outcome)
    }
}

/// State of one solve.
struct Run<'a> {
    options: &'a Sqp,
    program: Program<'a>,
    hessian: Hessian,
    subproblem: Subproblem,
    curvature: Curvature,
    point: Point,
    trial: Point,
    /// Multipliers of the constraints and of the bounds.
    y: Vec<f64>,
    trial_y: Vec<f64>,
    y_z: Vec<f64>,
    residuals: KktResiduals,
    gradient_scale: f64,
    filter: Filter,
    /// While feasibility is restored.
    restoration: Option<Restoration>,
    penalty: f64,
    /// How often the penalty was reduced.
    reductions: usize,
    /// Least shift of the Hessian: Levenberg and Marquardt's term.
    floor: f64,
    iterations: usize,
    best: Best,
    scratch: Vec<f64>,
    /// Step and its multipliers, while another is tried.
    step: Vec<f64>,
    step_y: Vec<f64>,
}

impl<'a> Run<'a> {
    fn new(options: &'a Sqp, nlp: &'a mut dyn Nlp, start: &Start) -> Result<Self, SolverError> {
        let mut program = Program::new(nlp)?;
        program.max_evaluations = options.max_evaluations;
        let point = program.start(start)?;
        let (n, m) = (program.n_variables(), program.n_constraints());
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
        Ok(Self {
            subproblem: Subproblem::try_new(&program, &hessian)?,
            best: Best::new(&point, m, options.feasibility_tol),
            trial: point.clone(),
            point,
            y: vec![0.0; m],
            trial_y: vec![0.0; m],
            y_z: vec![0.0; n],
            residuals: KktResiduals::UNKNOWN,
            gradient_scale: 0.0,
            filter: Filter::new(0.0, options.violation_limit, 1.0),
            restoration: None,
            penalty: 0.0,
            reductions: 0,
            floor: 0.0,
            iterations: 0,
            scratch: vec![0.0; n],
            step: vec![0.0; n],
            step_y: vec![0.0; n + m],
            options,
            program,
            hessian,
            curvature,
        })
    }

    fn run(
        &mut self,
        start: &Start,
        began: Instant,
        on_iteration: &mut dyn FnMut(&Iteration<'_>) -> Flow,
    ) -> Outcome {
        let evaluated = self.program.evaluate(&mut self.point);
        if let Err(error) = evaluated.and_then(|()| self.program.differentiate(&mut self.point)) {
            return Outcome::at_start(error);
        }
        self.program.limit_time(began, self.options.max_time);
        self.subproblem.deadline = self.program.deadline;
        if self.options.crossover {
            let is_cold = start.constraint_multipliers.is_empty();
            self.subproblem.most_quadratic_programs = if is_cold { 0 } else { crossover::FROM_A_WARM_START };
        }
        self.gradient_scale = max_norm(&self.point.gradient);
        self.empty_filter();
        if start.constraint_multipliers.is_empty() {
            self.subproblem.estimate_multipliers(&self.point, &mut self.y);
        } else {
            self.y.copy_from_slice(&start.constraint_multipliers);
        }
        self.subproblem.guess_set(&self.point, &self.y);
        let mut step_length = 1.0;
        let mut idle = 0;
        let mut least_residual = f64::INFINITY;
        loop {
            self.residuals = self.program.residuals(&self.point, &self.y, self.gradient_scale, &mut self.y_z);
            self.best.offer(&self.point, &self.y, &self.y_z, self.residuals);
            let flow = on_iteration(&Iteration {
                number: self.iterations,
                z: &self.point.z,
                cost: self.point.cost,
                residuals: self.residuals,
                step_length,
                shift: self.subproblem.shift,
            });
            if self.residuals.max() < 0.9 * least_residual {
                least_residual = self.residuals.max();
                idle = 0;
            }
            let advance = match (self.status(flow, idle), self.restoration) {
                (Some(status), _) => Ok(Advance::Ended(status)),
                (None, Some(restoration)) => self.restore(restoration),
                (None, None) => self.refresh().and_then(|()| self.advance(start, on_iteration)),
            };
            let advance = match advance {
                Ok(Advance::Ended(Status::Stalled)) if self.restoration.is_none() && !self.is_feasible() => {
                    self.begin_restoration(self.program.violation(&self.point.constraints))
                }
                advance => advance,
            };
            match advance {
                Ok(Advance::Stepped { length, decreased }) => {
                    step_length = length;
                    idle = if decreased { 0 } else { idle + 1 };
                }
                Ok(Advance::Ended(status)) => return self.end(status),
                Err(source) => return Outcome::of_failure(source),
            }
            self.iterations += 1;
        }
    }

    /// A filter of no point, for a search that begins here.
    fn empty_filter(&mut self) {
        let violation = self.program.violation(&self.point.constraints);
        let cost_scale = self.gradient_scale.max(100.0) / 100.0;
        self.filter = Filter::new(violation, self.options.violation_limit, cost_scale);
    }

    /// Asks for the Hessian. Where it has no value the last one stays.
    fn refresh(&mut self) -> Result<(), Failure> {
        match self.hessian.refresh(&mut self.program, &self.point.z, 1.0, &self.y) {
            Ok(()) => {}
            Err(EvaluationError::Undefined { .. }) if self.iterations > 0 => {}
            Err(EvaluationError::Undefined { .. }) => self.hessian.reset(),
            Err(EvaluationError::Failed(source)) => return Err(source),
        }
        Ok(())
    }

    fn end(&mut self, status: Status) -> Outcome {
        if matches!(status, Status::Converged | Status::Stalled | Status::Infeasible) {
            self.best.take(&self.point, &self.y, &self.y_z, self.residuals);
        }
        Outcome::Ended(status)
    }

    fn is_feasible(&self) -> bool {
        self.residuals.feasibility <= self.options.feasibility_tol
    }

    fn status(&self, flow: Flow, idle: usize) -> Option<Status> {
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
        } else if self.program.is_late() {
            Some(Status::TimeLimit)
        } else {
            None
        }
    }

    /// One step, with repairs of the Hessian where the line search refuses it, and of feasibility where the linearised
    /// constraints contradict each other and cannot be followed.
    fn advance(
        &mut self,
        start: &Start,
        on_iteration: &mut dyn FnMut(&Iteration<'_>) -> Flow,
    ) -> Result<Advance, Failure> {
        let violation = self.program.violation(&self.point.constraints);
        let size = max_norm(&self.hessian.values).max(f64::MIN_POSITIVE);
        let kept_floor = self.floor;
        if self.point.z.is_empty() {
            return Ok(Advance::Ended(Status::Infeasible));
        }
        for attempt in 0..REPAIRS {
            let origin = self.subproblem.solve(&self.point, &self.hessian, &self.y, self.floor, violation);
            if self.program.is_late() {
                return Ok(Advance::Ended(Status::TimeLimit));
            }
            if origin == Some(Origin::Deferred) {
                self.subproblem.most_quadratic_programs = usize::MAX;
                if let Some(advance) = self.cross_over(start, on_iteration)? {
                    return Ok(advance);
                }
                continue;
            }
            let filtered = self.options.globalisation == Globalisation::Filter;
            if origin == Some(Origin::Elastic)
                && !self.is_feasible()
                && (filtered || self.is_stuck(violation))
            {
                self.floor = kept_floor;
                return self.begin_restoration(violation);
            }
            if let Some(origin) = origin
                && let Some(length) = self.search(origin, violation)?
            {
                let decreased = self.accept(length);
                self.floor = match self.curvature {
                    Curvature::GaussNewton => self.damping(attempt, length, size),
                    Curvature::Exact | Curvature::None => kept_floor,
                };
                return Ok(Advance::Stepped { length, decreased });
            }
            if filtered && attempt > 0 && !self.is_feasible() {
                self.floor = kept_floor;
                return self.begin_restoration(violation);
            }
            // An indefinite matrix is shifted first; an approximation is given up last.
            let last = if self.hessian.is_definite() { 0 } else { REPAIRS - 2 };
            if self.hessian.is_quasi_newton() && attempt >= last {
                if attempt > last {
                    break;
                }
                self.hessian.reset();
                self.floor = kept_floor;
            } else {
                self.floor = (100.0 * self.subproblem.shift).max(1e-4 * size);
            }
        }
        self.floor = kept_floor;
        Ok(Advance::Ended(Status::Stalled))
    }

    /// Whether the violation is stationary: the elastic step neither reduces its linearisation, nor has it a slope.
    fn is_stuck(&self, violation: f64) -> bool {
        let gain = violation - self.subproblem.left_violation;
        gain <= INFEASIBLE * violation
            && self.subproblem.infeasibility_stationarity(&self.program, &self.point) <= INFEASIBLE
    }

    /// Levenberg and Marquardt's term for the next step.
    fn damping(&self, repairs: usize, length: f64, size: f64) -> f64 {
        if repairs > 0 || length < 0.3 {
            (4.0 * self.floor).max(1e-6 * size)
        } else if length == 1.0 {
            if self.floor < 1e-10 * size { 0.0 } else { self.floor / 8.0 }
        } else {
            self.floor
        }
    }

    /// Moves to the trial point. Whether what is searched along became smaller by more than rounding.
    fn accept(&mut self, length: f64) -> bool {
        let n = self.point.z.len();
        let (from, to) = (self.measures(&self.point), self.measures(&self.trial));
        let merit = self.merit(from);
        let decreased = self.merit(to) < merit - 1e-13 * merit.abs()
            || (self.options.globalisation == Globalisation::Filter && to.violation < 0.99 * from.violation);
        for (y, next) in self.y.iter_mut().zip(&self.subproblem.y[n..]) {
            *y += length * (next - *y);
        }
        if self.hessian.is_quasi_newton() {
            let jacobian = &self.program.structure.jacobian;
            self.scratch.fill(0.0);
            jacobian.add_transposed_product(&self.point.jacobian, &self.y, &mut self.scratch);
            for i in 0..n {
                self.step[i] = self.trial.z[i] - self.point.z[i];
                self.scratch[i] = self.trial.gradient[i] - self.point.gradient[i] - self.scratch[i];
            }
            jacobian.add_transposed_product(&self.trial.jacobian, &self.y, &mut self.scratch);
            self.hessian.update(&self.step, &mut self.scratch);
        }
        std::mem::swap(&mut self.point, &mut self.trial);
        decreased
    }

    fn finish(mut self, outcome: Outcome) -> Result<Report, SolverError> {
        self.program.counts.factorisations += self.subproblem.n_factorisations();
        self.program.counts.quadratic_programs += self.subproblem.n_quadratic_programs;
        let hessian = self.hessian.is_quasi_newton().then_some(self.hessian.values);
        self.best.report(outcome, self.iterations, self.program.counts, hessian)
    }
}

type Failure = Box<dyn std::error::Error + Send + Sync>;

enum Advance {
    Stepped { length: f64, decreased: bool },
    Ended(Status),
}
