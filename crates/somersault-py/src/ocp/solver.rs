//! Solvers of nonlinear programs, what they report, and how Python watches them.

use crate::error::Error;
use crate::plan::returns_interrupted;
use pyo3::exceptions::PyKeyboardInterrupt;
use pyo3::prelude::*;
use somersault::ocp::nlp::Nlp;
use somersault::ocp::solver::{
    self, Flow, Globalisation, GradientDescent, HessianSource, Iteration, Lbfgs, Limits, NlpSolver,
    SolverError, Sqp, Start,
};
use std::time::{Duration, Instant};

/// How often a solve looks whether it is to stop.
pub(crate) const ATTENTION: Duration = Duration::from_millis(50);

/// What a solver found: always the best iterate, with the residuals it has.
#[pyclass(frozen, module = "somersault.ocp")]
pub(crate) struct Report {
    pub(crate) report: solver::Report,
}

#[pymethods]
impl Report {
    /// str: How the solve ended: ``'converged'``, ``'stalled'``, ``'iteration_limit'``, ``'time_limit'``,
    /// ``'infeasible'``, ``'unbounded'``, ``'undefined'``, ``'stopped'`` or ``'failed'``.
    #[getter]
    fn status(&self) -> &'static str {
        status_name(self.report.status)
    }

    /// str: The status in a sentence.
    #[getter]
    fn message(&self) -> &'static str {
        self.report.status.message()
    }

    /// bool: Whether all residuals are within their tolerances.
    #[getter]
    fn success(&self) -> bool {
        self.report.status.is_converged()
    }

    /// ndarray, shape (n,): Decision vector.
    #[getter]
    fn z<'py>(&self, py: Python<'py>) -> Bound<'py, PyAny> {
        numpy::PyArray1::from_slice(py, &self.report.z).into_any()
    }

    /// float: Cost at z.
    #[getter]
    fn cost(&self) -> f64 {
        self.report.cost
    }

    /// ndarray, shape (m,): Multipliers of the constraints, positive at upper bounds.
    #[getter]
    fn constraint_multipliers<'py>(&self, py: Python<'py>) -> Bound<'py, PyAny> {
        numpy::PyArray1::from_slice(py, &self.report.constraint_multipliers).into_any()
    }

    /// ndarray, shape (n,): Multipliers of the bounds on z.
    #[getter]
    fn bound_multipliers<'py>(&self, py: Python<'py>) -> Bound<'py, PyAny> {
        numpy::PyArray1::from_slice(py, &self.report.bound_multipliers).into_any()
    }

    /// float: Residual of the gradient of the Lagrangian, scaled.
    #[getter]
    fn stationarity(&self) -> f64 {
        self.report.residuals.stationarity
    }

    /// float: Largest violation of a constraint or bound, relative to the bound where that is above 1.
    #[getter]
    fn feasibility(&self) -> f64 {
        self.report.residuals.feasibility
    }

    /// float: Largest product of a multiplier and the distance to its bound, scaled.
    #[getter]
    fn complementarity(&self) -> f64 {
        self.report.residuals.complementarity
    }

    /// int: Steps taken.
    #[getter]
    fn nit(&self) -> usize {
        self.report.iterations
    }

    /// int: Evaluations of cost and constraints.
    #[getter]
    fn nfev(&self) -> usize {
        self.report.counts.evaluations
    }

    /// int: Evaluations of first derivatives.
    #[getter]
    fn njev(&self) -> usize {
        self.report.counts.gradients
    }

    fn __repr__(&self) -> String {
        let solver::Report { cost, iterations, residuals, .. } = &self.report;
        format!(
            "<Report: {}, cost {cost:.8}, {iterations} iterations, KKT residual {:.1e}>",
            self.status(),
            residuals.max()
        )
    }
}

pub(crate) fn status_name(status: solver::Status) -> &'static str {
    match status {
        solver::Status::Converged => "converged",
        solver::Status::Stalled => "stalled",
        solver::Status::IterationLimit => "iteration_limit",
        solver::Status::TimeLimit => "time_limit",
        solver::Status::Infeasible => "infeasible",
        solver::Status::Unbounded => "unbounded",
        solver::Status::Undefined => "undefined",
        solver::Status::Stopped => "stopped",
        // statuses to come end a solve as well
        _ => "failed",
    }
}

