//! Contacts of a body with surfaces, as a force and as a system with modes.

use crate::carrier::Carrier;
use crate::encounters::Encounters;
use crate::error::{ContactError, UntouchableShape, direction, finite};
use crate::event::EventKind;
use crate::laws::{ContactLaw, ContactMode, ContactRate, Encounter, Mobility};
use crate::shape::{Feature, Place, Shape};
use crate::stretches::Touching;
#[cfg(doc)]
use crate::stretches::WithStretches;
use crate::surface::{self, HalfSpace, Surface, SurfaceCore, SurfaceFault, check_slope};
use crate::sweep::{BodySweep, PointSweep};
use crate::touch::{Motion, Touch};
use nalgebra::{UnitQuaternion, Vector3};
use somersault_core::argument::expect_positive;
use somersault_integrators::body::RigidBody;
use somersault_integrators::driver::IntegrateError;
use somersault_integrators::events::{Energy, Guard, Hybrid, HybridBodies, Sweep};
use somersault_integrators::force::{ForceModel, Wrench};
use somersault_integrators::partials::Partials;
use somersault_integrators::series::WrenchTerm;
use somersault_integrators::state::{InBody, Pose, RigidBodyState, State, Twist};
use somersault_integrators::system::{
    Decoder, Fault, FromBody, RigidBodySystem, RigidForms, RigidSystem, System, WorldScratch, euler,
};
use std::sync::Arc;

/// A part of a body that touches a surface under some laws.
///
/// Lengths are in the body frame, from the centre of mass, in m. Contacts may share a surface: clone the
/// `Arc`.
#[derive(Debug, Clone)]
pub struct Contact {
    shape: Shape,
    surface: Arc<dyn Surface>,
    /// The surface itself where it is a half-space, the most common one.
    plane: Option<HalfSpace>,
    /// The core of the surface.
    core: Option<SurfaceCore>,
    law: ContactLaw,
}

impl Contact {
    fn new(shape: Shape, surface: Arc<dyn Surface>, law: ContactLaw) -> Self {
        let (plane, core) = (surface.as_half_space().copied(), surface.core());
        Self { shape, surface, plane, core, law }
    }

    /// A point of the body, a surface and a law.
    pub fn try_new(
        point: Vector3<f64>,
        surface: Arc<dyn Surface>,
        law: impl Into<ContactLaw>,
    ) -> Result<Self, ContactError> {
        Ok(Self::new(Shape::Point(finite("point", point)?), surface, law.into()))
    }

    /// A ball of some centre and radius, against any surface.
    pub fn try_ball(
        centre: Vector3<f64>,
        radius: f64,
        surface: Arc<dyn Surface>,
        law: impl Into<ContactLaw>,
    ) -> Result<Self, ContactError> {
        Ok(Self::new(Shape::try_ball(centre, radius)?, surface, law.into()))
    }

    /// A capsule, by the ends of its segment and its radius, against a sphere or a cylinder that is seen from outside, or another
    /// surface with a [core](Surface::core). With the radius zero it is an edge.
    ///
    /// Against planes, and from inside, only the balls at its ends touch.
    pub fn try_capsule(
        ends: [Vector3<f64>; 2],
        radius: f64,
        surface: Arc<dyn Surface>,
        law: impl Into<ContactLaw>,
    ) -> Result<Self, ContactError> {
        let shape = Shape::try_capsule(ends, radius)?;
        match surface.core() {
            Some(_) => Ok(Self::new(shape, surface, law.into())),
            None => Err(UntouchableShape::CapsuleWithoutCore.into()),
        }
    }

    /// A box, by the lengths of its edges, its centre and how it is turned in the body, against a sphere that is seen from
    /// outside.
    ///
    /// Against planes, and from inside, only its corners touch.
    pub fn try_box(
        size: Vector3<f64>,
        place: (Vector3<f64>, UnitQuaternion<f64>),
        surface: Arc<dyn Surface>,
        law: impl Into<ContactLaw>,
    ) -> Result<Self, ContactError> {
        let shape = Shape::try_box(size, place)?;
        match surface.core() {
            Some(SurfaceCore::Point(_)) => Ok(Self::new(shape, surface, law.into())),
            Some(SurfaceCore::Line(..)) | None => Err(UntouchableShape::BoxWithoutCentre.into()),
        }
    }

