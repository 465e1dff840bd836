//! Exponentials and logarithms of SO(3), SE(3) and SE(2) over a generic scalar.
//!
//! The factors of Rodrigues' formulas are even in the angle θ; they are taken as functions of θ² and
//! expanded near zero, so that derivatives exist there. Rates act from the right: exp maps a
//! displacement in body axes. Sources: Murray, Li and Sastry, *A Mathematical Introduction to Robotic
//! Manipulation* (1994), appendix A; Iserles et al., Acta Numerica 9 (2000), appendix B.

use crate::scalar::{Scalar, constant};
use nalgebra::{Quaternion, Vector2, Vector3};

/// Σ c_k x^k.
fn horner<T: Scalar>(coefficients: &[f64], x: T) -> T {
    coefficients.iter().rev().fold(T::zero(), |sum, &c| sum * x + constant(c))
}

/// (−1)^k / (2k + first)!
const fn even_taylor<const N: usize>(first: u64) -> [f64; N] {
    let mut c = [1.0; N];
    let mut k = 0;
    while k < N {
        let n = 2 * k as u64 + first;
        if k > 0 {
            c[k] = -c[k - 1] / ((n * (n - 1)) as f64);
        } else {
            let mut m = 2;
            while m <= n {
                c[0] /= m as f64;
                m += 1;
            }
        }
        k += 1;
    }
    c
}

// At x = 1 the first neglected terms are below 1e-18.
const COS: [f64; 10] = even_taylor(0);
const SINC: [f64; 10] = even_taylor(1);
const SINE_DEFECT: [f64; 9] = even_taylor(3);

/// cos θ and sin θ / θ as functions of θ².
fn cos_sinc<T: Scalar>(x: T) -> (T, T) {
    if x < T::one() {
        (horner(&COS, x), horner(&SINC, x))
    } else {
        let angle = x.sqrt();
        let (sin, cos) = angle.sin_cos();
        (cos, sin / angle)
    }
}

/// (θ − sin θ)/θ³ as a function of θ².
fn sine_defect<T: Scalar>(x: T) -> T {
    if x < T::one() {
        horner(&SINE_DEFECT, x)
    } else {
        let angle = x.sqrt();
        (angle - angle.sin()) / (x * angle)
    }
}

/// k(x) = (1 − (θ/2) cot(θ/2))/θ² and dk/dx as functions of x = θ² < 4π², to rounding.
///
/// The coefficients of the inverse of the exponential map of SO(3), J⁻¹(φ) = 1 + ½ φ̂ + k φ̂². Below x = 1 by
/// Σ |B₂ⱼ| x^{j−1}/(2j)!, whose first neglected term is below 1e-18.
#[inline]
pub fn cotangent_ratio<T: Scalar>(x: T) -> [T; 2] {
    const SERIES: [f64; 11] = [
        1.0 / 12.0,
        1.0 / 720.0,
        1.0 / 30_240.0,
        1.0 / 1_209_600.0,
        1.0 / 47_900_160.0,
        691.0 / 1_307_674_368_000.0,
        1.0 / 74_724_249_600.0,
        3617.0 / 10_670_622_842_880_000.0,
        43_867.0 / 5_109_094_217_170_944_000.0,
        174_611.0 / 802_857_662_698_291_200_000.0,
        77_683.0 / 14_101_100_039_391_805_440_000.0,
    ];
    if x < T::one() {
        let (mut value, mut slope) = (T::zero(), T::zero());
        for &coefficient in SERIES.iter().rev() {
            slope = slope * x + value;
            value = value * x + constant(coefficient);
        }
        return [value, slope];
    }
    let half = x.sqrt() * constant(0.5);
    let (sin, cos) = half.sin_cos();
    let value = (T::one() - half * cos / sin) / x;
    // d(h cot h)/dx for h = √x/2
    let slope = (cos / sin - half / (sin * sin)) / (half * constant(8.0));
    [value, -(slope + value) / x]
}

/// The unit quaternion of the rotation by ‖u‖ about u.
pub(crate) fn exp_so3<T: Scalar>(u: &Vector3<T>) -> Quaternion<T> {
    let (cos, sinc) = cos_sinc(u.norm_squared() * constant(0.25));
    Quaternion::from_parts(cos, u * (sinc * constant(0.5)))
}

/// The rotation vector of least length of a unit quaternion, ‖u‖ ≤ π.
pub(crate) fn log_so3<T: Scalar>(q: &Quaternion<T>) -> Vector3<T> {
    // 2 atan(z)/z = 2 Σ (−z²)^k/(2k + 1)
    const ATAN: [f64; 9] =
        [2.0, -2.0 / 3.0, 2.0 / 5.0, -2.0 / 7.0, 2.0 / 9.0, -2.0 / 11.0, 2.0 / 13.0, -2.0 / 15.0, 2.0 / 17.0];
    let (w, v) = if q.w < T::zero() { (-q.w, -q.imag()) } else { (q.w, q.imag()) };
    let square = v.norm_squared();
    let scale = if square < w * w * constant(0.01) {
        horner(&ATAN, square / (w * w)) / w
    } else {
        let sine = square.sqrt();
        sine.atan2(w) * constant(2.0) / sine
    };
    v * scale
}

