//! Trees from and to URDF, the Unified Robot Description Format.
//!
//! Read are links with their inertial, joints of all types with origin, axis, limits and damping. A body has
//! the name of its link, q and v follow the joints depth first in the order of the document. The root
//! link stands at the world's origin or floats, as [`UrdfOptions`] say.
//!
//! | URDF | Here |
//! |---|---|
//! | fixed, revolute, continuous, prismatic, floating | [`Joint`] of that kind; continuous has no limits |
//! | planar | [`Joint::Planar`]; where its axis is not z, a massless body in between turns the plane |
//! | link without `<inertial>` | massless |
//! | `<origin>` | `xyz` with `rpy`, or with `quat_xyzw` of version 1.1 |
//!
//! Not read are geometry, materials, transmissions, Coulomb friction, effort and velocity limits, safety
//! controllers, calibration and the extensions of simulators. Joints that mimic others are refused: they
//! close a loop. What a document leaves out has the defaults of the format: origin zero, axis x, limits 0.
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
//! let model = urdf::read(text, &urdf::UrdfOptions::default())?;
//! let m = model.mass_matrix(&mut Data::new(&model), &[0.0])?[(0, 0)];
//! assert!((m - 0.7).abs() < 1e-15);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod error;
mod writer;
mod xml;

use crate::builder::ModelBuilder;
use crate::error::ModelError;
use crate::joint::Joint;
use crate::link::{Link, MassProperties};
use crate::model::Model;
use nalgebra::{Matrix3, UnitQuaternion, Vector3};
use roxmltree::Node;
use std::collections::{HashMap, HashSet};
use xml::Element;

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
}

impl Default for UrdfOptions {
    /// A fixed base, gravity (0, 0, −9.81) m/s².
    fn default() -> Self {
        Self { base: Base::Fixed, gravity: Vector3::new(0.0, 0.0, -9.81) }
    }
}

/// A joint as the document has it.
struct UrdfJoint<'a> {
    element: Element<'a>,
    parent: usize,
    child: usize,
}

/// The tree of a URDF document.
pub fn read(text: &str, options: &UrdfOptions) -> Result<Model, UrdfError> {
    let document = xml::parse(text)?;
    let robot = document.root_element();
    if robot.tag_name().name() != "robot" {
        return Err(UrdfError::NotARobot { found: xml::shorten(robot.tag_name().name()) });
    }
    let elements = |tag| robot.children().filter(move |n: &Node| n.tag_name().name() == tag);
    let mut links: Vec<Element> = Vec::new();
    let mut numbers: HashMap<&str, usize> = HashMap::new();
    for node in elements("link") {
        let link = Element::named(node)?;
        if numbers.insert(link.name, links.len()).is_some() {
            return Err(duplicate(&link));
        }
        links.push(link);
    }
    let joints = elements("joint").map(|node| joint(node, &numbers)).collect::<Result<Vec<_>, _>>()?;
    let (root, carries) = hierarchy(&links, &joints)?;

    let mut builder = ModelBuilder::new().with_gravity(options.gravity);
    let base = match options.base {
        Base::Fixed => Joint::Fixed,
        Base::Planar => Joint::Planar,
        Base::Free => Joint::Free,
    };
    let first = &links[root];
    add(&mut builder, first, first, Link::root(first.name, base, inertial(first)?))?;
    let mut reached = vec![false; links.len()];
    reached[root] = true;
    let mut open: Vec<usize> = carries[root].iter().rev().copied().collect();
    while let Some(k) = open.pop() {
        let UrdfJoint { element, parent, child } = &joints[k];
        attach(&mut builder, element, links[*parent].name, &links[*child])?;
        reached[*child] = true;
        open.extend(carries[*child].iter().rev());
    }
    if let Some(lost) = reached.iter().position(|reached| !reached) {
        return Err(UrdfError::Cycle { link: links[lost].name.to_owned() });
    }
    let whole = Element::new(robot, robot.attribute("name").unwrap_or_default());
    builder.build().map_err(|source| whole.rejected(source))
}

/// The root link, and the joints that each link carries.
fn hierarchy(links: &[Element], joints: &[UrdfJoint]) -> Result<(usize, Vec<Vec<usize>>), UrdfError> {
    let mut carried_by: Vec<Option<usize>> = vec![None; links.len()];
    let mut carries: Vec<Vec<usize>> = vec![Vec::new(); links.len()];
    let mut names = HashSet::new();
    for (k, joint) in joints.iter().enumerate() {
        if !names.insert(joint.element.name) {
            return Err(duplicate(&joint.element));
        }
        if let Some(other) = carried_by[joint.child].replace(k) {
            return Err(UrdfError::SecondParent {
                element: joint.element.to_string(),
                line: joint.element.line(),
                link: links[joint.child].name.to_owned(),
                other: joints[other].element.name.to_owned(),
            });
        }
        carries[joint.parent].push(k);
    }
    let mut roots = (0..links.len()).filter(|&i| carried_by[i].is_none());
    match (roots.next(), roots.next()) {
        (Some(root), None) => Ok((root, carries)),
        (Some(first), Some(second)) => {
            let name = |i: usize| links[i].name.to_owned();
            Err(UrdfError::SeveralRoots { first: name(first), second: name(second) })
        }
        (None, _) if links.is_empty() => Err(UrdfError::NoLink),
        (None, _) => Err(UrdfError::Cycle { link: links[0].name.to_owned() }),
    }
}

