//! Friction laws and resistance to rolling and spinning, as functions of a few vectors.
//!
//! Fₙ is the normal force and v the sliding velocity, tangential to the surface; F is the friction force.
//!
//! | Law | Force | Modes |
//! |---|---|---|
//! | [`RegularisedFriction`] | F = −μ Fₙ v/√(v² + v_ε²) | none |
//! | [`CoulombFriction`] | sticking F = −k ξ − c v, sliding F = −μ Fₙ v/‖v‖ | two |
//! | [`CreepFriction`] | F = −min(c ‖v‖, μ Fₙ) v/‖v‖ | two |
//!
//! C. A. Coulomb, *Théorie des machines simples*, 1785; the spring that sticking stretches: P. A. Cundall,
//! O. D. L. Strack, Géotechnique 29 (1979) 47; the resistances: K. L. Johnson, *Contact Mechanics*, 1985.

use crate::error::{ContactError, not_negative, positive};
use nalgebra::Vector3;

/// Friction of a contact.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum Friction {
    /// None.
    #[default]
    None,
    /// Smooth, without modes.
    Regularised(RegularisedFriction),
    /// Stick and slip, for points of a body.
    Coulomb(CoulombFriction),
    /// Creep and sliding, for whatever rolls.
    Creep(CreepFriction),
}

impl From<RegularisedFriction> for Friction {
    fn from(law: RegularisedFriction) -> Self {
        Self::Regularised(law)
    }
}

impl From<CoulombFriction> for Friction {
    fn from(law: CoulombFriction) -> Self {
        Self::Coulomb(law)
    }
}

impl From<CreepFriction> for Friction {
    fn from(law: CreepFriction) -> Self {
        Self::Creep(law)
    }
}

impl Friction {
    /// Whether it has modes, and so a guard.
    pub fn has_modes(&self) -> bool {
        matches!(self, Self::Coulomb(_) | Self::Creep(_))
    }
}

/// Coulomb's law made smooth: F = −μ Fₙ v/√(v² + v_ε²).
///
/// It cannot hold a body on a slope: it slides on at about v_ε times load over μ Fₙ.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RegularisedFriction {
    coefficient: f64,
    speed: f64,
}

impl RegularisedFriction {
    /// Coefficient μ ≥ 0 and the speed v_ε > 0 (m/s) over which the force builds up.
    pub fn try_new(coefficient: f64, speed: f64) -> Result<Self, ContactError> {
        let coefficient = not_negative("coefficient", coefficient)?;
        Ok(Self { coefficient, speed: positive("speed", speed)? })
    }

    /// μ.
    pub fn coefficient(&self) -> f64 {
        self.coefficient
    }

    /// v_ε, m/s.
    pub fn speed(&self) -> f64 {
        self.speed
    }

    /// The force, N.
    #[inline]
    pub fn force(&self, normal_force: f64, sliding: &Vector3<f64>) -> Vector3<f64> {
        let scale = (sliding.norm_squared() + self.speed * self.speed).sqrt();
        sliding * (-self.coefficient * normal_force / scale)
    }
}

/// Coulomb's law with a spring and damper that hold while the contact sticks.
///
/// Sticking begins where the velocity along the direction of sliding passes zero, and the spring begins
/// unstretched: ξ is the way of the point since then. It ends where ‖k ξ + c v‖ reaches μ Fₙ; then the
/// energy of the spring is lost. The force that holds is small when sticking begins, so that the spring takes
/// time to stretch to the cone and the modes cannot chatter. A load that sets in at once makes it swing: the
/// cone must hold twice the load without damping, and 1 + e⁻² times with critical damping.
///
/// Located events keep the order where sliding is straight as it stops. Where it is not, the direction
/// turns faster and faster towards the end, like a power of the time that is left, and the stop costs order.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CoulombFriction {
    coefficient: f64,
    stiffness: f64,
    damping: f64,
}

impl CoulombFriction {
    /// Coefficient μ ≥ 0, and stiffness k > 0 (N/m) and damping c ≥ 0 (N s/m) of sticking.
    pub fn try_new(coefficient: f64, stiffness: f64, damping: f64) -> Result<Self, ContactError> {
        Ok(Self {
            coefficient: not_negative("coefficient", coefficient)?,
            stiffness: positive("stiffness", stiffness)?,
            damping: not_negative("damping", damping)?,
        })
    }

    /// μ.
    pub fn coefficient(&self) -> f64 {
        self.coefficient
    }

    /// k, N/m.
    pub fn stiffness(&self) -> f64 {
        self.stiffness
    }

    /// c, N s/m.
    pub fn damping(&self) -> f64 {
        self.damping
    }

    /// The force that holds, −k ξ − c v, N.
    #[inline]
    pub fn sticking(&self, stretch: &Vector3<f64>, sliding: &Vector3<f64>) -> Vector3<f64> {
        stretch * -self.stiffness - sliding * self.damping
    }

