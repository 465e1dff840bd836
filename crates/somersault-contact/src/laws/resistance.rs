//! Resistance to rolling and spinning. K. L. Johnson, *Contact Mechanics*, 1985.

use super::encounter::Encounter;
use super::regularised::saturated;
use crate::error::ContactError;
use nalgebra::Vector3;
use somersault_core::argument::{expect_not_negative, expect_positive};

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

    /// Derivative of the couple along changes of the normal force and of the encounter.
    #[inline]
    pub(super) fn couple_derivative(
        &self,
        (push, push_change): (f64, f64),
        at: &Encounter,
        along: &Encounter,
    ) -> Vector3<f64> {
        let (normal, normal_change) = (&at.normal, &along.normal);
        let about = normal.dot(&at.turning);
        let about_change = normal_change.dot(&at.turning) + normal.dot(&along.turning);
        let (spin, spin_change) = (normal * about, normal_change * about + normal * about_change);
        let speed = (self.speed, 0.0);
        let (rolling, rolling_change) =
            saturated(&(at.turning - spin), &(along.turning - spin_change), speed);
        let (spinning, spinning_change) = saturated(&spin, &spin_change, speed);
        (rolling * self.rolling + spinning * self.spinning) * -push_change
            - (rolling_change * self.rolling + spinning_change * self.spinning) * push
    }

    /// Upper bound of the derivative of the couple by the angular velocity, N m s/rad, under a normal force.
    pub(super) fn damping(&self, normal_force: f64) -> f64 {
        self.rolling.max(self.spinning) * normal_force / self.speed
    }
}