fn duplicate(element: &Element) -> UrdfError {
    UrdfError::DuplicateName { element: element.to_string(), line: element.line() }
}

fn joint<'a>(node: Node<'a, 'a>, links: &HashMap<&str, usize>) -> Result<UrdfJoint<'a>, UrdfError> {
    let element = Element::named(node)?;
    let link = |tag| {
        let name = element.required(tag)?.attribute("link")?;
        links.get(name).copied().ok_or_else(|| UrdfError::UnknownLink {
            element: element.to_string(),
            line: element.line(),
            link: xml::shorten(name),
        })
    };
    let (parent, child) = (link("parent")?, link("child")?);
    Ok(UrdfJoint { element, parent, child })
}

/// Adds a body; what is wrong with its mass is said of the link, anything else of the joint.
fn add(builder: &mut ModelBuilder, joint: &Element, link: &Element, body: Link) -> Result<(), UrdfError> {
    use ModelError::{AsymmetricInertia, Negative, NonFinite, NonPhysicalInertia};
    builder.add(body).map(drop).map_err(|source| match &source {
        AsymmetricInertia { .. }
        | NonPhysicalInertia { .. }
        | Negative { argument: "mass", .. }
        | NonFinite { argument: "mass" | "center" | "inertia", .. } => link.rejected(source),
        _ => joint.rejected(source),
    })
}

/// Adds a link on its joint.
fn attach(
    builder: &mut ModelBuilder,
    joint: &Element,
    parent: &str,
    link: &Element,
) -> Result<(), UrdfError> {
    if joint.optional("mimic")?.is_some() {
        return Err(UrdfError::Mimic { element: joint.to_string(), line: joint.line() });
    }
    let (origin, orientation) = joint.origin()?;
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
            let (element, line, found) = (joint.to_string(), joint.line(), xml::shorten(kind));
            return Err(UrdfError::UnknownJointType { element, line, found });
        }
    };
    let damping = match joint.optional("dynamics")? {
        Some(dynamics) => dynamics.number_or_none("damping")?.unwrap_or(0.0),
        None => 0.0,
    };
    let mass = inertial(link)?;
    let mut moving =
        Link::child(link.name, parent, joint_kind, mass).at(origin).turned(orientation).with_damping(damping);
    if limited {
        let limit = joint.required("limit")?;
        moving = moving.with_limits(limit.bound("lower")?, limit.bound("upper")?);
    }
    if joint_kind != Joint::Planar || axis.xy() == nalgebra::Vector2::zeros() && axis.z > 0.0 {
        return add(builder, joint, link, moving);
    }
    if axis == Vector3::zeros() {
        return Err(joint.rejected(ModelError::ZeroAxis { name: link.name.to_owned() }));
    }
    let turn = UnitQuaternion::rotation_between(&Vector3::z(), &axis)
        .unwrap_or_else(|| UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI));
    let plane = format!("{} plane", link.name);
    let between = Link::child(&plane, parent, Joint::Planar, MassProperties::massless());
    add(builder, joint, link, between.at(origin).turned(orientation * turn).with_damping(damping))?;
    add(builder, joint, link, Link::child(link.name, plane, Joint::Fixed, mass).turned(turn.inverse()))
}

/// Mass, centre and inertia of a link in its own axes.
fn inertial(link: &Element) -> Result<MassProperties, UrdfError> {
    let Some(inertial) = link.optional("inertial")? else { return Ok(MassProperties::massless()) };
    let (center, orientation) = inertial.origin()?;
    let mass = inertial.required("mass")?.number("value")?;
    let tensor = inertial.required("inertia")?;
    let entry = |name| tensor.number(name);
    let (xy, xz, yz) = (entry("ixy")?, entry("ixz")?, entry("iyz")?);
    let (xx, yy, zz) = (entry("ixx")?, entry("iyy")?, entry("izz")?);
    let r = orientation.to_rotation_matrix().into_inner();
    let inertia = r * Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz) * r.transpose();
    Ok(MassProperties { mass, center, inertia: (inertia + inertia.transpose()) * 0.5 })
}
