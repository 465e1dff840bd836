//! Modified moments of inertia that raise the order of the discrete Moser–Veselov algorithm.
//!
//! With moments I_j the discrete Moser–Veselov step is of order 2. With moments Ĩ_j,
//! ```text
//! 1/Ĩ_j = (1/I_j)(1 + h² s₃ + h⁴ s₅ + h⁶ s₇ + h⁸ s₉) + h² d₃ + h⁴ d₅ + h⁶ d₇ + h⁸ d₉
//! ```
//! in its place, cut after s₃, d₃ or s₅, d₅ …, the same step is of order 4, 6, 8, 10 in both the body
//! momentum and the orientation (Hairer & Vilmart 2006). The s and d are polynomials in the energy
//! H = Σ L_j²/(2 I_j), in C = |L|²/2 and in the elementary symmetric functions of the inverse moments,
//! and so constant along a free motion: the cost of a step stays that of the second-order method.
//!
//! The coefficients were computed for this crate in exact rational arithmetic from the power series of
//! the free motion and checked on independent bodies: `tests/derivations/preprocessed_moser_veselov.py`.
//!
//! E. Hairer, G. Vilmart: Preprocessed discrete Moser–Veselov algorithm for the full dynamics of a rigid
//! body. J. Phys. A: Math. Gen. 39 (2006) 13225–13235.

use nalgebra::Vector3;

/// Order of the discrete Moser–Veselov step after preprocessing.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Preprocessing {
    /// Order 4: s₃, d₃.
    Four,
    /// Order 6: up to s₅, d₅.
    Six,
    /// Order 8: up to s₇, d₇.
    Eight,
    /// Order 10: up to s₉, d₉.
    Ten,
}

impl Preprocessing {
    /// The preprocessing for `order`; `None` for all but 4, 6, 8 and 10.
    pub const fn of_order(order: u8) -> Option<Self> {
        match order {
            4 => Some(Self::Four),
            6 => Some(Self::Six),
            8 => Some(Self::Eight),
            10 => Some(Self::Ten),
            _ => None,
        }
    }
}

/// The modified moments Ĩ for one body, one free motion and one step size.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ModifiedMoments {
    moments: Vector3<f64>,
}

/// The series gave a modified inverse moment that is not positive and finite: the step is too large
/// for preprocessing.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[error(
    "step too large for preprocessing: the modified inverse moments {inverse_moments:?} are not all positive"
)]
pub struct StepTooLarge {
    /// The three values of 1/Ĩ_j.
    pub inverse_moments: [f64; 3],
}

impl ModifiedMoments {
    /// Modified moments for the body with principal `moments`, moving freely with body momentum
    /// `momentum_body` in the principal frame, at steps of `h`.
    ///
    /// Cost: some 30 (order 4) to 200 (order 10) multiplications and one division per axis, once per
    /// motion and step size.
    pub fn try_new(
        moments: &Vector3<f64>,
        momentum_body: &Vector3<f64>,
        h: f64,
        order: Preprocessing,
    ) -> Result<Self, StepTooLarge> {
        // In units of the largest inverse moment, whose powers would leave the range of numbers for small bodies.
        let unit = moments.min().recip();
        let x = moments.map(|moment| moment.recip() / unit);
        let squares = momentum_body.map(|l| (h * unit * l) * (h * unit * l));
        let (energy, casimir) = (0.5 * squares.dot(&x), 0.5 * squares.sum());
        let (scale, shift) = scale_and_shift(&x, energy, casimir, order);
        let inverse = x.map(|x| unit * (x + (x * scale + shift)));
        // A NaN fails the comparison as well.
        if inverse.iter().all(|&y| y > 0.0 && y < f64::INFINITY) {
            Ok(Self { moments: inverse.map(f64::recip) })
        } else {
            Err(StepTooLarge { inverse_moments: inverse.into() })
        }
    }

    /// The modified moments Ĩ_j.
    #[inline]
    pub fn moments(&self) -> &Vector3<f64> {
        &self.moments
    }
}

