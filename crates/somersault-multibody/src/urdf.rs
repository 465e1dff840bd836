//! Trees from and to URDF, the Unified Robot Description Format.
//!
//! Read are links with their inertial, joints of all types with origin, axis, limits, damping and the joints they
//! mimic, and visual and collision elements. A body has the name of its link, q and v follow the joints depth first in the
//! order of the document. The root link stands at the world's origin or floats, as [`UrdfOptions`] say.
//!
//! | URDF | Here |
//! |---|---|
//! | fixed, revolute, continuous, prismatic, floating | [`Joint`] of that kind; continuous has no limits |
//! | planar | [`Joint::Planar`]; where its axis is not z, a massless body in between turns the plane |
//! | mimic | [`Mimic`](crate::Mimic): the joint has no numbers in q and v |
//! | link without `<inertial>` | massless |
//! | `<visual>`, `<collision>` | [`Geometry`], which no calculation reads |
//! | `<origin>` | `xyz` with `rpy`, or with `quat_xyzw` of version 1.1 |
//!
//! Files that exist have what no body can have. Three things are repaired, and listed in [`Robot::repairs`]; with
//! [`UrdfOptions::strict`] they are refused:
//!
//! * an inertia that no distribution of mass has becomes the nearest one,
//!   [`MassProperties::nearest_possible`](crate::MassProperties::nearest_possible);
//! * a joint that moves no mass, nor do those that follow it, is fixed: its row of the mass matrix is zero;
//! * a fixed joint that is to mimic another one stays fixed.
//!
//! Not read are materials, transmissions, effort and velocity limits, safety controllers, calibration and the extensions of
//! simulators, nor Coulomb friction, which [`Robot::ignored`] lists. What a document leaves out has the defaults of the format: origin zero, axis x,
//! limits 0, multiplier 1, offset 0.
//!
//! Documents may come from anywhere: a document type declaration (and with it every entity) is refused,
//! nesting costs no stack, and nodes and attributes are counted before they cost memory or time. The XML is
//! read by `roxmltree`. Cost O(n) in the length of the document.
//!
//! ```
//! use somersault_multibody::{Data, urdf};
//!
//! let text = r#"<robot name="pendulum">
//!   <link name="stand"/>
//!   <joint name="pivot" type="continuous">
//!     <parent link="stand"/> <child link="rod"/> <axis xyz="0 1 0"/>
//!   </joint>
//!   <link name="rod"><inertial>
//!     <origin xyz="0 0 -0.5"/> <mass value="2"/>
//!     <inertia ixx="0.2" ixy="0" ixz="0" iyy="0.2" iyz="0" izz="0.01"/>
//!   </inertial></link>
//! </robot>"#;
//! let model = urdf::read(text, &urdf::UrdfOptions::default())?.model;
//! let m = model.mass_matrix(&mut Data::new(&model), &[0.0])?[(0, 0)];
//! assert!((m - 0.7).abs() < 1e-15);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod error;
mod writer;

use crate::joint::Joint;
use crate::link::MassProperties;
use crate::robot::assembly::{Mounting, Part, assemble, possible};
use crate::robot::document::{self, Element};
use crate::robot::findings::Findings;
use crate::robot::{Change, DocumentError, Geometry, GeometryPurpose, GeometryShape, Robot};
use nalgebra::{Matrix3, UnitQuaternion, Vector3};
use roxmltree::Node;
use std::collections::{HashMap, HashSet};

pub use error::UrdfError;
pub use writer::write;

/// How the root link is connected to the world.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Base {
    /// Not at all movable.
    #[default]
    Fixed,
    /// In the x–y plane of the world.
    Planar,
    /// In any way.
    Free,
}

/// What a document does not say.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct UrdfOptions {
    /// Joint of the root link.
    pub base: Base,
    /// Gravitational acceleration, m/s², world axes.
    pub gravity: Vector3<f64>,
    /// Refuses what else would be repaired.
    pub strict: bool,
}

impl Default for UrdfOptions {
    /// A fixed base, gravity (0, 0, −9.81) m/s², repairs.
    fn default() -> Self {
        Self { base: Base::Fixed, gravity: Vector3::new(0.0, 0.0, -9.81), strict: false }
    }
}

