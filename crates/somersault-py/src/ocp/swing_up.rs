//! The pendulum on a cart, brought from one state to another.

use super::arguments::{count, limit, seed_of, starts_or_none};
use super::problem::Motion;
use super::search::{SearchArguments, SearchResult};
use super::solver::{Report, SolverArguments, deadline};
use super::verification::{SwingUpVerification, VerificationFailure, Verifier};
use crate::core::convert::{
    array, entries_or_none, finite, integer, integer_or_none, numbers_or_one, with_shape,
};
use crate::core::error::Error;
use crate::core::value::{Pickled, by_restore, value};
use crate::core::waiting::{cancel_on_signal, returns_interrupted};
use crate::multibody::model::Model;
use pyo3::prelude::*;
use pyo3::types::PyType;
use somersault::multibody::models::CartPendulum;
use somersault::nlp::{self, Iteration, Nlp, Sqp, Start};
use somersault::ocp::shooting::Scheme;
use somersault::ocp::swing_up::{self, SingleShooting, SwingUp};
use somersault::ocp::transcription::Transcription;
use std::sync::Arc;

/// Names that the library has for arguments of [`CartPendulumProblem`].
const NAMES: [(&str, &str); 7] = [
    ("n_coefficients", "n_par"),
    ("system.cart_mass", "cart_mass"),
    ("system.mass", "mass"),
    ("system.length", "length"),
    ("system.gravity", "gravity"),
    ("range.lower", "reach"),
    ("range", "reach"),
];

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
/// InputError
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
    /// The cost of a motion.
    single: SingleShooting,
    /// What is solved.
    lifted: SwingUp,
}

impl CartPendulumProblem {
    fn of(problem: swing_up::CartPendulumProblem) -> Result<Self, Error> {
        let make = || -> Result<Self, Error> {
            let (single, lifted) = (problem.single_shooting()?, problem.swing_up()?);
            // the tree, and the transcription, must exist as well
            problem.shooting()?;
            Ok(Self { single, lifted, problem: problem.clone() })
        };
        make().map_err(|error| error.with_names(&NAMES))
    }

    /// What integrates the motion of a report again.
    fn verifier(&self, report: &nlp::Report) -> Option<Arc<Verifier>> {
        let (problem, shown, cost) = (self.problem.clone(), self.problem.clone(), report.cost);
        let z = report.z[..self.n_variables()].to_vec();
        let same = z.clone();
        let verifier = Verifier::new(move |py| {
            let found = cancel_on_signal(py, |token| {
                problem.verify_cancellable(&z, token).map_err(VerificationFailure)
            })?;
            Ok(SwingUpVerification::of(py, found, cost)?.into_any())
        });
        Some(Arc::new(
            verifier.with_motion(move |py| Ok(Py::new(py, motion(py, &shown, &same)?)?.into_any())),
        ))
    }

    /// A start whose nodes are on the motion of given variables.
    fn start_at(&self, z: &Bound<'_, PyAny>) -> Result<Start, Error> {
        Ok(self.lifted.clone().start_on_motion(&self.variables(z)?)?)
    }

    /// A cold start, or one from variables or from a report.
    fn start_from(&self, z: Option<&Bound<'_, PyAny>>) -> Result<Start, Error> {
        let Some(z) = z else { return Ok(self.lifted.start(&self.lifted.straight_line())?) };
        let Ok(report) = z.cast::<Report>() else { return self.start_at(z) };
        let nlp::Report { z, constraint_multipliers, hessian, .. } = &report.get().report;
        Ok(Start {
            constraint_multipliers: constraint_multipliers.clone(),
            hessian: hessian.clone(),
            ..self.lifted.clone().start_on_motion(z)?
        })
    }

    fn variables(&self, z: &Bound<'_, PyAny>) -> Result<Vec<f64>, Error> {
        let z = with_shape("z", &[self.n_variables()], z)?;
        z.iter().try_for_each(|x| finite("z", *x).map(|_| ()))?;
        Ok(z)
    }
}

