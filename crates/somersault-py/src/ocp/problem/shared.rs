//! A problem that several threads may ask for.

use super::recipe::Program;
use crate::core::error::Error;
use pyo3::prelude::*;
use std::ops::{Deref, DerefMut};
use std::sync::{Mutex, MutexGuard, PoisonError, TryLockError};
use std::thread::ThreadId;

/// A problem that one thread uses at a time.
pub(super) struct Shared {
    problem: Mutex<Program>,
    /// The thread that holds the problem.
    holder: Mutex<Option<ThreadId>>,
}

/// A problem that no one else uses meanwhile.
pub(super) struct Held<'a> {
    problem: MutexGuard<'a, Program>,
    holder: &'a Mutex<Option<ThreadId>>,
}

impl Drop for Held<'_> {
    fn drop(&mut self) {
        *self.holder.lock().unwrap_or_else(PoisonError::into_inner) = None;
    }
}

impl Deref for Held<'_> {
    type Target = Program;

    fn deref(&self) -> &Program {
        &self.problem
    }
}

impl DerefMut for Held<'_> {
    fn deref_mut(&mut self) -> &mut Program {
        &mut self.problem
    }
}

impl Shared {
    pub(super) fn new(problem: Program) -> Self {
        Self { problem: Mutex::new(problem), holder: Mutex::new(None) }
    }

    /// The problem, once other threads have done with it; they need the interpreter meanwhile.
    ///
    /// A callback or a term that asks for the problem that called it would wait for itself: an error.
    pub(super) fn acquire(&self, py: Python<'_>) -> Result<Held<'_>, Error> {
        let own = std::thread::current().id();
        let holder = || self.holder.lock().unwrap_or_else(PoisonError::into_inner);
        loop {
            let problem = match self.problem.try_lock() {
                Ok(problem) => problem,
                Err(TryLockError::Poisoned(poisoned)) => poisoned.into_inner(),
                Err(TryLockError::WouldBlock) if *holder() == Some(own) => {
                    return Err(Error::input(
                        "a problem cannot be evaluated by a callback or a function that it has called",
                    ));
                }
                Err(TryLockError::WouldBlock) => {
                    py.detach(|| drop(self.problem.lock()));
                    continue;
                }
            };
            *holder() = Some(own);
            return Ok(Held { problem, holder: &self.holder });
        }
    }
}
