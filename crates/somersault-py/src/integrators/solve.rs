//! Bodies to be integrated as planned, and how that ended.

use crate::core::error::Error;
use crate::integrators::event::Events;
use crate::integrators::plan::Plan;
use crate::integrators::seen::Seen;
use somersault::integrators::driver::{IntegrateError, Observer, Outcome, Status};
use somersault::integrators::reversal::{Backwards, reversed};
use somersault::integrators::run::{ByMethod, Engages};
use somersault::integrators::state::State;
use somersault::integrators::system::{StateOf, System};

/// How a run ended and what it took.
pub(crate) struct Ended<Q: Seen> {
    pub(crate) status: Result<Status, Error>,
    pub(crate) rejected: u64,
    pub(crate) events: Events<Q>,
}

impl<Q: Seen> Ended<Q> {
    /// Of a run that looks for no events.
    pub(crate) fn without_events(outcome: Result<Outcome<Q>, IntegrateError>) -> Self {
        let rejected = outcome.as_ref().map_or(0, |outcome| outcome.rejected);
        let status = outcome.map(|outcome| outcome.status).map_err(Into::into);
        Self { status, rejected, events: Events::none() }
    }
}

/// Bodies to be integrated, and a count of how often their equations are evaluated.
pub(crate) trait Bodies: Send + Sync + 'static {
    /// What moves.
    type Configuration: Seen;

    /// Integrates as planned.
    fn solve(
        &self,
        initial: &State<Self::Configuration>,
        plan: &Plan,
        observer: &mut dyn Observer<Self::Configuration>,
    ) -> Ended<Self::Configuration>;

    /// How often the equations were evaluated in a run as planned that has tried so many steps.
    fn evaluations(&self, plan: &Plan, tried: u64) -> u64;

    /// How many contacts are located.
    fn contacts(&self) -> usize {
        0
    }
}

/// Runs a system that locates no events; backwards it is that of reversed time.
pub(crate) fn integrate<S: System>(
    system: &S,
    initial: &StateOf<S>,
    plan: &Plan,
    observer: &mut dyn Observer<S::Configuration>,
) -> Result<Outcome<S::Configuration>, IntegrateError>
where
    ByMethod: Engages<S>,
{
    if plan.backwards {
        let mut observer = Backwards(observer);
        let run = plan.run(system).observed_by(&mut observer);
        run.from(&reversed(initial)).map_err(IntegrateError::backwards)
    } else {
        plan.run(system).observed_by(observer).from(initial)
    }
}
