//! Bodies whose friction has stretches, as a part of the state.
//!
//! The friction of [`CoulombFriction`](crate::laws::coulomb::CoulombFriction) holds by a spring. Its stretch ξ, one
//! vector in the plane of contact for each contact, obeys an equation of first order; [`WithStretches`] puts the
//! stretches beside the rates of the bodies, where every method integrates them to the order that it has for
//! velocities.
//!
//! On a curved surface, and between two spheres, ξ turns with the plane of contact, ξ̇ = … + Ω × ξ with Ω = n × ṅ,
//! which keeps its length (parallel transport). Between two spheres, whose plane of contact turns with them when
//! they turn as one, Ω has the mean of their spins about n besides: S. Luding, Granular Matter 10 (2008) 235.
//!
//! ξ is zero where a contact is open, and as it begins.

use crate::encounters::{self, ContactState, Encounters, reset};
use crate::error::ContactError;
use crate::event::EventKind;
use crate::laws::{ContactLaw, ContactMode, Encounter};
use crate::load;
use crate::surface::SurfaceFault;
use nalgebra::{DVector, Vector3};
use somersault_integrators::augmented::{Augmented, AugmentedRate};
use somersault_integrators::body::RigidBody;
use somersault_integrators::driver::IntegrateError;
use somersault_integrators::events::{Energy, Guard, Hybrid, HybridBodies, Sweep};
use somersault_integrators::force::Wrench;
use somersault_integrators::partials::Partials;
use somersault_integrators::series::WrenchTerm;
use somersault_integrators::state::{Poses, State};
use somersault_integrators::system::{
    Fault, RateOf, RigidForms, RigidSystem, StateOf, System, world_acceleration,
};

/// Bodies and their contacts, for [`WithStretches`].
pub trait Touching:
    HybridBodies<Mode = Vec<ContactMode>, Kind = EventKind, Fault = SurfaceFault>
    + Encounters<<Self as System>::Configuration>
{
    /// Force and torque on every body, with the contacts' efforts by their numbers, laws and encounters.
    fn wrenches_by(
        &self,
        t: f64,
        x: (&Self::Configuration, &RateOf<Self>),
        effort: impl FnMut(usize, &ContactLaw, &Encounter) -> Wrench,
        out: &mut RateOf<Self>,
    );
}

impl<S: Touching> Touching for &S {
    fn wrenches_by(
        &self,
        t: f64,
        x: (&S::Configuration, &RateOf<S>),
        effort: impl FnMut(usize, &ContactLaw, &Encounter) -> Wrench,
        out: &mut RateOf<S>,
    ) {
        (**self).wrenches_by(t, x, effort, out);
    }
}

/// Bodies in contact with the stretches of their friction: a
/// [`BodyInContact`](crate::contacts::BodyInContact) or [`BodiesInContact`](crate::bodies::BodiesInContact).
///
/// Its state is that of the bodies and a stretch for each contact, m, in the order of the contacts, zero for
/// those whose friction has none: [`State::augmented`]. Modes, guards and events are those of the bodies.
#[derive(Debug, Clone, Copy)]
pub struct WithStretches<S>(pub S);

impl<S: Touching> WithStretches<S> {
    /// A state with unstretched contacts.
    pub fn unstretched(&self, x: StateOf<S>) -> StateOf<Self> {
        encounters::unstretched(&self.0, x)
    }

    /// A state with given stretches, m, of which the part in the plane of contact counts; none of open contacts.
    pub fn stretched(
        &self,
        x: StateOf<S>,
        stretches: Vec<Vector3<f64>>,
    ) -> Result<StateOf<Self>, ContactError> {
        encounters::stretched(&self.0, x, stretches)
    }

    /// A state whose stretches carry the load at time t, as far as friction can: the parts in the planes of contact of
    /// the least forces at the contacts that leave the least acceleration by Gauss' measure, aᵀ M a, each within
    /// its cone. Forces along the normals may change from those of the state, as they will under the load.
    pub fn loaded(&self, t: f64, x: StateOf<S>) -> StateOf<Self> {
        load::loaded(&self.0, x, |State { configuration: q, rate: p }, effort| {
            let mut wrenches = p.clone();
            self.0.wrenches_by(t, (q, p), effort, &mut wrenches);
            self.weighed(q, &wrenches)
        })
    }

