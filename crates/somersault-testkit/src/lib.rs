//! Reference problems with their solutions, and the estimation of orders, for somersault's own tests.
//!
//! Everything here returns data; what is asserted is the tests' to say. Where a problem of known numbers cannot be made, it panics:
//! only tests call it, and it is not published.
#![deny(unsafe_code)]

pub mod allocations;
pub mod bouncing_ball;
pub mod order;
pub mod planar_box;
pub mod problems;
pub mod spinning_top;
pub mod travels;
pub mod trees;
