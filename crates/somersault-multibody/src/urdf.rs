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

mod writer;
mod xml;

use crate::builder::{Link, MassProperties, ModelBuilder, ModelError};
use crate::joint::Joint;
use crate::model::Model;
use nalgebra::{Matrix3, UnitQuaternion, Vector3};
use roxmltree::Node;
use std::collections::{HashMap, HashSet};
use xml::Element;

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

/// Why a document is not a tree. `element` is the tag with its name, as in "joint `elbow`".
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum UrdfError {
    /// Not well-formed, a document type declaration, or more nodes than allowed.
    #[error("not a readable XML document: {reason}")]
    Xml {
        /// What the XML parser says, with the position.
        reason: String,
    },
    /// More attributes in one tag than any element of the format has.
    #[error("the tag in line {line} has more than {allowed} attributes")]
    TooManyAttributes {
        /// Line of the document.
        line: u32,
        /// Attributes allowed.
        allowed: usize,
    },
    /// The outermost element is another.
    #[error("the outermost element must be <robot>, found <{found}>")]
    NotARobot {
        /// Its tag.
        found: String,
    },
    /// An attribute that the format requires is missing.
    #[error("{element} (line {line}) has no attribute `{attribute}`")]
    MissingAttribute {
        /// The element.
        element: String,
        /// Line of the document.
        line: u32,
        /// The attribute.
        attribute: &'static str,
    },
    /// An element that the format requires is missing.
    #[error("{element} (line {line}) has no <{child}>")]
    MissingElement {
        /// The element.
        element: String,
        /// Line of the document.
        line: u32,
        /// Tag of what is missing.
        child: &'static str,
    },
    /// An element that may occur once occurs again.
    #[error("{element} (line {line}) has more than one <{child}>")]
    RepeatedElement {
        /// The element.
        element: String,
        /// Line of the document.
        line: u32,
        /// Tag of what is repeated.
        child: &'static str,
    },
    /// An attribute does not hold the finite numbers it must.
    #[error("`{attribute}` of {element} (line {line}) must be {expected} finite number(s), found `{found}`")]
    BadNumber {
        /// The element.
        element: String,
        /// Line of the document.
        line: u32,
        /// The attribute.
        attribute: &'static str,
        /// How many numbers it must hold.
        expected: usize,
        /// Its value, at most 40 characters of it.
        found: String,
    },
    /// A rotation is given twice.
    #[error("{element} (line {line}) has an origin with both `rpy` and `quat_xyzw`")]
    TwoRotations {
        /// The element.
        element: String,
        /// Line of the document.
        line: u32,
    },
    /// There is no such type of joint.
    #[error("{element} (line {line}) has the unknown type `{found}`")]
    UnknownJointType {
        /// The joint.
        element: String,
        /// Line of the document.
        line: u32,
        /// The type, at most 40 characters of it.
        found: String,
    },
    /// The joint follows another one, which closes a loop.
    #[error("{element} (line {line}) mimics another joint, which is not supported")]
    Mimic {
        /// The joint.
        element: String,
        /// Line of the document.
        line: u32,
    },
    /// Two links or two joints of one name.
    #[error("{element} (line {line}) has the name of an earlier one")]
    DuplicateName {
        /// The element.
        element: String,
        /// Line of the document.
        line: u32,
    },
    /// A joint names a link that the document does not have.
    #[error("{element} (line {line}) names the link `{link}`, which does not exist")]
    UnknownLink {
        /// The joint.
        element: String,
        /// Line of the document.
        line: u32,
        /// The link.
        link: String,
    },
    /// A link is the child of two joints.
    #[error("{element} (line {line}) has the child `{link}`, which is that of joint `{other}` already")]
    SecondParent {
        /// The joint.
        element: String,
        /// Line of the document.
        line: u32,
        /// The link.
        link: String,
        /// The other joint.
        other: String,
    },
    /// A tree has one root.
    #[error("link `{second}` is the child of no joint, but neither is link `{first}`")]
    SeveralRoots {
        /// The first link without a parent.
        first: String,
        /// The second.
        second: String,
    },
    /// A link hangs on itself.
    #[error("link `{link}` is part of a cycle, or hangs on one")]
    Cycle {
        /// The link.
        link: String,
    },
    /// The document has no link.
    #[error("the robot has no link")]
    NoLink,
    /// URDF cannot say this.
    #[error("{element} cannot be written: {reason}")]
    NotRepresentable {
        /// The link.
        element: String,
        /// Why.
        reason: &'static str,
    },
    /// The numbers describe no body or no joint.
    #[error("{element} (line {line}): {source}")]
    Rejected {
        /// The link, the joint or the robot.
        element: String,
        /// Line of the document.
        line: u32,
        /// What is wrong.
        source: ModelError,
    },
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
    let root = match (roots.next(), roots.next()) {
        (Some(root), None) => root,
        (Some(first), Some(second)) => {
            let name = |i: usize| links[i].name.to_owned();
            return Err(UrdfError::SeveralRoots { first: name(first), second: name(second) });
        }
        (None, _) if links.is_empty() => return Err(UrdfError::NoLink),
        (None, _) => return Err(UrdfError::Cycle { link: links[0].name.to_owned() }),
    };

    let mut builder = ModelBuilder::new().with_gravity(options.gravity);
    let base = match options.base {
        Base::Fixed => Joint::Fixed,
        Base::Planar => Joint::Planar,
        Base::Free => Joint::Free,
    };
    add(&mut builder, &links[root], Link::root(links[root].name, base, inertial(&links[root])?))?;
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

fn add(builder: &mut ModelBuilder, element: &Element, link: Link) -> Result<(), UrdfError> {
    builder.add(link).map(drop).map_err(|source| element.rejected(source))
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
        return add(builder, joint, moving);
    }
    if axis == Vector3::zeros() {
        return Err(joint.rejected(ModelError::ZeroAxis { name: link.name.to_owned() }));
    }
    let turn = UnitQuaternion::rotation_between(&Vector3::z(), &axis)
        .unwrap_or_else(|| UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI));
    let plane = format!("{} plane", link.name);
    let between = Link::child(&plane, parent, Joint::Planar, MassProperties::massless());
    add(builder, joint, between.at(origin).turned(orientation * turn).with_damping(damping))?;
    add(builder, joint, Link::child(link.name, plane, Joint::Fixed, mass).turned(turn.inverse()))
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