    /// Wrenches over the roots of mass and moments of inertia.
    fn weighed(&self, q: &S::Configuration, wrenches: &RateOf<S>) -> DVector<f64> {
        let mut sum = DVector::zeros(6 * q.count());
        for i in 0..q.count() {
            let (body, pose) = (self.0.body(i), q.pose(i));
            let wrench = S::Configuration::twist(wrenches, i);
            let principal = pose.orientation * body.inertia().principal_axes();
            let torque = principal.inverse_transform_vector(&wrench.angular);
            let moments = body.inertia().principal_moments().map(f64::sqrt);
            sum.fixed_rows_mut::<3>(6 * i).copy_from(&(wrench.linear / body.mass().sqrt()));
            sum.fixed_rows_mut::<3>(6 * i + 3).copy_from(&torque.component_div(&moments));
        }
        sum
    }

    /// What every contact does in a state, each in the mode that the state has it in.
    pub fn touches(&self, x: &StateOf<Self>) -> Vec<ContactState> {
        encounters::contact_states(&self.0, (&x.configuration, &x.rate))
    }

    /// Energy of the springs of contacts and friction, J.
    pub fn energy(&self, x: &StateOf<Self>) -> f64 {
        self.energy_at(&x.configuration, &x.rate)
    }

    pub(crate) fn energy_at(&self, q: &Augmented<S::Configuration>, p: &AugmentedRate<RateOf<S>>) -> f64 {
        encounters::energy(&self.0, (q, p))
    }

    pub(crate) fn mode_at(
        &self,
        q: &Augmented<S::Configuration>,
        p: &AugmentedRate<RateOf<S>>,
    ) -> Vec<ContactMode> {
        encounters::modes(&self.0, (q, p))
    }

    pub(crate) fn next_mode_at(
        &self,
        before: &[ContactMode],
        q: &Augmented<S::Configuration>,
        p: &AugmentedRate<RateOf<S>>,
    ) -> Vec<ContactMode> {
        encounters::next_modes(&self.0, before, (q, p))
    }

    #[inline]
    pub(crate) fn guards_at(
        &self,
        mode: &[ContactMode],
        q: &Augmented<S::Configuration>,
        p: &AugmentedRate<RateOf<S>>,
        out: &mut Vec<Guard>,
    ) {
        encounters::guards(&self.0, mode, (q, p), out);
    }

    #[inline]
    pub(crate) fn wrenches_at(
        &self,
        mode: &[ContactMode],
        t: f64,
        q: &Augmented<S::Configuration>,
        p: &AugmentedRate<RateOf<S>>,
        AugmentedRate { base, variables }: &mut AugmentedRate<RateOf<S>>,
    ) {
        let effort = |i: usize, law: &ContactLaw, at: &Encounter| {
            let (wrench, stretch_rate) = law.response_in(&mode[i], at, &p.variables[i]);
            variables[i] = stretch_rate;
            wrench
        };
        self.0.wrenches_by(t, (&q.0, &p.base), effort, base);
    }
}

impl<S: Touching> System for WithStretches<S> {
    type Configuration = Augmented<S::Configuration>;
    type Forms = RigidForms;
    type Workspace = ();
    fn workspace(&self) {}
    fn acceleration(&self, w: &mut (), t: f64, x: &StateOf<Self>, out: &mut RateOf<Self>) {
        self.acceleration_in(&self.mode(t, x), w, t, x, out);
    }
    fn next_stop(&self, t: f64, end: f64) -> Option<f64> {
        self.0.next_stop(t, end)
    }
    fn take_fault(&self) -> Option<Fault> {
        self.0.take_fault()
    }
}

impl<S: Touching> RigidSystem for WithStretches<S> {
    #[inline(always)]
    fn body(&self, i: usize) -> &RigidBody {
        self.0.body(i)
    }
    fn rest(&self) -> StateOf<Self> {
        self.unstretched(self.0.rest())
    }
    fn wrenches(&self, t: f64, x: &StateOf<Self>, out: &mut RateOf<Self>) {
        self.wrenches_in(&self.mode(t, x), t, x, out);
    }
    fn is_free(&self) -> bool {
        self.0.is_free()
    }
    fn is_torque_free(&self) -> bool {
        self.0.is_torque_free()
    }
    fn depends_on_velocity(&self) -> bool {
        self.0.depends_on_velocity()
    }
}

