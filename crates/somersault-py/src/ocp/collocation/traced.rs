//! A problem of optimal control whose functions were traced, of one phase or several.

use super::many::{Fault, Job, solve_many};
use super::phase::{TracedPhase, named};
use super::result::Subject;
use super::search::{SearchOptions, Settings};
use super::{CollocationOutcome, CollocationResult, MultiphaseResult, PolishResult, SolutionSensitivity};
use crate::core::convert::{integer, integer_or_none};
use crate::core::error::Error;
use crate::core::waiting::{Cancellation, attend, deliver, leave_on_signal, returns_interrupted};
use crate::ocp::arguments::{count, limit, seed_of};
use crate::ocp::search::SearchResult;
use crate::ocp::solver::deadline;
use pyo3::prelude::*;
use somersault::core::cancel::CancellationToken;
use somersault::ocp::arcs::{Polish, Polished};
use somersault::ocp::collocation::{
    CollocationReport, End, Guess, Interval, Linkage, PhaseSolution, Place, Problem, Quantity, distinct,
    ranked,
};
use somersault::ocp::solver::{SolutionMethod, SolverResult};
use std::sync::Arc;

/// What `ControlProblem` and `MultiphaseProblem` pose, once functions are traced.
#[pyclass(frozen, module = "somersault.ocp")]
pub(crate) struct TracedProblem {
    phases: Vec<Py<TracedPhase>>,
    horizons: Vec<[Interval; 2]>,
    /// None for a problem of one phase, whose result is that of the phase.
    linkages: Option<Vec<Linkage>>,
}

/// What the argument `method` says.
fn method_of(method: &str) -> Result<SolutionMethod, Error> {
    match method {
        "auto" => Ok(SolutionMethod::Auto),
        "shooting" => Ok(SolutionMethod::Shooting),
        "collocation" => Ok(SolutionMethod::Collocation),
        "indirect" => Ok(SolutionMethod::Indirect),
        other => Err(Error::input(format!(
            "`method` must be 'auto', 'shooting', 'collocation' or 'indirect', found '{other}'"
        ))),
    }
}

/// Starts of a search, at most.
const MOST_STARTS: usize = 10_000;

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