    /// The force against sliding, −μ Fₙ v/‖v‖, N, continued smoothly through a straight stop: beyond it,
    /// where v points against `direction`, it keeps its sign.
    ///
    /// Sliding in one direction goes on while [`heading`](Self::heading) is positive, away from where the
    /// sign changes.
    #[inline]
    pub fn slipping(
        &self,
        normal_force: f64,
        sliding: &Vector3<f64>,
        direction: &Vector3<f64>,
    ) -> Vector3<f64> {
        let speed = sliding.norm();
        let along = if speed > 0.0 { sliding / speed.copysign(sliding.dot(direction)) } else { *direction };
        along * (-self.coefficient * normal_force)
    }

    /// v · d − ½ ‖v‖, m/s, for the direction d: negative where v has passed zero along d, or has turned away
    /// from it by more than 60°.
    #[inline]
    pub fn heading(&self, sliding: &Vector3<f64>, direction: &Vector3<f64>) -> f64 {
        sliding.dot(direction) - 0.5 * sliding.norm()
    }

    /// (μ Fₙ)² − F², N²: negative where the cone does not hold the force F.
    #[inline]
    pub fn margin(&self, normal_force: f64, force: &Vector3<f64>) -> f64 {
        (self.coefficient * normal_force).powi(2) - force.norm_squared()
    }

    /// Whether spring and damper can stop a mass (kg) at this sliding speed within the cone:
    /// (c + √(k m)) ‖v‖ ≤ μ Fₙ.
    pub fn stops(&self, normal_force: f64, sliding: &Vector3<f64>, mass: f64) -> bool {
        (self.damping + (self.stiffness * mass).sqrt()) * sliding.norm() <= self.coefficient * normal_force
    }
}

/// Viscous creep up to Coulomb's bound: F = −min(c ‖v‖, μ Fₙ) v/‖v‖.
///
/// The force is continuous and its modes, creep and sliding, differ by a kink. For rolling bodies, whose
/// point of contact wanders, so that no spring can be anchored; the rolling is without slip in the limit of
/// large c.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CreepFriction {
    coefficient: f64,
    damping: f64,
}

impl CreepFriction {
    /// Coefficient μ ≥ 0 and damping c > 0 (N s/m).
    pub fn try_new(coefficient: f64, damping: f64) -> Result<Self, ContactError> {
        let coefficient = not_negative("coefficient", coefficient)?;
        Ok(Self { coefficient, damping: positive("damping", damping)? })
    }

    /// μ.
    pub fn coefficient(&self) -> f64 {
        self.coefficient
    }

    /// c, N s/m.
    pub fn damping(&self) -> f64 {
        self.damping
    }

    /// −c v, N.
    #[inline]
    pub fn creeping(&self, sliding: &Vector3<f64>) -> Vector3<f64> {
        sliding * -self.damping
    }

    /// −μ Fₙ v/‖v‖, N; zero at rest.
    #[inline]
    pub fn slipping(&self, normal_force: f64, sliding: &Vector3<f64>) -> Vector3<f64> {
        let speed = sliding.norm();
        if speed > 0.0 { sliding * (-self.coefficient * normal_force / speed) } else { Vector3::zeros() }
    }

    /// (μ Fₙ)² − (c v)², N²: negative where it slides.
    #[inline]
    pub fn margin(&self, normal_force: f64, sliding: &Vector3<f64>) -> f64 {
        (self.coefficient * normal_force).powi(2) - (self.damping * self.damping) * sliding.norm_squared()
    }
}

/// Couples against rolling and spinning, with ω the relative angular velocity, split along the normal n:
/// ```text
/// M = −Fₙ (b ω_t/√(ω_t² + ω_ε²) + s ωₙ n/√(ωₙ² + ω_ε²)).
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Resistance {
    rolling: f64,
    spinning: f64,
    speed: f64,
}

impl Resistance {
    /// Lengths b ≥ 0 of rolling and s ≥ 0 of spinning resistance (m), and the angular speed ω_ε > 0 (rad/s)
    /// over which the couples build up.
    ///
    /// b is the coefficient of rolling resistance times the radius; a disk of contact of radius a under
    /// uniform pressure has s = ⅔ μ a.
    pub fn try_new(rolling: f64, spinning: f64, speed: f64) -> Result<Self, ContactError> {
        Ok(Self {
            rolling: not_negative("rolling", rolling)?,
            spinning: not_negative("spinning", spinning)?,
            speed: positive("speed", speed)?,
        })
    }

    /// b, m.
    pub fn rolling(&self) -> f64 {
        self.rolling
    }

    /// s, m.
    pub fn spinning(&self) -> f64 {
        self.spinning
    }

    /// ω_ε, rad/s.
    pub fn speed(&self) -> f64 {
        self.speed
    }

    /// Whether it never acts.
    pub fn is_none(&self) -> bool {
        self.rolling == 0.0 && self.spinning == 0.0
    }

    /// The couple, N m.
    #[inline]
    pub fn couple(&self, normal_force: f64, normal: &Vector3<f64>, turning: &Vector3<f64>) -> Vector3<f64> {
        let about = normal.dot(turning);
        let across = turning - normal * about;
        let square = self.speed * self.speed;
        let rolling = self.rolling / (across.norm_squared() + square).sqrt();
        let spinning = self.spinning / (about * about + square).sqrt();
        (across * rolling + normal * (spinning * about)) * -normal_force
    }
}
