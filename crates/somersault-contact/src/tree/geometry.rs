//! Contacts from shapes that are fixed in links: a box, a capsule, a cylinder, a sphere, and what a robot's file collides with.

use super::contacts::LinkContact;
use crate::contacts::Contact;
use crate::error::{ContactError, UntouchableShape};
use crate::laws::ContactLaw;
use crate::surface::Surface;
use nalgebra::{UnitQuaternion, Vector3};
use somersault_core::argument::expect_positive;
use somersault_multibody::Model;
use somersault_multibody::geometry::{Geometry, GeometryPurpose, GeometryShape};
use std::fmt;
use std::sync::Arc;

/// A shape of a robot that has no contact.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct LeftOut {
    /// Name of the link; empty of the world.
    pub link: String,
    /// Name of the shape, if it has one.
    pub name: Option<String>,
    /// Why.
    pub reason: UntouchableShape,
}

impl fmt::Display for LeftOut {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { link, name, reason } = self;
        if let Some(name) = name {
            write!(f, "`{name}` of ")?;
        }
        if link.is_empty() { write!(f, "the world: {reason}") } else { write!(f, "link `{link}`: {reason}") }
    }
}

/// The contacts of the shapes that a robot collides with.
#[derive(Debug, Clone, Default)]
pub struct GeometryContacts {
    /// The contacts, in the order of the links.
    pub contacts: Vec<LinkContact>,
    /// The shapes that have none.
    pub left_out: Vec<LeftOut>,
}

/// The contacts of a shape that is fixed in a link, at a place and turned in its frame, m.
///
/// | Shape | Contacts |
/// |---|---|
/// | box | its 8 corners, `name corner 1` to `name corner 8`: x changes first, z last |
/// | capsule | the balls at its ends, `name end 1` (at −z) and `name end 2` |
/// | cylinder | its rims, `name rim 1` (at −z) and `name rim 2`, against half-spaces |
/// | sphere | a ball, `name` |
///
/// Each has the law for itself: a box that stands on a face has four springs. Against a plane these are all that touches; against
/// curved surfaces edges and faces of a box, and the middle of a capsule, do not touch. A cylinder that stands flat is held by points
/// that are not determined (see [`Shape::Rim`](crate::shape::Shape::Rim)): a flat foot is a box.
///
/// ```
/// use nalgebra::{UnitQuaternion, Vector3};
/// use somersault_contact::laws::{ContactLaw, compliant::CompliantLaw};
/// use somersault_contact::surface::{HalfSpace, Surface};
/// use somersault_contact::tree::shape_contacts;
/// use somersault_multibody::geometry::GeometryShape;
/// use std::sync::Arc;
///
/// let (ground, law): (Arc<dyn Surface>, ContactLaw) =
///     (Arc::new(HalfSpace::ground()), CompliantLaw::try_new(1e4, 20.0)?.into());
/// let foot = GeometryShape::Box { size: Vector3::new(0.2, 0.1, 0.04) };
/// let place = (Vector3::new(0.05, 0.0, -0.02), UnitQuaternion::identity());
/// let contacts = shape_contacts("sole", "foot", &foot, place, &ground, &law)?;
/// assert_eq!((contacts.len(), contacts[2].name()), (8, "sole corner 3"));
/// # Ok::<(), somersault_contact::ContactError>(())
/// ```
pub fn shape_contacts(
    name: &str,
    link: &str,
    shape: &GeometryShape,
    (position, orientation): (Vector3<f64>, UnitQuaternion<f64>),
    surface: &Arc<dyn Surface>,
    law: &ContactLaw,
) -> Result<Vec<LinkContact>, ContactError> {
    let at = |place: Vector3<f64>| position + orientation * place;
    let point = |place| Contact::try_new(at(place), surface.clone(), law.clone());
    let ball = |place, radius| Contact::try_ball(at(place), radius, surface.clone(), law.clone());
    let ends = |length: f64| [-0.5, 0.5].map(|end| Vector3::z() * (end * length));
    let (part, contacts): (_, Vec<Contact>) = match shape {
        GeometryShape::Box { size } => {
            for edge in size {
                expect_positive("size", *edge)?;
            }
            let corner = |k: usize| Vector3::from_fn(|axis, _| if k >> axis & 1 == 1 { 0.5 } else { -0.5 });
            let corners = (0..8).map(|k| point(corner(k).component_mul(size)));
            ("corner", corners.collect::<Result<_, _>>()?)
        }
        GeometryShape::Capsule { radius, length } => {
            let ends = ends(expect_positive("length", *length)?);
            ("end", ends.into_iter().map(|end| ball(end, *radius)).collect::<Result<_, _>>()?)
        }
        GeometryShape::Cylinder { radius, length } => {
            let plane = *surface.as_half_space().ok_or(UntouchableShape::Curved)?;
            let axis = orientation * Vector3::z();
            let rim = |end| Contact::try_rim(at(end), axis, *radius, plane, law.clone());
            let ends = ends(expect_positive("length", *length)?);
            ("rim", ends.into_iter().map(rim).collect::<Result<_, _>>()?)
        }
        GeometryShape::Sphere { radius } => ("", vec![ball(Vector3::zeros(), *radius)?]),
        GeometryShape::Ellipsoid { .. } => return Err(UntouchableShape::Ellipsoid.into()),
        GeometryShape::Mesh { file, .. } => return Err(UntouchableShape::Mesh { file: file.clone() }.into()),
    };
    let named = |(k, contact)| {
        let name = if part.is_empty() { name.to_owned() } else { format!("{name} {part} {}", k + 1) };
        LinkContact::new(name, link, contact)
    };
    Ok(contacts.into_iter().enumerate().map(named).collect())
}

