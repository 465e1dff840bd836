//! Long work without the interpreter.

use crate::error::Error;
use crate::waiting::attend_or_leave;
use pyo3::prelude::*;
use somersault::motion::GoOn;
use std::time::Duration;

/// Works while other Python threads run, and looks for signals meanwhile. Where a handler raises, the exception comes at
/// once. This is for work that is short, or a single decomposition: it has no place to stop.
pub(super) fn attended<T: Send + 'static, E: Into<Error> + Send + 'static>(
    py: Python<'_>,
    work: impl FnOnce() -> Result<T, E> + Send + 'static,
) -> Result<T, Error> {
    attended_while(py, |_| work())
}

/// As [`attended`], for work that asks whether to go on: after a signal it is not to.
pub(super) fn attended_while<T: Send + 'static, E: Into<Error> + Send + 'static>(
    py: Python<'_>,
    work: impl FnOnce(GoOn) -> Result<T, E> + Send + 'static,
) -> Result<T, Error> {
    let (done, _) = attend_or_leave(py, Duration::ZERO, |stop| work(&|| !stop.is_asked()))?;
    done.map_err(Into::into)
}
