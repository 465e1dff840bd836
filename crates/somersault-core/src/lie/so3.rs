//! The rotation group SO(3) and its Lie algebra so(3) ≅ ℝ³.
//!
//! Rotations are unit quaternions; q and −q are the same rotation. A curve with R' = ω̂ R (ω in the
//! world frame) is written R = exp(u) R₀ with u' = dexp⁻¹_u(ω); for R' = R ω̂ (ω in the body frame)
//! R = R₀ exp(u) with u' = dexp⁻¹_{−u}(ω).

use super::even::{
    cos_sinc, cotangent_ratio, cotangent_ratio_slope, horner, ratio_slopes, sine_defect_ratio, versine_ratio,
};
use crate::scalar::{Arithmetic, Scalar, constant};
use nalgebra::{Matrix3, Quaternion, UnitQuaternion, Vector3};

/// The rotation whose quaternion, of unit norm, is stored as x, y, z, w.
#[inline(always)]
pub fn from_xyzw<T: Scalar>(numbers: &[T]) -> UnitQuaternion<T> {
    UnitQuaternion::new_unchecked(Quaternion::new(numbers[3], numbers[0], numbers[1], numbers[2]))
}

/// The rotation matrix of the quaternion of unit norm that is stored as x, y, z, w.
#[inline(always)]
pub fn matrix_of_xyzw<T: Arithmetic>(numbers: &[T]) -> Matrix3<T> {
    let [x, y, z, w] = [numbers[0], numbers[1], numbers[2], numbers[3]];
    let twice = |a: T| a + a;
    let (ww, xx, yy, zz) = (w * w, x * x, y * y, z * z);
    let (xy, xz, yz) = (twice(x * y), twice(x * z), twice(y * z));
    let (wx, wy, wz) = (twice(w * x), twice(w * y), twice(w * z));
    Matrix3::new(
        ww + xx - yy - zz,
        xy - wz,
        wy + xz,
        wz + xy,
        ww - xx + yy - zz,
        yz - wx,
        xz - wy,
        wx + yz,
        ww - xx - yy + zz,
    )
}

/// The rotation whose quaternion is stored as x, y, z, w, of any norm but zero.
pub fn normalized_xyzw(numbers: &[f64]) -> UnitQuaternion<f64> {
    UnitQuaternion::new_normalize(from_xyzw(numbers).into_inner())
}

/// The skew-symmetric matrix û with û v = u × v.
#[inline(always)]
pub fn hat<T: Scalar>(u: &Vector3<T>) -> Matrix3<T> {
    let o = T::zero();
    Matrix3::new(o, -u.z, u.y, u.z, o, -u.x, -u.y, u.x, o)
}

/// The vector of the skew-symmetric part of a matrix: `vee(&hat(&u)) == u`.
#[inline]
pub fn vee<T: Scalar>(m: &Matrix3<T>) -> Vector3<T> {
    Vector3::new(m[(2, 1)] - m[(1, 2)], m[(0, 2)] - m[(2, 0)], m[(1, 0)] - m[(0, 1)]) * constant::<T>(0.5)
}

/// The rotation by the angle ‖u‖ about u (Rodrigues), as a unit quaternion.
///
/// Accurate to a rounding for all angles the trigonometric functions resolve; no branch point at 0.
#[inline(always)]
pub fn exp<T: Scalar>(u: &Vector3<T>) -> UnitQuaternion<T> {
    let (cos, sinc) = cos_sinc(u.norm_squared() * constant(0.25));
    let s = sinc * constant(0.5);
    UnitQuaternion::new_unchecked(Quaternion::new(cos, s * u.x, s * u.y, s * u.z))
}

