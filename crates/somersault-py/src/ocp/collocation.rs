//! Motions of trees by direct collocation.

use super::arguments::{count, finite_all, integer, integer_or_none, limit, number_or_range, tolerance};
use super::solver::{Report, Watcher, duration as limit_of_time, status_name, status_of};
use super::verification::{Verification, Verifier};
use crate::convert::{a_type, array, numbers_or_one, real_numbers, times, with_shape};
use crate::error::Error;
use crate::model::Model;
use crate::plan::returns_interrupted;
use pyo3::PyClass;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple, PyType};
use somersault::multibody::{self, Scalar};
use somersault::ocp::collocation::{
    Collocation, CollocationReport, CollocationStatus, Confirmation, Ends, Guess, Interval, Mesh, MeshRecord,
    Phase, PhaseConfirmation, PhaseRows, PhaseSolution, Point, Problem, Terms, TreeDynamics,
};
use somersault::ocp::nalgebra::convert;
use somersault::ocp::solver::{Flow, Iteration, Sqp, Status};
use somersault::ocp::verification::{self, momentum_drift};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

/// Names that the library has for arguments of these classes.
const NAMES: [(&str, &str); 4] = [
    ("control_bounds", "control_lower` and `control_upper"),
    ("state_bounds", "state_lower` and `state_upper"),
    ("path_bounds", "path_lower` and `path_upper"),
    ("tolerance", "tol"),
];

/// L = ½ Σ γᵢ uᵢ² + ½ Σ wᵢ (xᵢ − x*ᵢ)² + c, Φ = ½ Σ Wᵢ (xᵢ(t_f) − x*ᵢ)².
#[derive(Clone)]
struct Quadratic {
    control_weights: Vec<f64>,
    state_weights: Vec<f64>,
    final_weights: Vec<f64>,
    target: Vec<f64>,
    time_weight: f64,
    /// Rows over (x, u).
    path: Vec<Vec<f64>>,
}

fn half_squares<T: Scalar>(weights: &[f64], values: &[T], target: impl Iterator<Item = f64>) -> T {
    weights.iter().zip(values).zip(target).fold(T::zero(), |sum, ((&w, &x), target)| {
        let apart = x - convert::<f64, T>(target);
        sum + apart * apart * convert::<f64, T>(0.5 * w)
    })
}

impl Terms for Quadratic {
    fn n_path_constraints(&self) -> usize {
        self.path.len()
    }

    fn path_constraints<T: Scalar>(&self, at: &Point<'_, T>, values: &mut [T]) {
        for (value, row) in values.iter_mut().zip(&self.path) {
            let numbers = at.state.iter().chain(at.control);
            *value = row.iter().zip(numbers).fold(T::zero(), |sum, (&a, &x)| sum + x * convert::<f64, T>(a));
        }
    }

    fn running_cost<T: Scalar>(&self, at: &Point<'_, T>) -> T {
        half_squares(&self.control_weights, at.control, std::iter::repeat(0.0))
            + half_squares(&self.state_weights, at.state, self.target.iter().copied())
            + convert::<f64, T>(self.time_weight)
    }

    fn end_cost<T: Scalar>(&self, ends: &Ends<'_, T>) -> T {
        half_squares(&self.final_weights, ends.final_state, self.target.iter().copied())
    }
}

/// A motion of a tree by direct collocation: Legendre–Gauss–Radau points on a mesh that is refined to a tolerance.
///
/// The state is x = (q, v), the controls u are forces of joints. The cost is
/// ∫ ½ Σ γᵢ uᵢ² + ½ Σ wᵢ (xᵢ − x*ᵢ)² + c dt + ½ Σ Wᵢ (xᵢ(t_f) − x*ᵢ)².
///
/// Parameters
/// ----------
/// model : Model
///     A tree whose joints are revolute, prismatic or fixed.
/// initial_state, final_state : sequence, length 2 n
///     For each entry of x(0) and x(t_f) a number, a pair of bounds, or None where it is free.
/// duration : float or tuple of float
///     t_f, s; a pair makes it a variable between the two.
/// actuated : sequence of str or of bool, optional
///     Bodies whose joints have a control, or degrees of freedom; all of them unless given.
/// control_weights : float or array_like, shape (n_controls,), optional
///     γ.
/// state_weights, final_weights : float or array_like, shape (2 n,), optional
///     w and W.
/// target : float or array_like, shape (2 n,), optional
///     x*.
/// time_weight : float, optional
///     c.
/// control_lower, control_upper : float or array_like, shape (n_controls,), optional
///     Bounds on u; infinite unless given.
/// state_lower, state_upper : float or array_like, shape (2 n,), optional
///     Bounds on x.
/// path : array_like, shape (m, 2 n + n_controls), optional
///     A of path constraints on A (x, u), at all collocation points.
/// path_lower, path_upper : float or array_like, shape (m,), optional
///     Their bounds; infinite unless given.
///
/// Raises
/// ------
/// OcpInputError
///     If a joint has more than one degree of freedom, bounds contradict, or a number is not finite.
///
/// Examples
/// --------
/// One metre in one second from rest to rest with least effort: ½ ∫ u² dt = 6, u = 6 − 12 t.
///
/// >>> import somersault
/// >>> from somersault import multibody, ocp
/// >>> block = multibody.Link("block", joint="prismatic", axis=(1, 0, 0), mass=1.0)
/// >>> model = somersault.Model([block], gravity=(0, 0, 0))
/// >>> found = ocp.CollocationProblem(model, [0, 0], [1, 0], 1.0).solve()
/// >>> found.status, round(found.cost, 6), round(float(found.control(0.25)[0]), 4)
/// ('converged', 6.0, 3.0)
#[pyclass(frozen, module = "somersault.ocp")]
pub(crate) struct CollocationProblem {
    pub(super) model: multibody::Model,
    actuated: Vec<usize>,
    terms: Quadratic,
    pub(super) initial_state: Vec<Interval>,
    pub(super) final_state: Vec<Interval>,
    pub(super) duration: Interval,
    controls: Vec<Interval>,
    pub(super) states: Vec<Interval>,
    path: Vec<Interval>,
}

