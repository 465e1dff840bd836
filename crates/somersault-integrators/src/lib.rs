//! somersault-integrators
pub mod moser_veselov;
mod preprocessing;
pub use preprocessing::{ModifiedMoments, Preprocessing, StepTooLarge};
