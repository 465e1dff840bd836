//! Matching a motion from the start with one from the end.

use super::argument::{limits_of, whole, wholes};
use super::dimension::rows_array;
use super::flow::VariationalFlow;
use super::placement::Placement;
use super::watched::Watched;
use crate::core::convert::{finite_all, positive, real_numbers, with_shape};
use crate::core::error::Error;
use crate::core::value::{Pickled, by_restore, few, value};
use pyo3::prelude::*;
use pyo3::types::PyType;
use somersault::ftla::flow;
use somersault::ftla::matching::{self, GridSearch, LeastSquares, MatchStatus};
use somersault::ftla::nalgebra::DVector;
use somersault::ftla::spectrum::TimeDirection;

/// A motion from the start matched with one from the end on the centre manifold (thesis 10.2).
///
/// Unknown are the costates that the placement holds, at both ends. Each choice is placed, followed to the match time with
/// midcourse corrections, that is placed again at given times, and measured by the mismatch ‖p⁺ − p⁻‖ there.
///
/// Parameters
/// ----------
/// flow : VariationalFlow
/// initial_state, final_state : array_like, shape (n,)
/// horizon : float
///     s.
/// placement : Placement
///     For both ends.
/// initial_costate, final_costate : array_like, shape (n,)
///     Where the search begins; round values will often do.
/// match_time : float, optional
///     s; the middle unless given.
/// corrections : array_like, shape (m,), optional
///     Times of midcourse corrections, s, ascending.
///
/// Examples
/// --------
/// >>> from somersault import ftla
/// >>> flow = ftla.VariationalFlow(ftla.linear_regulator())
/// >>> placement = ftla.Placement((1, 0, 1), [], [2.0, 4.0, 8.0])
/// >>> matching = ftla.Matching(flow, [1.0], [1.0], 12.0, placement, initial_costate=[0.4], final_costate=[-2.4])
/// >>> matching.least_squares().success
/// True
#[pyclass(frozen, module = "somersault.ftla")]
pub(crate) struct Matching {
    flow: Py<VariationalFlow>,
    placement: Py<Placement>,
    states: [Vec<f64>; 2],
    costates: [Vec<f64>; 2],
    horizon: f64,
    match_time: f64,
    corrections: Vec<f64>,
}

/// Times and points of an end and after each correction.
type Course = Vec<(f64, DVector<f64>)>;

/// What Python calls a status.
fn name_of(status: MatchStatus) -> &'static str {
    match status {
        MatchStatus::Matched => "matched",
        MatchStatus::Exhausted => "exhausted",
        MatchStatus::MaxRounds => "max_rounds",
        MatchStatus::NoStart => "no_start",
        MatchStatus::LimitReached => "limit_reached",
    }
}

/// A pickled status.
fn status_named(name: &str) -> Result<&'static str, Error> {
    let all = [
        MatchStatus::Matched,
        MatchStatus::Exhausted,
        MatchStatus::MaxRounds,
        MatchStatus::NoStart,
        MatchStatus::LimitReached,
    ];
    let known = all.map(name_of).into_iter().find(|known| *known == name);
    known.ok_or_else(|| Error::input(format!("`status` is not known: '{name}'")))
}

/// The entries of a vector, to be pickled.
fn numbers(p: &DVector<f64>) -> Vec<f64> {
    p.as_slice().to_vec()
}

/// Finite numbers, so many of them.
pub(super) fn entries(name: &'static str, n: usize, value: &Bound<'_, PyAny>) -> Result<Vec<f64>, Error> {
    finite_all(name, with_shape(name, &[n], value)?)
}

/// What is done with a match.
enum Search {
    Check,
    Grid(GridSearch),
    LeastSquares(LeastSquares),
}

impl Matching {
    /// As the library has it, with the flow of a run.
    fn typed<'a>(
        &self,
        flow: flow::VariationalFlow<'a, Watched>,
    ) -> Result<matching::Matching<'a, Watched>, Error> {
        let (placement, n) = (self.placement.get(), self.dimension());
        let placements =
            [TimeDirection::Forward, TimeDirection::Backward].map(|direction| placement.typed(n, direction));
        let [forward, backward] = placements;
        let [initial, last] = self.states.each_ref().map(Vec::as_slice);
        let [first_guess, last_guess] = self.costates.each_ref().map(Vec::as_slice);
        let matching = matching::Matching::try_new(
            flow,
            [initial, last],
            [first_guess, last_guess],
            self.horizon,
            [forward?, backward?],
        )?;
        Ok(matching.try_with_course(self.match_time, &self.corrections)?)
    }

    fn dimension(&self) -> usize {
        self.flow.get().system.get().dimension
    }

    fn run(self_: &Bound<'_, Self>, search: &Search) -> Result<MatchingResult, Error> {
        let (py, matching) = (self_.py(), self_.get());
        let owner = self_.clone().unbind();
        let mut found = matching.flow.get().attend(py, |flow| search_in(matching, flow, search))?;
        found.matching = Some(owner);
        Ok(found)
    }
}