/// For each entry a number, a pair of bounds, or nothing.
pub(super) fn ends(argument: &str, n: usize, entries: &Bound<'_, PyAny>) -> Result<Vec<Interval>, Error> {
    let refused = |_| {
        let found = a_type(entries);
        Error::input(format!("`{argument}` must be a sequence of numbers, pairs or None, found {found}"))
    };
    let entry = |entry: PyResult<Bound<'_, PyAny>>| {
        let entry = entry?;
        if entry.is_none() {
            return Ok(Interval::FREE);
        }
        let (lower, upper) = number_or_range(argument, &entry)?;
        Ok::<_, Error>(Interval::new(lower, upper))
    };
    let found = entries.try_iter().map_err(refused)?.map(entry).collect::<Result<Vec<_>, Error>>()?;
    match found.len() {
        found if found != n => {
            Err(Error::input(format!("`{argument}` must have {n} entries, found {found}")))
        }
        _ => Ok(found),
    }
}

/// Rows of a matrix.
fn rows_of(values: &[f64], width: usize) -> Vec<Vec<f64>> {
    values.chunks(width.max(1)).map(<[f64]>::to_vec).collect()
}

/// One number for each, finite.
fn finite_numbers(
    argument: &str,
    n: usize,
    value: Option<&Bound<'_, PyAny>>,
    default: f64,
) -> Result<Vec<f64>, Error> {
    let Some(value) = value else { return Ok(vec![default; n]) };
    let numbers = numbers_or_one(argument, n, value)?;
    match numbers.iter().find(|x| !x.is_finite()) {
        Some(found) => Err(Error::ocp_input(format!("`{argument}` must be finite, found {found}"))),
        None => Ok(numbers),
    }
}

fn weights(
    argument: &str,
    n: usize,
    value: Option<&Bound<'_, PyAny>>,
    default: f64,
) -> Result<Vec<f64>, Error> {
    let numbers = finite_numbers(argument, n, value, default)?;
    match numbers.iter().find(|x| **x < 0.0) {
        Some(found) => Err(Error::ocp_input(format!("`{argument}` must not be negative, found {found}"))),
        None => Ok(numbers),
    }
}

fn intervals(
    names: [&str; 2],
    n: usize,
    lower: Option<&Bound<'_, PyAny>>,
    upper: Option<&Bound<'_, PyAny>>,
) -> Result<Vec<Interval>, Error> {
    let side = |name, value: Option<&Bound<'_, PyAny>>, default| match value {
        Some(value) => numbers_or_one(name, n, value),
        None => Ok(vec![default; n]),
    };
    let lower = side(names[0], lower, f64::NEG_INFINITY)?;
    let upper = side(names[1], upper, f64::INFINITY)?;
    Ok(lower.into_iter().zip(upper).map(|(lower, upper)| Interval::new(lower, upper)).collect())
}

/// `solve` takes its guess as times, states and controls, as states alone, or from an earlier result.
pub(super) fn guess_of(problem: &CollocationProblem, value: &Bound<'_, PyAny>) -> Result<Guess, Error> {
    if let Ok(result) = value.cast::<CollocationResult>() {
        return Ok(result.get().phase().to_guess());
    }
    let (n_states, n_controls) = (problem.states.len(), problem.controls.len());
    let at_rest = |n: usize| vec![vec![0.0; n_controls]; n];
    let states = |n: usize, value: &Bound<'_, PyAny>| -> Result<Vec<Vec<f64>>, Error> {
        let states = with_shape("states of the guess", &[n, n_states], value)
            .map_err(|error| error.with_names(&[("states of the guess", "guess")]))?;
        Ok(rows_of(&finite_all("guess", states)?, n_states))
    };
    if let Ok(tuple) = value.cast::<PyTuple>()
        && tuple.iter().any(|item| item.is_none() || item.len().is_ok_and(|n| n != n_states))
    {
        let Ok((t, x, u)) = value.extract::<(Bound<'_, PyAny>, Bound<'_, PyAny>, Bound<'_, PyAny>)>() else {
            return Err(Error::ocp_input(format!(
                "`guess` must be (times, states, controls or None) or states of length {n_states}, found a tuple of {}",
                tuple.len()
            )));
        };
        let times = finite_all("guess", real_numbers("guess", &t)?)?;
        let n = times.len();
        let controls = if u.is_none() {
            at_rest(n)
        } else {
            let controls = with_shape("controls of the guess", &[n, n_controls], &u)
                .map_err(|error| error.with_names(&[("controls of the guess", "guess")]))?;
            rows_of(&finite_all("guess", controls)?, n_controls)
        };
        let controls = if n_controls == 0 { at_rest(n) } else { controls };
        return Ok(Guess { states: states(n, &x)?, times, controls, parameters: Vec::new() });
    }
    let refused = |_| {
        let found = a_type(value);
        Error::ocp_input(format!(
            "`guess` must be states, (times, states, controls or None) or an earlier result, found {found}"
        ))
    };
    let n = value.len().map_err(refused)?;
    if n < 2 {
        return Err(Error::ocp_input(format!("`guess` must have at least 2 rows, found {n}")));
    }
    let end =
        if problem.duration.upper.is_finite() { problem.duration.upper } else { problem.duration.lower };
    Ok(Guess {
        times: (0..n).map(|k| end * k as f64 / (n.max(2) - 1) as f64).collect(),
        states: states(n, value)?,
        controls: at_rest(n),
        parameters: Vec::new(),
    })
}

