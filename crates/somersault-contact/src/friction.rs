//! Friction laws and resistance to rolling and spinning, as functions of a few vectors.
//!
//! N is the normal force and v the sliding velocity, tangential to the surface; F is the friction force.
//!
//! | Law | Force | Modes | State |
//! |---|---|---|---|
//! | [`RegularisedFriction`] | F = −μ N v/√(v² + v_ε²) | none | none |
//! | [`CoulombFriction`] | F = −min(‖p‖, μ N) p/‖p‖ with p = k ξ + c v | stick and slip | the stretch ξ |
//!
//! C. A. Coulomb, *Théorie des machines simples*, 1785; spring and damper in series with a slider: P. A. Cundall,
//! O. D. L. Strack, Géotechnique 29 (1979) 47, P. R. Dahl, AIAA J. 14 (1976) 1675; the resistances: K. L. Johnson,
//! *Contact Mechanics*, 1985.

use crate::error::ContactError;
use crate::interface::Encounter;
use nalgebra::Vector3;
use somersault_core::argument::{expect_not_negative, expect_positive};

/// Friction of a contact.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum Friction {
    /// None.
    #[default]
    None,
    /// Smooth, without modes.
    Regularised(RegularisedFriction),
    /// Stick and slip.
    Coulomb(CoulombFriction),
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

/// What friction depends on.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Rubbing<'a> {
    /// Whether it slips.
    pub(crate) slips: bool,
    /// N, N.
    pub(crate) push: f64,
    pub(crate) at: &'a Encounter,
    /// ξ, m.
    pub(crate) stretch: &'a Vector3<f64>,
}

impl Friction {
    /// Whether it has modes, and so a guard.
    pub fn has_modes(&self) -> bool {
        match self {
            Self::None | Self::Regularised(_) => false,
            Self::Coulomb(_) => true,
        }
    }

    /// Whether it has a stretch, a part of the state: see [`WithStretches`](crate::stretches::WithStretches).
    pub fn has_stretch(&self) -> bool {
        match self {
            Self::None | Self::Regularised(_) => false,
            Self::Coulomb(law) => law.stiffness > 0.0,
        }
    }

    /// The force, N.
    #[inline]
    pub(crate) fn force(&self, by: Rubbing<'_>) -> Vector3<f64> {
        match self {
            Self::None => Vector3::zeros(),
            Self::Regularised(law) => law.force(by.push, &by.at.sliding),
            Self::Coulomb(law) => law.force(by.slips, by.push, by.stretch, &by.at.sliding),
        }
    }

    /// ξ̇ without the turning of the plane of contact, m/s.
    #[inline]
    pub(crate) fn stretch_rate(&self, by: Rubbing<'_>) -> Vector3<f64> {
        match self {
            Self::Coulomb(law) if law.stiffness > 0.0 => {
                law.stretch_rate(by.slips, by.push, by.stretch, &by.at.sliding)
            }
            Self::None | Self::Regularised(_) | Self::Coulomb(_) => Vector3::zeros(),
        }
    }

    /// Negative where it slips; positive without modes.
    #[inline]
    pub(crate) fn margin(&self, by: Rubbing<'_>) -> f64 {
        match self {
            Self::None | Self::Regularised(_) => 1.0,
            Self::Coulomb(law) => law.margin(by.slips, by.push, by.stretch, &by.at.sliding),
        }
    }

    /// Energy of the spring, J.
    pub(crate) fn energy(&self, stretch: &Vector3<f64>) -> f64 {
        match self {
            Self::None | Self::Regularised(_) => 0.0,
            Self::Coulomb(law) => law.energy(stretch),
        }
    }
}

/// Coulomb's law made smooth: F = −μ N v/√(v² + v_ε²).
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
        let coefficient = expect_not_negative("coefficient", coefficient)?;
        Ok(Self { coefficient, speed: expect_positive("speed", speed)? })
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

/// Coulomb's law: a spring and a damper in series with a slider.
///
/// The spring has a stretch ξ in the plane of contact, which is part of the state. With the force p that holds,
/// ```text
/// p = k ξ + c v,
/// stick, ‖p‖ ≤ μ N:   F = −p,             ξ̇ = v,
/// slip,  ‖p‖ > μ N:   F = −μ N p/‖p‖,     ξ̇ = (μ N p/‖p‖ − k ξ)/c.
/// ```
/// F and ξ̇ are continuous where the modes change, both ways. The velocity of slip v − ξ̇ is parallel to p, and
/// ‖F‖ ≤ μ N. A contact begins with ξ = 0. On curved surfaces ξ turns with the plane of contact.
///
/// A body at rest on a slope of tan α < μ stays at rest: the spring stretches by the load over k and swings
/// about that with the damping of c. In slip ξ follows the direction of sliding over a time c/k.
///
/// Without stiffness it is viscous creep up to Coulomb's bound, which holds nothing at rest and has no stretch.
///
/// With a coefficient μ_s > μ that holds, stick ends where ‖p‖ = μ_s N, and the force falls to μ N at once; slip
/// ends at ‖p‖ = μ N as before.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CoulombFriction {
    coefficient: f64,
    holding: f64,
    stiffness: f64,
    damping: f64,
}