    /// The rim of a disk of some centre, axis (of any length but zero) and radius, against a plane.
    pub fn try_rim(
        centre: Vector3<f64>,
        axis: Vector3<f64>,
        radius: f64,
        plane: HalfSpace,
        law: impl Into<ContactLaw>,
    ) -> Result<Self, ContactError> {
        let (centre, axis) = (finite("centre", centre)?, direction("axis", axis)?);
        let shape = Shape::Rim { centre, axis, radius: expect_positive("radius", radius)? };
        Ok(Self::new(shape, Arc::new(plane), law.into()))
    }

    /// What touches.
    pub fn shape(&self) -> &Shape {
        &self.shape
    }

    /// The surface.
    pub fn surface(&self) -> &Arc<dyn Surface> {
        &self.surface
    }

    /// The same against another surface, which must be a plane for a rim, and have the [core](Surface::core) that a capsule or a box
    /// needs.
    #[must_use]
    pub fn against(self, surface: Arc<dyn Surface>) -> Self {
        Self::new(self.shape, surface, self.law)
    }

    /// The laws.
    pub fn law(&self) -> &ContactLaw {
        &self.law
    }

    /// Adds the wrench frozen in a mode as a term: of a point or a ball on a plane under a spring and a damper. False for all others.
    pub(crate) fn add_terms(&self, mode: &ContactMode, terms: &mut Vec<WrenchTerm>) -> bool {
        let (Some(plane), Some(law)) = (&self.plane, self.law.only_compliant()) else { return false };
        let (point, radius) = match self.shape {
            Shape::Point(point) => (point, 0.0),
            // the force on a ball acts through its centre
            Shape::Ball { centre, radius } => (centre, radius),
            Shape::Rim { .. } | Shape::Capsule { .. } | Shape::Box { .. } => return false,
        };
        if !mode.is_open() {
            terms.push(WrenchTerm::Support {
                normal: *plane.normal(),
                offset: plane.offset() + radius,
                point,
                stiffness: law.stiffness(),
                damping: law.damping(),
            });
        }
        true
    }

    #[inline(always)]
    fn place<C: Carrier>(&self, x: &C) -> Place {
        match &self.plane {
            Some(plane) => self.shape.place(None, |point| plane.signed_distance(point), x),
            None => self.place_on_surface(x),
        }
    }

    #[inline(never)]
    fn place_on_surface<C: Carrier>(&self, x: &C) -> Place {
        let distance = |point: &Vector3<f64>| {
            let mut at = self.surface.signed_distance(point);
            if check_slope(self.surface.as_ref(), point, &at.gradient).is_err() {
                // The run ends at the guard, which is asked what is the matter.
                at.distance = f64::NAN;
            }
            at
        };
        self.shape.place(self.core.as_ref(), distance, x)
    }

    /// The arm of the point whose distance from the surface is the gap, but for a radius, and its velocity.
    fn followed<C: Carrier>(&self, x: &C) -> (Vector3<f64>, Vector3<f64>) {
        match &self.core {
            Some(core) => self.shape.nearest_moving((core, &Vector3::zeros()), x),
            None => {
                let arm = x.turned(self.shape.centre());
                (arm, x.velocity_at(&arm))
            }
        }
    }

    /// The part of the shape that is nearest to the surface.
    pub(crate) fn feature<C: Carrier>(&self, x: &C) -> Feature {
        self.core.as_ref().map_or_else(Feature::default, |core| self.shape.feature(core, x))
    }

    /// Whether the shape has parts, of which one is nearest.
    pub(crate) fn has_features(&self) -> bool {
        matches!(self.shape, Shape::Capsule { .. } | Shape::Box { .. }) && self.core.is_some()
    }

    /// Whether the surface is fit to be touched in a state of the body.
    pub fn examine(&self, x: &RigidBodyState) -> Result<(), SurfaceFault> {
        self.examine_on(x)
    }

    /// The same of any carrier.
    pub(crate) fn examine_on<C: Carrier>(&self, x: &C) -> Result<(), SurfaceFault> {
        surface::examine(self.surface.as_ref(), &(x.origin() + self.followed(x).0))
    }

