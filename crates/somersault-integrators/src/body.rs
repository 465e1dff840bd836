//! The rigid body: mass and inertia.

use crate::state::{Pose, RigidBodyState};
use nalgebra::{UnitQuaternion, Vector3};
use somersault_core::{Inertia, InertiaError, PrincipalMoments};

/// Why a rigid body cannot be made.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum BodyError {
    /// The mass is not a positive finite number.
    #[error("`mass` must be positive and finite, found {found}")]
    Mass {
        /// The value given.
        found: f64,
    },
    /// The inertia is not one of a rigid body.
    #[error(transparent)]
    Inertia(#[from] InertiaError),
}

/// A rigid body: mass (kg) and inertia about its centre of mass, in the body frame (kg m²).
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(try_from = "Parts"))]
pub struct RigidBody {
    mass: f64,
    inertia: Inertia,
}

/// A body as files hold it.
#[cfg(feature = "serde")]
#[derive(serde::Deserialize)]
struct Parts {
    mass: f64,
    inertia: Inertia,
}

#[cfg(feature = "serde")]
impl TryFrom<Parts> for RigidBody {
    type Error = BodyError;

    fn try_from(Parts { mass, inertia }: Parts) -> Result<Self, BodyError> {
        Self::try_new(mass, inertia)
    }
}

/// A rigid body whose axes are its principal ones, in the least room that it takes: of many bodies in arrays.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PrincipalBody {
    mass: f64,
    moments: PrincipalMoments,
}

impl PrincipalBody {
    /// A body of the given mass and principal moments.
    #[inline]
    pub fn try_new(mass: f64, moments: Vector3<f64>) -> Result<Self, BodyError> {
        let moments = PrincipalMoments::try_new(moments)?;
        check_mass(mass)?;
        Ok(Self { mass, moments })
    }
}

impl From<PrincipalBody> for RigidBody {
    fn from(PrincipalBody { mass, moments }: PrincipalBody) -> Self {
        Self { mass, inertia: moments.into() }
    }
}

/// The principal frame of a body, on which its rotation depends where no torque acts.
pub trait PrincipalFrame {
    /// Principal moments of inertia, kg m².
    fn moments(&self) -> &Vector3<f64>;
    /// Rotation from the principal frame to the body frame.
    fn axes(&self) -> UnitQuaternion<f64>;
}

impl PrincipalFrame for RigidBody {
    #[inline]
    fn moments(&self) -> &Vector3<f64> {
        self.inertia.principal_moments()
    }
    #[inline]
    fn axes(&self) -> UnitQuaternion<f64> {
        *self.inertia.principal_axes()
    }
}

impl PrincipalFrame for PrincipalBody {
    #[inline]
    fn moments(&self) -> &Vector3<f64> {
        self.moments.as_vector()
    }
    #[inline]
    fn axes(&self) -> UnitQuaternion<f64> {
        UnitQuaternion::identity()
    }
}

#[inline]
fn check_mass(mass: f64) -> Result<(), BodyError> {
    if mass.is_finite() && mass >= f64::MIN_POSITIVE { Ok(()) } else { Err(BodyError::Mass { found: mass }) }
}

impl RigidBody {
    /// A body of the given mass and inertia.
    #[inline]
    pub fn try_new(mass: f64, inertia: Inertia) -> Result<Self, BodyError> {
        check_mass(mass)?;
        Ok(Self { mass, inertia })
    }

    /// The same body with a mass near its own, which a difference quotient needs.
    pub(crate) fn with_mass(&self, mass: f64) -> Self {
        Self { mass, ..*self }
    }

    /// The same body with its inertia multiplied by a factor near 1, which a difference quotient needs.
    pub(crate) fn with_inertia_scaled(&self, factor: f64) -> Result<Self, BodyError> {
        Ok(Self { inertia: self.inertia.scaled(factor)?, ..*self })
    }

    /// A body whose axes are principal axes with the given moments.
    #[inline]
    pub fn try_principal(mass: f64, moments: Vector3<f64>) -> Result<Self, BodyError> {
        PrincipalBody::try_new(mass, moments).map(Self::from)
    }

    /// A solid box with full side lengths `lengths` (m).
    pub fn try_box(mass: f64, lengths: Vector3<f64>) -> Result<Self, BodyError> {
        Self::try_new(mass, Inertia::try_box(mass, lengths)?)
    }

    /// Mass, kg.
    #[inline]
    pub fn mass(&self) -> f64 {
        self.mass
    }

    /// Inertia about the centre of mass in the body frame.
    #[inline]
    pub fn inertia(&self) -> &Inertia {
        &self.inertia
    }

    /// Angular momentum about the centre of mass, R I Rᵀ ω, world frame, kg m²/s.
    pub fn angular_momentum(&self, x: &RigidBodyState) -> Vector3<f64> {
        angular_momentum(self, &x.configuration, x.angular_velocity())
    }

    /// Kinetic energy of the rotation, ω · L/2, J.
    pub fn rotational_energy(&self, x: &RigidBodyState) -> f64 {
        0.5 * x.angular_velocity().dot(&self.angular_momentum(x))
    }

    /// Kinetic energy of translation and rotation, m v²/2 + ω · L/2, J.
    pub fn kinetic_energy(&self, x: &RigidBodyState) -> f64 {
        0.5 * self.mass * x.velocity().norm_squared() + self.rotational_energy(x)
    }
}

/// I ω in the world frame.
#[inline(always)]
pub(crate) fn angular_momentum(body: &RigidBody, pose: &Pose, omega: &Vector3<f64>) -> Vector3<f64> {
    let r = pose.orientation.to_rotation_matrix().into_inner();
    r * body.inertia().momentum(&r.tr_mul(omega))
}
