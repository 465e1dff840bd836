//! The tippe top.

use super::{ModelError, between};
use crate::contacts::{BodyInContact, Contact, Contacts};
use crate::laws::ContactLaw;
use crate::surface::HalfSpace;
use nalgebra::{UnitQuaternion, Vector3};
use somersault_integrators::body::RigidBody;
use somersault_integrators::force::Gravity;
use somersault_integrators::state::RigidBodyState;
use std::sync::Arc;

/// An eccentric sphere on the ground z = 0, under 9.81 m/s², which friction turns upside down.
///
/// Radius R, the centre of mass αR below the centre of the sphere, moments A across the axis of symmetry e
/// and C about it. With a = αR e − R n the arm of the contact, Jellett's quantity
/// ```text
/// λ = −L · a
/// ```
/// is constant whatever the force at the contact: λ̇ = −(a × F) · a − αR L · (ω × e), and both terms vanish.
/// Friction lowers the energy as far as λ allows. With z the cosine of the axis' lean the minimum energy is
/// ```text
/// V(z) = λ²/(2R² (A (1 − z²) + C (z − α)²)) − m g R α z,
/// ```
/// which near z = −1 rises with z, so that the top on its head is stable, where A/C < 1 + α and
/// ```text
/// λ > √(m g R³ C α) (1 + α)²/√(1 + α − A/C),
/// ```
/// and near z = 1 falls with z, so that the top upright is stable, for every λ where A/C < 1 − α. Tops turn
/// over for 1 − α < A/C < 1 + α.
///
/// J. H. Jellett, *A Treatise on the Theory of Friction*, 1872; R. J. Cohen, Am. J. Phys. 45 (1977) 12; S.
/// Rauch-Wojciechowski, M. Sköldstam, T. Glad, Regul. Chaotic Dyn. 10 (2005) 333.
#[derive(Debug, Clone)]
pub struct TippeTop {
    /// The top, its weight and its contact.
    pub system: BodyInContact<Gravity>,
    radius: f64,
    offset: f64,
}

impl TippeTop {
    /// Mass (kg), radius R (m), eccentricity 0 < α < 1, moments A and C (kg m²) and the laws of contact.
    pub fn try_new(
        mass: f64,
        radius: f64,
        eccentricity: f64,
        (across, about): (f64, f64),
        law: impl Into<ContactLaw>,
    ) -> Result<Self, ModelError> {
        let body = RigidBody::try_principal(mass, Vector3::new(across, across, about))?;
        let offset = radius * between("eccentricity", eccentricity, 0.0, 1.0)?;
        let centre = Vector3::new(0.0, 0.0, offset);
        let contact = Contact::try_ball(centre, radius, Arc::new(HalfSpace::ground()), law)?;
        let system = BodyInContact::new(body, (Gravity::earth(), Contacts::new(vec![contact])));
        Ok(Self { system, radius, offset })
    }

    /// The sphere `sag` (m) into the ground, its axis leaning by `tilt` (rad) from the upward vertical towards
    /// x, spinning about the axis at `spin` (rad/s).
    pub fn spinning(&self, tilt: f64, spin: f64, sag: f64) -> RigidBodyState {
        let orientation = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), tilt);
        let axis = orientation * Vector3::z();
        let centre = Vector3::new(0.0, 0.0, self.radius - sag) - axis * self.offset;
        RigidBodyState::new(centre, orientation, Vector3::zeros(), axis * spin)
    }

    /// Cosine of the angle between the axis and the vertical: −1 where the top stands on its head.
    pub fn uprightness(&self, x: &RigidBodyState) -> f64 {
        (x.orientation() * Vector3::z()).z
    }

    /// Jellett's quantity λ, kg m³/s.
    pub fn jellett(&self, x: &RigidBodyState) -> f64 {
        let arm = x.orientation() * Vector3::new(0.0, 0.0, self.offset) - Vector3::z() * self.radius;
        -self.system.body.angular_momentum(x).dot(&arm)
    }

    /// The least λ with which the top on its head is the only stable spin, kg m³/s; `None` where A/C does
    /// not lie between 1 − α and 1 + α.
    pub fn threshold(&self) -> Option<f64> {
        let body = &self.system.body;
        let moments = body.inertia().tensor();
        let (eccentricity, ratio) = (self.offset / self.radius, moments[(0, 0)] / moments[(2, 2)]);
        let weight = -body.mass() * self.system.forces.0.acceleration.z;
        let scale = (weight * self.radius.powi(3) * moments[(2, 2)] * eccentricity).sqrt();
        let inverts = ratio > 1.0 - eccentricity && ratio < 1.0 + eccentricity;
        inverts.then(|| scale * (1.0 + eccentricity).powi(2) / (1.0 + eccentricity - ratio).sqrt())
    }
}