    /// How far the gap may move where the body moves so.
    pub(crate) fn sweep(&self, body: &BodySweep, x: &RigidBodyState) -> Sweep {
        match &self.plane {
            Some(plane) => body.against(&self.shape, plane, x),
            None => body.against(&self.shape, self.surface.as_ref(), x),
        }
    }

    /// The same of the motion of the part that touches.
    pub(crate) fn sweep_of(&self, point: &PointSweep) -> Sweep {
        match &self.plane {
            Some(plane) => point.against(&self.shape, plane),
            None => point.against(&self.shape, self.surface.as_ref()),
        }
    }

    /// The rates of the laws in a mode.
    pub(crate) fn rate_in(&self, mode: &ContactMode, body: &RigidBody, x: &RigidBodyState) -> ContactRate {
        if matches!(mode, ContactMode::Open) {
            return ContactRate::default();
        }
        let (at, arm) = self.meet(body, x);
        self.law.rate(&at, &Mobility::of_body(body, x, &arm, &at.normal))
    }

    /// What the laws see in a state of a body.
    #[inline(always)]
    pub fn encounter(&self, body: &RigidBody, x: &RigidBodyState) -> Encounter {
        self.meet(body, x).0
    }

    /// The encounter and the lever arm of the point of contact.
    #[inline(always)]
    pub(crate) fn meet(&self, body: &RigidBody, x: &RigidBodyState) -> (Encounter, Vector3<f64>) {
        self.meet_on(body.mass(), x)
    }

    /// The same of a carrier of some mass, kg: the arm is from its origin.
    #[inline(always)]
    pub(crate) fn meet_on<C: Carrier>(&self, mass: f64, x: &C) -> (Encounter, Vector3<f64>) {
        let place = self.place(x);
        let velocity = x.velocity_at(&place.arm);
        let rate = place.normal.dot(&velocity);
        let encounter = Encounter {
            gap: place.gap,
            rate,
            normal: place.normal,
            point: x.origin() + place.arm,
            sliding: velocity - place.normal * rate,
            turning: *x.spin(),
            tilting: self.tilting(x, &place.normal),
            mass,
        };
        (encounter, place.arm)
    }

    /// n × ṅ, where friction has a stretch that turns with the plane of contact.
    #[inline]
    fn tilting<C: Carrier>(&self, x: &C, normal: &Vector3<f64>) -> Vector3<f64> {
        if self.plane.is_some() || !self.law.friction().has_stretch() {
            return Vector3::zeros();
        }
        let (arm, velocity) = self.followed(x);
        normal.cross(&(self.surface.hessian(&(x.origin() + arm)) * velocity))
    }

    /// Force, and torque about the centre of mass in the axes of the motion, frozen in a mode.
    #[inline(always)]
    fn wrench_in(&self, mode: &ContactMode, body: &RigidBody, motion: Motion<'_>) -> Wrench {
        if matches!(mode, ContactMode::Open) {
            return Wrench::default();
        }
        if let Some((point, plane)) = self.bare_point() {
            let touch = Touch::new(point, plane, motion);
            let push = self.law.push(touch.gap, touch.rate);
            return Wrench { force: plane.normal() * push, torque: touch.lever * push };
        }
        let Wrench { force, torque } = self.world_wrench_in(mode, body, motion.x);
        Wrench { force, torque: motion.of_world(&torque) }
    }

    /// Force, and torque in world axes, of any shape and law. A call costs little beside them, and a copy in each stage
    /// of each method would be long to compile.
    #[inline(never)]
    fn world_wrench_in(&self, mode: &ContactMode, body: &RigidBody, x: &RigidBodyState) -> Wrench {
        let (at, arm) = self.meet(body, x);
        let effort = self.law.effort_in(mode, &at, &Vector3::zeros());
        about_centre(&arm, &effort)
    }

    /// Point and plane where a point meets a plane and only the push along the normal acts.
    #[inline(always)]
    fn bare_point(&self) -> Option<(&Vector3<f64>, &HalfSpace)> {
        match (&self.shape, &self.plane) {
            (Shape::Point(point), Some(plane)) if self.law.is_only_normal() => Some((point, plane)),
            _ => None,
        }
    }
}

/// The wrench about the centre of mass of an effort at the end of a lever arm.
#[inline]
pub(crate) fn about_centre(arm: &Vector3<f64>, effort: &Wrench) -> Wrench {
    Wrench { force: effort.force, torque: arm.cross(&effort.force) + effort.torque }
}

