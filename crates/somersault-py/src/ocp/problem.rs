//! Motion problems by shooting.

use super::arguments::{
    count, finite_all, index, integer, integer_or_none, number_or_range, seed_of, starts_or_none,
};
use super::joint_motion::SplineMotion;
use super::search::{SearchArguments, SearchResult};
use super::solver::{Report, SolverArguments, attended, duration as limit_of_time};
use super::swing_up::scheme_of;
use super::term::{Term, sizes_of};
use super::verification::{Unverified, Verification, Verifier};
use crate::convert::{array, finite, numbers_or_one, real_numbers, with_shape};
use crate::error::Error;
use crate::model::Model;
use crate::plan::returns_interrupted;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PySlice, PyTuple, PyType};
use somersault::multibody::Split;
use somersault::ocp;
use somersault::ocp::dynamics::Tree;
use somersault::ocp::nlp::{Bounds, EvaluationError, Nlp};
use somersault::ocp::problem::{At, Loss};
use somersault::ocp::shooting::{self, Drive, Duration, Shooting, ShootingOptions, Start};
use somersault::ocp::solver::{self, samples};
use somersault::ocp::transcription::Transcription;
use somersault::ocp::verification::verify_while;
use std::ops::{Deref, DerefMut};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, TryLockError};
use std::thread::ThreadId;
use std::time::Instant;

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
pub(crate) struct Phase {
    phase: shooting::Phase,
    motion: Py<SplineMotion>,
}

#[pymethods]
impl Phase {
    #[new]
    #[pyo3(signature = (motion, duration, n_steps, *, n_segments=1))]
    fn new(
        motion: &Bound<'_, SplineMotion>,
        duration: &Bound<'_, PyAny>,
        #[pyo3(from_py_with = integer)] n_steps: i64,
        #[pyo3(from_py_with = integer)] n_segments: i64,
    ) -> Result<Self, Error> {
        let (lower, upper) = number_or_range("duration", duration)?;
        // a NaN is not below
        if !(0.0 < lower && lower <= upper && upper.is_finite()) {
            return Err(Error::ocp_input(format!(
                "`duration` must be positive and finite, or a pair of such numbers in their order, found ({lower}, {upper})"
            )));
        }
        let duration = if lower == upper { Duration::Fixed(lower) } else { Duration::Free { lower, upper } };
        let n_steps = count("n_steps", n_steps, 1)?;
        let n_segments = count("n_segments", n_segments, 1)?;
        if n_segments > n_steps {
            return Err(Error::ocp_input(format!(
                "`n_segments` must be at most `n_steps` = {n_steps}, found {n_segments}"
            )));
        }
        let phase = shooting::Phase { motion: motion.get().motion.clone(), n_steps, duration, n_segments };
        Ok(Self { phase, motion: motion.clone().unbind() })
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyTuple>)> {
        let (py, own) = (slf.py(), slf.get());
        let shooting::Phase { n_steps, duration, n_segments, .. } = own.phase;
        let duration = match duration {
            Duration::Fixed(duration) => (duration, duration),
            Duration::Free { lower, upper } => (lower, upper),
        };
        let arguments = (own.motion.clone_ref(py), duration, n_steps, n_segments).into_pyobject(py)?;
        Ok((slf.get_type().getattr("_restore")?, arguments))
    }

    /// A pickled phase.
    #[classmethod]
    fn _restore(
        _: &Bound<'_, PyType>,
        motion: &Bound<'_, SplineMotion>,
        duration: &Bound<'_, PyAny>,
        n_steps: i64,
        n_segments: i64,
    ) -> Result<Self, Error> {
        Self::new(motion, duration, n_steps, n_segments)
    }
}

/// Where a term is taken, as Python says it.
#[derive(Clone)]
struct Place {
    at: String,
    node: Option<i64>,
    phase: Option<i64>,
}

