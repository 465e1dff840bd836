//! From bodies with any number of joints to bodies with one each.

use super::MjcfError;
use super::body::Body;
use super::compiler::{Physics, Pose};
use super::joint::{BodyJoint, Kind};
use crate::joint::Joint;
use crate::link::MassProperties;
use crate::robot::assembly::{Mounting, Part};
use crate::robot::document::Element;
use nalgebra::{UnitQuaternion, Vector3};
use std::collections::{HashMap, HashSet};

/// What the world is called.
const WORLD: &str = "world";

/// Bodies on one joint each, of which the last one of a body of the document is that body.
pub(super) struct Parts<'a> {
    pub(super) list: Vec<Part<'a>>,
    /// For each body of the document the number of its part.
    pub(super) of_bodies: Vec<usize>,
    /// The joints that have names, in their order.
    pub(super) named: Vec<(&'a str, usize)>,
    numbers: HashMap<&'a str, usize>,
    /// For each part what its joint is in the document, and its coordinates in the reference configuration.
    joints: Vec<(Option<Kind>, Vec<f64>)>,
    names: HashSet<String>,
}

impl<'a> Parts<'a> {
    pub(super) fn new(
        world: &Element<'a>,
        bodies: &[Body<'a>],
        masses: &[MassProperties],
        physics: &Physics,
    ) -> Result<Self, MjcfError> {
        let mut names = HashSet::from([WORLD.to_owned()]);
        for body in bodies {
            if body.element.name.is_some_and(|name| !names.insert(name.to_owned())) {
                return Err(body.element.duplicate().into());
            }
        }
        let (list, of_bodies, named, joints) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
        let mut parts = Self { list, of_bodies, named, numbers: HashMap::new(), joints, names };
        // the world is a body of the tree where it carries several
        let several = bodies.iter().filter(|body| body.parent.is_none()).count() > 1;
        if several {
            let mounting = Mounting::here(Joint::Fixed);
            let (name, mass) = (WORLD.to_owned(), MassProperties::massless());
            parts.list.push(Part { joint: *world, body: *world, name, parent: None, mass, mounting });
            parts.joints.push((None, Vec::new()));
        }
        for (number, (body, mass)) in (1..).zip(bodies.iter().zip(masses)) {
            let parent = match body.parent {
                Some(parent) => Some(parts.of_bodies[parent]),
                None => several.then_some(0),
            };
            let name = match body.element.name {
                Some(name) => name.to_owned(),
                None => parts.unique(&format!("body {number}")),
            };
            parts.add(body, name, parent, *mass, physics)?;
        }
        Ok(parts)
    }

    /// A name that nothing else has.
    fn unique(&mut self, wanted: &str) -> String {
        let numbered = (2..).map(|k| format!("{wanted} {k}"));
        let mut candidates = std::iter::once(wanted.to_owned()).chain(numbered);
        let free = candidates.find(|name| !self.names.contains(name)).unwrap_or_default();
        self.names.insert(free.clone());
        free
    }

    /// A body, after a frame without mass for each of its joints but the last; and for the last too where the body is not at
    /// its anchor.
    fn add(
        &mut self,
        body: &Body<'a>,
        name: String,
        parent: Option<usize>,
        mass: MassProperties,
        physics: &Physics,
    ) -> Result<(), MjcfError> {
        // of the joint frames in the part before, at the reference; anchors are in the body
        let (mut carrier, mut pose, mut anchor) = (parent, body.pose, Vector3::zeros());
        for (k, joint) in (1..).zip(&body.joints) {
            let own = &joint.element.own;
            let here = match joint.kind {
                Kind::Ball | Kind::Hinge => joint.anchor,
                Kind::Slide | Kind::Free => anchor,
            };
            let placed = joint.placed(&Pose { position: pose.place(&(here - anchor)), ..pose });
            anchor = here;
            pose = Pose::identity();
            let mut mounting = match joint.kind {
                Kind::Free => Mounting::here(Joint::Free),
                Kind::Ball | Kind::Slide | Kind::Hinge => {
                    Mounting::new(joint.joint(), placed.position, placed.orientation)
                }
            };
            mounting.damping = if physics.damped { joint.damping } else { 0.0 };
            mounting.limits = joint.limits;
            let number = self.list.len();
            if let Some(joint) = own.name {
                if self.numbers.insert(joint, number).is_some() {
                    return Err(own.duplicate().into());
                }
                self.named.push((joint, number));
            }
            self.joints.push((Some(joint.kind), reference(joint, &body.pose)));
            let last = k == body.joints.len() && anchor == Vector3::zeros();
            let part =
                |name, mass| Part { joint: *own, body: body.element, name, parent: carrier, mass, mounting };
            if last {
                self.of_bodies.push(number);
                self.list.push(part(name, mass));
                return Ok(());
            }
            let frame = match own.name {
                Some(joint) => self.unique(joint),
                None => self.unique(&format!("{name} joint {k}")),
            };
            self.list.push(part(frame, MassProperties::massless()));
            carrier = Some(number);
        }
        let mounting = Mounting::new(Joint::Fixed, pose.place(&-anchor), pose.orientation);
        self.of_bodies.push(self.list.len());
        self.joints.push((None, Vec::new()));
        let element = body.element;
        self.list.push(Part { joint: element, body: element, name, parent: carrier, mass, mounting });
        Ok(())
    }

    /// The number of the joint that an attribute names.
    pub(super) fn joint(&self, element: &Element, attribute: &'static str) -> Result<usize, MjcfError> {
        let name = element.attribute(attribute)?;
        let found = self.numbers.get(name).copied();
        found.ok_or_else(|| MjcfError::unknown_name(element, "joint", name))
    }

    pub(super) fn kind(&self, joint: usize) -> Option<Kind> {
        self.joints[joint].0
    }

    /// The coordinates of a joint in the reference configuration.
    pub(super) fn reference(&self, joint: usize) -> &[f64] {
        &self.joints[joint].1
    }

    /// Whether the joint follows another one, or is fixed.
    pub(super) fn is_held(&self, joint: usize) -> bool {
        let mounting = &self.list[joint].mounting;
        mounting.follows.is_some() || mounting.joint == Joint::Fixed
    }

    /// Lets a joint follow: what its coordinate is more than its reference is a0 + a1 times what that of the leader is more than
    /// its own. Without a leader it is fixed.
    pub(super) fn hold(&mut self, follower: usize, leader: Option<usize>, a0: f64, a1: f64) {
        let reference = |joint: usize| self.reference(joint).first().copied().unwrap_or(0.0);
        let own = reference(follower) + a0;
        match leader {
            Some(leader) => {
                let offset = own - a1 * reference(leader);
                self.list[follower].mounting.follows = Some((leader, a1, offset));
            }
            None => self.list[follower].mounting.lock(own),
        }
    }
}

/// The coordinates of a joint where the document shows it.
fn reference(joint: &BodyJoint, pose: &Pose) -> Vec<f64> {
    match joint.kind {
        Kind::Free => [pose.position.as_slice(), pose.orientation.coords.as_slice()].concat(),
        Kind::Ball => UnitQuaternion::identity().coords.as_slice().to_vec(),
        Kind::Slide | Kind::Hinge => vec![joint.reference],
    }
}
