//! Contacts of several bodies, with surfaces and with each other.

use crate::carrier::Carrier;
use crate::contacts::{Contact, about_centre, is_free, without_stretch};
use crate::encounters::Encounters;
use crate::error::ContactError;
use crate::event::EventKind;
use crate::laws::{ContactLaw, ContactMode, ContactRate, Encounter, Mobility};
use crate::shape::{Feature, Shape, feature_of_segments, nearest_of_segments};
use crate::stretches::Touching;
use crate::surface::{SurfaceCore, SurfaceFault};
use crate::sweep::BodySweep;
use nalgebra::{UnitQuaternion, Vector3};
use somersault_core::argument::expect_positive;
use somersault_integrators::body::RigidBody;
use somersault_integrators::driver::IntegrateError;
use somersault_integrators::events::{Energy, Guard, Hybrid, HybridBodies, Sweep};
use somersault_integrators::force::{ForceModel, Wrench};
use somersault_integrators::partials::Partials;
use somersault_integrators::series::WrenchTerm;
use somersault_integrators::state::{Pose, RigidBodyState, State, Twist};
use somersault_integrators::system::{
    BodyPoses, BodyRate, CountMismatch, Fault, Interaction, RigidBodiesSystem, RigidForms, RigidSystem,
    System, WorldScratch, world_acceleration,
};
use somersault_multibody::geometry::GeometryShape;

/// A sphere fixed on a body, or a capsule or a box.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BodySphere {
    body: usize,
    shape: Shape,
}

impl BodySphere {
    pub(crate) fn body(&self) -> usize {
        self.body
    }

    pub(crate) fn centre(&self) -> &Vector3<f64> {
        self.shape.centre()
    }

    pub(crate) fn radius(&self) -> f64 {
        self.shape.radius()
    }

    /// The shape.
    pub fn shape(&self) -> &Shape {
        &self.shape
    }

    /// The body's index, and centre (body frame, from the centre of mass; of a link from the origin of its frame) and
    /// radius, m.
    pub fn try_new(body: usize, centre: Vector3<f64>, radius: f64) -> Result<Self, ContactError> {
        Ok(Self { body, shape: Shape::try_ball(centre, radius)? })
    }

    /// A sphere, a capsule or a box at a place of a body: its centre and how it is turned, axes of symmetry along z.
    pub fn of_shape(
        body: usize,
        shape: &GeometryShape,
        (centre, orientation): (Vector3<f64>, UnitQuaternion<f64>),
    ) -> Result<Self, ContactError> {
        let shape = match shape {
            GeometryShape::Sphere { radius } => Shape::try_ball(centre, *radius)?,
            GeometryShape::Capsule { radius, length } => {
                let half = orientation * (Vector3::z() * (0.5 * expect_positive("length", *length)?));
                Shape::try_capsule([centre - half, centre + half], expect_positive("radius", *radius)?)?
            }
            GeometryShape::Box { size } => Shape::try_box(*size, (centre, orientation))?,
            GeometryShape::Cylinder { .. } | GeometryShape::Ellipsoid { .. } | GeometryShape::Mesh { .. } => {
                return Err(ContactError::Pair);
            }
        };
        Ok(Self { body, shape })
    }

    /// The same on another body.
    pub(crate) fn on(self, body: usize) -> Self {
        Self { body, ..self }
    }
}

/// Two spheres on two bodies that touch under some laws, or a sphere and a capsule or a box, or two capsules.
///
/// The force acts at one point, on the line of the centres where the radii divide it, on one body as on the
/// other, so that neither momentum nor angular momentum arises from it. For a capsule or a box the centre is its point nearest to the
/// other shape: gap, normal and arms are continuous, and their rates jump where that point passes from a face to an edge, or to the
/// end of a segment. The nearest points of two parallel capsules are not unique.
#[derive(Debug, Clone, PartialEq)]
pub struct SpherePair {
    spheres: [BodySphere; 2],
    law: ContactLaw,
}

