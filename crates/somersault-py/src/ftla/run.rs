//! Calculations beside the interpreter: signals are looked for meanwhile, and what Python code raises ends them.

use crate::error::Error;
use pyo3::exceptions::PyException;
use pyo3::prelude::*;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{self, RecvTimeoutError};
use std::sync::{Arc, OnceLock};
use std::thread;
use std::time::Duration;

/// How often a calculation looks whether it is to stop.
const ATTENTION: Duration = Duration::from_millis(50);

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

/// Calculates in a thread without the interpreter, while this one looks for signals.
pub(crate) fn attend<T: Send>(py: Python<'_>, work: impl FnOnce(&Arc<Run>) -> T + Send) -> Result<T, Error> {
    let run = Arc::new(Run::default());
    let result = py.detach(|| {
        thread::scope(|scope| {
            let (sender, receiver) = mpsc::sync_channel(1);
            let within = &run;
            let worker = scope.spawn(move || sender.send(work(within)));
            loop {
                match receiver.recv_timeout(ATTENTION) {
                    Ok(result) => break Some(result),
                    Err(RecvTimeoutError::Timeout) => {
                        if let Err(error) = Python::attach(|py| py.check_signals()) {
                            run.stop(error);
                        }
                    }
                    Err(RecvTimeoutError::Disconnected) => {
                        let _ = worker.join();
                        break None;
                    }
                }
            }
        })
    });
    match (run.raised.get(), result) {
        (Some(error), _) => Err(Error::Raised(error.clone_ref(py))),
        (None, Some(result)) => Ok(result),
        (None, None) => {
            Err(Error::Own { class: "FtlaError", message: "the calculation broke off".to_owned() })
        }
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
