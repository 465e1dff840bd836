//! Calculations beside the interpreter: signals are looked for meanwhile, and what Python code raises ends them.

use crate::error::Error;
use pyo3::exceptions::{PyArithmeticError, PyException};
use pyo3::prelude::*;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::mpsc::{self, RecvTimeoutError};
use std::sync::{Arc, Mutex, OnceLock, PoisonError};
use std::thread;
use std::time::Duration;

/// How often a calculation looks whether it is to stop.
const ATTENTION: Duration = Duration::from_millis(50);

/// Points at the beginning of a calculation at which all derivatives are checked.
const FIRST_POINTS: usize = 4;

/// One calculation. Once it is stopped its fields have no values any more, which ends whatever integrates them.
#[derive(Default)]
pub(crate) struct Run {
    stopped: AtomicBool,
    raised: OnceLock<PyErr>,
    /// Why a callable had no value where it was asked last.
    no_value: Mutex<Option<PyErr>>,
    /// Points at which derivatives have been asked for.
    derivatives: AtomicUsize,
}

impl Run {
    /// Ends the calculation with an exception; a later one is a consequence of the first.
    pub(crate) fn stop(&self, error: PyErr) {
        let _ = self.raised.set(error);
        self.stopped.store(true, Ordering::Relaxed);
    }

    /// Notes why there is no value at some point. A trial that overflows is a step rejected; the reason is told where nothing
    /// but an error comes of it.
    pub(crate) fn note(&self, error: PyErr) {
        *self.no_value.lock().unwrap_or_else(PoisonError::into_inner) = Some(error);
    }

    /// Notes or ends, according to what a callable raised: arithmetic that fails at a point says nothing of other points.
    pub(crate) fn raised(&self, py: Python<'_>, name: &str, error: PyErr) {
        let arithmetic = error.is_instance_of::<PyArithmeticError>(py);
        let error = caused(py, name, error);
        if arithmetic { self.note(error) } else { self.stop(error) }
    }

    /// Whether derivatives are to be held against differences here: at the first points that they are asked for at, and then
    /// ever more seldom.
    pub(crate) fn checks_derivatives(&self) -> bool {
        let before = self.derivatives.fetch_add(1, Ordering::Relaxed);
        !self.is_stopped() && (before < FIRST_POINTS || before.is_power_of_two())
    }

    /// Whether it is to end.
    pub(crate) fn is_stopped(&self) -> bool {
        self.stopped.load(Ordering::Relaxed)
    }
}

/// Calculates in a thread without the interpreter, while this one looks for signals.
pub(crate) fn attend<T: Send>(
    py: Python<'_>,
    work: impl FnOnce(&Arc<Run>) -> Result<T, Error> + Send,
) -> Result<T, Error> {
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
        (None, Some(Ok(result))) => Ok(result),
        (None, Some(Err(error))) => {
            let noted = run.no_value.lock().unwrap_or_else(PoisonError::into_inner).take();
            match (noted, &error) {
                (None, _) | (Some(_), Error::Own { class: "FtlaInputError", .. }) => Err(error),
                (Some(why), _) => Err(Error::Raised(why)),
            }
        }
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
