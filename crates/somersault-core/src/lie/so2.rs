//! The rotation group SO(2) of the plane; its Lie algebra are angles, and it commutes.

use crate::scalar::Scalar;
use nalgebra::{Matrix2, UnitComplex};

/// The matrix of the rate: an angle times the quarter turn.
#[inline]
pub fn hat<T: Scalar>(angle: T) -> Matrix2<T> {
    Matrix2::new(T::zero(), -angle, angle, T::zero())
}

/// The angle of the skew-symmetric part of a matrix: `vee(&hat(angle)) == angle`.
#[inline]
pub fn vee<T: Scalar>(m: &Matrix2<T>) -> T {
    (m[(1, 0)] - m[(0, 1)]) * crate::scalar::constant(0.5)
}

/// The rotation by an angle.
#[inline]
pub fn exp<T: Scalar>(angle: T) -> UnitComplex<T> {
    UnitComplex::new(angle)
}

/// The angle of a rotation, in [−π, π].
#[inline]
pub fn log<T: Scalar>(rotation: &UnitComplex<T>) -> T {
    rotation.angle()
}

#[cfg(test)]
mod tests {
    use super::*;
    use num_dual::Dual64;

    #[test]
    fn log_inverts_exp_and_hat_is_the_rate() {
        for angle in [0.0_f64, 1e-170, -1e-9, 0.3, -2.0, 3.0, std::f64::consts::PI] {
            assert!((log(&exp(angle)) - angle).abs() <= 4.0 * f64::EPSILON * angle.abs(), "{angle}");
            let moving = exp(Dual64::from_re(angle).derivative());
            assert!((log(&moving).eps - 1.0).abs() < 1e-15);
            let matrix = moving.to_rotation_matrix().into_inner();
            let rate = matrix.map(|x| x.eps) * matrix.map(|x| x.re).transpose();
            assert!((rate - hat(1.0)).amax() < 1e-15);
            assert_eq!(vee(&hat(angle)), angle);
        }
    }
}
