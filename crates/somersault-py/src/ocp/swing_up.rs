//! The pendulum on a cart, brought from one state to another.

use super::problem::Motion;
use super::solver::{ATTENTION, Report, SolverArguments};
use crate::convert::{array, finite, numbers_or_one, with_shape};
use crate::error::Error;
use crate::model::Model;
use crate::plan::returns_interrupted;
use pyo3::exceptions::PyKeyboardInterrupt;
use pyo3::prelude::*;
use pyo3::types::PyType;
use somersault::multibody::models::CartPendulum;
use somersault::ocp::nlp::Nlp;
use somersault::ocp::shooting::Scheme;
use somersault::ocp::solver::{FailureCause, MultiStart, MultiStartReport, Sqp, Start, samples};
use somersault::ocp::swing_up::{self, SwingUp};
use somersault::ocp::transcription::Transcription;
use somersault::ocp::verification::{Verification, VerificationError, verify};
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;

/// Coefficients up to which random starts are of use.
const MOST_AT_RANDOM: usize = 12;
/// Coefficients that are added at once.
const LEVEL: usize = 5;
/// Minima that start a problem with more coefficients.
const CARRIED: usize = 8;

/// A pendulum on a cart is brought from one state to another (thesis appendix A).
///
/// States are (θ, r, θ̇, ṙ) with θ from the upright. The cost is ½ (x(T) − x_f)ᵀ Q (x(T) − x_f) + ½ ∫ ρ F² + (x − x_f)ᵀ W
/// (x − x_f) dt. The cart moves along a quintic spline that starts at r(0), ṙ(0), whose other coefficients z are the
/// variables; the pendulum is passive. Without arguments it is case A of Table A.1.
///
/// Parameters
/// ----------
/// start, target : array_like, shape (4,), optional
///     x(0) and x_f; the target is met by a penalty.
/// duration : float, optional
///     T, s.
/// n_steps : int, optional
///     Steps of equal length.
/// n_par : int, optional
///     Splines of the cart, two more than there are variables; at least 6.
/// scheme : {'euler', 'rk4'}, optional
///     How the pendulum is integrated: explicit Euler as in the thesis, or Runge–Kutta steps of fourth order.
/// terminal_weights : float or array_like, shape (4,), optional
///     Diagonal of Q.
/// force_weight : float, optional
///     ρ.
/// running_weights : float or array_like, shape (4,), optional
///     Diagonal of W.
/// cart_mass, mass : float, optional
///     kg.
/// length : float, optional
///     m.
/// gravity : float, optional
///     m/s².
///
/// Raises
/// ------
/// OcpInputError
///     If a number is not finite or not allowed, or there are fewer than six splines.
///
/// Examples
/// --------
/// >>> from somersault import ocp
/// >>> found = ocp.CartPendulumProblem().search(16, seed=1)
/// >>> round(found.best.cost, 2)
/// 478.39
#[pyclass(frozen, module = "somersault.ocp")]
pub(crate) struct CartPendulumProblem {
    problem: swing_up::CartPendulumProblem,
    nlp: SwingUp,
}

impl CartPendulumProblem {
    fn of(problem: swing_up::CartPendulumProblem) -> Result<Self, Error> {
        let nlp = problem.swing_up()?;
        // the tree, and the transcription, must exist as well
        problem.shooting()?;
        Ok(Self { problem, nlp })
    }

    /// Solves from random starts with few variables first, and starts each problem with more from the minima of the one
    /// before.
    fn climb(
        &self,
        many: &MultiStart<Sqp>,
        given: Vec<Start>,
        n_starts: usize,
        (reach, seed): (f64, u64),
        stop: &AtomicBool,
    ) -> Result<MultiStartReport, Error> {
        let last = self.problem.n_coefficients;
        let mut levels = vec![last];
        while n_starts > 0 && levels[0] > MOST_AT_RANDOM {
            levels.insert(0, levels[0] - LEVEL);
        }
        let mut known: Option<(swing_up::CartPendulumProblem, MultiStartReport)> = None;
        for n_coefficients in levels {
            let problem = swing_up::CartPendulumProblem { n_coefficients, ..self.problem.clone() };
            let mut starts = if n_coefficients == last { given.clone() } else { Vec::new() };
            match &known {
                Some((coarse, found)) if !found.minima.is_empty() => {
                    for minimum in found.minima.iter().take(CARRIED) {
                        starts.push(problem.carry_over(coarse, &minimum.report.z)?.into());
                    }
                }
                _ => starts.extend(samples(&problem.start_range(reach)?, n_starts, seed)?),
            }
            let nlp = problem.swing_up()?;
            let found = many.solve(|| nlp.clone(), &starts, || stop.load(Ordering::Relaxed))?;
            known = Some((problem, found));
        }
        known.map(|(_, found)| found).ok_or_else(|| Error::ocp(&"the search has no start"))
    }

