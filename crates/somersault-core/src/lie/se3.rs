//! The rigid motions SE(3) of space. A displacement is (ρ, u): a linear part and a rotation vector.
//!
//! se(3) is so(3) over dual numbers: with u + ε ρ in the place of u, ε² = 0, the formulas of SO(3) become those of SE(3). A
//! matrix M(u) of SO(3) therefore gives the matrix of SE(3) with M on its diagonal and dM(u + ε ρ)/dε above it. Source:
//! J. M. Selig, *Geometric Fundamentals of Robotics* (2005), section 7.6.

use super::even::{cotangent_ratio, cotangent_ratio_slope, ratio_slopes, sine_defect_ratio, versine_ratio};
use super::so3::{self, hat};
use crate::scalar::{Scalar, constant};
use nalgebra::{Isometry3, Matrix3, Matrix6, Translation3, Vector3};

/// The rigid motion reached by the constant velocity (ρ, u) in a unit of time.
#[inline]
pub fn exp<T: Scalar>(rho: &Vector3<T>, u: &Vector3<T>) -> Isometry3<T> {
    Isometry3::from_parts(Translation3::from(so3::dexp(u, rho)), so3::exp(u))
}

/// The displacement of least rotation, ‖u‖ ≤ π, that leads to a rigid motion.
#[inline]
pub fn log<T: Scalar>(motion: &Isometry3<T>) -> [Vector3<T>; 2] {
    let u = so3::log(&motion.rotation);
    [so3::dexp_inv(&u, &motion.translation.vector), u]
}

/// Ad: a displacement from the right of a rigid motion as the one from its left, motion exp(d) = exp(Ad d) motion.
pub fn adjoint<T: Scalar>(motion: &Isometry3<T>) -> Matrix6<T> {
    let r = motion.rotation.to_rotation_matrix().into_inner();
    assemble(&r, &(hat(&motion.translation.vector) * r))
}

/// ad: the bracket with (ρ, u), the rate of Ad.
pub fn bracket<T: Scalar>(rho: &Vector3<T>, u: &Vector3<T>) -> Matrix6<T> {
    assemble(&hat(u), &hat(rho))
}

/// J_l: what a change of the displacement moves exp(ρ, u) by, from the left.
pub fn left_jacobian<T: Scalar>(rho: &Vector3<T>, u: &Vector3<T>) -> Matrix6<T> {
    let x = u.norm_squared();
    let [versine_slope, defect_slope] = ratio_slopes(x);
    polynomial(rho, u, [versine_ratio(x), sine_defect_ratio(x)], [versine_slope, defect_slope])
}

/// J_l⁻¹, for ‖u‖ < 2π.
pub fn left_jacobian_inverse<T: Scalar>(rho: &Vector3<T>, u: &Vector3<T>) -> Matrix6<T> {
    let x = u.norm_squared();
    polynomial(rho, u, [constant(-0.5), cotangent_ratio(x)], [T::zero(), cotangent_ratio_slope(x)])
}

/// J_r: what a change of the displacement moves exp(ρ, u) by, from the right.
pub fn right_jacobian<T: Scalar>(rho: &Vector3<T>, u: &Vector3<T>) -> Matrix6<T> {
    left_jacobian(&-rho, &-u)
}

/// J_r⁻¹, for ‖u‖ < 2π.
pub fn right_jacobian_inverse<T: Scalar>(rho: &Vector3<T>, u: &Vector3<T>) -> Matrix6<T> {
    left_jacobian_inverse(&-rho, &-u)
}

/// 1 + a û + b û² of SE(3), for functions a and b of ‖u‖² and their slopes.
fn polynomial<T: Scalar>(rho: &Vector3<T>, u: &Vector3<T>, [a, b]: [T; 2], slopes: [T; 2]) -> Matrix6<T> {
    let (u_hat, rho_hat) = (hat(u), hat(rho));
    let square = u_hat * u_hat;
    let twice = u.dot(rho) * constant(2.0);
    let diagonal = Matrix3::identity() + u_hat * a + square * b;
    let above = rho_hat * a
        + (rho_hat * u_hat + u_hat * rho_hat) * b
        + (u_hat * slopes[0] + square * slopes[1]) * twice;
    assemble(&diagonal, &above)
}

/// Angular displacements have no linear rate: the lower left block is zero.
fn assemble<T: Scalar>(diagonal: &Matrix3<T>, above: &Matrix3<T>) -> Matrix6<T> {
    let mut matrix = Matrix6::zeros();
    matrix.fixed_view_mut::<3, 3>(0, 0).copy_from(diagonal);
    matrix.fixed_view_mut::<3, 3>(3, 3).copy_from(diagonal);
    matrix.fixed_view_mut::<3, 3>(0, 3).copy_from(above);
    matrix
}
