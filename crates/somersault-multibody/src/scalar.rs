//! The scalar of the kernels.

use nalgebra::RealField;

/// A real number that is copied: `f64`, `f32`, and dual numbers such as those of the crate `num-dual`,
/// which carry derivatives through every kernel of this crate.
pub trait Scalar: RealField + Copy {}

impl<T: RealField + Copy> Scalar for T {}

/// A constant in the scalar type.
#[inline(always)]
pub(crate) fn constant<T: Scalar>(x: f64) -> T {
    nalgebra::convert(x)
}
