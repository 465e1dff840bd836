//! Many starts, and their results.

use super::arguments::tolerance;
use super::collocation::{CollocationOutcome, PolishResult};
use super::solver::Report;
use super::verification::Verifier;
use crate::core::convert::a_type;
use crate::core::error::Error;
use crate::core::value::{Pickled, by_restore, value};
use crate::core::waiting::{Cancellation, attend, deliver};
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;
use pyo3::types::PyType;
use somersault::nlp::{
    self, FailureCause, MultiStart, MultiStartReport, Nlp, NlpSolver, SolverError, Start, Status,
};
use std::sync::Arc;
use std::time::Instant;

/// The arguments that all searches share.
pub(crate) struct SearchArguments<S> {
    pub(crate) solver: S,
    pub(crate) distance_tol: f64,
    pub(crate) deadline: Option<Instant>,
    /// Whether Ctrl-C returns what has been found.
    pub(crate) returned: bool,
}

impl<S: NlpSolver + Send + Sync> SearchArguments<S> {
    /// Solves from all starts without the interpreter, which looks for Ctrl-C meanwhile. `reported` makes reports of
    /// the variables that the caller knows, `verifier` what integrates their motion again, `wrong_derivative` what is said of a derivative that is wrong.
    pub(crate) fn run<N: Nlp>(
        self,
        py: Python<'_>,
        starts: &[Start],
        make: impl Fn() -> Result<N, Error> + Sync,
        reported: impl Fn(nlp::Report) -> nlp::Report,
        verifier: impl Fn(&nlp::Report) -> Option<Arc<Verifier>>,
        wrong_derivative: impl Fn(&nlp::Report) -> Option<String>,
    ) -> Result<SearchResult, Error> {
        tolerance("distance_tol", Some(self.distance_tol))?;
        let many = MultiStart { distance_tol: self.distance_tol, ..MultiStart::new(self.solver) };
        let cancellation = Cancellation::at(self.deadline);
        let solve = || many.try_solve::<N, Error>(&make, starts, || cancellation.token.is_cancelled());
        let found = attend(py, |raised| cancellation.raise(raised), solve)??;
        let raised = cancellation.raised().map(|raised| raised.clone_ref(py));
        let is_late = cancellation.token.has_expired() && raised.is_none();
        let result = SearchResult::of(py, found, is_late, reported, verifier, wrong_derivative)?;
        deliver(py, raised, self.returned, result)
    }
}

/// Result of a search from many starts.
///
/// One of ``method='indirect'`` is not pickled: keep the problem and the `found` of each result, and polish again.
#[pyclass(frozen, module = "somersault.ocp")]
pub(crate) struct SearchResult {
    minima: Vec<Py<PyAny>>,
    /// list of list of int: Numbers of the starts that led to each minimum.
    #[pyo3(get)]
    starts: Vec<Vec<usize>>,
    unfinished: Vec<Py<PyAny>>,
    failures: Vec<(usize, String)>,
    status: String,
}

impl SearchResult {
    pub(crate) fn new(
        minima: Vec<Py<PyAny>>,
        starts: Vec<Vec<usize>>,
        unfinished: Vec<Py<PyAny>>,
        failures: Vec<(usize, String)>,
        status: String,
    ) -> Self {
        Self { minima, starts, unfinished, failures, status }
    }

    fn of(
        py: Python<'_>,
        found: MultiStartReport,
        is_late: bool,
        reported: impl Fn(nlp::Report) -> nlp::Report,
        verifier: impl Fn(&nlp::Report) -> Option<Arc<Verifier>>,
        wrong_derivative: impl Fn(&nlp::Report) -> Option<String>,
    ) -> Result<Self, Error> {
        let status = match (found.is_interrupted(), is_late, found.minima.is_empty()) {
            (true, true, _) => "time_limit",
            (true, false, _) => "interrupted",
            (false, _, false) => "converged",
            (false, _, true) => "no_minimum",
        };
        // that of the best iterate stands for all
        let wrong = found.unfinished().first().and_then(|report| wrong_derivative(report));
        let report = |report: nlp::Report| {
            let wrong_derivative = wrong.clone().filter(|_| report.status.is_suspect());
            let mut report = reported(report);
            if is_late && report.status == Status::Interrupted {
                report.status = Status::TimeLimit;
            }
            let verifier = verifier(&report);
            Ok(Py::new(py, Report { report, verifier, wrong_derivative })?.into_any())
        };
        let unfinished: Vec<nlp::Report> = found.unfinished().into_iter().cloned().collect();
        let mut search = Self {
            minima: Vec::new(),
            starts: Vec::new(),
            unfinished: unfinished.into_iter().map(report).collect::<PyResult<_>>()?,
            failures: Vec::new(),
            status: status.to_owned(),
        };
        for minimum in found.minima {
            search.minima.push(report(minimum.report)?);
            search.starts.push(minimum.starts);
        }
        for failure in found.failures {
            let cause = match failure.cause {
                FailureCause::Ended(ended) if is_late && ended.status == Status::Interrupted => {
                    Status::TimeLimit.message().to_owned()
                }
                FailureCause::Ended(ended) => ended.status.message().to_owned(),
                FailureCause::Error(SolverError::Failed { source, .. }) => match source.downcast::<PyErr>() {
                    // a fault in a function of the user is one for all starts
                    Ok(error) => return Err((*error).into()),
                    Err(other) => other.to_string(),
                },
                FailureCause::Error(error) => error.to_string(),
                FailureCause::Skipped => "not begun".to_owned(),
            };
            search.failures.push((failure.start, cause));
        }
        Ok(search)
    }
}