impl SpherePair {
    /// Two spheres on different bodies and a law.
    pub fn try_new(
        first: BodySphere,
        second: BodySphere,
        law: impl Into<ContactLaw>,
    ) -> Result<Self, ContactError> {
        if first.body == second.body {
            return Err(ContactError::SameBody { body: first.body });
        }
        match (&first.shape, &second.shape) {
            (Shape::Ball { .. }, Shape::Ball { .. } | Shape::Capsule { .. } | Shape::Box { .. })
            | (Shape::Capsule { .. } | Shape::Box { .. }, Shape::Ball { .. }) => {}
            (Shape::Capsule { radius: a, .. }, Shape::Capsule { radius: b, .. }) if a + b > 0.0 => {}
            (Shape::Point(_) | Shape::Rim { .. }, _)
            | (_, Shape::Point(_) | Shape::Rim { .. })
            | (Shape::Capsule { .. } | Shape::Box { .. }, Shape::Capsule { .. } | Shape::Box { .. }) => {
                return Err(ContactError::Pair);
            }
        }
        Ok(Self { spheres: [first, second], law: law.into() })
    }

    /// The encounter of the first sphere with the second, and the lever arms of the point of contact.
    fn meet(&self, bodies: &[RigidBody], (q, p): Moving<'_>) -> (Encounter, [Vector3<f64>; 2]) {
        let [a, b] = self.spheres.each_ref().map(|sphere| sphere.body);
        self.meet_on([(&q[a], &p[a]), (&q[b], &p[b])], [bodies[a].mass(), bodies[b].mass()])
    }

    /// The same on two carriers of some masses, kg.
    ///
    /// The plane of contact turns with the line of the centres, and about it at the mean of the two spins.
    pub(crate) fn meet_on<C: Carrier>(
        &self,
        carriers: [C; 2],
        masses: [f64; 2],
    ) -> (Encounter, [Vector3<f64>; 2]) {
        let ([a, b], [on_a, on_b]) = (&self.spheres, &carriers);
        let [(arm_a, of_a), (arm_b, of_b)] = self.centres([on_a, on_b]);
        let span = (on_a.origin() - on_b.origin()) + (arm_a - arm_b);
        let distance = span.norm();
        let (of_first, of_second) = (a.radius(), b.radius());
        let total = of_first + of_second;
        // Spheres with one centre have no normal; zero is harmless.
        let normal = if distance > 0.0 { span / distance } else { Vector3::zeros() };
        let arms = [arm_a - span * (of_first / total), arm_b + span * (of_second / total)];
        let velocity = on_a.velocity_at(&arms[0]) - on_b.velocity_at(&arms[1]);
        let rate = normal.dot(&velocity);
        let [m_a, m_b] = masses;
        let encounter = Encounter {
            gap: distance - total,
            rate,
            normal,
            point: on_a.origin() + arms[0],
            sliding: velocity - normal * rate,
            turning: on_a.spin() - on_b.spin(),
            tilting: if self.law.friction().has_stretch() && distance > 0.0 {
                let spin = 0.5 * normal.dot(&(on_a.spin() + on_b.spin()));
                normal.cross(&(of_a - of_b)) / distance + normal * spin
            } else {
                Vector3::zeros()
            },
            mass: m_a / (1.0 + m_a / m_b),
        };
        (encounter, arms)
    }
}

/// The contacts of several bodies: with surfaces, and of pairs of spheres.
///
/// Guards and modes count the contacts with surfaces first, then the pairs; as in
/// [`Contacts`](crate::contacts::Contacts) the guards of friction follow where some friction has modes.
#[derive(Debug, Clone)]
pub struct BodyContacts {
    bodies: usize,
    on_surfaces: Vec<(usize, Contact)>,
    pairs: Vec<SpherePair>,
    friction_has_modes: bool,
}