/// The contacts of a body.
///
/// As a [`ForceModel`] it switches each contact by its state, as the thesis does: that costs any method
/// its order. As part of a [`BodyInContact`] it has modes, one a contact, for runs that locate events
/// ([`Run::locating`](somersault_integrators::run::Run::locating)). Friction with a stretch needs a state that has it,
/// [`WithStretches`]; as a [`ForceModel`] the stretch is zero.
///
/// ```
/// use nalgebra::Vector3;
/// use somersault_contact::event::EventKind;
/// use somersault_contact::laws::compliant::CompliantLaw;
/// use somersault_contact::laws::coulomb::CoulombFriction;
/// use somersault_contact::models::SlidingBlock;
/// use somersault_contact::stretches::WithStretches;
/// use somersault_integrators::driver::TimeGrid;
/// use somersault_integrators::events::Location;
/// use somersault_integrators::methods::Method;
/// use somersault_integrators::run::Run;
///
/// let law = CompliantLaw::from_frequency(1.0, 140.0, 0.2)?;
/// let friction = CoulombFriction::try_new(0.4, 1e4, 200.0)?;
/// let block = SlidingBlock::try_new(1.0, Vector3::new(0.2, 0.1, 0.06), law, friction)?;
/// let system = WithStretches(&block.system);
/// let (start, grid) = (system.unstretched(block.sliding(3.0)), TimeGrid::try_new(0.0, 1.0, 1e-3)?);
/// let run = Run::new(&system, Method::RkmkB, grid).locating(Location::default()).from(&start)?;
/// // It slips, and sticks once it has stopped, after about v/(μ g).
/// assert_eq!(run.events[0].kind, EventKind::Stick);
/// assert!((run.events[0].t - 3.0 / (0.4 * 9.81)).abs() < 1e-2);
/// assert!(run.state.base().velocity().norm() < 1e-6);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// With n contacts, guard i is that of contact i and, where some friction has modes, guard n + i that of its
/// friction.
#[derive(Debug, Clone, Default)]
pub struct Contacts {
    contacts: Vec<Contact>,
    friction_has_modes: bool,
}

impl Contacts {
    /// The contacts in the order that events count them.
    pub fn new(contacts: Vec<Contact>) -> Self {
        let friction_has_modes = contacts.iter().any(|c| c.law.friction().has_modes());
        Self { contacts, friction_has_modes }
    }

    /// The contact that a guard belongs to.
    pub fn of_guard(&self, guard: usize) -> usize {
        guard % self.contacts.len().max(1)
    }

    /// Energy of the springs of the normal laws, J; Σ ½ k min(Δx, 0)² for compliant ones.
    pub fn energy(&self, x: &RigidBodyState) -> f64 {
        self.contacts.iter().map(|c| c.law.normal_energy(c.place(x).gap)).sum()
    }
}

impl Contacts {
    /// The sweeps of all gaps, between two states of a body h apart, under forces that are smooth.
    pub(crate) fn sweeps<F: ForceModel>(
        &self,
        modes: &[ContactMode],
        (body, forces): (&RigidBody, &F),
        h: f64,
        ends: (&RigidBodyState, &RigidBodyState),
        out: &mut Vec<Sweep>,
    ) {
        let sweep = BodySweep::between(body, forces, ends, h, is_free(modes));
        out.extend(self.contacts.iter().map(|contact| contact.sweep(&sweep, ends.0)));
    }

    /// For how long no contact can close.
    pub(crate) fn clear_time<F: ForceModel>(
        &self,
        modes: &[ContactMode],
        (body, forces): (&RigidBody, &F),
        x: &RigidBodyState,
        guards: &[Guard],
        horizon: f64,
    ) -> f64 {
        if !is_free(modes) {
            return 0.0;
        }
        let Some(sweep) = BodySweep::ahead(body, forces, x, horizon) else { return 0.0 };
        let times = self.contacts.iter().zip(guards);
        times.fold(horizon, |least, (c, guard)| least.min(c.sweep(&sweep, x).clear_time(guard.gap)))
    }

    /// Upper bound of |λ| of the contacts closed, 1/s.
    pub(crate) fn rate(&self, modes: &[ContactMode], body: &RigidBody, x: &RigidBodyState) -> f64 {
        self.contacts.iter().zip(modes).map(|(c, mode)| c.rate_in(mode, body, x)).sum::<ContactRate>().bound()
    }

