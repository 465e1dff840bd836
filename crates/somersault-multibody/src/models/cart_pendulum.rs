//! The inverted pendulum on a cart (thesis appendix A).
//!
//! With r along x and θ from the upright towards −x the equations are, corrected and in symmetric form,
//!
//! (m_c + m) r̈ − m ℓ θ̈ cos θ + m ℓ θ̇² sin θ = F,
//! m ℓ² θ̈ − m ℓ r̈ cos θ − m g ℓ sin θ = τ.

use crate::builder::ModelBuilder;
use crate::error::ModelError;
use crate::joint::Joint;
use crate::link::{Link, MassProperties};
use crate::model::Model;
use nalgebra::Vector3;

/// Parameters of the cart with its pendulum: a point mass on a massless rod.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct CartPendulum {
    /// m_c, kg.
    pub cart_mass: f64,
    /// m, kg.
    pub mass: f64,
    /// ℓ, m.
    pub length: f64,
    /// g, m/s².
    pub gravity: f64,
}

impl Default for CartPendulum {
    /// Thesis A.2: m_c = 2, m = 1, ℓ = 1, with g = 9.81.
    fn default() -> Self {
        Self { cart_mass: 2.0, mass: 1.0, length: 1.0, gravity: 9.81 }
    }
}

impl CartPendulum {
    /// The tree, with q = (r, θ), gravity along −z and motion in the x–z plane.
    pub fn model(&self) -> Result<Model, ModelError> {
        let mut builder = ModelBuilder::new().with_gravity(Vector3::new(0.0, 0.0, -self.gravity));
        builder.add(Link::root(
            "cart",
            Joint::Prismatic { axis: Vector3::x() },
            MassProperties::point(self.cart_mass, Vector3::zeros()),
        ))?;
        builder.add(Link::child(
            "pendulum",
            "cart",
            Joint::Revolute { axis: -Vector3::y() },
            MassProperties::point(self.mass, Vector3::new(0.0, 0.0, self.length)),
        ))?;
        builder.build()
    }
}
