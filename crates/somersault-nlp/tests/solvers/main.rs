//! Solvers of nonlinear programs.

mod behaviour;
mod cart_pendulum;
mod dependent;
#[path = "../../src/filter.rs"]
#[expect(dead_code, reason = "a file of the library with tests of what is no public name")]
mod filter;
mod hock_schittkowski;
mod infeasible;
mod interior_point;
mod large;
mod least_squares;
mod multi_start;
/// What the file of the library below reads of it.
mod nlp {
    pub(crate) use somersault_nlp::Pattern;
}
mod problems;
mod random;
mod sensitivity;
mod sqp;
#[path = "../../src/supernodal.rs"]
mod supernodal;
mod unconstrained;
