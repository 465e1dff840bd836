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
//! Not read are materials, transmissions, Coulomb friction, effort and velocity limits, safety controllers, calibration
//! and the extensions of simulators. What a document leaves out has the defaults of the format: origin zero, axis x,
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
mod xml;

use crate::builder::ModelBuilder;
use crate::error::ModelError;
use crate::joint::Joint;
use crate::link::{Link, MassProperties};
use crate::robot::{Change, Geometry, GeometryPurpose, GeometryShape, Repair, Robot};
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
struct UrdfJoint<'a> {
    element: Element<'a>,
    parent: usize,
    child: usize,
}

/// What a joint is, and how it is placed.
struct Mounting {
    joint: Joint,
    origin: Vector3<f64>,
    orientation: UnitQuaternion<f64>,
    damping: f64,
    limits: Option<[f64; 2]>,
    /// Across its axis a planar joint moves; elsewhere it is z.
    normal: Vector3<f64>,
    /// Number of the joint that leads, multiplier and offset.
    follows: Option<(usize, f64, f64)>,
}

impl Mounting {
    /// Fixes the joint at a coordinate.
    fn lock(&mut self, at: f64) {
        match self.joint {
            Joint::Revolute { axis } => {
                let turn = axis.try_normalize(0.0).map_or(Vector3::zeros(), |axis| axis * at);
                self.orientation *= UnitQuaternion::from_scaled_axis(turn);
            }
            Joint::Prismatic { axis } => {
                let along = axis.try_normalize(0.0).map_or(Vector3::zeros(), |axis| axis * at);
                self.origin += self.orientation * along;
            }
            Joint::Fixed | Joint::Spherical | Joint::Planar | Joint::Free => {}
        }
        let Self { origin, orientation, .. } = *self;
        *self = Self { origin, orientation, ..Self::fixed() };
    }

    fn fixed() -> Self {
        Self {
            joint: Joint::Fixed,
            origin: Vector3::zeros(),
            orientation: UnitQuaternion::identity(),
            damping: 0.0,
            limits: None,
            normal: Vector3::z(),
            follows: None,
        }
    }

    /// A coordinate that it may have, the one nearest to zero.
    fn rest(&self) -> f64 {
        let [lower, upper] = self.limits.unwrap_or([0.0, 0.0]);
        let rest = 0.0_f64.max(lower).min(upper);
        if rest.is_finite() { rest } else { 0.0 }
    }
}

/// The robot of a URDF document.
pub fn read(text: &str, options: &UrdfOptions) -> Result<Robot, UrdfError> {
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
    let order = depth_first(&links, &joints, root, &carries)?;

    let mut repairs = Repairs::new(text);
    let names: HashMap<&str, usize> = joints.iter().enumerate().map(|(k, j)| (j.element.name, k)).collect();
    let mut mountings = Vec::with_capacity(joints.len());
    let mut masses = Vec::with_capacity(links.len());
    for joint in &joints {
        mountings.push(mounting(&joint.element, &names, options, &mut repairs)?);
    }
    for link in &links {
        masses.push(mass_of(link, options, &mut repairs)?);
    }
    if !options.strict {
        lock_massless(&joints, &order, &masses, &mut mountings, &mut repairs);
    }

    let mut builder = ModelBuilder::new().with_gravity(options.gravity);
    let base = match options.base {
        Base::Fixed => Joint::Fixed,
        Base::Planar => Joint::Planar,
        Base::Free => Joint::Free,
    };
    let mut geometry = Vec::new();
    let first = &links[root];
    let (mut n_bodies, mut root_moves) = (1, Link::root(first.name, base, masses[root]));
    if !options.strict && base != Joint::Fixed && masses.iter().all(|body| body.mass == 0.0) {
        root_moves = Link::root(first.name, Joint::Fixed, masses[root]);
        repairs.add(first, Change::Locked { at: 0.0 });
    }
    add(&mut builder, first, first, root_moves)?;
    shapes_of(first, 0, &mut geometry)?;
    for &k in &order {
        let UrdfJoint { element, parent, child } = &joints[k];
        let leader =
            |(k, multiplier, offset): (usize, f64, f64)| (links[joints[k].child].name, multiplier, offset);
        let follows = mountings[k].follows.map(leader);
        n_bodies += attach(
            &mut builder,
            element,
            links[*parent].name,
            &links[*child],
            &mountings[k],
            follows,
            masses[*child],
        )?;
        shapes_of(&links[*child], n_bodies - 1, &mut geometry)?;
    }
    let whole = Element::new(robot, robot.attribute("name").unwrap_or_default());
    let model = builder.build().map_err(|source| whole.rejected(source))?;
    Ok(Robot { name: whole.name.to_owned(), model, repairs: repairs.list, geometry })
}

/// The list of repairs, with what finds the line of an element.
struct Repairs {
    /// Where the lines of the document end.
    ends: Vec<usize>,
    list: Vec<Repair>,
}

impl Repairs {
    fn new(text: &str) -> Self {
        Self { ends: text.match_indices('\n').map(|(end, _)| end).collect(), list: Vec::new() }
    }

    fn add(&mut self, element: &Element, change: Change) {
        let line = self.ends.partition_point(|&end| end < element.start()) as u32 + 1;
        self.list.push(Repair { element: element.to_string(), line, change });
    }
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
        Some(lost) => Err(UrdfError::Cycle { link: links[lost].name.to_owned() }),
        None => Ok(order),
    }
}