/// (Σ h²ᵐ s, Σ h²ᵐ d) with a = h² H, b = h² C and the inverse moments `x`.
fn scale_and_shift(x: &Vector3<f64>, a: f64, b: f64, order: Preprocessing) -> (f64, f64) {
    let e1 = x.sum();
    let e2 = x[0] * x[1] + x[1] * x[2] + x[2] * x[0];
    let e3 = x[0] * x[1] * x[2];
    let (a2, b2) = (a * a, b * b);

    let mut s = (b * e2 - 2.0 * a * e1) / 6.0;
    let mut d = (a * e2 - 2.0 * b * e3) / 6.0;
    if order >= Preprocessing::Six {
        let (e11, e12, e13, e22, e23) = (e1 * e1, e1 * e2, e1 * e3, e2 * e2, e2 * e3);
        s += (a2 * (2.0 * e11 - e2) + a * b * (8.0 * e3 - 2.0 * e12) + b2 * (2.0 * e22 - 6.0 * e13)) / 60.0;
        d += (-a2 * (e12 + 6.0 * e3) + a * b * (8.0 * e13 - e22) - b2 * e23) / 60.0;
    }
    if order >= Preprocessing::Eight {
        let (e11, e22, e33) = (e1 * e1, e2 * e2, e3 * e3);
        let s7 = [
            e1 * (4.0 * e2 - 4.0 * e11) + 72.0 * e3,
            e2 * (6.0 * e11 + 41.0 * e2) - 212.0 * e1 * e3,
            e3 * (132.0 * e11 - 30.0 * e2) - 36.0 * e1 * e22,
            e2 * (17.0 * e22 - 66.0 * e1 * e3) + 100.0 * e33,
        ];
        let d7 = [
            e2 * (2.0 * e11 - 26.0 * e2) + 60.0 * e1 * e3,
            13.0 * e1 * e22 + e3 * (110.0 * e2 - 64.0 * e11),
            2.0 * e2 * (e22 - e1 * e3) - 176.0 * e33,
            e3 * (72.0 * e1 * e3 - 19.0 * e22),
        ];
        s += homogeneous(a, b, &s7) / 2520.0;
        d += homogeneous(a, b, &d7) / 2520.0;
    }
    if order >= Preprocessing::Ten {
        let (e11, e13, e22, e33) = (e1 * e1, e1 * e3, e2 * e2, e3 * e3);
        let s9 = [
            e11 * (2.0 * e11 - 3.0 * e2) + 153.0 * e22 - 486.0 * e13,
            -e1 * e2 * (4.0 * e11 + 264.0 * e2) + e3 * (1104.0 * e11 - 828.0 * e2),
            e22 * (156.0 * e11 + 18.0 * e2) + e13 * (180.0 * e2 - 612.0 * e11) + 1908.0 * e33,
            e2 * (e1 * (612.0 * e13 - 154.0 * e22) + 282.0 * e2 * e3) - 2256.0 * e1 * e33,
            e22 * (62.0 * e22 - 342.0 * e13) + e33 * (378.0 * e11 + 291.0 * e2),
        ];
        let d9 = [
            -e1 * e2 * (e11 + 6.0 * e2) + e3 * (459.0 * e2 - 126.0 * e11),
            e22 * (194.0 * e2 - 30.0 * e11) + e13 * (128.0 * e11 - 552.0 * e2) - 1296.0 * e33,
            e1 * e2 * (114.0 * e13 - 30.0 * e22) + e3 * (2136.0 * e13 - 798.0 * e22),
            e22 * (222.0 * e13 - e22) + e33 * (684.0 * e2 - 864.0 * e11),
            e3 * (e2 * (243.0 * e13 - 61.0 * e22) - 610.0 * e33),
        ];
        s += homogeneous(a, b, &s9) / 45360.0;
        d += homogeneous(a, b, &d9) / 45360.0;
    }
    (s, d)
}

