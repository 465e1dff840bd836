//! The even functions of the angle θ in the formulas of the groups, as functions of x = θ², to rounding.
//!
//! Below bounds of x they are polynomials that end where the next term is below a rounding, of the function and of its first
//! two derivatives; so dual numbers lose nothing either.

use crate::scalar::{Scalar, constant};

/// (−1)^k / (2k + first)!
const fn even_taylor<const N: usize>(first: u64) -> [f64; N] {
    let mut c = [1.0; N];
    let mut m = 2;
    while m <= first {
        c[0] /= m as f64;
        m += 1;
    }
    let mut k = 1;
    while k < N {
        let n = 2 * k as u64 + first;
        c[k] = -c[k - 1] / ((n * (n - 1)) as f64);
        k += 1;
    }
    c
}

/// Σ c_k x^k.
#[inline(always)]
pub(super) fn horner<T: Scalar, const N: usize>(c: &[f64; N], x: T) -> T {
    let mut p = constant(c[N - 1]);
    for k in (0..N - 1).rev() {
        p = p * x + constant(c[k]);
    }
    p
}

/// Σ k c_k x^(k−1).
fn horner_slope<T: Scalar, const N: usize>(c: &[f64; N], x: T) -> T {
    let mut p = T::zero();
    for k in (1..N).rev() {
        p = p * x + constant(k as f64 * c[k]);
    }
    p
}

/// cos √x and sin √x / √x for x ≥ 0, each to about one rounding.
///
/// Rotations over one time step are small: a short polynomial serves them where they are used, and the
/// rest is a call.
#[inline(always)]
pub(super) fn cos_sinc<T: Scalar>(x: T) -> (T, T) {
    // The first neglected terms are below 3e-20 and 3e-21.
    const COS: [f64; 6] = even_taylor(0);
    const SINC: [f64; 6] = even_taylor(1);
    // Estrin's grouping: a step waits for this, and its chain is half as long as Horner's.
    let quintic = |c: &[f64; 6]| {
        let c = |k: usize| constant::<T>(c[k]);
        let square = x * x;
        (c(0) + c(1) * x) + square * ((c(2) + c(3) * x) + square * (c(4) + c(5) * x))
    };
    if x < constant(1.0 / 64.0) { (quintic(&COS), quintic(&SINC)) } else { cos_sinc_of_large(x) }
}

#[inline(never)]
fn cos_sinc_of_large<T: Scalar>(x: T) -> (T, T) {
    // The first neglected terms are below 5e-19 and 2e-20.
    const COS: [f64; 10] = even_taylor(0);
    const SINC: [f64; 10] = even_taylor(1);
    if x < T::one() {
        let (x2, x4) = (x * x, (x * x) * (x * x));
        let nonic = |c: &[f64; 10]| {
            let pair = |k: usize| constant::<T>(c[k]) + constant::<T>(c[k + 1]) * x;
            (pair(0) + x2 * pair(2)) + x4 * ((pair(4) + x2 * pair(6)) + x4 * pair(8))
        };
        (nonic(&COS), nonic(&SINC))
    } else {
        let angle = x.sqrt();
        let (sin, cos) = angle.sin_cos();
        (cos, sin / angle)
    }
}

/// (1 − cos θ)/θ².
#[inline]
pub(super) fn versine_ratio<T: Scalar>(x: T) -> T {
    let (_, sinc) = cos_sinc(x * constant(0.25));
    sinc * sinc * constant(0.5)
}

/// At x = 1 the first neglected terms are below 1e-20 and 1e-21, those of the slopes below 1e-19.
const VERSINE: [f64; 10] = even_taylor(2);
const SINE_DEFECT: [f64; 10] = even_taylor(3);

/// (θ − sin θ)/θ³.
#[inline]
pub(super) fn sine_defect_ratio<T: Scalar>(x: T) -> T {
    if x < T::one() {
        horner(&SINE_DEFECT, x)
    } else {
        let angle = x.sqrt();
        (angle - angle.sin()) / (x * angle)
    }
}

/// Slopes by x of [`versine_ratio`] and [`sine_defect_ratio`].
#[inline]
pub(super) fn ratio_slopes<T: Scalar>(x: T) -> [T; 2] {
    if x < T::one() {
        [horner_slope(&VERSINE, x), horner_slope(&SINE_DEFECT, x)]
    } else {
        let (cos, sinc) = cos_sinc(x);
        let twice = x + x;
        let sinc_slope = (cos - sinc) / twice;
        [(sinc - versine_ratio(x) * constant(2.0)) / twice, -(sinc_slope + sine_defect_ratio(x)) / x]
    }
}

