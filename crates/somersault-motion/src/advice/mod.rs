//! What would have been, and what to do: a reconstructed flight is flown again with a change, and advice follows from the changes that bring
//! the entry to the vertical.
//!
//! | Change | What it does |
//! |---|---|
//! | opening | the folded posture is left later or earlier, and all that follows with it |
//! | posture | the folded posture is tighter or looser, by an angle of the joints that are folded |
//! | momentum | the angular momentum is larger or smaller, by a fraction of it |
//! | height | the centre of mass rises higher or less high, and all joints take their time in proportion |
//!
//! The flight is that of [`KnownFlight`](somersault_multibody::flight::KnownFlight): joints as reconstructed, momentum and parabola exact. Beside the
//! difference that is *flown* stands the *linear* one: exact derivatives of the orientation by opening, posture and momentum; central
//! differences by the height and of the line from feet to hands. Where both differ by more than a tenth, as with throws and square-outs of
//! twisting dives, the linear one is not used in words.
//!
//! Advice is for the entry: the line from feet to hands is to be vertical. A dive that is short opens later or holds its posture tighter, one
//! that turns too far opens earlier; both can leave the board with another momentum. Each amount is solved with flown flights, and has a
//! 95 % interval:
//!
//! ```text
//! x = −e/s,   σ_x² = (σ_e/s)² + (x σ_s/s)²
//! ```
//! e is the angle at the entry with its standard deviation, s its change for the unit of x. σ_s follows from flights flown again with the momentum, and
//! with the joints, displaced by a standard deviation along each principal axis of their covariance, and, where a tuck is tighter by hips and knees, with another
//! proportion of both. Advice whose interval spans
//! zero is withheld, as is what covers less than a twentieth within reach; so is all advice where the reconstruction is no success, gravity is another or no number of somersaults is sure.
//!
//! **Within reach**: a posture is left no later than so that the body is straight for a while before the entry ([`Reach`]), is no tighter than the
//! closed pike or the tuck of [`Posture`](somersault_multibody::models::Posture), nor than joints allow. Advice is ranked by the fraction of the error that is
//! within reach; what must be brought from the board comes before what covers less than half.
//!
//! Cost: some 20 flights, and two for each degree of freedom of the joints.

mod correction;
mod held;
mod what_if;

pub use correction::{Advice, AdviceStatus, Correction, FlightAdvice, Reach, advise_flight};
pub use held::FoldedPhase;
pub use what_if::{Outcome, WhatIf, WhatIfFlight};

use crate::identification::IdentificationError;
use somersault_core::argument::ArgumentError;
use somersault_multibody::DynamicsError;
use somersault_multibody::flight::FlightError;

/// Why a flight cannot be flown again.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum AdviceError {
    /// An argument that is not allowed.
    #[error(transparent)]
    Argument(#[from] ArgumentError),
    /// The model has not the bodies of a diver, or a configuration is not the model's.
    #[error(transparent)]
    Model(#[from] DynamicsError),
    /// A change that the flight does not take.
    #[error(transparent)]
    Flight(#[from] FlightError),
    /// The flight cannot be identified.
    #[error(transparent)]
    Identification(#[from] IdentificationError),
    /// Frames between which joints move otherwise than their interpolants.
    #[error(
        "`flight` must have frames that are nearer than {apart:.2} s: the joints between them are not those of the reconstruction, and lead to an \
         entry that is {:.1}° off",
        off.to_degrees()
    )]
    FramesApart {
        /// The longest time between two frames, s.
        apart: f64,
        /// By how much the angle at the entry is off, rad.
        off: f64,
    },
    /// The token was cancelled.
    #[error("the flights were interrupted")]
    Interrupted,
    /// There is no posture to leave or to tighten.
    #[error("`{argument}` changes a folded posture, and the flight holds none for two frames: give `phase`")]
    NotFolded {
        /// The change.
        argument: &'static str,
    },
}