impl BodyContacts {
    /// Contacts of `bodies` bodies: with surfaces, each with the index of its body, and of pairs of spheres.
    pub fn try_new(
        bodies: usize,
        on_surfaces: Vec<(usize, Contact)>,
        pairs: Vec<SpherePair>,
    ) -> Result<Self, ContactError> {
        let of_surfaces = on_surfaces.iter().map(|(body, _)| ("on_surfaces", *body));
        let of_pairs = pairs.iter().flat_map(|p| p.spheres.map(|s| ("pairs", s.body)));
        if let Some((argument, found)) = of_surfaces.chain(of_pairs).find(|(_, body)| *body >= bodies) {
            return Err(ContactError::NoBody { argument, found, bodies });
        }
        let friction_has_modes = on_surfaces.iter().any(|(_, c)| c.law().friction().has_modes())
            || pairs.iter().any(|p| p.law.friction().has_modes());
        Ok(Self { bodies, on_surfaces, pairs, friction_has_modes })
    }

    /// Number of contacts.
    pub fn len(&self) -> usize {
        self.on_surfaces.len() + self.pairs.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The laws of the contacts, in their order.
    pub fn laws(&self) -> impl Iterator<Item = &ContactLaw> {
        self.parts().map(|part| part.law())
    }

    /// The contacts in their order.
    #[inline]
    pub(crate) fn parts(&self) -> impl Iterator<Item = Part<'_>> {
        let of_surfaces = self.on_surfaces.iter().map(|(body, contact)| Part::Surface(*body, contact));
        of_surfaces.chain(self.pairs.iter().map(Part::Pair))
    }

    /// Law and encounter of each contact in a state.
    fn encounters(
        &self,
        bodies: &[RigidBody],
        x: Moving<'_>,
    ) -> impl Iterator<Item = (&ContactLaw, Encounter)> {
        self.parts().map(move |part| (part.law(), part.meet_of(bodies, x).0))
    }

    /// Energy of the springs of the normal laws, J.
    pub fn energy(&self, bodies: &[RigidBody], x: &State<Vec<Pose>>) -> f64 {
        self.encounters(bodies, moving(x)).map(|(law, at)| law.normal_energy(at.gap)).sum()
    }

    /// Adds the wrenches of all contacts, each by the effort that `effort` gives it by its number and encounter.
    fn add_wrenches_by(
        &self,
        mut effort: impl FnMut(usize, &ContactLaw, &Encounter) -> Wrench,
        bodies: &[RigidBody],
        x: Moving<'_>,
        out: &mut [Twist],
    ) {
        for (i, part) in self.parts().enumerate() {
            let (at, hold) = part.meet_of(bodies, x);
            hold.press(&effort(i, part.law(), &at), |body, wrench| {
                out[body].linear += wrench.force;
                out[body].angular += wrench.torque;
            });
        }
    }
}

