//! The contacts of a tree: of links with surfaces, and of pairs of spheres on two links.

use crate::bodies::{BodyContacts, BodySphere, Hold, Part, SpherePair};
use crate::carrier::Frame;
use crate::contacts::Contact;
use crate::error::ContactError;
use crate::laws::{ContactLaw, Encounter};
use crate::shape::{Feature, Shape};
use nalgebra::{ArrayStorage, Matrix3, UnitQuaternion, Vector3};
use somersault_multibody::geometry::GeometryShape;
use somersault_multibody::motion::mobility_bound;
use somersault_multibody::{Model, Velocities};
use std::collections::HashSet;

/// A part of a link that touches a surface, with a name.
///
/// Lengths of the [`Contact`] are in the frame of the link, from its origin, in m.
#[derive(Debug, Clone)]
pub struct LinkContact {
    name: String,
    link: String,
    contact: Contact,
    base: Option<String>,
}

impl LinkContact {
    /// A contact of the body `link` of a model.
    pub fn new(name: impl Into<String>, link: impl Into<String>, contact: Contact) -> Self {
        Self { name: name.into(), link: link.into(), contact, base: None }
    }

    /// The same with its surface fixed in the frame of the body `base`: a board, a platform, a conveyor. It pushes on that body
    /// as on the link.
    #[must_use]
    pub fn on(self, base: impl Into<String>) -> Self {
        Self { base: Some(base.into()), ..self }
    }

    /// Name of the contact.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Name of the link.
    pub fn link(&self) -> &str {
        &self.link
    }

    /// Name of the body that carries the surface; none where it stands in the world.
    pub fn base(&self) -> Option<&str> {
        self.base.as_deref()
    }

    /// What touches what, and under which laws.
    pub fn contact(&self) -> &Contact {
        &self.contact
    }
}

/// The centre of a shape in the frame of its link, and how it is turned.
type Placed = (Vector3<f64>, UnitQuaternion<f64>);

/// Two spheres on two links that touch under some laws, with a name; or a sphere and a capsule or a box, or two capsules.
#[derive(Debug, Clone, PartialEq)]
pub struct LinkPair {
    name: String,
    links: [String; 2],
    /// On no bodies yet.
    spheres: [BodySphere; 2],
    law: ContactLaw,
}

impl LinkPair {
    /// Two spheres, each by link, centre in the frame of the link and radius, m, and a law.
    pub fn try_new(
        name: impl Into<String>,
        first: (impl Into<String>, Vector3<f64>, f64),
        second: (impl Into<String>, Vector3<f64>, f64),
        law: impl Into<ContactLaw>,
    ) -> Result<Self, ContactError> {
        let spheres =
            [BodySphere::try_new(0, first.1, first.2)?, BodySphere::try_new(0, second.1, second.2)?];
        Self::of(name.into(), [first.0.into(), second.0.into()], spheres, law.into())
    }

    /// Two shapes, each by link, shape, centre and how it is turned in the frame of the link, and a law, as [`SpherePair`] has them.
    pub fn of_shapes(
        name: impl Into<String>,
        links: [impl Into<String>; 2],
        shapes: [(&GeometryShape, Placed); 2],
        law: impl Into<ContactLaw>,
    ) -> Result<Self, ContactError> {
        let [first, second] = shapes.map(|(shape, place)| BodySphere::of_shape(0, shape, place));
        Self::of(name.into(), links.map(Into::into), [first?, second?], law.into())
    }

    fn of(
        name: String,
        links: [String; 2],
        spheres: [BodySphere; 2],
        law: ContactLaw,
    ) -> Result<Self, ContactError> {
        let [a, b] = &links;
        if a == b {
            return Err(ContactError::SameLink { link: a.clone() });
        }
        let [first, second] = spheres;
        SpherePair::try_new(first, second.on(1), law.clone())?;
        Ok(Self { name, links, spheres, law })
    }

    /// Name of the contact.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Names of the links.
    pub fn links(&self) -> &[String; 2] {
        &self.links
    }

    /// The shapes on them.
    pub fn shapes(&self) -> [&Shape; 2] {
        self.spheres.each_ref().map(BodySphere::shape)
    }
}