    fn variables(&self, z: &Bound<'_, PyAny>) -> Result<Vec<f64>, Error> {
        let z = with_shape("z", &[self.n_variables()], z)?;
        z.iter().try_for_each(|x| finite("z", *x).map(|_| ()))?;
        Ok(z)
    }
}

fn four(argument: &str, value: Option<&Bound<'_, PyAny>>, default: [f64; 4]) -> Result<[f64; 4], Error> {
    let Some(value) = value else { return Ok(default) };
    let mut out = default;
    out.copy_from_slice(&with_shape(argument, &[4], value)?);
    Ok(out)
}

fn weights(argument: &str, value: Option<&Bound<'_, PyAny>>, default: [f64; 4]) -> Result<[f64; 4], Error> {
    let Some(value) = value else { return Ok(default) };
    let mut out = default;
    out.copy_from_slice(&numbers_or_one(argument, 4, value)?);
    Ok(out)
}

#[pymethods]
impl CartPendulumProblem {
    #[new]
    #[pyo3(signature = (
        start=None, target=None, *, duration=2.0, n_steps=200, n_par=7, scheme="euler", terminal_weights=None,
        force_weight=1.0, running_weights=None, cart_mass=2.0, mass=1.0, length=1.0, gravity=9.81
    ))]
    fn new(
        start: Option<&Bound<'_, PyAny>>,
        target: Option<&Bound<'_, PyAny>>,
        duration: f64,
        n_steps: usize,
        n_par: usize,
        scheme: &str,
        terminal_weights: Option<&Bound<'_, PyAny>>,
        force_weight: f64,
        running_weights: Option<&Bound<'_, PyAny>>,
        cart_mass: f64,
        mass: f64,
        length: f64,
        gravity: f64,
    ) -> Result<Self, Error> {
        let default = swing_up::CartPendulumProblem::default();
        let scheme = match scheme {
            "euler" => Scheme::ExplicitEuler,
            "rk4" => Scheme::RungeKutta4,
            other => return Err(Error::input(format!("`scheme` must be 'euler' or 'rk4', found '{other}'"))),
        };
        Self::of(swing_up::CartPendulumProblem {
            system: CartPendulum { cart_mass, mass, length, gravity },
            start: four("start", start, default.start)?,
            target: four("target", target, default.target)?,
            duration,
            n_steps,
            n_coefficients: n_par,
            scheme,
            terminal_weights: weights("terminal_weights", terminal_weights, default.terminal_weights)?,
            force_weight,
            running_weights: weights("running_weights", running_weights, default.running_weights)?,
        })
    }

    /// A case of Table A.1.
    ///
    /// Parameters
    /// ----------
    /// name : {'A', 'B', 'C', 'D', 'E', 'F', 'G'}
    ///     With 5, 10, 15, 20, 30, 40 or 50 variables.
    ///
    /// Returns
    /// -------
    /// CartPendulumProblem
    #[classmethod]
    fn case(_: &Bound<'_, PyType>, name: &str) -> Result<Self, Error> {
        let p = match name {
            "A" => 5,
            "B" => 10,
            "C" => 15,
            "D" => 20,
            "E" => 30,
            "F" => 40,
            "G" => 50,
            other => {
                return Err(Error::input(format!(
                    "`name` must be a letter from 'A' to 'G', found '{other}'"
                )));
            }
        };
        Self::of(swing_up::CartPendulumProblem::with_parameters(p))
    }

    /// int: Length of z.
    #[getter]
    fn n_variables(&self) -> usize {
        self.nlp.structure().variables.len()
    }

    /// Model: The tree, q = (r, θ).
    #[getter]
    fn model(&self) -> Result<Model, Error> {
        Ok(Model::of(self.problem.system.model()?))
    }

    /// The cost.
    ///
    /// Parameters
    /// ----------
    /// z : array_like, shape (n_variables,)
    ///
    /// Returns
    /// -------
    /// float
    fn cost(&self, z: &Bound<'_, PyAny>) -> Result<f64, Error> {
        let z = self.variables(z)?;
        self.nlp.clone().evaluate(&z, &mut []).map_err(|error| Error::ocp(&error))
    }

    /// The gradient of the cost.
    ///
    /// Parameters
    /// ----------
    /// z : array_like, shape (n_variables,)
    ///
    /// Returns
    /// -------
    /// ndarray, shape (n_variables,)
    fn gradient<'py>(&self, py: Python<'py>, z: &Bound<'py, PyAny>) -> Result<Bound<'py, PyAny>, Error> {
        let z = self.variables(z)?;
        let (mut nlp, mut gradient) = (self.nlp.clone(), vec![0.0; z.len()]);
        nlp.evaluate(&z, &mut [])
            .and_then(|_| nlp.differentiate(&z, &mut gradient, &mut []))
            .map_err(|error| Error::ocp(&error))?;
        Ok(numpy::PyArray1::from_vec(py, gradient).into_any())
    }

    /// The Hessian of the cost, exact.
    ///
    /// Parameters
    /// ----------
    /// z : array_like, shape (n_variables,)
    ///
    /// Returns
    /// -------
    /// ndarray, shape (n_variables, n_variables)
    fn hessian<'py>(&self, py: Python<'py>, z: &Bound<'py, PyAny>) -> Result<Bound<'py, PyAny>, Error> {
        let z = self.variables(z)?;
        let (mut nlp, n) = (self.nlp.clone(), z.len());
        let mut gradient = vec![0.0; n];
        let mut triangle = vec![0.0; n * (n + 1) / 2];
        nlp.evaluate(&z, &mut [])
            .and_then(|_| nlp.differentiate(&z, &mut gradient, &mut []))
            .and_then(|()| nlp.hessian(&z, 1.0, &[], &mut triangle))
            .map_err(|error| Error::ocp(&error))?;
        let mut dense = vec![0.0; n * n];
        for (k, i, j) in nlp.structure().hessian.entries() {
            (dense[i * n + j], dense[j * n + i]) = (triangle[k], triangle[k]);
        }
        Ok(array(py, dense, &[n, n])?.into_any())
    }

    /// Solves from one start.
    ///
    /// Parameters
    /// ----------
    /// z : array_like, shape (n_variables,), or Report
    ///     Start; a report of an earlier solve gives its multipliers as well.
    /// solver : {'sqp', 'sqp_bfgs', 'lbfgs', 'gradient_descent'}, optional
    ///     Sequential quadratic programming with the exact or a quasi-Newton Hessian, or first-order methods.
    /// tol : float, optional
    ///     Of the scaled gradient.
    /// max_iterations : int, optional
    /// max_time : float, optional
    ///     s.
    /// callback : callable, optional
    ///     ``callback(iteration, z, cost, residual)`` after each step; the solve stops where it returns true.
    /// on_interrupt : {'return', 'raise'}, optional
    ///     What Ctrl-C does: return the best iterate, or raise with it as the attribute ``report``.
    ///
    /// Returns
    /// -------
    /// Report
    ///     With the best iterate, whatever the status.
    #[pyo3(signature = (
        z, *, solver="sqp", tol=None, max_iterations=None, max_time=None, callback=None, on_interrupt="return"
    ))]
    fn solve(
        &self,
        py: Python<'_>,
        z: &Bound<'_, PyAny>,
        solver: &str,
        tol: Option<f64>,
        max_iterations: Option<usize>,
        max_time: Option<f64>,
        callback: Option<&Bound<'_, PyAny>>,
        on_interrupt: &str,
    ) -> Result<Report, Error> {
        let start = match z.cast::<Report>() {
            Ok(report) => report.get().report.start(),
            Err(_) => self.variables(z)?.into(),
        };
        let arguments = SolverArguments { solver, tol, max_iterations, max_time, callback, on_interrupt };
        arguments.solve(py, &mut self.nlp.clone(), &start, false)
    }

    /// Solves from many starts, in parallel, and gathers the distinct minima.
    ///
    /// Starts are a Latin hypercube of coefficients within `reach` of the line from the cart's start to its target. With
    /// more than ten variables few of these converge: then they are for the same problem with at most ten, whose best
    /// minima start one with five more, and so on. The same arguments give the same minima for any
    /// number of threads.
    ///
    /// Parameters
    /// ----------
    /// n_starts : int, optional
    ///     Random ones.
    /// starts : array_like, shape (m, n_variables), optional
    ///     Others, numbered before the random ones.
    /// seed : int, optional
    /// reach : float, optional
    ///     m.
    /// distance_tol : float, optional
    ///     Two minima are the same if no variable differs by more, relative to its size where that is above 1.
    /// on_interrupt : {'return', 'raise'}, optional
    ///     What Ctrl-C does: return what has been found, or raise.
    ///
    /// Returns
    /// -------
    /// SwingUpSearch
    #[pyo3(signature = (
        n_starts=32, *, starts=None, seed=0, reach=2.0, distance_tol=1e-4, on_interrupt="return"
    ))]
    fn search(
        &self,
        py: Python<'_>,
        n_starts: usize,
        starts: Option<Vec<Bound<'_, PyAny>>>,
        seed: u64,
        reach: f64,
        distance_tol: f64,
        on_interrupt: &str,
    ) -> Result<SwingUpSearch, Error> {
        let returned = returns_interrupted(on_interrupt)?;
        if n_starts == 0 && starts.is_none() {
            return Err(Error::input("`n_starts` must be positive where no `starts` are given, found 0"));
        }
        let given = starts
            .iter()
            .flatten()
            .map(|z| Ok(self.variables(z)?.into()))
            .collect::<Result<Vec<Start>, Error>>()?;
        let many = MultiStart { distance_tol, ..MultiStart::new(Sqp::default()) };
        let stop = AtomicBool::new(false);
        let (found, raised) = py.detach(|| {
            thread::scope(|scope| {
                let search = scope.spawn(|| self.climb(&many, given, n_starts, (reach, seed), &stop));
                let mut raised = None;
                while !search.is_finished() {
                    thread::park_timeout(ATTENTION / 10);
                    if raised.is_none()
                        && let Err(error) = Python::attach(|py| py.check_signals())
                    {
                        stop.store(true, Ordering::Relaxed);
                        raised = Some(error);
                    }
                }
                (search.join(), raised)
            })
        });
        let found = found.map_err(|_| Error::ocp(&"the search broke off"))??;
        match raised {
            Some(error) if !(returned && error.is_instance_of::<PyKeyboardInterrupt>(py)) => {
                Err(error.into())
            }
            _ => SwingUpSearch::of(py, found),
        }
    }

    /// The decision vector with which this problem has the motion nearest to one of another problem.
    ///
    /// Parameters
    /// ----------
    /// other : CartPendulumProblem
    ///     With another number of variables, say.
    /// z : array_like, shape (other.n_variables,)
    ///
    /// Returns
    /// -------
    /// ndarray, shape (n_variables,)
    fn carry_over<'py>(
        &self,
        py: Python<'py>,
        other: &Bound<'py, CartPendulumProblem>,
        z: &Bound<'py, PyAny>,
    ) -> Result<Bound<'py, PyAny>, Error> {
        let z = other.get().variables(z)?;
        Ok(numpy::PyArray1::from_vec(py, self.problem.carry_over(&other.get().problem, &z)?).into_any())
    }

    /// The motion that a decision vector makes, q = (r, θ).
    ///
    /// Parameters
    /// ----------
    /// z : array_like, shape (n_variables,)
    ///
    /// Returns
    /// -------
    /// Motion
    ///     At the nodes; the force on the cart is ``torque[:, 0]``.
    fn motion(&self, z: &Bound<'_, PyAny>) -> Result<Motion, Error> {
        let z = self.variables(z)?;
        let mut shooting = self.problem.shooting()?;
        shooting.rollout(&z).map_err(|error| Error::ocp(&error))?;
        Ok(Motion::of(&shooting))
    }

    /// Integrates the motion of a decision vector anew and accurately.
    ///
    /// Parameters
    /// ----------
    /// z : array_like, shape (n_variables,)
    ///
    /// Returns
    /// -------
    /// SwingUpVerification
    fn verify(&self, py: Python<'_>, z: &Bound<'_, PyAny>) -> Result<SwingUpVerification, Error> {
        let z = self.variables(z)?;
        let model = self.problem.system.model()?;
        let mut shooting = self.problem.shooting()?;
        py.detach(|| {
            let verification = verify(&mut shooting, &model, &z).map_err(unverified)?;
            // no fewer steps than ten for each of the thesis'
            let factor = 2000_usize.div_ceil(self.problem.n_steps);
            let refined = |factor| {
                let mut nlp = self.problem.refined(factor).swing_up()?;
                nlp.evaluate(&z, &mut []).map_err(|error| Error::ocp(&error))
            };
            let (coarse, cost) = (refined(factor)?, refined(2 * factor)?);
            Ok(SwingUpVerification { verification, cost, cost_error: (cost - coarse).abs() / cost.abs() })
        })
    }

    fn __repr__(&self) -> String {
        let swing_up::CartPendulumProblem { duration, n_steps, n_coefficients, .. } = &self.problem;
        let n = self.n_variables();
        format!("<CartPendulumProblem: {n} variables, n_par {n_coefficients}, {n_steps} steps, {duration} s>")
    }
}

