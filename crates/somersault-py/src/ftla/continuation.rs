//! Extremals from a rest, and families of them.

use super::argument::{limits_of, whole};
use super::flow::Settings;
use super::matching::entries;
use super::named_systems::of_arm;
use super::run::{Run, attend, attend_stopping, caused};
use super::shooting::{EndStates, Extremal, end_of, shooting_of};
use super::system::System;
use super::watched::Source;
use crate::core::callable::check_callable;
use crate::core::convert::{a_type, positive, real_numbers};
use crate::core::error::Error;
use crate::core::value::{Pickled, by_restore, value};
use pyo3::prelude::*;
use pyo3::types::PyType;
use somersault::core::cancel::CancellationToken;
use somersault::ftla::budget::Limits;
use somersault::ftla::cold_start::{ArmTravel, ProblemTravel, TreeTravel};
use somersault::ftla::continuation::{self, Continuation, Member, Reason};
use somersault::ftla::shooting::MultipleShooting;
use somersault::ftla::system::StateCostate;
use std::sync::Arc;

/// Result of a continuation.
#[pyclass(frozen, module = "somersault.ftla")]
pub(crate) struct ContinuationResult {
    extremal: Py<Extremal>,
    /// float: The parameter of that extremal: one if the continuation arrived.
    #[pyo3(get)]
    s: f64,
    /// int: Members solved on the way.
    #[pyo3(get)]
    n_steps: usize,
    /// int: Members tried without success.
    #[pyo3(get)]
    n_rejected: usize,
    /// int: Newton steps of all of them.
    #[pyo3(get)]
    n_iterations: usize,
    /// int: Evaluations of the field for all of them.
    #[pyo3(get)]
    n_evaluations: usize,
    /// str: What it was doing last, such as ``'along the family'`` or ``'lowering torque limits'``.
    #[pyo3(get)]
    stage: String,
    /// Why it went no further, and whether that was a limit; none if it arrived.
    reason: Option<(String, bool)>,
}

value! {
    impl ContinuationResult {
        /// bool: Whether the last member was reached and polished.
        success: bool = |own| own.reason.is_none();
        /// Extremal: The last solution.
        extremal: Py<Extremal> = |own, py| own.extremal.clone_ref(py);
    }
}

#[pymethods]
impl ContinuationResult {
    /// str: ``'arrived'``, ``'broke_off'``, or ``'limit_reached'`` where ``max_time`` or ``max_evaluations`` was; ``extremal`` is then
    /// the last member solved or, where there is none, the best iterate.
    #[getter]
    fn status(&self) -> &'static str {
        match self.reason {
            None => "arrived",
            Some((_, false)) => "broke_off",
            Some((_, true)) => "limit_reached",
        }
    }

    /// str: Stage and reason in a sentence.
    #[getter]
    fn message(&self) -> String {
        match &self.reason {
            None => "the last member is reached and polished".to_owned(),
            Some((why, _)) => format!("stopped early at s = {} {}: {why}", self.s, self.stage),
        }
    }

    fn __repr__(&self) -> String {
        let Self { s, n_steps, n_rejected, n_iterations, .. } = self;
        let how = if self.success() { "arrived" } else { "stopped early" };
        format!(
            "<ContinuationResult: {how} at s = {s}, {n_steps} members, {n_rejected} without success, {n_iterations} iterations>"
        )
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> Pickled<'py> {
        let own = slf.get();
        let counts = (own.n_steps, own.n_rejected, own.n_iterations, own.n_evaluations);
        by_restore(slf, (own.extremal.bind(slf.py()), own.s, counts, own.stage.clone(), own.reason.clone()))
    }

    /// A pickled continuation.
    #[classmethod]
    fn _restore(
        _: &Bound<'_, PyType>,
        extremal: Py<Extremal>,
        s: f64,
        counts: (usize, usize, usize, usize),
        stage: String,
        reason: Option<(String, bool)>,
    ) -> Self {
        let (n_steps, n_rejected, n_iterations, n_evaluations) = counts;
        Self { extremal, s, n_steps, n_rejected, n_iterations, n_evaluations, stage, reason }
    }
}

/// What a continuation leaves, as a value of Python.
fn continued(
    py: Python<'_>,
    found: continuation::ContinuationResult,
    system: Py<System>,
    polish: &MultipleShooting,
) -> Result<ContinuationResult, Error> {
    let extremal = Extremal { system, settings: Settings::new(polish.flow), extremal: found.extremal };
    Ok(ContinuationResult {
        extremal: Py::new(py, extremal)?,
        s: found.s,
        n_steps: found.steps[0],
        n_rejected: found.steps[1],
        n_iterations: found.iterations,
        n_evaluations: found.work.evaluations,
        stage: found.stage.to_string(),
        reason: found.reason.map(|why| (why.to_string(), matches!(why, Reason::Limit(_)))),
    })
}

