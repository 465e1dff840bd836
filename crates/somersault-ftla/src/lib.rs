#![doc = include_str!("../README.md")]
//!
//! # How it works
//!
//! The necessary conditions of an optimal control problem are a boundary value problem of a Hamiltonian field in state
//! and costate. Where it has rates that are fast against the horizon, shooting fails; the same rates split the tangent
//! space, and extremals start near the centre-stable and end near the centre-unstable manifold. This crate measures the
//! rates, places points on those manifolds, matches the two ends in the middle and polishes the result to rounding.
//!
//! ```math
//! \mu_i(T, p) = \frac1T \ln \left\| \Phi(T, p)\, l_i \right\|
//! ```
//!
//! | Symbol | Meaning | Here |
//! |---|---|---|
//! | p = (x, λ) | state and costate, 2n numbers | `DVector<f64>`, and `&[f64]` where a field is evaluated |
//! | ṗ = h(p), D = ∂h/∂p | field and Jacobian (8.9), (8.11) | [`system::VectorField`] |
//! | H* | Hamiltonian at the optimal control | [`system::HamiltonianSystem`] |
//! | Φ(T, p) | transition matrix, and its factors | [`flow::VariationalFlow`], [`flow::Chain`] |
//! | μᵢ, lᵢ | finite-time exponents and vectors (9.1)–(9.4) | [`spectrum::Spectrum`] |
//! | E^s, E^cs, E^c, E^cu, E^u | subspaces (9.5)–(9.9) | [`spectrum::Splitting`] |
//! | p⁺, p⁻ | motions from both ends (9.12) | [`matching::Matching`] |
//!
//! In the order of work: [`system`] poses, [`spectrum`] diagnoses, [`placement`] and [`matching`] approximate, [`shooting`]
//! polishes, [`continuation`] follows families from a rest, and [`cold_start`] finds the arm's extremals from nothing.
//! Every search ends within its [`budget::Limits`], with a status.
//!
//! Any other field is analysed as well, one of time too: [`spectrum::LongRun`] has its Lyapunov exponents over a long time, [`ftle`] those
//! of many initial points with their ridges, and [`system::TracedField`] takes a field written in symbols.
//!
//! Source: the thesis, chapters 8–10 and appendices F–H; E. Aykutlug, M. Maggia and K. Mease, *Solving partially
//! hyper-sensitive optimal control problems using manifold structure*, IFAC Proceedings Volumes 46 (2013); K. Mease,
//! U. Topcu, E. Aykutluğ and M. Maggia, *Characterizing two-timescale nonlinear dynamics using finite-time Lyapunov
//! exponents and vectors*, Commun. Nonlinear Sci. Numer. Simul. 36 (2016).
#![forbid(unsafe_code)]
#![cfg_attr(
    not(test),
    deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::unreachable, clippy::todo)
)]

pub mod budget;
pub mod cold_start;
pub mod continuation;
pub mod flow;
pub mod ftle;
pub mod matching;
pub mod placement;
mod product;
pub mod shooting;
pub mod spectrum;
pub mod system;

pub use nalgebra;