    /// The energy of a body, its springs in contact and its forces.
    pub(crate) fn total_energy<F: ForceModel>(
        &self,
        (body, forces): (&RigidBody, &F),
        x: &RigidBodyState,
    ) -> Option<Energy> {
        let potential = forces.potential(body, x)?;
        Some(Energy { kinetic: body.kinetic_energy(x), springs: self.energy(x), potential })
    }
}

/// Whether no contact is closed.
pub(crate) fn is_free(modes: &[ContactMode]) -> bool {
    modes.iter().all(|mode| matches!(mode, ContactMode::Open))
}

impl std::ops::Deref for Contacts {
    type Target = [Contact];
    fn deref(&self) -> &[Contact] {
        &self.contacts
    }
}

impl ForceModel for Contacts {
    #[inline]
    fn wrench(&self, _: f64, body: &RigidBody, x: &RigidBodyState) -> Wrench {
        let mut sum = Wrench::default();
        for contact in &self.contacts {
            let mode = contact.law.mode(&contact.encounter(body, x), &Vector3::zeros());
            sum = sum + contact.wrench_in(&mode, body, Motion::in_world(x));
        }
        sum
    }
    fn is_free(&self) -> bool {
        self.contacts.is_empty()
    }
    fn is_torque_free(&self) -> bool {
        self.contacts.iter().all(|contact| match contact.shape {
            Shape::Point(point) => point == Vector3::zeros() && contact.law.resistance().is_none(),
            // the normal force of a ball acts through its centre
            Shape::Ball { centre, .. } => centre == Vector3::zeros() && contact.law.is_only_normal(),
            Shape::Rim { .. } | Shape::Capsule { .. } | Shape::Box { .. } => false,
        })
    }
    fn depends_on_velocity(&self) -> bool {
        self.contacts.iter().any(|c| c.law.depends_on_velocity())
    }
}

/// A rigid body under forces `F`, smooth along a trajectory, and contacts.
///
/// As a [`System`] in its own right it switches each contact by its state, as [`Contacts`] do.
#[derive(Debug, Clone)]
pub struct BodyInContact<F>(pub RigidBodySystem<(F, Contacts)>);

impl<F: ForceModel> BodyInContact<F> {
    /// A body, and the forces and contacts on it.
    pub fn new(body: RigidBody, forces: (F, Contacts)) -> Self {
        Self(RigidBodySystem::new(body, forces))
    }
}

impl<F> std::ops::Deref for BodyInContact<F> {
    type Target = RigidBodySystem<(F, Contacts)>;
    #[inline(always)]
    fn deref(&self) -> &Self::Target {
        &self.0
    }
}

#[deny(clippy::missing_trait_methods)]
impl<F: ForceModel> System for BodyInContact<F> {
    type Configuration = Pose;
    type Forms = RigidForms;
    type Workspace = ();
    fn workspace(&self) {}
    #[inline(always)]
    fn velocity(&self, w: &mut (), t: f64, x: &RigidBodyState, out: &mut Twist) {
        self.0.velocity(w, t, x, out);
    }
    #[inline(always)]
    fn acceleration(&self, w: &mut (), t: f64, x: &RigidBodyState, out: &mut Twist) {
        self.0.acceleration(w, t, x, out);
    }
    fn partials(&self, w: &mut (), t: f64, x: &RigidBodyState, out: &mut Partials<Pose>) {
        self.0.partials(w, t, x, out);
    }
    fn next_stop(&self, t: f64, end: f64) -> Option<f64> {
        self.0.next_stop(t, end)
    }
    #[inline(always)]
    fn depends_on_configuration(&self) -> bool {
        self.0.depends_on_configuration()
    }
    fn take_fault(&self) -> Option<Fault> {
        self.0.take_fault()
    }
}