#[deny(clippy::missing_trait_methods)]
impl<S: Touching> Hybrid for WithStretches<S> {
    type Mode = Vec<ContactMode>;
    type Kind = EventKind;
    type Fault = SurfaceFault;
    const RESETS: bool = true;

    fn check(&self) -> Result<(), IntegrateError> {
        Ok(())
    }

    fn mode(&self, _: f64, x: &StateOf<Self>) -> Vec<ContactMode> {
        self.mode_at(&x.configuration, &x.rate)
    }

    fn next_mode(&self, before: &Vec<ContactMode>, _: f64, x: &StateOf<Self>) -> Vec<ContactMode> {
        self.next_mode_at(before, &x.configuration, &x.rate)
    }

    fn event_kind(
        &self,
        guard: usize,
        before: &Guard,
        after: &Guard,
        modes: (&Vec<ContactMode>, &Vec<ContactMode>),
    ) -> EventKind {
        EventKind::of_guard(modes.0.len(), guard, before, after)
    }

    #[inline]
    fn guards(&self, mode: &Vec<ContactMode>, _: f64, x: &StateOf<Self>, out: &mut Vec<Guard>) {
        self.guards_at(mode, &x.configuration, &x.rate, out);
    }

    fn sweeps(
        &self,
        mode: &Vec<ContactMode>,
        t: f64,
        h: f64,
        ends: (&StateOf<Self>, &StateOf<Self>),
        out: &mut Vec<Sweep>,
    ) {
        self.0.sweeps(mode, t, h, (&ends.0.base(), &ends.1.base()), out);
    }

    fn clear_time(
        &self,
        mode: &Vec<ContactMode>,
        t: f64,
        x: &StateOf<Self>,
        guards: &[Guard],
        horizon: f64,
    ) -> f64 {
        self.0.clear_time(mode, t, &x.base(), guards, horizon)
    }

    fn examine(&self, guard: usize, x: &StateOf<Self>) -> Result<(), SurfaceFault> {
        self.0.examine(guard, &x.base())
    }

    fn stiffest_rate(&self, mode: &Vec<ContactMode>, x: &StateOf<Self>) -> f64 {
        self.0.stiffest_rate(mode, &x.base())
    }

    fn energy(&self, x: &StateOf<Self>) -> Option<Energy> {
        let of_bodies = self.0.energy(&x.base())?;
        Some(Energy { springs: self.energy(x), ..of_bodies })
    }

    #[inline]
    fn acceleration_in(
        &self,
        mode: &Vec<ContactMode>,
        (): &mut (),
        t: f64,
        x: &StateOf<Self>,
        out: &mut RateOf<Self>,
    ) {
        self.wrenches_in(mode, t, x, out);
        for i in 0..x.configuration.count() {
            let (pose, rate) = (x.configuration.pose(i), Augmented::<S::Configuration>::twist(&x.rate, i));
            let wrench = Augmented::<S::Configuration>::twist(out, i);
            let state = State { configuration: pose, rate };
            let acceleration = world_acceleration(self.0.body(i), &state, &wrench);
            Augmented::<S::Configuration>::set_twist(out, i, acceleration);
        }
    }

    fn partials_in(
        &self,
        mode: &Vec<ContactMode>,
        w: &mut (),
        t: f64,
        x: &StateOf<Self>,
        out: &mut Partials<Self::Configuration>,
    ) {
        out.by_differences(x, |x, acceleration| self.acceleration_in(mode, w, t, x, acceleration));
    }

    /// Contacts begin and end without stretch.
    fn reset(&self, _: f64, before: &Vec<ContactMode>, after: &Vec<ContactMode>, x: &mut StateOf<Self>) {
        reset(before, after, &mut x.rate.variables);
    }

    fn impulse(&self, guard: usize, h: f64, before: &Guard, after: &Guard) -> f64 {
        self.0.laws().nth(guard).map_or(0.0, |law| law.normal().impulse(h, before, after))
    }
}

impl<S: Touching> HybridBodies for WithStretches<S> {
    #[inline]
    fn wrenches_in(&self, mode: &Vec<ContactMode>, t: f64, x: &StateOf<Self>, out: &mut RateOf<Self>) {
        self.wrenches_at(mode, t, &x.configuration, &x.rate, out);
    }

    fn add_terms_in(&self, mode: &Vec<ContactMode>, i: usize, terms: &mut Vec<WrenchTerm>) -> bool {
        self.0.add_terms_in(mode, i, terms)
    }
}
