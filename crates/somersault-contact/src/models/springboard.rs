//! A diver of three links who jumps onto a springboard: a board on a hinge with a spring, whose surface it carries.

use super::planar::{axes, down, hanging, mass};
use super::tree_system::{JointActuator, JointActuators, TreeContactSystem};
use super::{ModelError, between};
use crate::contacts::Contact;
use crate::laws::ContactLaw;
use crate::laws::compliant::CompliantLaw;
use crate::laws::coulomb::CoulombFriction;
use crate::surface::HalfSpace;
use crate::tree::LinkContact;
use nalgebra::{Matrix3, Vector3};
use somersault_multibody::{Joint, Link, MassProperties, Model};
use std::sync::Arc;

/// A springboard that is level at rest, with the fulcrum at the origin and its tip at x = l, and a diver above its end, in the plane of
/// x and z under 9.81 m/s².
///
/// Its links are `stand`, `board`, `trunk`, `thigh` and `shank`, its contact `foot`, with the upper side of the board. The board is
/// rigid, on a hinge whose spring has the stiffness k l² for a stiffness k at the tip.
#[derive(Debug, Clone, PartialEq)]
pub struct Springboard {
    /// From the hinge to the tip l, m.
    pub length: f64,
    /// Stiffness k, N/m, and damping, N s/m, of the tip.
    pub tip: [f64; 2],
    /// Mass of the board that moves with the tip, kg.
    pub tip_mass: f64,
    /// Of the trunk with head and arms: mass, kg, height of the centre of mass above the hip, m, and moment of inertia, kg m².
    pub trunk: [f64; 3],
    /// Of both thighs: mass, depth of the centre of mass below the hip, and moment of inertia.
    pub thigh: [f64; 3],
    /// Of both shanks and feet: mass, depth of the centre of mass below the knee, and moment of inertia.
    pub shank: [f64; 3],
    /// Lengths of thigh and shank with foot, m.
    pub lengths: [f64; 2],
    /// Law of the foot.
    pub law: CompliantLaw,
    /// Its friction.
    pub friction: CoulombFriction,
    /// Stiffness, N m/rad, and damping, N m s/rad, of hip and knee.
    pub joints: [f64; 2],
    /// Angles that these hold, rad: the hip forward, the knee back.
    pub bend: [f64; 2],
    /// Height of the foot above the board at the start, m.
    pub height: f64,
}

impl Springboard {
    /// A diver of 65 kg who falls by 0.3 m onto a board of 5.5 kN/m, and is thrown up with a forward somersault.
    pub fn example() -> Result<Self, ModelError> {
        Ok(Self {
            length: 2.4,
            tip: [5500.0, 3.0],
            tip_mass: 7.0,
            trunk: [43.0, 0.25, 2.4],
            thigh: [14.0, 0.19, 0.2],
            shank: [8.0, 0.2, 0.1],
            lengths: [0.43, 0.46],
            law: CompliantLaw::try_new(1e5, 1000.0)?,
            friction: CoulombFriction::try_new(0.9, 8e4, 400.0)?,
            joints: [1500.0, 40.0],
            bend: [0.5, -1.0],
            height: 0.3,
        })
    }

    /// The tree with its contact, actuators and start: 5 cm short of the tip, moving to it at 0.3 m/s.
    pub fn system(&self) -> Result<TreeContactSystem, ModelError> {
        let length = between("length", self.length, 0.0, 20.0)?;
        let tip_mass = between("tip_mass", self.tip_mass, 0.0, 100.0)?;
        let mut builder = Model::builder();
        let stand = MassProperties { mass: 1.0, center: Vector3::zeros(), inertia: Matrix3::identity() };
        builder.add(Link::root("stand", Joint::Fixed, stand).turned(axes()))?;
        // a board whose weight rests on the fulcrum: all of its inertia is that of the tip's mass
        let moment = tip_mass * length * length;
        let hinge = Joint::Revolute { axis: Vector3::z() };
        builder.add(Link::child("board", "stand", hinge, mass(4.0 * tip_mass, Vector3::zeros(), moment)))?;
        let [own, height, inertia] = self.trunk;
        builder.add(Link::child(
            "trunk",
            "stand",
            Joint::Planar,
            mass(own, Vector3::y() * height, inertia),
        ))?;
        builder.add(hanging("thigh", "trunk", self.thigh))?;
        builder.add(hanging("shank", "thigh", self.shank).at(down(self.lengths[0])))?;
        let model = builder.build()?;
        let top = HalfSpace::try_new(Vector3::zeros(), Vector3::y())?;
        let law = ContactLaw::from(self.law).with_friction(self.friction);
        let foot = Contact::try_new(down(self.lengths[1]), Arc::new(top), law)?;
        let contacts = vec![LinkContact::new("foot", "shank", foot).on("board")];
        let hold = |body: &str, hold: [f64; 2], angle: f64| {
            Ok::<_, ModelError>(JointActuator::at_joint_of(&model, body)?.holding(hold, angle, [0.0; 3]))
        };
        let [hip, knee] = self.bend;
        let actuators = JointActuators(vec![
            hold("board", self.tip.map(|x| x * length * length), 0.0)?,
            hold("thigh", self.joints, hip)?,
            hold("shank", self.joints, knee)?,
        ]);
        let [thigh, shank] = self.lengths;
        let forward = thigh * hip.sin() + shank * (hip + knee).sin();
        let below = thigh * hip.cos() + shank * (hip + knee).cos();
        let q = vec![0.0, length - 0.05 - forward, self.height + below, 0.0, hip, knee];
        Ok(TreeContactSystem { model, contacts, actuators, q, v: vec![0.0, 0.3, 0.0, 0.0, 0.0, 0.0] })
    }
}