fn search_in(
    matching: &Matching,
    flow: flow::VariationalFlow<'_, Watched>,
    search: &Search,
) -> Result<MatchingResult, Error> {
    let typed = matching.typed(flow)?;
    let found = match search {
        Search::Check => return Ok(MatchingResult::default()),
        Search::Grid(search) => search.run(&typed)?,
        Search::LeastSquares(search) => search.run(&typed)?,
    };
    Ok(MatchingResult {
        status: name_of(found.status),
        ends: found.ends,
        meeting: found.meeting,
        mismatch: found.mismatch,
        n_rounds: found.rounds,
        n_branches: found.branches,
        n_flow_evaluations: found.flow_evaluations,
        courses: found.courses,
        matching: None,
    })
}

#[pymethods]
impl Matching {
    #[new]
    #[pyo3(signature = (
        flow, initial_state, final_state, horizon, placement, *, initial_costate, final_costate, match_time=None,
        corrections=None
    ))]
    fn new(
        py: Python<'_>,
        flow: Py<VariationalFlow>,
        initial_state: &Bound<'_, PyAny>,
        final_state: &Bound<'_, PyAny>,
        horizon: f64,
        placement: Py<Placement>,
        initial_costate: &Bound<'_, PyAny>,
        final_costate: &Bound<'_, PyAny>,
        match_time: Option<f64>,
        corrections: Option<&Bound<'_, PyAny>>,
    ) -> Result<Self, Error> {
        let n = flow.get().system.get().n_states()?;
        let matching = Self {
            states: [entries("initial_state", n, initial_state)?, entries("final_state", n, final_state)?],
            costates: [
                entries("initial_costate", n, initial_costate)?,
                entries("final_costate", n, final_costate)?,
            ],
            flow,
            placement,
            horizon,
            match_time: match match_time {
                Some(given) => given,
                None => 0.5 * positive("horizon", horizon)?,
            },
            corrections: corrections.map_or(Ok(Vec::new()), |times| real_numbers("corrections", times))?,
        };
        matching.flow.get().attend(py, |flow| search_in(&matching, flow, &Search::Check))?;
        Ok(matching)
    }

    /// The grid search of appendix G: three values of each unknown at each end, all pairs compared, in parallel.
    ///
    /// Parameters
    /// ----------
    /// spacing : array_like, shape (2, k)
    ///     Of the grids at the start and at the end, for each costate held.
    /// tol : float, optional
    ///     Mismatch at which to stop, in the units of p.
    /// finest : float, optional
    ///     Stops when every spacing is below this fraction of the first.
    /// max_rounds : int, optional
    /// max_time : float, optional
    ///     s. A search that reaches it ends with the status ``'limit_reached'`` and the best pair.
    /// max_evaluations : int, optional
    ///     Of the field, likewise.
    ///
    /// Returns
    /// -------
    /// MatchingResult
    ///
    /// Examples
    /// --------
    /// >>> import numpy as np
    /// >>> from somersault import ftla
    /// >>> flow = ftla.VariationalFlow(ftla.linear_regulator())
    /// >>> placement = ftla.Placement((1, 0, 1), [], [2.0, 4.0, 8.0])
    /// >>> matching = ftla.Matching(flow, [1.0], [1.0], 12.0, placement, initial_costate=[0.4], final_costate=[-2.4])
    /// >>> found = matching.grid_search(np.zeros((2, 0)))
    /// >>> found.success, found.mismatch < 2e-3
    /// (True, True)
    #[pyo3(signature = (
        spacing, *, tol=2e-3, finest=1e-4, max_rounds=100, max_time=None, max_evaluations=None
    ))]
    fn grid_search(
        self_: &Bound<'_, Self>,
        spacing: &Bound<'_, PyAny>,
        tol: f64,
        finest: f64,
        #[pyo3(from_py_with = whole::max_rounds)] max_rounds: usize,
        max_time: Option<&Bound<'_, PyAny>>,
        max_evaluations: Option<&Bound<'_, PyAny>>,
    ) -> Result<MatchingResult, Error> {
        let limits = limits_of(max_time, max_evaluations)?;
        let count = self_.get().placement.get().held_count();
        let numbers = with_shape("spacing", &[2, count], spacing)?;
        let (first, last) = numbers.split_at(count);
        let spacing = [first.to_vec(), last.to_vec()];
        let search = GridSearch {
            spacing,
            tolerance: positive("tol", tol)?,
            finest: positive("finest", finest)?,
            max_rounds,
            limits,
        };
        Self::run(self_, &Search::Grid(search))
    }

    /// Gauss–Newton on p⁺ − p⁻ and H⁺ − H⁻.
    ///
    /// Parameters
    /// ----------
    /// conserved : sequence of int, optional
    ///     Numbers, from 0, of held costates that are constant along motions: one unknown for both ends. λ₁ of the arm is.
    /// tol : float, optional
    ///     Mismatch at which to stop, in the units of p.
    /// max_rounds : int, optional
    /// max_time : float, optional
    ///     s. A search that reaches it ends with the status ``'limit_reached'`` and the best pair.
    /// max_evaluations : int, optional
    ///     Of the field, likewise.
    ///
    /// Returns
    /// -------
    /// MatchingResult
    ///
    /// Examples
    /// --------
    /// >>> from somersault import ftla
    /// >>> flow = ftla.VariationalFlow(ftla.linear_regulator())
    /// >>> placement = ftla.Placement((1, 0, 1), [], [2.0, 4.0, 8.0])
    /// >>> matching = ftla.Matching(flow, [1.0], [1.0], 12.0, placement, initial_costate=[0.4], final_costate=[-2.4])
    /// >>> found = matching.least_squares()
    /// >>> found.success, found.mismatch < 2e-3
    /// (True, True)
    #[pyo3(signature = (conserved=vec![], *, tol=2e-3, max_rounds=30, max_time=None, max_evaluations=None))]
    fn least_squares(
        self_: &Bound<'_, Self>,
        #[pyo3(from_py_with = wholes::conserved)] conserved: Vec<usize>,
        tol: f64,
        #[pyo3(from_py_with = whole::max_rounds)] max_rounds: usize,
        max_time: Option<&Bound<'_, PyAny>>,
        max_evaluations: Option<&Bound<'_, PyAny>>,
    ) -> Result<MatchingResult, Error> {
        let limits = limits_of(max_time, max_evaluations)?;
        let search = LeastSquares { conserved, tolerance: positive("tol", tol)?, max_rounds, limits };
        Self::run(self_, &Search::LeastSquares(search))
    }

    fn __repr__(&self) -> String {
        let Self { horizon, match_time, corrections, .. } = self;
        format!("<Matching: {horizon} s, at {match_time} s, corrections at [{}] s>", few(corrections))
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> Pickled<'py> {
        let (py, own) = (slf.py(), slf.get());
        let times = (own.horizon, own.match_time, own.corrections.clone());
        let arguments =
            (own.flow.bind(py), own.placement.bind(py), own.states.clone(), own.costates.clone(), times);
        by_restore(slf, arguments)
    }

    /// A pickled problem.
    #[classmethod]
    fn _restore(
        _: &Bound<'_, PyType>,
        flow: Py<VariationalFlow>,
        placement: Py<Placement>,
        states: [Vec<f64>; 2],
        costates: [Vec<f64>; 2],
        times: (f64, f64, Vec<f64>),
    ) -> Self {
        let (horizon, match_time, corrections) = times;
        Self { flow, placement, states, costates, horizon, match_time, corrections }
    }
}