pub(super) fn scheme_of(name: &str) -> Result<Scheme, Error> {
    match name {
        "euler" => Ok(Scheme::ExplicitEuler),
        "rk4" => Ok(Scheme::RungeKutta4),
        other => Err(Error::input(format!("`scheme` must be 'euler' or 'rk4', found '{other}'"))),
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

/// The motion that a decision vector makes.
fn motion(py: Python<'_>, problem: &swing_up::CartPendulumProblem, z: &[f64]) -> Result<Motion, Error> {
    let mut shooting = problem.shooting()?;
    shooting.rollout(z).map_err(|error| Error::evaluation(error.to_string()))?;
    Ok(Motion::of(Py::new(py, Model::of(problem.system.model()?))?, &shooting))
}

/// A report in the variables of the cart alone.
fn of_cart(mut report: nlp::Report, n_variables: usize) -> nlp::Report {
    report.z.truncate(n_variables);
    report.bound_multipliers.truncate(n_variables);
    report
}

value! {
    impl CartPendulumProblem {
        /// int: Length of z.
        n_variables: usize = |own| own.lifted.n_parameters();
        /// Model: The tree, q = (r, θ).
        model: Result<Model, Error> = |own| Ok(Model::of(own.problem.system.model()?));
    }
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
        #[pyo3(from_py_with = integer)] n_steps: i64,
        #[pyo3(from_py_with = integer)] n_par: i64,
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
        Self::of(swing_up::CartPendulumProblem {
            system: CartPendulum { cart_mass, mass, length, gravity },
            start: four("start", start, default.start)?,
            target: four("target", target, default.target)?,
            duration,
            n_steps: count("n_steps", n_steps, 1)?,
            n_coefficients: count("n_par", n_par, 6)?,
            scheme: scheme_of(scheme)?,
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
    ///
    /// Examples
    /// --------
    /// >>> from somersault import ocp
    /// >>> ocp.CartPendulumProblem.case("C").n_variables
    /// 15
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

    /// The cost.
    ///
    /// Parameters
    /// ----------
    /// z : array_like, shape (n_variables,)
    ///
    /// Returns
    /// -------
    /// float
    ///
    /// Examples
    /// --------
    /// >>> import numpy as np
    /// >>> from somersault import ocp
    /// >>> problem = ocp.CartPendulumProblem()
    /// >>> best = problem.solve().z
    /// >>> round(problem.cost(best), 2), problem.cost(best) < problem.cost(np.zeros(5))
    /// (478.39, True)
    fn cost(&self, z: &Bound<'_, PyAny>) -> Result<f64, Error> {
        let z = self.variables(z)?;
        self.single.clone().evaluate(&z, &mut []).map_err(|error| Error::evaluation(error.to_string()))
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
    ///
    /// Examples
    /// --------
    /// It vanishes at a solution:
    ///
    /// >>> from somersault import ocp
    /// >>> problem = ocp.CartPendulumProblem()
    /// >>> bool(abs(problem.gradient(problem.solve().z)).max() < 1e-3)
    /// True
    fn gradient<'py>(&self, py: Python<'py>, z: &Bound<'py, PyAny>) -> Result<Bound<'py, PyAny>, Error> {
        let z = self.variables(z)?;
        let (mut nlp, mut gradient) = (self.single.clone(), vec![0.0; z.len()]);
        nlp.evaluate(&z, &mut [])
            .and_then(|_| nlp.differentiate(&z, &mut gradient, &mut []))
            .map_err(|error| Error::evaluation(error.to_string()))?;
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
    ///
    /// Examples
    /// --------
    /// It is positive definite at a minimum:
    ///
    /// >>> import numpy as np
    /// >>> from somersault import ocp
    /// >>> problem = ocp.CartPendulumProblem()
    /// >>> bool((np.linalg.eigvalsh(problem.hessian(problem.solve().z)) > 0.0).all())
    /// True
    fn hessian<'py>(&self, py: Python<'py>, z: &Bound<'py, PyAny>) -> Result<Bound<'py, PyAny>, Error> {
        let z = self.variables(z)?;
        let (mut nlp, n) = (self.single.clone(), z.len());
        let mut gradient = vec![0.0; n];
        let mut triangle = vec![0.0; n * (n + 1) / 2];
        nlp.evaluate(&z, &mut [])
            .and_then(|_| nlp.differentiate(&z, &mut gradient, &mut []))
            .and_then(|()| nlp.hessian(&z, 1.0, &[], &mut triangle))
            .map_err(|error| Error::evaluation(error.to_string()))?;
        let mut dense = vec![0.0; n * n];
        for (k, i, j) in nlp.structure().hessian.entries() {
            (dense[i * n + j], dense[j * n + i]) = (triangle[k], triangle[k]);
        }
        Ok(array(py, dense, &[n, n])?.into_any())
    }

    /// Solves from one start.
    ///
    /// Sequential quadratic programming solves the lifted form: the state of the pendulum at a few nodes and the terminal
    /// error are variables as well, so that a step is not bent by the whole motion. The report has z alone; its
    /// multipliers are those of (θ, θ̇) at the nodes and of the error (θ, θ̇, r, ṙ), and unless it has converged its cost
    /// is that of a motion with gaps at the nodes, as large as its ``feasibility`` says. First-order methods have z alone
    /// for variables.
    ///
    /// Parameters
    /// ----------
    /// z : array_like, shape (n_variables,), or Report, optional
    ///     Start, with nodes on its motion; a report of an earlier solve gives its multipliers as well. By default the
    ///     cart is on the straight line from its start to its target, and the nodes are on that of the pendulum.
    /// solver : {'sqp', 'sqp_bfgs', 'lbfgs', 'gradient_descent'}, optional
    ///     Sequential quadratic programming with the exact or a quasi-Newton Hessian, or first-order methods.
    /// tol : float, optional
    ///     Of the scaled gradient of the Lagrangian, and of the gaps.
    /// max_iterations : int, optional
    /// max_evaluations : int, optional
    ///     Of cost and constraints.
    /// max_time : float, optional
    ///     s.
    /// callback : callable, optional
    ///     ``callback(iteration, z, cost, residual)`` after each step; the solve stops where it returns true.
    /// on_interrupt : {'raise', 'return'}, optional
    ///     What Ctrl-C does: raise with the best iterate as the attribute ``solution``, or return it.
    ///
    /// Returns
    /// -------
    /// Report
    ///     With the best iterate, whatever the status.
    ///
    /// Examples
    /// --------
    /// >>> from somersault import ocp
    /// >>> report = ocp.CartPendulumProblem().solve()
    /// >>> report.status, round(report.cost, 2)
    /// ('converged', 478.39)
    #[pyo3(signature = (
        z=None, *, solver="sqp", tol=None, max_iterations=None, max_evaluations=None, max_time=None, callback=None,
        on_interrupt="raise"
    ))]
    fn solve(
        &self,
        py: Python<'_>,
        z: Option<&Bound<'_, PyAny>>,
        solver: &str,
        tol: Option<f64>,
        #[pyo3(from_py_with = integer_or_none)] max_iterations: Option<i64>,
        #[pyo3(from_py_with = integer_or_none)] max_evaluations: Option<i64>,
        max_time: Option<f64>,
        callback: Option<&Bound<'_, PyAny>>,
        on_interrupt: &str,
    ) -> Result<Report, Error> {
        let mut start = self.start_from(z)?;
        let arguments = SolverArguments {
            solver,
            tol,
            max_iterations,
            max_evaluations,
            max_time,
            callback,
            on_interrupt,
        };
        let n = self.n_variables();
        if !solver.starts_with("sqp") {
            start.z.truncate(n);
            let mut nlp = self.single.clone();
            return arguments.solve(py, &mut nlp, &start.z.into(), false, |report| self.verifier(report));
        }
        let mut nlp = self.lifted.clone();
        let solve = |solver: &dyn nlp::NlpSolver, watch: super::solver::Watch<'_>| {
            let mut watch_cart =
                |iteration: &Iteration<'_>| watch(&Iteration { z: &iteration.z[..n], ..*iteration });
            Ok(of_cart(solver.solve(&mut nlp, &start, &mut watch_cart)?, n))
        };
        arguments.solve_by(py, false, solve, |report| self.verifier(report))
    }

    /// Solves from many starts, in parallel, and gathers the distinct minima.
    ///
    /// The first start is the straight lines of cart and pendulum. Others are a Latin hypercube about these: five half waves
    /// of the cart, and nodes of the pendulum up to 1 rad away. The same arguments give the same minima for any number of
    /// threads.
    ///
    /// Parameters
    /// ----------
    /// n_starts : int, optional
    ///     Those of the library.
    /// starts : array_like, shape (m, n_variables), optional
    ///     Others, numbered before these, with nodes on their motion.
    /// seed : int, optional
    /// reach : float, optional
    ///     Amplitude of the first half wave, m; that of the m-th is an m-th of it.
    /// distance_tol : float, optional
    ///     Two minima are the same if no variable differs by more, relative to its size where that is above 1.
    /// max_iterations, max_evaluations : int, optional
    ///     Of each start; evaluations are those of cost and constraints.
    /// max_time : float, optional
    ///     Of all starts, s.
    /// on_interrupt : {'raise', 'return'}, optional
    ///     What Ctrl-C does: raise with what has been found as the attribute ``solution``, or return it.
    ///
    /// Returns
    /// -------
    /// SearchResult
    ///
    /// Examples
    /// --------
    /// >>> from somersault import ocp
    /// >>> found = ocp.CartPendulumProblem().search(4, seed=1)
    /// >>> found.success, len(found.minima)
    /// (True, 1)
    #[pyo3(signature = (
        n_starts=32, *, starts=None, seed=0, reach=1.0, distance_tol=1e-4, max_iterations=None, max_evaluations=None,
        max_time=None, on_interrupt="raise"
    ))]
    fn search(
        &self,
        py: Python<'_>,
        #[pyo3(from_py_with = integer)] n_starts: i64,
        #[pyo3(from_py_with = entries_or_none)] starts: Option<Vec<Bound<'_, PyAny>>>,
        #[pyo3(from_py_with = integer)] seed: i64,
        reach: f64,
        distance_tol: f64,
        #[pyo3(from_py_with = integer_or_none)] max_iterations: Option<i64>,
        #[pyo3(from_py_with = integer_or_none)] max_evaluations: Option<i64>,
        max_time: Option<f64>,
        on_interrupt: &str,
    ) -> Result<SearchResult, Error> {
        let returned = returns_interrupted(on_interrupt)?;
        let (n_starts, seed) = (count("n_starts", n_starts, 0)?, seed_of(seed)?);
        let given = starts_or_none(starts, n_starts)?;
        let from =
            |z: &Bound<'_, PyAny>| self.start_at(z).map_err(|error| error.with_names(&[("z", "starts")]));
        let mut all = given.iter().map(from).collect::<Result<Vec<Start>, Error>>()?;
        let cold = self.lifted.starts(n_starts, reach, seed);
        all.extend(cold.map_err(|error| Error::from(error).with_names(&NAMES))?);
        let default = Sqp::default();
        let solver = Sqp {
            max_iterations: limit("max_iterations", max_iterations, 0)?.unwrap_or(default.max_iterations),
            max_evaluations: limit("max_evaluations", max_evaluations, 1)?,
            ..default
        };
        let arguments = SearchArguments { solver, distance_tol, deadline: deadline(max_time)?, returned };
        let n = self.n_variables();
        let make = || Ok(self.lifted.clone());
        arguments.run(py, &all, make, |report| of_cart(report, n), |report| self.verifier(report), |_| None)
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
    ///
    /// Examples
    /// --------
    /// The solution with few splines as a start with more:
    ///
    /// >>> from somersault import ocp
    /// >>> few, more = ocp.CartPendulumProblem.case("A"), ocp.CartPendulumProblem.case("B")
    /// >>> start = more.carry_over(few, few.solve().z)
    /// >>> more.solve(start).status
    /// 'converged'
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
    ///
    /// Examples
    /// --------
    /// >>> from somersault import ocp
    /// >>> problem = ocp.CartPendulumProblem()
    /// >>> motion = problem.motion(problem.solve().z)
    /// >>> motion.q[-1].round(2) + 0.0
    /// array([0., 0.])
    fn motion(&self, py: Python<'_>, z: &Bound<'_, PyAny>) -> Result<Motion, Error> {
        motion(py, &self.problem, &self.variables(z)?)
    }

    /// Integrates the motion of a decision vector again and accurately.
    ///
    /// Parameters
    /// ----------
    /// z : array_like, shape (n_variables,)
    ///
    /// Returns
    /// -------
    /// SwingUpVerification
    ///
    /// Examples
    /// --------
    /// Ten steps of explicit Euler do not describe a pendulum:
    ///
    /// >>> from somersault import ocp
    /// >>> problem = ocp.CartPendulumProblem(n_steps=10)
    /// >>> problem.verify(problem.solve().z).confirmed
    /// False
    fn verify(&self, py: Python<'_>, z: &Bound<'_, PyAny>) -> Result<Py<SwingUpVerification>, Error> {
        let z = self.variables(z)?;
        let cost = self
            .single
            .clone()
            .evaluate(&z, &mut [])
            .map_err(|error| Error::evaluation(error.to_string()))?;
        let found = cancel_on_signal(py, |token| {
            self.problem.verify_cancellable(&z, token).map_err(VerificationFailure)
        })?;
        Ok(SwingUpVerification::of(py, found, cost)?)
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> Pickled<'py> {
        let problem = &slf.get().problem;
        let CartPendulum { cart_mass, mass, length, gravity } = problem.system;
        let scheme = if problem.scheme == Scheme::ExplicitEuler { "euler" } else { "rk4" };
        let arguments = (
            (problem.start, problem.target),
            problem.duration,
            (problem.n_steps, problem.n_coefficients),
            scheme,
            (problem.terminal_weights, problem.force_weight, problem.running_weights),
            (cart_mass, mass, length, gravity),
        );
        by_restore(slf, arguments)
    }

    /// A pickled problem.
    #[classmethod]
    fn _restore(
        _: &Bound<'_, PyType>,
        states: ([f64; 4], [f64; 4]),
        duration: f64,
        sizes: (i64, i64),
        scheme: &str,
        weights: ([f64; 4], f64, [f64; 4]),
        system: (f64, f64, f64, f64),
    ) -> Result<Self, Error> {
        let (terminal_weights, force_weight, running_weights) = weights;
        let (cart_mass, mass, length, gravity) = system;
        Self::of(swing_up::CartPendulumProblem {
            system: CartPendulum { cart_mass, mass, length, gravity },
            start: states.0,
            target: states.1,
            duration,
            n_steps: count("n_steps", sizes.0, 1)?,
            n_coefficients: count("n_par", sizes.1, 6)?,
            scheme: scheme_of(scheme)?,
            terminal_weights,
            force_weight,
            running_weights,
        })
    }

    fn __repr__(&self) -> String {
        let swing_up::CartPendulumProblem { duration, n_steps, n_coefficients, .. } = &self.problem;
        let n = self.n_variables();
        format!("<CartPendulumProblem: {n} variables, n_par {n_coefficients}, {n_steps} steps, {duration} s>")
    }
}