/// A joint as the document has it.
#[derive(Clone, Copy)]
struct UrdfJoint<'a> {
    element: Element<'a>,
    parent: usize,
    child: usize,
}

/// The robot of a URDF document.
pub fn read(text: &str, options: &UrdfOptions) -> Result<Robot, UrdfError> {
    let document = document::parse(text)?;
    let robot = document::outermost(&document, "robot")?;
    let elements = |tag| robot.children().filter(move |n: &Node| n.tag_name().name() == tag);
    let mut links: Vec<Element> = Vec::new();
    let mut numbers: HashMap<&str, usize> = HashMap::new();
    for node in elements("link") {
        let link = Element::named(node)?;
        if numbers.insert(name_of(&link), links.len()).is_some() {
            return Err(link.duplicate().into());
        }
        links.push(link);
    }
    let joints = elements("joint").map(|node| joint(node, &numbers)).collect::<Result<Vec<_>, _>>()?;
    let (root, carries) = hierarchy(&links, &joints)?;
    let order = depth_first(&links, &joints, root, &carries)?;

    let mut findings = Findings::new([(None, text)]);
    // of each joint and of each link the number of its part
    let (mut joint_parts, mut link_parts) = (vec![0; joints.len()], vec![0; links.len()]);
    for (part, &k) in (1..).zip(&order) {
        (joint_parts[k], link_parts[joints[k].child]) = (part, part);
    }
    let leaders = joints.iter().zip(&joint_parts).map(|(joint, &part)| (name_of(&joint.element), part));
    let leaders: HashMap<&str, usize> = leaders.collect();
    let mut mountings = Vec::with_capacity(joints.len());
    let mut masses = Vec::with_capacity(links.len());
    for joint in &joints {
        mountings.push(mounting(&joint.element, &leaders, options, &mut findings)?);
    }
    for link in &links {
        masses.push(possible(inertial(link)?, link, options.strict, &mut findings));
    }

    let base = match options.base {
        Base::Fixed => Joint::Fixed,
        Base::Planar => Joint::Planar,
        Base::Free => Joint::Free,
    };
    let part = |joint, link: usize, parent, mounting| Part {
        joint,
        body: links[link],
        name: name_of(&links[link]).to_owned(),
        parent,
        mass: masses[link],
        mounting,
    };
    let mut parts = Vec::with_capacity(links.len());
    parts.push(part(links[root], root, None, Mounting::here(base)));
    for &k in &order {
        let UrdfJoint { element, parent, child } = joints[k];
        parts.push(part(element, child, Some(link_parts[parent]), mountings[k].clone()));
    }
    let whole = Element::new(robot, Some(robot.attribute("name").unwrap_or_default()));
    let (model, bodies) = assemble(&whole, &mut parts, options.gravity, options.strict, &mut findings)?;
    let mut geometry = Vec::new();
    for (part, &body) in parts.iter().zip(&bodies) {
        shapes_of(&part.body, body, &mut geometry)?;
    }
    let joints = parts.iter().zip(bodies).skip(1);
    let joints = joints.map(|(part, body)| (name_of(&part.joint).to_owned(), body)).collect();
    let Findings { repairs, ignored, .. } = findings;
    let reference = model.neutral();
    Ok(Robot { name: name_of(&whole).to_owned(), model, reference, joints, repairs, ignored, geometry })
}

/// The name of a link, a joint or the robot, which have one.
fn name_of<'a>(element: &Element<'a>) -> &'a str {
    element.name.unwrap_or_default()
}

/// The joints from the root outwards.
fn depth_first(
    links: &[Element],
    joints: &[UrdfJoint],
    root: usize,
    carries: &[Vec<usize>],
) -> Result<Vec<usize>, UrdfError> {
    let mut order = Vec::with_capacity(joints.len());
    let mut reached = vec![false; links.len()];
    reached[root] = true;
    let mut open: Vec<usize> = carries[root].iter().rev().copied().collect();
    while let Some(k) = open.pop() {
        order.push(k);
        reached[joints[k].child] = true;
        open.extend(carries[joints[k].child].iter().rev());
    }
    match reached.iter().position(|reached| !reached) {
        Some(lost) => Err(UrdfError::Cycle { link: name_of(&links[lost]).to_owned() }),
        None => Ok(order),
    }
}

