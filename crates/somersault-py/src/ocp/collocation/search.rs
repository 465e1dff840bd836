//! The search, as Python asks for it and watches it.

use super::NAMES;
use crate::core::error::Error;
use crate::core::waiting::{attend_or_leave_by, deliver, returns_interrupted, with_solution};
use crate::ocp::arguments::{count, limit, tolerance};
use crate::ocp::solver::{Watcher, deadline};
use pyo3::prelude::*;
use somersault::core::cancel::CancellationToken;
use somersault::nlp::{Flow, Iteration, Sqp, Status};
use somersault::ocp::collocation::{
    Collocation, CollocationError, CollocationReport, CollocationStatus, Mesh, Problem, RelativeErrors,
    SearchError,
};
use somersault::ocp::solver::{SolutionMethod, Solver, SolverResult, Splines, StartFrom};
use std::sync::Arc;
use std::time::Duration;

/// Collocation points of a first mesh, at most.
const MOST_POINTS: usize = 100_000;

/// Intervals of a first mesh, and points of each.
const DEFAULT_SIZES: (i64, i64) = (20, 3);

/// How long Ctrl-C waits for the iteration under way and its result, on fine meshes without success.
const PATIENCE: Duration = Duration::from_millis(400);

/// Tolerance, meshes and limits, as Python gives them.
pub(super) struct Settings {
    pub(super) tol: f64,
    /// Intervals of the first mesh of each phase, and points of each. Those of a solution to start from unless given.
    pub(super) sizes: [Option<i64>; 2],
    pub(super) max_meshes: i64,
    pub(super) max_iterations: Option<i64>,
    pub(super) max_evaluations: Option<i64>,
    pub(super) method: SolutionMethod,
}

impl Settings {
    /// Whether a search that starts from a solution takes its mesh.
    pub(super) fn keeps_mesh(&self) -> bool {
        self.sizes == [None, None]
    }

    /// What solves a problem whose functions have these errors.
    pub(super) fn solver(&self, errors: RelativeErrors) -> Result<Solver, Error> {
        let named = |error: CollocationError| Error::from(error).with_names(&NAMES);
        let collocation = self.collocation()?.try_with_errors(errors).map_err(named)?;
        Ok(Solver { method: self.method, splines: splines(&collocation), collocation })
    }

    /// The first mesh of each phase, if it is not that of a solution or one that the search chooses.
    pub(super) fn mesh(&self) -> Result<Mesh, Error> {
        let [n_intervals, n_points] = self.sizes;
        let (n_intervals, n_points) = (
            count("n_intervals", n_intervals.unwrap_or(DEFAULT_SIZES.0), 1)?,
            count("n_points", n_points.unwrap_or(DEFAULT_SIZES.1), 1)?,
        );
        if n_intervals.saturating_mul(n_points) > MOST_POINTS || n_points > 500 {
            return Err(Error::input(format!(
                "`n_intervals` × `n_points` must be at most {MOST_POINTS} and `n_points` at most 500, found {n_intervals} × {n_points}"
            )));
        }
        Ok(Mesh::try_uniform(n_intervals, n_points)?)
    }

    fn collocation(&self) -> Result<Collocation, Error> {
        let default = Collocation::default();
        tolerance("tol", Some(self.tol))?;
        let most = limit("max_iterations", self.max_iterations, 0)?;
        Ok(Collocation {
            tolerance: self.tol,
            max_meshes: count("max_meshes", self.max_meshes, 1)?,
            max_evaluations: limit("max_evaluations", self.max_evaluations, 1)?,
            solver: Sqp { max_iterations: most.unwrap_or(default.solver.max_iterations), ..default.solver },
            ..default
        })
    }
}

/// How one search is to go.
pub(super) struct SearchOptions<'a, 'py> {
    pub(super) settings: Settings,
    /// Where the search starts, if it is no guess.
    pub(super) solution: Option<Arc<CollocationReport>>,
    pub(super) max_time: Option<f64>,
    pub(super) callback: Option<&'a Bound<'py, PyAny>>,
    pub(super) on_interrupt: &'a str,
}

impl SearchOptions<'_, '_> {
    /// Searches without the interpreter, and looks for callback and Ctrl-C meanwhile.
    pub(super) fn run(
        self,
        py: Python<'_>,
        n_phases: usize,
        problem: impl FnOnce(&Arc<CancellationToken>) -> Result<Problem, Error>,
        result: impl FnOnce(SolverResult) -> Result<Py<PyAny>, Error>,
    ) -> Result<Py<PyAny>, Error> {
        let returned = returns_interrupted(self.on_interrupt)?;
        let mesh = self.settings.mesh()?;
        let token = Arc::new(CancellationToken::with_deadline(deadline(self.max_time)?));
        let keeps_mesh = self.settings.keeps_mesh();
        let again = self.solution.filter(|_| keeps_mesh);
        let meshes = vec![mesh; n_phases];
        let (mut problem, mut watcher) = (problem(&token)?, Watcher::new(self.callback)?);
        let named = |error: CollocationError| Error::from(error).with_names(&NAMES);
        let solver = self.settings.solver(problem.relative_errors())?;
        let search = move |token: &CancellationToken| {
            let mut look = |iteration: &Iteration<'_>| -> Flow {
                if token.is_cancelled() { Flow::Stop } else { watcher.look(iteration) }
            };
            let from = match &again {
                Some(solution) => StartFrom::Solution(solution),
                None if keeps_mesh => StartFrom::Guess,
                None => StartFrom::Meshes(&meshes),
            };
            (solver.solve(&mut problem, from, &mut look, token), watcher)
        };
        let ((found, mut watcher), raised) = attend_or_leave_by(py, PATIENCE, token.clone(), search)?;
        watcher.hears(raised);
        let mut found = match found {
            Ok(found) => found,
            Err(SearchError::Failed { source, report }) => {
                let error = PyErr::from(Error::failed(source));
                return Err(with_solution(
                    py,
                    error,
                    result(SolverResult { report: *report, polished: None })?,
                ));
            }
            Err(SearchError::Collocation(error)) => return Err(named(error)),
        };
        if watcher.is_interrupted(py) {
            ended_by(&mut found.report, Status::Interrupted);
        } else if token.has_expired() {
            ended_by(&mut found.report, Status::TimeLimit);
        }
        let result = result(found)?;
        deliver(py, watcher.into_raised(), returned, result)
    }
}

/// Splines whose programs have the limits of those of collocation.
fn splines(collocation: &Collocation) -> Splines {
    let (default, of_meshes) = (Splines::default(), &collocation.solver);
    let solver = Sqp {
        stationarity_tol: default.solver.stationarity_tol.max(of_meshes.stationarity_tol),
        feasibility_tol: default.solver.feasibility_tol.max(of_meshes.feasibility_tol),
        complementarity_tol: default.solver.complementarity_tol.max(of_meshes.complementarity_tol),
        max_iterations: of_meshes.max_iterations,
        ..default.solver
    };
    Splines { solver, ..default }
}

/// A search that was stopped for another reason than its callback's.
pub(super) fn ended_by(report: &mut CollocationReport, reason: Status) {
    let is_stopped = |status: Status| matches!(status, Status::Stopped | Status::Interrupted);
    if let CollocationStatus::NotSolved(status) = &mut report.status
        && is_stopped(*status)
    {
        *status = reason;
    }
    if is_stopped(report.program.status) {
        report.program.status = reason;
    }
}
