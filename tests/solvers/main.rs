//! Solvers of nonlinear programs.

mod behaviour;
mod large;
mod multi_start;
mod problems;
mod sqp;
mod unconstrained;
