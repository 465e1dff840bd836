//! The leg that hops: a body, a thigh and a shank in a vertical plane, driven at hip and knee.

use super::ModelError;
use super::planar::{axes, down, hanging, mass};
use super::tree_system::{JointActuator, JointActuators, TreeContactSystem};
use crate::contacts::Contact;
use crate::laws::ContactLaw;
use crate::laws::compliant::CompliantLaw;
use crate::laws::coulomb::CoulombFriction;
use crate::surface::HalfSpace;
use crate::tree::LinkContact;
use nalgebra::Vector3;
use somersault_multibody::{Joint, Link, Model};
use std::sync::Arc;

/// A leg that hops on the ground z = 0 in the plane of x and z, under 9.81 m/s².
///
/// Its links are `body`, `thigh` and `shank`, its contact `foot`. With the angles a₀, a₁, a₂ of the links, of which zero points
/// down and positive ones forward, to x, a link points along (sin a, −cos a), and
/// ```text
/// q = (x, z, a₀, a₁ − a₀, a₂ − a₁),    τ = (0, 0, 0, τ_hip, τ_knee)
/// ```
/// with the centre of mass of the body at (x, z). The torques are τ = τ₀ + τ₁ sin(ω t + φ) each.
#[derive(Debug, Clone, PartialEq)]
pub struct HoppingLeg {
    /// Masses of body, thigh and shank, kg.
    pub masses: [f64; 3],
    /// Moments of inertia about their centres of mass, kg m².
    pub moments: [f64; 3],
    /// From the centre of mass of the body to the hip, and the lengths of thigh and shank, m.
    pub lengths: [f64; 3],
    /// Of thigh and shank: from the joint above to the centre of mass, m.
    pub centers: [f64; 2],
    /// Law of the foot.
    pub law: CompliantLaw,
    /// Its friction.
    pub friction: CoulombFriction,
    /// τ₀, τ₁ (N m), ω (rad/s) and φ (rad) of hip and knee.
    pub drives: [[f64; 4]; 2],
}

impl HoppingLeg {
    /// A leg of 6.5 kg that makes three hops in 0.6 s.
    pub fn example() -> Result<Self, ModelError> {
        Ok(Self {
            masses: [5.0, 1.0, 0.5],
            moments: [0.08, 0.009, 0.005],
            lengths: [0.05, 0.3, 0.3],
            centers: [0.13, 0.12],
            law: CompliantLaw::try_new(2e4, 150.0)?,
            friction: CoulombFriction::try_new(0.5, 1.5e4, 60.0)?,
            drives: [[0.88, 4.72, 28.309, 2.31], [6.485, 10.486, 28.609, 5.489]],
        })
    }

    /// The tree.
    pub fn model(&self) -> Result<Model, ModelError> {
        let ([body, thigh, shank], [hip, knee, _]) = (self.masses, self.lengths);
        let [about_body, about_thigh, about_shank] = self.moments;
        let [of_thigh, of_shank] = self.centers;
        let mut builder = Model::builder();
        let root = Link::root("body", Joint::Planar, mass(body, Vector3::zeros(), about_body));
        builder.add(root.turned(axes()))?;
        builder.add(hanging("thigh", "body", [thigh, of_thigh, about_thigh]).at(down(hip)))?;
        builder.add(hanging("shank", "thigh", [shank, of_shank, about_shank]).at(down(knee)))?;
        Ok(builder.build()?)
    }

    /// The contact of its foot.
    pub fn contacts(&self) -> Result<Vec<LinkContact>, ModelError> {
        let law = ContactLaw::from(self.law).with_friction(self.friction);
        let [_, _, shank] = self.lengths;
        let foot = Contact::try_new(down(shank), Arc::new(HalfSpace::ground()), law)?;
        Ok(vec![LinkContact::new("foot", "shank", foot)])
    }

    /// The tree with its contact, actuators and start.
    pub fn system(&self) -> Result<TreeContactSystem, ModelError> {
        let (model, (q, v)) = (self.model()?, self.start());
        let actuator = |(body, [mean, amplitude, rate, phase]): (&str, [f64; 4])| {
            let joint = JointActuator::at_joint_of(&model, body)?;
            Ok::<_, ModelError>(JointActuator { mean, amplitude, rate, phase, ..joint })
        };
        let drives = ["thigh", "shank"].into_iter().zip(self.drives);
        let actuators = JointActuators(drives.map(actuator).collect::<Result<_, _>>()?);
        Ok(TreeContactSystem { contacts: self.contacts()?, actuators, q: q.to_vec(), v: v.to_vec(), model })
    }

    /// q and v at the place of the body and the angles of the links (x, z, a₀, a₁, a₂), and their rates.
    pub fn coordinates(&self, places: [f64; 5], rates: [f64; 5]) -> ([f64; 5], [f64; 5]) {
        let [x, z, body, thigh, shank] = places;
        let [dx, dz, body_rate, thigh_rate, shank_rate] = rates;
        let (s, c) = body.sin_cos();
        (
            [x, z, body, thigh - body, shank - thigh],
            [c * dx + s * dz, c * dz - s * dx, body_rate, thigh_rate - body_rate, shank_rate - thigh_rate],
        )
    }

    /// Where the example starts: in the air, with its body at 0.594 m and 0.659 m/s.
    pub fn start(&self) -> ([f64; 5], [f64; 5]) {
        self.coordinates([0.0, 0.594, 0.05, 0.525, -0.467], [0.659, 0.0, 0.0, 0.0, 0.0])
    }
}
