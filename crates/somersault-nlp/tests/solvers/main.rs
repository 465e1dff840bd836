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
mod problems;
mod random;
mod sensitivity;
mod sqp;
mod unconstrained;
