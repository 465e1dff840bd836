//! Solvers of nonlinear programs, what they report, and how Python watches them.

use super::arguments::{limit, tolerance};
use super::verification::{Verifier, judgement};
use crate::core::callable::check_callable;
use crate::core::error::Error;
use crate::core::value::{Pickled, by_restore, value};
use crate::core::waiting::{SignalTimer, deliver, returns_interrupted, with_solution};
use pyo3::exceptions::PyKeyboardInterrupt;
use pyo3::prelude::*;
use pyo3::types::PyType;
use somersault::nlp::{
    self, Flow, Globalisation, GradientDescent, HessianSource, Iteration, Lbfgs, Limits, Nlp, NlpSolver,
    SolverError, Sqp, Start, Status,
};
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Result of a solver: always the best iterate, with its residuals and its verification by an accurate integration.
///
/// The motion is re-integrated when `verification`, `confirmed` or `message` is first requested, not to print the report.
/// Ctrl-C ends that with a KeyboardInterrupt; the report stays, and integrates again when it is asked again.
#[pyclass(frozen, module = "somersault.ocp")]
pub(crate) struct Report {
    pub(crate) report: nlp::Report,
    /// None where the program has no motion of its own.
    pub(crate) verifier: Option<Arc<Verifier>>,
    /// What is said of a derivative that differences contradict at z.
    pub(crate) wrong_derivative: Option<String>,
}

value! {
    impl Report {
        /// str: How the solve ended: ``'converged'``, ``'stalled'``, ``'iteration_limit'``, ``'evaluation_limit'``,
        /// ``'time_limit'``, ``'infeasible'``, ``'unbounded'``, ``'undefined'``, ``'stopped'``, ``'interrupted'`` or ``'failed'``.
        status: &'static str = |own| status_name(own.report.status);
        /// bool: Whether all residuals are within their tolerances: the program is solved, which does not make it a physical motion; see `confirmed`.
        success: bool = |own| own.report.status.is_converged();
        /// Verification, SwingUpVerification or DiveVerification: The motion re-integrated; None for programs without a motion of their
        /// own, as those of a mesh of `CollocationResult`, which has it itself.
        verification: Result<Option<Py<PyAny>>, Error> =
            |own, py| own.verifier.as_ref().map(|verifier| verifier.get(py)).transpose();
        /// bool or None: Whether the integration agrees with the motion; None where there is no verification.
        confirmed: PyResult<Option<bool>> =
            |own, py| own.verifier.as_ref().map(|verifier| Ok(verifier.judge(py)?.0)).transpose();
        /// Motion or None: The motion of z, made when first requested; None where another result has it, as that of a dive or of
        /// collocation, and for programs without one.
        motion: Result<Option<Py<PyAny>>, Error> =
            |own, py| own.verifier.as_ref().map_or(Ok(None), |verifier| verifier.motion(py));
        /// ndarray, shape (n,): Decision vector.
        z: Bound<'py, PyAny> = |own, py| numpy::PyArray1::from_slice(py, &own.report.z).into_any();
        /// float: Cost at z.
        cost: f64 = |own| own.report.cost;
        /// ndarray, shape (m,): Multipliers of the constraints, positive at upper bounds.
        constraint_multipliers: Bound<'py, PyAny> =
            |own, py| numpy::PyArray1::from_slice(py, &own.report.constraint_multipliers).into_any();
        /// ndarray, shape (n,): Multipliers of the bounds on z.
        bound_multipliers: Bound<'py, PyAny> =
            |own, py| numpy::PyArray1::from_slice(py, &own.report.bound_multipliers).into_any();
        /// float: Residual of the gradient of the Lagrangian, scaled.
        stationarity: f64 = |own| own.report.residuals.stationarity;
        /// float: Largest violation of a constraint or bound, relative to the bound where that is above 1.
        feasibility: f64 = |own| own.report.residuals.feasibility;
        /// float: Largest product of a multiplier and the distance to its bound, scaled.
        complementarity: f64 = |own| own.report.residuals.complementarity;
        /// int: Steps taken.
        nit: usize = |own| own.report.iterations;
        /// int: Evaluations of cost and constraints.
        nfev: usize = |own| own.report.counts.evaluations;
        /// int: Evaluations of first derivatives.
        njev: usize = |own| own.report.counts.gradients;
    }
}

#[pymethods]
impl Report {
    /// str: The status in a sentence, and another about the verification. Where a solve did not converge, the derivative of a
    /// user-defined term that differences contradict at z, if there is one.
    #[getter]
    fn message(&self, py: Python<'_>) -> PyResult<String> {
        let status = match &self.wrong_derivative {
            Some(wrong) => format!("{}. A likely reason: {wrong}", self.report.status.message()),
            None => self.report.status.message().to_owned(),
        };
        Ok(match &self.verifier {
            Some(verifier) => format!("{status}. {}", verifier.judge(py)?.1),
            None => status,
        })
    }

