//! The leg that hops: a body, a thigh and a shank in a vertical plane, driven at hip and knee.

use super::ModelError;
use crate::contacts::Contact;
use crate::laws::ContactLaw;
use crate::laws::compliant::CompliantLaw;
use crate::laws::coulomb::CoulombFriction;
use crate::surface::HalfSpace;
use crate::tree::LinkContact;
use nalgebra::{Matrix3, UnitQuaternion, Vector3};
use somersault_multibody::{Joint, Link, MassProperties, Model};
use std::f64::consts::FRAC_PI_2;
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
        let down = -Vector3::y();
        let mass = |i: usize, center: f64| MassProperties {
            mass: self.masses[i],
            center: down * center,
            inertia: Matrix3::from_diagonal_element(self.moments[i]),
        };
        let hinge = Joint::Revolute { axis: Vector3::z() };
        let plane = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), FRAC_PI_2);
        let mut builder = Model::builder();
        builder.add(Link::root("body", Joint::Planar, mass(0, 0.0)).turned(plane))?;
        let [hip, thigh, _] = self.lengths;
        builder.add(Link::child("thigh", "body", hinge, mass(1, self.centers[0])).at(down * hip))?;
        builder.add(Link::child("shank", "thigh", hinge, mass(2, self.centers[1])).at(down * thigh))?;
        Ok(builder.build()?)
    }

    /// The contact of its foot.
    pub fn contacts(&self) -> Result<Vec<LinkContact>, ModelError> {
        let law = ContactLaw::from(self.law).with_friction(self.friction);
        let [_, _, shank] = self.lengths;
        let foot = Contact::try_new(Vector3::new(0.0, -shank, 0.0), Arc::new(HalfSpace::ground()), law)?;
        Ok(vec![LinkContact::new("foot", "shank", foot)])
    }

    /// The torques of hip and knee at a time, N m.
    pub fn torques(&self, t: f64) -> [f64; 2] {
        self.drives.map(|[mean, amplitude, rate, phase]| mean + amplitude * (rate * t + phase).sin())
    }

    /// Adds the torques of hip and knee: forces of a tree ([`TreeForces`](somersault_multibody::motion::TreeForces)).
    pub fn add_torques(&self, t: f64, torque: &mut [f64]) {
        let [hip, knee] = self.torques(t);
        if let [_, _, _, at_hip, at_knee] = torque {
            *at_hip += hip;
            *at_knee += knee;
        }
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