/// Settings of a continuation: those of `shoot` for its last member, then those of its steps.
fn continuation_of(
    tolerances: [f64; 3],
    max_iterations: usize,
    [first_step, min_step]: [f64; 2],
    limits: Limits,
) -> Result<Continuation, Error> {
    let polish = shooting_of(tolerances, max_iterations, limits)?;
    for (name, found) in [("first_step", first_step), ("min_step", min_step)] {
        if !found.is_finite() || found <= 0.0 || found > 1.0 {
            return Err(Error::input(format!("`{name}` must be above 0 and not above 1, found {found}")));
        }
    }
    Ok(Continuation { polish, first_step, min_step, ..Continuation::default() })
}

/// Fractions of the horizon, which must ascend from 0 to 1.
fn fractions_of(fractions: &Bound<'_, PyAny>) -> Result<Vec<f64>, Error> {
    let fractions = real_numbers("fractions", fractions)?;
    let ascending = fractions.windows(2).all(|pair| pair[0] < pair[1]);
    match (fractions.first(), fractions.last()) {
        (Some(0.0), Some(1.0)) if ascending => Ok(fractions),
        (_, _) => Err(Error::input("`fractions` must ascend from 0 to 1")),
    }
}

fn through(
    continuation: &Continuation,
    system: &System,
    run: &Arc<Run>,
    stages: &[[Vec<f64>; 2]],
    horizon: f64,
    fractions: &[f64],
) -> Result<continuation::ContinuationResult, Error> {
    system.n_states()?;
    Ok(continuation.through(&system.watched(run)?, stages, horizon, fractions)?)
}

/// Leads a system from rest to given end states, through pairs of end states on the way.
///
/// Parameters
/// ----------
/// system : System
/// stages : sequence of pair of array_like, shape (n,)
///     Initial and final states. The first pair must be a rest: the same state at both ends, at which staying without control
///     costs nothing. An arm that folds first rests folded, then travels folded, then unfolds at the ends.
/// horizon : float
///     s.
/// fractions : array_like, shape (m,)
///     Times of the nodes as fractions of the horizon, ascending from 0 to 1.
/// tol : float, optional
///     Of the last member, as for `shoot`.
/// max_iterations : int, optional
/// rtol, atol : float, optional
/// first_step, min_step : float, optional
///     First step of the parameter from 0 to 1 in a stage, and the one below which a continuation ends.
/// max_time : float, optional
///     s. A search that reaches it ends with the status ``'limit_reached'`` and what it has.
/// max_evaluations : int, optional
///     Of the field, likewise.
///
/// Returns
/// -------
/// ContinuationResult
///
/// Examples
/// --------
/// >>> from somersault import ftla
/// >>> fractions = ftla.graded_times(1.0, 0.02, 0.2)
/// >>> stages = [([0.0], [0.0]), ([1.0], [1.5])]
/// >>> found = ftla.continue_through(ftla.cubic_regulator(), stages, 40.0, fractions)
/// >>> found.success, round(found.extremal.cost(), 6)
/// (True, 3.362057)
#[pyfunction]
#[pyo3(signature = (
    system, stages, horizon, fractions, *, tol=1e-11, max_iterations=100, rtol=1e-13, atol=1e-15, first_step=0.1,
    min_step=1e-4, max_time=None, max_evaluations=None
))]
pub(crate) fn continue_through(
    py: Python<'_>,
    system: Py<System>,
    #[pyo3(from_py_with = crate::core::convert::entries)] stages: Vec<Bound<'_, PyAny>>,
    horizon: f64,
    fractions: &Bound<'_, PyAny>,
    tol: f64,
    #[pyo3(from_py_with = whole::max_iterations)] max_iterations: usize,
    rtol: f64,
    atol: f64,
    first_step: f64,
    min_step: f64,
    max_time: Option<&Bound<'_, PyAny>>,
    max_evaluations: Option<&Bound<'_, PyAny>>,
) -> Result<ContinuationResult, Error> {
    let limits = limits_of(max_time, max_evaluations)?;
    let continuation = continuation_of([tol, rtol, atol], max_iterations, [first_step, min_step], limits)?;
    let fractions = fractions_of(fractions)?;
    let pair = |pair: &Bound<'_, PyAny>| {
        let [initial, last]: [Bound<'_, PyAny>; 2] = pair
            .extract()
            .map_err(|_| Error::input(format!("`stages` must be pairs of states, found {}", a_type(pair))))?;
        Ok([real_numbers("stages", &initial)?, real_numbers("stages", &last)?])
    };
    let stages = stages.iter().map(pair).collect::<Result<Vec<_>, Error>>()?;
    positive("horizon", horizon)?;
    let found = attend(py, |run| through(&continuation, system.get(), run, &stages, horizon, &fractions))?;
    continued(py, found, system, &continuation.polish)
}

