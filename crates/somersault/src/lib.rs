//! somersault
