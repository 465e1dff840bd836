//! The rigid motions SE(2) of the plane. A displacement is (ρ, θ): a linear part and an angle.
//!
//! SE(2) is the plane of SE(3): the Jacobians are those of [`se3`](super::se3), of which the numbers x, y and the angle about z
//! remain.

use super::even::{cos_sinc, cotangent_ratio, sine_defect_ratio, versine_ratio};
use super::so2;
use crate::scalar::{Scalar, constant};
use nalgebra::{Isometry2, Matrix3, Translation2, Vector2};

/// v turned by a quarter turn.
fn quarter_turn<T: Scalar>(v: &Vector2<T>) -> Vector2<T> {
    Vector2::new(-v.y, v.x)
}

/// The translation of exp(ρ, θ): (sin θ/θ) ρ + ((1 − cos θ)/θ) Jρ, J the quarter turn.
pub fn translation<T: Scalar>(rho: &Vector2<T>, angle: T) -> Vector2<T> {
    let (square, quarter) = (angle * angle, quarter_turn(rho));
    let (_, sinc) = cos_sinc(square);
    rho * sinc + quarter * (angle * versine_ratio(square))
}

/// ρ with `translation(ρ, θ) = p`: (θ/2) cot(θ/2) p − (θ/2) Jp, for |θ| < 2π.
///
/// The angle is given by itself, so that one beyond a half turn may be meant.
pub fn linear_part<T: Scalar>(p: &Vector2<T>, angle: T) -> Vector2<T> {
    let square = angle * angle;
    let along = T::one() - square * cotangent_ratio(square);
    p * along - quarter_turn(p) * (angle * constant(0.5))
}

/// The rigid motion reached by the constant velocity (ρ, θ) in a unit of time.
pub fn exp<T: Scalar>(rho: &Vector2<T>, angle: T) -> Isometry2<T> {
    Isometry2::from_parts(Translation2::from(translation(rho, angle)), so2::exp(angle))
}

/// The displacement of least rotation, |θ| ≤ π, that leads to a rigid motion.
pub fn log<T: Scalar>(motion: &Isometry2<T>) -> (Vector2<T>, T) {
    let angle = so2::log(&motion.rotation);
    (linear_part(&motion.translation.vector, angle), angle)
}

/// J_l: what a change of the displacement moves exp(ρ, θ) by, from the left.
pub fn left_jacobian<T: Scalar>(rho: &Vector2<T>, angle: T) -> Matrix3<T> {
    let square = angle * angle;
    let (_, sinc) = cos_sinc(square);
    let (versine, defect) = (versine_ratio(square), sine_defect_ratio(square));
    assemble(sinc, angle * versine, quarter_turn(rho) * -versine + rho * (angle * defect))
}

/// J_l⁻¹, for |θ| < 2π.
pub fn left_jacobian_inverse<T: Scalar>(rho: &Vector2<T>, angle: T) -> Matrix3<T> {
    let (square, half) = (angle * angle, constant::<T>(0.5));
    let ratio = cotangent_ratio(square);
    assemble(T::one() - square * ratio, -(angle * half), quarter_turn(rho) * half + rho * (angle * ratio))
}

/// J_r: what a change of the displacement moves exp(ρ, θ) by, from the right.
pub fn right_jacobian<T: Scalar>(rho: &Vector2<T>, angle: T) -> Matrix3<T> {
    left_jacobian(&-rho, -angle)
}

/// J_r⁻¹, for |θ| < 2π.
pub fn right_jacobian_inverse<T: Scalar>(rho: &Vector2<T>, angle: T) -> Matrix3<T> {
    left_jacobian_inverse(&-rho, -angle)
}

/// a + b J beside what the angle moves the place by.
fn assemble<T: Scalar>(a: T, b: T, by_angle: Vector2<T>) -> Matrix3<T> {
    let o = T::zero();
    Matrix3::new(a, -b, by_angle.x, b, a, by_angle.y, o, o, T::one())
}