/// The contacts of a tree: those with surfaces first, then the pairs.
#[derive(Debug, Clone)]
pub struct TreeContacts {
    names: Vec<String>,
    contacts: BodyContacts,
    /// The bodies that carry the surfaces.
    bases: Vec<Option<usize>>,
    /// Of the links, kg.
    masses: Vec<f64>,
    /// What each contact's speed is at most over the root of the energy, 1/√kg.
    mobilities: Vec<f64>,
}

impl TreeContacts {
    /// Contacts of the bodies of a model.
    pub fn try_new(
        model: &Model,
        on_surfaces: Vec<LinkContact>,
        pairs: Vec<LinkPair>,
    ) -> Result<Self, ContactError> {
        let mut names = Vec::with_capacity(on_surfaces.len() + pairs.len());
        let number = |argument, link: String| {
            model.body(&link).map_err(|_| ContactError::NoLink { argument, found: link })
        };
        let (mut placed, mut paired, mut bases) = (Vec::new(), Vec::new(), Vec::new());
        for LinkContact { name, link, contact, base } in on_surfaces {
            if base.as_ref() == Some(&link) {
                return Err(ContactError::SameLink { link });
            }
            placed.push((number("link", link)?, contact));
            bases.push(base.map(|base| number("on", base)).transpose()?);
            names.push(name);
        }
        for LinkPair { name, links: [a, b], spheres: [first, second], law } in pairs {
            let (first, second) = (first.on(number("links", a)?), second.on(number("links", b)?));
            paired.push(SpherePair::try_new(first, second, law)?);
            names.push(name);
        }
        let mut seen = HashSet::new();
        if let Some(name) = names.iter().find(|name| !seen.insert(name.as_str())) {
            return Err(ContactError::DuplicateName { name: name.clone() });
        }
        let contacts = BodyContacts::try_new(model.n_bodies(), placed, paired)?;
        let masses = model.links().iter().map(|link| link.mass_properties().mass).collect();
        let root = |link: usize, point: &Vector3<f64>, radius: f64| {
            Ok::<_, ContactError>((2.0 * mobility_bound(model, link, point, radius)?).sqrt())
        };
        let mobility = |(i, part): (usize, Part<'_>)| match part {
            // The point of a surface that is touched may be anywhere on the body that carries it.
            Part::Surface(..) if bases[i].is_some() => Ok(f64::INFINITY),
            Part::Surface(link, contact) => {
                let shape = contact.shape();
                root(link, shape.centre(), shape.reach() - shape.centre().norm())
            }
            Part::Pair(pair) => {
                let [a, b] = pair.spheres();
                let of = |sphere: &BodySphere| {
                    root(sphere.body(), sphere.centre(), sphere.shape().reach() - sphere.centre().norm())
                };
                Ok(of(a)? + of(b)?)
            }
        };
        let mobilities = contacts.parts().enumerate().map(mobility).collect::<Result<_, _>>()?;
        Ok(Self { names, contacts, bases, masses, mobilities })
    }

    /// Number of contacts.
    pub fn len(&self) -> usize {
        self.names.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.names.is_empty()
    }

    /// Names of the contacts, in their order.
    pub fn names(&self) -> &[String] {
        &self.names
    }

    /// The number of the contact that a guard belongs to.
    pub fn of_guard(&self, guard: usize) -> usize {
        guard % self.len().max(1)
    }

    /// The number of the link of contact `i`, or of its first link, and that of the second of a pair, or of the body that
    /// carries its surface.
    pub fn links(&self, i: usize) -> Result<(usize, Option<usize>), ContactError> {
        match self.part(i)? {
            Part::Surface(link, _) => Ok((link, self.base(i))),
            Part::Pair(pair) => {
                let [a, b] = pair.spheres();
                Ok((a.body(), Some(b.body())))
            }
        }
    }

    /// The laws of the contacts, in their order.
    pub fn laws(&self) -> impl Iterator<Item = &ContactLaw> {
        self.contacts.laws()
    }

