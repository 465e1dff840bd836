//! Hertz's contact with the damping of Hunt and Crossley.
//!
//! With x = −Δx the penetration,
//! ```text
//! F = k x^{3/2} (1 + 3/2 α ẋ)   where x > 0 and 1 + 3/2 α ẋ > 0,   F = 0 elsewhere.
//! ```
//! The force is continuous at touch-down and at release, which is where the surfaces part. In an impact under
//! no other force ẋ never falls to −2/(3α), where the force would begin to pull; under other forces contact
//! ends there, and begins again where ẋ recovers.
//!
//! x^{3/2} has no second derivative at x = 0. The step that begins there leaves an error of order h^{5/2} in
//! the velocity, as does the one that ends there, whatever the method: located events keep an order of at
//! most 5/2, unless the first and the last steps in contact are graded, as t = T (j/m)^r with r > p/(5/2)
//! for a method of order p. Steps adapted to tolerances are graded by them, and so keep the order.
//!
//! K. H. Hunt, F. R. E. Crossley, J. Appl. Mech. 42 (1975) 440; H. Hertz, J. reine angew. Math. 92 (1882) 156.

use super::normal_law::{NormalChange, NormalDerivative, NormalLaw, Stiffest, between};
use crate::error::ContactError;
use somersault_core::argument::{expect_not_negative, expect_positive};
use somersault_core::quadrature::GAUSS_3;
use somersault_core::roots;
use somersault_integrators::events::Guard;
use std::convert::Infallible;

/// An isotropic elastic material.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Elastic {
    young_modulus: f64,
    poisson_ratio: f64,
}

impl Elastic {
    /// Young's modulus E > 0 (Pa) and Poisson's ratio −1 < ν ≤ ½.
    pub fn try_new(young_modulus: f64, poisson_ratio: f64) -> Result<Self, ContactError> {
        let young_modulus = expect_positive("young_modulus", young_modulus)?;
        if poisson_ratio > -1.0 && poisson_ratio <= 0.5 {
            Ok(Self { young_modulus, poisson_ratio })
        } else {
            Err(ContactError::PoissonRatio { found: poisson_ratio })
        }
    }

    /// (1 − ν²)/E, 1/Pa.
    fn compliance(&self) -> f64 {
        (1.0 - self.poisson_ratio * self.poisson_ratio) / self.young_modulus
    }
}

/// Hertz's spring with the damper of Hunt and Crossley, which grows with the penetration.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HuntCrossley {
    stiffness: f64,
    damping: f64,
}

impl HuntCrossley {
    /// Stiffness k > 0 (N/m^{3/2}) and damping α ≥ 0 (s/m).
    ///
    /// α is the slope of the restitution, e = 1 − α v + O(v²) at the speed v of the impact.
    pub fn try_new(stiffness: f64, damping: f64) -> Result<Self, ContactError> {
        Ok(Self {
            stiffness: expect_positive("stiffness", stiffness)?,
            damping: expect_not_negative("damping", damping)?,
        })
    }

    /// Two bodies of given materials by Hertz, k = ⁴⁄₃ E √R with 1/E = Σ (1 − νᵢ²)/Eᵢ, and α (s/m).
    ///
    /// 1/R = 1/R₁ + 1/R₂ (m) for two spheres; R is the radius of the sphere for a sphere on a plane.
    pub fn from_materials(
        materials: [Elastic; 2],
        effective_radius: f64,
        damping: f64,
    ) -> Result<Self, ContactError> {
        let radius = expect_positive("effective_radius", effective_radius)?;
        let modulus = 1.0 / (materials[0].compliance() + materials[1].compliance());
        Self::try_new(4.0 / 3.0 * modulus * radius.sqrt(), damping)
    }

    /// From stiffness and the coefficient of restitution 0 < e ≤ 1 of a central impact at `speed` (m/s)
    /// under no other force; see [`restitution`].
    pub fn from_restitution(stiffness: f64, restitution: f64, speed: f64) -> Result<Self, ContactError> {
        let speed = expect_positive("speed", speed)?;
        Self::try_new(stiffness, impact_number(restitution)? / (1.5 * speed))
    }

    /// k, N/m^{3/2}.
    pub fn stiffness(&self) -> f64 {
        self.stiffness
    }

    /// α, s/m.
    pub fn damping(&self) -> f64 {
        self.damping
    }

