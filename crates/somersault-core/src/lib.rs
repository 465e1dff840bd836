#![doc = include_str!("../README.md")]
//!
//! # Symbols
//!
//! | Symbol | Meaning | Here |
//! |---|---|---|
//! | R, q | orientation, body frame → world frame | [`nalgebra::UnitQuaternion`] |
//! | φ, u | rotation vector, an element of so(3) ≅ ℝ³ | [`nalgebra::Vector3`] |
//! | ω | angular velocity, world frame unless named `_body` | [`nalgebra::Vector3`] |
//! | I | inertia about the centre of mass, body frame | [`Inertia`] |
//!
//! Rotation vectors become rotations by Rodrigues' formula, which is a series near φ = 0:
//!
//! ```math
//! \exp \phi = 1 + \frac{\sin |\phi|}{|\phi|}\, \hat\phi + \frac{1 - \cos |\phi|}{|\phi|^2}\, \hat\phi^2
//! ```
#![deny(unsafe_code)]
#![cfg_attr(
    not(test),
    deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::unreachable, clippy::todo)
)]

pub mod argument;
pub mod cancel;
pub mod differences;
pub mod double_double;
pub mod elliptic;
mod inertia;
pub mod interval;
pub mod lane_dual;
#[allow(unsafe_code)]
pub mod lanes;
pub mod lie;
pub mod quadrature;
pub mod random;
pub mod roots;
pub mod scalar;
pub mod spline;

pub use inertia::{Inertia, InertiaError, PrincipalMoments};
pub use scalar::Scalar;
