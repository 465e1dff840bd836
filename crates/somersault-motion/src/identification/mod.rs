//! What a flight was: its dive number, and what a coach asks of it, each value with its 95 % interval.
//!
//! | Part of the number | From |
//! |---|---|
//! | half somersaults n | the angle from the vertical, counted on SO(3) in the frame of travel, of the line from feet to hands in the last frame |
//! | half twists | the twist of the whole flight |
//! | direction | the sense of the somersaults; where the diver faces, given, or else taken from the velocity: a diver travels away from the board; armstand where the first frame is upside down |
//! | flying | the body is straight for the first half somersault, and folded later |
//! | position | hip and knee where the hip is closed most: A straight, B pike, C tuck; D free where a twisting dive turns both straight and folded |
//!
//! A count is a whole number n with the probability
//!
//! ```text
//! P(n) ∝ (1 − u) N(x − n π; 0, σ² + s²),   P(between) ∝ u/π
//! ```
//! x the angle with its standard deviation s, σ = 30° how far dives enter from the vertical, 25° for twists, u = 0.05: of 2¼ somersaults, neither neighbour is probable. The
//! probability of a dive number is the product of those of its parts. Where none has 90 % the flight lies between.
//!
//! **What is checked** by something that did not make it: gravity as the recording has it ([`seen_gravity`](crate::reconstruction::ReconstructedFlight::seen_gravity)) must be
//! that of the model. A flight that was not reconstructed has no number.
//!
//! Intervals hold for the given body, as those of the reconstruction do. That of an angle has its changes with orientation and joints displaced by a
//! standard deviation along each principal axis of their covariance in the frame.
//!
//! Sources: World Aquatics, *Diving Rules*, for numbers and positions; M. R. Yeadon, J. Biomech. 23 (1990) 59, for somersault and twist.

mod code;
mod count;
mod position;
mod report;

pub use code::{Direction, Facing, Group};
pub use count::Count;
pub use position::Position;
pub(crate) use position::{Angles, HIP};
pub(crate) use report::line_ahead;
pub use report::{FlightReport, IdentificationStatus, identify_flight};

use somersault_multibody::DynamicsError;

/// Why a flight cannot be identified.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum IdentificationError {
    /// The model has not the bodies of a diver, or a configuration is not the model's.
    #[error(transparent)]
    Model(#[from] DynamicsError),
    /// The flight has no frames.
    #[error("`flight` has no frames")]
    NoFrames,
}