impl CollocationProblem {
    /// The phase, whose horizon begins at zero.
    pub(super) fn phase(&self, guess: Option<Guess>) -> Result<Phase, Error> {
        let dynamics = TreeDynamics::try_new(&self.model, &self.actuated)?;
        let phase = Phase::of_tree(dynamics, self.terms.clone())
            .initial_state(self.initial_state.clone())
            .final_state(self.final_state.clone())
            .horizon(0.0, self.duration)
            .control_bounds(self.controls.clone())
            .state_bounds(self.states.clone())
            .path_bounds(self.path.clone());
        Ok(match guess {
            Some(guess) => phase.guess(guess),
            None => phase,
        })
    }

    /// A path constraint that an end, with whatever controls there are, cannot meet: it is not asked for at the very end,
    /// where nothing is collocated, so that a program would leap there.
    fn check_path(&self) -> Result<(), Error> {
        for (k, (row, bounds)) in self.terms.path.iter().zip(&self.path).enumerate() {
            for (argument, end) in
                [("initial_state", &self.initial_state), ("final_state", &self.final_state)]
            {
                let within = end
                    .iter()
                    .zip(&self.states)
                    .map(|(end, bound)| (end.lower.max(bound.lower), end.upper.min(bound.upper)));
                let within = within.chain(self.controls.iter().map(|bound| (bound.lower, bound.upper)));
                let (mut least, mut most) = (0.0, 0.0);
                for (a, (lower, upper)) in row.iter().zip(within).filter(|(a, _)| **a != 0.0) {
                    least += (a * lower).min(a * upper);
                    most += (a * lower).max(a * upper);
                }
                let rounding = 1e-12 * bounds.lower.abs().min(bounds.upper.abs()).max(1.0);
                if least > bounds.upper + rounding || most < bounds.lower - rounding {
                    return Err(Error::ocp_input(format!(
                        "`path`, row {k}, must be possible at `{argument}`: there it is {}, and `path_lower` and \
                         `path_upper` allow {bounds}",
                        Interval::new(least, most)
                    )));
                }
            }
        }
        Ok(())
    }

    pub(super) fn state_names(&self) -> Result<Vec<String>, Error> {
        Ok(TreeDynamics::try_new(&self.model, &self.actuated)?.state_names())
    }

    fn problem(&self, guess: Option<Guess>) -> Result<Problem, Error> {
        Problem::try_new(self.phase(guess)?).map_err(|error| Error::from(error).with_names(&NAMES))
    }
}

/// How a search is to go.
pub(super) struct SearchOptions<'a, 'py> {
    pub(super) tol: f64,
    /// Intervals of the first mesh of each phase, and points of each.
    pub(super) sizes: (i64, i64),
    pub(super) max_meshes: i64,
    pub(super) max_iterations: Option<i64>,
    pub(super) max_time: Option<f64>,
    pub(super) callback: Option<&'a Bound<'py, PyAny>>,
    pub(super) on_interrupt: &'a str,
}

impl SearchOptions<'_, '_> {
    /// Searches without the interpreter, and looks for callback and Ctrl-C meanwhile.
    pub(super) fn run<R: PyClass>(
        self,
        py: Python<'_>,
        n_phases: usize,
        problem: impl FnOnce() -> Result<Problem, Error>,
        result: impl FnOnce(CollocationReport) -> Result<Py<R>, Error>,
    ) -> Result<Py<R>, Error> {
        let returned = returns_interrupted(self.on_interrupt)?;
        let default = Collocation::default();
        tolerance("tol", Some(self.tol))?;
        let most = limit("max_iterations", self.max_iterations, 0)?;
        let (n_intervals, n_points) =
            (count("n_intervals", self.sizes.0, 1)?, count("n_points", self.sizes.1, 1)?);
        let collocation = Collocation {
            tolerance: self.tol,
            max_meshes: count("max_meshes", self.max_meshes, 1)?,
            solver: Sqp {
                max_iterations: most.unwrap_or(default.solver.max_iterations),
                max_time: limit_of_time(self.max_time)?,
                ..default.solver
            },
            ..default
        };
        if n_intervals.saturating_mul(n_points) > MOST_POINTS || n_points > 500 {
            return Err(Error::ocp_input(format!(
                "`n_intervals` × `n_points` must be at most {MOST_POINTS} and `n_points` at most 500, found {n_intervals} × {n_points}"
            )));
        }
        let meshes = vec![Mesh::try_uniform(n_intervals, n_points)?; n_phases];
        let mut problem = problem()?;
        let watcher = Mutex::new(Watcher::new(self.callback)?);
        let watch = || watcher.lock().unwrap_or_else(PoisonError::into_inner);
        let found = py.detach(|| {
            let mut look = |iteration: &Iteration<'_>| -> Flow { watch().look(iteration) };
            collocation.solve_while(&mut problem, &meshes, &mut look, &mut || watch().goes_on())
        });
        let watcher = watcher.into_inner().unwrap_or_else(PoisonError::into_inner);
        let mut report = found.map_err(|error| Error::from(error).with_names(&NAMES))?;
        if watcher.is_interrupted(py) {
            report.program = report.program.interrupted();
            if let CollocationStatus::NotSolved(status @ Status::Stopped) = &mut report.status {
                *status = Status::Interrupted;
            }
        }
        let result = result(report)?;
        match watcher.into_raised(py, returned) {
            Some(error) => {
                // An exception that takes no attributes is still the one to raise.
                let _ = error.value(py).setattr("result", result);
                Err(error.into())
            }
            None => Ok(result),
        }
    }
}

