//! The spinning top of the thesis.

use super::ModelError;
use crate::contacts::{BodyInContact, Contact, Contacts};
use crate::laws::compliant::CompliantLaw;
use crate::surface::HalfSpace;
use nalgebra::{UnitQuaternion, Vector3};
use somersault_integrators::body::RigidBody;
use somersault_integrators::force::Gravity;
use somersault_integrators::state::RigidBodyState;
use std::sync::Arc;

/// The spinning top of thesis 7.3.2: a disk with a tip, on frictionless ground.
#[derive(Debug, Clone)]
pub struct SpinningTop {
    /// The top, its weight and the contact of its tip.
    pub system: BodyInContact<Gravity>,
    /// The initial state.
    pub start: RigidBodyState,
}

impl SpinningTop {
    /// The top as the thesis gives it: 0.2 kg, I = diag(0.817, 0.817, 1.6)·10⁻⁴ kg m² as printed, the tip
    /// 0.05 m below the centre of mass, ωₙ = 2π·50 rad/s and ζ = 0.1, so that k = 19 739.2 N/m and
    /// c = 12.566 N s/m; the centre of mass 0.05 m above the ground, the axis along (0, 1, 4), spinning at
    /// 32π rad/s.
    ///
    /// Gravity, which the thesis does not state, is 9.81 m/s².
    pub fn thesis() -> Result<Self, ModelError> {
        const MASS: f64 = 0.2;
        let body = RigidBody::try_principal(MASS, Vector3::new(0.817e-4, 0.817e-4, 1.6e-4))?;
        let law = CompliantLaw::from_frequency(MASS, 100.0 * std::f64::consts::PI, 0.1)?;
        let tip = Contact::try_new(Vector3::new(0.0, 0.0, -0.05), Arc::new(HalfSpace::ground()), law)?;
        let system = BodyInContact::new(body, (Gravity::earth(), Contacts::new(vec![tip])));
        // Body and world x-axes are parallel, so the top leans by a turn about x that takes z to (0, 1, 4).
        let lean = -(0.25f64).atan();
        let orientation = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), lean);
        let spin = orientation * Vector3::new(0.0, 0.0, 32.0 * std::f64::consts::PI);
        let centre = Vector3::new(0.0, 0.0, 0.05);
        Ok(Self { system, start: RigidBodyState::new(centre, orientation, Vector3::zeros(), spin) })
    }
}
