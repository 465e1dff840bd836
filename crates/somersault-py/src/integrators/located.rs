//! Runs of bodies in contact, whose events are located.

use crate::integrators::event::Events;
use crate::integrators::plan::Plan;
use crate::integrators::seen::Seen;
use crate::integrators::solve::{Bodies, Ended};
use somersault::contact::bodies::BodiesInContact;
use somersault::contact::contacts::BodyInContact;
use somersault::contact::stretches::{Touching, WithStretches};
use somersault::integrators::augmented::Augmented;
use somersault::integrators::counted::Counted;
use somersault::integrators::driver::Observer;
use somersault::integrators::events::{Interrupted, Located, Location};
use somersault::integrators::force::BoxedForce;
use somersault::integrators::state::State;
use somersault::integrators::system::System;

/// Models that add up and count how often they are evaluated.
type CountedForces = Counted<Vec<BoxedForce>>;

/// Bodies with contacts whose events are located.
pub(crate) struct InContact<S> {
    /// Bodies, forces and contacts.
    pub(crate) system: WithStretches<S>,
    /// Number of contacts.
    pub(crate) contacts: usize,
    /// How events are located.
    pub(crate) location: Location,
}

/// A system whose forces count its evaluations.
pub(crate) trait Evaluated {
    /// How often.
    fn evaluations(&self) -> u64;
}

impl Evaluated for BodyInContact<CountedForces> {
    fn evaluations(&self) -> u64 {
        self.forces.0.calls()
    }
}

impl Evaluated for BodiesInContact<CountedForces> {
    fn evaluations(&self) -> u64 {
        // Every evaluation asks for the forces on every body.
        self.forces().first().map_or(0, |forces| forces.calls())
    }
}

/// The bodies with the stretches of their contacts.
type Held<S> = Augmented<<S as System>::Configuration>;

impl<S> Bodies for InContact<S>
where
    S: Touching<Configuration: Seen> + Evaluated + Send + Sync + 'static,
{
    type Configuration = Held<S>;

    fn solve(
        &self,
        initial: &State<Held<S>>,
        plan: &Plan,
        observer: &mut dyn Observer<Held<S>>,
    ) -> Ended<Held<S>> {
        let run = plan.run(&self.system).locating(self.location).observed_by(observer);
        let (status, located) = match run.from(initial) {
            Ok(located) => (Ok(located.status), located),
            Err(interrupted) => {
                let Interrupted { reason, so_far } = *interrupted;
                (Err(reason.into()), so_far)
            }
        };
        let Located { rejected, trials, substeps, event_count, events, .. } = located;
        let events = Events { trials, substeps, count: event_count, contacts: self.contacts, events };
        Ended { status, rejected, events }
    }

    fn evaluations(&self, _: &Plan, _: u64) -> u64 {
        self.system.0.evaluations()
    }

    fn contacts(&self) -> usize {
        self.contacts
    }
}
