//! The bouncing ball.

use super::ModelError;
use crate::contacts::{BodyInContact, Contact, Contacts};
use crate::laws::compliant::CompliantLaw;
use crate::surface::HalfSpace;
use nalgebra::Vector3;
use somersault_integrators::body::{BodyError, RigidBody};
use somersault_integrators::force::Gravity;
use somersault_integrators::state::RigidBodyState;
use std::sync::Arc;

/// A ball on the ground z = 0, under weight, that touches with its lowest point, without friction.
#[derive(Debug, Clone)]
pub struct BouncingBall {
    /// The ball, its weight and its contact.
    pub system: BodyInContact<Gravity>,
    radius: f64,
}

impl BouncingBall {
    /// A solid ball of some mass (kg) and radius (m) with a contact law, under 9.81 m/s².
    pub fn try_new(mass: f64, radius: f64, law: CompliantLaw) -> Result<Self, ModelError> {
        let inertia = somersault_core::Inertia::try_sphere(mass, radius).map_err(BodyError::from)?;
        let body = RigidBody::try_new(mass, inertia)?;
        let contact = Contact::try_ball(Vector3::zeros(), radius, Arc::new(HalfSpace::ground()), law)?;
        let system = BodyInContact::new(body, (Gravity::earth(), Contacts::new(vec![contact])));
        Ok(Self { system, radius })
    }

    /// The ball with its lowest point at `height` (m), moving up with `velocity` (m/s).
    pub fn at(&self, height: f64, velocity: f64) -> RigidBodyState {
        let mut state = RigidBodyState::default();
        state.configuration.position.z = self.radius + height;
        state.rate.linear.z = velocity;
        state
    }
}