/// Pairs of bounds.
fn pairs(intervals: &[Interval]) -> Vec<(f64, f64)> {
    intervals.iter().map(|interval| (interval.lower, interval.upper)).collect()
}

fn intervals_of(pairs: Vec<(f64, f64)>) -> Vec<Interval> {
    pairs.into_iter().map(|(lower, upper)| Interval::new(lower, upper)).collect()
}

#[pymethods]
impl CollocationProblem {
    #[new]
    #[pyo3(signature = (
        model, initial_state, final_state, duration, *, actuated=None, control_weights=None, state_weights=None,
        final_weights=None, target=None, time_weight=0.0, control_lower=None, control_upper=None,
        state_lower=None, state_upper=None, path=None, path_lower=None, path_upper=None
    ))]
    fn new(
        model: &Bound<'_, Model>,
        initial_state: &Bound<'_, PyAny>,
        final_state: &Bound<'_, PyAny>,
        duration: &Bound<'_, PyAny>,
        actuated: Option<&Bound<'_, PyAny>>,
        control_weights: Option<&Bound<'_, PyAny>>,
        state_weights: Option<&Bound<'_, PyAny>>,
        final_weights: Option<&Bound<'_, PyAny>>,
        target: Option<&Bound<'_, PyAny>>,
        time_weight: f64,
        control_lower: Option<&Bound<'_, PyAny>>,
        control_upper: Option<&Bound<'_, PyAny>>,
        state_lower: Option<&Bound<'_, PyAny>>,
        state_upper: Option<&Bound<'_, PyAny>>,
        path: Option<&Bound<'_, PyAny>>,
        path_lower: Option<&Bound<'_, PyAny>>,
        path_upper: Option<&Bound<'_, PyAny>>,
    ) -> Result<Self, Error> {
        let tree = &model.get().model;
        let n = tree.n_velocities();
        let actuated: Vec<usize> = match actuated {
            Some(value) => {
                let split = model.get().split(value);
                let named = |error: Error| error.with_names(&[("active", "actuated")]).within("actuated");
                let split = split.map_err(named)?;
                (0..n).filter(|k| split.active()[*k]).collect()
            }
            None => (0..n).collect(),
        };
        if !time_weight.is_finite() {
            return Err(Error::ocp_input(format!("`time_weight` must be finite, found {time_weight}")));
        }
        let m = actuated.len();
        let (lower, upper) = number_or_range("duration", duration)?;
        // a NaN is not below
        if !(0.0 < lower && lower <= upper && lower.is_finite()) {
            return Err(Error::ocp_input(format!(
                "`duration` must be positive, or a pair of such numbers in their order, found ({lower}, {upper})"
            )));
        }
        let duration = Interval::new(lower, upper);
        let width = 2 * n + m;
        let path = match path {
            Some(path) => {
                let n_rows = path.len().map_err(|_| {
                    Error::input(format!(
                        "`path` must be a matrix with {width} columns, found {}",
                        a_type(path)
                    ))
                })?;
                rows_of(&finite_all("path", with_shape("path", &[n_rows, width], path)?)?, width)
            }
            None => Vec::new(),
        };
        if path.is_empty() && (path_lower.is_some() || path_upper.is_some()) {
            return Err(Error::input(
                "`path_lower` and `path_upper` are bounds of `path`, which is not given",
            ));
        }
        let n_path = path.len();
        let terms = Quadratic {
            control_weights: weights("control_weights", m, control_weights, 1.0)?,
            state_weights: weights("state_weights", 2 * n, state_weights, 0.0)?,
            final_weights: weights("final_weights", 2 * n, final_weights, 0.0)?,
            target: finite_numbers("target", 2 * n, target, 0.0)?,
            time_weight,
            path,
        };
        let posed = Self {
            model: tree.clone(),
            terms,
            initial_state: ends("initial_state", 2 * n, initial_state)?,
            final_state: ends("final_state", 2 * n, final_state)?,
            duration,
            controls: intervals(["control_lower", "control_upper"], m, control_lower, control_upper)?,
            states: intervals(["state_lower", "state_upper"], 2 * n, state_lower, state_upper)?,
            path: intervals(["path_lower", "path_upper"], n_path, path_lower, path_upper)?,
            actuated,
        };
        posed.problem(None)?;
        posed.check_path()?;
        Ok(posed)
    }

    /// Model: The tree.
    #[getter]
    fn model(&self) -> Model {
        Model::of(self.model.clone())
    }

    /// int: Length of x.
    #[getter]
    fn n_states(&self) -> usize {
        self.states.len()
    }

    /// int: Length of u.
    #[getter]
    fn n_controls(&self) -> usize {
        self.controls.len()
    }

    /// Solves, refines the mesh to the tolerance, and integrates what was found anew.
    ///
    /// Parameters
    /// ----------
    /// guess : array_like, shape (m, n_states), or tuple, or CollocationResult, optional
    ///     States at equal distances in time; or times (m,), states (m, n_states) and controls (m, n_controls) or None; or
    ///     an earlier result. Straight lines in between. A straight line from start to end unless given.
    /// tol : float, optional
    ///     Relative error that each interval of the mesh may have.
    /// n_intervals, n_points : int, optional
    ///     Intervals of the first mesh, and collocation points of each.
    /// max_meshes : int, optional
    /// max_iterations : int, optional
    ///     Of the solver, on each mesh.
    /// max_time : float, optional
    ///     s, on each mesh.
    /// callback : callable, optional
    ///     ``callback(iteration, z, cost, residual)`` after each step of the solver; the search stops where it
    ///     returns true.
    /// on_interrupt : {'return', 'raise'}, optional
    ///     What Ctrl-C does: return the best iterate, or raise with it as the attribute ``result``.
    ///
    /// Returns
    /// -------
    /// CollocationResult
    ///     With the best motion found, whatever the status.
    #[pyo3(signature = (
        guess=None, *, tol=1e-6, n_intervals=40, n_points=4, max_meshes=20, max_iterations=None, max_time=None,
        callback=None, on_interrupt="return"
    ))]
    fn solve(
        &self,
        py: Python<'_>,
        guess: Option<&Bound<'_, PyAny>>,
        tol: f64,
        #[pyo3(from_py_with = integer)] n_intervals: i64,
        #[pyo3(from_py_with = integer)] n_points: i64,
        #[pyo3(from_py_with = integer)] max_meshes: i64,
        #[pyo3(from_py_with = integer_or_none)] max_iterations: Option<i64>,
        max_time: Option<f64>,
        callback: Option<&Bound<'_, PyAny>>,
        on_interrupt: &str,
    ) -> Result<Py<CollocationResult>, Error> {
        let sizes = (n_intervals, n_points);
        let options =
            SearchOptions { tol, sizes, max_meshes, max_iterations, max_time, callback, on_interrupt };
        let problem = || self.problem(guess.map(|guess| guess_of(self, guess)).transpose()?);
        options
            .run(py, 1, problem, |report| Ok(Py::new(py, CollocationResult::of(report, &self.model, tol)?)?))
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyTuple>)> {
        let own = slf.get();
        let terms = &own.terms;
        let weights = (
            terms.control_weights.clone(),
            terms.state_weights.clone(),
            terms.final_weights.clone(),
            terms.target.clone(),
            terms.time_weight,
        );
        let bounds = (
            pairs(&own.initial_state),
            pairs(&own.final_state),
            (own.duration.lower, own.duration.upper),
            pairs(&own.controls),
            pairs(&own.states),
            pairs(&own.path),
        );
        let arguments = (own.model(), own.actuated.clone(), weights, bounds, terms.path.clone());
        Ok((slf.get_type().getattr("_restore")?, arguments.into_pyobject(slf.py())?))
    }

    /// A pickled problem.
    #[classmethod]
    fn _restore(
        _: &Bound<'_, PyType>,
        model: &Bound<'_, Model>,
        actuated: Vec<usize>,
        weights: Weights,
        bounds: AllBounds,
        path: Vec<Vec<f64>>,
    ) -> Result<Self, Error> {
        let model = model.get().model.clone();
        let (control_weights, state_weights, final_weights, target, time_weight) = weights;
        let (initial_state, final_state, duration, controls, states, path_bounds) = bounds;
        let (n, m) = (2 * model.n_velocities(), actuated.len());
        let sizes = [
            ("control_weights", control_weights.len(), m),
            ("state_weights", state_weights.len(), n),
            ("final_weights", final_weights.len(), n),
            ("target", target.len(), n),
            ("path", path.iter().map(Vec::len).find(|width| *width != n + m).unwrap_or(n + m), n + m),
        ];
        if let Some((argument, found, expected)) = sizes.iter().find(|(_, found, n)| found != n) {
            return Err(Error::input(format!("`{argument}` must have {expected} entries, found {found}")));
        }
        let terms = Quadratic { control_weights, state_weights, final_weights, target, time_weight, path };
        let posed = Self {
            model,
            actuated,
            terms,
            initial_state: intervals_of(initial_state),
            final_state: intervals_of(final_state),
            duration: Interval::new(duration.0, duration.1),
            controls: intervals_of(controls),
            states: intervals_of(states),
            path: intervals_of(path_bounds),
        };
        posed.problem(None)?;
        Ok(posed)
    }

    fn __repr__(&self) -> String {
        let (n, m) = (self.n_states(), self.n_controls());
        format!("<CollocationProblem: {n} states, {m} controls>")
    }
}

