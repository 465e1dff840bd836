//! The compliant normal force of the thesis, (7.10), and its constants from what is known of an impact.
//!
//! With the gap Δx (negative inside the surface) and its rate,
//! ```text
//! F = −k Δx − c Δẋ   where Δx < 0 and k Δx + c Δẋ < 0,   F = 0 elsewhere.
//! ```
//! The spring pushes, the damper may not pull: contact ends where the *force* returns to zero, which with
//! damping happens below the surface. At touch-down the force jumps to −c Δẋ; at release it is continuous
//! and its slope jumps.

use super::normal_law::{NormalChange, NormalDerivative, NormalLaw, Stiffest};
use crate::error::ContactError;
use somersault_core::argument::{expect_not_negative, expect_positive};
use somersault_core::roots;
use somersault_integrators::events::Guard;
use std::convert::Infallible;

/// Spring and damper that push and never pull, thesis (7.10).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CompliantLaw {
    stiffness: f64,
    damping: f64,
}

impl CompliantLaw {
    /// Stiffness k > 0 (N/m) and damping c ≥ 0 (N s/m).
    pub fn try_new(stiffness: f64, damping: f64) -> Result<Self, ContactError> {
        Ok(Self {
            stiffness: expect_positive("stiffness", stiffness)?,
            damping: expect_not_negative("damping", damping)?,
        })
    }

    /// From the natural frequency ωₙ (rad/s) and the damping ratio ζ ≥ 0 of a mass (kg) on the contact:
    /// k = m ωₙ², c = 2 m ωₙ ζ, thesis 7.3.2.
    pub fn from_frequency(mass: f64, frequency: f64, damping_ratio: f64) -> Result<Self, ContactError> {
        let (mass, frequency) = (expect_positive("mass", mass)?, expect_positive("frequency", frequency)?);
        let ratio = expect_not_negative("damping_ratio", damping_ratio)?;
        Self::try_new(mass * frequency * frequency, 2.0 * mass * frequency * ratio)
    }

    /// From stiffness and the coefficient of restitution 0 < e ≤ 1 of a central impact of an effective mass
    /// (kg) under no other force; e = 1 gives c = 0.
    ///
    /// The damping ratio follows from [`damping_ratio`]; c = 2 ζ √(k m).
    pub fn from_restitution(
        effective_mass: f64,
        stiffness: f64,
        restitution: f64,
    ) -> Result<Self, ContactError> {
        let mass = expect_positive("effective_mass", effective_mass)?;
        let stiffness = expect_positive("stiffness", stiffness)?;
        let ratio = damping_ratio(restitution)?;
        Self::try_new(stiffness, 2.0 * ratio * (stiffness * mass).sqrt())
    }

    /// k, N/m.
    pub fn stiffness(&self) -> f64 {
        self.stiffness
    }

    /// c, N s/m.
    pub fn damping(&self) -> f64 {
        self.damping
    }

    /// Coefficient of restitution in a central impact of an effective mass (kg) under no other force.
    pub fn restitution(&self, effective_mass: f64) -> Result<f64, ContactError> {
        let mass = expect_positive("effective_mass", effective_mass)?;
        restitution(self.damping / (2.0 * (self.stiffness * mass).sqrt()))
    }
}

impl NormalLaw for CompliantLaw {
    /// −k Δx − c Δẋ.
    #[inline(always)]
    fn force_in_contact(&self, gap: f64, rate: f64) -> f64 {
        -self.stiffness * gap - self.damping * rate
    }

    /// c/k.
    #[inline(always)]
    fn lag(&self, _: f64, _: f64) -> f64 {
        self.damping / self.stiffness
    }

    /// ½ k min(Δx, 0)².
    #[inline]
    fn energy(&self, gap: f64) -> f64 {
        0.5 * self.stiffness * gap.min(0.0).powi(2)
    }

    /// At the depth √(x² + m ẋ²/k).
    fn stiffest(&self, gap: f64, rate: f64, mass: f64) -> Stiffest {
        let depth = (gap * gap + mass * rate * rate / self.stiffness).sqrt();
        let force = self.stiffness * depth + self.damping * rate.abs();
        Stiffest { force, stiffness: self.stiffness, damping: self.damping }
    }

    /// The damper's part is exact; the spring's is the integral of the cubic through the four numbers, of
    /// order 4 in h.
    #[inline]
    fn impulse(&self, h: f64, before: &Guard, after: &Guard) -> f64 {
        let area = 0.5 * h * (before.gap + after.gap) + h * h / 12.0 * (before.rate - after.rate);
        -self.stiffness * area - self.damping * (after.gap - before.gap)
    }

    fn is_damped(&self) -> bool {
        self.damping != 0.0
    }

    fn parameters(&self) -> &'static [&'static str] {
        &["stiffness", "damping"]
    }

    #[inline]
    fn derivative(&self, gap: f64, rate: f64, along: &NormalChange) -> Option<NormalDerivative> {
        let [stiffness, damping] = along.parameters();
        let force =
            -self.stiffness * along.gap - self.damping * along.rate - stiffness * gap - damping * rate;
        let lag = (damping - self.damping / self.stiffness * stiffness) / self.stiffness;
        Some(NormalDerivative { force, lag })
    }
}

