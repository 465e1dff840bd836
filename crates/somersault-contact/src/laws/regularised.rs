//! Friction without modes.

use super::friction_law::{
    FrictionChange, FrictionDerivative, FrictionInput, FrictionLaw, FrictionResponse, StiffestFriction,
};
use super::normal_law::Stiffest;
use crate::error::ContactError;
use nalgebra::Vector3;
use somersault_core::argument::{expect_not_negative, expect_positive};

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
}

impl FrictionLaw for RegularisedFriction {
    #[inline]
    fn response(&self, by: &FrictionInput<'_>) -> FrictionResponse {
        let sliding = &by.at.sliding;
        let scale = (sliding.norm_squared() + self.speed * self.speed).sqrt();
        let force = sliding * (-self.coefficient * by.normal_force / scale);
        FrictionResponse { force, ..FrictionResponse::default() }
    }

    fn stiffest(&self, normal: &Stiffest) -> StiffestFriction {
        StiffestFriction {
            damping: self.coefficient * normal.force / self.speed,
            ..StiffestFriction::default()
        }
    }

    fn parameters(&self) -> &'static [&'static str] {
        &["coefficient", "speed"]
    }

    fn derivative(&self, of: &FrictionInput<'_>, along: &FrictionChange<'_>) -> Option<FrictionDerivative> {
        let [coefficient, speed] = along.parameters();
        let (direction, change) = saturated(&of.at.sliding, &along.at.sliding, (self.speed, speed));
        let bound_change = coefficient * of.normal_force + self.coefficient * along.normal_force;
        let force = direction * -bound_change - change * (self.coefficient * of.normal_force);
        Some(FrictionDerivative { force, ..FrictionDerivative::default() })
    }
}

/// v/√(v² + w²) and its derivative along changes of v and w.
#[inline]
pub(super) fn saturated(
    v: &Vector3<f64>,
    change: &Vector3<f64>,
    (w, w_change): (f64, f64),
) -> (Vector3<f64>, Vector3<f64>) {
    let scale = (v.norm_squared() + w * w).sqrt();
    let value = v / scale;
    (value, (change - value * (value.dot(change) + w / scale * w_change)) / scale)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::laws::checks::check_friction_law;

    #[test]
    fn the_law_is_what_its_trait_asks() {
        check_friction_law(|[mu, v]: [f64; 2]| RegularisedFriction::try_new(0.3 + mu, 0.1 + v).unwrap());
    }
}
