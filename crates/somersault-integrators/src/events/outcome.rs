//! Events, and what a run with events leaves.

use super::hybrid::Hybrid;
use crate::driver::{IntegrateError, Status};
use crate::state::{Configuration, State};
use crate::system::System;
use std::convert::Infallible;

/// A change of sign of a guard, of some kind `K`.
#[derive(Debug, Clone)]
pub struct Event<Q: Configuration, K> {
    /// When.
    pub t: f64,
    /// Which guard.
    pub guard: usize,
    /// What happened.
    pub kind: K,
    /// What the guard gathered inside, where it comes out ([`Hybrid::impulse`]); zero where it goes in.
    pub impulse: f64,
    /// The state, before it jumps if it does.
    pub state: State<Q>,
}

/// Where a run with events ended and what happened on the way.
#[derive(Debug, Clone)]
pub struct Located<Q: Configuration, K> {
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
    /// How many of the steps were parts of longer ones, divided for the springs of a mode.
    pub substeps: u64,
    /// Number of events.
    pub event_count: u64,
    /// The events, in the order of time, unless they were not to be kept.
    pub events: Vec<Event<Q, K>>,
}

impl<Q: Configuration, K> Located<Q, K> {
    /// A run that has not left its start.
    pub fn at_start(t: f64, initial: &State<Q>) -> Self {
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

/// Why a run with events did not reach its end; `F` says why a guard may not go in.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum Interruption<F = Infallible> {
    /// The integration could not start or continue.
    #[error(transparent)]
    Integrate(#[from] IntegrateError),
    /// A guard is not a number.
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
    /// A guard may not go in where it does; see [`Hybrid::examine`].
    #[error("guard {guard} may not go in at t = {t}: {fault}")]
    Refused {
        /// Which guard.
        guard: usize,
        /// When.
        t: f64,
        /// Why.
        fault: F,
    },
    /// A step would have to be divided by more than allowed.
    #[error(
        "the step {dt} is too long for the springs and dampers that act at t = {t}: it would take {parts:.0} parts and {most} are allowed; take a shorter step, softer springs or steps adapted to tolerances"
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
    /// A step could not be proved clear of events, nor an event be found in it.
    #[error(
        "the step of {h:e} from t = {t} could not be proved clear of events in {parts} parts: the motion is too fast for it, or stays within the depth of a graze"
    )]
    Unproved {
        /// Start of the step.
        t: f64,
        /// Its length.
        h: f64,
        /// Parts looked at.
        parts: u32,
    },
    /// The energy of a mode grows by the integration, however short the steps allowed.
    #[error(
        "the method gains energy at t = {t}: {gain:.1e} of it, also with steps of {dt:.1e}; take a method of higher order or steps adapted to tolerances"
    )]
    EnergyGain {
        /// When.
        t: f64,
        /// Energy gained, relative to what there was when the first spring began to act.
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

impl<F> Interruption<F> {
    /// Whether a shorter step may help: the equation of an implicit one was not solved.
    pub(super) fn is_of_the_step(&self) -> bool {
        matches!(self, Self::Integrate(error) if error.is_of_the_step())
    }
}

/// A run that did not reach its end, with the solution up to there.
#[derive(Debug, Clone, thiserror::Error)]
#[error("{reason}")]
pub struct Interrupted<Q: Configuration, K, F> {
    /// What ended it.
    pub reason: Interruption<F>,
    /// The last state that was committed, and the events up to it.
    pub so_far: Located<Q, K>,
}

/// A run of a system that did not reach its end.
pub(super) type InterruptedRun<H> =
    Box<Interrupted<<H as System>::Configuration, <H as Hybrid>::Kind, <H as Hybrid>::Fault>>;

/// The outcome of a run of a system with events.
pub type LocatedResult<H> =
    Result<Located<<H as System>::Configuration, <H as Hybrid>::Kind>, InterruptedRun<H>>;