impl CoulombFriction {
    /// Coefficient μ ≥ 0, stiffness k ≥ 0 (N/m) and damping c > 0 (N s/m).
    pub fn try_new(coefficient: f64, stiffness: f64, damping: f64) -> Result<Self, ContactError> {
        let coefficient = expect_not_negative("coefficient", coefficient)?;
        Ok(Self {
            coefficient,
            holding: coefficient,
            stiffness: expect_not_negative("stiffness", stiffness)?,
            damping: expect_positive("damping", damping)?,
        })
    }

    /// Coefficient μ ≥ 0, stiffness k > 0 (N/m) and the damping ratio ζ > 0 of a mass (kg) that sticks:
    /// c = 2 ζ √(k m).
    pub fn from_damping_ratio(
        coefficient: f64,
        stiffness: f64,
        mass: f64,
        damping_ratio: f64,
    ) -> Result<Self, ContactError> {
        let (stiffness, mass) = (expect_positive("stiffness", stiffness)?, expect_positive("mass", mass)?);
        let ratio = expect_positive("damping_ratio", damping_ratio)?;
        Self::try_new(coefficient, stiffness, 2.0 * ratio * (stiffness * mass).sqrt())
    }

    /// The same with a coefficient μ_s ≥ μ up to which it sticks.
    pub fn with_static(self, coefficient: f64) -> Result<Self, ContactError> {
        if coefficient.is_finite() && coefficient >= self.coefficient {
            Ok(Self { holding: coefficient, ..self })
        } else {
            Err(ContactError::StaticCoefficient { found: coefficient, kinetic: self.coefficient })
        }
    }

    /// μ.
    pub fn coefficient(&self) -> f64 {
        self.coefficient
    }

    /// μ_s, the coefficient up to which it sticks: μ unless given.
    pub fn static_coefficient(&self) -> f64 {
        self.holding
    }

    /// k, N/m.
    pub fn stiffness(&self) -> f64 {
        self.stiffness
    }

    /// c, N s/m.
    pub fn damping(&self) -> f64 {
        self.damping
    }

    /// The force that holds, p = k ξ + c v, N.
    #[inline]
    pub fn hold(&self, stretch: &Vector3<f64>, sliding: &Vector3<f64>) -> Vector3<f64> {
        stretch * self.stiffness + sliding * self.damping
    }

    /// p in stick and μ N p/‖p‖ in slip, N.
    #[inline]
    fn held(&self, slips: bool, push: f64, stretch: &Vector3<f64>, sliding: &Vector3<f64>) -> Vector3<f64> {
        let hold = self.hold(stretch, sliding);
        if slips { hold.try_normalize(0.0).unwrap_or_default() * (self.coefficient * push) } else { hold }
    }

    /// The force in stick or slip, N.
    #[inline]
    pub fn force(
        &self,
        slips: bool,
        normal_force: f64,
        stretch: &Vector3<f64>,
        sliding: &Vector3<f64>,
    ) -> Vector3<f64> {
        -self.held(slips, normal_force, stretch, sliding)
    }

    /// ξ̇ on a plane in stick or slip, m/s.
    #[inline]
    pub fn stretch_rate(
        &self,
        slips: bool,
        normal_force: f64,
        stretch: &Vector3<f64>,
        sliding: &Vector3<f64>,
    ) -> Vector3<f64> {
        if slips {
            (self.held(true, normal_force, stretch, sliding) - stretch * self.stiffness) / self.damping
        } else {
            *sliding
        }
    }

    /// The coefficient at which stick, or slip, ends.
    #[inline]
    pub(crate) fn bound(&self, slips: bool) -> f64 {
        if slips { self.coefficient } else { self.holding }
    }

    /// (μ N)² − p², N², with μ_s for μ in stick: negative where it slips.
    #[inline]
    pub fn margin(
        &self,
        slips: bool,
        normal_force: f64,
        stretch: &Vector3<f64>,
        sliding: &Vector3<f64>,
    ) -> f64 {
        let bound = self.bound(slips) * normal_force;
        bound * bound.abs() - self.hold(stretch, sliding).norm_squared()
    }

    /// ½ k ξ², J.
    pub fn energy(&self, stretch: &Vector3<f64>) -> f64 {
        0.5 * self.stiffness * stretch.norm_squared()
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
            rolling: expect_not_negative("rolling", rolling)?,
            spinning: expect_not_negative("spinning", spinning)?,
            speed: expect_positive("speed", speed)?,
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
