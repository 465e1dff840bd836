//! Cancellation of long work: a [`CancellationToken`] that the caller sets and the work looks at now and then; and a [`Flow`] by
//! which an observer that is shown each step answers.

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

/// What an observer or a callback answers to the work that it is shown.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Flow {
    /// Continue.
    Continue,
    /// End after this step, with the result so far.
    Stop,
}

/// Asks work to end, from any thread, at once or at a deadline. A request is never withdrawn.
#[derive(Debug, Default)]
pub struct CancellationToken {
    cancelled: AtomicBool,
    expired: AtomicBool,
    deadline: Option<Instant>,
}

impl CancellationToken {
    /// A token that asks for nothing until it is cancelled.
    pub fn new() -> Self {
        Self::default()
    }

    /// A token that is cancelled when `deadline` is reached, if there is one.
    pub fn with_deadline(deadline: Option<Instant>) -> Self {
        Self { deadline, ..Self::default() }
    }

    /// Asks the work to end.
    pub fn cancel(&self) {
        self.cancelled.store(true, Ordering::Relaxed);
    }

    /// Whether the work is to end.
    pub fn is_cancelled(&self) -> bool {
        if self.deadline.is_some_and(|deadline| Instant::now() >= deadline) {
            self.expired.store(true, Ordering::Relaxed);
        }
        self.cancelled.load(Ordering::Relaxed) || self.has_expired()
    }

    /// When it is cancelled by itself, if ever.
    pub fn deadline(&self) -> Option<Instant> {
        self.deadline
    }

    /// Whether work has been asked to end because the deadline was reached.
    pub fn has_expired(&self) -> bool {
        self.expired.load(Ordering::Relaxed)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;

    #[test]
    fn what_has_been_asked_stays_asked() {
        let token = CancellationToken::new();
        assert!(!token.is_cancelled());
        token.cancel();
        assert!(token.is_cancelled() && token.is_cancelled() && !token.has_expired());
    }

    #[test]
    fn a_deadline_cancels_when_it_is_looked_at() {
        let now = Instant::now();
        let token = CancellationToken::with_deadline(Some(now));
        assert!(!token.has_expired());
        assert!(token.is_cancelled() && token.has_expired());
        let later = CancellationToken::with_deadline(now.checked_add(Duration::from_secs(3600)));
        assert!(!later.is_cancelled() && !later.has_expired());
    }
}
