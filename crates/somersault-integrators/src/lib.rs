//! Integrators for rigid bodies on ℝ³ × SO(3).
#![forbid(unsafe_code)]

pub use nalgebra;

pub mod body;
pub mod dense;
pub mod driver;
pub mod force;
pub mod methods;
pub mod scratch;
pub mod solution;
pub mod state;
pub mod stepper;
pub mod system;
pub mod tableau;
