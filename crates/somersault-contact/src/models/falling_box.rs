//! The box dropped on a corner.

use super::ModelError;
use crate::contacts::{BodyInContact, Contact, Contacts};
use crate::laws::ContactLaw;
use crate::surface::HalfSpace;
use nalgebra::{UnitQuaternion, Vector3};
use somersault_integrators::body::RigidBody;
use somersault_integrators::force::Gravity;
use somersault_integrators::state::RigidBodyState;
use std::sync::Arc;

/// A box that touches the ground z = 0 with its eight corners, under 9.81 m/s².
#[derive(Debug, Clone)]
pub struct FallingBox {
    /// The box, its weight and its contacts.
    pub system: BodyInContact<Gravity>,
    half_lengths: Vector3<f64>,
}

impl FallingBox {
    /// A box of some mass (kg) and side lengths (m) with one law for all corners.
    ///
    /// Corner i is at the positive end of axis j where bit j of i is set.
    pub fn try_new(mass: f64, lengths: Vector3<f64>, law: impl Into<ContactLaw>) -> Result<Self, ModelError> {
        let body = RigidBody::try_box(mass, lengths)?;
        let (half_lengths, law, ground) = (0.5 * lengths, law.into(), Arc::new(HalfSpace::ground()));
        let corner = |i: usize| {
            let sign = |axis: usize| if i >> axis & 1 == 1 { 1.0 } else { -1.0 };
            let point = half_lengths.component_mul(&Vector3::from_fn(|axis, _| sign(axis)));
            Contact::try_new(point, ground.clone(), law.clone())
        };
        let corners = (0..8).map(corner).collect::<Result<Vec<_>, _>>()?;
        let system = BodyInContact::new(body, (Gravity::earth(), Contacts::new(corners)));
        Ok(Self { system, half_lengths })
    }

    /// At rest, with the diagonal through corner 0 upright and that corner at `height` (m), the first axis
    /// turned by `heading` (rad) about the vertical.
    pub fn on_corner(&self, height: f64, heading: f64) -> RigidBodyState {
        let down = -self.half_lengths;
        let upright =
            UnitQuaternion::rotation_between(&down, &-Vector3::z()).unwrap_or_else(UnitQuaternion::identity);
        let turned = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), heading) * upright;
        let centre = Vector3::new(0.0, 0.0, height + down.norm());
        RigidBodyState::new(centre, turned, Vector3::zeros(), Vector3::zeros())
    }
}
