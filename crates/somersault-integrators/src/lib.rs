//! Integrators for rigid bodies on ℝ³ × SO(3).
#![deny(unsafe_code)]

pub use nalgebra;

pub mod augmented;
pub mod batch;
pub mod body;
pub mod dense;
pub mod driver;
pub mod exact;
pub mod force;
mod inverse3;
pub mod methods;
pub mod moser_veselov;
pub mod preprocessing;
pub mod scratch;
pub mod solution;
pub mod state;
pub mod step_size;
pub mod stepper;
pub mod studies;
pub mod system;
pub mod tableau;
pub mod variation;
pub mod variational_cayley;
