//! Long work without the interpreter.

use crate::error::Error;
use crate::waiting::attend_or_leave;
use pyo3::prelude::*;
use somersault::core::cancel::CancellationToken;
use std::time::Duration;

/// Works while other Python threads run, and looks for signals meanwhile. Where a handler raises, the exception comes at
/// once. This is for work that is short, or a single decomposition: it has no place to stop.
pub(super) fn attended<T: Send + 'static, E: Into<Error> + Send + 'static>(
    py: Python<'_>,
    work: impl FnOnce() -> Result<T, E> + Send + 'static,
) -> Result<T, Error> {
    attended_cancellable(py, |_| work())
}

/// As [`attended`], for work that looks whether it is cancelled, as it is after a signal.
pub(super) fn attended_cancellable<T: Send + 'static, E: Into<Error> + Send + 'static>(
    py: Python<'_>,
    work: impl FnOnce(&CancellationToken) -> Result<T, E> + Send + 'static,
) -> Result<T, Error> {
    let (done, _) = attend_or_leave(py, Duration::ZERO, work)?;
    done.map_err(Into::into)
}