    /// Coefficient of restitution of a central impact at `speed` (m/s) under no other force.
    pub fn restitution(&self, speed: f64) -> Result<f64, ContactError> {
        restitution(1.5 * self.damping * expect_not_negative("speed", speed)?)
    }
}

impl NormalLaw for HuntCrossley {
    /// k x^{3/2} (1 − 3/2 α Δẋ), zero above the surface.
    #[inline(always)]
    fn force_in_contact(&self, gap: f64, rate: f64) -> f64 {
        let x = (-gap).max(0.0);
        self.stiffness * x * x.sqrt() * (1.0 - 1.5 * self.damping * rate)
    }

    /// 3/2 α x: the law acts below the surface, and where 3/2 α Δẋ < 1.
    #[inline(always)]
    fn lag(&self, gap: f64, _: f64) -> f64 {
        1.5 * self.damping * gap.abs()
    }

    /// ⅖ k x^{5/2}.
    #[inline]
    fn energy(&self, gap: f64) -> f64 {
        0.4 * self.stiffness * half_powers(gap)
    }

    /// At the depth (x^{5/2} + ⁵⁄₄ m ẋ²/k)^{2/5}.
    fn stiffest(&self, gap: f64, rate: f64, mass: f64) -> Stiffest {
        let depth = (half_powers(gap) + 1.25 * mass * rate * rate / self.stiffness).powf(0.4);
        let spring = self.stiffness * depth * depth.sqrt();
        let loss = 1.5 * self.damping;
        let stiffening = 1.0 + loss * rate.abs();
        Stiffest {
            force: spring * stiffening,
            stiffness: 1.5 * self.stiffness * depth.sqrt() * stiffening,
            damping: loss * spring,
        }
    }

    /// The damper's part is exact; the spring's is Gauss' rule of three points on the cubic through the
    /// four numbers, of order 4 in h, and 5/2 in the first and the last step.
    fn impulse(&self, h: f64, before: &Guard, after: &Guard) -> f64 {
        let spring = |s: f64| self.force_in_contact(between(h, before, after, s).0, 0.0);
        let elastic = h * GAUSS_3.map(|(s, w)| w * spring(s)).iter().sum::<f64>();
        elastic + 0.6 * self.damping * self.stiffness * (half_powers(after.gap) - half_powers(before.gap))
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
        let x = (-gap).max(0.0);
        let (root, hertz) = (x.sqrt(), x * x.sqrt());
        let damper = 1.0 - 1.5 * self.damping * rate;
        let force = (stiffness * hertz - 1.5 * self.stiffness * root * along.gap) * damper
            - 1.5 * self.stiffness * hertz * (damping * rate + self.damping * along.rate);
        // τ = −3/2 α Δx inside.
        let lag = -1.5 * (damping * gap + self.damping * along.gap);
        Some(NormalDerivative { force, lag })
    }
}

/// x^{5/2} of the penetration.
#[inline]
fn half_powers(gap: f64) -> f64 {
    let x = (-gap).max(0.0);
    x * x * x.sqrt()
}

/// ((ln(1 + u) − u)/u² + ½)/u = ⅓ − u/4 + u²/5 − …, for u > −1.
fn remainder(u: f64) -> f64 {
    if u.abs() < 0.3 {
        (3..40).rev().fold(0.0, |sum, n| 1.0 / f64::from(n) - u * sum)
    } else {
        ((u.ln_1p() - u) / (u * u) + 0.5) / u
    }
}

/// Zero where (1 + e) u = ln((1 + u)/(1 − e u)), and of the sign of the difference.
fn mismatch(restitution: f64, u: f64) -> f64 {
    // The difference over u², without the terms that cancel.
    let e = restitution;
    u * (remainder(u) + e * e * e * remainder(-e * u)) - 0.5 * (1.0 - e) * (1.0 + e)
}

/// Coefficient of restitution of a central impact under no other force, for u = 3/2 α v ≥ 0:
/// ```text
/// (1 + e) u = ln((1 + u)/(1 − e u)).
/// ```
/// m ẋ dẋ/dx = −k x^{3/2} (1 + 3/2 α ẋ), integrated from x = 0 to x = 0: neither mass nor stiffness
/// matters. e = 1 − ⅔ u + …, the relation that Hunt and Crossley give, for small u.
pub fn restitution(impact_number: f64) -> Result<f64, ContactError> {
    let u = expect_not_negative("impact_number", impact_number)?;
    if u == 0.0 {
        return Ok(1.0);
    }
    let excess = |e: f64| Ok::<_, Infallible>(mismatch(e, u));
    let top = (1.0 / u).min(1.0);
    let (at_zero, at_top) = (mismatch(0.0, u), mismatch(top, u));
    let Ok((below, above)) =
        roots::bracket(excess, (0.0, at_zero), (top, at_top), 1.0 / (1.0 + u), 2.0 * f64::EPSILON * top);
    Ok(0.5 * (below + above))
}

