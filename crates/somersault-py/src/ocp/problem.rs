//! Motion problems by shooting.

use super::joint_motion::SplineMotion;
use super::solver::{Report, SolverArguments};
use super::term::{Term, sizes_of};
use crate::convert::{array, finite, numbers_or_one, with_shape};
use crate::error::Error;
use crate::model::Model;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PySlice};
use somersault::ocp;
use somersault::ocp::dynamics::Tree;
use somersault::ocp::nlp::{Bounds, EvaluationError, Nlp};
use somersault::ocp::problem::{At, Loss};
use somersault::ocp::shooting::{self, Drive, Duration, Scheme, Shooting, ShootingOptions, Start};
use somersault::ocp::transcription::Transcription;
use std::ops::{Deref, DerefMut};
use std::sync::{Mutex, MutexGuard, PoisonError, TryLockError};
use std::thread::ThreadId;

/// A phase of a motion.
///
/// Parameters
/// ----------
/// motion : SplineMotion
///     Of the driven joints, or of their torques.
/// duration : float or tuple of float
///     s; a pair makes the duration a variable between the two.
/// n_steps : int
///     Steps of equal length.
/// n_segments : int, optional
///     1 for single shooting; more for multiple shooting, whose starts are variables.
#[pyclass(frozen, module = "somersault.ocp")]
pub(crate) struct Phase(shooting::Phase);

/// A number, or a range.
#[derive(FromPyObject)]
enum NumberOrRange {
    Number(f64),
    Range(f64, f64),
}

#[pymethods]
impl Phase {
    #[new]
    #[pyo3(signature = (motion, duration, n_steps, *, n_segments=1))]
    fn new(
        motion: &Bound<'_, SplineMotion>,
        duration: NumberOrRange,
        n_steps: usize,
        n_segments: usize,
    ) -> Self {
        let duration = match duration {
            NumberOrRange::Number(duration) => Duration::Fixed(duration),
            NumberOrRange::Range(lower, upper) => Duration::Free { lower, upper },
        };
        Self(shooting::Phase { motion: motion.get().motion.clone(), n_steps, duration, n_segments })
    }
}

fn at_of(at: &str, node: Option<usize>) -> Result<At, Error> {
    match (at, node) {
        ("start", None) => Ok(At::Start),
        ("finish", None) => Ok(At::End),
        ("path", None) => Ok(At::EveryNode),
        ("node", Some(node)) => Ok(At::Node(node)),
        ("node", None) => Err(Error::input("`node` must be given where `at` is 'node'")),
        ("start" | "finish" | "path", Some(_)) => Err(Error::input("`node` is for `at` = 'node'")),
        (other, _) => {
            Err(Error::input(format!("`at` must be 'start', 'finish', 'node' or 'path', found '{other}'")))
        }
    }
}

/// Part of the cost: ½ Σ wᵢ (rᵢ − tᵢ)² of the rows r of a term, or Σ wᵢ rᵢ.
///
/// Parameters
/// ----------
/// term : Term
/// weights : float or array_like, shape (n_rows,), optional
///     w.
/// target : float or array_like, shape (n_rows,), optional
///     t.
/// at : {'path', 'start', 'finish', 'node'}, optional
///     Integrated over the whole motion (Lagrange), or taken at one time (Mayer).
/// node : int, optional
///     Which node, where `at` is ``'node'``.
/// linear : bool, optional
///     Σ wᵢ rᵢ instead of squares.
#[pyclass(frozen, module = "somersault.ocp")]
pub(crate) struct Cost {
    term: Py<Term>,
    weights: Option<Py<PyAny>>,
    target: Option<Py<PyAny>>,
    at: At,
    linear: bool,
}

#[pymethods]
impl Cost {
    #[new]
    #[pyo3(signature = (term, weights=None, target=None, *, at="path", node=None, linear=false))]
    fn new(
        term: Py<Term>,
        weights: Option<Py<PyAny>>,
        target: Option<Py<PyAny>>,
        at: &str,
        node: Option<usize>,
        linear: bool,
    ) -> Result<Self, Error> {
        if linear && target.is_some() {
            return Err(Error::input("`target` is for squares; leave out `linear`"));
        }
        Ok(Self { term, weights, target, at: at_of(at, node)?, linear })
    }
}

impl Cost {
    fn loss(&self, py: Python<'_>, n_rows: usize) -> Result<Loss, Error> {
        let numbers = |name, value: &Option<Py<PyAny>>, default| match value {
            Some(value) => numbers_or_one(name, n_rows, value.bind(py)),
            None => Ok(vec![default; n_rows]),
        };
        let weights = numbers("weights", &self.weights, 1.0)?;
        Ok(if self.linear {
            Loss::Linear { weights }
        } else {
            Loss::HalfSquares { weights, target: numbers("target", &self.target, 0.0)? }
        })
    }
}

