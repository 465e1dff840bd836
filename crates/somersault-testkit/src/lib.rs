//! somersault-testkit
