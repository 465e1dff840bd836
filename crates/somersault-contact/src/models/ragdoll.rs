//! A limp figure that falls: the segments of the diver in space on ball joints and hinges.

use super::tree_system::{JointActuator, JointActuators, TreeContactSystem};
use super::{ModelError, lowest};
use crate::contacts::Contact;
use crate::laws::ContactLaw;
use crate::laws::compliant::CompliantLaw;
use crate::laws::coulomb::CoulombFriction;
use crate::surface::{HalfSpace, Surface};
use crate::tree::LinkContact;
use nalgebra::Vector3;
use somersault_multibody::models::{BallJointedDiver, Diver};
use somersault_multibody::{Joint, Link, Model};
use std::sync::Arc;

/// A limp figure above the ground z = 0, with the segments of a [`Diver`] in space.
///
/// Pelvis, head, upper arms and thighs are on ball joints, with damping only; forearms, hands, shanks, feet and toes on hinges,
/// whose springs are weak and hold a slight bend. Balls at head, chest, pelvis, elbows, hands, knees, heels and toes touch the ground.
#[derive(Debug, Clone, PartialEq)]
pub struct Ragdoll {
    /// Its segments.
    pub body: Diver,
    /// Damping of the ball joints, N m s/rad.
    pub damping: f64,
    /// Stiffness, N m/rad, and damping, N m s/rad, of the hinges.
    pub hinges: [f64; 2],
    /// Law of the contacts.
    pub law: CompliantLaw,
    /// Their friction.
    pub friction: CoulombFriction,
    /// Height of the lowest ball above the ground at the start, m.
    pub height: f64,
    /// Velocity v of the torso at the start: angular last.
    pub velocity: [f64; 6],
}

/// The balls by link, with centre and radius, m, of the diver of 1.70 m.
const BALLS: [(&str, [f64; 3], f64); 15] = [
    ("head", [0.02, 0.0, 0.12], 0.1),
    ("torso", [0.0, 0.1, 0.3], 0.11),
    ("torso", [0.0, -0.1, 0.3], 0.11),
    ("pelvis", [0.0, 0.0, -0.1], 0.12),
    ("right_forearm", [0.0, 0.0, 0.0], 0.04),
    ("left_forearm", [0.0, 0.0, 0.0], 0.04),
    ("right_hand", [0.0, 0.0, -0.1], 0.04),
    ("left_hand", [0.0, 0.0, -0.1], 0.04),
    ("right_shank", [0.0, 0.0, 0.0], 0.06),
    ("left_shank", [0.0, 0.0, 0.0], 0.06),
    ("right_foot", [-0.04, 0.0, -0.03], 0.03),
    ("left_foot", [-0.04, 0.0, -0.03], 0.03),
    ("right_toes", [0.04, 0.0, 0.0], 0.03),
    ("left_toes", [0.04, 0.0, 0.0], 0.03),
    ("torso", [0.0, 0.0, 0.02], 0.11),
];

impl Ragdoll {
    /// A figure of 65 kg and 1.70 m that falls by half a metre, tumbling.
    pub fn example() -> Result<Self, ModelError> {
        Ok(Self {
            body: Diver::spatial(),
            damping: 2.0,
            hinges: [20.0, 1.0],
            law: CompliantLaw::try_new(2e4, 300.0)?,
            friction: CoulombFriction::try_new(0.6, 1.5e4, 150.0)?,
            height: 0.5,
            velocity: [0.5, 0.0, 0.0, 0.3, 1.5, -0.2],
        })
    }

    /// The tree with its contacts, actuators and start.
    pub fn system(&self) -> Result<TreeContactSystem, ModelError> {
        let figure = BallJointedDiver::new(self.body).model()?;
        let mut builder = Model::builder().with_gravity(*figure.gravity());
        for link in figure.links() {
            builder.add(self.limp(link))?;
        }
        let model = builder.build()?;
        let (mut actuators, mut q) = (Vec::new(), model.neutral());
        for i in 0..model.n_bodies() {
            if let (Some(Joint::Revolute { .. }), Some(name)) = (model.joint(i), model.name(i)) {
                let joint = JointActuator::at_joint_of(&model, name)?;
                q[joint.position] = 0.2;
                actuators.push(joint.holding(self.hinges, 0.2, [0.0; 3]));
            }
        }
        let (ground, law): (Arc<dyn Surface>, _) =
            (Arc::new(HalfSpace::ground()), ContactLaw::from(self.law).with_friction(self.friction));
        let scale = self.body.height / Diver::spatial().height;
        let ball = |(k, (link, centre, radius)): (usize, &(&str, [f64; 3], f64))| {
            let centre = Vector3::from(*centre) * scale;
            let ball = Contact::try_ball(centre, radius * scale, ground.clone(), law.clone())?;
            Ok::<_, ModelError>(LinkContact::new(format!("{link} {}", k + 1), *link, ball))
        };
        let contacts = BALLS.iter().enumerate().map(ball).collect::<Result<Vec<_>, _>>()?;
        q[2] = self.height - lowest(&model, &contacts, &q)?;
        let mut v = vec![0.0; model.n_velocities()];
        v[..6].copy_from_slice(&self.velocity);
        Ok(TreeContactSystem { model, contacts, actuators: JointActuators(actuators), q, v })
    }

    /// A segment with friction in its ball, and without limits.
    fn limp(&self, link: &Link) -> Link {
        let damping = if matches!(link.joint(), Joint::Spherical) { self.damping } else { 0.0 };
        let mass = *link.mass_properties();
        let made = Link::root(link.name(), *link.joint(), mass).at(*link.origin()).with_damping(damping);
        match link.parent() {
            Some(parent) => made.carried_by(parent),
            None => made,
        }
    }
}