/// Of the sum over the poles of [`cotangent_ratio`] all but the nearest, Σ 2(ζ(2m+2) − 1) xᵐ/(2π)^(2m+2), whose terms fall as
/// (4π)^(−2m): the first neglected is below 1e-17 of the whole for x < 6.
const FARTHER_POLES: [f64; 11] = [
    0.03267274151216445,
    0.000105641107053347,
    5.637370282876845e-7,
    3.357141926657451e-9,
    2.0742872904166045e-11,
    1.3000482138698975e-13,
    8.196052055691008e-16,
    5.180118196169724e-18,
    3.277539174701792e-20,
    2.0747401878593604e-22,
    1.3136241807166534e-24,
];

const FOUR_PI_SQUARED: f64 = 4.0 * std::f64::consts::PI * std::f64::consts::PI;

/// (1 − (θ/2) cot(θ/2))/θ² = Σ_k 2/(4π²k² − θ²); 1/12 at 0, infinite at θ = 2π.
#[inline(always)]
pub(super) fn cotangent_ratio<T: Scalar>(x: T) -> T {
    if x < constant(6.0) {
        // Estrin's grouping, as in `cos_sinc`.
        let c = |k: usize| constant::<T>(FARTHER_POLES[k]);
        let (x2, x4) = (x * x, (x * x) * (x * x));
        let low = (c(0) + c(1) * x) + x2 * (c(2) + c(3) * x);
        let middle = (c(4) + c(5) * x) + x2 * (c(6) + c(7) * x);
        let high = (c(8) + c(9) * x) + x2 * c(10);
        constant::<T>(2.0) / (constant::<T>(FOUR_PI_SQUARED) - x) + (low + x4 * (middle + x4 * high))
    } else {
        cotangent_ratio_of_large(x)
    }
}

#[inline(never)]
fn cotangent_ratio_of_large<T: Scalar>(x: T) -> T {
    let half = x.sqrt() * constant(0.5);
    (T::one() - half / half.tan()) / x
}

/// The slope by x of [`cotangent_ratio`].
pub(super) fn cotangent_ratio_slope<T: Scalar>(x: T) -> T {
    if x < constant(6.0) {
        let distance = constant::<T>(FOUR_PI_SQUARED) - x;
        constant::<T>(2.0) / (distance * distance) + horner_slope(&FARTHER_POLES, x)
    } else {
        // d(h cot h)/dx for h = √x/2
        let half = x.sqrt() * constant(0.5);
        let (sin, cos) = half.sin_cos();
        let slope = (cos / sin - half / (sin * sin)) / (half * constant(8.0));
        -(slope + cotangent_ratio_of_large(x)) / x
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use num_dual::{Dual2_64, Dual64};

    const BOUNDS: [f64; 3] = [1.0 / 64.0, 1.0, 6.0];

    /// Every function.
    fn all<T: Scalar>(x: T) -> [T; 8] {
        let (cos, sinc) = cos_sinc(x);
        let [versine, defect] = ratio_slopes(x);
        let cotangent = [cotangent_ratio(x), cotangent_ratio_slope(x)];
        [cos, sinc, versine_ratio(x), sine_defect_ratio(x), versine, defect, cotangent[0], cotangent[1]]
    }

    #[test]
    fn branches_meet() {
        for x in BOUNDS {
            let (below, above) = (x * (1.0 - 1e-15), x * (1.0 + 1e-15));
            for (k, (a, b)) in all(below).into_iter().zip(all(above)).enumerate() {
                let bound = if k == 4 || k == 5 { 5e-14 } else { 5e-15 };
                assert!((a / b - 1.0).abs() < bound * x.max(1.0), "function {k} at {x}: {a} and {b}");
            }
            // what dual numbers carry, to two derivatives
            let at = |x: f64| all(Dual2_64::from_re(x).derivative());
            for (k, (a, b)) in at(below).into_iter().zip(at(above)).enumerate() {
                assert!((a.v1 / b.v1 - 1.0).abs() < 1e-12, "function {k} at {x}: {a} and {b}");
                assert!((a.v2 / b.v2 - 1.0).abs() < 1e-10, "function {k} at {x}: {a} and {b}");
            }
        }
    }

    #[test]
    fn dual_numbers_have_the_values_of_plain_ones_and_their_slopes() {
        for x in [0.0, 1e-12, 0.01, 0.3, 0.99, 1.01, 4.0, 6.5, 20.0, 39.0] {
            let dual = all(Dual64::from_re(x).derivative());
            for (k, (dual, plain)) in dual.iter().zip(all(x)).enumerate() {
                // their quotients are products with reciprocals
                assert!(
                    (dual.re / plain - 1.0).abs() < 1e-14,
                    "function {k} at {x}: {} and {plain}",
                    dual.re
                );
            }
            for (value, slope) in [(2, 4), (3, 5), (6, 7)] {
                let (found, expected) = (dual[value].eps, dual[slope].re);
                assert!(
                    (found / expected - 1.0).abs() < 1e-12,
                    "function {value} at {x}: {found}, {expected}"
                );
            }
        }
    }
}
