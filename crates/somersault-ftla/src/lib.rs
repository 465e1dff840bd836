//! Finite-time Lyapunov analysis of hyper-sensitive optimal control.
//!
//! The necessary conditions of an optimal control problem are a boundary value problem of a Hamiltonian field in state
//! and costate. Where it has rates that are fast against the horizon, shooting fails; the same rates split the tangent
//! space, and extremals start near the centre-stable and end near the centre-unstable manifold. This crate measures the
//! rates, places points on those manifolds, matches the two ends in the middle and polishes the result to rounding.
//!
//! | Symbol | Meaning | Here |
//! |---|---|---|
//! | p = (x, λ) | state and costate, N = 2n numbers | `SVector<f64, N>` |
//! | ṗ = h(p), D = ∂h/∂p | field and Jacobian (8.9), (8.11) | [`system::VectorField`] |
//! | H* | Hamiltonian at the optimal control | [`system::HamiltonianSystem`] |
//!
//! Source: the thesis, chapters 8–10 and appendices F–H; M. Maggia and K. D. Mease and their references on finite-time
//! Lyapunov analysis.
#![forbid(unsafe_code)]

pub mod continuation;
pub mod flow;
pub mod placement;
pub mod shooting;
pub mod spectrum;
pub mod system;

pub use nalgebra;