/// A contact: of a body with a surface, or of two bodies.
pub(crate) enum Part<'a> {
    /// The body and its contact.
    Surface(usize, &'a Contact),
    /// Two spheres.
    Pair(&'a SpherePair),
}

/// On what a contact acts: bodies, and the arms from their origins to the point of contact, world frame.
pub(crate) struct Hold {
    pub(crate) first: (usize, Vector3<f64>),
    pub(crate) second: Option<(usize, Vector3<f64>)>,
}

impl Hold {
    /// The encounter of a contact of body `first` with a surface, and on what it acts, where the body of some mass is carried so.
    #[inline(always)]
    pub(crate) fn on_surface<C: Carrier>(
        (first, contact): (usize, &Contact),
        mass: f64,
        carrier: &C,
    ) -> (Encounter, Self) {
        let (at, arm) = contact.meet_on(mass, carrier);
        (at, Self { first: (first, arm), second: None })
    }

    /// Shows the wrench about the origin of each body that an effort on the first one makes.
    #[inline]
    pub(crate) fn press(&self, effort: &Wrench, mut add: impl FnMut(usize, Wrench)) {
        let (body, arm) = &self.first;
        add(*body, about_centre(arm, effort));
        if let Some((body, arm)) = &self.second {
            let wrench = about_centre(arm, effort);
            add(*body, Wrench { force: -wrench.force, torque: -wrench.torque });
        }
    }
}

impl<'a> Part<'a> {
    #[inline]
    pub(crate) fn law(&self) -> &'a ContactLaw {
        match self {
            Self::Surface(_, contact) => contact.law(),
            Self::Pair(pair) => &pair.law,
        }
    }

    /// The encounter, and on what it acts, where the bodies are carried so and have such masses.
    #[inline]
    pub(crate) fn meet<C: Carrier>(
        &self,
        carrier: impl Fn(usize) -> C,
        mass: impl Fn(usize) -> f64,
    ) -> (Encounter, Hold) {
        match self {
            Self::Surface(body, contact) => Hold::on_surface((*body, contact), mass(*body), &carrier(*body)),
            Self::Pair(pair) => {
                let [a, b] = pair.spheres.each_ref().map(|sphere| sphere.body);
                let (at, [arm_a, arm_b]) = pair.meet_on([a, b].map(&carrier), [a, b].map(mass));
                (at, Hold { first: (a, arm_a), second: Some((b, arm_b)) })
            }
        }
    }

    /// The parts of its shapes that are nearest, where the bodies are carried so.
    pub(crate) fn feature<C: Carrier>(&self, carrier: impl Fn(usize) -> C) -> Feature {
        match self {
            Self::Surface(body, contact) => contact.feature(&carrier(*body)),
            Self::Pair(pair) => {
                let [a, b] = pair.spheres.each_ref().map(|sphere| carrier(sphere.body));
                pair.feature([&a, &b])
            }
        }
    }

    /// Whether a shape has parts.
    pub(crate) fn has_features(&self) -> bool {
        match self {
            Self::Surface(_, contact) => contact.has_features(),
            Self::Pair(pair) => !pair.is_of_balls(),
        }
    }

    /// The same of bodies in a state.
    #[inline]
    fn meet_of(&self, bodies: &[RigidBody], (q, p): Moving<'_>) -> (Encounter, Hold) {
        self.meet(|i| (&q[i], &p[i]), |i| bodies[i].mass())
    }
}

impl SpherePair {
    /// The laws under which they touch.
    pub(crate) fn law(&self) -> &ContactLaw {
        &self.law
    }

    /// The two spheres.
    pub(crate) fn spheres(&self) -> &[BodySphere; 2] {
        &self.spheres
    }

    /// Whether both are spheres.
    pub(crate) fn is_of_balls(&self) -> bool {
        self.spheres.iter().all(|sphere| !sphere.shape.is_extended())
    }

    /// The arms of the centres of two spheres and their velocities; for a capsule or a box those of its point nearest to the other
    /// shape.
    fn centres<C: Carrier>(&self, carriers: [&C; 2]) -> [(Vector3<f64>, Vector3<f64>); 2] {
        let [a, b] = self.spheres.each_ref().map(|sphere| &sphere.shape);
        let [on_a, on_b] = carriers;
        let centre = |shape: &Shape, on: &C| {
            let arm = on.turned(shape.centre());
            (arm, on.velocity_at(&arm))
        };
        let next_to = |(arm, velocity): &(Vector3<f64>, Vector3<f64>), on: &C| {
            (SurfaceCore::Point(on.origin() + arm), *velocity)
        };
        match (a, b) {
            (
                Shape::Capsule { centre: centre_a, half: half_a, .. },
                Shape::Capsule { centre: centre_b, half: half_b, .. },
            ) => nearest_of_segments([(centre_a, half_a), (centre_b, half_b)], carriers),
            (Shape::Capsule { .. } | Shape::Box { .. }, _) => {
                let of_b = centre(b, on_b);
                let (core, velocity) = next_to(&of_b, on_b);
                [a.nearest_moving((&core, &velocity), on_a), of_b]
            }
            (_, Shape::Capsule { .. } | Shape::Box { .. }) => {
                let of_a = centre(a, on_a);
                let (core, velocity) = next_to(&of_a, on_a);
                [of_a, b.nearest_moving((&core, &velocity), on_b)]
            }
            _ => [centre(a, on_a), centre(b, on_b)],
        }
    }

