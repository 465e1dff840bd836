//! Limits of a search, and what it has spent of them.

use somersault_core::cancel::CancellationToken;
use std::fmt;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::time::{Duration, Instant};

/// What a search may spend; none of both unless given.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Limits {
    /// Time by the clock.
    pub time: Option<Duration>,
    /// Evaluations of the field, or of field and Jacobian, by the integrator.
    pub evaluations: Option<usize>,
}

/// The limit that a search has reached.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Limit {
    /// [`Limits::time`].
    Time(Duration),
    /// [`Limits::evaluations`].
    Evaluations(usize),
    /// [`Budget::stop`] was called.
    Stopped,
}

impl fmt::Display for Limit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Time(time) => write!(f, "the time limit of {} s is reached", time.as_secs_f64()),
            Self::Evaluations(count) => write!(f, "the limit of {count} evaluations is reached"),
            Self::Stopped => f.write_str("the search was stopped"),
        }
    }
}

/// A search that has begun: its limits, when it began and its evaluations so far. Shared by all of its threads.
#[derive(Debug)]
pub struct Budget {
    limits: Limits,
    began: Instant,
    evaluations: AtomicUsize,
    stopped: AtomicBool,
}

impl Limits {
    /// A token that is cancelled when the time is over that begins now.
    pub fn token(self) -> CancellationToken {
        CancellationToken::with_deadline(self.time.and_then(|most| Instant::now().checked_add(most)))
    }

    /// From now on.
    pub fn start(self) -> Budget {
        let (evaluations, stopped) = (AtomicUsize::new(0), AtomicBool::new(false));
        Budget { limits: self, began: Instant::now(), evaluations, stopped }
    }
}

impl Budget {
    /// Counts evaluations.
    pub fn spend(&self, evaluations: usize) {
        self.evaluations.fetch_add(evaluations, Ordering::Relaxed);
    }

    /// Ends the search, from any thread.
    pub fn stop(&self) {
        self.stopped.store(true, Ordering::Relaxed);
    }

    /// What is left of the time, if that is limited.
    pub fn time_left(&self) -> Option<Duration> {
        self.limits.time.map(|most| most.saturating_sub(self.began.elapsed()))
    }

    /// The limit that has been reached, if one has.
    pub fn reached(&self) -> Option<Limit> {
        if self.stopped.load(Ordering::Relaxed) {
            return Some(Limit::Stopped);
        }
        let Limits { time, evaluations } = self.limits;
        let spent = self.evaluations.load(Ordering::Relaxed);
        let of_evaluations = evaluations.filter(|&most| spent >= most).map(Limit::Evaluations);
        of_evaluations.or_else(|| time.filter(|&most| self.began.elapsed() >= most).map(Limit::Time))
    }
}