/// Bounds on the rows of a term.
///
/// Parameters
/// ----------
/// term : Term
/// lower, upper : float or array_like, shape (n_rows,)
///     Equal for an equality, infinite where there is no bound.
/// at : {'path', 'start', 'finish', 'node', 'integral'}, optional
///     At every node, at one, or of the integral over time.
/// node : int, optional
///     Which node, where `at` is ``'node'``.
#[pyclass(frozen, module = "somersault.ocp")]
pub(crate) struct Constraint {
    term: Py<Term>,
    lower: Py<PyAny>,
    upper: Py<PyAny>,
    at: At,
    integral: bool,
}

#[pymethods]
impl Constraint {
    #[new]
    #[pyo3(signature = (term, lower, upper, *, at="path", node=None))]
    fn new(
        term: Py<Term>,
        lower: Py<PyAny>,
        upper: Py<PyAny>,
        at: &str,
        node: Option<usize>,
    ) -> Result<Self, Error> {
        let integral = at == "integral";
        let at = if integral { At::EveryNode } else { at_of(at, node)? };
        Ok(Self { term, lower, upper, at, integral })
    }
}

/// A motion problem: passive joints follow the equations of motion, driven ones splines.
///
/// The decision vector z holds what is free of the start, the parameters of the splines, free durations and the starts of
/// segments; see `parts`.
///
/// Parameters
/// ----------
/// model : Model
///     The tree.
/// q, v : array_like, shape (n_positions,) and (n_velocities,)
///     Passive state at the start; what they hold for driven joints is not read.
/// phases : sequence of Phase
///     One after the other.
/// active : sequence of str or of bool
///     Driven bodies, or degrees of freedom.
/// drive : {'motion', 'torque'}, optional
///     Whether the splines are the motion of the driven joints, or their torques.
/// scheme : {'rk4', 'euler'}, optional
///     Runge–Kutta steps, on the group where joints rotate freely; or explicit Euler, as in the thesis.
/// costs : sequence of Cost, optional
/// constraints : sequence of Constraint, optional
/// free_positions, free_velocities : sequence of bool, shape (n_velocities,), optional
///     Degrees of freedom whose start is a variable.
/// lower, upper : array_like, shape (n_variables,), optional
///     Bounds on z beside those of free durations.
/// exact_hessian : bool, optional
///     The exact Hessian of the Lagrangian in place of that of Gauss and Newton: where joints are hinges or
///     sliders, durations fixed, and terms entries or displacements.
///
/// Raises
/// ------
/// OcpInputError
///     If the parts do not fit each other, or bounds contradict.
#[pyclass(frozen, module = "somersault.ocp")]
pub(crate) struct MotionProblem {
    problem: Mutex<Inner>,
    /// The thread that holds the problem.
    holder: Mutex<Option<ThreadId>>,
    n_variables: usize,
    n_constraints: usize,
    calls_python: bool,
}

