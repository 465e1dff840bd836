//! Smooth motions behind recordings, on the ground and elsewhere.
//!
//! Where a body pushes the ground or another, the laws of flight do not hold ([`reconstruction`](crate::reconstruction) has them), and nothing
//! is known of its motion but that it is smooth. A [`MotionSmoother`] fits one motion to all frames at once, with velocities and accelerations,
//! and says how well each is known:
//!
//! ```text
//! minimise  Σ r ᵀ C⁻¹ r + Σ_c ∫ q⃛_c² dt / S_c + ((s − s̄)/σ_s)²
//! ```
//! over the markers' residuals r with the covariance C of white and correlated noise ([`MarkerNoise`]), Huber's loss by reweighting, and the
//! numbers q_c of the joints: linear ones along fixed axes, angles, and rotations R exp(φ) of ball joints and of the root. Between frames q⃛ is white
//! noise of the density S_c, which for a single number makes the smoothest curve a quintic spline, as in H. J. Woltring's filter. The densities are
//! estimated for each number (D. J. C. MacKay), and so is the noise, by restricted maximum likelihood over up to 160 frames of the
//! middle: what is taken for white makes intervals that are far too short.
//!
//! Method: Gauss–Newton with damping over the states (q, q̇, q̈) of all frames and the correlated errors of their markers, each of which is joined to
//! the next alone, so that a step takes O(N n³) for N frames of n unknowns; it begins with fits of single frames
//! ([`MarkerFit`](crate::fit::MarkerFit)). Covariances are blocks of the inverse of the Hessian of data and prior.
//!
//! **What is checked**: residuals must be those that fits of single frames leave, which do not assume that a motion is smooth (χ² per degree of freedom),
//! over all frames and over each fifth of a second, so that a blow that a smooth curve does not follow is found; the covariance must be finite;
//! joints that no marker sees must not carry a tenth of the body. Errors of the places of markers on their bodies and motion of the skin
//! are *not* seen, nor are exchanged markers put right: [`reconstruction`](crate::reconstruction) does that in flight.
//!
//! Sources: H. J. Woltring, Adv. Eng. Software 8 (1986) 104; G. Wahba, *Spline Models for Observational Data*, SIAM 1990; H. E. Rauch, F. Tung and
//! C. T. Striebel, AIAA J. 3 (1965) 1445; T. D. Barfoot, *State Estimation for Robotics*, Cambridge University Press 2017, chapter 11, for motions on groups;
//! D. J. C. MacKay, Neural Comput. 4 (1992) 415.

mod chain;
mod channels;
mod motion;
mod options;
mod problem;
mod rows;
mod search;

pub use crate::noise::MarkerNoise;
pub use motion::{Deviations, SmoothedFrame, SmoothedMotion, SmoothingStatus};
pub use options::SmoothingOptions;
pub use problem::MotionSmoother;

use crate::fit::FitError;
use crate::recording::RecordingError;
use somersault_core::argument::ArgumentError;
use somersault_multibody::DynamicsError;

/// Why no motion can be smoothed.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SmoothingError {
    /// An argument that is not allowed.
    #[error(transparent)]
    Argument(#[from] ArgumentError),
    /// The markers, or the fit of a frame.
    #[error(transparent)]
    Fit(#[from] FitError),
    /// A configuration is not the model's.
    #[error(transparent)]
    Model(#[from] DynamicsError),
    /// A part of a recording.
    #[error(transparent)]
    Recording(#[from] RecordingError),
    /// Too few frames show the body.
    #[error("a motion needs at least {least} frames that have markers, found {found}")]
    TooFewFrames {
        /// Frames needed.
        least: usize,
        /// Frames there are.
        found: usize,
    },
    /// The covariances of so many frames take too much memory.
    #[error(
        "a motion with so many unknowns in a frame may have {limit} frames, found {found}: smooth it in parts, or give noise that is white"
    )]
    TooManyFrames {
        /// Frames there are.
        found: usize,
        /// Frames allowed.
        limit: usize,
    },
}
