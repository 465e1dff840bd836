//! Contacts from shapes that are fixed in links: a box, a capsule, a cylinder, a sphere, the convex hull of a mesh, and what a
//! robot's file collides with.

use super::contacts::LinkContact;
use super::mesh;
use crate::contacts::Contact;
use crate::error::{ContactError, UntouchableShape};
use crate::laws::ContactLaw;
use crate::surface::{Surface, SurfaceCore};
use nalgebra::{UnitQuaternion, Vector3};
use somersault_core::argument::expect_positive;
use somersault_multibody::Model;
use somersault_multibody::geometry::{Geometry, GeometryPurpose, GeometryShape};
use std::fmt;
use std::fs;
use std::path::{Path, PathBuf};
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
/// | box | its 8 corners, `name corner 1` to `name corner 8`: x changes first, z last; against a cylinder from outside its edges, `name edge 1` to `name edge 12`, those along x first; as one, `name`, against a sphere from outside |
/// | capsule | the balls at its ends, `name end 1` (at −z) and `name end 2`; as one, `name`, against spheres and cylinders from outside |
/// | cylinder | its rims, `name rim 1` (at −z) and `name rim 2`, against half-spaces |
/// | sphere | a ball, `name` |
///
/// Each has its own law: a box that stands on a face has four springs, and a corner that touches a cylinder those of its three
/// edges. Against planes, spheres and cylinders, from outside or inside, nothing else can touch. Against other surfaces edges and faces
/// of a box, and the middle of a capsule, do not touch. The point of contact of a cylinder that stands flat, and of a capsule along a
/// cylinder, is not unique (see [`Shape`](crate::shape::Shape)): use a box for a flat foot.
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
            let touch = |ends: [Vector3<f64>; 2]| {
                Contact::try_capsule(ends.map(at), 0.0, surface.clone(), law.clone())
            };
            match surface.core() {
                Some(SurfaceCore::Point(_)) => {
                    let place = (position, orientation);
                    let whole = Contact::try_box(*size, place, surface.clone(), law.clone())?;
                    return Ok(vec![LinkContact::new(name, link, whole)]);
                }
                Some(SurfaceCore::Line(..)) => {
                    let edges = edges(size).into_iter().map(touch).collect::<Result<_, _>>()?;
                    return Ok(named(name, link, "edge", edges));
                }
                None => {}
            }
            let corner = |k: usize| Vector3::from_fn(|axis, _| if k >> axis & 1 == 1 { 0.5 } else { -0.5 });
            let corners = (0..8).map(|k| point(corner(k).component_mul(size)));
            ("corner", corners.collect::<Result<_, _>>()?)
        }
        GeometryShape::Capsule { radius, length } => {
            let ends = ends(expect_positive("length", *length)?);
            if surface.core().is_some() {
                let radius = expect_positive("radius", *radius)?;
                let whole = Contact::try_capsule(ends.map(at), radius, surface.clone(), law.clone())?;
                return Ok(vec![LinkContact::new(name, link, whole)]);
            }
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
    Ok(named(name, link, part, contacts))
}

/// Contacts of a link by the name of the whole and the number of each part.
fn named(name: &str, link: &str, part: &str, contacts: Vec<Contact>) -> Vec<LinkContact> {
    let named = |(k, contact)| {
        let name = if part.is_empty() { name.to_owned() } else { format!("{name} {part} {}", k + 1) };
        LinkContact::new(name, link, contact)
    };
    contacts.into_iter().enumerate().map(named).collect()
}

/// The edges of a box about the origin by their ends, those along x first.
fn edges(size: &Vector3<f64>) -> Vec<[Vector3<f64>; 2]> {
    let half = size * 0.5;
    let edge = |axis: usize, k: usize| {
        let signs = [k & 1, k >> 1].map(|bit| if bit == 1 { 1.0 } else { -1.0 });
        let mut middle = Vector3::zeros();
        for (side, sign) in [(axis + 1) % 3, (axis + 2) % 3].into_iter().zip(signs) {
            middle[side] = sign * half[side];
        }
        let along = Vector3::ith(axis, half[axis]);
        [middle - along, middle + along]
    };
    (0..3).flat_map(|axis| (0..4).map(move |k| edge(axis, k))).collect()
}

/// How many bytes the file of a mesh may have.
const LARGEST_FILE: u64 = 64 << 20;

/// The contacts of the convex hull of a mesh that is fixed in a link: its vertices as points, `name vertex 1` and so on.
///
/// A mesh that is not convex touches as its hull does, and, as of a box, neither edges nor faces touch curved surfaces. The
/// file ends in `.stl` or `.obj`; it may have 50 000 different vertices, and its hull 512 vertices.
pub fn mesh_contacts(
    name: &str,
    link: &str,
    file: &Path,
    scale: &Vector3<f64>,
    (position, orientation): (Vector3<f64>, UnitQuaternion<f64>),
    surface: &Arc<dyn Surface>,
    law: &ContactLaw,
) -> Result<Vec<LinkContact>, ContactError> {
    let shown = file.display().to_string();
    let unreadable = |reason: String| UntouchableShape::Unreadable { file: shown.clone(), reason };
    let size = fs::metadata(file).map_err(|error| unreadable(error.to_string()))?.len();
    if size > LARGEST_FILE {
        return Err(unreadable(format!("it has {size} bytes, more than {LARGEST_FILE}")).into());
    }
    let content = fs::read(file).map_err(|error| unreadable(error.to_string()))?;
    let vertices = mesh::hull_vertices(&content, &shown, scale)?;
    let point = |place| Contact::try_new(position + orientation * place, surface.clone(), law.clone());
    Ok(named(name, link, "vertex", vertices.into_iter().map(point).collect::<Result<_, _>>()?))
}

/// Where the file of a mesh lies: under a folder, by its whole path or without the name of its package.
fn found_under(folder: &Path, file: &str) -> Option<PathBuf> {
    let path = file.split_once("://").map_or(file, |(_, path)| path);
    let whole = Path::new(path);
    let within: PathBuf = whole.components().skip(1).collect();
    [folder.join(whole), folder.join(within)].into_iter().find(|path| path.is_file())
}

/// The contacts of what a robot collides with, `Robot::geometry` of `somersault_multibody::robot`: of the links of
/// these names, or of all.
///
/// The contacts of a link with one shape are called by its name, as [`shape_contacts`] does; those of one with more by
/// `link shape 1`, `link shape 2` and so on. Shapes that are to be seen have none. Files of meshes are opened where `meshes` is
/// the folder that they lie in, as [`mesh_contacts`] does.
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
/// let found = geometry_contacts(&robot.model, &robot.geometry, None, None, &ground, &law)?;
/// assert_eq!(found.contacts[0].name(), "shaft shape 1");
/// assert!(found.left_out[0].to_string().starts_with("link `shaft`: a mesh has no contacts"));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn geometry_contacts(
    model: &Model,
    geometry: &[Geometry],
    links: Option<&[String]>,
    meshes: Option<&Path>,
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
            let place = (of.position, of.orientation);
            let made = match (&of.shape, meshes) {
                (GeometryShape::Mesh { file, scale }, Some(folder)) => match found_under(folder, file) {
                    Some(path) => mesh_contacts(&name, link, &path, scale, place, surface, law),
                    None => Err(UntouchableShape::NoFile {
                        file: file.clone(),
                        folder: folder.display().to_string(),
                    }
                    .into()),
                },
                _ => shape_contacts(&name, link, &of.shape, place, surface, law),
            };
            match made {
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
