//! The two-link robot arm on a horizontal plane (thesis 8.2, with M₁₂ corrected).
//!
//! M₁₁ = m₁L₁²/4 + m₂(L₁² + L₁L₂ cos θ₂ + L₂²/4) + I₁ + I₂, M₁₂ = m₂(L₂²/4 + ½ L₁L₂ cos θ₂) + I₂,
//! M₂₂ = m₂L₂²/4 + I₂, I = mL²/12 each;
//! C = (−½ L₁L₂m₂ θ̇₂(2θ̇₁ + θ̇₂) sin θ₂ + c₁θ̇₁, ½ L₁L₂m₂ θ̇₁² sin θ₂ + c₂θ̇₂).

use crate::builder::ModelBuilder;
use crate::error::ModelError;
use crate::joint::Joint;
use crate::link::{Link, MassProperties};
use crate::model::Model;
use nalgebra::Vector3;

/// Parameters of the arm: two uniform rods.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TwoLinkArm {
    /// m₁, m₂, kg.
    pub masses: [f64; 2],
    /// L₁, L₂, m.
    pub lengths: [f64; 2],
    /// c₁, c₂, N m s.
    pub damping: [f64; 2],
}

impl Default for TwoLinkArm {
    /// Thesis Table 8.1.
    fn default() -> Self {
        Self { masses: [0.5, 0.5], lengths: [2.0, 0.5], damping: [0.2, 0.0] }
    }
}

impl TwoLinkArm {
    /// The tree, with q = (θ₁, θ₂) about z and no gravity; links lie along x at q = 0.
    pub fn model(&self) -> Result<Model, ModelError> {
        for (name, found) in ["upper", "lower"].into_iter().zip(self.lengths) {
            if !(found > 0.0 && found.is_finite()) {
                return Err(ModelError::NotPositive { argument: "lengths", name: name.to_owned(), found });
            }
        }
        let joint = Joint::Revolute { axis: Vector3::z() };
        let rod =
            |i: usize| MassProperties::rod(self.masses[i], Vector3::zeros(), Vector3::x() * self.lengths[i]);
        let mut builder = ModelBuilder::new().with_gravity(Vector3::zeros());
        builder.add(Link::root("upper", joint, rod(0)).with_damping(self.damping[0]))?;
        builder.add(
            Link::child("lower", "upper", joint, rod(1))
                .at(Vector3::x() * self.lengths[0])
                .with_damping(self.damping[1]),
        )?;
        builder.build()
    }
}
