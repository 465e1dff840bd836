#![doc = include_str!("../README.md")]
//!
//! # How it works
//!
//! ```math
//! \min\ \Phi\big(x(t_0), x(t_f)\big) + \int_{t_0}^{t_f} L(x, u, t)\, dt \quad\text{subject to}\quad \dot x = f(x, u, t),
//! \quad g(x, u, t) \le 0
//! ```
//! A motion is sought that makes a cost small and keeps to constraints. What is unknown about it, the decision
//! vector z, is a start and the parameters of the joint motion; a [`transcription`] makes nodes of it, a
//! [`term`] makes numbers of a node, a [`problem`] costs and constraints of these, and the result is a nonlinear
//! program ([`somersault_nlp`]) for a solver. Other than by shooting, motions are found by [`collocation`], whose
//! solutions [`arcs`] makes exact and certifies; [`solver`] poses one problem to each of these. A [`swing_up`] is
//! the case study; dives, which have a flight and a search of their own, are a crate above.
#![forbid(unsafe_code)]
#![cfg_attr(
    not(test),
    deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::unreachable, clippy::todo)
)]

pub mod arcs;
pub mod collocation;
pub mod dynamics;
mod error;
pub mod problem;
pub mod shooting;
pub mod solver;
pub mod swing_up;
pub mod term;
pub mod transcription;
pub mod verification;
mod wrong_derivative;

pub use error::{NoSplines, OcpError};
pub use nalgebra;
pub use wrong_derivative::WrongDerivative;
