//! Events, and what a run with events leaves.

use crate::hybrid::Guard;
use somersault_integrators::driver::{IntegrateError, Status};
use somersault_integrators::state::{Configuration, State};

/// What happens at an event.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum EventKind {
    /// A guard goes in at its surface: a point comes to touch.
    TouchDown,
    /// A guard comes out: the force of a contact has returned to zero.
    Release,
    /// A guard goes in while its gap grows: a point that was released below the surface is held again.
    ReEngagement,
    /// A contact that slid begins to stick.
    Stick,
    /// A contact that stuck begins to slide.
    Slip,
}

impl EventKind {
    /// What the change of a contact's own guard is called: going in, [`TouchDown`](Self::TouchDown), or
    /// [`ReEngagement`](Self::ReEngagement) where the gap grows; coming out, [`Release`](Self::Release).
    pub fn of_contact(before: &Guard, after: &Guard) -> Self {
        if before.is_inside() {
            Self::Release
        } else if after.rate > 0.0 {
            Self::ReEngagement
        } else {
            Self::TouchDown
        }
    }
}

/// A change of sign of a guard.
#[derive(Debug, Clone)]
pub struct Event<Q: Configuration> {
    /// When.
    pub t: f64,
    /// Which guard. Those of the contacts themselves come first and have the index of the contact; see
    /// [`Contacts`](crate::contacts::Contacts) for those of friction.
    pub guard: usize,
    /// What happened.
    pub kind: EventKind,
    /// Impulse of the contact that a release finishes, ∫ F dt (N s), to order 4; zero for the other kinds.
    pub impulse: f64,
    /// The state, before it jumps if it does.
    pub state: State<Q>,
}

/// Settings of the event-locating driver.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Location {
    /// Most events per unit of time and guard, averaged over the last 64 for each guard.
    ///
    /// The default, 1e9, lets any number of contacts complete that last more than nanoseconds each.
    pub max_event_rate: f64,
    /// Whether events are kept. They are counted in any case.
    pub keep_events: bool,
}

impl Default for Location {
    fn default() -> Self {
        Self { max_event_rate: 1e9, keep_events: true }
    }
}

/// Where a run with events ended and what happened on the way.
#[derive(Debug, Clone)]
pub struct Located<Q: Configuration> {
    /// Time reached.
    pub t: f64,
    /// State there.
    pub state: State<Q>,
    /// How it ended.
    pub status: Status,
    /// Steps taken.
    pub steps: u64,
    /// Steps tried and rejected by the step size control; none with fixed steps.
    pub rejected: u64,
    /// Steps tried to find events, in addition.
    pub trials: u64,
    /// Number of events.
    pub event_count: u64,
    /// The events, in the order of time, unless they were not to be kept.
    pub events: Vec<Event<Q>>,
}

impl<Q: Configuration> Located<Q> {
    pub(crate) fn at_start(t: f64, initial: &State<Q>) -> Self {
        Self {
            t,
            state: initial.clone(),
            status: Status::Stopped,
            steps: 0,
            rejected: 0,
            trials: 0,
            event_count: 0,
            events: Vec::new(),
        }
    }
}

/// Why a run with events did not reach its end.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Interruption {
    /// The integration could not start or go on.
    #[error(transparent)]
    Integrate(#[from] IntegrateError),
    /// A guard is not a number: a surface function failed.
    #[error("guard {guard} is not finite at t = {t}: the gap is {gap}, its rate {rate}")]
    NonFiniteGuard {
        /// Which guard.
        guard: usize,
        /// When.
        t: f64,
        /// Its gap.
        gap: f64,
        /// The rate of the gap.
        rate: f64,
    },
    /// Events follow each other faster than allowed.
    #[error("more than `max_event_rate` = {max_event_rate} events per unit of time at t = {t}")]
    Chattering {
        /// Time of the last event.
        t: f64,
        /// Rate allowed.
        max_event_rate: f64,
    },
}

/// A run that did not reach its end, with the solution up to there.
#[derive(Debug, Clone, thiserror::Error)]
#[error("{reason}")]
pub struct Interrupted<Q: Configuration> {
    /// What ended it.
    pub reason: Interruption,
    /// The last state that was committed, and the events up to it.
    pub so_far: Located<Q>,
}
