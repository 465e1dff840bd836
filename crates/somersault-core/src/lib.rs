//! somersault-core