#[deny(clippy::missing_trait_methods)]
impl<F: ForceModel> RigidSystem for BodyInContact<F> {
    #[inline(always)]
    fn body(&self, i: usize) -> &RigidBody {
        self.0.body(i)
    }
    fn rest(&self) -> RigidBodyState {
        self.0.rest()
    }
    #[inline(always)]
    fn wrenches(&self, t: f64, x: &RigidBodyState, out: &mut Twist) {
        self.0.wrenches(t, x, out);
    }
    #[inline(always)]
    fn body_wrenches(
        &self,
        t: f64,
        x: &State<InBody<Pose>>,
        world: &mut WorldScratch<Self>,
        out: &mut InBody<Twist>,
    ) {
        self.0.body_wrenches(t, x, world, out);
    }
    fn add_terms(&self, i: usize, terms: &mut Vec<WrenchTerm>) -> bool {
        self.0.add_terms(i, terms)
    }
    #[inline(always)]
    fn is_free(&self) -> bool {
        self.0.is_free()
    }
    #[inline(always)]
    fn is_torque_free(&self) -> bool {
        self.0.is_torque_free()
    }
    #[inline(always)]
    fn depends_on_velocity(&self) -> bool {
        self.0.depends_on_velocity()
    }
}

/// Refuses friction with a stretch, for which a state of poses and rates alone has no place.
pub(crate) fn without_stretch<'a>(
    laws: impl IntoIterator<Item = &'a ContactLaw>,
) -> Result<(), IntegrateError> {
    if laws.into_iter().any(|law| law.friction().has_stretch()) {
        return Err(IntegrateError::Variables { remedy: "integrate the system in `WithStretches`" });
    }
    Ok(())
}

/// Force, and torque about the centre of mass in the axes of the motion, with contacts frozen in their modes.
#[inline(always)]
fn wrench_in<F: ForceModel>(
    system: &BodyInContact<F>,
    modes: &[ContactMode],
    t: f64,
    motion: Motion<'_>,
) -> Wrench {
    let (smooth, contacts) = &system.forces;
    let mut sum = smooth.wrench(t, &system.body, motion.x);
    if !smooth.is_torque_free() {
        sum.torque = motion.of_world(&sum.torque);
    }
    for (contact, mode) in contacts.iter().zip(modes) {
        sum = sum + contact.wrench_in(mode, &system.body, motion);
    }
    sum
}

impl<F: ForceModel> Hybrid for BodyInContact<F> {
    type Mode = Vec<ContactMode>;
    type Kind = EventKind;
    type Fault = SurfaceFault;

    fn check(&self) -> Result<(), IntegrateError> {
        without_stretch(self.forces.1.iter().map(Contact::law))
    }

    fn mode(&self, _: f64, x: &RigidBodyState) -> Vec<ContactMode> {
        let none = Vector3::zeros();
        self.forces.1.iter().map(|c| c.law.mode(&c.encounter(&self.body, x), &none)).collect()
    }

    fn next_mode(&self, before: &Vec<ContactMode>, _: f64, x: &RigidBodyState) -> Vec<ContactMode> {
        let contacts = self.forces.1.iter().zip(before);
        let none = Vector3::zeros();
        contacts.map(|(c, before)| c.law.next_mode(before, &c.encounter(&self.body, x), &none)).collect()
    }

    fn event_kind(
        &self,
        guard: usize,
        before: &Guard,
        after: &Guard,
        _: (&Vec<ContactMode>, &Vec<ContactMode>),
    ) -> EventKind {
        EventKind::of_guard(self.forces.1.len(), guard, before, after)
    }

    #[inline]
    fn guards(&self, mode: &Vec<ContactMode>, _: f64, x: &RigidBodyState, out: &mut Vec<Guard>) {
        let contacts = &self.forces.1;
        let n = contacts.len();
        out.resize(if contacts.friction_has_modes { 2 * n } else { n }, Guard::default());
        for (i, (contact, mode)) in contacts.iter().zip(mode).enumerate() {
            let at = contact.encounter(&self.body, x);
            out[i] = contact.law.guard(&at);
            if contacts.friction_has_modes {
                // A copy, so that without friction the encounter need not be in memory.
                let seen = at;
                out[n + i] = contact.law.friction_guard(mode, &seen, &Vector3::zeros());
            }
        }
    }

    fn sweeps(
        &self,
        mode: &Vec<ContactMode>,
        _: f64,
        h: f64,
        ends: (&RigidBodyState, &RigidBodyState),
        out: &mut Vec<Sweep>,
    ) {
        self.forces.1.sweeps(mode, (&self.body, &self.forces.0), h, ends, out);
    }

