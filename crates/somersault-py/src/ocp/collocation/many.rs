//! Many solves at once, on all threads.

use super::NAMES;
use super::search::{Settings, ended_by};
use crate::core::error::Error;
use crate::core::waiting::{Cancellation, attend};
use crate::ocp::solver::deadline;
use pyo3::prelude::*;
use rayon::prelude::*;
use somersault::core::cancel::CancellationToken;
use somersault::nlp::{Flow, Iteration, Status};
use somersault::ocp::collocation::{
    CollocationError, CollocationReport, Problem, RelativeErrors, SearchError,
};
use somersault::ocp::solver::{SolverResult, StartFrom};
use std::sync::Arc;

/// Results of all solves.
pub(super) struct Many {
    /// None where it had not begun when all were to end.
    pub(super) outcomes: Vec<Option<Result<SolverResult, Fault>>>,
    /// What a handler of signals raised meanwhile.
    pub(super) raised: Option<PyErr>,
    /// Whether the time was over.
    pub(super) is_late: bool,
}

/// Why a solve has no report of its own.
pub(super) struct Fault {
    pub(super) error: Error,
    /// What was found until a function of the user raised the error.
    pub(super) report: Option<Box<CollocationReport>>,
}

impl From<Error> for Fault {
    fn from(error: Error) -> Self {
        Self { error, report: None }
    }
}

impl From<CollocationError> for Fault {
    fn from(error: CollocationError) -> Self {
        Error::from(error).with_names(&NAMES).into()
    }
}

impl From<SearchError> for Fault {
    fn from(error: SearchError) -> Self {
        match error {
            SearchError::Failed { source, report } => {
                Self { error: Error::failed(source), report: Some(report) }
            }
            SearchError::Collocation(error) => error.into(),
        }
    }
}

/// A problem, and the solution of a like one to start from.
pub(super) type Job = (Problem, Option<Arc<CollocationReport>>);

/// Solves problems in parallel, without the interpreter, until all are solved, the time is over or a signal comes.
pub(super) fn solve_many(
    py: Python<'_>,
    settings: &Settings,
    max_time: Option<f64>,
    n: usize,
    make: impl Fn(usize, &Arc<CancellationToken>) -> Result<Job, Error> + Sync,
) -> Result<Many, Error> {
    let mesh = settings.mesh()?;
    // what is wrong with the settings is said once
    settings.solver(RelativeErrors::default())?;
    let cancellation = Cancellation::at(deadline(max_time)?);
    let token = &cancellation.token;
    let solve = |k: usize| -> Result<SolverResult, Fault> {
        let (mut problem, solution) = make(k, token)?;
        let solver = settings.solver(problem.relative_errors())?;
        let look = &mut |_: &Iteration<'_>| if token.is_cancelled() { Flow::Stop } else { Flow::Continue };
        let meshes = vec![mesh.clone(); problem.n_phases()];
        let from = match &solution {
            Some(solution) if settings.keeps_mesh() => StartFrom::Solution(solution),
            Some(_) | None if settings.keeps_mesh() => StartFrom::Guess,
            Some(_) | None => StartFrom::Meshes(&meshes),
        };
        Ok(solver.solve(&mut problem, from, look, token)?)
    };
    // one problem to a job: some take a hundred times as long as others
    let all = || {
        let each = (0..n).into_par_iter().with_max_len(1);
        each.map(|k| (!token.is_cancelled()).then(|| solve(k))).collect::<Vec<_>>()
    };
    let mut outcomes = attend(py, |raised| cancellation.raise(raised), all)?;
    let raised = cancellation.raised().map(|raised| raised.clone_ref(py));
    let is_late = raised.is_none() && token.has_expired();
    let ended = if is_late { Status::TimeLimit } else { Status::Interrupted };
    outcomes.iter_mut().flatten().flatten().for_each(|found| ended_by(&mut found.report, ended));
    Ok(Many { outcomes, raised, is_late })
}