/// The rotation vector u of least length, ‖u‖ ≤ π, with `exp(&u)` equal to the rotation `q`.
///
/// Keeps all digits both near the identity and near a half turn, where u and −u meet: there the sign
/// follows the vector part of `q`.
#[inline]
pub fn log<T: Scalar>(q: &UnitQuaternion<T>) -> Vector3<T> {
    // 2 atan(z)/z = 2 Σ (−z²)^k/(2k + 1); at z = 0.1 the first neglected term is below 2e-19.
    const ATAN: [f64; 9] =
        [2.0, -2.0 / 3.0, 2.0 / 5.0, -2.0 / 7.0, 2.0 / 9.0, -2.0 / 11.0, 2.0 / 13.0, -2.0 / 15.0, 2.0 / 17.0];
    let (w, v) = if q.w < T::zero() { (-q.w, -q.imag()) } else { (q.w, q.imag()) };
    let (square, of_w) = (v.norm_squared(), w * w);
    let scale = if square < of_w * constant(0.01) {
        horner(&ATAN, square / of_w) / w
    } else {
        let sine = square.sqrt();
        sine.atan2(w) * constant(2.0) / sine
    };
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

/// dexp_u(v) = v + (1 − cos θ)/θ² u × v + (θ − sin θ)/θ³ u × (u × v), θ = ‖u‖.
///
/// The world-frame angular velocity of exp(u(t)) when u' = v. In the body frame it is
/// `dexp(&-u, &v)`.
#[inline]
pub fn dexp<T: Scalar>(u: &Vector3<T>, v: &Vector3<T>) -> Vector3<T> {
    let x = u.norm_squared();
    let uv = u.cross(v);
    v + uv * versine_ratio(x) + u.cross(&uv) * sine_defect_ratio(x)
}

/// ∂ dexp_u(v)/∂u.
pub fn dexp_partials<T: Scalar>(u: &Vector3<T>, v: &Vector3<T>) -> Matrix3<T> {
    let x = u.norm_squared();
    partials(u, v, [versine_ratio(x), sine_defect_ratio(x)], ratio_slopes(x))
}

/// dexp⁻¹_u(v) = v − ½ u × v + (1 − (θ/2) cot(θ/2))/θ² u × (u × v), θ = ‖u‖.
///
/// The inverse of [`dexp`] in v; singular at θ = 2π.
#[inline(always)]
pub fn dexp_inv<T: Scalar>(u: &Vector3<T>, v: &Vector3<T>) -> Vector3<T> {
    let uv = u.cross(v);
    v - uv * constant::<T>(0.5) + u.cross(&uv) * cotangent_ratio(u.norm_squared())
}

/// ∂ dexp⁻¹_u(v)/∂u.
pub fn dexp_inv_partials<T: Scalar>(u: &Vector3<T>, v: &Vector3<T>) -> Matrix3<T> {
    let x = u.norm_squared();
    partials(u, v, [constant(-0.5), cotangent_ratio(x)], [T::zero(), cotangent_ratio_slope(x)])
}

/// The partials by u of v + a u × v + b u × (u × v), for functions a and b of ‖u‖² and their slopes.
fn partials<T: Scalar>(u: &Vector3<T>, v: &Vector3<T>, [a, b]: [T; 2], slopes: [T; 2]) -> Matrix3<T> {
    let uv = u.cross(v);
    let outer = v * u.transpose();
    let by_double = Matrix3::from_diagonal_element(u.dot(v)) + outer.transpose() - outer * constant::<T>(2.0);
    let along = (uv * slopes[0] + u.cross(&uv) * slopes[1]) * constant::<T>(2.0);
    hat(v) * -a + by_double * b + along * u.transpose()
}

/// J_l(u), the matrix of [`dexp`]: what a change of u turns exp(u) by, in the axes it starts from.
#[inline]
pub fn left_jacobian<T: Scalar>(u: &Vector3<T>) -> Matrix3<T> {
    let (x, u_hat) = (u.norm_squared(), hat(u));
    Matrix3::identity() + u_hat * versine_ratio(x) + u_hat * u_hat * sine_defect_ratio(x)
}

/// J_l(u)⁻¹, the matrix of [`dexp_inv`].
#[inline]
pub fn left_jacobian_inverse<T: Scalar>(u: &Vector3<T>) -> Matrix3<T> {
    let u_hat = hat(u);
    Matrix3::identity() - u_hat * constant::<T>(0.5) + u_hat * u_hat * cotangent_ratio(u.norm_squared())
}

/// J_r(u): what a change of u turns exp(u) by, in the axes it leads to.
#[inline]
pub fn right_jacobian<T: Scalar>(u: &Vector3<T>) -> Matrix3<T> {
    left_jacobian(&-u)
}

/// J_r(u)⁻¹.
#[inline]
pub fn right_jacobian_inverse<T: Scalar>(u: &Vector3<T>) -> Matrix3<T> {
    left_jacobian_inverse(&-u)
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
    use crate::random::SplitMix64;
    use std::f64::consts::PI;

    /// A check of 100,000 tuples of vectors, up to lengths that are given.
    fn for_random<const N: usize>(largest: [f64; N], check: impl Fn([Vector3<f64>; N])) {
        let mut random = SplitMix64::new(20_261_121);
        for _ in 0..100_000 {
            check(largest.map(|largest| {
                let direction = loop {
                    let d = Vector3::from_fn(|_, _| 2.0 * random.unit() - 1.0);
                    if d.norm() > 1e-3 {
                        break d.normalize();
                    }
                };
                // Lengths over many decades, so that every branch is met.
                direction * largest * 10f64.powf(-9.0 * random.unit())
            }));
        }
    }

    #[test]
    fn log_inverts_exp_up_to_a_half_turn() {
        for_random([PI * (1.0 - 1e-15)], |[u]| {
            let back = log(&exp(&u));
            assert!((back - u).norm() <= 4.0 * f64::EPSILON * u.norm(), "{u:?} -> {back:?}");
        });
    }

    #[test]
    fn exp_is_a_rotation_with_the_axis_fixed() {
        for_random([100.0], |[u]| {
            let q = exp(&u);
            assert!((q.as_ref().norm() - 1.0).abs() < 4.0 * f64::EPSILON);
            assert!((q * u - u).norm() <= 8.0 * f64::EPSILON * u.norm());
        });
    }

    #[test]
    fn group_axioms() {
        for_random([PI, PI, PI], |[a, b, c]| {
            let (a, b, c) = (exp(&a), exp(&b), exp(&c));
            assert!(angle_between(&((a * b) * c), &(a * (b * c))) < 1e-14);
            assert!(angle_between(&(a * a.inverse()), &UnitQuaternion::identity()) < 1e-15);
            assert!((angle_between(&a, &b) - angle_between(&b, &a)).abs() < 1e-15);
            assert!((angle_between(&(c * a), &(c * b)) - angle_between(&a, &b)).abs() < 1e-14);
        });
    }

    #[test]
    fn exp_of_minus_u_is_the_inverse() {
        for_random([50.0], |[u]| {
            assert!((exp(&-u).as_ref() - exp(&u).inverse().as_ref()).norm() < 1e-15);
        });
    }

    #[test]
    fn dexp_inv_inverts_dexp() {
        for_random([6.0, 1.0], |[u, v]| {
            let back = dexp_inv(&u, &dexp(&u, &v));
            assert!((back - v).norm() <= 1e-13 * v.norm(), "{u:?} {v:?} {back:?}");
        });
    }

    #[test]
    fn vee_inverts_hat_and_hat_is_the_cross_product() {
        for_random([1e3, 1e3], |[u, v]| {
            assert_eq!(vee(&hat(&u)), u);
            assert!((hat(&u) * v - u.cross(&v)).norm() <= 1e-15 * u.norm() * v.norm());
        });
    }

    #[test]
    fn angle_of_exp_is_the_length_of_u() {
        for_random([PI], |[u]| {
            let one = UnitQuaternion::identity();
            assert!((angle_between(&one, &exp(&u)) - u.norm()).abs() <= 4.0 * f64::EPSILON * u.norm());
            // A matrix holds its small angles only to the rounding of its entries.
            let m = exp(&u).to_rotation_matrix().into_inner();
            assert!((angle_between_matrices(&Matrix3::identity(), &m) - u.norm()).abs() < 2e-15);
        });
    }

    #[test]
    fn renormalize_squares_the_deviation() {
        for_random([PI, 1e-5], |[u, small]| {
            let deviation = small.x;
            let q = UnitQuaternion::new_unchecked(exp(&u).as_ref() * (1.0 + deviation));
            assert!(
                (renormalize(&q).as_ref().norm() - 1.0).abs()
                    <= 2.0 * deviation * deviation + 4.0 * f64::EPSILON
            );
        });
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
}
