//! Where a thread of Python waits for the library: the threads that work for it, signals meanwhile, and their effects.
//!
//! Ctrl-C raises KeyboardInterrupt everywhere, with what was found until then in its attribute `solution`; calls that take
//! `on_interrupt='return'` return that instead.
//!
//! Parallel work runs on threads of this module and never on rayon's global ones. Threads do not survive `fork`, and a
//! child that counted on its parent's would wait indefinitely; here it finds that they are another process's and makes its own.

use crate::core::error::Error;
use pyo3::exceptions::PyKeyboardInterrupt;
use pyo3::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuilder};
use somersault::core::cancel::CancellationToken;
use std::convert::Infallible;
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::sync::{Arc, OnceLock};
use std::time::{Duration, Instant};

/// How often the waiting thread looks for signals.
const SIGNAL_INTERVAL: Duration = Duration::from_millis(20);

/// The threads of a process.
struct Threads {
    process: u32,
    pool: ThreadPool,
    /// Those of a child of it.
    next: OnceLock<Box<Threads>>,
}

/// The threads of this process. There is no lock in it that another thread could have held when the process was forked:
/// threads are started first and put in their place after, where of two that come at once the second stays unused.
fn threads() -> Result<&'static ThreadPool, Error> {
    static FIRST: OnceLock<Box<Threads>> = OnceLock::new();
    let process = std::process::id();
    let (mut place, mut last) = (&FIRST, None);
    loop {
        while let Some(threads) = place.get() {
            last = Some(threads);
            place = &threads.next;
        }
        if let Some(threads) = last.filter(|threads| threads.process == process) {
            return Ok(&threads.pool);
        }
        let pool = start()?;
        let _ = place.set(Box::new(Threads { process, pool, next: OnceLock::new() }));
    }
}

/// New threads, as many as there are processors.
fn start() -> Result<ThreadPool, Error> {
    let started = ThreadPoolBuilder::new().thread_name(|i| format!("somersault-{i}")).build();
    started.map_err(|error| Error::of_system(format!("no threads can be started: {error}")))
}

/// Whether this thread is one of those that work.
fn works() -> bool {
    rayon::current_thread_index().is_some()
}

/// Works on all threads, without the interpreter. For what takes a fraction of a second.
pub(crate) fn together<T: Send>(py: Python<'_>, work: impl FnOnce() -> T + Send) -> Result<T, Error> {
    if works() {
        return Ok(py.detach(work));
    }
    let threads = threads()?;
    Ok(py.detach(|| threads.install(work)))
}

/// Works on all threads, without the interpreter, while this thread looks for signals. What a handler of them raises is
/// given to `interrupted`, once, which has the work end.
///
/// Work inside of work looks for none: the thread that waits for the outer work does.
pub(crate) fn attend<T: Send>(
    py: Python<'_>,
    interrupted: impl FnOnce(PyErr) + Send,
    work: impl FnOnce() -> T + Send,
) -> Result<T, Error> {
    if works() {
        return Ok(py.detach(work));
    }
    let threads = threads()?;
    let mut done = None;
    let place = &mut done;
    py.detach(|| {
        threads.in_place_scope(|scope| {
            let (working, end) = channel();
            scope.spawn(move |_| {
                *place = Some(work());
                drop(working);
            });
            if let Some(raised) = signal_before(&end) {
                interrupted(raised);
            }
            // what is still under way ends before the scope does, and a panic is passed on by it
        });
    });
    done.ok_or_else(|| Error::of_system("the work stopped early".to_owned()))
}

/// What tells that work has ended: the other end is dropped then, also by a panic.
type End = Receiver<Infallible>;

/// Whether the work has ended within the time between two looks for signals.
fn ends_soon(end: &End) -> bool {
    !matches!(end.recv_timeout(SIGNAL_INTERVAL), Err(RecvTimeoutError::Timeout))
}

/// What a handler of signals raises before the end of some work.
fn signal_before(end: &End) -> Option<PyErr> {
    while !ends_soon(end) {
        if let Err(raised) = Python::attach(|py| py.check_signals()) {
            return Some(raised);
        }
    }
    None
}

/// As [`attend`], for work that may take long to end: what was raised comes once `patience` is over, or at once after a
/// second signal, and the work ends in the background when it next looks whether it is cancelled.
///
/// Work that ended in time comes with what was raised. It has threads of its own: other work does not wait for what was
/// left.
pub(crate) fn attend_or_leave<T: Send + 'static>(
    py: Python<'_>,
    patience: Duration,
    work: impl FnOnce(&CancellationToken) -> T + Send + 'static,
) -> Result<(T, Option<PyErr>), Error> {
    attend_or_leave_by(py, patience, Arc::default(), work)
}

/// The same with a token that others look at too, and which may have a deadline.
pub(crate) fn attend_or_leave_by<T: Send + 'static>(
    py: Python<'_>,
    patience: Duration,
    token: Arc<CancellationToken>,
    work: impl FnOnce(&CancellationToken) -> T + Send + 'static,
) -> Result<(T, Option<PyErr>), Error> {
    if works() {
        return Ok((py.detach(|| work(&token)), None));
    }
    let threads = start()?;
    let (working, end) = channel();
    let within = Arc::clone(&token);
    let worker = std::thread::Builder::new().name("somersault".to_owned()).spawn(move || {
        let done = threads.install(|| work(&within));
        drop(working);
        done
    });
    let worker = worker.map_err(|error| Error::of_system(format!("no thread can be started: {error}")))?;
    let (raised, joined) = py.detach(move || {
        let raised = end_or_leave(&end, patience, &token)?;
        Ok::<_, PyErr>((raised, worker.join()))
    })?;
    match joined {
        Ok(done) => Ok((done, raised)),
        Err(panic) => std::panic::resume_unwind(panic),
    }
}

