//! Calculations beside the interpreter: signals are looked for meanwhile, and what Python code raises ends them.

use crate::error::Error;
use crate::waiting;
use pyo3::exceptions::PyException;
use pyo3::prelude::*;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, OnceLock};

/// One calculation. Once it is stopped its fields have no values any more, which ends whatever integrates them.
#[derive(Default)]
pub(crate) struct Run {
    stopped: AtomicBool,
    raised: OnceLock<PyErr>,
}

impl Run {
    /// Ends the calculation with an exception; a later one is a consequence of the first.
    pub(crate) fn stop(&self, error: PyErr) {
        let _ = self.raised.set(error);
        self.stopped.store(true, Ordering::Relaxed);
    }

    /// Whether it is to end.
    pub(crate) fn is_stopped(&self) -> bool {
        self.stopped.load(Ordering::Relaxed)
    }
}

/// Calculates without the interpreter, while this thread looks for signals.
pub(crate) fn attend<T: Send>(py: Python<'_>, work: impl FnOnce(&Arc<Run>) -> T + Send) -> Result<T, Error> {
    let run = Arc::new(Run::default());
    let result = waiting::attend(py, |raised| run.stop(raised), || work(&run));
    match run.raised.get() {
        Some(error) => Err(Error::Raised(error.clone_ref(py))),
        None => result,
    }
}

/// The exception of a callable as the cause of one that names it; what is no `Exception` ends the program as it is.
pub(crate) fn caused(py: Python<'_>, name: &str, error: PyErr) -> PyErr {
    if !error.is_instance_of::<PyException>(py) {
        return error;
    }
    let message = format!("`{name}` raised {error}");
    let outer = PyErr::from(Error::Own { class: "FieldError", message });
    outer.set_cause(py, Some(error));
    outer
}
