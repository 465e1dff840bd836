#![doc = include_str!("../README.md")]
//!
//! # How it works
//!
//! A state has a position, an orientation and their rates, all in the world frame. A rigid body moves by
//!
//! ```math
//! m \ddot x = f, \qquad \dot R = \hat\omega\, R, \qquad \frac{d}{dt} \left( R I R^T \omega \right) = \tau
//! ```
//! and a step of a Lie group method moves the orientation by an exponential, so that it stays a rotation. A
//! [`Run`](run::Run) takes a [`System`](system::System), a [`Method`](methods::Method) and its steps; [`events`] locates where
//! the equations change.
#![forbid(unsafe_code)]
#![cfg_attr(
    not(test),
    deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::unreachable, clippy::todo)
)]

pub use nalgebra;

mod adams;
pub mod augmented;
#[cfg(feature = "rayon")]
pub mod batch;
pub mod body;
mod cancellation;
pub mod counted;
pub mod dense;
pub mod doubling;
pub mod driver;
pub mod engine;
mod error;
pub mod events;
pub mod exact;
mod fault;
pub mod force;
pub mod gyrostat;
mod inverse3;
mod iteration;
mod kick_drift_kick;
mod lu;
pub mod methods;
pub mod moser_veselov;
pub mod orbit;
pub mod partials;
pub mod preprocessing;
pub mod reversal;
pub mod rotors;
pub mod run;
pub mod satellite;
pub mod scratch;
pub mod series;
pub mod solution;
mod splitting;
pub mod state;
pub mod step_size;
pub mod stepper;
pub mod studies;
pub mod system;
pub mod tableau;
mod torque_free;
pub mod variation;
pub mod variational_cayley;
