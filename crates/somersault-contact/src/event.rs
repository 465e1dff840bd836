//! Events, and what a run with events leaves.

use crate::hybrid::Guard;
use crate::surface::SurfaceFault;
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
    /// Its name in files and in Python: `touch_down`, `release`, `re_engagement`, `stick` or `slip`.
    pub fn name(self) -> &'static str {
        match self {
            Self::TouchDown => "touch_down",
            Self::Release => "release",
            Self::ReEngagement => "re_engagement",
            Self::Stick => "stick",
            Self::Slip => "slip",
        }
    }

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

    /// What the change of a guard is called, where the guards of `contacts` contacts are followed by those of
    /// their friction.
    pub(crate) fn of_guard(contacts: usize, guard: usize, before: &Guard, after: &Guard) -> Self {
        if guard < contacts {
            Self::of_contact(before, after)
        } else if before.is_inside() {
            Self::Stick
        } else {
            Self::Slip
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
    /// Depth below which a hit may be missed, m, where a gap has a Lipschitz constant but no bound of its second
    /// derivative: rims, and surfaces without [`concavity`](crate::surface::Surface::concavity).
    ///
    /// The default is 1e-6 m. The others are resolved to rounding.
    pub graze: f64,
    /// What is done about fixed steps that are too long for the contacts closed.
    pub stiff: StiffSteps,
}

/// What is done about fixed steps that are too long for the contacts closed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum StiffSteps {
    /// They are divided as the rate of the contacts and the method ask for, and further where the energy grows; a
    /// run that would need to divide a step by more than `most` ends with an error.
    Divide {
        /// The largest number of parts; 1 refuses every step that is too long.
        most: u64,
    },
    /// They are made as given, for studies of methods: what comes out may be far from any motion.
    AsGiven,
}

impl Location {
    /// With fixed steps made as given, however long for the contacts closed: for studies of methods.
    pub fn as_given() -> Self {
        Self { stiff: StiffSteps::AsGiven, ..Self::default() }
    }
}

impl Default for Location {
    fn default() -> Self {
        let stiff = StiffSteps::Divide { most: 100_000 };
        Self { max_event_rate: 1e9, keep_events: true, graze: 1e-6, stiff }
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
    /// Steps tried to find events, and to prove steps clear of them, in addition.
    pub trials: u64,
    /// How many of the steps were parts of longer ones, divided for the contacts closed.
    pub substeps: u64,
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
            substeps: 0,
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
    /// A surface is not fit to be touched.
    #[error("the surface behind guard {guard} cannot be touched at t = {t}: {fault}")]
    Surface {
        /// Which guard.
        guard: usize,
        /// When.
        t: f64,
        /// What is wrong.
        fault: SurfaceFault,
    },
    /// A step would have to be divided by more than allowed.
    #[error(
        "the step {dt} is too long for the contacts closed at t = {t}: it would take {parts:.0} parts and {most} are allowed; take a shorter step, softer contacts or steps adapted to tolerances"
    )]
    StepTooLong {
        /// When.
        t: f64,
        /// The step given.
        dt: f64,
        /// Parts needed.
        parts: f64,
        /// Parts allowed.
        most: u64,
    },
    /// A step could not be proved clear of contacts, nor an event be found in it.
    #[error(
        "the step of {h:e} from t = {t} could not be proved clear of contacts in {parts} parts: the motion is too fast for it, or stays within the depth of a graze"
    )]
    Unproved {
        /// Start of the step.
        t: f64,
        /// Its length.
        h: f64,
        /// Parts looked at.
        parts: u32,
    },
    /// A contact gains energy from the integration, however short the steps allowed.
    #[error(
        "the method gains energy in contact at t = {t}: {gain:.1e} of it, also with steps of {dt:.1e}; take a method of higher order or steps adapted to tolerances"
    )]
    EnergyGain {
        /// When.
        t: f64,
        /// Energy gained, relative to what there was at first touch.
        gain: f64,
        /// The shortest step tried.
        dt: f64,
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
