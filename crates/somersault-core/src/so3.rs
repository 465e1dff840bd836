//! The rotation group SO(3) and its Lie algebra so(3) ≅ ℝ³.
//!
//! Rotations are unit quaternions; q and −q are the same rotation. A curve with R' = ω̂ R (ω in the
//! world frame) is written R = exp(u) R₀ with u' = dexp⁻¹_u(ω); for R' = R ω̂ (ω in the body frame)
//! R = R₀ exp(u) with u' = dexp⁻¹_{−u}(ω).
//!
//! Sources: Iserles, Munthe-Kaas, Nørsett and Zanna, *Lie-group methods*, Acta Numerica 9 (2000),
//! appendix B; Hairer, Lubich and Wanner, *Geometric Numerical Integration* (2006), section III.4.

use nalgebra::{Matrix3, Quaternion, UnitQuaternion, Vector3};

/// The skew-symmetric matrix û with û v = u × v.
#[inline]
pub fn hat(u: &Vector3<f64>) -> Matrix3<f64> {
    Matrix3::new(0.0, -u.z, u.y, u.z, 0.0, -u.x, -u.y, u.x, 0.0)
}

/// The vector of the skew-symmetric part of a matrix: `vee(&hat(&u)) == u`.
#[inline]
pub fn vee(m: &Matrix3<f64>) -> Vector3<f64> {
    0.5 * Vector3::new(m[(2, 1)] - m[(1, 2)], m[(0, 2)] - m[(2, 0)], m[(1, 0)] - m[(0, 1)])
}

/// cos √x and sin √x / √x for x ≥ 0, each to about one rounding.
///
/// Rotations over one time step are small: a short polynomial serves them where they are used, and the
/// rest is a call.
#[inline(always)]
fn cos_sinc_of_sqrt(x: f64) -> (f64, f64) {
    // The first neglected terms are below 3e-20 and 3e-21.
    const COS: [f64; 6] = even_taylor(0);
    const SINC: [f64; 6] = even_taylor(1);
    // Estrin's grouping: a step waits for this, and its chain is half as long as Horner's.
    let quintic = |c: &[f64; 6]| {
        let square = x * x;
        (c[0] + c[1] * x) + square * ((c[2] + c[3] * x) + square * (c[4] + c[5] * x))
    };
    if x < 1.0 / 64.0 { (quintic(&COS), quintic(&SINC)) } else { cos_sinc_of_large_sqrt(x) }
}

#[inline(never)]
fn cos_sinc_of_large_sqrt(x: f64) -> (f64, f64) {
    // The first neglected terms are below 5e-19 and 2e-20.
    const COS: [f64; 10] = even_taylor(0);
    const SINC: [f64; 10] = even_taylor(1);
    if x < 1.0 {
        (horner(&COS, x), horner(&SINC, x))
    } else {
        let angle = x.sqrt();
        let (sin, cos) = angle.sin_cos();
        (cos, sin / angle)
    }
}

/// (−1)^k / (2k + first)!
const fn even_taylor<const N: usize>(first: u64) -> [f64; N] {
    let mut c = [1.0; N];
    let mut k = 1;
    while k < N {
        let n = 2 * k as u64 + first;
        c[k] = -c[k - 1] / ((n * (n - 1)) as f64);
        k += 1;
    }
    c
}

#[inline(always)]
fn horner<const N: usize>(c: &[f64; N], x: f64) -> f64 {
    let mut p = c[N - 1];
    for k in (0..N - 1).rev() {
        p = p * x + c[k];
    }
    p
}

/// The rotation by the angle ‖u‖ about u (Rodrigues), as a unit quaternion.
///
/// Accurate to a rounding for all angles the trigonometric functions resolve; no branch point at 0.
#[inline(always)]
pub fn exp(u: &Vector3<f64>) -> UnitQuaternion<f64> {
    let (cos, sinc) = cos_sinc_of_sqrt(0.25 * u.norm_squared());
    let s = 0.5 * sinc;
    UnitQuaternion::new_unchecked(Quaternion::new(cos, s * u.x, s * u.y, s * u.z))
}