/// γ, w, W, x* and c.
type Weights = (Vec<f64>, Vec<f64>, Vec<f64>, Vec<f64>, f64);
type Pairs = Vec<(f64, f64)>;
/// Of both ends, the duration, controls, states and the path.
type AllBounds = (Pairs, Pairs, (f64, f64), Pairs, Pairs, Pairs);

/// Collocation points of a first mesh, at most.
const MOST_POINTS: usize = 100_000;

/// What collocation found. Rows belong to the collocation points; those of `t`, `x` and `costates` have the end as a
/// last row.
#[pyclass(frozen, module = "somersault.ocp")]
pub(crate) struct CollocationResult {
    pub(super) report: CollocationReport,
    pub(super) model: multibody::Model,
    pub(super) tol: f64,
    verifier: Arc<Verifier>,
}

fn table<'py>(py: Python<'py>, rows: &[Vec<f64>]) -> PyResult<Bound<'py, PyAny>> {
    let shape = [rows.len(), rows.first().map_or(0, Vec::len)];
    Ok(array(py, rows.concat(), &shape)?.into_any())
}

/// Status, cost, tolerance.
type Outcome = (String, f64, f64);
/// Bounds and points of a mesh, ends of the horizon.
type OnMesh = (Vec<f64>, Vec<usize>, (f64, f64));
/// Defects, error and state of one integration from start to end, violation and what it is of, running and end cost, cost.
type Confirmed = (Vec<f64>, f64, Vec<f64>, (f64, String), (f64, f64), f64);
/// Of a mesh: bounds, points, cost, error, status, steps, seconds.
type Tried = (Vec<f64>, Vec<usize>, f64, f64, String, usize, f64);

