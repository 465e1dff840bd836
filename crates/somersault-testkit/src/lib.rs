//! Reference problems of the somersault crates.

pub mod trees;