    fn clear_time(
        &self,
        mode: &Vec<ContactMode>,
        _: f64,
        x: &RigidBodyState,
        guards: &[Guard],
        horizon: f64,
    ) -> f64 {
        self.forces.1.clear_time(mode, (&self.body, &self.forces.0), x, guards, horizon)
    }

    fn examine(&self, guard: usize, x: &RigidBodyState) -> Result<(), SurfaceFault> {
        self.forces.1.get(guard).map_or(Ok(()), |contact| contact.examine(x))
    }

    fn stiffest_rate(&self, mode: &Vec<ContactMode>, x: &RigidBodyState) -> f64 {
        self.forces.1.rate(mode, &self.body, x)
    }

    fn energy(&self, x: &RigidBodyState) -> Option<Energy> {
        self.forces.1.total_energy((&self.body, &self.forces.0), x)
    }

    #[inline(always)]
    fn acceleration_in(
        &self,
        mode: &Vec<ContactMode>,
        (): &mut (),
        t: f64,
        x: &RigidBodyState,
        out: &mut Twist,
    ) {
        let r = x.orientation().to_rotation_matrix().into_inner();
        let omega = r.tr_mul(x.angular_velocity());
        let wrench = wrench_in(self, mode, t, Motion::in_body(x, &omega));
        let angular = euler(&self.body, &omega, &wrench.torque);
        *out = Twist { linear: wrench.force / self.body.mass(), angular: r * angular };
    }

    fn impulse(&self, guard: usize, h: f64, before: &Guard, after: &Guard) -> f64 {
        self.forces.1.get(guard).map_or(0.0, |c| c.law.normal().impulse(h, before, after))
    }
}

impl<F: ForceModel> Encounters<Pose> for BodyInContact<F> {
    fn laws(&self) -> impl Iterator<Item = &ContactLaw> {
        self.forces.1.iter().map(Contact::law)
    }

    #[inline]
    fn each_encounter(&self, q: &Pose, p: &Twist, mut see: impl FnMut(usize, &ContactLaw, &Encounter)) {
        let x = State { configuration: *q, rate: *p };
        for (i, contact) in self.forces.1.iter().enumerate() {
            see(i, &contact.law, &contact.encounter(&self.body, &x));
        }
    }
}

impl<F: ForceModel> Touching for BodyInContact<F> {
    #[inline]
    fn wrenches_by(
        &self,
        t: f64,
        (q, p): (&Pose, &Twist),
        mut effort: impl FnMut(usize, &ContactLaw, &Encounter) -> Wrench,
        out: &mut Twist,
    ) {
        let x = State { configuration: *q, rate: *p };
        let (smooth, contacts) = &self.forces;
        let mut sum = smooth.wrench(t, &self.body, &x);
        for (i, contact) in contacts.iter().enumerate() {
            let (at, arm) = contact.meet(&self.body, &x);
            sum = sum + about_centre(&arm, &effort(i, &contact.law, &at));
        }
        *out = Twist { linear: sum.force, angular: sum.torque };
    }
}

impl<F: ForceModel> HybridBodies for BodyInContact<F> {
    #[inline(always)]
    fn wrenches_in(&self, mode: &Vec<ContactMode>, t: f64, x: &RigidBodyState, out: &mut Twist) {
        let wrench = wrench_in(self, mode, t, Motion::in_world(x));
        *out = Twist { linear: wrench.force, angular: wrench.torque };
    }

    #[inline(always)]
    fn body_wrenches_in(
        &self,
        mode: &Vec<ContactMode>,
        t: f64,
        x: &State<InBody<Pose>>,
        _: &mut WorldScratch<Self>,
        out: &mut InBody<Twist>,
    ) {
        let mut world = RigidBodyState::default();
        FromBody.decode(x, &mut world);
        let wrench = wrench_in(self, mode, t, Motion::in_body(&world, &x.rate.0.angular));
        *out = InBody(Twist { linear: wrench.force, angular: wrench.torque });
    }

    fn add_terms_in(&self, mode: &Vec<ContactMode>, _: usize, terms: &mut Vec<WrenchTerm>) -> bool {
        let (smooth, contacts) = &self.forces;
        let mut contacts = contacts.iter().zip(mode);
        smooth.add_terms(&self.body, terms) && contacts.all(|(contact, mode)| contact.add_terms(mode, terms))
    }
}