/// The name of a status.
pub(super) fn status(status: CollocationStatus) -> &'static str {
    match status {
        CollocationStatus::Converged => "converged",
        CollocationStatus::FalseConvergence => "false_convergence",
        CollocationStatus::MeshLimit => "mesh_limit",
        CollocationStatus::NotSolved(status) => status_name(status),
        // statuses to come end a search as well
        _ => "failed",
    }
}

/// The status in a sentence, and what is exceeded between the points.
pub(super) fn message(report: &CollocationReport, tol: f64) -> String {
    let defect = report.confirmation.max_defect();
    let said = match report.status {
        CollocationStatus::Converged => {
            format!("converged and confirmed: integrated anew the largest defect is {defect:.1e}")
        }
        CollocationStatus::FalseConvergence => format!(
            "false convergence: the program was solved, but integrated anew its motion leaves its own nodes by \
             {defect:.1e}"
        ),
        CollocationStatus::NotSolved(Status::Interrupted) if report.program.status.is_converged() => {
            return "interrupted while the motion was integrated anew; its program was solved".to_owned();
        }
        CollocationStatus::NotSolved(status) => {
            return format!("the program of the last mesh was not solved: {}", status.message());
        }
        _ => "the last mesh allowed does not meet the tolerance".to_owned(),
    };
    match report.confirmation.violation_sentence(tol) {
        Some(violation) => format!("{said}. {violation}"),
        None => said,
    }
}

/// What a result is, in its text.
pub(super) fn summary(report: &CollocationReport, tol: f64) -> String {
    let (cost, meshes) = (report.cost, report.history.len());
    let defect = report.confirmation.max_defect();
    let is_confirmed = report.confirmation.is_confirmed(tol);
    let confirmed = if is_confirmed { "confirmed" } else { "NOT confirmed by integration" };
    let status = status(report.status);
    format!("{status}, {confirmed}, cost {cost:.8}, {meshes} meshes, largest defect {defect:.1e}")
}

/// What the integrations of all phases say, those of trees.
pub(super) fn verifier(report: &CollocationReport, models: Vec<multibody::Model>, tol: f64) -> Arc<Verifier> {
    let (confirmation, phases) = (report.confirmation.clone(), report.phases.clone());
    Verifier::new(move |py| {
        let mut drift: f64 = 0.0;
        for (model, phase) in models.iter().zip(&phases) {
            let states = phase.states.iter().map(|x| x.split_at(model.n_velocities()));
            drift = drift.max(momentum_drift(model, states)?);
        }
        let found = verification::Verification {
            defects: confirmation.phases.iter().flat_map(|phase| phase.defects.iter().copied()).collect(),
            terminal_error: confirmation.end_to_end_error(),
            momentum_drift: drift,
        };
        let (confirmed, message) = (confirmation.is_confirmed(tol), confirmation.sentence(tol));
        Ok(Py::new(py, Verification::judged(found, tol, confirmed, message))?.into_any())
    })
}

impl CollocationResult {
    pub(super) fn of(report: CollocationReport, model: &multibody::Model, tol: f64) -> Result<Self, Error> {
        let verifier = verifier(&report, vec![model.clone()], tol);
        Ok(Self { report, model: model.clone(), tol, verifier })
    }

    /// The problem has one phase.
    fn phase(&self) -> &PhaseSolution {
        &self.report.phases[0]
    }

    fn at<'py>(
        &self,
        py: Python<'py>,
        t: &Bound<'py, PyAny>,
        value: impl Fn(&PhaseSolution, f64) -> Vec<f64>,
    ) -> Result<Bound<'py, PyAny>, Error> {
        let (single, times) = times("t", t)?;
        if let Some(found) = times.iter().find(|t| !t.is_finite()) {
            return Err(Error::input(format!("`t` must be finite, found {found}")));
        }
        let rows: Vec<Vec<f64>> = times.iter().map(|&t| value(self.phase(), t)).collect();
        match (single, rows.first()) {
            (true, Some(row)) => Ok(numpy::PyArray1::from_slice(py, row).into_any()),
            _ => Ok(table(py, &rows)?),
        }
    }
}