/// Σ_j c_j aⁿ⁻ʲ bʲ for the n + 1 coefficients c.
fn homogeneous(a: f64, b: f64, coefficients: &[f64]) -> f64 {
    let mut power = 1.0;
    let mut sum = 0.0;
    for c in coefficients {
        sum = sum * a + c * power;
        power *= b;
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_modified_moment_of_a_ball_makes_its_rotation_exact_to_the_order() {
        // With equal moments the discrete equation is Ĩ sin θ = h |L|; the exact motion turns by θ = h |L|/I.
        let (moment, momentum) = (0.7, Vector3::new(0.3, -0.2, 0.4));
        for (order, power) in [
            (Preprocessing::Four, 4),
            (Preprocessing::Six, 6),
            (Preprocessing::Eight, 8),
            (Preprocessing::Ten, 10),
        ] {
            let error = |h: f64| {
                let modified =
                    ModifiedMoments::try_new(&Vector3::repeat(moment), &momentum, h, order).unwrap();
                let angle = h * momentum.norm() / moment;
                modified.moments()[0] * angle.sin() / (h * momentum.norm()) - 1.0
            };
            let slope = (error(1.0) / error(0.5)).log2();
            assert!((slope - f64::from(power)).abs() < 0.2, "{order:?}: {slope}");
        }
    }

    /// Exact (s, d) of orders 3, 5, 7, 9 for two bodies, from the power series of their motion (printed by the
    /// derivation), not from the polynomials.
    #[test]
    fn the_polynomials_agree_with_the_series_of_the_motion() {
        let known = [
            (
                Vector3::new(2.0, 3.0, 4.0),
                Vector3::new(1.0, -2.0, 3.0),
                [
                    (-259.0 / 864.0, 35.0 / 1152.0),
                    (39053.0 / 1244160.0, -3871.0 / 663552.0),
                    (-3258157.0 / 2149908480.0, 205261.0 / 573308928.0),
                    (546993419.0 / 11145125560320.0, -79984513.0 / 5944066965504.0),
                ],
            ),
            (
                Vector3::new(5.0, 3.0, 7.0),
                Vector3::new(4.0, 1.0, 2.0),
                [
                    (-28127.0 / 132300.0, 137.0 / 8820.0),
                    (470999477.0 / 29172150000.0, -4121567.0 / 1944810000.0),
                    (-7842502601327.0 / 13508164057500000.0, 85029024137.0 / 900544270500000.0),
                    (
                        145927055671475177.0 / 10722780628843500000000.0,
                        -1768393158960467.0 / 714852041922900000000.0,
                    ),
                ],
            ),
        ];
        for (moments, momentum, terms) in known {
            let squares: Vector3<f64> = momentum.component_mul(&momentum);
            let (energy, casimir) = (0.5 * squares.component_div(&moments).sum(), 0.5 * squares.sum());
            let mut before = (0.0, 0.0);
            for (order, (s, d)) in [4, 6, 8, 10].into_iter().zip(terms) {
                let order = Preprocessing::of_order(order).unwrap();
                let sum = scale_and_shift(&moments.map(f64::recip), energy, casimir, order);
                assert!((sum.0 - before.0 - s).abs() < 1e-15, "{order:?}: {} {s}", sum.0 - before.0);
                assert!((sum.1 - before.1 - d).abs() < 1e-15, "{order:?}: {} {d}", sum.1 - before.1);
                before = sum;
            }
        }
    }

    #[test]
    fn a_step_beyond_the_series_is_refused() {
        let refused = ModifiedMoments::try_new(
            &Vector3::new(1.0, 2.0, 2.5),
            &Vector3::new(1.0, 2.0, 3.0),
            10.0,
            Preprocessing::Four,
        );
        assert!(matches!(refused, Err(StepTooLarge { .. })));
        let nan =
            ModifiedMoments::try_new(&Vector3::repeat(1.0), &Vector3::x(), f64::NAN, Preprocessing::Ten);
        assert!(nan.is_err());
    }
}
