//! Events: systems whose equations change, integrated by any method without the loss of its order.
//!
//! A step that straddles a change of the equations is wrong by its whole size, whatever the method. Here a system has
//! *modes* in each of which its equations are smooth, and *guards* whose signs change where a mode ends ([`Hybrid`]). Each
//! step is made in a [`Frozen`] mode, along smooth equations. If a guard changes sign over it, or twice
//! within it, the earliest change is found by stepping again from the same state with a smaller h, until
//! h is known to two roundings of the time: the event lies on the method's own trajectory, so that its
//! time has the method's order and nothing is interpolated. The step to the far side of the change is
//! committed, the mode is read there, the state jumps if it does, the memory restarts, and so does the grid of times or
//! the control of the step size.
//!
//! - The committed end of a step to an event has the guard on its new side. What was found is therefore
//!   not found again, and guards that change together are handled together.
//! - Methods with history make the shorter step with their start-up, as after any restart.
//! - A guard that is outside at both ends of a step is proved to have stayed so, by bounds of how far it may move
//!   in between ([`Sweep`]), or the step is made again to somewhere within and both parts are looked
//!   at. With fixed steps that is a trial; an adapted step ends there.
//! - A guard that is inside, or has no bounds, is decided by the cubic through its ends, which is good where steps
//!   resolve its motion.
//! - While springs act that fixed steps are too long for, these are divided ([`StiffSteps`]).
//! - A guard that must not go in, say of a surface that has no normal, ends the run where it does
//!   ([`Hybrid::examine`]).
//! - A start where a guard is zero belongs to what follows; a start at rest there is outside until it has moved by a
//!   rounding.
//! - Equations that drive the motion back over the border of a mode from either side have no motion there, and end in
//!   [`Interruption::Chattering`].
//!
//! Errors keep the solution up to where they arose: a state or a guard that is not finite, a failure of
//! the method, events that follow each other faster than [`Location`] allows.
//!
//! A [`Run`](crate::run::Run) locates events on request ([`Run::locating`](crate::run::Run::locating)).
//! [`EventSearch`] is the search by itself, for what steps in another way ([`Retrace`]).
//!
//! Functions of the state that change no equations are watched: a [`Watch`] observes any run, with events or without, and
//! finds their changes of sign by the same search.
//!
//! # A user-defined event
//!
//! A system says which mode a state belongs to, where its guards are, what its equations are in a mode, and what its events
//! are called. All else is provided. Here a mass on a line is driven by a table: 2 N up to 1 m, −1 N beyond.
//!
//! ```
//! use somersault_integrators::driver::TimeGrid;
//! use somersault_integrators::events::{Crossing, Guard, Hybrid, Location};
//! use somersault_integrators::methods::Method;
//! use somersault_integrators::run::Run;
//! use somersault_integrators::state::{Pose, RigidBodyState, Twist};
//! use somersault_integrators::system::{OneForm, System};
//! use std::convert::Infallible;
//!
//! struct Driven {
//!     /// Where the force changes, m, and the forces before and after, N.
//!     ends: Vec<f64>,
//!     forces: Vec<f64>,
//! }
//!
//! impl Driven {
//!     fn guard(&self, row: usize, x: &RigidBodyState) -> Guard {
//!         Guard { gap: x.position().x - self.ends[row], rate: x.velocity().x, lag: 0.0 }
//!     }
//! }
//!
//! impl System for Driven {
//!     type Configuration = Pose;
//!     type Forms = OneForm;
//!     type Workspace = ();
//!     fn workspace(&self) {}
//!     fn acceleration(&self, w: &mut (), t: f64, x: &RigidBodyState, out: &mut Twist) {
//!         self.acceleration_in(&self.mode(t, x), w, t, x, out);
//!     }
//! }
//!
//! impl Hybrid for Driven {
//!     /// The row of the table.
//!     type Mode = usize;
//!     type Kind = Crossing;
//!     type Fault = Infallible;
//!     fn mode(&self, _: f64, x: &RigidBodyState) -> usize {
//!         (0..self.ends.len()).filter(|row| !self.guard(*row, x).is_inside()).count()
//!     }
//!     fn guards(&self, _: &usize, _: f64, x: &RigidBodyState, out: &mut Vec<Guard>) {
//!         out.extend((0..self.ends.len()).map(|row| self.guard(row, x)));
//!     }
//!     fn acceleration_in(&self, row: &usize, _: &mut (), _: f64, _: &RigidBodyState, out: &mut Twist) {
//!         *out = Twist::default();
//!         out.linear.x = self.forces[*row];
//!     }
//!     fn event_kind(&self, _: usize, before: &Guard, _: &Guard, _: (&usize, &usize)) -> Crossing {
//!         Crossing::of(before)
//!     }
//! }
//!
//! let (system, start) = (Driven { ends: vec![1.0], forces: vec![2.0, -1.0] }, RigidBodyState::default());
//! let grid = TimeGrid::try_new(0.0, 8.0, 0.3)?;
//! let run = Run::new(&system, Method::Rk4, grid).locating(Location::default()).from(&start)?;
//! // It passes 1 m after 1 s, turns at 3 m, and is back after 5 s; at 0 m it turns again.
//! let events: Vec<_> = run.events.iter().map(|event| (event.t.round(), event.kind)).collect();
//! assert_eq!(events, [(1.0, Crossing::Leaves), (5.0, Crossing::Enters), (7.0, Crossing::Leaves)]);
//! assert!(run.events.iter().all(|event| (event.t - event.t.round()).abs() < 1e-13));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod adaptive;
mod fixed;
mod guard;
mod hybrid;
mod locating;
mod location;
mod outcome;
mod run;
mod search;
mod step_curve;
mod stiff;
mod sweep;
mod watch;
mod worker;

pub use guard::{Crossing, Guard, GuardChange};
pub use hybrid::{Energy, Frozen, Hybrid, HybridBodies};
pub use location::{Location, StiffSteps};
pub use outcome::{Event, Interrupted, Interruption, Located, LocatedResult};
pub use search::{EventSearch, Retrace, Trail};
pub use step_curve::StepCurve;
pub use sweep::Sweep;
pub use watch::{
    Certificate, Direction, Occurrence, Watch, WatchError, WatchInterrupted, WatchProgress, WatchRule,
    Watched,
};
