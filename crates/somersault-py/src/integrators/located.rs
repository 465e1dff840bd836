//! Runs of bodies in contact, whose events are located.

use crate::integrators::event::Events;
use crate::integrators::monitor::Monitor;
use crate::integrators::plan::Plan;
use crate::integrators::seen::Seen;
use crate::integrators::solve::{Bodies, Ended};
use somersault::contact::bodies::BodiesInContact;
use somersault::contact::contacts::BodyInContact;
use somersault::contact::stretches::{Touching, WithStretches};
use somersault::integrators::augmented::Augmented;
use somersault::integrators::body::RigidBody;
use somersault::integrators::events::{Interrupted, Located, Location};
use somersault::integrators::force::{BoxedForce, ForceModel, Reach, Wrench, WrenchBound};
use somersault::integrators::state::{RigidBodyState, State, Twist};
use somersault::integrators::system::System;
use somersault::integrators::variation::Tangent;
use std::sync::atomic::{AtomicU64, Ordering};

/// Models that add up and count how often they are evaluated.
pub(crate) struct CountedForces {
    models: Vec<BoxedForce>,
    calls: AtomicU64,
}

impl CountedForces {
    /// The sum of `models`.
    pub(crate) fn new(models: Vec<BoxedForce>) -> Self {
        Self { models, calls: AtomicU64::new(0) }
    }
}

#[deny(clippy::missing_trait_methods)]
impl ForceModel for CountedForces {
    fn wrench(&self, t: f64, body: &RigidBody, x: &RigidBodyState) -> Wrench {
        self.calls.fetch_add(1, Ordering::Relaxed);
        self.models.wrench(t, body, x)
    }
    fn is_free(&self) -> bool {
        self.models.is_free()
    }
    fn is_torque_free(&self) -> bool {
        self.models.is_torque_free()
    }
    fn depends_on_velocity(&self) -> bool {
        self.models.depends_on_velocity()
    }
    fn wrench_variation(
        &self,
        t: f64,
        body: &RigidBody,
        x: &RigidBodyState,
        along: &Tangent<Twist>,
    ) -> Wrench {
        self.models.wrench_variation(t, body, x, along)
    }
    fn mass_derivative(&self, t: f64, body: &RigidBody, x: &RigidBodyState) -> Wrench {
        self.models.mass_derivative(t, body, x)
    }
    fn bound(&self, body: &RigidBody, reach: &Reach) -> Option<WrenchBound> {
        self.models.bound(body, reach)
    }
    fn potential(&self, body: &RigidBody, x: &RigidBodyState) -> Option<f64> {
        self.models.potential(body, x)
    }
}

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
        self.forces.0.calls.load(Ordering::Relaxed)
    }
}

impl Evaluated for BodiesInContact<CountedForces> {
    fn evaluations(&self) -> u64 {
        // Every evaluation asks for the forces on every body.
        self.forces().first().map_or(0, |forces| forces.calls.load(Ordering::Relaxed))
    }
}

/// The bodies with the stretches of their contacts.
type Held<S> = Augmented<<S as System>::Configuration>;

impl<S: Touching<Configuration: Seen> + Evaluated + Sync> Bodies for InContact<S> {
    type Configuration = Held<S>;

    fn solve(
        &self,
        initial: &State<Held<S>>,
        plan: &Plan,
        observer: &mut Monitor<Held<S>>,
    ) -> Ended<Held<S>> {
        let run = plan.run(&self.system).locating(self.location).observed_by(observer);
        let (status, located) = match run.from(initial) {
            Ok(located) => (Ok(located.status), located),
            Err(interrupted) => {
                let Interrupted { reason, so_far } = *interrupted;
                (Err(reason.into()), so_far)
            }
        };
        let Located { rejected, trials, substeps, event_count, events, state, .. } = located;
        let stretches = state.rate.variables;
        let events =
            Events { trials, substeps, count: event_count, contacts: self.contacts, events, stretches };
        Ended { status, rejected, nfev: self.system.0.evaluations(), events }
    }
}
