//! The scalar of formulas that are differentiated by their arithmetic, and the arithmetic of those that are computed in lanes.

use core::ops::{Add, AddAssign, Div, Mul, Neg, Sub, SubAssign};
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

/// What the recursions over a tree ask of a number: every [`Scalar`] has it, and so have the numbers of several states in lanes
/// ([`Packed`](crate::lanes::Packed)), which have no order.
///
/// Code over it must be inlined up to its [`Kernel`](crate::lanes::Kernel), by `#[inline(always)]`.
pub trait Arithmetic:
    nalgebra::Scalar
    + Copy
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
    + AddAssign
    + SubAssign
{
    /// The sine and the cosine.
    fn sine_and_cosine(self) -> (Self, Self);

    /// The square root.
    fn square_root(self) -> Self;

    /// Whether the number, in every lane, is greater than `bound` and finite.
    fn exceeds(self, bound: Self) -> bool;
}

impl<T: Scalar> Arithmetic for T {
    #[inline(always)]
    fn sine_and_cosine(self) -> (Self, Self) {
        self.sin_cos()
    }

    #[inline(always)]
    fn square_root(self) -> Self {
        self.sqrt()
    }

    #[inline(always)]
    fn exceeds(self, bound: Self) -> bool {
        self > bound && self.is_finite()
    }
}

/// Arithmetic with constants of the type `C`: those of a model, which are kept once however many states are computed.
pub trait Lift<C>: Arithmetic {
    /// What making a number takes: vector instructions, or nothing.
    type Proof: Copy;

    /// The constant, in every lane.
    fn lift(proof: Self::Proof, constant: C) -> Self;
}

impl<T: Scalar> Lift<T> for T {
    type Proof = ();

    #[inline(always)]
    fn lift((): (), constant: T) -> T {
        constant
    }
}
