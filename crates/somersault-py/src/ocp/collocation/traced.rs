//! A problem of optimal control whose functions were traced.

use super::arguments::intervals_of;
use super::result::Subject;
use super::search::SearchOptions;
use super::{CollocationResult, NAMES};
use crate::core::convert::{integer, integer_or_none};
use crate::core::error::Error;
use crate::expr::CompiledFunction;
use pyo3::prelude::*;
use somersault::expr::ExprFunction;
use somersault::ocp::collocation::{Guess, Interval, Phase, Problem};

/// What `ControlProblem` poses, once its functions are traced.
#[pyclass(frozen, module = "somersault.ocp")]
pub(crate) struct TracedProblem {
    /// f, then L with path constraints, then Φ with end constraints.
    functions: [ExprFunction; 3],
    subject: Subject,
    bounds: Bounds,
    scales: Option<(Vec<f64>, Vec<f64>)>,
}

struct Bounds {
    states: Vec<Interval>,
    controls: Vec<Interval>,
    parameters: Vec<Interval>,
    initial: Vec<Interval>,
    last: Vec<Interval>,
    horizon: [Interval; 2],
    path: Vec<Interval>,
    ends: Vec<Interval>,
}

type Pairs = Vec<(f64, f64)>;

/// Where a search starts.
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

impl TracedProblem {
    fn phase(&self, guess: Option<Guess>) -> Result<Phase, Error> {
        let [dynamics, path, ends] = &self.functions;
        let (bounds, subject) = (&self.bounds, &self.subject);
        let [start, end] = bounds.horizon;
        let n = [subject.controls.len(), subject.parameters.len()];
        let mut phase = Phase::try_traced([dynamics, path, ends], n[0], n[1])?
            .names(subject.states.clone(), subject.controls.clone())
            .state_bounds(bounds.states.clone())
            .control_bounds(bounds.controls.clone())
            .parameter_bounds(bounds.parameters.clone())
            .initial_state(bounds.initial.clone())
            .final_state(bounds.last.clone())
            .horizon(start, end)
            .path_bounds(bounds.path.clone())
            .end_bounds(bounds.ends.clone());
        if let Some((states, controls)) = &self.scales {
            phase = phase.scales(states.clone(), controls.clone());
        }
        Ok(match guess {
            Some(guess) => phase.guess(guess),
            None => phase,
        })
    }

    fn problem(&self, guess: Option<Guess>) -> Result<Problem, Error> {
        Problem::try_new(self.phase(guess)?).map_err(|error| Error::from(error).with_names(&NAMES))
    }
}

#[pymethods]
impl TracedProblem {
    /// Functions, names of states, controls and parameters, bounds of these, of both ends, both times, path and end constraints,
    /// and scales of states and controls.
    #[new]
    fn new(
        functions: [Py<CompiledFunction>; 3],
        names: [Vec<String>; 3],
        bounds: [Pairs; 8],
        scales: Option<(Vec<f64>, Vec<f64>)>,
    ) -> Result<Self, Error> {
        let [states, controls, parameters] = names;
        let subject = Subject { model: None, states, controls, parameters };
        let [x, u, p, initial, last, times, path, ends] = bounds.map(intervals_of);
        let horizon = times.try_into().map_err(|found: Vec<_>| {
            Error::input(format!("`times` must have 2 entries, found {}", found.len()))
        })?;
        let bounds = Bounds { states: x, controls: u, parameters: p, initial, last, horizon, path, ends };
        let functions = functions.map(|function| function.get().function.clone());
        let posed = Self { functions, subject, bounds, scales };
        posed.problem(None)?;
        Ok(posed)
    }

    /// As `ControlProblem.solve`, with a guess by times, states, controls and parameters.
    #[pyo3(signature = (
        guess, tol, n_intervals, n_points, max_meshes, max_iterations, max_time, callback, on_interrupt
    ))]
    fn solve(
        &self,
        py: Python<'_>,
        guess: Option<Given<'_>>,
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
        let problem = || self.problem(guess.map(guess_of));
        let subject = self.subject.clone();
        options.run(py, 1, problem, |report| Ok(CollocationResult::of(py, report, subject, tol)?))
    }
}