/// u = 3/2 α v that gives a coefficient of restitution 0 < e ≤ 1: the inverse of [`restitution`].
pub fn impact_number(restitution: f64) -> Result<f64, ContactError> {
    if !(restitution > 0.0 && restitution <= 1.0) {
        return Err(ContactError::Restitution { found: restitution });
    }
    let e = restitution;
    // The root for e near 1, and everywhere below the true one.
    let least = 1.5 * (1.0 - e) * (1.0 + e) / (1.0 + e * e * e);
    if least == 0.0 {
        return Ok(0.0);
    }
    let excess = |u: f64| Ok::<_, Infallible>(mismatch(e, u));
    let top = 1.0 / e;
    let Ok((below, above)) = roots::bracket(
        excess,
        (0.0, mismatch(e, 0.0)),
        (top, mismatch(e, top)),
        least,
        2.0 * f64::EPSILON * least.max(f64::MIN_POSITIVE),
    );
    Ok(0.5 * (below + above))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::laws::checks::check_normal_law;

    #[test]
    fn the_law_is_what_its_trait_asks() {
        let law = |[k, a]: [f64; 2]| HuntCrossley::try_new(200.0 + k, 0.3 + a).unwrap();
        check_normal_law(law, &[(-0.02, 0.3), (-0.02, -0.3), (-1e-2, 0.0)]);
    }

    #[test]
    fn the_impact_number_inverts_restitution() {
        for e in [1.0 - 1e-12, 1.0 - 1e-6, 0.999, 0.9, 0.7, 0.5, 0.3, 0.1, 1e-2, 1e-6] {
            let u = impact_number(e).unwrap();
            // 1/(1 − e) amplifies a rounding of e.
            assert!((restitution(u).unwrap() / e - 1.0).abs() < 1e-13, "{e}: {u}");
            let logarithm = ((1.0 + u) / (1.0 - e * u)).ln();
            assert!(u < 0.01 || ((1.0 + e) * u / logarithm - 1.0).abs() < 1e-8 || e < 0.1, "{e} {u}");
        }
        assert_eq!(impact_number(1.0).unwrap(), 0.0);
        assert_eq!(restitution(0.0).unwrap(), 1.0);
        // Hunt and Crossley: e = 1 − α v for small speeds.
        for u in [1e-3, 1e-5, 1e-9] {
            let loss = 1.0 - restitution(u).unwrap();
            assert!((loss / (2.0 / 3.0 * u) - 1.0).abs() < u + 1e-15 / u, "{u}: {loss}");
        }
        for e in [0.0, -0.1, 1.1, f64::NAN] {
            assert!(matches!(impact_number(e), Err(ContactError::Restitution { .. })));
        }
    }

    #[test]
    fn the_guard_is_inside_exactly_where_the_law_acts() {
        let law = HuntCrossley::try_new(100.0, 0.5).unwrap();
        for (gap, rate) in [(-0.1, -3.0), (-0.1, 1.3), (-0.1, 1.4), (0.1, -1.0), (0.1, 9.0), (-1e-9, 0.0)] {
            let pushes = gap < 0.0 && 1.0 - 0.75 * rate > 0.0;
            assert_eq!(law.guard(gap, rate).is_inside(), pushes, "{gap} {rate}");
        }
        assert!((law.force_in_contact(-0.04, -1.0) - 0.8 * 1.75).abs() < 1e-15);
    }

    #[test]
    fn hertz_gives_the_stiffness_of_two_spheres() {
        // Steel balls of radius 0.02 m: E = 210 GPa/(2 · 0.91), R = 0.01 m.
        let steel = Elastic::try_new(210e9, 0.3).unwrap();
        let law = HuntCrossley::from_materials([steel, steel], 0.01, 0.0).unwrap();
        assert!((law.stiffness() / (4.0 / 3.0 * 210e9 / 1.82 * 0.1) - 1.0).abs() < 1e-15);
    }
}