/// Waits for the end of work, and gives what a handler of signals raised meanwhile, which cancels the work.
///
/// Errors: what was raised, once `patience` is over or at a second signal: nobody waits for the work any more.
fn end_or_leave(end: &End, patience: Duration, token: &CancellationToken) -> PyResult<Option<PyErr>> {
    let mut first: Option<(PyErr, Instant)> = None;
    while !ends_soon(end) {
        if let Err(raised) = Python::attach(|py| py.check_signals()) {
            token.cancel();
            if patience.is_zero() || first.is_some() {
                return Err(raised);
            }
            first = Some((raised, Instant::now()));
        }
        if let Some((raised, _)) = first.take_if(|(_, since)| since.elapsed() >= patience) {
            return Err(raised);
        }
    }
    Ok(first.map(|(raised, _)| raised))
}

/// As [`attend_or_leave`] for work that nobody waits for after a signal, and whose errors are exceptions. Work that has no
/// place to stop need not look at the token.
pub(crate) fn leave_on_signal<T: Send + 'static, E: Into<Error> + Send + 'static>(
    py: Python<'_>,
    work: impl FnOnce(&CancellationToken) -> Result<T, E> + Send + 'static,
) -> Result<T, Error> {
    let (done, _) = attend_or_leave(py, Duration::ZERO, work)?;
    done.map_err(Into::into)
}

/// As [`attend`] for work that ends soon after it is cancelled; then what a handler of signals raised comes out.
pub(crate) fn cancel_on_signal<T: Send, E: Send + Into<Error>>(
    py: Python<'_>,
    work: impl FnOnce(&CancellationToken) -> Result<T, E> + Send,
) -> Result<T, Error> {
    let cancellation = Cancellation::default();
    let found = attend(py, |raised| cancellation.raise(raised), || work(&cancellation.token))?;
    match cancellation.raised() {
        Some(error) => Err(error.clone_ref(py).into()),
        None => found.map_err(Into::into),
    }
}

/// What the argument `on_interrupt` asks for: whether what was found is returned.
pub(crate) fn returns_interrupted(on_interrupt: &str) -> Result<bool, Error> {
    match on_interrupt {
        "raise" => Ok(false),
        "return" => Ok(true),
        _ => Err(Error::input(format!("`on_interrupt` must be 'raise' or 'return', found '{on_interrupt}'"))),
    }
}

/// What was found until a call ended: returned, or the attribute `solution` of what was raised.
pub(crate) fn deliver<'py, T: IntoPyObject<'py>>(
    py: Python<'py>,
    raised: Option<PyErr>,
    return_interrupted: bool,
    found: T,
) -> Result<T, Error> {
    match raised {
        Some(error) if !(return_interrupted && error.is_instance_of::<PyKeyboardInterrupt>(py)) => {
            Err(with_solution(py, error, found))
        }
        _ => Ok(found),
    }
}

/// The exception, with what was found until then in its attribute `solution`.
pub(crate) fn with_solution<'py>(py: Python<'py>, error: PyErr, found: impl IntoPyObject<'py>) -> Error {
    // An exception that takes no attributes is still the one to raise.
    let _ = error.value(py).setattr("solution", found);
    error.into()
}

/// Items that are worked through between two looks for signals, at some microseconds each.
const ITEMS_PER_LOOK: usize = 1 << 12;

/// Works through items in turn, without the interpreter, and looks for signals every few milliseconds.
pub(crate) fn in_turn<T: Sync>(
    py: Python<'_>,
    items: &[T],
    mut work: impl FnMut(&T) -> Result<(), Error> + Send,
) -> Result<(), Error> {
    for part in items.chunks(ITEMS_PER_LOOK) {
        py.detach(|| part.iter().try_for_each(&mut work))?;
        py.check_signals()?;
    }
    Ok(())
}

/// The clock of those that look for signals themselves, between parts of their work.
pub(crate) struct SignalTimer(Instant);

impl SignalTimer {
    pub(crate) fn start() -> Self {
        Self(Instant::now())
    }

    /// Whether it is time to look.
    pub(crate) fn is_due(&self) -> bool {
        self.0.elapsed() >= SIGNAL_INTERVAL
    }

    /// Whether a handler of signals raises now.
    pub(crate) fn look(&mut self, py: Python<'_>) -> PyResult<()> {
        self.0 = Instant::now();
        py.check_signals()
    }
}

/// How the waiting thread cancels work, and why.
#[derive(Default)]
pub(crate) struct Cancellation {
    pub(crate) token: Arc<CancellationToken>,
    raised: OnceLock<PyErr>,
}

impl Cancellation {
    /// With a time after which work is to end.
    pub(crate) fn at(deadline: Option<Instant>) -> Self {
        Self { token: Arc::new(CancellationToken::with_deadline(deadline)), ..Self::default() }
    }

    /// Ends the work, by what a handler of signals raised.
    pub(crate) fn raise(&self, raised: PyErr) {
        let _ = self.raised.set(raised);
        self.token.cancel();
    }

    /// What a handler of signals raised.
    pub(crate) fn raised(&self) -> Option<&PyErr> {
        self.raised.get()
    }
}