/// The root link, and the joints that each link carries.
fn hierarchy(links: &[Element], joints: &[UrdfJoint]) -> Result<(usize, Vec<Vec<usize>>), UrdfError> {
    let mut carried_by: Vec<Option<usize>> = vec![None; links.len()];
    let mut carries: Vec<Vec<usize>> = vec![Vec::new(); links.len()];
    let mut names = HashSet::new();
    for (k, joint) in joints.iter().enumerate() {
        if !names.insert(joint.element.name) {
            return Err(joint.element.duplicate().into());
        }
        if let Some(other) = carried_by[joint.child].replace(k) {
            return Err(UrdfError::SecondParent {
                element: joint.element.to_string(),
                line: joint.element.line(),
                link: name_of(&links[joint.child]).to_owned(),
                other: name_of(&joints[other].element).to_owned(),
            });
        }
        carries[joint.parent].push(k);
    }
    let mut roots = (0..links.len()).filter(|&i| carried_by[i].is_none());
    match (roots.next(), roots.next()) {
        (Some(root), None) => Ok((root, carries)),
        (Some(first), Some(second)) => {
            let name = |i: usize| name_of(&links[i]).to_owned();
            Err(UrdfError::SeveralRoots { first: name(first), second: name(second) })
        }
        (None, _) if links.is_empty() => Err(UrdfError::NoLink),
        (None, _) => Err(UrdfError::Cycle { link: name_of(&links[0]).to_owned() }),
    }
}

fn joint<'a>(node: Node<'a, 'a>, links: &HashMap<&str, usize>) -> Result<UrdfJoint<'a>, UrdfError> {
    let element = Element::named(node)?;
    let link = |tag| {
        let name = element.required(tag)?.attribute("link")?;
        links.get(name).copied().ok_or_else(|| UrdfError::UnknownLink {
            element: element.to_string(),
            line: element.line(),
            link: document::shorten(name),
        })
    };
    let (parent, child) = (link("parent")?, link("child")?);
    Ok(UrdfJoint { element, parent, child })
}

/// What a joint of the document is; `leaders` are the numbers of the joints.
fn mounting(
    joint: &Element,
    leaders: &HashMap<&str, usize>,
    options: &UrdfOptions,
    findings: &mut Findings,
) -> Result<Mounting, UrdfError> {
    let (position, orientation) = origin(joint)?;
    let axis = match joint.optional("axis")? {
        Some(axis) => axis.vector("xyz")?.unwrap_or(Vector3::x()),
        None => Vector3::x(),
    };
    let kind = joint.attribute("type")?;
    let (joint_kind, limited) = match kind {
        "fixed" => (Joint::Fixed, false),
        "revolute" => (Joint::Revolute { axis }, true),
        "continuous" => (Joint::Revolute { axis }, false),
        "prismatic" => (Joint::Prismatic { axis }, true),
        "floating" => (Joint::Free, false),
        "planar" => (Joint::Planar, false),
        _ => {
            let (element, line, found) = (joint.to_string(), joint.line(), document::shorten(kind));
            return Err(UrdfError::UnknownJointType { element, line, found });
        }
    };
    let mut mounting = Mounting::new(joint_kind, position, orientation);
    if let Some(dynamics) = joint.optional("dynamics")? {
        mounting.damping = dynamics.number_or_none("damping")?.unwrap_or(0.0);
        let friction = dynamics.attribute_or_none("friction");
        if friction.is_some_and(|text| text.trim().parse() != Ok(0.0)) {
            findings.ignore(joint, "Coulomb friction is not read");
        }
    }
    if limited {
        let limit = joint.required("limit")?;
        mounting.limits = Some([limit.bound("lower")?, limit.bound("upper")?]);
    }
    match joint.optional("mimic")? {
        None => {}
        Some(_) if joint_kind == Joint::Fixed && !options.strict => {
            findings.repair(joint, Change::FixedFollower);
        }
        Some(mimic) => {
            let leader = mimic.attribute("joint")?;
            let number = leaders.get(leader).copied().ok_or_else(|| UrdfError::UnknownJoint {
                element: joint.to_string(),
                line: joint.line(),
                joint: document::shorten(leader),
            })?;
            let multiplier = mimic.number_or_none("multiplier")?.unwrap_or(1.0);
            mounting.follows = Some((number, multiplier, mimic.number_or_none("offset")?.unwrap_or(0.0)));
        }
    }
    if joint_kind == Joint::Planar {
        mounting.normal = axis;
    }
    Ok(mounting)
}

