#![doc = include_str!("../README.md")]
//!
//! # How it works
//!
//! A contact presses with a spring and a damper, and does not pull (thesis 7.10):
//!
//! ```math
//! F = \max(-k\, \Delta x - c\, \Delta \dot x,\ 0) \quad\text{where}\quad \Delta x < 0
//! ```
//! A force that switches with the state costs every method its order: a step that straddles the switch
//! is wrong by its whole size (thesis 7.4). Here the equations are frozen in a mode during a step, and
//! the step is cut where a guard says that the mode ends: [`somersault_integrators::events`]. That works for every method
//! of the table. [`sensitivity`] differentiates such motions, and in [`tree`] the links of articulated bodies touch.
//!
//! | Symbol | Meaning | Here |
//! |---|---|---|
//! | Δx, Δẋ | gap, negative inside the surface, and its rate; m, m/s | [`Guard`](somersault_integrators::events::Guard) |
//! | k, c | stiffness, N/m; damping, N s/m | [`CompliantLaw`](laws::compliant::CompliantLaw) |
//! | μ, v | coefficient of friction; sliding velocity, m/s | [`FrictionLaw`](laws::FrictionLaw) |
//! | ωₙ, ζ, e | natural frequency, damping ratio, coefficient of restitution | its constructors |
//!
//! # What is found
//!
//! - A flight is proved clear of contacts, or searched. What may be missed is stated: nothing on planes, on spheres and
//!   cylinders and in pairs of spheres but for the method's own error; hits shallower than
//!   [`graze`](somersault_integrators::events::Location::graze), in m, on rims and on surfaces without
//!   [`concavity`](surface::Surface::concavity); and where a force has no bound (a closure) or a contact is closed,
//!   accelerations are estimated, which is no proof.
//! - A link of a tree that nothing drives is proved clear by the energy; near a surface, and under torques, by estimates along
//!   the chain of joints ([`tree`]).
//! - A contact that is closed, and friction, is decided by the cubic through the ends of a step, which is good where steps
//!   resolve the contact; fixed steps are divided until they do, but for those of an L-stable method, which passes over what dies
//!   away in them.
//! - Surfaces are examined where they are touched first: [`SurfaceFault`](surface::SurfaceFault).
//! - A law whose force and rate of force are continuous at release, and whose gap rate is continuous at
//!   touch-down, as (7.10), cannot slide along the border of a mode.
//!
//! # Cost
//!
//! A step of the spinning top in contact takes 1.05 to 1.3 times as long as one in flight, whatever the method, but for
//! `imid`: 2.5 times, since its iteration takes five or six evaluations where two do in free fall. Beside the same top
//! without a ground, in the driver without events, it takes 1.3 (`split2`, `split4`, `rkmk8`) to 1.7 times as long by most
//! one-step methods of order 4 and above, and 1.7 to 2.8 times by methods whose steps are about as short as the guards and
//! by `rkmk_b` and `cf4_b`, which without a ground need no orientation within a step (`cargo bench --bench contact`).
//!
//! J. Aguilar Mayans, *Numerical Integration and Optimization of Motions for Multibody Dynamic Systems*, UC
//! Irvine 2017, section 7.3.
#![forbid(unsafe_code)]
#![cfg_attr(
    not(test),
    deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::unreachable, clippy::todo)
)]

pub mod bodies;
mod carrier;
pub mod contacts;
pub mod encounters;
mod error;
pub mod event;
pub mod laws;
mod linearization;
pub mod linearized;
mod load;
pub mod models;
pub mod sensitivity;
pub mod shape;
pub mod stretches;
pub mod studies;
pub mod surface;
mod sweep;
mod touch;
pub mod tree;

pub use error::{ContactError, UntouchableShape};
