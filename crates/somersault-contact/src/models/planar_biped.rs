//! A biped in the plane that takes a step: a trunk on two legs of thigh and shank, held by springs at hips and knees.

use super::planar::{axes, down, hanging, mass};
use super::tree_system::{JointActuator, JointActuators, TreeContactSystem};
use super::{ModelError, lowest};
use crate::contacts::Contact;
use crate::laws::ContactLaw;
use crate::laws::compliant::CompliantLaw;
use crate::laws::coulomb::CoulombFriction;
use crate::surface::HalfSpace;
use crate::tree::LinkContact;
use nalgebra::Vector3;
use somersault_multibody::{Joint, Link, Model};
use std::f64::consts::FRAC_PI_2;
use std::sync::Arc;

/// A biped in the plane of x and z, on the ground z = 0, with points as feet.
///
/// Its links are `trunk`, and `left thigh`, `left shank`, `right thigh`, `right shank`; its contacts `left foot` and `right foot`.
/// Springs and dampers hold each hip at 0.15 rad + Δ sin(ω t ± π/2), positive forward, and each knee at −0.35 rad − Δ sin(ω t ± π/2 + π/2).
#[derive(Debug, Clone, PartialEq)]
pub struct PlanarBiped {
    /// Of the trunk: mass, kg, height of the centre of mass above the hips, m, and moment of inertia about it, kg m².
    pub trunk: [f64; 3],
    /// Of a thigh: mass, depth of the centre of mass below the hip, and moment of inertia.
    pub thigh: [f64; 3],
    /// Of a shank: mass, depth of the centre of mass below the knee, and moment of inertia.
    pub shank: [f64; 3],
    /// Lengths of thigh and shank, m.
    pub lengths: [f64; 2],
    /// Law of the feet.
    pub law: CompliantLaw,
    /// Their friction.
    pub friction: CoulombFriction,
    /// Stiffness, N m/rad, and damping, N m s/rad, of the hips.
    pub hips: [f64; 2],
    /// The same of the knees.
    pub knees: [f64; 2],
    /// Δ, rad, and ω, rad/s.
    pub stride: [f64; 2],
    /// Speed forward at the start, m/s.
    pub speed: f64,
    /// Weight per mass, m/s².
    pub gravity: Vector3<f64>,
}

impl PlanarBiped {
    /// A biped of 60 kg that starts at 0.9 m/s. In its first second it steps from the left foot, which sticks, to the right one.
    pub fn example() -> Result<Self, ModelError> {
        Ok(Self {
            trunk: [40.0, 0.3, 2.0],
            thigh: [7.0, 0.2, 0.1],
            shank: [3.0, 0.2, 0.05],
            lengths: [0.45, 0.45],
            law: CompliantLaw::try_new(5e4, 1000.0)?,
            friction: CoulombFriction::try_new(0.8, 4e4, 400.0)?,
            hips: [800.0, 60.0],
            knees: [800.0, 40.0],
            stride: [0.35, std::f64::consts::TAU],
            speed: 0.9,
            gravity: Vector3::new(0.0, 0.0, -9.81),
        })
    }

    /// The tree with its contacts, actuators and start: 2 mm above the ground, leaning back by 0.05 rad.
    pub fn system(&self) -> Result<TreeContactSystem, ModelError> {
        let [own, height, moment] = self.trunk;
        let law = ContactLaw::from(self.law).with_friction(self.friction);
        let mut builder = Model::builder().with_gravity(self.gravity);
        let trunk = Link::root("trunk", Joint::Planar, mass(own, Vector3::y() * height, moment));
        builder.add(trunk.turned(axes()))?;
        let mut contacts = Vec::new();
        for side in ["left", "right"] {
            let [thigh, shank] = ["thigh", "shank"].map(|part| format!("{side} {part}"));
            builder.add(hanging(&thigh, "trunk", self.thigh))?;
            builder.add(hanging(&shank, &thigh, self.shank).at(down(self.lengths[0])))?;
            let foot = Contact::try_new(down(self.lengths[1]), Arc::new(HalfSpace::ground()), law.clone())?;
            contacts.push(LinkContact::new(format!("{side} foot"), shank, foot));
        }
        let model = builder.build()?;
        let (mut actuators, mut q) = (Vec::new(), vec![0.0, 0.0, -0.05]);
        for (side, phase) in [("left", FRAC_PI_2), ("right", -FRAC_PI_2)] {
            let [swing, rate] = self.stride;
            let hip = JointActuator::at_joint_of(&model, &format!("{side} thigh"))?;
            let knee = JointActuator::at_joint_of(&model, &format!("{side} shank"))?;
            actuators.push(hip.holding(self.hips, 0.15, [swing, rate, phase]));
            actuators.push(knee.holding(self.knees, -0.35, [-swing, rate, phase + FRAC_PI_2]));
            q.push(0.15 + swing * phase.sin());
            q.push(-0.35 - swing * (phase + FRAC_PI_2).sin());
        }
        let v = vec![self.speed, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
        q[1] = 2e-3 - lowest(&model, &contacts, &q)?;
        Ok(TreeContactSystem { model, contacts, actuators: JointActuators(actuators), q, v })
    }
}