    /// The parts of the two shapes that are nearest to each other.
    fn feature<C: Carrier>(&self, carriers: [&C; 2]) -> Feature {
        let [a, b] = self.spheres.each_ref().map(|sphere| &sphere.shape);
        let [on_a, on_b] = carriers;
        let centre = |shape: &Shape, on: &C| SurfaceCore::Point(on.origin() + on.turned(shape.centre()));
        match (a, b) {
            (
                Shape::Capsule { centre: centre_a, half: half_a, .. },
                Shape::Capsule { centre: centre_b, half: half_b, .. },
            ) => feature_of_segments([(centre_a, half_a), (centre_b, half_b)], carriers),
            (Shape::Capsule { .. } | Shape::Box { .. }, _) => a.feature(&centre(b, on_b), on_a),
            (Shape::Point(_) | Shape::Ball { .. } | Shape::Rim { .. }, _) => {
                b.feature(&centre(a, on_a), on_b)
            }
        }
    }

    /// How far the gap may move where the bodies move so.
    fn sweep(&self, sweep: &impl Fn(usize) -> BodySweep) -> Sweep {
        let [a, b] = &self.spheres;
        BodySweep::of_pair([&sweep(a.body), &sweep(b.body)], [&a.shape, &b.shape])
    }

    /// Whether the spheres have a normal.
    fn examine(&self, bodies: &[RigidBody], x: &State<Vec<Pose>>) -> Result<(), SurfaceFault> {
        Self::examine_at(&self.meet(bodies, moving(x)).0)
    }

    /// The same of an encounter.
    pub(crate) fn examine_at(at: &Encounter) -> Result<(), SurfaceFault> {
        if at.normal == Vector3::zeros() {
            return Err(SurfaceFault::Concentric { point: at.point.into() });
        }
        Ok(())
    }

    /// The rates of the laws in a mode.
    fn rate_in(&self, mode: &ContactMode, bodies: &[RigidBody], x: &State<Vec<Pose>>) -> ContactRate {
        if matches!(mode, ContactMode::Open) {
            return ContactRate::default();
        }
        let (at, arms) = self.meet(bodies, moving(x));
        let [first, second] = [0, 1].map(|i| {
            let body = self.spheres[i].body;
            Mobility::of_body(&bodies[body], &state(moving(x), body), &arms[i], &at.normal)
        });
        self.law.rate(&at, &(first + second))
    }
}

impl BodyContacts {
    /// The sweep of each gap where the bodies move as `sweep` says.
    fn gap_sweeps(
        &self,
        x: &State<Vec<Pose>>,
        sweep: &impl Fn(usize) -> BodySweep,
    ) -> impl Iterator<Item = Sweep> {
        let of_surfaces =
            self.on_surfaces.iter().map(|(body, c)| c.sweep(&sweep(*body), &state(moving(x), *body)));
        of_surfaces.chain(self.pairs.iter().map(move |pair| pair.sweep(sweep)))
    }
}

/// Poses of bodies and their rates.
type Moving<'a> = (&'a [Pose], &'a [Twist]);

fn moving(x: &State<Vec<Pose>>) -> Moving<'_> {
    (&x.configuration, &x.rate)
}

fn state((q, p): Moving<'_>, body: usize) -> RigidBodyState {
    State { configuration: q[body], rate: p[body] }
}

