//! Reference problems for somersault's own tests, derived apart from the code under test.

pub mod bouncing_ball;
pub mod spinning_top;