#[pymethods]
impl MotionProblem {
    #[new]
    #[pyo3(signature = (
        model, q, v, phases, *, active, drive="motion", scheme="rk4", costs=vec![], constraints=vec![],
        free_positions=None, free_velocities=None, lower=None, upper=None, exact_hessian=false
    ))]
    fn new(
        py: Python<'_>,
        model: &Bound<'_, Model>,
        q: &Bound<'_, PyAny>,
        v: &Bound<'_, PyAny>,
        phases: Vec<Bound<'_, Phase>>,
        active: &Bound<'_, PyAny>,
        drive: &str,
        scheme: &str,
        costs: Vec<Bound<'_, Cost>>,
        constraints: Vec<Bound<'_, Constraint>>,
        free_positions: Option<Vec<bool>>,
        free_velocities: Option<Vec<bool>>,
        lower: Option<&Bound<'_, PyAny>>,
        upper: Option<&Bound<'_, PyAny>>,
        exact_hessian: bool,
    ) -> Result<Self, Error> {
        let tree = &model.get().model;
        let n = tree.n_velocities();
        let split = model.get().split(active)?;
        let (split, drive) = match drive {
            "motion" => (split, Drive::Motion),
            "torque" => {
                let dofs = (0..n).filter(|k| split.active()[*k]).collect();
                (somersault::multibody::Split::new(vec![false; n]), Drive::Torque { dofs })
            }
            other => {
                return Err(Error::input(format!("`drive` must be 'motion' or 'torque', found '{other}'")));
            }
        };
        let scheme = match scheme {
            "rk4" => Scheme::RungeKutta4,
            "euler" => Scheme::ExplicitEuler,
            other => return Err(Error::input(format!("`scheme` must be 'rk4' or 'euler', found '{other}'"))),
        };
        let start = Start {
            position: with_shape("q", &[tree.n_positions()], q)?,
            velocity: with_shape("v", &[n], v)?,
            free_positions: free_positions.unwrap_or_else(|| vec![false; n]),
            free_velocities: free_velocities.unwrap_or_else(|| vec![false; n]),
        };
        let dynamics = Tree::try_new(tree.clone(), split)?;
        let n_channels = phases.first().map_or(0, |phase| phase.get().0.motion.n_channels());
        let phases = phases.iter().map(|phase| phase.get().0.clone()).collect();
        let shooting = Shooting::try_new(dynamics.clone(), start, phases, ShootingOptions { scheme, drive })?;
        let sizes = sizes_of(&dynamics, n_channels);
        let mut builder = ocp::problem::MotionProblem::builder(shooting);
        let mut calls_python = false;
        for cost in &costs {
            let cost = cost.get();
            let term = cost.term.get().build(py, &dynamics, &sizes)?;
            calls_python |= cost.term.get().calls_python();
            let loss = cost.loss(py, term.n_rows())?;
            builder = match cost.at {
                At::EveryNode => builder.lagrange(term, loss)?,
                at => builder.mayer(at, term, loss)?,
            };
        }
        for constraint in &constraints {
            let constraint = constraint.get();
            let term = constraint.term.get().build(py, &dynamics, &sizes)?;
            calls_python |= constraint.term.get().calls_python();
            let n_rows = term.n_rows();
            let bounds = Bounds {
                lower: numbers_or_one("lower", n_rows, constraint.lower.bind(py))?,
                upper: numbers_or_one("upper", n_rows, constraint.upper.bind(py))?,
            };
            builder = if constraint.integral {
                builder.constrain_integral(constraint.at, term, bounds)?
            } else {
                builder.constrain(constraint.at, term, bounds)?
            };
        }
        let n_variables = builder.transcription().outline().n_variables();
        let bounds = |name, value: Option<&Bound<'_, PyAny>>, default| match value {
            Some(value) => numbers_or_one(name, n_variables, value),
            None => Ok(vec![default; n_variables]),
        };
        let lower = bounds("lower", lower, f64::NEG_INFINITY)?;
        let upper = bounds("upper", upper, f64::INFINITY)?;
        for (variable, (lower, upper)) in lower.into_iter().zip(upper).enumerate() {
            builder = builder.bound_variable(variable, lower, upper)?;
        }
        if exact_hessian {
            builder = builder.with_exact_hessian();
        }
        let problem = builder.build()?;
        Ok(Self {
            n_variables,
            n_constraints: problem.structure().constraints.len(),
            problem: Mutex::new(problem),
            holder: Mutex::new(None),
            calls_python,
        })
    }

    /// int: Length of z.
    #[getter]
    fn n_variables(&self) -> usize {
        self.n_variables
    }

    /// list of str: A name for each constraint.
    #[getter]
    fn constraint_names(&self, py: Python<'_>) -> Result<Vec<String>, Error> {
        Ok(self.acquire(py)?.constraint_names())
    }

    /// dict of str to slice or list of slice: Where z has its parts: ``'start'``, ``'parameters'`` of each phase,
    /// ``'durations'`` that are free, and ``'lifted'`` states.
    #[getter]
    fn parts<'py>(&self, py: Python<'py>) -> Result<Bound<'py, PyDict>, Error> {
        let layout = self.acquire(py)?.transcription().layout().clone();
        let slice = |range: &std::ops::Range<usize>| {
            // lengths of decision vectors are far below the limits of isize
            PySlice::new(py, range.start as isize, range.end as isize, 1)
        };
        let parts = PyDict::new(py);
        parts.set_item("start", slice(&layout.start))?;
        parts.set_item("parameters", layout.parameters.iter().map(slice).collect::<Vec<_>>())?;
        parts.set_item("durations", layout.durations.iter().flatten().copied().collect::<Vec<_>>())?;
        parts.set_item("lifted", layout.lifted.iter().map(slice).collect::<Vec<_>>())?;
        Ok(parts)
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
    fn cost(&self, py: Python<'_>, z: &Bound<'_, PyAny>) -> Result<f64, Error> {
        let (z, mut constraints) = self.room(z)?;
        self.run(py, |problem| problem.evaluate(&z, &mut constraints))
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
        Ok(numpy::PyArray1::from_vec(py, self.derivatives(py, z)?.0).into_any())
    }

    /// The constraints.
    ///
    /// Parameters
    /// ----------
    /// z : array_like, shape (n_variables,)
    ///
    /// Returns
    /// -------
    /// ndarray, shape (n_constraints,)
    fn constraints<'py>(&self, py: Python<'py>, z: &Bound<'py, PyAny>) -> Result<Bound<'py, PyAny>, Error> {
        let (z, mut constraints) = self.room(z)?;
        self.run(py, |problem| problem.evaluate(&z, &mut constraints))?;
        Ok(numpy::PyArray1::from_vec(py, constraints).into_any())
    }

    /// The Jacobian of the constraints.
    ///
    /// Parameters
    /// ----------
    /// z : array_like, shape (n_variables,)
    ///
    /// Returns
    /// -------
    /// ndarray, shape (n_constraints, n_variables)
    fn jacobian<'py>(&self, py: Python<'py>, z: &Bound<'py, PyAny>) -> Result<Bound<'py, PyAny>, Error> {
        let values = self.derivatives(py, z)?.1;
        let (shape, dense) = {
            let problem = self.acquire(py)?;
            let pattern = &problem.structure().jacobian;
            let (m, n) = (pattern.n_rows, pattern.n_columns());
            let mut dense = vec![0.0; m * n];
            for column in 0..n {
                for k in pattern.columns[column]..pattern.columns[column + 1] {
                    dense[pattern.rows[k] * n + column] = values[k];
                }
            }
            ([m, n], dense)
        };
        Ok(array(py, dense, &shape)?.into_any())
    }

    /// Solves from a start.
    ///
    /// Parameters
    /// ----------
    /// z : array_like, shape (n_variables,), or Report
    ///     Start; a report of an earlier solve gives its multipliers as well.
    /// solver : {'sqp', 'sqp_filter', 'sqp_bfgs', 'lbfgs', 'gradient_descent'}, optional
    ///     Sequential quadratic programming with the Hessian of the problem, steps judged by a merit function, which is
    ///     cautious under strong penalties, or by a filter, which takes full steps along curved constraints; with a
    ///     quasi-Newton Hessian; the last two for problems without constraints.
    /// tol : float, optional
    ///     Of the residuals of the conditions of Karush, Kuhn and Tucker, scaled.
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
            Err(_) => self.room(z)?.0.into(),
        };
        let arguments = SolverArguments { solver, tol, max_iterations, max_time, callback, on_interrupt };
        let calls_python = self.calls_python;
        let mut problem = self.acquire(py)?;
        arguments.solve(py, &mut *problem, &start, calls_python)
    }

    /// The motion that a decision vector makes.
    ///
    /// Parameters
    /// ----------
    /// z : array_like, shape (n_variables,)
    ///
    /// Returns
    /// -------
    /// Motion
    fn motion(&self, py: Python<'_>, z: &Bound<'_, PyAny>) -> Result<Motion, Error> {
        let (z, _) = self.room(z)?;
        let mut problem = self.acquire(py)?;
        let shooting = problem.transcription_mut();
        shooting.rollout(&z).map_err(undefined)?;
        Ok(Motion::of(shooting))
    }

    fn __repr__(&self) -> String {
        format!("<MotionProblem: {} variables, {} constraints>", self.n_variables, self.n_constraints)
    }
}

