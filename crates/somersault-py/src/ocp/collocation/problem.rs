//! A motion of a tree by direct collocation.

use super::arguments::{ends, finite_numbers, intervals, intervals_of, pairs, rows_of, weights};
use super::guess::guess_of;
use super::result::Subject;
use super::search::SearchOptions;
use super::terms::Quadratic;
use super::{CollocationResult, NAMES};
use crate::core::convert::{a_type, finite, finite_all, integer, integer_or_none, with_shape};
use crate::core::error::Error;
use crate::core::value::{Pickled, by_restore, value};
use crate::multibody::model::Model;
use crate::ocp::arguments::number_or_range;
use pyo3::prelude::*;
use pyo3::types::PyType;
use somersault::multibody;
use somersault::ocp::collocation::{Guess, Interval, Phase, Problem, TreeDynamics};

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
/// InputError
///     If a joint has more than one degree of freedom, bounds contradict, or a number is not finite.
///
/// Examples
/// --------
/// One metre in one second from rest to rest with minimum effort: ½ ∫ u² dt = 6, u = 6 − 12 t.
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

    /// A path constraint that an end, with whatever controls there are, cannot meet: it is not required at the very end,
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
                    return Err(Error::input(format!(
                        "`path`, row {k}, must be possible at `{argument}`: there it is {}, and `path_lower` and \
                         `path_upper` allow {bounds}",
                        Interval::new(least, most)
                    )));
                }
            }
        }
        Ok(())
    }

    /// The guess that an argument stands for.
    pub(super) fn guess(&self, value: &Bound<'_, PyAny>) -> Result<Guess, Error> {
        guess_of([self.states.len(), self.controls.len()], self.duration, value)
    }

    pub(super) fn subject(&self) -> Result<Subject, Error> {
        let dynamics = TreeDynamics::try_new(&self.model, &self.actuated)?;
        Ok(Subject {
            model: Some(self.model.clone()),
            states: dynamics.state_names(),
            controls: dynamics.control_names(),
            parameters: Vec::new(),
        })
    }

    fn problem(&self, guess: Option<Guess>) -> Result<Problem, Error> {
        Problem::try_new(self.phase(guess)?).map_err(|error| Error::from(error).with_names(&NAMES))
    }
}

value! {
    impl CollocationProblem {
        /// Model: The tree.
        model: Model = |own| Model::of(own.model.clone());
        /// int: Length of x.
        n_states: usize = |own| own.states.len();
        /// int: Length of u.
        n_controls: usize = |own| own.controls.len();
    }
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
        finite("time_weight", time_weight)?;
        let m = actuated.len();
        let (lower, upper) = number_or_range("duration", duration)?;
        // a NaN is not below
        if !(0.0 < lower && lower <= upper && lower.is_finite()) {
            return Err(Error::input(format!(
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

    /// Solves, refines the mesh to the tolerance, and integrates what was found again.
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
    /// on_interrupt : {'raise', 'return'}, optional
    ///     What Ctrl-C does: raise with the best iterate as the attribute ``solution``, or return it.
    ///     An iteration that takes longer than 0.4 s is not waited for: KeyboardInterrupt is raised without it.
    ///
    /// Returns
    /// -------
    /// CollocationResult
    ///     With the best motion found, whatever the status.
    ///
    /// Examples
    /// --------
    /// With a free duration, which costs as much as effort, and bounds on the force:
    ///
    /// >>> from somersault import multibody, ocp
    /// >>> block = multibody.Link("block", joint="prismatic", axis=(1, 0, 0), mass=1.0)
    /// >>> model = multibody.Model([block], gravity=(0, 0, 0))
    /// >>> problem = ocp.CollocationProblem(
    /// ...     model, [0, 0], [1, 0], (0.5, 5.0), control_lower=-1, control_upper=1, time_weight=1)
    /// >>> found = problem.solve(tol=1e-4, n_intervals=10)
    /// >>> found.status, round(float(found.t[-1]), 3)
    /// ('converged', 2.167)
    #[pyo3(signature = (
        guess=None, *, tol=1e-6, n_intervals=40, n_points=4, max_meshes=20, max_iterations=None, max_time=None,
        callback=None, on_interrupt="raise"
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
        let problem = || self.problem(guess.map(|guess| self.guess(guess)).transpose()?);
        let subject = self.subject()?;
        options.run(py, 1, problem, |report| Ok(CollocationResult::of(py, report, subject, tol)?))
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> Pickled<'py> {
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
        by_restore(slf, (own.model(), own.actuated.clone(), weights, bounds, terms.path.clone()))
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
