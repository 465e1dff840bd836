//! somersault-integrators
pub mod exact;
