//! Python callables in the library's loops: they cannot unwind these, and what they raise is kept until the loop has ended.

use crate::core::convert::a_type;
use crate::core::error::Error;
use pyo3::exceptions::PyException;
use pyo3::prelude::*;
use std::sync::{Arc, OnceLock};

/// The first exception that Python code raised in a run. The run stops at it.
#[derive(Clone, Default)]
pub(crate) struct Failure(Arc<OnceLock<PyErr>>);

impl Failure {
    /// Keeps an exception unless there is one.
    pub(crate) fn set(&self, error: PyErr) {
        // A later exception is a consequence of the first.
        let _ = self.0.set(error);
    }

    /// The exception kept.
    pub(crate) fn get(&self) -> Option<&PyErr> {
        self.0.get()
    }
}

/// What a Python callable gives; `nan` once anything has been raised, so that numbers tell those in between.
pub(crate) fn call<T>(failure: &Failure, nan: T, f: impl FnOnce(Python<'_>) -> Result<T, Error>) -> T {
    if failure.get().is_some() {
        return nan;
    }
    Python::attach(f).unwrap_or_else(|error| {
        failure.set(error.into());
        nan
    })
}

/// What a callable returned. What it raised has a note of who raised it and where, which tracebacks show.
pub(crate) fn noted<T>(
    py: Python<'_>,
    returned: PyResult<T>,
    who_and_where: impl FnOnce() -> String,
) -> PyResult<T> {
    returned.inspect_err(|error| {
        if error.is_instance_of::<PyException>(py) {
            // an exception that takes no notes is still the one to raise
            let _ = add_note(error.value(py).as_any(), &format!("raised by {}", who_and_where()));
        }
    })
}

/// Does what `BaseException.add_note` does, which Python has from 3.11 on.
fn add_note(raised: &Bound<'_, PyAny>, note: &str) -> PyResult<()> {
    match raised.getattr_opt("__notes__")? {
        Some(notes) => notes.call_method1("append", (note,)).map(|_| ()),
        None => raised.setattr("__notes__", [note]),
    }
}

/// What a callable calls itself, for messages.
pub(crate) fn callable_name(callable: &Bound<'_, PyAny>) -> String {
    let name = callable.getattr("__qualname__").and_then(|name| name.extract::<String>());
    name.or_else(|_| callable.get_type().name().map(|name| name.to_string())).unwrap_or_default()
}

/// Fails unless an argument can be called.
pub(crate) fn check_callable(argument: &str, signature: &str, value: &Bound<'_, PyAny>) -> Result<(), Error> {
    if value.is_callable() {
        return Ok(());
    }
    Err(Error::input(format!("`{argument}` must be a callable {signature}, found {}", a_type(value))))
}
