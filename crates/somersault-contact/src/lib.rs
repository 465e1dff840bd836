//! Rigid bodies in compliant contact, with events located so that integrators keep their order.
//!
//! A force that switches with the state costs every method its order: a step that straddles the switch
//! is wrong by its whole size (thesis 7.4). Here the equations are frozen in a mode during a step, and
//! the step is cut where a guard says that the mode ends. That works for every method of the table.
//! [`sensitivity`] differentiates such motions.
//!
//! | Symbol | Meaning | Here |
//! |---|---|---|
//! | Δx, Δẋ | gap, negative inside the surface, and its rate; m, m/s | [`Guard`](hybrid::Guard) |
//! | k, c | stiffness, N/m; damping, N s/m | [`CompliantLaw`](laws::compliant::CompliantLaw) |
//! | μ, v | coefficient of friction; sliding velocity, m/s | [`FrictionLaw`](laws::FrictionLaw) |
//! | ωₙ, ζ, e | natural frequency, damping ratio, coefficient of restitution | its constructors |
//!
//! ```
//! use somersault_contact::driver::integrate_located;
//! use somersault_contact::event::Location;
//! use somersault_contact::models::SpinningTop;
//! use somersault_integrators::driver::TimeGrid;
//! use somersault_integrators::methods::{Method, Options};
//!
//! let top = SpinningTop::thesis()?;
//! let grid = TimeGrid::try_new(0.0, 0.1, 1e-4)?;
//! let (method, options, location) = (Method::RkmkB, Options::default(), Location::default());
//! let run = integrate_located(method, options, &top.system, &top.start, &grid, &location, &mut ())?;
//! assert!(run.events[0].t > 0.0 && run.t == 0.1);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! J. Aguilar Mayans, *Numerical Integration and Optimization of Motions for Multibody Dynamic Systems*, UC
//! Irvine 2017, section 7.3.
#![forbid(unsafe_code)]

pub mod bodies;
pub mod contacts;
pub mod driver;
mod error;
pub mod event;
pub mod hybrid;
pub mod laws;
pub mod models;
pub mod sensitivity;
pub mod shape;
mod step_curve;
pub mod stretches;
pub mod studies;
pub mod surface;
pub mod sweep;
mod touch;

pub use error::ContactError;