/// The translation of exp(ρ, u) ∈ SE(3): ρ + (1 − cos θ)/θ² u × ρ + (θ − sin θ)/θ³ u × (u × ρ).
pub(crate) fn exp_se3_translation<T: Scalar>(rho: &Vector3<T>, u: &Vector3<T>) -> Vector3<T> {
    let x = u.norm_squared();
    let (_, half_sinc) = cos_sinc(x * constant(0.25));
    let cross = u.cross(rho);
    rho + cross * (half_sinc * half_sinc * constant(0.5)) + u.cross(&cross) * sine_defect(x)
}

/// ρ with `exp_se3_translation(ρ, u) = p`: p − ½ u × p + (1 − (θ/2) cot(θ/2))/θ² u × (u × p).
pub(crate) fn log_se3_translation<T: Scalar>(p: &Vector3<T>, u: &Vector3<T>) -> Vector3<T> {
    let cross = u.cross(p);
    p - cross * constant::<T>(0.5) + u.cross(&cross) * cotangent_ratio(u.norm_squared())[0]
}

/// v turned by a quarter turn.
fn quarter_turn<T: Scalar>(v: &Vector2<T>) -> Vector2<T> {
    Vector2::new(-v.y, v.x)
}

/// The translation of exp(ρ, θ) ∈ SE(2): (sin θ/θ) ρ + ((1 − cos θ)/θ) Jρ, J the quarter turn.
pub(crate) fn exp_se2_translation<T: Scalar>(rho: &Vector2<T>, angle: T) -> Vector2<T> {
    let (_, sinc) = cos_sinc(angle * angle);
    let (_, half_sinc) = cos_sinc(angle * angle * constant(0.25));
    rho * sinc + quarter_turn(rho) * (angle * half_sinc * half_sinc * constant(0.5))
}

/// ρ with `exp_se2_translation(ρ, θ) = p`: (θ/2) cot(θ/2) p − (θ/2) Jp, for |θ| < 2π.
pub(crate) fn log_se2_translation<T: Scalar>(p: &Vector2<T>, angle: T) -> Vector2<T> {
    let square = angle * angle;
    let along = T::one() - square * cotangent_ratio(square)[0];
    p * along - quarter_turn(p) * (angle * constant(0.5))
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Matrix3, Matrix4};
    use somersault_core::so3;

    const VECTORS: [[f64; 3]; 5] =
        [[0.0, 0.0, 0.0], [1e-9, -2e-9, 3e-9], [0.1, 0.05, -0.02], [0.7, -0.6, 0.3], [1.5, 2.0, -1.7]];

    #[test]
    fn so3_maps_equal_those_of_the_core() {
        for u in VECTORS.map(Vector3::from) {
            let q = exp_so3(&u);
            assert!((q - so3::exp(&u).into_inner()).norm() < 4e-16);
            assert!((log_so3(&q) - u).norm() < 1e-15, "{u}");
            assert!((log_so3(&-q) - u).norm() < 1e-15, "{u}");
        }
    }

    #[test]
    fn se3_exponential_is_the_matrix_exponential() {
        let rho = Vector3::new(0.3, -1.2, 0.8);
        for u in VECTORS.map(Vector3::from) {
            let mut generator = Matrix4::zeros();
            generator.fixed_view_mut::<3, 3>(0, 0).copy_from(&so3::hat(&u));
            generator.fixed_view_mut::<3, 1>(0, 3).copy_from(&rho);
            let (mut term, mut sum) = (Matrix4::<f64>::identity(), Matrix4::identity());
            for k in 1..60 {
                term = term * generator / f64::from(k);
                sum += term;
            }
            let p = exp_se3_translation(&rho, &u);
            assert!((p - sum.fixed_view::<3, 1>(0, 3)).norm() < 2e-14);
            let r: Matrix3<f64> = so3::exp(&u).to_rotation_matrix().into_inner();
            assert!((r - sum.fixed_view::<3, 3>(0, 0)).norm() < 2e-14);
            assert!((log_se3_translation(&p, &u) - rho).norm() < 1e-14);
        }
    }

    #[test]
    fn se2_is_the_plane_of_se3() {
        for angle in [0.0, 1e-8, -0.3, 1.4, 3.0, -6.0] {
            let rho = Vector2::new(0.4, -0.9);
            let p = exp_se2_translation(&rho, angle);
            let full = exp_se3_translation(&Vector3::new(0.4, -0.9, 0.0), &Vector3::new(0.0, 0.0, angle));
            assert!((p - full.xy()).norm() < 1e-15);
            assert!((log_se2_translation(&p, angle) - rho).norm() < 1e-14);
        }
    }
}
