//! Solvers of nonlinear programs.

mod large;
mod problems;
mod sqp;