/// What came of many starts.
#[pyclass(frozen, module = "somersault.ocp")]
pub(crate) struct SwingUpSearch {
    minima: Vec<Py<Report>>,
    /// list of list of int: Numbers of the starts that led to each minimum.
    #[pyo3(get)]
    starts: Vec<Vec<usize>>,
    failures: Vec<(usize, String)>,
}

impl SwingUpSearch {
    fn of(py: Python<'_>, found: MultiStartReport) -> Result<Self, Error> {
        let mut search = Self { minima: Vec::new(), starts: Vec::new(), failures: Vec::new() };
        for minimum in found.minima {
            search.minima.push(Py::new(py, Report { report: minimum.report })?);
            search.starts.push(minimum.starts);
        }
        for failure in found.failures {
            let cause = match failure.cause {
                FailureCause::Ended(report) => report.status.message().to_owned(),
                FailureCause::Error(error) => error.to_string(),
                FailureCause::Skipped => "not begun".to_owned(),
            };
            search.failures.push((failure.start, cause));
        }
        Ok(search)
    }
}

#[pymethods]
impl SwingUpSearch {
    /// list of Report: Distinct minima, that of least cost first.
    #[getter]
    fn minima(&self, py: Python<'_>) -> Vec<Py<Report>> {
        self.minima.iter().map(|report| report.clone_ref(py)).collect()
    }

