//! Motions of trees by direct collocation.

use super::solver::{Report, Watcher, duration as limit_of_time, status_name};
use crate::convert::{array, numbers_or_one, real_numbers, times, with_shape};
use crate::error::Error;
use crate::model::Model;
use crate::plan::returns_interrupted;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use somersault::multibody::{self, Scalar};
use somersault::ocp::collocation::{
    Collocation, CollocationReport, CollocationStatus, Ends, Guess, Interval, Mesh, Phase, PhaseSolution,
    Point, Problem, Terms, TreeDynamics,
};
use somersault::ocp::nalgebra::convert;
use somersault::ocp::solver::{Flow, Sqp};

/// L = ½ Σ γᵢ uᵢ² + ½ Σ wᵢ (xᵢ − x*ᵢ)² + c, Φ = ½ Σ Wᵢ (xᵢ(t_f) − x*ᵢ)².
#[derive(Clone)]
struct Quadratic {
    control_weights: Vec<f64>,
    state_weights: Vec<f64>,
    final_weights: Vec<f64>,
    target: Vec<f64>,
    time_weight: f64,
}

fn half_squares<T: Scalar>(weights: &[f64], values: &[T], target: impl Iterator<Item = f64>) -> T {
    weights.iter().zip(values).zip(target).fold(T::zero(), |sum, ((&w, &x), target)| {
        let apart = x - convert::<f64, T>(target);
        sum + apart * apart * convert::<f64, T>(0.5 * w)
    })
}

impl Terms for Quadratic {
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
    model: multibody::Model,
    actuated: Vec<usize>,
    terms: Quadratic,
    initial_state: Vec<Interval>,
    final_state: Vec<Interval>,
    duration: Interval,
    controls: Vec<Interval>,
    states: Vec<Interval>,
}

/// A number, a pair of bounds, or nothing.
#[derive(FromPyObject, Clone, Copy)]
enum Entry {
    Number(f64),
    Range(f64, f64),
}

impl From<Entry> for Interval {
    fn from(entry: Entry) -> Self {
        match entry {
            Entry::Number(value) => Self::fixed(value),
            Entry::Range(lower, upper) => Self::new(lower, upper),
        }
    }
}

fn ends(argument: &str, n: usize, entries: &[Option<Entry>]) -> Result<Vec<Interval>, Error> {
    if entries.len() != n {
        let found = entries.len();
        return Err(Error::input(format!("`{argument}` must have {n} entries, found {found}")));
    }
    Ok(entries.iter().map(|entry| entry.map_or(Interval::FREE, Interval::from)).collect())
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
fn guess_of(problem: &CollocationProblem, value: &Bound<'_, PyAny>) -> Result<Guess, Error> {
    if let Ok(result) = value.cast::<CollocationResult>() {
        return Ok(result.get().phase().to_guess());
    }
    let (n_states, n_controls) = (problem.states.len(), problem.controls.len());
    let rows = |values: Vec<f64>, width: usize| values.chunks(width.max(1)).map(<[f64]>::to_vec).collect();
    let at_rest = |n: usize| vec![vec![0.0; n_controls]; n];
    let states = |n: usize, value: &Bound<'_, PyAny>| -> Result<Vec<Vec<f64>>, Error> {
        Ok(rows(with_shape("states of the guess", &[n, n_states], value)?, n_states))
    };
    if let Ok((t, x, u)) = value.extract::<(Bound<'_, PyAny>, Bound<'_, PyAny>, Bound<'_, PyAny>)>()
        && value.is_instance_of::<pyo3::types::PyTuple>()
    {
        let times = real_numbers("times of the guess", &t)?;
        let n = times.len();
        let controls = if u.is_none() {
            at_rest(n)
        } else {
            rows(with_shape("controls of the guess", &[n, n_controls], &u)?, n_controls)
        };
        let controls = if n_controls == 0 { at_rest(n) } else { controls };
        return Ok(Guess { states: states(n, &x)?, times, controls, parameters: Vec::new() });
    }
    let n = value.len()?;
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
    fn problem(&self, guess: Option<Guess>) -> Result<Problem, Error> {
        let dynamics = TreeDynamics::try_new(&self.model, &self.actuated)?;
        let mut phase = Phase::of_tree(dynamics, self.terms.clone())
            .initial_state(self.initial_state.clone())
            .final_state(self.final_state.clone())
            .horizon(0.0, self.duration)
            .control_bounds(self.controls.clone())
            .state_bounds(self.states.clone());
        if let Some(guess) = guess {
            phase = phase.guess(guess);
        }
        Ok(Problem::try_new(phase)?)
    }
}

#[pymethods]
impl CollocationProblem {
    #[new]
    #[pyo3(signature = (
        model, initial_state, final_state, duration, *, actuated=None, control_weights=None, state_weights=None,
        final_weights=None, target=None, time_weight=0.0, control_lower=None, control_upper=None,
        state_lower=None, state_upper=None
    ))]
    fn new(
        model: &Bound<'_, Model>,
        initial_state: Vec<Option<Entry>>,
        final_state: Vec<Option<Entry>>,
        duration: Entry,
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
    ) -> Result<Self, Error> {
        let tree = &model.get().model;
        let n = tree.n_velocities();
        let actuated: Vec<usize> = match actuated {
            Some(value) => {
                let split = model.get().split(value)?;
                (0..n).filter(|k| split.active()[*k]).collect()
            }
            None => (0..n).collect(),
        };
        if !time_weight.is_finite() {
            return Err(Error::ocp_input(format!("`time_weight` must be finite, found {time_weight}")));
        }
        let m = actuated.len();
        let terms = Quadratic {
            control_weights: weights("control_weights", m, control_weights, 1.0)?,
            state_weights: weights("state_weights", 2 * n, state_weights, 0.0)?,
            final_weights: weights("final_weights", 2 * n, final_weights, 0.0)?,
            target: finite_numbers("target", 2 * n, target, 0.0)?,
            time_weight,
        };
        let posed = Self {
            model: tree.clone(),
            terms,
            initial_state: ends("initial_state", 2 * n, &initial_state)?,
            final_state: ends("final_state", 2 * n, &final_state)?,
            duration: duration.into(),
            controls: intervals(["control_lower", "control_upper"], m, control_lower, control_upper)?,
            states: intervals(["state_lower", "state_upper"], 2 * n, state_lower, state_upper)?,
            actuated,
        };
        posed.problem(None)?;
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
        n_intervals: usize,
        n_points: usize,
        max_meshes: usize,
        max_iterations: Option<usize>,
        max_time: Option<f64>,
        callback: Option<&Bound<'_, PyAny>>,
        on_interrupt: &str,
    ) -> Result<CollocationResult, Error> {
        let returned = returns_interrupted(on_interrupt)?;
        let default = Collocation::default();
        let collocation = Collocation {
            tolerance: tol,
            max_meshes,
            solver: Sqp {
                max_iterations: max_iterations.unwrap_or(default.solver.max_iterations),
                max_time: limit_of_time(max_time)?,
                ..default.solver
            },
            ..default
        };
        let mesh = Mesh::try_uniform(n_intervals, n_points)?;
        let guess = guess.map(|guess| guess_of(self, guess)).transpose()?;
        let mut problem = self.problem(guess)?;
        let mut watcher = Watcher::new(callback);
        let found = py.detach(|| {
            collocation.solve(&mut problem, &[mesh], &mut |iteration| -> Flow { watcher.look(iteration) })
        });
        let result = CollocationResult { report: found? };
        match watcher.into_raised(py, returned) {
            Some(error) => {
                // An exception that takes no attributes is still the one to raise.
                let _ = error.value(py).setattr("result", Py::new(py, result)?);
                Err(error.into())
            }
            None => Ok(result),
        }
    }

    fn __repr__(&self) -> String {
        let (n, m) = (self.n_states(), self.n_controls());
        format!("<CollocationProblem: {n} states, {m} controls>")
    }
}