/// The rotation vector u of least length, ‖u‖ ≤ π, with `exp(&u)` equal to the rotation `q`.
///
/// Keeps all digits both near the identity and near a half turn, where u and −u meet: there the sign
/// follows the vector part of `q`.
#[inline]
pub fn log(q: &UnitQuaternion<f64>) -> Vector3<f64> {
    let (w, v) = if q.w < 0.0 { (-q.w, -q.imag()) } else { (q.w, q.imag()) };
    let sine = v.norm();
    // atan2(s, w)/s is even and smooth in s; below this its second term is under a rounding.
    let scale = if sine < 1e-9 { 2.0 / w } else { 2.0 * sine.atan2(w) / sine };
    v * scale
}

/// The angle of least magnitude, in [0, π], between two rotations given as quaternions.
///
/// The arctangent of the relative quaternion keeps full relative accuracy down to zero, where the
/// arccosine of a trace loses half the digits.
#[inline]
pub fn angle_between(a: &UnitQuaternion<f64>, b: &UnitQuaternion<f64>) -> f64 {
    let relative = a.inverse() * b;
    2.0 * relative.imag().norm().atan2(relative.w.abs())
}

/// The angle in [0, π] between two rotation matrices: atan2(‖vee(S)‖, (tr S − 1)/2), S = AᵀB.
#[inline]
pub fn angle_between_matrices(a: &Matrix3<f64>, b: &Matrix3<f64>) -> f64 {
    let relative = a.transpose() * b;
    vee(&relative).norm().atan2(0.5 * (relative.trace() - 1.0))
}

/// (1 − cos θ)/θ² as a function of θ².
#[inline]
fn versine_ratio(theta_squared: f64) -> f64 {
    let (_, sinc) = cos_sinc_of_sqrt(0.25 * theta_squared);
    0.5 * sinc * sinc
}

/// (θ − sin θ)/θ³ as a function of θ².
#[inline]
fn sine_defect_ratio(theta_squared: f64) -> f64 {
    let x = theta_squared;
    if x < 1.0 {
        // Σ (−x)^k/(2k+3)!; the first neglected term is 1/23! < 4e-23.
        let mut term = 1.0 / 6.0;
        let mut sum = term;
        for k in 1..10 {
            let n = 2.0 * k as f64 + 2.0;
            term *= -x / (n * (n + 1.0));
            sum += term;
        }
        sum
    } else {
        let theta = x.sqrt();
        (theta - theta.sin()) / (x * theta)
    }
}

/// dexp_u(v) = v + (1 − cos θ)/θ² u × v + (θ − sin θ)/θ³ u × (u × v), θ = ‖u‖.
///
/// The world-frame angular velocity of exp(u(t)) when u' = v. In the body frame it is
/// `dexp(&-u, &v)`.
#[inline]
pub fn dexp(u: &Vector3<f64>, v: &Vector3<f64>) -> Vector3<f64> {
    let x = u.norm_squared();
    let uv = u.cross(v);
    v + uv * versine_ratio(x) + u.cross(&uv) * sine_defect_ratio(x)
}

/// Slopes by θ² of the two ratios in [`dexp`].
#[inline]
fn ratio_slopes(theta_squared: f64) -> [f64; 2] {
    let x = theta_squared;
    if x < 1.0 {
        // Σ k (−1)^k x^(k−1)/(2k + 2)! and the same over (2k + 3)!
        let (mut term, mut slopes) = (-1.0, [0.0; 2]);
        let mut factorial = 2.0;
        for k in 1..11 {
            let n = 2.0 * f64::from(k);
            factorial *= (n + 1.0) * (n + 2.0);
            let share = f64::from(k) * term / factorial;
            slopes[0] += share;
            slopes[1] += share / (n + 3.0);
            term *= -x;
        }
        slopes
    } else {
        let (cos, sinc) = cos_sinc_of_sqrt(x);
        let sinc_slope = (cos - sinc) / (2.0 * x);
        [(sinc - 2.0 * versine_ratio(x)) / (2.0 * x), -(sinc_slope + sine_defect_ratio(x)) / x]
    }
}