fn all(py: Python<'_>, reports: &[Py<PyAny>]) -> Vec<Py<PyAny>> {
    reports.iter().map(|report| report.clone_ref(py)).collect()
}

value! {
    impl SearchResult {
        /// str: ``'converged'`` where all starts have ended and at least one in a minimum, ``'no_minimum'`` where none did,
        /// ``'interrupted'`` or ``'time_limit'`` where not all of them could end.
        status: &str = |own| &own.status;
        /// bool: Whether there is a minimum.
        success: bool = |own| !own.minima.is_empty();
        /// list of Report, CollocationResult or MultiphaseResult: Distinct minima, that of lowest cost first.
        minima: Vec<Py<PyAny>> = |own, py| all(py, &own.minima);
        /// list: Best iterates of starts that did not get to a minimum, best first by merit: cost and weighed violation.
        unfinished: Vec<Py<PyAny>> = |own, py| all(py, &own.unfinished);
        /// list of tuple: Number of each start that led to no minimum, and why.
        failures: Vec<(usize, String)> = |own| own.failures.clone();
    }
}

#[pymethods]
impl SearchResult {
    /// Report, CollocationResult or MultiphaseResult: The local minimum with the lowest cost; if no start converged, the best iterate of all starts.
    #[getter]
    fn best(&self, py: Python<'_>) -> Result<Py<PyAny>, Error> {
        match self.minima.first().or(self.unfinished.first()) {
            Some(report) => Ok(report.clone_ref(py)),
            None => Err(Error::evaluation("no start led to an iterate; see `failures`")),
        }
    }

    fn __repr__(&self) -> String {
        let converged: usize = self.starts.iter().map(Vec::len).sum();
        format!(
            "<SearchResult: {}, {} distinct minima from {converged} of {} starts>",
            self.status,
            self.minima.len(),
            converged + self.failures.len()
        )
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> Pickled<'py> {
        let (py, search) = (slf.py(), slf.get());
        let mut results = search.minima.iter().chain(&search.unfinished);
        if results.any(|found| found.bind(py).is_instance_of::<PolishResult>()) {
            return Err(PyTypeError::new_err(
                "a SearchResult of method='indirect' holds functions of its problem: keep that and the `found` of each result, and polish again",
            ));
        }
        let arguments = (
            all(py, &search.minima),
            search.starts.clone(),
            all(py, &search.unfinished),
            search.failures.clone(),
            search.status.clone(),
        );
        by_restore(slf, arguments)
    }

    /// A pickled search.
    #[classmethod]
    fn _restore(
        _: &Bound<'_, PyType>,
        minima: Vec<Bound<'_, PyAny>>,
        starts: Vec<Vec<usize>>,
        unfinished: Vec<Bound<'_, PyAny>>,
        failures: Vec<(usize, String)>,
        status: String,
    ) -> Result<Self, Error> {
        if minima.len() != starts.len() {
            let (n, found) = (minima.len(), starts.len());
            return Err(Error::input(format!("`starts` must have {n} entries, found {found}")));
        }
        for found in minima.iter().chain(&unfinished) {
            if !(found.is_instance_of::<Report>() || found.is_instance_of::<CollocationOutcome>()) {
                let found = a_type(found);
                return Err(Error::input(format!(
                    "`minima` and `unfinished` must hold results, found {found}"
                )));
            }
        }
        let unbound = |all: Vec<Bound<'_, PyAny>>| all.into_iter().map(Bound::unbind).collect();
        Ok(Self::new(unbound(minima), starts, unbound(unfinished), failures, status))
    }
}
