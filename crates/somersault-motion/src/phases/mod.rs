//! When a body flies: take-off and entry, from heights of its centre of mass or from markers.
//!
//! In the air the height z keeps to a parabola of known curvature, so that y = z + ½ g t² is a line. The flight is sought in two
//! steps:
//!
//! 1. The stretch of frames that maximises
//!
//!    ```text
//!    Σ (3 − r²/s²)
//!    ```
//!    over the residuals r of y to the line nearest to it in that stretch, in O(n²) by cumulative sums. The size s of the residuals is that
//!    of third differences first, and then that which the stretch has.
//! 2. Beyond the take-off t_a the residual is (t_a − t)²₊, that of a force that ends at once, and cubic splines (t_a − kδ − t)³₊, those of
//!    forces that vary within δ = 0.05 s; their factors are normal with the sizes of such forces. With the noise of the flight, white and
//!    correlated ([`MarkerNoise`](crate::reconstruction::MarkerNoise)), estimated by restricted likelihood, all factors are integrated out, and what is left is the
//!    probability of each t_a between frames. Its mean and its 95 % interval are reported. The entry is found likewise. Both are sought
//!    within 0.25 s of the ends of the stretch, and farther where they are probable at the edge of that: slow noise may end a
//!    stretch within a flight.
//!
//! **What is checked** by something that did not find the flight: the curvature that is free within the stretch must be that of gravity, and
//! no longer stretch may keep to a parabola of another curvature: that is what a wrong rate of the frames or a wrong unit of length shows.
//!
//! Take-off and entry are those of the force on the centre of mass: hands in the water that push little are seen late. The mean
//! of markers is not the centre of mass; it leaves the parabola with the limbs, which counts as noise and makes intervals wider.
//!
//! Cost: O(n²) for the n frames of the record, thinned to 120 in a second by means, and some 10⁴ times O(n).
//!
//! Sources: R. Bellman, Comm. ACM 4 (1961) 284, for segments that are found by sums; D. A. Harville, J. Am. Stat. Assoc. 72 (1977)
//! 320, for restricted likelihood; A. F. M. Smith, Biometrika 62 (1975) 407, for the probability of a change point.

mod heights;
mod moment;
mod phase;
mod record;
mod spread;
mod stretch;

pub use heights::mean_heights;
pub use phase::{FlightPhase, PhaseDoubt, PhaseStatus, WithInterval, find_flight, gravity_message};

use crate::recording::RecordingError;
use somersault_core::argument::ArgumentError;

/// Why no flight can be sought.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum PhaseError {
    /// An argument that is not allowed.
    #[error(transparent)]
    Argument(#[from] ArgumentError),
    /// Times, or a part of a recording.
    #[error(transparent)]
    Recording(#[from] RecordingError),
    /// Too few frames have a height.
    #[error("a flight is sought in at least {least} frames that have heights, found {found}")]
    TooFewFrames {
        /// Frames needed.
        least: usize,
        /// Frames there are.
        found: usize,
    },
    /// The search takes too long.
    #[error("a flight is sought in at most {limit} frames, found {found}: take a part of the recording")]
    TooManyFrames {
        /// Frames allowed.
        limit: usize,
        /// Frames there are.
        found: usize,
    },
}
