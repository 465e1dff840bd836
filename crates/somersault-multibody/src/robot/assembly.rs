//! From bodies on their joints, as a document has them, to a tree: what all formats share.

use super::Change;
use super::document::Element;
use super::error::DocumentError;
use super::findings::Findings;
use crate::builder::ModelBuilder;
use crate::error::ModelError;
use crate::joint::Joint;
use crate::link::{Link, MassProperties};
use crate::model::Model;
use nalgebra::{UnitQuaternion, Vector3};

/// A body with the joint that carries it, and the elements that messages name.
pub(crate) struct Part<'a> {
    pub(crate) joint: Element<'a>,
    pub(crate) body: Element<'a>,
    pub(crate) name: String,
    /// Number of the part that carries it, which comes before it; the root has none.
    pub(crate) parent: Option<usize>,
    pub(crate) mass: MassProperties,
    pub(crate) mounting: Mounting,
}

/// What a joint is, and how it is placed.
#[derive(Clone)]
pub(crate) struct Mounting {
    pub(crate) joint: Joint,
    pub(crate) origin: Vector3<f64>,
    pub(crate) orientation: UnitQuaternion<f64>,
    pub(crate) damping: f64,
    pub(crate) limits: Option<[f64; 2]>,
    /// Across its axis a planar joint moves; elsewhere it is z.
    pub(crate) normal: Vector3<f64>,
    /// What the joint follows: the number of that one, multiplier and offset.
    pub(crate) follows: Option<(usize, f64, f64)>,
}

impl Mounting {
    pub(crate) fn new(joint: Joint, origin: Vector3<f64>, orientation: UnitQuaternion<f64>) -> Self {
        Self { joint, origin, orientation, damping: 0.0, limits: None, normal: Vector3::z(), follows: None }
    }

    /// Where the joint is: at the origin of its parent.
    pub(crate) fn here(joint: Joint) -> Self {
        Self::new(joint, Vector3::zeros(), UnitQuaternion::identity())
    }

    /// Fixes the joint at a coordinate.
    pub(crate) fn lock(&mut self, at: f64) {
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
        *self = Self::new(Joint::Fixed, self.origin, self.orientation);
    }

    /// A coordinate that it may have, the one nearest to zero.
    fn rest(&self) -> f64 {
        let [lower, upper] = self.limits.unwrap_or([0.0, 0.0]);
        let rest = 0.0_f64.max(lower).min(upper);
        if rest.is_finite() { rest } else { 0.0 }
    }
}

/// The mass of a body, or unless `strict` the nearest that it can have.
pub(crate) fn possible(
    found: MassProperties,
    body: &Element,
    strict: bool,
    findings: &mut Findings,
) -> MassProperties {
    if strict {
        return found;
    }
    let nearest = found.nearest_possible();
    if nearest != found {
        let (found, nearest) = (found.principal_moments(), nearest.principal_moments());
        findings.repair(body, Change::Inertia { found, nearest });
    }
    nearest
}

/// The tree of all parts, and for each part the number of its body. Joints that move no mass are fixed unless `strict`; what is
/// wrong with the whole is said of `document`.
pub(crate) fn assemble(
    document: &Element,
    parts: &mut [Part],
    gravity: Vector3<f64>,
    strict: bool,
    findings: &mut Findings,
) -> Result<(Model, Vec<usize>), DocumentError> {
    if !strict {
        lock_massless(parts, findings);
    }
    let mut builder = ModelBuilder::new().with_gravity(gravity);
    let mut numbers: Vec<usize> = Vec::with_capacity(parts.len());
    for part in parts.iter() {
        let next = numbers.last().map_or(0, |last| last + 1);
        numbers.push(next + attach(&mut builder, parts, part)?);
    }
    let model = builder.build().map_err(|source| document.rejected(source))?;
    Ok((model, numbers))
}

/// Fixes the joints that, with all that follow them, move no mass. Joints whose leaders make no sense are left to the builder.
fn lock_massless(parts: &mut [Part], findings: &mut Findings) {
    let mut carried: Vec<f64> = parts.iter().map(|part| part.mass.mass).collect();
    for (k, part) in parts.iter().enumerate().rev() {
        if let Some(parent) = part.parent {
            carried[parent] += carried[k];
        }
    }
    // for each joint the one that leads in the end, multiplier and offset
    let lead = |mut k: usize| {
        let (mut multiplier, mut offset) = (1.0, 0.0);
        for _ in 0..parts.len() {
            let Some((leader, m, o)) = parts[k].mounting.follows else { break };
            (k, multiplier, offset) = (leader, multiplier * m, offset + multiplier * o);
        }
        (k, multiplier, offset)
    };
    let leads: Vec<(usize, f64, f64)> = (0..parts.len()).map(lead).collect();
    let mut moved = vec![0.0; parts.len()];
    for (carried, &(leader, multiplier, _)) in carried.iter().zip(&leads) {
        if multiplier != 0.0 {
            moved[leader] += carried;
        }
    }
    let rest: Vec<f64> = parts.iter().map(|part| part.mounting.rest()).collect();
    for (part, (leader, multiplier, offset)) in parts.iter_mut().zip(leads) {
        if moved[leader] == 0.0 && part.mounting.joint != Joint::Fixed {
            let at = multiplier * rest[leader] + offset;
            part.mounting.lock(at);
            findings.repair(&part.joint, Change::Locked { at });
        }
    }
}

/// Adds a body on its joint, and says how many bodies that took before it.
fn attach(builder: &mut ModelBuilder, parts: &[Part], part: &Part) -> Result<usize, DocumentError> {
    let Mounting { joint, origin, orientation, damping, limits, normal, follows } = part.mounting;
    let parent = part.parent.map(|k| parts[k].name.as_str());
    let body = |name: &str, joint: Joint, mass: MassProperties| {
        let link = Link::root(name, joint, mass).with_damping(damping);
        match parent {
            Some(parent) => link.carried_by(parent),
            None => link,
        }
    };
    if normal.xy() == nalgebra::Vector2::zeros() && normal.z > 0.0 {
        let mut moving = body(&part.name, joint, part.mass).at(origin).turned(orientation);
        if let Some([lower, upper]) = limits {
            moving = moving.with_limits(lower, upper);
        }
        if let Some((leader, multiplier, offset)) = follows {
            moving = moving.following(&parts[leader].name, multiplier, offset);
        }
        return add(builder, part, moving).map(|()| 0);
    }
    if normal == Vector3::zeros() {
        return Err(part.joint.rejected(ModelError::ZeroAxis { name: part.name.clone() }));
    }
    let turn = UnitQuaternion::rotation_between(&Vector3::z(), &normal)
        .unwrap_or_else(|| UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI));
    let plane = format!("{} plane", part.name);
    let between = body(&plane, joint, MassProperties::massless()).at(origin).turned(orientation * turn);
    add(builder, part, between)?;
    let moving = Link::child(&part.name, plane, Joint::Fixed, part.mass).turned(turn.inverse());
    add(builder, part, moving)?;
    Ok(1)
}

/// Adds a body; what is wrong with its mass is said of the body, anything else of the joint.
fn add(builder: &mut ModelBuilder, part: &Part, body: Link) -> Result<(), DocumentError> {
    use ModelError::{AsymmetricInertia, Negative, NonFinite, NonPhysicalInertia};
    builder.add(body).map(drop).map_err(|source| match &source {
        AsymmetricInertia { .. }
        | NonPhysicalInertia { .. }
        | Negative { argument: "mass", .. }
        | NonFinite { argument: "mass" | "center" | "inertia", .. } => part.body.rejected(source),
        _ => part.joint.rejected(source),
    })
}