    /// Report: The minimum of least cost.
    #[getter]
    fn best(&self, py: Python<'_>) -> Result<Py<Report>, Error> {
        match self.minima.first() {
            Some(report) => Ok(report.clone_ref(py)),
            None => Err(Error::ocp(&"no start led to a minimum; see `failures`")),
        }
    }

    /// list of tuple: Number of each start that led to no minimum, and why.
    #[getter]
    fn failures(&self) -> Vec<(usize, String)> {
        self.failures.clone()
    }

    fn __repr__(&self) -> String {
        let converged: usize = self.starts.iter().map(Vec::len).sum();
        format!(
            "<SwingUpSearch: {} distinct minima from {converged} of {} starts>",
            self.minima.len(),
            converged + self.failures.len()
        )
    }
}

/// A swing-up integrated anew, with the same motion of the cart.
#[pyclass(frozen, module = "somersault.ocp")]
pub(crate) struct SwingUpVerification {
    verification: Verification,
    /// float: Cost of the motion integrated accurately from start to end.
    #[pyo3(get)]
    cost: f64,
    /// float: Relative change of that cost when its step was last halved.
    #[pyo3(get)]
    cost_error: f64,
}

fn unverified(error: VerificationError) -> Error {
    match error {
        VerificationError::Problem(error) => error.into(),
        VerificationError::Integration(error) => error.into(),
        VerificationError::Dynamics(error) => error.into(),
        error => Error::ocp(&error),
    }
}

