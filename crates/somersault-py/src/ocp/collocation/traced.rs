//! A problem of optimal control whose functions were traced, of one phase or several.

use super::phase::{TracedPhase, named};
use super::result::Subject;
use super::search::SearchOptions;
use super::{CollocationOutcome, CollocationResult, MultiphaseResult, SolutionSensitivity};
use crate::core::convert::{integer, integer_or_none};
use crate::core::error::Error;
use crate::core::waiting::leave_on_signal;
use pyo3::prelude::*;
use somersault::ocp::collocation::{End, Guess, Interval, Linkage, PhaseSolution, Place, Problem, Quantity};

/// What `ControlProblem` and `MultiphaseProblem` pose, once functions are traced.
#[pyclass(frozen, module = "somersault.ocp")]
pub(crate) struct TracedProblem {
    phases: Vec<Py<TracedPhase>>,
    horizons: Vec<[Interval; 2]>,
    /// None for a problem of one phase, whose result is that of the phase.
    linkages: Option<Vec<Linkage>>,
}

/// Where a search starts.
#[derive(FromPyObject)]
enum Origin<'py> {
    Solution(Bound<'py, CollocationOutcome>),
    Guesses(Vec<Given<'py>>),
}

/// Where a search starts, in one phase.
#[derive(FromPyObject)]
enum Given<'py> {
    Result(Bound<'py, CollocationResult>),
    /// Times, states, controls and parameters.
    Rows(Vec<f64>, Vec<Vec<f64>>, Vec<Vec<f64>>, Vec<f64>),
}

fn guess_of(given: Given<'_>) -> Guess {
    match given {
        Given::Result(result) => result.get().phase().to_guess(),
        Given::Rows(times, states, controls, parameters) => Guess { times, states, controls, parameters },
    }
}

/// From the end of one phase to the start of another, or from the start of one to its end: 'state' and two entries, 'parameter' and
/// two entries, 'time', 'duration'; and what the difference may be.
type Link = (usize, usize, String, usize, usize, (f64, f64));

fn linkage((left, right, what, i, j, (lower, upper)): Link) -> Result<Linkage, Error> {
    let (first, second) = match what.as_str() {
        "state" => (Quantity::State(i), Quantity::State(j)),
        "parameter" => (Quantity::Parameter(i), Quantity::Parameter(j)),
        "time" | "duration" => (Quantity::Time, Quantity::Time),
        other => {
            return Err(Error::input(format!(
                "`links` must be of a state, parameter, time or duration, found '{other}'"
            )));
        }
    };
    let (from, to) = if what == "duration" { (End::Start, End::Finish) } else { (End::Finish, End::Start) };
    Ok(Linkage {
        left: Place { phase: left, end: from, quantity: first },
        right: Place { phase: right, end: to, quantity: second },
        difference: Interval::new(lower, upper),
    })
}

impl TracedProblem {
    fn problem(&self, guesses: Vec<Guess>) -> Result<Problem, Error> {
        let mut guesses = guesses.into_iter();
        let each = self.phases.iter().zip(&self.horizons);
        let phases = each
            .map(|(phase, horizon)| phase.get().phase(*horizon, guesses.next()))
            .collect::<Result<_, _>>()?;
        Problem::try_of_phases(phases, self.linkages.clone().unwrap_or_default())
            .map_err(|error| named(error.into()))
    }

    fn subjects(&self) -> Vec<Subject> {
        self.phases.iter().map(|phase| phase.get().subject.clone()).collect()
    }
}

#[pymethods]
impl TracedProblem {
    /// Phases with first and last times that each may begin and end at, and links between them; none for a problem of one phase.
    #[new]
    fn new(
        phases: Vec<Py<TracedPhase>>,
        horizons: Vec<[(f64, f64); 2]>,
        links: Option<Vec<Link>>,
    ) -> Result<Self, Error> {
        let n = if links.is_none() { 1 } else { phases.len() };
        if phases.len() != n || horizons.len() != n {
            let found = phases.len().max(horizons.len());
            return Err(Error::input(format!("`horizons` must have {n} entries, found {found}")));
        }
        let horizons = horizons
            .into_iter()
            .map(|horizon| horizon.map(|(lower, upper)| Interval::new(lower, upper)))
            .collect();
        let linkages =
            links.map(|links| links.into_iter().map(linkage).collect::<Result<_, _>>()).transpose()?;
        let posed = Self { phases, horizons, linkages };
        posed.problem(Vec::new())?;
        Ok(posed)
    }

    /// As `ControlProblem.solve` and `MultiphaseProblem.solve`, from a result, or from guesses by times, states, controls and
    /// parameters.
    #[pyo3(signature = (
        start, tol, n_intervals, n_points, max_meshes, max_iterations, max_time, callback, on_interrupt
    ))]
    fn solve(
        &self,
        py: Python<'_>,
        start: Origin<'_>,
        tol: f64,
        #[pyo3(from_py_with = integer_or_none)] n_intervals: Option<i64>,
        #[pyo3(from_py_with = integer_or_none)] n_points: Option<i64>,
        #[pyo3(from_py_with = integer)] max_meshes: i64,
        #[pyo3(from_py_with = integer_or_none)] max_iterations: Option<i64>,
        max_time: Option<f64>,
        callback: Option<&Bound<'_, PyAny>>,
        on_interrupt: &str,
    ) -> Result<Py<CollocationOutcome>, Error> {
        let sizes = [n_intervals, n_points];
        let (guesses, solution) = match start {
            Origin::Guesses(guesses) => (guesses.into_iter().map(guess_of).collect(), None),
            Origin::Solution(solution) => {
                let report = &solution.get().report;
                (report.phases.iter().map(PhaseSolution::to_guess).collect(), Some(report.clone()))
            }
        };
        let options = SearchOptions {
            tol,
            sizes,
            solution,
            max_meshes,
            max_iterations,
            max_time,
            callback,
            on_interrupt,
        };
        let problem = || self.problem(guesses);
        let subjects = self.subjects();
        let found = |report| match (&self.linkages, subjects.as_slice()) {
            (None, [subject]) => {
                let found = CollocationResult::of(py, report, subject.clone(), tol)?;
                Ok(found.into_bound(py).into_super().unbind())
            }
            _ => {
                let found = MultiphaseResult::of(py, &subjects, report, tol)?;
                Ok(found.into_bound(py).into_super().unbind())
            }
        };
        options.run(py, subjects.len(), problem, found)
    }

    /// As `ControlProblem.sensitivity`.
    fn sensitivity(
        &self,
        py: Python<'_>,
        solution: &Bound<'_, CollocationResult>,
    ) -> Result<SolutionSensitivity, Error> {
        let (report, subject) = (solution.get().report.clone(), self.phases[0].get().subject.clone());
        let mut problem = self.problem(vec![solution.get().phase().to_guess()])?;
        leave_on_signal(py, move |_| SolutionSensitivity::of(&report, &mut problem, subject))
    }
}