/// arccos ζ/√(1 − ζ²), continued as arcosh ζ/√(ζ² − 1): 1 at ζ = 1, where both are 0/0.
fn half_phase(ratio: f64) -> f64 {
    // With s² = |1 − ζ|/2 both numerator and denominator keep their digits near ζ = 1.
    let square = 0.5 * (1.0 - ratio);
    let s = square.abs().sqrt();
    if s < 1e-9 {
        1.0
    } else if square > 0.0 {
        s.asin() / (s * (1.0 - square).sqrt())
    } else {
        s.asinh() / (s * (1.0 - square).sqrt())
    }
}

/// Coefficient of restitution at damping ratio ζ ≥ 0, with release at zero force:
/// ```text
/// e = exp(−2 ζ arccos ζ / √(1 − ζ²))    ζ < 1
/// e = exp(−2)                           ζ = 1
/// e = exp(−2 ζ arcosh ζ / √(ζ² − 1))    ζ > 1
/// ```
/// From m Δẍ = −k Δx − c Δẋ, Δx(0) = 0: with ζ = cos ψ the force is zero again at ω_d t = 2ψ, where
/// Δẋ = −e^{−ζ ωₙ t} Δẋ(0). Analytic through ζ = 1; falls from 1 to 0 as 1/(4ζ²). Release at zero
/// penetration, the more common formula exp(−π ζ/√(1 − ζ²)), lets the damper pull.
pub fn restitution(damping_ratio: f64) -> Result<f64, ContactError> {
    let ratio = expect_not_negative("damping_ratio", damping_ratio)?;
    Ok((-2.0 * ratio * half_phase(ratio)).exp())
}

/// Damping ratio ζ that gives a coefficient of restitution 0 < e ≤ 1: the inverse of [`restitution`], to a
/// few roundings.
///
/// e = 0 is refused: it would take infinite damping.
pub fn damping_ratio(restitution: f64) -> Result<f64, ContactError> {
    if !(restitution > 0.0 && restitution <= 1.0) {
        return Err(ContactError::Restitution { found: restitution });
    }
    let target = -0.5 * restitution.ln();
    // ζ half_phase(ζ) ≥ ln 2ζ, so that the root lies below e^target; above, the function exceeds the target.
    let top = target.exp();
    let excess = |ratio: f64| Ok::<_, Infallible>(ratio * half_phase(ratio) - target);
    let (Ok(at_zero), Ok(at_top)) = (excess(0.0), excess(top));
    let Ok((below, above)) =
        roots::bracket(excess, (0.0, at_zero), (top, at_top), 0.5 * top, 2.0 * f64::EPSILON * top);
    let near_zero = 2.0 * target / std::f64::consts::PI;
    // Light damping is below the resolution of the bracket; there ζ half_phase(ζ) = πζ/2 − ζ² + ….
    Ok(if target < 1e-9 {
        near_zero * (1.0 + near_zero * 2.0 / std::f64::consts::PI)
    } else {
        0.5 * (below + above)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::laws::checks::check_normal_law;

    #[test]
    fn restitution_is_continuous_through_critical_damping() {
        assert_eq!(restitution(0.0).unwrap(), 1.0);
        assert!((restitution(1.0).unwrap() - (-2.0f64).exp()).abs() < 1e-16);
        for d in [1e-4, 1e-8, 1e-12, 1e-16] {
            let (below, above) = (restitution(1.0 - d).unwrap(), restitution(1.0 + d).unwrap());
            // d ln e/dζ = −4/3 at ζ = 1.
            let slope = (above / below).ln();
            assert!((slope + 8.0 / 3.0 * d).abs() < 1e-6 * d + 1e-15, "{d}: {slope}");
        }
    }

    #[test]
    fn damping_ratio_inverts_restitution_on_all_branches() {
        for e in
            [1.0, 1.0 - 1e-15, 1.0 - 1e-9, 0.999, 0.7, 0.3, (-2.0f64).exp(), 0.1, 1e-3, 1e-9, 1e-100, 1e-300]
        {
            let back = restitution(damping_ratio(e).unwrap()).unwrap();
            assert!((back / e - 1.0).abs() < 1e-12, "{e}: {back}");
        }
        assert_eq!(damping_ratio(1.0).unwrap(), 0.0);
        assert!(damping_ratio(0.5).unwrap() < 1.0 && damping_ratio(0.1).unwrap() > 1.0);
        for e in [0.0, -0.1, 1.1, f64::NAN, f64::INFINITY] {
            assert!(matches!(damping_ratio(e), Err(ContactError::Restitution { .. })), "{e}");
        }
    }

    #[test]
    fn the_law_is_what_its_trait_asks() {
        let law = |[k, c]: [f64; 2]| CompliantLaw::try_new(200.0 + k, 3.0 + c).unwrap();
        check_normal_law(law, &[(-0.02, 0.3), (-0.02, -0.3), (-1e-3, 0.0)]);
    }

    #[test]
    fn the_force_is_that_of_7_10() {
        let law = CompliantLaw::try_new(100.0, 2.0).unwrap();
        assert_eq!(law.force(-0.1, -1.0), 12.0);
        assert_eq!(law.force(-0.1, 1.0), 8.0);
        assert_eq!(law.force(-0.1, 6.0), 0.0);
        assert_eq!(law.force(0.1, -60.0), 0.0);
        assert_eq!(law.restitution(0.25).unwrap(), restitution(0.2).unwrap());
    }
}
