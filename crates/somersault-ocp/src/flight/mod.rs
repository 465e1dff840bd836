//! Flight, reduced by its momentum.
//!
//! In the air nothing of a tree's state is free but its orientation: the centre of mass keeps to its parabola and
//! the angular momentum to its value ([`somersault_multibody::flight`]). So of the passive states one rotation is
//! left to integrate ([`OrientationPath`], and [`FlightShooting`] for whole states), and momentum is exact at every node whatever the step.

mod forces;
mod path;
mod response;
mod step;
mod transcription;

pub(crate) use forces::joints_active;

pub(crate) use path::{COEFFICIENTS, MOMENTUM, NodeExpansion, START};
pub use path::{NodeDerivatives, OrientationPath, PathGradient};
pub use transcription::{FlightShooting, FlightStart, FlightVariables};
