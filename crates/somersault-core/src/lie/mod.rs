//! The groups of rotations and rigid motions of the plane and of space.
//!
//! | Group | Element | Displacement | Here |
//! |---|---|---|---|
//! | SO(2) | [`UnitComplex`](nalgebra::UnitComplex) | angle | [`so2`] |
//! | SO(3) | [`UnitQuaternion`](nalgebra::UnitQuaternion) | rotation vector u | [`so3`] |
//! | SE(2) | [`Isometry2`](nalgebra::Isometry2) | (ρ, angle) | [`se2`] |
//! | SE(3) | [`Isometry3`](nalgebra::Isometry3) | (ρ, u) | [`se3`] |
//!
//! Displacements have their linear part first. Each group has its exponential and logarithm and, where it does not commute,
//! the Jacobians of the exponential: a displacement changed by δ moves exp by
//!
//! ```text
//! exp(u + δ) = exp(J_l δ) exp(u) = exp(u) exp(J_r δ),   to first order,   J_r(u) = J_l(−u) = Ad(exp(u))⁻¹ J_l(u)
//! ```
//! All of this is generic over the scalar, so that dual numbers go through. Factors such as sin θ/θ are even in the angle; they
//! are functions of θ² without a branch point at 0, and their derivatives exist there. [`short`] is the inverse differential on
//! SO(3) as far as a method of order 4 needs it.
//!
//! Sources: Iserles, Munthe-Kaas, Nørsett and Zanna, *Lie-group methods*, Acta Numerica 9 (2000), appendix B; Murray, Li and
//! Sastry, *A Mathematical Introduction to Robotic Manipulation* (1994), appendix A; Hairer, Lubich and Wanner, *Geometric
//! Numerical Integration* (2006), section III.4.

pub mod attitude;
mod even;
pub mod se2;
pub mod se3;
pub mod short;
pub mod so2;
pub mod so3;

#[cfg(test)]
mod tests;
