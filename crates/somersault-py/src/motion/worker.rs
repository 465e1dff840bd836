//! Long work without the interpreter.

use crate::error::Error;
use pyo3::prelude::*;
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::time::Duration;

/// How often Ctrl-C is looked for.
const ATTENTION: Duration = Duration::from_millis(20);

/// Runs `work` on a thread of its own while other Python threads run, and looks for signals meanwhile. Where a
/// handler raises, the exception comes at once; the work has no place to stop and goes on to its end, unheard.
pub(super) fn attended<T: Send + 'static, E: Into<Error> + Send + 'static>(
    py: Python<'_>,
    work: impl FnOnce() -> Result<T, E> + Send + 'static,
) -> Result<T, Error> {
    let (sender, receiver) = channel();
    let worker = std::thread::spawn(move || {
        // nobody listens any more after a signal
        let _ = sender.send(work());
    });
    let ended: PyResult<Result<T, E>> = py.detach(move || {
        loop {
            match receiver.recv_timeout(ATTENTION) {
                Ok(result) => return Ok(result),
                Err(RecvTimeoutError::Timeout) => Python::attach(|py| py.check_signals())?,
                Err(RecvTimeoutError::Disconnected) => {
                    let panic = worker.join().err();
                    std::panic::resume_unwind(panic.unwrap_or_else(|| Box::new("the worker is gone")));
                }
            }
        }
    });
    ended?.map_err(Into::into)
}