/// Position and rotation of the `<origin>` of an element.
fn origin(element: &Element) -> Result<(Vector3<f64>, UnitQuaternion<f64>), UrdfError> {
    let Some(origin) = element.optional("origin")? else {
        return Ok((Vector3::zeros(), UnitQuaternion::identity()));
    };
    let position = origin.vector("xyz")?.unwrap_or_default();
    let rotation = match (origin.finite("rpy")?, origin.finite("quat_xyzw")?) {
        (None, None) => UnitQuaternion::identity(),
        (Some([roll, pitch, yaw]), None) => UnitQuaternion::from_euler_angles(roll, pitch, yaw),
        (None, Some(q)) => origin.rotation("quat_xyzw", q)?,
        (Some(_), Some(_)) => {
            return Err(UrdfError::TwoRotations { element: element.to_string(), line: origin.line() });
        }
    };
    Ok((position, rotation))
}

/// What is to be seen and touched of a link that is body number `body`.
fn shapes_of(link: &Element, body: usize, geometry: &mut Vec<Geometry>) -> Result<(), UrdfError> {
    for (tag, purpose) in [("visual", GeometryPurpose::Visual), ("collision", GeometryPurpose::Collision)] {
        for element in link.all(tag) {
            let (position, orientation) = origin(&element)?;
            let name = element.attribute_or_none("name").map(str::to_owned);
            let shape = shape(&element.required("geometry")?)?;
            geometry.push(Geometry { body: Some(body), purpose, name, position, orientation, shape });
        }
    }
    Ok(())
}

fn shape(geometry: &Element) -> Result<GeometryShape, DocumentError> {
    if let Some(found) = geometry.optional("box")? {
        let size = found.vector("size")?.ok_or_else(|| found.missing("size"))?;
        Ok(GeometryShape::Box { size })
    } else if let Some(found) = geometry.optional("cylinder")? {
        Ok(GeometryShape::Cylinder { radius: found.number("radius")?, length: found.number("length")? })
    } else if let Some(found) = geometry.optional("capsule")? {
        Ok(GeometryShape::Capsule { radius: found.number("radius")?, length: found.number("length")? })
    } else if let Some(found) = geometry.optional("sphere")? {
        Ok(GeometryShape::Sphere { radius: found.number("radius")? })
    } else {
        let found = geometry.required("mesh")?;
        let scale = found.vector("scale")?.unwrap_or(Vector3::repeat(1.0));
        Ok(GeometryShape::Mesh { file: found.attribute("filename")?.to_owned(), scale })
    }
}

/// Mass, centre and inertia of a link in its own axes.
fn inertial(link: &Element) -> Result<MassProperties, UrdfError> {
    let Some(inertial) = link.optional("inertial")? else { return Ok(MassProperties::massless()) };
    let (center, orientation) = origin(&inertial)?;
    let mass = inertial.required("mass")?.number("value")?;
    let tensor = inertial.required("inertia")?;
    let entry = |name| tensor.number(name);
    let (xy, xz, yz) = (entry("ixy")?, entry("ixz")?, entry("iyz")?);
    let (xx, yy, zz) = (entry("ixx")?, entry("iyy")?, entry("izz")?);
    let r = orientation.to_rotation_matrix().into_inner();
    let inertia = r * Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz) * r.transpose();
    Ok(MassProperties { mass, center, inertia: (inertia + inertia.transpose()) * 0.5 })
}