    pub(crate) fn part(&self, i: usize) -> Result<Part<'_>, ContactError> {
        let unknown = ContactError::NoContact { found: i, contacts: self.len() };
        self.contacts.parts().nth(i).ok_or(unknown)
    }

    pub(crate) fn parts(&self) -> impl Iterator<Item = Part<'_>> {
        self.contacts.parts()
    }

    /// What the speed of contact `i` is at most over the root of the energy.
    pub(super) fn mobility(&self, i: usize) -> f64 {
        self.mobilities[i]
    }

    /// The body that carries the surface of contact `i`.
    #[inline]
    pub(crate) fn base(&self, i: usize) -> Option<usize> {
        self.bases.get(i).copied().flatten()
    }

    /// Whether contact `i` is with a surface that stands in the world.
    pub(super) fn is_of_world(&self, i: usize) -> bool {
        self.base(i).is_none() && matches!(self.parts().nth(i), Some(Part::Surface(..)))
    }

    /// The encounter of contact `i`, and on what it acts.
    #[inline]
    pub(crate) fn meet(&self, i: usize, part: &Part<'_>, bodies: &Velocities<'_>) -> (Encounter, Hold) {
        match (part, self.base(i)) {
            (Part::Surface(link, contact), Some(base)) => self.meet_on_base((*link, contact), base, bodies),
            (Part::Surface(link, contact), None) => {
                Hold::on_surface((*link, contact), self.masses[*link], &frame_in_place(bodies, *link))
            }
            (Part::Pair(_), _) => part.meet(|link| frame(bodies, link), |link| self.masses[link]),
        }
    }

    /// The parts of the shapes of contact `i` that are nearest.
    pub(crate) fn feature(&self, i: usize, part: &Part<'_>, bodies: &Velocities<'_>) -> Feature {
        match (part, self.base(i)) {
            (Part::Surface(link, contact), Some(base)) => {
                contact.feature(&frame(bodies, *link).seen_from(&frame(bodies, base)))
            }
            (Part::Surface(..) | Part::Pair(_), _) => part.feature(|link| frame(bodies, link)),
        }
    }

    /// Of a contact whose surface is carried by a body: in its frame, where the surface rests, and seen from the world again.
    fn meet_on_base(
        &self,
        (link, contact): (usize, &Contact),
        base: usize,
        bodies: &Velocities<'_>,
    ) -> (Encounter, Hold) {
        let (carrier, ground) = (frame(bodies, link), frame(bodies, base));
        let [m_a, m_b] = [link, base].map(|body| self.masses[body]);
        let (at, _) = contact.meet_on(m_a / (1.0 + m_a / m_b), &carrier.seen_from(&ground));
        let turned = |v: &Vector3<f64>| ground.rotation * v;
        let point = ground.origin + turned(&at.point);
        let at = Encounter {
            normal: turned(&at.normal),
            point,
            sliding: turned(&at.sliding),
            turning: turned(&at.turning),
            // The plane of contact turns with its body, and on it.
            tilting: turned(&at.tilting) + ground.angular_velocity,
            ..at
        };
        let arms = [carrier.origin, ground.origin].map(|origin| point - origin);
        (at, Hold { first: (link, arms[0]), second: Some((base, arms[1])) })
    }
}

/// The rotation of a link that is not there.
static NOWHERE: Matrix3<f64> = Matrix3::from_array_storage(ArrayStorage([[f64::NAN; 3]; 3]));

/// How the frame of a link stands and moves; NaN of one that is not there.
#[inline]
pub(super) fn frame(bodies: &Velocities<'_>, link: usize) -> Frame {
    let Frame { origin, rotation, velocity, angular_velocity } = frame_in_place(bodies, link);
    Frame { origin, rotation: *rotation, velocity, angular_velocity }
}

/// The same without a copy of the rotation.
#[inline(always)]
fn frame_in_place<'a>(bodies: &Velocities<'a>, link: usize) -> Frame<&'a Matrix3<f64>> {
    if let Ok((origin, rotation)) = bodies.positions().origin_and_rotation(link)
        && let Ok(motion) = bodies.velocity(link)
    {
        let [velocity, angular_velocity] = [motion.linear, motion.angular].map(|v| rotation * v);
        return Frame { origin, rotation, velocity, angular_velocity };
    }
    let none = Vector3::repeat(f64::NAN);
    Frame { origin: none, rotation: &NOWHERE, velocity: none, angular_velocity: none }
}
