//! The inverse differential of exp on SO(3), its series ended after three terms.
//!
//! ```text
//! R = R₀ exp(u),  R' = R ω̂:   u' = ω + ½ u × ω + ¹⁄₁₂ u × (u × ω) + O(‖u‖⁴ ‖ω‖)
//! ```
//! A Runge–Kutta–Munthe-Kaas method of order 4 needs no more. It is a polynomial, so that it and its derivatives cost a few
//! products and have no singular turn. [`so3`](super::so3) has the whole of it.
//!
//! Source: H. Munthe-Kaas, BIT 38 (1998) 92.

use super::so3::hat;
use nalgebra::{Matrix3, Vector3};

/// u' for the angular velocity ω in body axes.
pub fn rate(u: &Vector3<f64>, omega: &Vector3<f64>) -> Vector3<f64> {
    let cross = u.cross(omega);
    omega + cross * 0.5 + u.cross(&cross) / 12.0
}

/// ∂u'/∂ω and ∂u'/∂u.
pub fn rate_partials(u: &Vector3<f64>, omega: &Vector3<f64>) -> [Matrix3<f64>; 2] {
    let (u_hat, omega_hat) = (hat(u), hat(omega));
    let by_omega = Matrix3::identity() + u_hat * 0.5 + u_hat * u_hat / 12.0;
    let by_u = omega_hat * -0.5 - (hat(&u.cross(omega)) + u_hat * omega_hat) / 12.0;
    [by_omega, by_u]
}

/// ∂ω/∂u', the inverse of 1 + û/2 + û²/12, which every u has.
pub fn omega_by_rate(u: &Vector3<f64>) -> Matrix3<f64> {
    let (u_hat, square) = (hat(u), u.norm_squared());
    let n = 1.0 + square / 12.0 + square * square / 144.0;
    Matrix3::identity() - u_hat * (0.5 / n) + u_hat * u_hat * ((1.0 / 6.0 + square / 144.0) / n)
}

/// Second derivatives of κ · u': by u twice, and by ω and u.
pub fn rate_second_partials(
    u: &Vector3<f64>,
    omega: &Vector3<f64>,
    kappa: &Vector3<f64>,
) -> [Matrix3<f64>; 2] {
    let one = Matrix3::identity();
    let by_u = kappa * omega.transpose() + omega * kappa.transpose() - one * (2.0 * kappa.dot(omega));
    let by_both = one * u.dot(kappa) + u * kappa.transpose() - kappa * u.transpose() * 2.0;
    [by_u / 12.0, hat(kappa) * 0.5 + by_both / 12.0]
}

#[cfg(test)]
mod tests {
    use super::super::so3;
    use super::*;

    const OMEGA: Vector3<f64> = Vector3::new(1.0, 2.0, -0.5);

    #[test]
    fn the_rate_is_three_terms_of_the_series() {
        let u = Vector3::new(0.3, -0.5, 0.4);
        assert!((rate(&u, &OMEGA) - so3::dexp_inv_series(&-u, &OMEGA, 3)).norm() < 1e-15);
        let error = |scale: f64| (rate(&(u * scale), &OMEGA) - so3::dexp_inv(&(u * -scale), &OMEGA)).norm();
        assert!(((error(1.0) / error(0.5)).log2() - 4.0).abs() < 0.1);
    }

    #[test]
    fn the_rate_has_an_inverse() {
        for size in [0.0, 1e-9, 0.3, 2.0, 12f64.sqrt(), 40.0] {
            let u = Vector3::new(0.6, -0.64, 0.48) * size;
            let [by_omega, _] = rate_partials(&u, &Vector3::x());
            let product = omega_by_rate(&u) * by_omega;
            assert!((product - Matrix3::identity()).amax() < 1e-13, "{size}: {product}");
        }
    }

    /// The rate is linear in ω and quadratic in u: central differences are exact but for their rounding.
    #[test]
    fn partials_of_the_rate_are_its_differences() {
        let (u, kappa, s) = (Vector3::new(0.3, -0.5, 0.4), Vector3::new(-0.2, 0.7, 0.9), 0.25);
        let [by_omega, by_u] = rate_partials(&u, &OMEGA);
        let [by_u_twice, by_both] = rate_second_partials(&u, &OMEGA, &kappa);
        for (k, axis) in [Vector3::x(), Vector3::y(), Vector3::z()].into_iter().enumerate() {
            let along = |f: &dyn Fn(f64) -> Vector3<f64>| (f(s) - f(-s)) / (2.0 * s);
            let of_omega = along(&|s| rate(&u, &(OMEGA + axis * s)));
            let of_u = along(&|s| rate(&(u + axis * s), &OMEGA));
            assert!((of_omega - by_omega.column(k)).norm() < 1e-14);
            assert!((of_u - by_u.column(k)).norm() < 1e-14);
            let of_partials =
                [0, 1].map(|part| along(&|s| rate_partials(&(u + axis * s), &OMEGA)[part].tr_mul(&kappa)));
            assert!((of_partials[0] - by_both.column(k)).norm() < 1e-14);
            assert!((of_partials[1] - by_u_twice.column(k)).norm() < 1e-14);
        }
    }
}