impl Place {
    fn nodes(&self) -> Result<At, Error> {
        let node = self.node.map(|node| index("node", node)).transpose()?;
        let phase = self.phase.map(|phase| index("phase", phase)).transpose()?;
        match (self.at.as_str(), node, phase) {
            ("start", None, None) => Ok(At::Start),
            ("finish", None, None) => Ok(At::End),
            ("path" | "integral", None, None) => Ok(At::EveryNode),
            ("start", None, Some(phase)) => Ok(At::StartOf(phase)),
            ("finish", None, Some(phase)) => Ok(At::EndOf(phase)),
            ("path" | "integral", None, Some(phase)) => Ok(At::EveryNodeOf(phase)),
            ("node", Some(node), None) => Ok(At::Node(node)),
            ("node", None, _) => Err(Error::input("`node` must be given where `at` is 'node'")),
            ("node", Some(_), Some(_)) => {
                Err(Error::input("`phase` is not for `at` = 'node': nodes are counted through all phases"))
            }
            ("start" | "finish" | "path" | "integral", Some(_), _) => {
                Err(Error::input("`node` is for `at` = 'node'"))
            }
            (other, ..) => Err(Error::input(format!(
                "`at` must be 'start', 'finish', 'node' or 'path', or 'integral' of a constraint, found '{other}'"
            ))),
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
///     Which node, where `at` is ``'node'``; counted through all phases.
/// linear : bool, optional
///     Σ wᵢ rᵢ instead of squares.
/// phase : int, optional
///     Of which phase path, start or finish are meant; of the whole motion unless given.
#[pyclass(frozen, module = "somersault.ocp")]
pub(crate) struct Cost {
    term: Py<Term>,
    weights: Option<Py<PyAny>>,
    target: Option<Py<PyAny>>,
    place: Place,
    nodes: At,
    linear: bool,
}

#[pymethods]
impl Cost {
    #[new]
    #[pyo3(signature = (term, weights=None, target=None, *, at="path", node=None, linear=false, phase=None))]
    fn new(
        term: Py<Term>,
        weights: Option<Py<PyAny>>,
        target: Option<Py<PyAny>>,
        at: &str,
        #[pyo3(from_py_with = integer_or_none)] node: Option<i64>,
        linear: bool,
        #[pyo3(from_py_with = integer_or_none)] phase: Option<i64>,
    ) -> Result<Self, Error> {
        if linear && target.is_some() {
            return Err(Error::input("`target` is for squares; leave out `linear`"));
        }
        if at == "integral" {
            return Err(Error::input("`at` of a cost must be 'start', 'finish', 'node' or 'path'"));
        }
        let place = Place { at: at.to_owned(), node, phase };
        Ok(Self { term, weights, target, nodes: place.nodes()?, place, linear })
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyTuple>)> {
        let (py, own) = (slf.py(), slf.get());
        let copy = |value: &Option<Py<PyAny>>| value.as_ref().map(|value| value.clone_ref(py));
        let Place { at, node, phase } = own.place.clone();
        let place = (at, node, own.linear, phase);
        let arguments = (own.term.clone_ref(py), copy(&own.weights), copy(&own.target), place);
        Ok((slf.get_type().getattr("_restore")?, arguments.into_pyobject(py)?))
    }

    /// A pickled cost.
    #[classmethod]
    fn _restore(
        _: &Bound<'_, PyType>,
        term: Py<Term>,
        weights: Option<Py<PyAny>>,
        target: Option<Py<PyAny>>,
        place: (String, Option<i64>, bool, Option<i64>),
    ) -> Result<Self, Error> {
        let (at, node, linear, phase) = place;
        Self::new(term, weights, target, &at, node, linear, phase)
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

/// Lower bounds that are not above their upper ones; a single bound is that of all rows.
fn in_order(lower: &[f64], upper: &[f64]) -> Result<(), Error> {
    let of = |bounds: &[f64], k: usize| bounds[k.min(bounds.len() - 1)];
    if lower.is_empty() || upper.is_empty() {
        return Ok(());
    }
    let pairs = (0..lower.len().max(upper.len())).map(|k| (of(lower, k), of(upper, k)));
    match pairs.enumerate().find(|(_, (lower, upper))| lower > upper) {
        Some((k, (lower, upper))) => Err(Error::ocp_input(format!(
            "`lower` of a constraint must not be above `upper`, found {lower} and {upper} in entry {k}"
        ))),
        None => Ok(()),
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
///     Which node, where `at` is ``'node'``; counted through all phases.
/// phase : int, optional
///     Of which phase path, integral, start or finish are meant; of the whole motion unless given.
#[pyclass(frozen, module = "somersault.ocp")]
pub(crate) struct Constraint {
    term: Py<Term>,
    lower: Py<PyAny>,
    upper: Py<PyAny>,
    place: Place,
    nodes: At,
}

#[pymethods]
impl Constraint {
    #[new]
    #[pyo3(signature = (term, lower, upper, *, at="path", node=None, phase=None))]
    fn new(
        py: Python<'_>,
        term: Py<Term>,
        lower: Py<PyAny>,
        upper: Py<PyAny>,
        at: &str,
        #[pyo3(from_py_with = integer_or_none)] node: Option<i64>,
        #[pyo3(from_py_with = integer_or_none)] phase: Option<i64>,
    ) -> Result<Self, Error> {
        let place = Place { at: at.to_owned(), node, phase };
        in_order(&real_numbers("lower", lower.bind(py))?, &real_numbers("upper", upper.bind(py))?)?;
        Ok(Self { term, lower, upper, nodes: place.nodes()?, place })
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyTuple>)> {
        let (py, own) = (slf.py(), slf.get());
        let Place { at, node, phase } = own.place.clone();
        let bounds = (own.lower.clone_ref(py), own.upper.clone_ref(py));
        let arguments = (own.term.clone_ref(py), bounds.0, bounds.1, (at, node, phase));
        Ok((slf.get_type().getattr("_restore")?, arguments.into_pyobject(py)?))
    }

    /// A pickled constraint.
    #[classmethod]
    fn _restore(
        cls: &Bound<'_, PyType>,
        term: Py<Term>,
        lower: Py<PyAny>,
        upper: Py<PyAny>,
        place: (String, Option<i64>, Option<i64>),
    ) -> Result<Self, Error> {
        let (at, node, phase) = place;
        Self::new(cls.py(), term, lower, upper, &at, node, phase)
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
    recipe: Recipe,
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
        phases: Vec<Py<Phase>>,
        active: &Bound<'_, PyAny>,
        drive: &str,
        scheme: &str,
        costs: Vec<Py<Cost>>,
        constraints: Vec<Py<Constraint>>,
        free_positions: Option<Vec<bool>>,
        free_velocities: Option<Vec<bool>>,
        lower: Option<&Bound<'_, PyAny>>,
        upper: Option<&Bound<'_, PyAny>>,
        exact_hessian: bool,
    ) -> Result<Self, Error> {
        let tree = &model.get().model;
        let n = tree.n_velocities();
        let drives_motion = match drive {
            "motion" => true,
            "torque" => false,
            other => {
                return Err(Error::input(format!("`drive` must be 'motion' or 'torque', found '{other}'")));
            }
        };
        if phases.is_empty() {
            return Err(Error::ocp_input("`phases` must have at least one phase, found none".to_owned()));
        }
        let free = |argument: &str, free: Option<Vec<bool>>| match free {
            None => Ok(vec![false; n]),
            Some(free) if free.len() == n => Ok(free),
            Some(free) => {
                let found = free.len();
                Err::<_, Error>(Error::ocp_input(format!(
                    "`{argument}` must have {n} entries, found {found}"
                )))
            }
        };
        let start = Start {
            position: finite_all("q", with_shape("q", &[tree.n_positions()], q)?)?,
            velocity: finite_all("v", with_shape("v", &[n], v)?)?,
            free_positions: free("free_positions", free_positions)?,
            free_velocities: free("free_velocities", free_velocities)?,
        };
        let recipe = Recipe {
            model: model.clone().unbind(),
            active: model.get().split(active).map_err(|error| error.within("active"))?.active().to_vec(),
            drives_motion,
            scheme: scheme_of(scheme)?,
            start,
            phases,
            costs,
            constraints,
            lower: lower.map(|bound| bound.clone().unbind()),
            upper: upper.map(|bound| bound.clone().unbind()),
            exact_hessian,
        };
        let problem = recipe.build(py)?;
        let calls_python = recipe.costs.iter().any(|cost| cost.get().term.get().calls_python())
            || recipe.constraints.iter().any(|constraint| constraint.get().term.get().calls_python());
        Ok(Self {
            n_variables: problem.structure().variables.len(),
            n_constraints: problem.structure().constraints.len(),
            problem: Mutex::new(problem),
            holder: Mutex::new(None),
            calls_python,
            recipe,
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
        #[pyo3(from_py_with = integer_or_none)] max_iterations: Option<i64>,
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
        let motion = self.recipe.motion()?;
        let mut problem = self.acquire(py)?;
        arguments.solve(py, &mut *problem, &start, calls_python, |report| Some(motion.verifier(report)))
    }

    /// Solves from many starts, in parallel, and gathers the distinct minima.
    ///
    /// The first start is `z`. Others are a Latin hypercube about it, within the bounds; the states of segments stay
    /// as they are there. The same arguments give the same minima for any number of threads. Functions in Python take
    /// turns.
    ///
    /// Parameters
    /// ----------
    /// n_starts : int, optional
    ///     Those of the library.
    /// z : array_like, shape (n_variables,), optional
    ///     By default the middle of bounds that are finite on both sides, which are then the range, and what is nearest to
    ///     zero otherwise.
    /// starts : array_like, shape (m, n_variables), optional
    ///     Others, numbered before these.
    /// seed : int, optional
    /// reach : float or array_like, shape (n_variables,), optional
    ///     How far the others are from `z` in each variable at most.
    /// distance_tol : float, optional
    ///     Two minima are the same if no variable differs by more, relative to its size where that is above 1.
    /// solver, tol, max_iterations
    ///     As of `solve`, for each start.
    /// max_time : float, optional
    ///     Of all starts, s.
    /// on_interrupt : {'return', 'raise'}, optional
    ///     What Ctrl-C does: return what has been found, or raise.
    ///
    /// Returns
    /// -------
    /// SearchResult
    #[pyo3(signature = (
        n_starts=16, *, z=None, starts=None, seed=0, reach=None, distance_tol=1e-4, solver="sqp", tol=None,
        max_iterations=None, max_time=None, on_interrupt="return"
    ))]
    fn search(
        &self,
        py: Python<'_>,
        #[pyo3(from_py_with = integer)] n_starts: i64,
        z: Option<&Bound<'_, PyAny>>,
        starts: Option<Vec<Bound<'_, PyAny>>>,
        #[pyo3(from_py_with = integer)] seed: i64,
        reach: Option<&Bound<'_, PyAny>>,
        distance_tol: f64,
        solver: &str,
        tol: Option<f64>,
        #[pyo3(from_py_with = integer_or_none)] max_iterations: Option<i64>,
        max_time: Option<f64>,
        on_interrupt: &str,
    ) -> Result<SearchResult, Error> {
        let returned = returns_interrupted(on_interrupt)?;
        let (n_starts, seed) = (count("n_starts", n_starts, 0)?, seed_of(seed)?);
        let given = starts_or_none(starts, n_starts)?;
        let from = |z: &Bound<'_, PyAny>| {
            self.room(z).map(|(z, _)| z.into()).map_err(|error| error.with_names(&[("z", "starts")]))
        };
        let mut all = given.iter().map(from).collect::<Result<Vec<solver::Start>, Error>>()?;
        let (centre, range) = self.range(py, z, reach)?;
        if n_starts > 0 {
            all.push(centre.into());
            all.extend(samples(&range, n_starts - 1, seed)?);
        }
        let deadline = limit_of_time(max_time)?.map(|limit| Instant::now() + limit);
        let arguments =
            SolverArguments { solver, tol, max_iterations, max_time: None, callback: None, on_interrupt };
        let arguments = SearchArguments { solver: arguments.solver()?, distance_tol, deadline, returned };
        let motion = self.recipe.motion()?;
        let make = || Python::attach(|py| self.recipe.build(py));
        arguments.run(py, &all, make, |report| report, |report| Some(motion.verifier(report)))
    }

    /// Integrates the motion of a decision vector anew and accurately.
    ///
    /// Parameters
    /// ----------
    /// z : array_like, shape (n_variables,)
    ///
    /// Returns
    /// -------
    /// Verification
    fn verify(&self, py: Python<'_>, z: &Bound<'_, PyAny>) -> Result<Verification, Error> {
        let z = self.room(z)?.0;
        self.recipe.motion()?.verify(py, &z)
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

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyTuple>)> {
        let (py, recipe) = (slf.py(), &slf.get().recipe);
        let copy = |value: &Option<Py<PyAny>>| value.as_ref().map(|value| value.clone_ref(py));
        let Start { position, velocity, free_positions, free_velocities } = recipe.start.clone();
        let scheme = if recipe.scheme == shooting::Scheme::ExplicitEuler { "euler" } else { "rk4" };
        let choices = (
            recipe.active.clone(),
            if recipe.drives_motion { "motion" } else { "torque" },
            scheme,
            recipe.exact_hessian,
        );
        let arguments = (
            recipe.model.clone_ref(py),
            (numpy::PyArray1::from_vec(py, position), numpy::PyArray1::from_vec(py, velocity)),
            recipe.phases.iter().map(|phase| phase.clone_ref(py)).collect::<Vec<_>>(),
            choices,
            recipe.costs.iter().map(|cost| cost.clone_ref(py)).collect::<Vec<_>>(),
            recipe.constraints.iter().map(|constraint| constraint.clone_ref(py)).collect::<Vec<_>>(),
            (free_positions, free_velocities),
            (copy(&recipe.lower), copy(&recipe.upper)),
        );
        Ok((slf.get_type().getattr("_restore")?, arguments.into_pyobject(py)?))
    }

    /// A pickled problem.
    #[classmethod]
    fn _restore(
        cls: &Bound<'_, PyType>,
        model: &Bound<'_, Model>,
        start: (Bound<'_, PyAny>, Bound<'_, PyAny>),
        phases: Vec<Py<Phase>>,
        choices: (Bound<'_, PyAny>, String, String, bool),
        costs: Vec<Py<Cost>>,
        constraints: Vec<Py<Constraint>>,
        free: (Vec<bool>, Vec<bool>),
        bounds: (Option<Bound<'_, PyAny>>, Option<Bound<'_, PyAny>>),
    ) -> Result<Self, Error> {
        let (active, drive, scheme, exact_hessian) = choices;
        Self::new(
            cls.py(),
            model,
            &start.0,
            &start.1,
            phases,
            &active,
            &drive,
            &scheme,
            costs,
            constraints,
            Some(free.0),
            Some(free.1),
            bounds.0.as_ref(),
            bounds.1.as_ref(),
            exact_hessian,
        )
    }

    fn __repr__(&self) -> String {
        format!("<MotionProblem: {} variables, {} constraints>", self.n_variables, self.n_constraints)
    }
}

/// All that a problem is made of, to make it again: for each start of a search, and from a file.
struct Recipe {
    model: Py<Model>,
    /// Whether each degree of freedom is driven.
    active: Vec<bool>,
    drives_motion: bool,
    scheme: shooting::Scheme,
    start: Start,
    phases: Vec<Py<Phase>>,
    costs: Vec<Py<Cost>>,
    constraints: Vec<Py<Constraint>>,
    lower: Option<Py<PyAny>>,
    upper: Option<Py<PyAny>>,
    exact_hessian: bool,
}

impl Recipe {
    /// The motion without costs and constraints.
    fn motion(&self) -> Result<PosedMotion, Error> {
        let model = self.model.get().model.clone();
        let n = self.active.len();
        let (split, drive) = if self.drives_motion {
            (Split::new(self.active.clone()), Drive::Motion)
        } else {
            let dofs = (0..n).filter(|k| self.active[*k]).collect();
            (Split::new(vec![false; n]), Drive::Torque { dofs })
        };
        let names = [("motion.base", "phases"), ("motion.n_channels", "phases"), ("drive.dofs", "active")];
        Ok(PosedMotion {
            dynamics: Tree::try_new(model, split).map_err(|error| Error::from(error).with_names(&names))?,
            start: self.start.clone(),
            phases: self.phases.iter().map(|phase| phase.get().phase.clone()).collect(),
            options: ShootingOptions { scheme: self.scheme, drive },
        })
    }

    fn build(&self, py: Python<'_>) -> Result<Inner, Error> {
        let motion = self.motion()?;
        let n_channels = self.phases.first().map_or(0, |phase| phase.get().phase.motion.n_channels());
        let (dynamics, sizes) = (&motion.dynamics, sizes_of(&motion.dynamics, n_channels));
        let mut builder = ocp::problem::MotionProblem::builder(motion.shooting()?);
        for cost in &self.costs {
            let cost = cost.get();
            let term = cost.term.get().build(py, dynamics, &sizes)?;
            let loss = cost.loss(py, term.n_rows())?;
            builder = match cost.nodes {
                at @ (At::EveryNode | At::EveryNodeOf(_)) => builder.lagrange_over(at, term, loss)?,
                at => builder.mayer(at, term, loss)?,
            };
        }
        for constraint in &self.constraints {
            let constraint = constraint.get();
            let term = constraint.term.get().build(py, dynamics, &sizes)?;
            let n_rows = term.n_rows();
            let bounds = Bounds {
                lower: numbers_or_one("lower", n_rows, constraint.lower.bind(py))?,
                upper: numbers_or_one("upper", n_rows, constraint.upper.bind(py))?,
            };
            let built = if constraint.place.at == "integral" {
                builder.constrain_integral(constraint.nodes, term, bounds)
            } else {
                builder.constrain(constraint.nodes, term, bounds)
            };
            builder =
                built.map_err(|error| Error::from(error).with_names(&[("bounds", "lower` and `upper")]))?;
        }
        let n_variables = builder.transcription().outline().n_variables();
        let bounds = |name, value: &Option<Py<PyAny>>, default| match value {
            Some(value) => numbers_or_one(name, n_variables, value.bind(py)),
            None => Ok(vec![default; n_variables]),
        };
        let lower = bounds("lower", &self.lower, f64::NEG_INFINITY)?;
        let upper = bounds("upper", &self.upper, f64::INFINITY)?;
        if n_variables > 0 && lower == upper {
            return Err(Error::ocp_input(format!(
                "`lower` and `upper` must leave a variable free, found all {n_variables} of them fixed"
            )));
        }
        for (variable, (lower, upper)) in lower.into_iter().zip(upper).enumerate() {
            let bounded = builder.bound_variable(variable, lower, upper);
            builder = bounded
                .map_err(|error| Error::from(error).with_names(&[("variables", "lower` and `upper")]))?;
        }
        if self.exact_hessian {
            builder = builder.with_exact_hessian();
        }
        Ok(builder.build()?)
    }
}

/// A motion by shooting before it is made.
#[derive(Clone)]
struct PosedMotion {
    dynamics: Tree,
    start: Start,
    phases: Vec<shooting::Phase>,
    options: ShootingOptions,
}

impl PosedMotion {
    fn shooting(&self) -> Result<Shooting<Tree>, Error> {
        let Self { dynamics, start, phases, options } = self.clone();
        let names = [("motion.base", "phases"), ("motion.n_channels", "phases"), ("drive.dofs", "active")];
        Shooting::try_new(dynamics, start, phases, options)
            .map_err(|error| Error::from(error).with_names(&names))
    }

    fn verify(&self, py: Python<'_>, z: &[f64]) -> Result<Verification, Error> {
        let mut shooting = self.shooting()?;
        let found = attended(py, |go_on| {
            verify_while(&mut shooting, self.dynamics.model(), z, go_on).map_err(Unverified)
        })?;
        Ok(Verification::of(found))
    }

    fn verifier(&self, report: &solver::Report) -> Arc<Verifier> {
        let (motion, z) = (self.clone(), report.z.clone());
        Verifier::new(move |py| Ok(Py::new(py, motion.verify(py, &z)?)?.into_any()))
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

    /// The middle of a search and the range about it.
    fn range(
        &self,
        py: Python<'_>,
        z: Option<&Bound<'_, PyAny>>,
        reach: Option<&Bound<'_, PyAny>>,
    ) -> Result<(Vec<f64>, Bounds), Error> {
        let z = z.map(|z| Ok::<_, Error>(self.room(z)?.0)).transpose()?;
        let n = self.n_variables;
        let given = reach.map(|reach| numbers_or_one("reach", n, reach)).transpose()?;
        if let Some(found) = given.iter().flatten().find(|reach| !(**reach >= 0.0 && reach.is_finite())) {
            return Err(Error::ocp_input(format!("`reach` must be finite and not negative, found {found}")));
        }
        let problem = self.acquire(py)?;
        let Bounds { lower, upper } = &problem.structure().variables;
        let lifted = &problem.transcription().layout().lifted;
        let (mut centre, mut range) = (Vec::with_capacity(n), Bounds::default());
        for k in 0..n {
            let (lower, upper) = (lower[k], upper[k]);
            let bounded = lower.is_finite() && upper.is_finite();
            let middle = match &z {
                Some(z) => z[k].clamp(lower, upper),
                None if bounded => 0.5 * (lower + upper),
                None => 0.0_f64.clamp(lower, upper),
            };
            let reach = match &given {
                _ if lifted.iter().any(|range| range.contains(&k)) => 0.0,
                Some(reach) => reach[k],
                None if z.is_none() && bounded => 0.5 * (upper - lower),
                None => 1.0,
            };
            range.push((middle - reach).max(lower), (middle + reach).min(upper));
            centre.push(middle);
        }
        Ok((centre, range))
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

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyTuple>)> {
        let (py, motion) = (slf.py(), slf.get());
        let parts = (0..motion.parts.len()).map(|k| motion.part(py, k)).collect::<PyResult<Vec<_>>>()?;
        Ok((slf.get_type().getattr("_restore")?, (motion.t(py), parts).into_pyobject(py)?))
    }

    /// A pickled motion.
    #[classmethod]
    fn _restore(
        _: &Bound<'_, PyType>,
        t: &Bound<'_, PyAny>,
        parts: [Bound<'_, PyAny>; 7],
    ) -> Result<Self, Error> {
        let times = crate::convert::real_numbers("t", t)?;
        let mut motion = Self { times, parts: Default::default() };
        for ((width, values), part) in motion.parts.iter_mut().zip(&parts) {
            let shape: (usize, usize) = part.getattr("shape")?.extract()?;
            *width = shape.1;
            *values = with_shape("parts", &[motion.times.len(), shape.1], part)?;
        }
        Ok(motion)
    }

    fn __repr__(&self) -> String {
        let (first, last) = (self.times.first().unwrap_or(&0.0), self.times.last().unwrap_or(&0.0));
        format!("<Motion: {} nodes, t = {first} to {last} s>", self.times.len())
    }
}