/// ∂ dexp_u(v)/∂u.
pub fn dexp_partials(u: &Vector3<f64>, v: &Vector3<f64>) -> Matrix3<f64> {
    let x = u.norm_squared();
    let [versine_slope, defect_slope] = ratio_slopes(x);
    let uv = u.cross(v);
    let by_double = Matrix3::from_diagonal_element(u.dot(v)) + u * v.transpose() - v * u.transpose() * 2.0;
    let along = (uv * versine_slope + u.cross(&uv) * defect_slope) * 2.0;
    hat(v) * -versine_ratio(x) + by_double * sine_defect_ratio(x) + along * u.transpose()
}

/// (1 − (θ/2) cot(θ/2))/θ² = Σ_k 2/(4π²k² − θ²) as a function of θ²; 1/12 at 0, infinite at θ = 2π.
#[inline(always)]
fn cotangent_ratio(theta_squared: f64) -> f64 {
    let x = theta_squared;
    // The nearest pole is taken as it is; the sum of the others is Σ 2(ζ(2m+2) − 1) xᵐ/(2π)^(2m+2),
    // whose terms fall as (4π)^(−2m): the first neglected is below 1e-17 of the whole at the end of the
    // range. Estrin's grouping, as in `cos_sinc_of_sqrt`.
    const REST: [f64; 11] = [
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
    if x < 6.0 {
        let c = &REST;
        let (x2, x4) = (x * x, (x * x) * (x * x));
        let low = (c[0] + c[1] * x) + x2 * (c[2] + c[3] * x);
        let middle = (c[4] + c[5] * x) + x2 * (c[6] + c[7] * x);
        let high = (c[8] + c[9] * x) + x2 * c[10];
        2.0 / (FOUR_PI_SQUARED - x) + (low + x4 * (middle + x4 * high))
    } else {
        cotangent_ratio_of_large(x)
    }
}

#[inline(never)]
fn cotangent_ratio_of_large(x: f64) -> f64 {
    let half = 0.5 * x.sqrt();
    (1.0 - half / half.tan()) / x
}

/// dexp⁻¹_u(v) = v − ½ u × v + (1 − (θ/2) cot(θ/2))/θ² u × (u × v), θ = ‖u‖.
///
/// The inverse of [`dexp`] in v; singular at θ = 2π.
#[inline(always)]
pub fn dexp_inv(u: &Vector3<f64>, v: &Vector3<f64>) -> Vector3<f64> {
    let uv = u.cross(v);
    v - uv * 0.5 + u.cross(&uv) * cotangent_ratio(u.norm_squared())
}

/// The first `terms` terms of dexp_u(v) = Σ ad_uᵏ v/(k+1)!, ad_u v = u × v.
pub fn dexp_series(u: &Vector3<f64>, v: &Vector3<f64>, terms: usize) -> Vector3<f64> {
    let mut term = *v;
    let mut sum = Vector3::zeros();
    for k in 0..terms {
        sum += term;
        term = u.cross(&term) / (k as f64 + 2.0);
    }
    sum
}

/// The first `terms` terms of dexp⁻¹_u(v) = Σ B_k ad_uᵏ v/k!, B_k the Bernoulli numbers.
///
/// Converges for ‖u‖ < 2π.
pub fn dexp_inv_series(u: &Vector3<f64>, v: &Vector3<f64>, terms: usize) -> Vector3<f64> {
    let bernoulli = bernoulli_over_factorial(terms);
    let mut adjoint = *v;
    let mut sum = Vector3::zeros();
    for b in bernoulli {
        sum += adjoint * b;
        adjoint = u.cross(&adjoint);
    }
    sum
}

/// B_k/k! for k < `count`, from the generating function x/(eˣ − 1): Σ_{j≤k} b_j/(k+1−j)! = 0.
fn bernoulli_over_factorial(count: usize) -> Vec<f64> {
    let mut inverse_factorial = vec![1.0; count + 2];
    for k in 1..count + 2 {
        inverse_factorial[k] = inverse_factorial[k - 1] / k as f64;
    }
    let mut b: Vec<f64> = Vec::with_capacity(count);
    for k in 0..count {
        b.push(if k == 0 {
            1.0
        } else if k > 1 && k % 2 == 1 {
            0.0
        } else {
            -(0..k).map(|j| b[j] * inverse_factorial[k + 1 - j]).sum::<f64>()
        });
    }
    b
}

/// Brings a quaternion of nearly unit norm back to the unit sphere by one Newton step,
/// q (3 − ‖q‖²)/2; a deviation ε from unit norm becomes 3ε²/2.
#[inline]
pub fn renormalize(q: &UnitQuaternion<f64>) -> UnitQuaternion<f64> {
    let scale = 1.5 - 0.5 * q.as_ref().norm_squared();
    UnitQuaternion::new_unchecked(q.as_ref() * scale)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::f64::consts::PI;

    fn vector(largest: f64) -> impl Strategy<Value = Vector3<f64>> {
        // Lengths over many decades, so that every branch is met.
        ([-1.0f64..1.0, -1.0f64..1.0, -1.0f64..1.0], -18.0f64..0.0).prop_filter_map(
            "zero direction",
            move |(d, decade)| {
                let d = Vector3::from(d);
                (d.norm() > 1e-3).then(|| d.normalize() * largest * 10f64.powf(decade * 0.5))
            },
        )
    }

    proptest! {
        #![proptest_config(ProptestConfig {
            cases: 100_000,
            rng_seed: proptest::test_runner::RngSeed::Fixed(20_261_121),
            failure_persistence: None,
            ..ProptestConfig::default()
        })]

        #[test]
        fn log_inverts_exp_up_to_a_half_turn(u in vector(PI * (1.0 - 1e-15))) {
            let back = log(&exp(&u));
            prop_assert!((back - u).norm() <= 4.0 * f64::EPSILON * u.norm(), "{u:?} -> {back:?}");
        }

        #[test]
        fn exp_is_a_rotation_with_the_axis_fixed(u in vector(100.0)) {
            let q = exp(&u);
            prop_assert!((q.as_ref().norm() - 1.0).abs() < 4.0 * f64::EPSILON);
            prop_assert!((q * u - u).norm() <= 8.0 * f64::EPSILON * u.norm());
        }

        #[test]
        fn group_axioms(a in vector(PI), b in vector(PI), c in vector(PI)) {
            let (a, b, c) = (exp(&a), exp(&b), exp(&c));
            prop_assert!(angle_between(&((a * b) * c), &(a * (b * c))) < 1e-14);
            prop_assert!(angle_between(&(a * a.inverse()), &UnitQuaternion::identity()) < 1e-15);
            prop_assert!((angle_between(&a, &b) - angle_between(&b, &a)).abs() < 1e-15);
            prop_assert!((angle_between(&(c * a), &(c * b)) - angle_between(&a, &b)).abs() < 1e-14);
        }

        #[test]
        fn exp_of_minus_u_is_the_inverse(u in vector(50.0)) {
            prop_assert!((exp(&-u).as_ref() - exp(&u).inverse().as_ref()).norm() < 1e-15);
        }

        #[test]
        fn dexp_inv_inverts_dexp(u in vector(6.0), v in vector(1.0)) {
            let back = dexp_inv(&u, &dexp(&u, &v));
            prop_assert!((back - v).norm() <= 1e-13 * v.norm(), "{u:?} {v:?} {back:?}");
        }

        #[test]
        fn vee_inverts_hat_and_hat_is_the_cross_product(u in vector(1e3), v in vector(1e3)) {
            prop_assert_eq!(vee(&hat(&u)), u);
            prop_assert!((hat(&u) * v - u.cross(&v)).norm() <= 1e-15 * u.norm() * v.norm());
        }

        #[test]
        fn angle_of_exp_is_the_length_of_u(u in vector(PI)) {
            let one = UnitQuaternion::identity();
            prop_assert!((angle_between(&one, &exp(&u)) - u.norm()).abs() <= 4.0 * f64::EPSILON * u.norm());
            // A matrix holds its small angles only to the rounding of its entries.
            let m = exp(&u).to_rotation_matrix().into_inner();
            prop_assert!((angle_between_matrices(&Matrix3::identity(), &m) - u.norm()).abs() < 2e-15);
        }

        #[test]
        fn renormalize_squares_the_deviation(u in vector(PI), deviation in -1e-5f64..1e-5) {
            let q = UnitQuaternion::new_unchecked(exp(&u).as_ref() * (1.0 + deviation));
            prop_assert!((renormalize(&q).as_ref().norm() - 1.0).abs() <= 2.0 * deviation * deviation + 4.0 * f64::EPSILON);
        }
    }

    #[test]
    fn dexp_is_the_derivative_of_exp() {
        // Central difference of exp(u + s v) exp(u)⁻¹ at s = 0.
        for u in [Vector3::new(1e-6, 2e-6, -1e-6), Vector3::new(0.3, -0.2, 0.9), Vector3::new(2.0, 1.5, -1.9)]
        {
            let v = Vector3::new(-0.4, 0.7, 0.2);
            let s = 1e-5;
            let forward = log(&(exp(&(u + v * s)) * exp(&u).inverse()));
            let backward = log(&(exp(&(u - v * s)) * exp(&u).inverse()));
            assert!(((forward - backward) / (2.0 * s) - dexp(&u, &v)).norm() < 1e-9, "{u:?}");
        }
    }

    #[test]
    fn partials_of_dexp_are_its_differences() {
        let v = Vector3::new(-0.4, 0.7, 0.2);
        for u in [
            Vector3::new(1e-6, 2e-6, -1e-6),
            Vector3::new(0.3, -0.2, 0.9),
            Vector3::new(0.6, 0.5, 0.7),
            Vector3::new(2.0, 1.5, -1.9),
        ] {
            let s = 1e-3;
            let difference = |axis: Vector3<f64>| {
                let half = |s: f64| (dexp(&(u + axis * s), &v) - dexp(&(u - axis * s), &v)) / (2.0 * s);
                (half(s) * 4.0 - half(2.0 * s)) / 3.0
            };
            let expected = Matrix3::from_columns(&[Vector3::x(), Vector3::y(), Vector3::z()].map(difference));
            assert!((dexp_partials(&u, &v) - expected).norm() < 1e-12, "{u:?}");
        }
    }

    #[test]
    fn series_converge_to_the_closed_forms() {
        let u = Vector3::new(0.3, -0.5, 0.4);
        let v = Vector3::new(1.0, 2.0, -0.5);
        assert!((dexp_series(&u, &v, 20) - dexp(&u, &v)).norm() < 1e-15);
        assert!((dexp_inv_series(&u, &v, 26) - dexp_inv(&u, &v)).norm() < 2e-15);
        // Each truncation leaves an error of the size of its first neglected term.
        for terms in [1, 2, 3, 5, 7] {
            let error =
                |scale: f64| (dexp_inv_series(&(u * scale), &v, terms) - dexp_inv(&(u * scale), &v)).norm();
            let slope = (error(1.0) / error(0.5)).log2();
            let expected = if terms == 1 { 1.0 } else { (terms + terms % 2) as f64 };
            assert!((slope - expected).abs() < 0.1, "{terms} terms: slope {slope}");
        }
    }

    #[test]
    fn log_is_accurate_near_a_half_turn() {
        for distance in [1e-3, 1e-8, 1e-12, 0.0] {
            let u = Vector3::new(1.0, -2.0, 2.0) / 3.0 * (PI - distance);
            assert!((log(&exp(&u)) - u).norm() < 1e-15, "{distance}");
        }
    }

    #[test]
    fn small_angles_keep_all_their_digits() {
        let u = Vector3::new(3e-170, -4e-170, 0.0);
        let one = UnitQuaternion::identity();
        assert!((log(&exp(&u)) - u).norm() <= 1e-185);
        let tiny = Vector3::new(3e-12, -4e-12, 0.0);
        assert!((angle_between(&one, &exp(&tiny)) - 5e-12).abs() < 1e-27);
    }

    #[test]
    fn branches_of_the_ratios_meet() {
        for x in [1.0 / 64.0, 1.0, 6.0] {
            let (below, above) = (x * (1.0 - 1e-15), x * (1.0 + 1e-15));
            for f in [cotangent_ratio, sine_defect_ratio, versine_ratio] {
                assert!((f(below) / f(above) - 1.0).abs() < 5e-15, "{x}");
            }
            for (below, above) in ratio_slopes(below).into_iter().zip(ratio_slopes(above)) {
                assert!((below / above - 1.0).abs() < 5e-14, "{x}");
            }
            let (a, b) = (cos_sinc_of_sqrt(below), cos_sinc_of_sqrt(above));
            let bound = 1e-15 * x.max(1.0);
            assert!((a.0 - b.0).abs() < bound && (a.1 - b.1).abs() < bound, "{x}");
        }
    }
}