/// What collocation found. Rows belong to the collocation points; those of `t`, `x` and `costates` have the end as a
/// last row.
#[pyclass(frozen, module = "somersault.ocp")]
pub(crate) struct CollocationResult {
    report: CollocationReport,
}

fn table<'py>(py: Python<'py>, rows: &[Vec<f64>]) -> PyResult<Bound<'py, PyAny>> {
    let shape = [rows.len(), rows.first().map_or(0, Vec::len)];
    Ok(array(py, rows.concat(), &shape)?.into_any())
}

impl CollocationResult {
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
        match self.report.status {
            CollocationStatus::Converged => "converged",
            CollocationStatus::FalseConvergence => "false_convergence",
            CollocationStatus::MeshLimit => "mesh_limit",
            CollocationStatus::NotSolved(status) => status_name(status),
            // statuses to come end a search as well
            _ => "failed",
        }
    }

    /// str: The status in a sentence.
    #[getter]
    fn message(&self) -> String {
        let defect = self.report.confirmation.max_defect();
        match self.report.status {
            CollocationStatus::Converged => {
                format!("converged and confirmed: integrated anew the largest defect is {defect:.1e}")
            }
            CollocationStatus::FalseConvergence => format!(
                "false convergence: the program was solved, but integrated anew its motion leaves its own nodes by \
                 {defect:.1e}"
            ),
            CollocationStatus::NotSolved(status) => {
                format!("the program of the last mesh was not solved: {}", status.message())
            }
            _ => "the last mesh allowed does not meet the tolerance".to_owned(),
        }
    }

    /// bool: Whether the status is ``'converged'``.
    #[getter]
    fn success(&self) -> bool {
        self.report.status == CollocationStatus::Converged
    }

    /// float: Cost as the program sees it; that of an accurate integration is `verified_cost`.
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

    /// float: Largest violation of a bound, between the points too.
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
        Report { report: self.report.program.clone() }
    }

    fn __repr__(&self) -> String {
        let (cost, meshes) = (self.report.cost, self.report.history.len());
        let defect = self.report.confirmation.max_defect();
        format!(
            "<CollocationResult: {}, cost {cost:.8}, {meshes} meshes, largest defect {defect:.1e}>",
            self.status()
        )
    }
}