#[pymethods]
impl SwingUpVerification {
    /// ndarray, shape (n_steps,): For each step, integrated accurately from the node where it begins, the distance at its
    /// end: the largest difference of q or v.
    #[getter]
    fn defects<'py>(&self, py: Python<'py>) -> Bound<'py, PyAny> {
        numpy::PyArray1::from_slice(py, &self.verification.defects).into_any()
    }

    /// float: The largest defect.
    #[getter]
    fn max_defect(&self) -> f64 {
        self.verification.largest_defect()
    }

    /// float: The distance at T, integrated from the start in one piece.
    #[getter]
    fn terminal_error(&self) -> f64 {
        self.verification.terminal_error
    }

    /// What the motion is worth, in a sentence.
    ///
    /// Parameters
    /// ----------
    /// allowed : float, optional
    ///     Distance that its use allows.
    ///
    /// Returns
    /// -------
    /// str
    #[pyo3(signature = (allowed=1e-4))]
    fn sentence(&self, allowed: f64) -> String {
        self.verification.sentence(allowed, None)
    }

    fn __repr__(&self) -> String {
        let (end, defect) = (self.terminal_error(), self.max_defect());
        format!(
            "<SwingUpVerification: cost {:.8}, terminal error {end:.1e}, largest defect {defect:.1e}>",
            self.cost
        )
    }
}