/// The ends of a cold start and its horizon.
struct Travel {
    ends: [EndStates; 2],
    horizon: f64,
}

impl Travel {
    /// As given, or else as the problem has them that the system is of.
    fn of(
        system: &System,
        ends: [Option<&Bound<'_, PyAny>>; 2],
        horizon: Option<f64>,
    ) -> Result<Self, Error> {
        let (n, posed) = (system.n_states()?, system.posed().map(StateCostate::problem));
        let names = ["initial_state", "final_state"];
        let missing = |name: &str| {
            Error::input(format!("`{name}` must be given: only the system of a `ControlProblem` has one"))
        };
        let end = |k: usize| -> Result<EndStates, Error> {
            match (ends[k], posed) {
                (Some(given), None) => Ok(entries(names[k], n, given)?.into_iter().map(Some).collect()),
                (Some(given), Some(_)) => {
                    let states: EndStates = given.extract().map_err(|_| {
                        Error::input(format!(
                            "`{}` must be numbers, or None where free, found {}",
                            names[k],
                            a_type(given)
                        ))
                    })?;
                    end_of(names[k], n, &states).map(|_| states)
                }
                (None, Some(problem)) if k == 0 => Ok(problem.initial_state()?),
                (None, Some(problem)) => Ok(problem.final_state()?),
                (None, None) => Err(missing(names[k])),
            }
        };
        let ends = [end(0)?, end(1)?];
        let horizon = match (horizon, posed) {
            (Some(given), _) => given,
            (None, Some(problem)) => problem.horizon()?,
            (None, None) => return Err(missing("horizon")),
        };
        positive("horizon", horizon)?;
        Ok(Self { ends, horizon })
    }

    /// By collocation for the system of a problem, by a spline of minimum effort for a tree, by the linearised problem for another.
    fn start(
        &self,
        continuation: &Continuation,
        system: &System,
        run: &Arc<Run>,
        token: &CancellationToken,
    ) -> Result<continuation::ContinuationResult, Error> {
        let Self { ends: [initial, last], horizon } = self;
        let (watched, horizon) = (system.watched(run)?, *horizon);
        if let Some(system) = system.posed() {
            let travel = ProblemTravel { system, initial, last, horizon };
            return Ok(travel.solve_as(continuation, &watched, token)?);
        }
        // the ends of other systems have no free states
        let [initial, last] = [initial, last].map(|end| end.iter().flatten().copied().collect::<Vec<_>>());
        Ok(match system.tree() {
            Some(tree) => {
                let watch = |tree| Source::Compiled(Arc::new(tree)).watched(run);
                TreeTravel { system: tree, initial: &initial, last: &last, horizon }
                    .solve_as(continuation, watch)?
            }
            None => {
                somersault::ftla::cold_start::cold_start(&watched, &initial, &last, horizon, continuation)?
            }
        })
    }
}

/// An extremal of any system from its boundary states and the horizon alone.
///
/// The system of a `ControlProblem` starts from states and costates of collocation, at nodes between which the fastest rate
/// grows e-fold four times; its ends and duration are those of the problem unless others are given, and states may be free. Where
/// shooting fails from there, the linearised problem follows as for other systems.
/// A tree of hinges and sliders starts from a spline of minimum effort, whose torques tell the costates; what is passive is driven
/// at first and released by continuation, and limits come down on it. For any other system the problem linearised halfway
/// between the ends, which one Newton step solves, is led to the problem itself; where that stops early, the same at the
/// start, and the ends are moved apart afterwards. Of several extremals it finds one.
///
/// Parameters
/// ----------
/// system : System
/// initial_state, final_state : array_like, shape (n,), optional
///     For the system of a `ControlProblem` those of the problem, with None for states that are free. To be given for others.
/// horizon : float, optional
///     s. As `initial_state`.
/// tol : float, optional
///     As for `shoot`.
/// max_iterations : int, optional
/// rtol, atol : float, optional
/// first_step, min_step : float, optional
///     First step of the parameter from 0 to 1, and the one below which a continuation ends.
/// max_time : float, optional
///     s. A search that reaches it ends with the status ``'limit_reached'`` and what it has.
/// max_evaluations : int, optional
///     Of the field, likewise.
///
/// Returns
/// -------
/// ContinuationResult
///
/// Examples
/// --------
/// >>> from somersault import ftla
/// >>> found = ftla.cold_start(ftla.cubic_regulator(), [1.0], [1.5], 40.0)
/// >>> found.success, round(found.extremal.cost(), 6)
/// (True, 3.362057)
#[pyfunction]
#[pyo3(signature = (
    system, initial_state=None, final_state=None, horizon=None, *, tol=1e-11, max_iterations=100, rtol=1e-13,
    atol=1e-15, first_step=0.1, min_step=1e-4, max_time=None, max_evaluations=None
))]
pub(crate) fn cold_start(
    py: Python<'_>,
    system: Py<System>,
    initial_state: Option<&Bound<'_, PyAny>>,
    final_state: Option<&Bound<'_, PyAny>>,
    horizon: Option<f64>,
    tol: f64,
    #[pyo3(from_py_with = whole::max_iterations)] max_iterations: usize,
    rtol: f64,
    atol: f64,
    first_step: f64,
    min_step: f64,
    max_time: Option<&Bound<'_, PyAny>>,
    max_evaluations: Option<&Bound<'_, PyAny>>,
) -> Result<ContinuationResult, Error> {
    let limits = limits_of(max_time, max_evaluations)?;
    let continuation = continuation_of([tol, rtol, atol], max_iterations, [first_step, min_step], limits)?;
    let travel = Travel::of(system.get(), [initial_state, final_state], horizon)?;
    let token = Arc::new(limits.token());
    let stopping = Arc::clone(&token);
    let found = attend_stopping(
        py,
        move || stopping.cancel(),
        |run| travel.start(&continuation, system.get(), run, &token),
    )?;
    continued(py, found, system, &continuation.polish)
}