type Inner = ocp::problem::MotionProblem<Shooting<Tree>>;

/// A problem that no one else uses meanwhile.
struct Held<'a> {
    problem: MutexGuard<'a, Inner>,
    holder: &'a Mutex<Option<ThreadId>>,
}

impl Drop for Held<'_> {
    fn drop(&mut self) {
        *self.holder.lock().unwrap_or_else(PoisonError::into_inner) = None;
    }
}

impl Deref for Held<'_> {
    type Target = Inner;

    fn deref(&self) -> &Inner {
        &self.problem
    }
}

impl DerefMut for Held<'_> {
    fn deref_mut(&mut self) -> &mut Inner {
        &mut self.problem
    }
}

impl MotionProblem {
    /// The problem, once other threads have done with it; they need the interpreter meanwhile.
    ///
    /// A callback or a term that asks for the problem that called it would wait for itself: an error.
    fn acquire(&self, py: Python<'_>) -> Result<Held<'_>, Error> {
        let own = std::thread::current().id();
        let holder = || self.holder.lock().unwrap_or_else(PoisonError::into_inner);
        loop {
            let problem = match self.problem.try_lock() {
                Ok(problem) => problem,
                Err(TryLockError::Poisoned(poisoned)) => poisoned.into_inner(),
                Err(TryLockError::WouldBlock) if *holder() == Some(own) => {
                    return Err(Error::input(
                        "a problem cannot be evaluated by a callback or a function that it has called",
                    ));
                }
                Err(TryLockError::WouldBlock) => {
                    py.detach(|| drop(self.problem.lock()));
                    continue;
                }
            };
            *holder() = Some(own);
            return Ok(Held { problem, holder: &self.holder });
        }
    }

    fn room(&self, z: &Bound<'_, PyAny>) -> Result<(Vec<f64>, Vec<f64>), Error> {
        let z = with_shape("z", &[self.n_variables], z)?;
        for x in &z {
            finite("z", *x)?;
        }
        Ok((z, vec![0.0; self.n_constraints]))
    }

    fn run<T: Send>(
        &self,
        py: Python<'_>,
        run: impl FnOnce(&mut Inner) -> Result<T, EvaluationError> + Send,
    ) -> Result<T, Error> {
        run(&mut *self.acquire(py)?).map_err(undefined)
    }

    fn derivatives(&self, py: Python<'_>, z: &Bound<'_, PyAny>) -> Result<(Vec<f64>, Vec<f64>), Error> {
        let (z, mut constraints) = self.room(z)?;
        self.run(py, |problem| {
            let mut gradient = vec![0.0; z.len()];
            let mut jacobian = vec![0.0; problem.structure().jacobian.n_entries()];
            problem.evaluate(&z, &mut constraints)?;
            problem.differentiate(&z, &mut gradient, &mut jacobian)?;
            Ok((gradient, jacobian))
        })
    }
}

fn undefined(error: EvaluationError) -> Error {
    match error {
        EvaluationError::Failed(source) => match source.downcast::<PyErr>() {
            Ok(error) => Error::Raised(*error),
            Err(other) => Error::ocp(&other),
        },
        error => Error::ocp(&error),
    }
}

/// A motion at the nodes of a transcription, time first.
#[pyclass(frozen, module = "somersault.ocp")]
pub(crate) struct Motion {
    times: Vec<f64>,
    parts: [(usize, Vec<f64>); 7],
}

impl Motion {
    pub(crate) fn of(transcription: &impl Transcription) -> Self {
        let n_nodes = transcription.outline().n_nodes();
        let mut motion = Self { times: Vec::with_capacity(n_nodes), parts: Default::default() };
        for k in 0..n_nodes {
            let node = transcription.node(k);
            motion.times.push(node.time);
            let parts = [
                node.position,
                node.velocity,
                node.acceleration,
                node.torque,
                node.channel,
                node.channel_rate,
                node.channel_second_rate,
            ];
            for ((width, values), part) in motion.parts.iter_mut().zip(parts) {
                *width = part.len();
                values.extend_from_slice(part);
            }
        }
        motion
    }