/// Without modes: each contact switches by its state, which costs any method its order.
impl Interaction for BodyContacts {
    fn add_wrenches(&self, _: f64, bodies: &[RigidBody], x: &State<Vec<Pose>>, out: &mut [Twist]) {
        let none = Vector3::zeros();
        let effort = |_, law: &ContactLaw, at: &Encounter| law.effort_in(&law.mode(at, &none), at, &none);
        self.add_wrenches_by(effort, bodies, moving(x), out);
    }
    fn is_none(&self) -> bool {
        self.is_empty()
    }
    fn bodies(&self) -> Option<usize> {
        Some(self.bodies)
    }
    fn depends_on_velocity(&self) -> bool {
        self.on_surfaces.iter().any(|(_, c)| c.law().depends_on_velocity())
            || self.pairs.iter().any(|p| p.law.depends_on_velocity())
    }
}

/// Several rigid bodies, each under forces `F`, smooth along a trajectory, and their contacts.
///
/// As a [`System`] in its own right it switches each contact by its state, as [`BodyContacts`] do.
#[derive(Debug, Clone)]
pub struct BodiesInContact<F>(pub RigidBodiesSystem<F, BodyContacts>);

impl<F: ForceModel> BodiesInContact<F> {
    /// Bodies, the force model of each, and their contacts.
    pub fn try_new(
        bodies: Vec<RigidBody>,
        forces: Vec<F>,
        contacts: BodyContacts,
    ) -> Result<Self, CountMismatch> {
        RigidBodiesSystem::try_new(bodies, forces, contacts).map(Self)
    }
}

impl<F> std::ops::Deref for BodiesInContact<F> {
    type Target = RigidBodiesSystem<F, BodyContacts>;
    #[inline(always)]
    fn deref(&self) -> &Self::Target {
        &self.0
    }
}

#[deny(clippy::missing_trait_methods)]
impl<F: ForceModel> System for BodiesInContact<F> {
    type Configuration = Vec<Pose>;
    type Forms = RigidForms;
    type Workspace = Vec<Twist>;
    fn workspace(&self) -> Vec<Twist> {
        self.0.workspace()
    }
    fn velocity(&self, w: &mut Vec<Twist>, t: f64, x: &State<Vec<Pose>>, out: &mut Vec<Twist>) {
        self.0.velocity(w, t, x, out);
    }
    fn acceleration(&self, w: &mut Vec<Twist>, t: f64, x: &State<Vec<Pose>>, out: &mut Vec<Twist>) {
        self.0.acceleration(w, t, x, out);
    }
    fn partials(&self, w: &mut Vec<Twist>, t: f64, x: &State<Vec<Pose>>, out: &mut Partials<Vec<Pose>>) {
        self.0.partials(w, t, x, out);
    }
    fn next_stop(&self, t: f64, end: f64) -> Option<f64> {
        self.0.next_stop(t, end)
    }
    fn depends_on_configuration(&self) -> bool {
        self.0.depends_on_configuration()
    }
    fn take_fault(&self) -> Option<Fault> {
        self.0.take_fault()
    }
}

