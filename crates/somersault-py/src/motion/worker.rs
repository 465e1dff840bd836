//! Long work without the interpreter.

use crate::error::Error;
use pyo3::prelude::*;
use somersault::motion::GoOn;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::time::Duration;

/// How often Ctrl-C is looked for.
const ATTENTION: Duration = Duration::from_millis(20);

/// Runs `work` on a thread of its own while other Python threads run, and looks for signals meanwhile. Where a
/// handler raises, the exception comes at once. This is for work that is short, or a single decomposition: it has no
/// place to stop.
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
    let (sender, receiver) = channel();
    let wanted = Arc::new(AtomicBool::new(true));
    let seen = Arc::clone(&wanted);
    let worker = std::thread::spawn(move || {
        // nobody listens any more after a signal
        let _ = sender.send(work(&|| seen.load(Ordering::Relaxed)));
    });
    let ended: PyResult<Result<T, E>> = py.detach(move || {
        loop {
            match receiver.recv_timeout(ATTENTION) {
                Ok(result) => return Ok(result),
                Err(RecvTimeoutError::Timeout) => {
                    if let Err(raised) = Python::attach(|py| py.check_signals()) {
                        wanted.store(false, Ordering::Relaxed);
                        return Err(raised);
                    }
                }
                Err(RecvTimeoutError::Disconnected) => {
                    let panic = worker.join().err();
                    std::panic::resume_unwind(panic.unwrap_or_else(|| Box::new("the worker is gone")));
                }
            }
        }
    });
    ended?.map_err(Into::into)
}