/// A pair of ends whose motions nearly meet: the best that was found.
#[pyclass(frozen, module = "somersault.ftla")]
pub(crate) struct MatchingResult {
    /// str: ``'matched'``, ``'exhausted'`` where spacing or steps have become too small, ``'max_rounds'``,
    /// ``'limit_reached'``, or ``'no_start'`` where nothing to begin with could be placed and followed.
    #[pyo3(get)]
    status: &'static str,
    ends: [DVector<f64>; 2],
    meeting: [DVector<f64>; 2],
    /// float: ‖p⁺ − p⁻‖ at the match time.
    #[pyo3(get)]
    mismatch: f64,
    /// int: Rounds of the search.
    #[pyo3(get)]
    n_rounds: usize,
    /// int: Ends placed and followed.
    #[pyo3(get)]
    n_branches: usize,
    /// int: Spectra and segments computed for them.
    #[pyo3(get)]
    n_flow_evaluations: usize,
    courses: [Course; 2],
    matching: Option<Py<Matching>>,
}

impl Default for MatchingResult {
    fn default() -> Self {
        Self {
            status: "no_start",
            ends: [DVector::zeros(0), DVector::zeros(0)],
            meeting: [DVector::zeros(0), DVector::zeros(0)],
            mismatch: f64::INFINITY,
            n_rounds: 0,
            n_branches: 0,
            n_flow_evaluations: 0,
            courses: Default::default(),
            matching: None,
        }
    }
}

