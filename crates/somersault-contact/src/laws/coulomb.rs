//! Friction that sticks and slips.
//!
//! C. A. Coulomb, *Théorie des machines simples*, 1785; spring and damper in series with a slider: P. A. Cundall,
//! O. D. L. Strack, Géotechnique 29 (1979) 47, P. R. Dahl, AIAA J. 14 (1976) 1675.

use super::friction_law::{
    FrictionChange, FrictionDerivative, FrictionInput, FrictionLaw, FrictionResponse, FrictionSpring,
    StiffestFriction,
};
use super::normal_law::Stiffest;
use crate::error::ContactError;
use nalgebra::Vector3;
use somersault_core::argument::{expect_not_negative, expect_positive};

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

    /// The coefficient at which stick, or slip, ends.
    #[inline]
    fn bound(&self, slips: bool) -> f64 {
        if slips { self.coefficient } else { self.holding }
    }
}

impl FrictionLaw for CoulombFriction {
    #[inline]
    fn response(&self, by: &FrictionInput<'_>) -> FrictionResponse {
        let hold = self.hold(by.stretch, &by.at.sliding);
        let held = if by.slips { direction(&hold) * (self.coefficient * by.normal_force) } else { hold };
        let stretch_rate = if self.stiffness == 0.0 {
            Vector3::zeros()
        } else if by.slips {
            (held - by.stretch * self.stiffness) / self.damping
        } else {
            by.at.sliding
        };
        FrictionResponse { force: -held, stretch_rate }
    }

    fn stiffest(&self, _: &Stiffest) -> StiffestFriction {
        let (stiffness, damping) = (self.stiffness, self.damping);
        StiffestFriction { stiffness, damping, relaxation: stiffness / damping }
    }

    fn has_modes(&self) -> bool {
        true
    }

    /// (μ N)² − p², N², with μ_s for μ in stick.
    #[inline]
    fn margin(&self, by: &FrictionInput<'_>) -> f64 {
        let bound = self.bound(by.slips) * by.normal_force;
        bound * bound.abs() - self.hold(by.stretch, &by.at.sliding).norm_squared()
    }

    fn breaks_away(&self) -> bool {
        self.holding > self.coefficient
    }

    fn spring(&self, normal_force: f64) -> Option<FrictionSpring> {
        let longest = self.holding * normal_force / self.stiffness;
        (self.stiffness > 0.0).then_some(FrictionSpring { stiffness: self.stiffness, longest })
    }

    /// The static coefficient changes in proportion to the coefficient.
    fn parameters(&self) -> &'static [&'static str] {
        // Without stiffness there is no stretch that one could hold by.
        if self.stiffness > 0.0 {
            &["coefficient", "damping", "stiffness"]
        } else {
            &["coefficient", "damping"]
        }
    }

    fn derivative(&self, of: &FrictionInput<'_>, along: &FrictionChange<'_>) -> Option<FrictionDerivative> {
        let [coefficient, damping, stiffness] = along.parameters();
        let (push, push_change) = (of.normal_force, along.normal_force);
        let hold = self.hold(of.stretch, &of.at.sliding);
        let by_state = self.hold(along.stretch, &along.at.sliding);
        let hold_change = by_state + of.stretch * stiffness + of.at.sliding * damping;
        let static_change = if of.slips || self.holding == self.coefficient {
            coefficient
        } else {
            coefficient * self.holding / self.coefficient
        };
        let bound = self.bound(of.slips);
        let margin = 2.0 * (bound * push).abs() * (static_change * push + bound * push_change)
            - 2.0 * hold.dot(&hold_change);
        let held_change = if of.slips {
            direction(&hold) * (coefficient * push + self.coefficient * push_change)
                + direction_change(&hold, &hold_change) * (self.coefficient * push)
        } else {
            hold_change
        };
        let stretch_rate = if self.stiffness == 0.0 {
            Vector3::zeros()
        } else if of.slips {
            let spring_change = along.stretch * self.stiffness + of.stretch * stiffness;
            (held_change - spring_change - self.response(of).stretch_rate * damping) / self.damping
        } else {
            along.at.sliding
        };
        Some(FrictionDerivative { force: -held_change, stretch_rate, margin })
    }
}

/// v/‖v‖; zero at zero.
#[inline]
fn direction(v: &Vector3<f64>) -> Vector3<f64> {
    v.try_normalize(0.0).unwrap_or_default()
}

/// Derivative of v/‖v‖; zero at zero.
#[inline]
fn direction_change(v: &Vector3<f64>, change: &Vector3<f64>) -> Vector3<f64> {
    let length = v.norm();
    if length > 0.0 {
        let along = v / length;
        (change - along * along.dot(change)) / length
    } else {
        Vector3::zeros()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::laws::checks::check_friction_law;

    #[test]
    fn the_law_is_what_its_trait_asks() {
        for ratio in [1.0, 1.5] {
            check_friction_law(|[mu, c, k]: [f64; 3]| {
                let law = CoulombFriction::try_new(0.3 + mu, 50.0 + k, 2.0 + c).unwrap();
                law.with_static(ratio * (0.3 + mu)).unwrap()
            });
        }
        check_friction_law(|[mu, c]: [f64; 2]| CoulombFriction::try_new(0.3 + mu, 0.0, 4.0 + c).unwrap());
    }
}