/// An extremal of the two-link arm between two rests, from the way it folds alone.
///
/// Parameters
/// ----------
/// system : System
///     As `arm` makes it.
/// initial, last : tuple of float
///     (θ₁, θ₂), rad.
/// horizon : float
///     s.
/// fold : float
///     θ₂ on the way, rad.
/// tol : float, optional
///     As for `shoot`.
/// max_iterations : int, optional
/// rtol, atol : float, optional
/// max_time : float, optional
///     s. A search that reaches it ends with the status ``'limit_reached'`` and what it has.
/// max_evaluations : int, optional
///     Of the field, likewise.
///
/// Returns
/// -------
/// ContinuationResult
#[pyfunction]
#[pyo3(signature = (
    system, initial, last, horizon, fold, *, tol=1e-11, max_iterations=100, rtol=1e-13, atol=1e-15, max_time=None,
    max_evaluations=None
))]
pub(crate) fn travel_arm(
    py: Python<'_>,
    system: Py<System>,
    initial: [f64; 2],
    last: [f64; 2],
    horizon: f64,
    fold: f64,
    tol: f64,
    #[pyo3(from_py_with = whole::max_iterations)] max_iterations: usize,
    rtol: f64,
    atol: f64,
    max_time: Option<&Bound<'_, PyAny>>,
    max_evaluations: Option<&Bound<'_, PyAny>>,
) -> Result<ContinuationResult, Error> {
    let polish = shooting_of([tol, rtol, atol], max_iterations, limits_of(max_time, max_evaluations)?)?;
    let Some(arm) = system.get().arm() else {
        return Err(Error::input("`system` must be an arm, as `ftla.arm` makes it"));
    };
    let travel = ArmTravel { system: arm, initial, last, fold, horizon };
    let continuation = Continuation { polish, ..Continuation::default() };
    let found = attend(py, |run| {
        let watch = |arm| Source::Compiled(Arc::new(arm)).watched(run);
        Ok(travel.solve_as(&continuation, watch)?)
    })?;
    // with limits that were not reached the motion is one of another arm
    let reached = if found.system == arm { system } else { Py::new(py, of_arm(found.system))? };
    continued(py, found.continued, reached, &continuation.polish)
}

/// A member of a family as a callable gives it.
type GivenMember = (Py<System>, EndStates, EndStates, f64);

