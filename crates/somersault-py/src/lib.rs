//! somersault-py
