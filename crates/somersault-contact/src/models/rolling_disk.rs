//! The disk that rolls on its rim.

use super::{ModelError, between};
use crate::contacts::{BodyInContact, Contact, Contacts};
use crate::laws::ContactLaw;
use crate::laws::compliant::CompliantLaw;
use crate::laws::coulomb::CoulombFriction;
use crate::surface::HalfSpace;
use nalgebra::{UnitQuaternion, Vector3};
use somersault_integrators::body::RigidBody;
use somersault_integrators::force::Gravity;
use somersault_integrators::state::RigidBodyState;

/// A thin uniform disk that rolls on its rim on the ground z = 0, under 9.81 m/s².
///
/// Let its axis e lean by θ from the vertical. Without slip there are steady motions in which the disk goes
/// round at Ω about the vertical with the component ω₃ of its angular velocity along e,
/// ```text
/// (C + m r²) Ω ω₃ sin θ − A Ω² sin θ cos θ + m g r cos θ = 0,   A = m r²/4, C = m r²/2,
/// ```
/// its centre on a circle at the velocity −r ω₃. For ω₃ = 0 the centre rests and Ω² = 4 g/(r sin θ). E. J.
/// Routh, *Advanced Dynamics of a System of Rigid Bodies*, 1905, art. 244.
#[derive(Debug, Clone)]
pub struct RollingDisk {
    /// The disk, its weight and its contact.
    pub system: BodyInContact<Gravity>,
    radius: f64,
    sag: f64,
}

impl RollingDisk {
    /// Mass (kg) and radius r (m), and the laws of contact.
    pub fn try_new(
        mass: f64,
        radius: f64,
        law: CompliantLaw,
        friction: CoulombFriction,
    ) -> Result<Self, ModelError> {
        let across = 0.25 * mass * radius * radius;
        let body = RigidBody::try_principal(mass, Vector3::new(across, across, 2.0 * across))?;
        let sag = -mass * Gravity::earth().acceleration.z / law.stiffness();
        let law = ContactLaw::from(law).with_friction(friction);
        let rim = Contact::try_rim(Vector3::zeros(), Vector3::z(), radius, HalfSpace::ground(), law)?;
        let system = BodyInContact::new(body, (Gravity::earth(), Contacts::new(vec![rim])));
        Ok(Self { system, radius, sag })
    }

    /// ω₃ (rad/s) of the steady motion with the axis leaning by `tilt` (rad) and going round at `turning`
    /// (rad/s).
    pub fn steady_spin(&self, tilt: f64, turning: f64) -> f64 {
        let gravity = -self.system.forces.0.acceleration.z;
        let (sin, cos) = tilt.sin_cos();
        (0.25 * turning * turning * sin * cos - gravity / self.radius * cos) / (1.5 * turning * sin)
    }

    /// The state of the steady motion: the disk on its springs, the axis leaning by 0 < `tilt` < π/2 (rad) from
    /// the vertical towards x, going round at `turning` ≠ 0 (rad/s), the centre on the z-axis moving along y.
    pub fn steady(&self, tilt: f64, turning: f64) -> Result<RigidBodyState, ModelError> {
        let tilt = between("tilt", tilt, 0.0, std::f64::consts::FRAC_PI_2)?;
        if turning == 0.0 || !turning.is_finite() {
            return Err(ModelError::OutOfRange {
                argument: "turning",
                found: turning,
                low: 0.0,
                high: f64::INFINITY,
            });
        }
        let spin = self.steady_spin(tilt, turning);
        let orientation = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), tilt);
        let axis = orientation * Vector3::z();
        let omega = Vector3::z() * turning + axis * (spin - turning * tilt.cos());
        let centre = Vector3::new(0.0, 0.0, self.radius * tilt.sin() - self.sag);
        let velocity = Vector3::new(0.0, -self.radius * spin, 0.0);
        Ok(RigidBodyState::new(centre, orientation, velocity, omega))
    }
}
