//! Solvers of nonlinear programs.

mod problems;
mod sqp;
