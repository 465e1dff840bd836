//! The scalar of formulas that are differentiated by their arithmetic.

use nalgebra::RealField;

/// A real number that is copied: `f64`, `f32`, and dual numbers such as those of the crate `num-dual`, which carry
/// derivatives through every formula that is generic over it.
pub trait Scalar: RealField + Copy {}

impl<T: RealField + Copy> Scalar for T {}

/// A constant in the scalar type.
#[inline(always)]
pub fn constant<T: Scalar>(x: f64) -> T {
    nalgebra::convert(x)
}