    fn __repr__(&self, py: Python<'_>) -> PyResult<String> {
        let nlp::Report { cost, iterations, residuals, .. } = &self.report;
        let confirmed = match &self.verifier {
            Some(verifier) => format!(", {}", judgement(py, verifier)?),
            None => String::new(),
        };
        Ok(format!(
            "<Report: {}{confirmed}, cost {cost:.8}, {iterations} iterations, KKT residual {:.1e}>",
            self.status(),
            residuals.max()
        ))
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> Pickled<'py> {
        let (py, report) = (slf.py(), &slf.get().report);
        let numbers = |values: &[f64]| numpy::PyArray1::from_slice(py, values);
        let residuals =
            (report.residuals.stationarity, report.residuals.feasibility, report.residuals.complementarity);
        let counts = [
            report.counts.evaluations,
            report.counts.gradients,
            report.counts.hessians,
            report.counts.factorisations,
            report.counts.quadratic_programs,
        ];
        // a motion that cannot be integrated is stored without its verification
        let verifier = slf.get().verifier.as_ref();
        let verification = verifier.and_then(|verifier| verifier.get(py).ok());
        let motion = verifier.and_then(|verifier| verifier.motion(py).ok().flatten());
        let arguments = (
            slf.get().status(),
            (numbers(&report.z), numbers(&report.constraint_multipliers), numbers(&report.bound_multipliers)),
            report.cost,
            residuals,
            report.iterations,
            counts,
            report.hessian.as_deref().map(numbers),
            verification,
            motion,
            slf.get().wrong_derivative.clone(),
        );
        by_restore(slf, arguments)
    }

    /// A pickled report.
    #[classmethod]
    #[pyo3(signature = (
        status, vectors, cost, residuals, iterations, counts, hessian, verification, motion=None,
        wrong_derivative=None
    ))]
    fn _restore(
        cls: &Bound<'_, PyType>,
        status: &str,
        vectors: (Vec<f64>, Vec<f64>, Vec<f64>),
        cost: f64,
        residuals: (f64, f64, f64),
        iterations: usize,
        counts: [usize; 5],
        hessian: Option<Vec<f64>>,
        verification: Option<Py<PyAny>>,
        motion: Option<Py<PyAny>>,
        wrong_derivative: Option<String>,
    ) -> Result<Self, Error> {
        let (z, constraint_multipliers, bound_multipliers) = vectors;
        let (stationarity, feasibility, complementarity) = residuals;
        let [evaluations, gradients, hessians, factorisations, quadratic_programs] = counts;
        if bound_multipliers.len() != z.len() {
            let (n, found) = (z.len(), bound_multipliers.len());
            return Err(Error::input(format!("`bound_multipliers` must have {n} numbers, found {found}")));
        }
        let report = nlp::Report {
            status: status_of(status)?,
            z,
            constraint_multipliers,
            bound_multipliers,
            cost,
            residuals: nlp::KktResiduals { stationarity, feasibility, complementarity },
            iterations,
            counts: nlp::Counts { evaluations, gradients, hessians, factorisations, quadratic_programs },
            hessian,
        };
        let verifier = verification.map(|found| Arc::new(Verifier::of(cls.py(), found, motion)));
        Ok(Self { report, verifier, wrong_derivative })
    }
}

const STATUSES: [(Status, &str); 11] = [
    (Status::Converged, "converged"),
    (Status::Stalled, "stalled"),
    (Status::IterationLimit, "iteration_limit"),
    (Status::EvaluationLimit, "evaluation_limit"),
    (Status::TimeLimit, "time_limit"),
    (Status::Infeasible, "infeasible"),
    (Status::Unbounded, "unbounded"),
    (Status::Undefined, "undefined"),
    (Status::Stopped, "stopped"),
    (Status::Interrupted, "interrupted"),
    (Status::Failed, "failed"),
];

pub(crate) fn status_of(name: &str) -> Result<Status, Error> {
    let found = STATUSES.iter().find(|(_, known)| *known == name).map(|(status, _)| *status);
    found.ok_or_else(|| Error::input(format!("`status` must be that of a report, found '{name}'")))
}

pub(crate) fn status_name(status: Status) -> &'static str {
    // statuses to come end a solve as well
    STATUSES.iter().find(|(known, _)| *known == status).map_or("failed", |(_, name)| name)
}

