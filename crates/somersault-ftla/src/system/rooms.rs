//! Memory of evaluations, one for each thread: a system is shared among them.

use std::fmt;
use std::sync::{Mutex, PoisonError};

/// Rooms to work in.
pub(super) struct Rooms<R>(Vec<Mutex<Aligned<R>>>);

/// On lines of the cache of its own.
#[repr(align(128))]
struct Aligned<R>(R);

impl<R> Rooms<R> {
    /// As many as there are threads.
    pub(super) fn new(make: impl Fn() -> R) -> Self {
        let threads = std::thread::available_parallelism().map_or(1, usize::from);
        Self((0..=threads).map(|_| Mutex::new(Aligned(make()))).collect())
    }

    /// Works in the room of this thread.
    #[inline]
    pub(super) fn at<T>(&self, work: impl FnOnce(&mut R) -> T) -> T {
        let number = rayon::current_thread_index().map_or(0, |thread| 1 + thread) % self.0.len();
        // a room is whole whatever happened in it
        work(&mut self.0[number].lock().unwrap_or_else(PoisonError::into_inner).0)
    }
}

impl<R> fmt::Debug for Rooms<R> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} rooms", self.0.len())
    }
}
