//! Solvers of nonlinear programs.

mod behaviour;
mod cart_pendulum;
mod dependent;
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