#[pymethods]
impl CollocationResult {
    /// str: ``'converged'``; ``'false_convergence'`` where the program was solved and its motion is none;
    /// ``'mesh_limit'`` where the last mesh does not meet the tolerance; else how the last program ended, as for `Report`.
    #[getter]
    fn status(&self) -> &'static str {
        status(self.report.status)
    }

    /// str: The status in a sentence, and another where bounds or path constraints are exceeded by more than the tolerance
    /// between the collocation points or at the end, where they are not asked for: what, by how much and when.
    #[getter]
    fn message(&self) -> String {
        message(&self.report, self.tol)
    }

    /// bool: Whether the status is ``'converged'``.
    #[getter]
    fn success(&self) -> bool {
        self.report.status == CollocationStatus::Converged
    }

    /// bool: Whether each interval, integrated anew, ends within the tolerance of where it should.
    #[getter]
    fn confirmed(&self) -> bool {
        self.report.confirmation.is_confirmed(self.tol)
    }

    /// Verification: The motion integrated anew, interval by interval.
    #[getter]
    fn verification(&self, py: Python<'_>) -> Result<Py<PyAny>, Error> {
        self.verifier.get(py)
    }

    /// float: Cost as the program sees it; that of an accurate integration is `verified_cost`. Of one of several phases both are
    /// accurate.
    #[getter]
    fn cost(&self) -> f64 {
        self.report.cost
    }

    /// ndarray, shape (n + 1,): Times, s.
    #[getter]
    fn t<'py>(&self, py: Python<'py>) -> Bound<'py, PyAny> {
        numpy::PyArray1::from_slice(py, &self.phase().times).into_any()
    }

    /// ndarray, shape (n + 1, n_states): States.
    #[getter]
    fn x<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        table(py, &self.phase().states)
    }

    /// ndarray, shape (n, n_controls): Controls.
    #[getter]
    fn u<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        table(py, &self.phase().controls)
    }

    /// ndarray, shape (n + 1, n_states): Costates λ, the change of the least cost from there on with the state.
    #[getter]
    fn costates<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        table(py, &self.phase().costates)
    }

    /// ndarray, shape (n,): Hamiltonian L + λᵀ ẋ.
    #[getter]
    fn hamiltonian<'py>(&self, py: Python<'py>) -> Bound<'py, PyAny> {
        numpy::PyArray1::from_slice(py, &self.phase().hamiltonian).into_any()
    }

    /// float: Largest minus smallest Hamiltonian; zero for the optimum.
    #[getter]
    fn hamiltonian_spread(&self) -> f64 {
        self.phase().hamiltonian_spread()
    }

    /// States at times, by the polynomials of collocation.
    ///
    /// Parameters
    /// ----------
    /// t : float or array_like, shape (m,)
    ///     Times outside of the motion count as its ends.
    ///
    /// Returns
    /// -------
    /// ndarray, shape (n_states,) or (m, n_states)
    fn state<'py>(&self, py: Python<'py>, t: &Bound<'py, PyAny>) -> Result<Bound<'py, PyAny>, Error> {
        self.at(py, t, PhaseSolution::state)
    }

    /// Controls at times.
    ///
    /// Parameters
    /// ----------
    /// t : float or array_like, shape (m,)
    ///
    /// Returns
    /// -------
    /// ndarray, shape (n_controls,) or (m, n_controls)
    fn control<'py>(&self, py: Python<'py>, t: &Bound<'py, PyAny>) -> Result<Bound<'py, PyAny>, Error> {
        self.at(py, t, PhaseSolution::control)
    }

    /// Costates at times.
    ///
    /// Parameters
    /// ----------
    /// t : float or array_like, shape (m,)
    ///
    /// Returns
    /// -------
    /// ndarray, shape (n_states,) or (m, n_states)
    fn costate<'py>(&self, py: Python<'py>, t: &Bound<'py, PyAny>) -> Result<Bound<'py, PyAny>, Error> {
        self.at(py, t, PhaseSolution::costate)
    }

    /// float: Cost with the running cost integrated accurately along the motion.
    #[getter]
    fn verified_cost(&self) -> f64 {
        self.report.confirmation.cost
    }

    /// ndarray, shape (n_intervals,): Relative error at the end of each interval of the mesh, integrated accurately from
    /// its start; infinite where that broke off.
    #[getter]
    fn defects<'py>(&self, py: Python<'py>) -> Bound<'py, PyAny> {
        numpy::PyArray1::from_slice(py, &self.report.confirmation.phases[0].defects).into_any()
    }

    /// float: The largest defect.
    #[getter]
    fn max_defect(&self) -> f64 {
        self.report.confirmation.max_defect()
    }

    /// float: Relative error at the end of the motion, integrated from its start in one piece. It grows where the motion
    /// is hyper-sensitive, however good the solution is.
    #[getter]
    fn terminal_error(&self) -> f64 {
        self.report.confirmation.end_to_end_error()
    }

    /// float: Largest violation of a bound or path constraint, between the points and at the end too.
    #[getter]
    fn violation(&self) -> f64 {
        self.report.confirmation.max_violation()
    }

    /// list of dict: All meshes: ``n_intervals``, ``n_points``, ``cost``, ``error`` (largest relative one estimated),
    /// ``status`` of the program, ``nit`` and ``seconds``.
    #[getter]
    fn meshes<'py>(&self, py: Python<'py>) -> PyResult<Vec<Bound<'py, PyDict>>> {
        let record = |record: &somersault::ocp::collocation::MeshRecord| {
            let entry = PyDict::new(py);
            entry.set_item("n_intervals", record.meshes[0].n_intervals())?;
            entry.set_item("n_points", record.meshes[0].n_points())?;
            entry.set_item("cost", record.cost)?;
            entry.set_item("error", record.error)?;
            entry.set_item("status", status_name(record.status))?;
            entry.set_item("nit", record.iterations)?;
            entry.set_item("seconds", record.time.as_secs_f64())?;
            Ok(entry)
        };
        self.report.history.iter().map(record).collect()
    }

    /// Report: Of the last program.
    #[getter]
    fn report(&self) -> Report {
        Report { report: self.report.program.clone(), verifier: Some(self.verifier.clone()) }
    }

    fn __repr__(&self) -> String {
        format!("<CollocationResult: {}>", summary(&self.report, self.tol))
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyTuple>)> {
        let (py, own) = (slf.py(), slf.get());
        let (report, phase) = (&own.report, own.phase());
        let confirmed = &report.confirmation.phases[0];
        let tables = [&phase.states, &phase.controls, &phase.costates, &phase.path_multipliers];
        let tables = tables.map(|rows| rows.clone());
        let tried = |record: &MeshRecord| -> Tried {
            let mesh = &record.meshes[0];
            let (status, seconds) = (status_name(record.status).to_owned(), record.time.as_secs_f64());
            let points = mesh.points().to_vec();
            (mesh.bounds().to_vec(), points, record.cost, record.error, status, record.iterations, seconds)
        };
        let on_mesh: OnMesh =
            (phase.mesh().bounds().to_vec(), phase.mesh().points().to_vec(), phase.horizon());
        let integrated: Confirmed = (
            confirmed.defects.clone(),
            confirmed.end_to_end_error,
            confirmed.end_to_end_state.clone(),
            (confirmed.violation, confirmed.violated.clone()),
            (confirmed.running_cost, confirmed.end_cost),
            report.confirmation.cost,
        );
        let arguments = (
            Model::of(own.model.clone()),
            (own.status(), report.cost, own.tol),
            on_mesh,
            tables,
            phase.hamiltonian.clone(),
            integrated,
            report.history.iter().map(tried).collect::<Vec<_>>(),
            Report { report: report.program.clone(), verifier: None },
        );
        Ok((slf.get_type().getattr("_restore")?, arguments.into_pyobject(py)?))
    }

    /// A pickled result.
    #[classmethod]
    fn _restore(
        _: &Bound<'_, PyType>,
        model: &Bound<'_, Model>,
        outcome: Outcome,
        on_mesh: OnMesh,
        tables: [Vec<Vec<f64>>; 4],
        hamiltonian: Vec<f64>,
        integrated: Confirmed,
        history: Vec<Tried>,
        program: &Bound<'_, Report>,
    ) -> Result<Self, Error> {
        let (status, cost, tol) = outcome;
        let status = match status.as_str() {
            "converged" => CollocationStatus::Converged,
            "false_convergence" => CollocationStatus::FalseConvergence,
            "mesh_limit" => CollocationStatus::MeshLimit,
            other => CollocationStatus::NotSolved(status_of(other)?),
        };
        let (bounds, points, horizon) = on_mesh;
        let [states, controls, costates, path_multipliers] = tables;
        let rows =
            PhaseRows { states, controls, costates, path_multipliers, hamiltonian, parameters: Vec::new() };
        let mesh = Mesh::try_new(bounds, points)?;
        let (defects, end_to_end_error, end_to_end_state, violation, costs, accurate) = integrated;
        let ((violation, violated), (running_cost, end_cost)) = (violation, costs);
        if defects.len() != mesh.n_intervals() {
            let (n, found) = (mesh.n_intervals(), defects.len());
            return Err(Error::input(format!("`defects` must have {n} entries, found {found}")));
        }
        let phase = PhaseSolution::try_new(mesh, horizon, rows)?;
        let model = &model.get().model;
        if phase.states[0].len() != 2 * model.n_velocities() {
            let (n, found) = (2 * model.n_velocities(), phase.states[0].len());
            return Err(Error::input(format!("`states` must have {n} columns, found {found}")));
        }
        let tried = |(bounds, points, cost, error, status, iterations, seconds): Tried| {
            let time = Duration::try_from_secs_f64(seconds)
                .map_err(|_| Error::input(format!("`seconds` must not be negative, found {seconds}")))?;
            let meshes = vec![Mesh::try_new(bounds, points)?];
            Ok(MeshRecord { meshes, cost, error, status: status_of(&status)?, iterations, time })
        };
        let confirmed = PhaseConfirmation {
            defects,
            end_to_end_error,
            end_to_end_state,
            violation,
            violated,
            running_cost,
            end_cost,
        };
        let report = CollocationReport {
            status,
            phases: vec![phase],
            cost,
            confirmation: Confirmation { phases: vec![confirmed], cost: accurate },
            history: history.into_iter().map(tried).collect::<Result<_, Error>>()?,
            program: program.get().report.clone(),
        };
        Self::of(report, model, tol)
    }
}