/// What a solver shows its iterations.
pub(crate) type Watch<'a> = &'a mut dyn FnMut(&Iteration<'_>) -> Flow;

/// The arguments that choose a solver and its limits.
pub(crate) struct SolverArguments<'a, 'py> {
    pub(crate) solver: &'a str,
    pub(crate) tol: Option<f64>,
    pub(crate) max_iterations: Option<i64>,
    pub(crate) max_evaluations: Option<i64>,
    pub(crate) max_time: Option<f64>,
    pub(crate) callback: Option<&'a Bound<'py, PyAny>>,
    pub(crate) on_interrupt: &'a str,
}

pub(crate) fn duration(max_time: Option<f64>) -> Result<Option<Duration>, Error> {
    let Some(seconds) = max_time else { return Ok(None) };
    match Duration::try_from_secs_f64(seconds) {
        Ok(limit) if seconds > 0.0 => Ok(Some(limit)),
        _ => Err(Error::input(format!("`max_time` must be a positive number of seconds, found {seconds}"))),
    }
}

/// When a solve that may take so long is to end; never where the clock does not reach so far.
pub(crate) fn deadline(max_time: Option<f64>) -> Result<Option<Instant>, Error> {
    Ok(duration(max_time)?.and_then(|limit| Instant::now().checked_add(limit)))
}

impl SolverArguments<'_, '_> {
    pub(crate) fn solver(&self) -> Result<Box<dyn NlpSolver + Send + Sync>, Error> {
        let max_time = duration(self.max_time)?;
        let tol = tolerance("tol", self.tol)?;
        let max_iterations = limit("max_iterations", self.max_iterations, 0)?;
        let max_evaluations = limit("max_evaluations", self.max_evaluations, 1)?;
        let sqp = |hessian, globalisation| {
            let default = Sqp::default();
            Box::new(Sqp {
                hessian,
                globalisation,
                stationarity_tol: tol.unwrap_or(default.stationarity_tol),
                feasibility_tol: tol.unwrap_or(default.feasibility_tol),
                complementarity_tol: tol.unwrap_or(default.complementarity_tol),
                max_iterations: max_iterations.unwrap_or(default.max_iterations),
                max_evaluations,
                max_time,
                ..default
            })
        };
        let default = Limits::default();
        let limits = Limits {
            stationarity_tol: tol.unwrap_or(default.stationarity_tol),
            max_iterations: max_iterations.unwrap_or(default.max_iterations),
            max_evaluations,
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
    /// An interruption ends the solve; its best iterate is the attribute `solution` of the exception, or is returned.
    pub(crate) fn solve(
        &self,
        py: Python<'_>,
        nlp: &mut (dyn Nlp + Send),
        start: &Start,
        calls_python: bool,
        verifier: impl Fn(&nlp::Report) -> Option<Arc<Verifier>>,
    ) -> Result<Report, Error> {
        self.solve_by(py, calls_python, |solver, watch| solver.solve(nlp, start, watch), verifier)
    }

    /// The same for what solves in its own way with the solver.
    pub(crate) fn solve_by(
        &self,
        py: Python<'_>,
        calls_python: bool,
        solve: impl FnOnce(&dyn NlpSolver, Watch<'_>) -> Result<nlp::Report, SolverError> + Send,
        verifier: impl Fn(&nlp::Report) -> Option<Arc<Verifier>>,
    ) -> Result<Report, Error> {
        let returned = returns_interrupted(self.on_interrupt)?;
        let solver = self.solver()?;
        let mut watcher = Watcher::new(self.callback)?;
        let mut watch = |iteration: &Iteration<'_>| watcher.look(iteration);
        let found = if calls_python {
            solve(&*solver, &mut watch)
        } else {
            py.detach(|| solve(&*solver, &mut watch))
        };
        let verified =
            |report: nlp::Report| Report { verifier: verifier(&report), report, wrong_derivative: None };
        let report = match found {
            Ok(report) if watcher.is_interrupted(py) => verified(report.interrupted()),
            Ok(report) => verified(report),
            Err(SolverError::Failed { source, report }) => {
                let error = Error::failed(source).into();
                return Err(with_solution(py, error, verified(*report)));
            }
            Err(error) => return Err(error.into()),
        };
        deliver(py, watcher.into_raised(), returned, report)
    }
}

/// Looks at a solve from Python: for a callback after each step, for Ctrl-C now and then.
pub(crate) struct Watcher {
    callback: Option<Py<PyAny>>,
    raised: Option<PyErr>,
    timer: SignalTimer,
}

impl Watcher {
    pub(crate) fn new(callback: Option<&Bound<'_, PyAny>>) -> Result<Self, Error> {
        if let Some(callback) = callback {
            check_callable("callback", "callback(iteration, z, cost, residual)", callback)?;
        }
        let callback = callback.map(|f| f.clone().unbind());
        Ok(Self { callback, raised: None, timer: SignalTimer::start() })
    }

    /// Whether Ctrl-C has ended the solve.
    pub(crate) fn is_interrupted(&self, py: Python<'_>) -> bool {
        self.raised.as_ref().is_some_and(|error| error.is_instance_of::<PyKeyboardInterrupt>(py))
    }

    /// Whether the solve is to continue.
    pub(crate) fn look(&mut self, iteration: &Iteration<'_>) -> Flow {
        if self.callback.is_none() && !self.timer.is_due() {
            return Flow::Continue;
        }
        let looked = Python::attach(|py| {
            self.timer.look(py)?;
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

    /// What a handler of signals raised where a thread waited for the solve is as if it had been raised here.
    pub(crate) fn hears(&mut self, raised: Option<PyErr>) {
        if let Some(raised) = raised {
            self.raised.get_or_insert(raised);
        }
    }

    /// What was raised.
    pub(crate) fn into_raised(self) -> Option<PyErr> {
        self.raised
    }
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
