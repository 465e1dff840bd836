//! Contact of bodies with surfaces and with each other.

pub(crate) mod contacts;
pub(crate) mod laws;
pub(crate) mod sensitivity;
pub(crate) mod surface;
pub(crate) mod system;
