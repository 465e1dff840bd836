//! somersault-integrators
mod inverse3;
pub mod moser_veselov;
mod preprocessing;
pub mod variational_cayley;
pub use preprocessing::{ModifiedMoments, Preprocessing, StepTooLarge};