/// The contacts of what a robot collides with, `Robot::geometry` of `somersault_multibody::robot`: of the links of
/// these names, or of all.
///
/// The contacts of a link with one shape are called by its name, as [`shape_contacts`] does; those of one with more by
/// `link shape 1`, `link shape 2` and so on. Shapes that are to be seen have none.
///
/// ```
/// use somersault_contact::laws::{ContactLaw, compliant::CompliantLaw};
/// use somersault_contact::surface::{HalfSpace, Surface};
/// use somersault_contact::tree::geometry_contacts;
/// use somersault_multibody::urdf::{self, UrdfOptions};
/// use std::sync::Arc;
///
/// let text = r#"<robot name="stilt"><link name="shaft"><inertial><mass value="1"/>
///   <inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/></inertial>
///   <collision><origin xyz="0 0 -0.5"/><geometry><sphere radius="0.02"/></geometry></collision>
///   <collision><geometry><mesh filename="handle.stl"/></geometry></collision></link></robot>"#;
/// let robot = urdf::read(text, &UrdfOptions::default())?;
/// let (ground, law): (Arc<dyn Surface>, ContactLaw) =
///     (Arc::new(HalfSpace::ground()), CompliantLaw::try_new(1e4, 20.0)?.into());
/// let found = geometry_contacts(&robot.model, &robot.geometry, None, &ground, &law)?;
/// assert_eq!(found.contacts[0].name(), "shaft shape 1");
/// assert!(found.left_out[0].to_string().starts_with("link `shaft`: a mesh has no contacts"));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn geometry_contacts(
    model: &Model,
    geometry: &[Geometry],
    links: Option<&[String]>,
    surface: &Arc<dyn Surface>,
    law: &ContactLaw,
) -> Result<GeometryContacts, ContactError> {
    let number = |link: &String| {
        model.body(link).map_err(|_| ContactError::NoLink { argument: "links", found: link.clone() })
    };
    let wanted = links.map(|links| links.iter().map(number).collect::<Result<Vec<_>, _>>()).transpose()?;
    let collides = |of: &&Geometry| match of.purpose {
        GeometryPurpose::Collision => true,
        GeometryPurpose::Visual => false,
    };
    let mut found = GeometryContacts::default();
    for body in 0..model.n_bodies() {
        if wanted.as_ref().is_some_and(|wanted| !wanted.contains(&body)) {
            continue;
        }
        let link = model.name(body).unwrap_or_default();
        let shapes: Vec<&Geometry> =
            geometry.iter().filter(collides).filter(|g| g.body == Some(body)).collect();
        let left_out =
            |name: Option<&String>, reason| LeftOut { link: link.to_owned(), name: name.cloned(), reason };
        if shapes.is_empty() && wanted.is_some() {
            found.left_out.push(left_out(None, UntouchableShape::NoShape));
        }
        for (k, of) in shapes.iter().enumerate() {
            let name = if shapes.len() == 1 { link.to_owned() } else { format!("{link} shape {}", k + 1) };
            match shape_contacts(&name, link, &of.shape, (of.position, of.orientation), surface, law) {
                Ok(contacts) => found.contacts.extend(contacts),
                Err(ContactError::Shape(reason)) => found.left_out.push(left_out(of.name.as_ref(), reason)),
                Err(error) => return Err(error),
            }
        }
    }
    if wanted.is_none() {
        let fixed = geometry.iter().filter(collides).filter(|of| of.body.is_none());
        found.left_out.extend(fixed.map(|of| LeftOut {
            link: String::new(),
            name: of.name.clone(),
            reason: UntouchableShape::World,
        }));
    }
    Ok(found)
}