#[deny(clippy::missing_trait_methods)]
impl<F: ForceModel> RigidSystem for BodiesInContact<F> {
    fn body(&self, i: usize) -> &RigidBody {
        self.0.body(i)
    }
    fn rest(&self) -> State<Vec<Pose>> {
        self.0.rest()
    }
    fn wrenches(&self, t: f64, x: &State<Vec<Pose>>, out: &mut Vec<Twist>) {
        self.0.wrenches(t, x, out);
    }
    fn body_wrenches(
        &self,
        t: f64,
        x: &State<BodyPoses<Self>>,
        world: &mut WorldScratch<Self>,
        out: &mut BodyRate<Self>,
    ) {
        self.0.body_wrenches(t, x, world, out);
    }
    fn add_terms(&self, i: usize, terms: &mut Vec<WrenchTerm>) -> bool {
        self.0.add_terms(i, terms)
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

impl<F: ForceModel> Encounters<Vec<Pose>> for BodiesInContact<F> {
    fn laws(&self) -> impl Iterator<Item = &ContactLaw> {
        self.interaction().laws()
    }

    fn each_encounter(
        &self,
        q: &Vec<Pose>,
        p: &Vec<Twist>,
        mut see: impl FnMut(usize, &ContactLaw, &Encounter),
    ) {
        for (i, (law, at)) in self.interaction().encounters(self.bodies(), (q, p)).enumerate() {
            see(i, law, &at);
        }
    }
}

impl<F: ForceModel> Touching for BodiesInContact<F> {
    fn wrenches_by(
        &self,
        t: f64,
        (q, p): (&Vec<Pose>, &Vec<Twist>),
        effort: impl FnMut(usize, &ContactLaw, &Encounter) -> Wrench,
        out: &mut Vec<Twist>,
    ) {
        for (i, (body, force)) in self.bodies().iter().zip(self.forces()).enumerate() {
            let wrench = force.wrench(t, body, &state((q, p), i));
            out[i] = Twist { linear: wrench.force, angular: wrench.torque };
        }
        self.interaction().add_wrenches_by(effort, self.bodies(), (q, p), out);
    }
}

impl<F: ForceModel> Hybrid for BodiesInContact<F> {
    type Mode = Vec<ContactMode>;
    type Kind = EventKind;
    type Fault = SurfaceFault;

    fn check(&self) -> Result<(), IntegrateError> {
        without_stretch(self.laws())
    }

    fn mode(&self, _: f64, x: &State<Vec<Pose>>) -> Vec<ContactMode> {
        let encounters = self.interaction().encounters(self.bodies(), moving(x));
        encounters.map(|(law, at)| law.mode(&at, &Vector3::zeros())).collect()
    }

    fn next_mode(&self, before: &Vec<ContactMode>, _: f64, x: &State<Vec<Pose>>) -> Vec<ContactMode> {
        let encounters = self.interaction().encounters(self.bodies(), moving(x)).zip(before);
        encounters.map(|((law, at), before)| law.next_mode(before, &at, &Vector3::zeros())).collect()
    }

    fn event_kind(
        &self,
        guard: usize,
        before: &Guard,
        after: &Guard,
        _: (&Vec<ContactMode>, &Vec<ContactMode>),
    ) -> EventKind {
        EventKind::of_guard(self.interaction().len(), guard, before, after)
    }

    fn guards(&self, mode: &Vec<ContactMode>, _: f64, x: &State<Vec<Pose>>, out: &mut Vec<Guard>) {
        let contacts = self.interaction();
        let n = contacts.len();
        out.resize(if contacts.friction_has_modes { 2 * n } else { n }, Guard::default());
        for (i, ((law, at), mode)) in contacts.encounters(self.bodies(), moving(x)).zip(mode).enumerate() {
            out[i] = law.guard(&at);
            if contacts.friction_has_modes {
                out[n + i] = law.friction_guard(mode, &at, &Vector3::zeros());
            }
        }
    }

    fn sweeps(
        &self,
        mode: &Vec<ContactMode>,
        _: f64,
        h: f64,
        (before, after): (&State<Vec<Pose>>, &State<Vec<Pose>>),
        out: &mut Vec<Sweep>,
    ) {
        let is_free = is_free(mode);
        let sweep = |i: usize| {
            let ends = (&state(moving(before), i), &state(moving(after), i));
            BodySweep::between(&self.bodies()[i], &self.forces()[i], ends, h, is_free)
        };
        out.extend(self.interaction().gap_sweeps(before, &sweep));
    }

    fn clear_time(
        &self,
        mode: &Vec<ContactMode>,
        _: f64,
        x: &State<Vec<Pose>>,
        guards: &[Guard],
        horizon: f64,
    ) -> f64 {
        let ahead =
            |i: usize| BodySweep::ahead(&self.bodies()[i], &self.forces()[i], &state(moving(x), i), horizon);
        if !is_free(mode) || (0..self.bodies().len()).any(|i| ahead(i).is_none()) {
            return 0.0;
        }
        let sweep = |i: usize| ahead(i).unwrap_or(BodySweep::UNKNOWN);
        let gaps = self.interaction().gap_sweeps(x, &sweep).zip(guards);
        gaps.fold(horizon, |least, (sweep, guard)| least.min(sweep.clear_time(guard.gap)))
    }

    fn examine(&self, guard: usize, x: &State<Vec<Pose>>) -> Result<(), SurfaceFault> {
        match self.interaction().parts().nth(guard) {
            Some(Part::Surface(body, contact)) => contact.examine(&state(moving(x), body)),
            Some(Part::Pair(pair)) => pair.examine(self.bodies(), x),
            None => Ok(()),
        }
    }

    fn stiffest_rate(&self, mode: &Vec<ContactMode>, x: &State<Vec<Pose>>) -> f64 {
        let (contacts, bodies) = (self.interaction(), self.bodies());
        let of_surfaces = contacts.on_surfaces.iter().zip(mode);
        let of_pairs = contacts.pairs.iter().zip(mode.iter().skip(contacts.on_surfaces.len()));
        let surfaces = of_surfaces.map(|((i, c), mode)| c.rate_in(mode, &bodies[*i], &state(moving(x), *i)));
        let pairs = of_pairs.map(|(pair, mode)| pair.rate_in(mode, bodies, x));
        surfaces.chain(pairs).sum::<ContactRate>().bound()
    }

    fn energy(&self, x: &State<Vec<Pose>>) -> Option<Energy> {
        let mut sum = Energy { springs: self.interaction().energy(self.bodies(), x), ..Energy::default() };
        for (i, (body, force)) in self.bodies().iter().zip(self.forces()).enumerate() {
            sum.potential += force.potential(body, &state(moving(x), i))?;
            sum.kinetic += body.kinetic_energy(&state(moving(x), i));
        }
        Some(sum)
    }

    fn acceleration_in(
        &self,
        mode: &Vec<ContactMode>,
        wrenches: &mut Vec<Twist>,
        t: f64,
        x: &State<Vec<Pose>>,
        out: &mut Vec<Twist>,
    ) {
        self.wrenches_in(mode, t, x, wrenches);
        for (i, body) in self.bodies().iter().enumerate() {
            out[i] = world_acceleration(body, &state(moving(x), i), &wrenches[i]);
        }
    }

    fn impulse(&self, guard: usize, h: f64, before: &Guard, after: &Guard) -> f64 {
        self.laws().nth(guard).map_or(0.0, |law| law.normal().impulse(h, before, after))
    }
}

impl<F: ForceModel> HybridBodies for BodiesInContact<F> {
    fn wrenches_in(&self, mode: &Vec<ContactMode>, t: f64, x: &State<Vec<Pose>>, out: &mut Vec<Twist>) {
        let effort =
            |i: usize, law: &ContactLaw, at: &Encounter| law.effort_in(&mode[i], at, &Vector3::zeros());
        self.wrenches_by(t, (&x.configuration, &x.rate), effort, out);
    }

    /// Of contacts with surfaces, where no pair may touch.
    fn add_terms_in(&self, mode: &Vec<ContactMode>, i: usize, terms: &mut Vec<WrenchTerm>) -> bool {
        let contacts = self.interaction();
        let mut of_body = contacts.on_surfaces.iter().zip(mode).filter(|((body, _), _)| *body == i);
        contacts.pairs.is_empty()
            && self.forces()[i].add_terms(&self.bodies()[i], terms)
            && of_body.all(|((_, contact), mode)| contact.add_terms(mode, terms))
    }
}
