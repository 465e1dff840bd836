//! somersault-integrators
