//! Calculations beside the interpreter: signals are looked for meanwhile, and what Python code raises ends them.

use crate::core::error::{Class, Error};
use crate::core::waiting::{self, Cancellation};
use pyo3::exceptions::{PyArithmeticError, PyException};
use pyo3::prelude::*;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

/// Points at the beginning of a calculation at which all derivatives are checked.
const FIRST_POINTS: usize = 4;

/// One calculation. Once it is stopped its fields have no values any more, which ends whatever integrates them.
#[derive(Default)]
pub(crate) struct Run {
    cancellation: Cancellation,
    /// Why a callable had no value where it was asked last.
    no_value: Mutex<Option<PyErr>>,
    /// Points at which derivatives have been requested.
    derivatives: AtomicUsize,
}

impl Run {
    /// Ends the calculation with an exception; a later one is a consequence of the first.
    pub(crate) fn stop(&self, error: PyErr) {
        self.cancellation.raise(error);
    }

    /// Notes why there is no value at some point. A trial that overflows is a step rejected; the reason is reported where the
    /// run ends in an error.
    pub(crate) fn note(&self, error: PyErr) {
        *self.no_value.lock().unwrap_or_else(PoisonError::into_inner) = Some(error);
    }

    /// Notes or ends, according to what a callable raised: arithmetic that fails at a point says nothing of other points.
    pub(crate) fn raised(&self, py: Python<'_>, name: &str, error: PyErr) {
        let arithmetic = error.is_instance_of::<PyArithmeticError>(py);
        let error = caused(py, name, error);
        if arithmetic { self.note(error) } else { self.stop(error) }
    }

    /// Whether derivatives are to be checked against differences here: at the first points at which they are requested, and then
    /// ever more rarely.
    pub(crate) fn checks_derivatives(&self) -> bool {
        let before = self.derivatives.fetch_add(1, Ordering::Relaxed);
        !self.is_stopped() && (before < FIRST_POINTS || before.is_power_of_two())
    }

    /// Whether it is to end.
    pub(crate) fn is_stopped(&self) -> bool {
        self.cancellation.token.is_cancelled()
    }
}

/// Calculates without the interpreter, while this thread looks for signals.
pub(crate) fn attend<T: Send>(
    py: Python<'_>,
    work: impl FnOnce(&Arc<Run>) -> Result<T, Error> + Send,
) -> Result<T, Error> {
    attend_stopping(py, || {}, work)
}

/// The same, and `stop` is called before systems lose their values.
pub(crate) fn attend_stopping<T: Send>(
    py: Python<'_>,
    stop: impl FnOnce() + Send,
    work: impl FnOnce(&Arc<Run>) -> Result<T, Error> + Send,
) -> Result<T, Error> {
    let run = Arc::new(Run::default());
    let stopped = |raised| {
        stop();
        run.stop(raised);
    };
    let result = waiting::attend(py, stopped, || work(&run))?;
    if let Some(error) = run.cancellation.raised() {
        return Err(Error::Raised(error.clone_ref(py)));
    }
    result.map_err(|error| {
        let noted = run.no_value.lock().unwrap_or_else(PoisonError::into_inner).take();
        match (noted, &error) {
            (None, _) | (Some(_), Error::Own { class: Class::Input, .. }) => error,
            (Some(why), _) => Error::Raised(why),
        }
    })
}

/// As [`attend`], for work that gives what it has where it ends early, with what was raised. `stop` is called before systems lose
/// their values.
pub(crate) fn attend_with_rest<T: Send>(
    py: Python<'_>,
    stop: impl FnOnce() + Send,
    work: impl FnOnce(&Arc<Run>) -> Result<T, Error> + Send,
) -> Result<(T, Option<PyErr>), Error> {
    let run = Arc::new(Run::default());
    let stopping = Arc::clone(&run);
    let stopped = move |raised| {
        stop();
        stopping.stop(raised);
    };
    let result = waiting::attend(py, stopped, || work(&run))?;
    let raised = run.cancellation.raised().map(|error| error.clone_ref(py));
    match (result, raised) {
        (Err(_), Some(error)) => Err(Error::Raised(error)),
        (result, raised) => Ok((result?, raised)),
    }
}

/// The exception of a callable as the cause of one that names it; what is no `Exception` ends the program as it is.
pub(crate) fn caused(py: Python<'_>, name: &str, error: PyErr) -> PyErr {
    if !error.is_instance_of::<PyException>(py) {
        return error;
    }
    let outer = PyErr::from(Error::evaluation(format!("`{name}` raised {error}")));
    outer.set_cause(py, Some(error));
    outer
}
