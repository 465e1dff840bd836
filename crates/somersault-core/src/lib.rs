//! Shared mathematics of the somersault crates: rotations and rigid motions, inertia, splines, bracketed roots, quadrature,
//! seeded numbers.
//!
//! | Symbol | Meaning | Here |
//! |---|---|---|
//! | R, q | orientation, body frame → world frame | [`nalgebra::UnitQuaternion`] |
//! | φ, u | rotation vector, an element of so(3) ≅ ℝ³ | [`nalgebra::Vector3`] |
//! | ω | angular velocity, world frame unless named `_body` | [`nalgebra::Vector3`] |
//! | I | inertia about the centre of mass, body frame | [`Inertia`] |
//!
//! ```
//! use nalgebra::Vector3;
//! use somersault_core::lie::so3;
//!
//! let quarter_turn = Vector3::new(0.0, 0.0, std::f64::consts::FRAC_PI_2);
//! let q = so3::exp(&quarter_turn);
//! assert!((q * Vector3::x() - Vector3::y()).norm() < 1e-15);
//! assert!((so3::log(&q) - quarter_turn).norm() < 1e-15);
//! ```
#![forbid(unsafe_code)]

pub mod argument;
pub mod cancel;
pub mod double_double;
pub mod elliptic;
mod inertia;
pub mod lie;
pub mod quadrature;
pub mod random;
pub mod roots;
pub mod scalar;
pub mod spline;

pub use inertia::{Inertia, InertiaError};
pub use scalar::Scalar;