impl Origin<'_> {
    /// Guesses of the phases, and a solution that they are of.
    fn read(self) -> (Vec<Guess>, Option<Arc<CollocationReport>>) {
        match self {
            Self::Guesses(guesses) => (guesses.into_iter().map(guess_of).collect(), None),
            Self::Solution(solution) => {
                let report = &solution.get().report;
                (report.phases.iter().map(PhaseSolution::to_guess).collect(), Some(report.clone()))
            }
        }
    }
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
    /// The problem from guesses. Functions that are not traced look at the token.
    pub(crate) fn problem(
        &self,
        guesses: Vec<Guess>,
        token: &Arc<CancellationToken>,
    ) -> Result<Problem, Error> {
        let mut guesses = guesses.into_iter();
        let each = self.phases.iter().zip(&self.horizons);
        let phases = each
            .map(|(phase, horizon)| phase.get().phase(*horizon, guesses.next(), token))
            .collect::<Result<_, _>>()?;
        Problem::try_of_phases(phases, self.linkages.clone().unwrap_or_default())
            .map_err(|error| named(error.into()))
    }

    /// Refuses a method that does not take the problem.
    fn expect_taken_by(&self, method: SolutionMethod) -> Result<(), Error> {
        let name = match method {
            SolutionMethod::Shooting => "shooting",
            SolutionMethod::Indirect => "indirect",
            _ => return Ok(()),
        };
        if self.linkages.is_some() {
            return Err(Error::input(format!(
                "`method` must be 'auto' or 'collocation' for a problem of several phases, found '{name}'"
            )));
        }
        if method == SolutionMethod::Indirect { self.expect_arcs("method='indirect'") } else { Ok(()) }
    }

    /// Refuses what arcs cannot be found of: functions that are not traced.
    fn expect_arcs(&self, what: &str) -> Result<(), Error> {
        for phase in &self.phases {
            if let Some(name) = phase.get().untraced().next() {
                return Err(Error::input(format!(
                    "`dynamics`, costs and constraints must be traced for `{what}`, found the ExternalFunction `{name}`"
                )));
            }
        }
        Ok(())
    }

    /// What was polished as Python sees it.
    fn polished(&self, py: Python<'_>, found: SolverResult, tol: f64) -> Result<Py<PolishResult>, Error> {
        let subject = self.phases[0].get().subject.clone();
        let SolverResult { report, polished } = found;
        let polished =
            polished.unwrap_or_else(|| Polished::refused(&report, "the search was stopped before"));
        let found = CollocationResult::of(py, report, subject.clone(), tol)?;
        Ok(Py::new(py, PolishResult { polished, found, subject })?)
    }

    /// What a method found as Python sees it.
    fn found(
        &self,
        py: Python<'_>,
        found: SolverResult,
        method: SolutionMethod,
        tol: f64,
    ) -> Result<Py<PyAny>, Error> {
        Ok(match method {
            SolutionMethod::Indirect => self.polished(py, found, tol)?.into_any(),
            _ => self.result(py, found.report, tol)?.into_any(),
        })
    }

    /// A report as what Python sees of it: of one phase, or of several.
    fn result(
        &self,
        py: Python<'_>,
        report: CollocationReport,
        tol: f64,
    ) -> Result<Py<CollocationOutcome>, Error> {
        let subjects: Vec<Subject> = self.phases.iter().map(|phase| phase.get().subject.clone()).collect();
        match (&self.linkages, subjects.as_slice()) {
            (None, [subject]) => {
                let found = CollocationResult::of(py, report, subject.clone(), tol)?;
                Ok(found.into_bound(py).into_super().unbind())
            }
            _ => {
                let found = MultiphaseResult::of(py, &subjects, report, tol)?;
                Ok(found.into_bound(py).into_super().unbind())
            }
        }
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
        posed.problem(Vec::new(), &Arc::default())?;
        Ok(posed)
    }

    /// As `ControlProblem.solve` and `MultiphaseProblem.solve`, from a result, or from guesses by times, states, controls and
    /// parameters.
    #[pyo3(signature = (
        start, tol, n_intervals, n_points, max_meshes, max_iterations, max_evaluations, max_time, callback, on_interrupt,
        method = "auto"
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
        #[pyo3(from_py_with = integer_or_none)] max_evaluations: Option<i64>,
        max_time: Option<f64>,
        callback: Option<&Bound<'_, PyAny>>,
        on_interrupt: &str,
        method: &str,
    ) -> Result<Py<PyAny>, Error> {
        let method = method_of(method)?;
        self.expect_taken_by(method)?;
        let (guesses, solution) = start.read();
        let sizes = [n_intervals, n_points];
        let settings = Settings { tol, sizes, max_meshes, max_iterations, max_evaluations, method };
        let options = SearchOptions { settings, solution, max_time, callback, on_interrupt };
        let problem = |token: &Arc<CancellationToken>| self.problem(guesses, token);
        options.run(py, self.phases.len(), problem, |found| self.found(py, found, method, tol))
    }

    /// As `ControlProblem.search` and `MultiphaseProblem.search`.
    #[pyo3(signature = (
        n_starts, seed, tol, n_intervals, n_points, max_meshes, max_iterations, max_evaluations, max_time, on_interrupt, method
    ))]
    fn search(
        &self,
        py: Python<'_>,
        #[pyo3(from_py_with = integer)] n_starts: i64,
        #[pyo3(from_py_with = integer)] seed: i64,
        tol: f64,
        #[pyo3(from_py_with = integer_or_none)] n_intervals: Option<i64>,
        #[pyo3(from_py_with = integer_or_none)] n_points: Option<i64>,
        #[pyo3(from_py_with = integer)] max_meshes: i64,
        #[pyo3(from_py_with = integer_or_none)] max_iterations: Option<i64>,
        #[pyo3(from_py_with = integer_or_none)] max_evaluations: Option<i64>,
        max_time: Option<f64>,
        on_interrupt: &str,
        method: &str,
    ) -> Result<SearchResult, Error> {
        let returned = returns_interrupted(on_interrupt)?;
        let method = method_of(method)?;
        self.expect_taken_by(method)?;
        let sizes = [n_intervals, n_points];
        let settings = Settings { tol, sizes, max_meshes, max_iterations, max_evaluations, method };
        let (n, seed) = (count("n_starts", n_starts, 1)?, seed_of(seed)?);
        if n > MOST_STARTS {
            return Err(Error::input(format!("`n_starts` must be at most {MOST_STARTS}, found {n}")));
        }
        let guesses = self.problem(Vec::new(), &Arc::default())?.random_guesses(n, seed);
        let job = |k: usize, token: &Arc<CancellationToken>| -> Result<Job, Error> {
            Ok((self.problem(guesses[k].clone(), token)?, None))
        };
        let many = solve_many(py, &settings, max_time, n, job)?;
        let has_ended = many.raised.is_none() && !many.is_late;
        let mut raised: Option<PyErr> = many.raised;
        let (mut solved, mut others, mut failures) = (Vec::new(), Vec::new(), Vec::new());
        for (start, outcome) in many.outcomes.into_iter().enumerate() {
            match outcome {
                Some(Ok(found)) if found.is_solution() => solved.push((start, found)),
                Some(Ok(found)) => others.push((start, found)),
                Some(Err(Fault { error, report: Some(report) })) => {
                    // a fault in a function of the user is one for all starts
                    raised.get_or_insert(error.into());
                    others.push((start, SolverResult { report: *report, polished: None }));
                }
                // so is what splines cannot take
                Some(Err(Fault { error, report: None })) if method == SolutionMethod::Shooting => {
                    return Err(error);
                }
                Some(Err(Fault { error, report: None })) => {
                    failures.push((start, PyErr::from(error).value(py).to_string()));
                }
                None => failures.push((start, "not begun".to_owned())),
            }
        }
        let status = match (has_ended, many.is_late, solved.is_empty()) {
            (true, _, false) => "converged",
            (true, _, true) => "no_minimum",
            (false, true, _) => "time_limit",
            (false, false, _) => "interrupted",
        };
        let (mut minima, mut starts, mut unfinished) = (Vec::new(), Vec::new(), Vec::new());
        for (found, from) in distinct(solved) {
            minima.push(self.found(py, found, method, tol)?);
            starts.push(from);
        }
        for (start, found) in ranked(others) {
            let result = self.found(py, found, method, tol)?;
            failures.push((start, result.getattr(py, "message")?.extract(py)?));
            unfinished.push(result);
        }
        failures.sort_by_key(|(start, _)| *start);
        let found = SearchResult::new(minima, starts, unfinished, failures, status.to_owned());
        deliver(py, raised, returned, found)
    }

    /// As `solve_batch`.
    #[staticmethod]
    #[pyo3(signature = (
        problems, starts, tol, n_intervals, n_points, max_meshes, max_iterations, max_evaluations, max_time, on_interrupt, method
    ))]
    fn solve_all(
        py: Python<'_>,
        problems: Vec<Py<Self>>,
        starts: Vec<Origin<'_>>,
        tol: f64,
        #[pyo3(from_py_with = integer_or_none)] n_intervals: Option<i64>,
        #[pyo3(from_py_with = integer_or_none)] n_points: Option<i64>,
        #[pyo3(from_py_with = integer)] max_meshes: i64,
        #[pyo3(from_py_with = integer_or_none)] max_iterations: Option<i64>,
        #[pyo3(from_py_with = integer_or_none)] max_evaluations: Option<i64>,
        max_time: Option<f64>,
        on_interrupt: &str,
        method: &str,
    ) -> Result<Vec<Option<Py<PyAny>>>, Error> {
        let returned = returns_interrupted(on_interrupt)?;
        let method = method_of(method)?;
        for (k, problem) in problems.iter().enumerate() {
            let taken = problem.get().expect_taken_by(method);
            taken.map_err(|error| error.within(&format!("problems[{k}]")))?;
        }
        let sizes = [n_intervals, n_points];
        let settings = Settings { tol, sizes, max_meshes, max_iterations, max_evaluations, method };
        let starts: Vec<_> = starts.into_iter().map(Origin::read).collect();
        if starts.len() != problems.len() {
            let (n, found) = (problems.len(), starts.len());
            return Err(Error::input(format!("`guesses` must have {n} entries, found {found}")));
        }
        let job = |k: usize, token: &Arc<CancellationToken>| -> Result<Job, Error> {
            let (guesses, solution) = &starts[k];
            Ok((problems[k].get().problem(guesses.clone(), token)?, solution.clone()))
        };
        let many = solve_many(py, &settings, max_time, problems.len(), job)?;
        let mut raised: Option<PyErr> = many.raised;
        let mut found = Vec::with_capacity(problems.len());
        for (k, (problem, outcome)) in problems.iter().zip(many.outcomes).enumerate() {
            let one = match outcome {
                Some(Ok(one)) => Some(one),
                Some(Err(Fault { error, report: Some(report) })) => {
                    raised.get_or_insert(error.into());
                    Some(SolverResult { report: *report, polished: None })
                }
                Some(Err(Fault { error, report: None })) => {
                    return Err(error.within(&format!("problems[{k}]")));
                }
                None => None,
            };
            found.push(one.map(|one| problem.get().found(py, one, method, tol)).transpose()?);
        }
        deliver(py, raised, returned, found)
    }

    /// As `ControlProblem.polish`.
    #[pyo3(signature = (found, max_evaluations, max_time))]
    fn polish(
        &self,
        py: Python<'_>,
        found: &Bound<'_, CollocationResult>,
        #[pyo3(from_py_with = integer_or_none)] max_evaluations: Option<i64>,
        max_time: Option<f64>,
    ) -> Result<PolishResult, Error> {
        let (report, phase) = (&found.get().report, self.phases[0].get());
        let subject = phase.subject.clone();
        self.expect_arcs("polish")?;
        let cancellation = Cancellation::at(deadline(max_time)?);
        let guess = found.get().phase().to_guess();
        let mut polish = Polish::default();
        polish.max_evaluations = limit("max_evaluations", max_evaluations, 1)?;
        let polish = || -> Result<Polished, Error> {
            let mut problem = self.problem(vec![guess], &cancellation.token)?;
            Ok(polish.polish_cancellable(&mut problem, report, &cancellation.token)?)
        };
        let polished = attend(py, |raised| cancellation.raise(raised), polish)??;
        if let Some(raised) = cancellation.raised() {
            return Err(raised.clone_ref(py).into());
        }
        Ok(PolishResult { polished, found: found.clone().unbind(), subject })
    }

    /// As `ControlProblem.sensitivity`.
    fn sensitivity(
        &self,
        py: Python<'_>,
        solution: &Bound<'_, CollocationResult>,
    ) -> Result<SolutionSensitivity, Error> {
        let (report, subject) = (solution.get().report.clone(), self.phases[0].get().subject.clone());
        let mut problem = self.problem(vec![solution.get().phase().to_guess()], &Arc::default())?;
        leave_on_signal(py, move |_| SolutionSensitivity::of(&report, &mut problem, subject))
    }
}