value! {
    impl MatchingResult {
        /// bool: Whether the mismatch is below the tolerance.
        success: bool = |own| own.status == "matched";
        /// ndarray, shape (2, dimension): PlacementResult points at the start and at the end.
        ends: PyResult<Bound<'py, PyAny>> = |own, py| rows_array(py, &own.ends, own.ends[0].len());
        /// ndarray, shape (2, dimension): p⁺ and p⁻ at the match time.
        meeting: PyResult<Bound<'py, PyAny>> = |own, py| rows_array(py, &own.meeting, own.meeting[0].len());
    }
}

#[pymethods]
impl MatchingResult {
    /// The matched motion at given times: a guess for `shoot`.
    ///
    /// Parameters
    /// ----------
    /// times : array_like, shape (m,)
    ///     s, from 0 to the horizon.
    ///
    /// Returns
    /// -------
    /// ndarray, shape (m, dimension)
    ///
    /// Examples
    /// --------
    /// >>> from somersault import ftla
    /// >>> flow = ftla.VariationalFlow(ftla.linear_regulator())
    /// >>> placement = ftla.Placement((1, 0, 1), [], [2.0, 4.0, 8.0])
    /// >>> matching = ftla.Matching(flow, [1.0], [1.0], 12.0, placement, initial_costate=[0.4], final_costate=[-2.4])
    /// >>> times = ftla.graded_times(12.0, 0.2, 2.0)
    /// >>> guess = matching.least_squares().nodes(times)
    /// >>> ftla.shoot(flow.system, [1.0], [1.0], times, guess).status
    /// 'converged'
    fn nodes<'py>(&self, py: Python<'py>, times: &Bound<'py, PyAny>) -> Result<Bound<'py, PyAny>, Error> {
        let times = real_numbers("times", times)?;
        let Some(matching) = self.matching.as_ref().filter(|_| self.status != "no_start") else {
            return Err(Error::input("this match has no motion"));
        };
        let matching = matching.get();
        if let Some(t) = times.iter().find(|t| !(0.0..=matching.horizon).contains(*t)) {
            return Err(Error::input(format!("`times` must be from 0 to the horizon, found {t}")));
        }
        let n = matching.dimension();
        let nodes = matching
            .flow
            .get()
            .attend(py, |flow| Ok(matching.typed(flow)?.nodes(&self.courses, &times)?))?;
        Ok(rows_array(py, &nodes, n)?)
    }

    fn __repr__(&self) -> String {
        let Self { status, mismatch, n_rounds, n_branches, .. } = self;
        format!(
            "<MatchingResult: {status}, mismatch {mismatch:.2e} after {n_rounds} rounds, {n_branches} branches>"
        )
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> Pickled<'py> {
        let (py, own) = (slf.py(), slf.get());
        let counts = (own.n_rounds, own.n_branches, own.n_flow_evaluations);
        let matching = own.matching.as_ref().map(|matching| matching.bind(py));
        let arguments = (
            own.status,
            own.ends.each_ref().map(numbers),
            own.meeting.each_ref().map(numbers),
            own.mismatch,
            counts,
            own.courses
                .each_ref()
                .map(|course| course.iter().map(|(t, p)| (*t, numbers(p))).collect::<Vec<_>>()),
            matching,
        );
        by_restore(slf, arguments)
    }

    /// A pickled match.
    #[classmethod]
    fn _restore(
        _: &Bound<'_, PyType>,
        status: &str,
        ends: [Vec<f64>; 2],
        meeting: [Vec<f64>; 2],
        mismatch: f64,
        counts: (usize, usize, usize),
        courses: [Vec<(f64, Vec<f64>)>; 2],
        matching: Option<Py<Matching>>,
    ) -> Result<Self, Error> {
        let status = status_named(status)?;
        let (n_rounds, n_branches, n_flow_evaluations) = counts;
        Ok(Self {
            status,
            ends: ends.map(DVector::from_vec),
            meeting: meeting.map(DVector::from_vec),
            mismatch,
            n_rounds,
            n_branches,
            n_flow_evaluations,
            courses: courses.map(|c| c.into_iter().map(|(t, p)| (t, DVector::from_vec(p))).collect()),
            matching,
        })
    }
}