/// Fixes the joints that, with all that follow them, move no mass. Joints whose leaders make no sense are left to the builder.
fn lock_massless(
    joints: &[UrdfJoint],
    order: &[usize],
    masses: &[MassProperties],
    mountings: &mut [Mounting],
    repairs: &mut Repairs,
) {
    let mut carried: Vec<f64> = masses.iter().map(|body| body.mass).collect();
    for &k in order.iter().rev() {
        carried[joints[k].parent] += carried[joints[k].child];
    }
    // for each joint the one that leads in the end, multiplier and offset
    let lead = |mut k: usize| {
        let (mut multiplier, mut offset) = (1.0, 0.0);
        for _ in 0..joints.len() {
            let Some((leader, m, o)) = mountings[k].follows else { break };
            (k, multiplier, offset) = (leader, multiplier * m, offset + multiplier * o);
        }
        (k, multiplier, offset)
    };
    let leads: Vec<(usize, f64, f64)> = (0..joints.len()).map(lead).collect();
    let mut moved = vec![0.0; joints.len()];
    for (joint, &(leader, multiplier, _)) in joints.iter().zip(&leads) {
        if multiplier != 0.0 {
            moved[leader] += carried[joint.child];
        }
    }
    let rest: Vec<f64> = mountings.iter().map(Mounting::rest).collect();
    for &k in order {
        let (leader, multiplier, offset) = leads[k];
        if moved[leader] == 0.0 && mountings[k].joint != Joint::Fixed {
            let at = multiplier * rest[leader] + offset;
            mountings[k].lock(at);
            repairs.add(&joints[k].element, Change::Locked { at });
        }
    }
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

/// What a joint of the document is.
fn mounting(
    joint: &Element,
    names: &HashMap<&str, usize>,
    options: &UrdfOptions,
    repairs: &mut Repairs,
) -> Result<Mounting, UrdfError> {
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
    let limits = if limited {
        let limit = joint.required("limit")?;
        Some([limit.bound("lower")?, limit.bound("upper")?])
    } else {
        None
    };
    let follows = match joint.optional("mimic")? {
        None => None,
        Some(_) if joint_kind == Joint::Fixed && !options.strict => {
            repairs.add(joint, Change::FixedFollower);
            None
        }
        Some(mimic) => {
            let leader = mimic.attribute("joint")?;
            let number = names.get(leader).copied().ok_or_else(|| UrdfError::UnknownJoint {
                element: joint.to_string(),
                line: joint.line(),
                joint: xml::shorten(leader),
            })?;
            let multiplier = mimic.number_or_none("multiplier")?.unwrap_or(1.0);
            Some((number, multiplier, mimic.number_or_none("offset")?.unwrap_or(0.0)))
        }
    };
    let normal = if joint_kind == Joint::Planar { axis } else { Vector3::z() };
    Ok(Mounting { joint: joint_kind, origin, orientation, damping, limits, normal, follows })
}

/// Adds a link on its joint, and says how many bodies that took. `follows` names the link that the leading joint carries.
fn attach(
    builder: &mut ModelBuilder,
    joint: &Element,
    parent: &str,
    link: &Element,
    mounting: &Mounting,
    follows: Option<(&str, f64, f64)>,
    mass: MassProperties,
) -> Result<usize, UrdfError> {
    let Mounting { joint: joint_kind, origin, orientation, damping, limits, normal, .. } = *mounting;
    let mut moving =
        Link::child(link.name, parent, joint_kind, mass).at(origin).turned(orientation).with_damping(damping);
    if let Some([lower, upper]) = limits {
        moving = moving.with_limits(lower, upper);
    }
    if let Some((leader, multiplier, offset)) = follows {
        moving = moving.following(leader, multiplier, offset);
    }
    if normal.xy() == nalgebra::Vector2::zeros() && normal.z > 0.0 {
        return add(builder, joint, link, moving).map(|()| 1);
    }
    if normal == Vector3::zeros() {
        return Err(joint.rejected(ModelError::ZeroAxis { name: link.name.to_owned() }));
    }
    let turn = UnitQuaternion::rotation_between(&Vector3::z(), &normal)
        .unwrap_or_else(|| UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI));
    let plane = format!("{} plane", link.name);
    let between = Link::child(&plane, parent, Joint::Planar, MassProperties::massless());
    add(builder, joint, link, between.at(origin).turned(orientation * turn).with_damping(damping))?;
    add(builder, joint, link, Link::child(link.name, plane, Joint::Fixed, mass).turned(turn.inverse()))?;
    Ok(2)
}

/// The mass of a link, or the nearest that it can have.
fn mass_of(
    link: &Element,
    options: &UrdfOptions,
    repairs: &mut Repairs,
) -> Result<MassProperties, UrdfError> {
    let found = inertial(link)?;
    if options.strict {
        return Ok(found);
    }
    let nearest = found.nearest_possible();
    if nearest != found {
        let (found, nearest) = (found.principal_moments(), nearest.principal_moments());
        repairs.add(link, Change::Inertia { found, nearest });
    }
    Ok(nearest)
}

/// What is to be seen and touched of a link that is body number `body`.
fn shapes_of(link: &Element, body: usize, geometry: &mut Vec<Geometry>) -> Result<(), UrdfError> {
    for (tag, purpose) in [("visual", GeometryPurpose::Visual), ("collision", GeometryPurpose::Collision)] {
        for element in link.all(tag) {
            let (position, orientation) = element.origin()?;
            let name = element.attribute_or_none("name").map(str::to_owned);
            let shape = shape(&element.required("geometry")?)?;
            geometry.push(Geometry { body, purpose, name, position, orientation, shape });
        }
    }
    Ok(())
}

fn shape(geometry: &Element) -> Result<GeometryShape, UrdfError> {
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