/// What a solver shows its iterations.
pub(crate) type Watch<'a> = &'a mut dyn FnMut(&Iteration<'_>) -> Flow;

/// The arguments that choose a solver and its limits.
pub(crate) struct SolverArguments<'a, 'py> {
    pub(crate) solver: &'a str,
    pub(crate) tol: Option<f64>,
    pub(crate) max_iterations: Option<usize>,
    pub(crate) max_time: Option<f64>,
    pub(crate) callback: Option<&'a Bound<'py, PyAny>>,
    pub(crate) on_interrupt: &'a str,
}

pub(crate) fn duration(max_time: Option<f64>) -> Result<Option<Duration>, Error> {
    let refused = |_| Error::input("`max_time` must be a positive number of seconds");
    max_time.map(|seconds| Duration::try_from_secs_f64(seconds).map_err(refused)).transpose()
}

impl SolverArguments<'_, '_> {
    fn solver(&self) -> Result<Box<dyn NlpSolver + Send + Sync>, Error> {
        let max_time = duration(self.max_time)?;
        let sqp = |hessian, globalisation| {
            let default = Sqp::default();
            Box::new(Sqp {
                hessian,
                globalisation,
                stationarity_tol: self.tol.unwrap_or(default.stationarity_tol),
                feasibility_tol: self.tol.unwrap_or(default.feasibility_tol),
                complementarity_tol: self.tol.unwrap_or(default.complementarity_tol),
                max_iterations: self.max_iterations.unwrap_or(default.max_iterations),
                max_time,
                ..default
            })
        };
        let default = Limits::default();
        let limits = Limits {
            stationarity_tol: self.tol.unwrap_or(default.stationarity_tol),
            max_iterations: self.max_iterations.unwrap_or(default.max_iterations),
            max_time,
            ..default
        };
        Ok(match self.solver {
            "sqp" => sqp(HessianSource::Offered, Globalisation::Merit),
            "sqp_filter" => sqp(HessianSource::Offered, Globalisation::Filter),
            "sqp_bfgs" => sqp(HessianSource::QuasiNewton, Globalisation::Merit),
            "lbfgs" => Box::new(Lbfgs { limits, ..Lbfgs::default() }),
            "gradient_descent" => Box::new(GradientDescent { limits }),
            other => {
                return Err(Error::input(format!(
                    "`solver` must be 'sqp', 'sqp_filter', 'sqp_bfgs', 'lbfgs' or 'gradient_descent', found '{other}'"
                )));
            }
        })
    }

    /// Solves. Without Python code in the program or a callback the interpreter is released.
    ///
    /// An interruption ends the solve; its best iterate is returned, or is the attribute `report` of the exception.
    pub(crate) fn solve(
        &self,
        py: Python<'_>,
        nlp: &mut (dyn Nlp + Send),
        start: &Start,
        calls_python: bool,
    ) -> Result<Report, Error> {
        self.solve_by(py, calls_python, |solver, watch| solver.solve(nlp, start, watch))
    }

    /// The same for what solves in its own way with the solver.
    pub(crate) fn solve_by(
        &self,
        py: Python<'_>,
        calls_python: bool,
        solve: impl FnOnce(&dyn NlpSolver, Watch<'_>) -> Result<solver::Report, SolverError> + Send,
    ) -> Result<Report, Error> {
        let returned = returns_interrupted(self.on_interrupt)?;
        let solver = self.solver()?;
        let mut watcher = Watcher::new(self.callback);
        let mut watch = |iteration: &Iteration<'_>| watcher.look(iteration);
        let found = if calls_python {
            solve(&*solver, &mut watch)
        } else {
            py.detach(|| solve(&*solver, &mut watch))
        };
        let report = match found {
            Ok(report) => report,
            Err(SolverError::Failed { source, report }) => {
                let error = match source.downcast::<PyErr>() {
                    Ok(error) => *error,
                    Err(other) => Error::ocp(&other).into(),
                };
                return Err(with_report(py, error, *report));
            }
            Err(error) => return Err(error.into()),
        };
        match watcher.into_raised(py, returned) {
            Some(error) => Err(with_report(py, error, report)),
            None => Ok(Report { report }),
        }
    }
}

/// Looks at a solve from Python: for a callback after each step, for Ctrl-C now and then.
pub(crate) struct Watcher {
    callback: Option<Py<PyAny>>,
    raised: Option<PyErr>,
    last_look: Instant,
}

impl Watcher {
    pub(crate) fn new(callback: Option<&Bound<'_, PyAny>>) -> Self {
        Self { callback: callback.map(|f| f.clone().unbind()), raised: None, last_look: Instant::now() }
    }

    /// Whether the solve is to go on.
    pub(crate) fn look(&mut self, iteration: &Iteration<'_>) -> Flow {
        if self.callback.is_none() && self.last_look.elapsed() < ATTENTION {
            return Flow::Continue;
        }
        self.last_look = Instant::now();
        let looked = Python::attach(|py| {
            py.check_signals()?;
            self.callback.as_ref().map_or(Ok(false), |f| asks_to_stop(py, f, iteration))
        });
        match looked {
            Ok(false) => Flow::Continue,
            Ok(true) => Flow::Stop,
            Err(error) => {
                self.raised = Some(error);
                Flow::Stop
            }
        }
    }

    /// What was raised, unless it is an interruption that ends in a result.
    pub(crate) fn into_raised(self, py: Python<'_>, returned: bool) -> Option<PyErr> {
        self.raised.filter(|error| !(returned && error.is_instance_of::<PyKeyboardInterrupt>(py)))
    }
}

/// The exception, with the report as its attribute.
fn with_report(py: Python<'_>, error: PyErr, report: solver::Report) -> Error {
    if let Ok(report) = Py::new(py, Report { report }) {
        // An exception that takes no attributes is still the one to raise.
        let _ = error.value(py).setattr("report", report);
    }
    error.into()
}

fn asks_to_stop(py: Python<'_>, callback: &Py<PyAny>, iteration: &Iteration<'_>) -> PyResult<bool> {
    let seen = (
        iteration.number,
        numpy::PyArray1::from_slice(py, iteration.z),
        iteration.cost,
        iteration.residuals.max(),
    );
    callback.call1(py, seen)?.bind(py).is_truthy()
}
