//! The block that slides until friction stops it.

use super::ModelError;
use crate::contacts::{BodyInContact, Contact, Contacts};
use crate::laws::ContactLaw;
use crate::laws::compliant::CompliantLaw;
use crate::laws::coulomb::CoulombFriction;
use crate::surface::HalfSpace;
use nalgebra::Vector3;
use somersault_integrators::body::RigidBody;
use somersault_integrators::force::Gravity;
use somersault_integrators::state::RigidBodyState;
use std::sync::Arc;

/// A block that slides on the ground z = 0 without tipping, under 9.81 m/s².
///
/// Friction acts through the centre of mass, so that the block does not turn: the point of contact is the
/// centre against the ground raised by half the height. In contact and in flight alike,
/// ```text
/// v = v₀ − μ (g t + ż − ż₀),   x = x₀ + v₀ t − μ (g t²/2 + z − z₀ − ż₀ t)
/// ```
/// until v is about to vanish, since m z̈ = Fₙ − m g, from the time on at which the stretch of its friction has
/// settled. Resting on its spring it stops after about v₀/(μ g), at about v₀²/(2 μ g). Friction with a stretch takes the
/// system in [`WithStretches`](crate::stretches::WithStretches).
#[derive(Debug, Clone)]
pub struct SlidingBlock {
    /// The block, its weight and its contact.
    pub system: BodyInContact<Gravity>,
    half_height: f64,
    sag: f64,
}

impl SlidingBlock {
    /// A block of some mass (kg) and side lengths (m), the last one upright, with its laws.
    pub fn try_new(
        mass: f64,
        lengths: Vector3<f64>,
        law: CompliantLaw,
        friction: CoulombFriction,
    ) -> Result<Self, ModelError> {
        let body = RigidBody::try_box(mass, lengths)?;
        let half_height = 0.5 * lengths.z;
        let ground = HalfSpace::try_new(Vector3::new(0.0, 0.0, half_height), Vector3::z())?;
        let sag = -mass * Gravity::earth().acceleration.z / law.stiffness();
        let law = ContactLaw::from(law).with_friction(friction);
        let contact = Contact::try_new(Vector3::zeros(), Arc::new(ground), law)?;
        let system = BodyInContact::new(body, (Gravity::earth(), Contacts::new(vec![contact])));
        Ok(Self { system, half_height, sag })
    }

    /// The block with its lower face at `height` (m) and a velocity (m/s).
    pub fn at(&self, height: f64, velocity: Vector3<f64>) -> RigidBodyState {
        let mut state = RigidBodyState::default();
        state.configuration.position.z = self.half_height + height;
        state.rate.linear = velocity;
        state
    }

    /// The block resting on its spring and sliding along x with `velocity` (m/s).
    pub fn sliding(&self, velocity: f64) -> RigidBodyState {
        self.at(-self.sag, Vector3::new(velocity, 0.0, 0.0))
    }

    /// The same block on a slope that falls along x by `angle` (rad): the ground stays z = 0 and the weight turns.
    #[must_use]
    pub fn on_slope(self, angle: f64) -> Self {
        let weight = Gravity::earth().acceleration.norm();
        let (sin, cos) = angle.sin_cos();
        let gravity = Gravity { acceleration: Vector3::new(weight * sin, 0.0, -weight * cos) };
        let Self { system, half_height, sag } = self;
        let system = BodyInContact::new(system.body, (gravity, system.0.forces.1));
        Self { system, half_height, sag: sag * cos }
    }
}
