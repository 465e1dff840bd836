//! A quadruped of a robot's file: a trunk on four legs of two hinges, with balls as feet.

use super::tree_system::{JointActuator, JointActuators, TreeContactSystem};
use super::{ModelError, lowest};
use crate::laws::ContactLaw;
use crate::laws::compliant::CompliantLaw;
use crate::laws::coulomb::CoulombFriction;
use crate::surface::{HalfSpace, Surface};
use crate::tree::geometry_contacts;
use nalgebra::Vector3;
use somersault_multibody::urdf::{self, Base, UrdfOptions};
use std::sync::Arc;

/// A quadruped of 13.6 kg on the ground z = 0, with the contacts of its `<collision>` elements: the corners of its trunk, and its feet.
///
/// The legs are `lf`, `rf`, `lh` and `rh`, with the bodies `lf_thigh`, `lf_shank` and so on. Springs and dampers hold the hinges.
#[derive(Debug, Clone, PartialEq)]
pub struct Quadruped {
    /// Law of the contacts.
    pub law: CompliantLaw,
    /// Their friction.
    pub friction: CoulombFriction,
    /// Stiffness, N m/rad, and damping, N m s/rad, of hips and knees.
    pub joints: [f64; 2],
    /// Angles that these hold, rad.
    pub bend: [f64; 2],
    /// Weight per mass, m/s².
    pub gravity: Vector3<f64>,
    /// Height of the feet above the ground at the start, m.
    pub height: f64,
}

impl Quadruped {
    /// Its description, a URDF document.
    pub const URDF: &'static str = include_str!("quadruped.urdf");

    /// A quadruped whose feet fall by 0.1 m.
    pub fn example() -> Result<Self, ModelError> {
        Ok(Self {
            law: CompliantLaw::try_new(2e4, 150.0)?,
            friction: CoulombFriction::try_new(0.6, 1.5e4, 100.0)?,
            joints: [400.0, 4.0],
            bend: [0.5, -1.0],
            gravity: Vector3::new(0.0, 0.0, -9.81),
            height: 0.1,
        })
    }

    /// The tree with its contacts, actuators and start, level and at rest.
    pub fn system(&self) -> Result<TreeContactSystem, ModelError> {
        let options = UrdfOptions { base: Base::Free, gravity: self.gravity, strict: true };
        let robot = urdf::read(Self::URDF, &options)?;
        let ground: Arc<dyn Surface> = Arc::new(HalfSpace::ground());
        let law = ContactLaw::from(self.law).with_friction(self.friction);
        let contacts = geometry_contacts(&robot.model, &robot.geometry, None, None, &ground, &law)?.contacts;
        let model = robot.model;
        let (mut actuators, mut q) = (Vec::new(), model.neutral());
        for leg in ["lf", "rf", "lh", "rh"] {
            for (part, angle) in ["thigh", "shank"].into_iter().zip(self.bend) {
                let joint = JointActuator::at_joint_of(&model, &format!("{leg}_{part}"))?;
                q[joint.position] = angle;
                actuators.push(joint.holding(self.joints, angle, [0.0; 3]));
            }
        }
        q[2] = self.height - lowest(&model, &contacts, &q)?;
        let v = vec![0.0; model.n_velocities()];
        Ok(TreeContactSystem { model, contacts, actuators: JointActuators(actuators), q, v })
    }
}
