//! The event-locating drivers, with steps of fixed or adapted size.
//!
//! Each step is made in a frozen mode, along smooth equations. If a guard changes sign over it, or twice
//! within it, the earliest change is found by stepping again from the same state with a smaller h, until
//! h is known to two roundings of the time: the event lies on the method's own trajectory, so that its
//! time has the method's order and nothing is interpolated. The step to the far side of the change is
//! committed, the mode is read there, the memory restarts, and so does the grid of times or the control of
//! the step size.
//!
//! - The committed end of a step to an event has the guard on its new side. What was found is therefore
//!   not found again, and guards that change together are handled together.
//! - Methods with history make the shorter step with their start-up, as after any restart.
//! - A guard that is outside at both ends of a step is proved to have stayed so, by bounds of how far it may move
//!   in between ([`sweep`](crate::sweep)), or the step is made again to somewhere within and both parts are looked
//!   at. With fixed steps that is a trial; an adapted step ends there. What may be missed is stated:
//!   nothing on planes, on spheres and cylinders and in pairs of spheres but for the method's own error; hits
//!   shallower than [`graze`](crate::event::Location::graze) on rims and surfaces of unknown curvature; and where a
//!   force has no bound (a closure) or a contact is closed, accelerations are estimated, which is no proof.
//! - A guard inside, and a guard of friction, is judged by the cubic through its ends, which is good where steps
//!   resolve the contact; fixed steps are divided until they do.
//! - Surfaces are examined where they are touched first: [`SurfaceFault`](crate::surface::SurfaceFault).
//! - A start on the surface belongs to what follows; a start at rest on it is free until it has moved by a
//!   rounding.
//! - A law whose force and rate of force are continuous at release, and whose gap rate is continuous at
//!   touch-down, as (7.10), cannot slide along the border of a mode. Anything else that does ends in
//!   [`Interruption::Chattering`](crate::event::Interruption::Chattering).
//!
//! Errors keep the solution up to where they arose: a state or a guard that is not finite, a failure of
//! the method, events that follow each other faster than [`Location`](crate::event::Location) allows.

mod adaptive;
mod fixed;
mod run;
mod search;
mod stiff;
mod worker;

use crate::event::{Interrupted, Located};

pub use adaptive::{integrate_hybrid_adaptive, integrate_located_adaptive};
pub use fixed::{integrate_hybrid, integrate_located};

pub(crate) use adaptive::integrate_hybrid_form_adaptive;
pub(crate) use fixed::integrate_hybrid_form;

/// The outcome of a run with events.
pub type LocatedResult<Q> = Result<Located<Q>, Box<Interrupted<Q>>>;
