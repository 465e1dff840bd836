//! Counts of evaluations.

use crate::body::RigidBody;
use crate::force::{ForceModel, Reach, StatesInLanes, Wrench, WrenchBound, WrenchesInLanes};
use crate::partials::Partials;
use crate::series::WrenchTerm;
use crate::state::{RigidBodyState, State, Twist};
use crate::system::{
    BodyPoses, BodyRate, Fault, RateOf, RigidForms, RigidSystem, StateOf, System, WorldScratch,
};
use crate::variation::Tangent;
use std::sync::atomic::{AtomicU64, Ordering};

/// What counts how often it is evaluated, by one thread at a time: a system, its own or borrowed, or forces.
///
/// An evaluation of a system is one call for the accelerations or the wrenches of all bodies; it does not say that it is
/// free. One of forces is a call for the wrench on a body.
#[derive(Debug)]
pub struct Counted<T> {
    inner: T,
    calls: AtomicU64,
}

impl<T> Counted<T> {
    /// With its count at 0.
    pub fn new(inner: T) -> Self {
        Self { inner, calls: AtomicU64::new(0) }
    }

    /// Evaluations so far.
    pub fn calls(&self) -> u64 {
        self.calls.load(Ordering::Relaxed)
    }

    /// Resets the count to 0.
    pub fn reset(&self) {
        self.calls.store(0, Ordering::Relaxed);
    }

    /// Apart from each other, load and store cost no more than with a plain number.
    #[inline]
    fn count(&self) {
        self.calls.store(self.calls() + 1, Ordering::Relaxed);
    }
}

#[deny(clippy::missing_trait_methods)]
impl<S: RigidSystem> System for Counted<S> {
    type Configuration = S::Configuration;
    type Forms = RigidForms;
    type Workspace = S::Workspace;
    fn workspace(&self) -> S::Workspace {
        self.inner.workspace()
    }
    fn velocity(&self, w: &mut S::Workspace, t: f64, x: &StateOf<S>, out: &mut RateOf<S>) {
        self.inner.velocity(w, t, x, out);
    }
    fn acceleration(&self, w: &mut S::Workspace, t: f64, x: &StateOf<S>, out: &mut RateOf<S>) {
        self.count();
        self.inner.acceleration(w, t, x, out);
    }
    fn partials(&self, w: &mut S::Workspace, t: f64, x: &StateOf<S>, out: &mut Partials<S::Configuration>) {
        out.by_differences(x, |x, acceleration| self.acceleration(w, t, x, acceleration));
    }
    #[inline(always)]
    fn depends_on_configuration(&self) -> bool {
        self.inner.depends_on_configuration()
    }
    fn next_stop(&self, t: f64, end: f64) -> Option<f64> {
        self.inner.next_stop(t, end)
    }
    fn take_fault(&self) -> Option<Fault> {
        self.inner.take_fault()
    }
}

#[deny(clippy::missing_trait_methods)]
impl<S: RigidSystem> RigidSystem for Counted<S> {
    fn body(&self, i: usize) -> &RigidBody {
        self.inner.body(i)
    }
    fn rest(&self) -> StateOf<S> {
        self.inner.rest()
    }
    fn wrenches(&self, t: f64, x: &StateOf<S>, out: &mut RateOf<S>) {
        self.count();
        self.inner.wrenches(t, x, out);
    }
    fn body_wrenches(
        &self,
        t: f64,
        x: &State<BodyPoses<S>>,
        world: &mut WorldScratch<S>,
        out: &mut BodyRate<S>,
    ) {
        self.count();
        self.inner.body_wrenches(t, x, world, out);
    }
    fn add_terms(&self, i: usize, terms: &mut Vec<WrenchTerm>) -> bool {
        self.count();
        self.inner.add_terms(i, terms)
    }
    fn is_free(&self) -> bool {
        false
    }
    fn is_torque_free(&self) -> bool {
        self.inner.is_torque_free()
    }
    fn depends_on_velocity(&self) -> bool {
        self.inner.depends_on_velocity()
    }
}

#[deny(clippy::missing_trait_methods)]
impl<F: ForceModel> ForceModel for Counted<F> {
    fn wrench(&self, t: f64, body: &RigidBody, x: &RigidBodyState) -> Wrench {
        self.count();
        self.inner.wrench(t, body, x)
    }
    fn is_free(&self) -> bool {
        self.inner.is_free()
    }
    fn is_torque_free(&self) -> bool {
        self.inner.is_torque_free()
    }
    fn depends_on_velocity(&self) -> bool {
        self.inner.depends_on_velocity()
    }
    fn wrench_variation(
        &self,
        t: f64,
        body: &RigidBody,
        x: &RigidBodyState,
        along: &Tangent<Twist>,
    ) -> Wrench {
        self.inner.wrench_variation(t, body, x, along)
    }
    fn mass_derivative(&self, t: f64, body: &RigidBody, x: &RigidBodyState) -> Wrench {
        self.inner.mass_derivative(t, body, x)
    }
    fn bound(&self, body: &RigidBody, reach: &Reach) -> Option<WrenchBound> {
        self.inner.bound(body, reach)
    }
    fn potential(&self, body: &RigidBody, x: &RigidBodyState) -> Option<f64> {
        self.inner.potential(body, x)
    }
    fn add_terms(&self, body: &RigidBody, terms: &mut Vec<WrenchTerm>) -> bool {
        self.count();
        self.inner.add_terms(body, terms)
    }
    fn add_in_lanes(&self, on: &StatesInLanes<'_>, sums: &mut WrenchesInLanes) {
        on.bodies().iter().for_each(|_| self.count());
        self.inner.add_in_lanes(on, sums);
    }
    fn next_stop(&self, t: f64, end: f64) -> Option<f64> {
        self.inner.next_stop(t, end)
    }
}