    fn part<'py>(&self, py: Python<'py>, index: usize) -> PyResult<Bound<'py, PyAny>> {
        let (width, values) = &self.parts[index];
        Ok(array(py, values.clone(), &[self.times.len(), *width])?.into_any())
    }
}

#[pymethods]
impl Motion {
    /// ndarray, shape (n,): Times, s.
    #[getter]
    fn t<'py>(&self, py: Python<'py>) -> Bound<'py, PyAny> {
        numpy::PyArray1::from_slice(py, &self.times).into_any()
    }

    /// ndarray, shape (n, n_positions): Configurations.
    #[getter]
    fn q<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.part(py, 0)
    }

    /// ndarray, shape (n, n_velocities): Velocities.
    #[getter]
    fn v<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.part(py, 1)
    }

    /// ndarray, shape (n, n_velocities): Accelerations.
    #[getter]
    fn a<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.part(py, 2)
    }

    /// ndarray, shape (n, n_velocities): Joint forces.
    #[getter]
    fn torque<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.part(py, 3)
    }

    /// ndarray, shape (n, n_channels): Weights of eigenpostures, or driven joints.
    #[getter]
    fn channels<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.part(py, 4)
    }

    /// ndarray, shape (n, n_channels): Rates of the channels, 1/s.
    #[getter]
    fn channel_rates<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.part(py, 5)
    }

    /// ndarray, shape (n, n_channels): Second rates of the channels, 1/s².
    #[getter]
    fn channel_second_rates<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.part(py, 6)
    }

    fn __len__(&self) -> usize {
        self.times.len()
    }

    fn __repr__(&self) -> String {
        let (first, last) = (self.times.first().unwrap_or(&0.0), self.times.last().unwrap_or(&0.0));
        format!("<Motion: {} nodes, t = {first} to {last} s>", self.times.len())
    }
}