fn follow(
    continuation: &Continuation,
    run: &Arc<Run>,
    first: &GivenMember,
    family: &(dyn Fn(f64) -> PyResult<GivenMember> + Sync),
    start: &Extremal,
) -> Result<continuation::ContinuationResult, Error> {
    let (dimension, n) = (start.system.get().dimension, start.system.get().n_states()?);
    let member = |(system, initial, last, horizon): &GivenMember| -> Result<Member<_>, Error> {
        if !horizon.is_finite() || *horizon <= 0.0 {
            return Err(Error::input(format!(
                "`family` must return a positive and finite horizon, found {horizon}"
            )));
        }
        if system.get().dimension != dimension {
            let found = system.get().dimension;
            return Err(Error::input(format!(
                "`family` must have systems of dimension {dimension} as `start` has, found {found}"
            )));
        }
        let ends = [end_of("initial_state", n, initial)?, end_of("final_state", n, last)?];
        Ok(Member { system: system.get().watched(run)?, ends, horizon: *horizon })
    };
    let fallback = member(first)?;
    let members = |s: f64| {
        if run.is_stopped() {
            return fallback.clone();
        }
        let given = family(s).map_err(Error::from).and_then(|given| member(&given));
        given.unwrap_or_else(|error| {
            run.stop(error.into());
            fallback.clone()
        })
    };
    Ok(continuation.follow(members, &start.fractions(), &start.extremal.nodes)?)
}

/// Follows a family of problems, from nodes that solve its first member to its last: in horizon, travel or any parameter.
///
/// By secants and Newton's method, in steps that grow where Newton is quick and are halved where it fails.
///
/// Parameters
/// ----------
/// family : callable
///     ``family(s) -> (system, initial_state, final_state, horizon)`` for s from 0 to 1.
/// start : Extremal
///     Of the member s = 0.
/// tol : float, optional
///     Of the last member, as for `shoot`.
/// max_iterations : int, optional
/// rtol, atol : float, optional
/// first_step, min_step : float, optional
///     First step of s, and the one below which the continuation ends.
/// max_time : float, optional
///     s. A search that reaches it ends with the status ``'limit_reached'`` and what it has.
/// max_evaluations : int, optional
///     Of the field, likewise.
///
/// Returns
/// -------
/// ContinuationResult
///
/// Examples
/// --------
/// From a horizon of 2 s to one of 8 s:
///
/// >>> import numpy as np
/// >>> from somersault import ftla
/// >>> system, t = ftla.linear_regulator(), np.linspace(0.0, 2.0, 5)
/// >>> start = ftla.shoot(system, [1.0], [1.5], t, np.zeros((5, 2)))
/// >>> found = ftla.follow(lambda s: (system, [1.0], [1.5], 2.0 + 6.0 * s), start)
/// >>> found.success, float(found.extremal.times[-1])
/// (True, 8.0)
#[pyfunction(name = "follow")]
#[pyo3(signature = (
    family, start, *, tol=1e-11, max_iterations=100, rtol=1e-13, atol=1e-15, first_step=0.1, min_step=1e-4,
    max_time=None, max_evaluations=None
))]
pub(crate) fn py_follow(
    py: Python<'_>,
    family: &Bound<'_, PyAny>,
    start: &Extremal,
    tol: f64,
    #[pyo3(from_py_with = whole::max_iterations)] max_iterations: usize,
    rtol: f64,
    atol: f64,
    first_step: f64,
    min_step: f64,
    max_time: Option<&Bound<'_, PyAny>>,
    max_evaluations: Option<&Bound<'_, PyAny>>,
) -> Result<ContinuationResult, Error> {
    let limits = limits_of(max_time, max_evaluations)?;
    let continuation = continuation_of([tol, rtol, atol], max_iterations, [first_step, min_step], limits)?;
    check_callable("family", "of s", family)?;
    let callable = family.clone().unbind();
    let given = |s: f64| -> PyResult<GivenMember> {
        Python::attach(|py| {
            let returned = callable.call1(py, (s,)).map_err(|error| caused(py, "family", error))?;
            returned.bind(py).extract().map_err(|_| {
                let what = "`family` must return (system, initial_state, final_state, horizon)";
                PyErr::from(Error::input(what))
            })
        })
    };
    let first = given(0.0)?;
    let found = attend(py, |run| follow(&continuation, run, &first, &given, start))?;
    // the nodes are those of the member that was reached
    let reached = given(found.s)?.0;
    continued(py, found, reached, &continuation.polish)
}
