//! The flight behind a recording, by the laws of flight.
//!
//! From take-off to entry the centre of mass keeps to a parabola and the angular momentum L about it is constant. A
//! [`FlightReconstruction`] fits a motion that obeys both exactly to all frames at once:
//!
//! ```text
//! c(t) = c₀ + v₀ t + ½ g t²,   ω = I(q)⁻¹ (Rᵀ L − A(q) q̇),   Ṙ = R ω̂,   x_k = c + s R (p_k(q) − c(q))
//! ```
//! Unknowns are the orientation R at a frame near the middle, L, c₀, v₀, cubic splines of the joints, and, where they are
//! sought, the size s of the body and g. Masses are those of the model and do not change with s: cameras see L/m and I/m only.
//!
//! ```text
//! minimise  Σ r ᵀ C⁻¹ r + Σ_{c,j} (q̈_c(t_j)/a_c)² + ((s − s̄)/σ_s)²
//! ```
//! over the markers' residuals r, C their covariance: white and correlated noise ([`MarkerNoise`]), to which a weight w of a point in the
//! recording adds white noise of the variance (1/w − 1) σ², Huber's loss by reweighting. Second derivatives q̈ at the knots are normal with sizes a_c for each joint, which are estimated by expectation and
//! maximisation; the noise is by restricted maximum likelihood. Taken for white, correlated noise makes intervals that
//! hold the truth in half of all cases.
//!
//! Method: Gauss–Newton with damping, by shooting from the middle over a window that grows by 0.1 s at a time; it begins with the
//! posture that the markers of one frame have ([`MarkerFit`](crate::fit::MarkerFit)). The covariance of all that is reported is that of the inverse of the Hessian of
//! data and prior.
//!
//! Joints are softly bound by the limits that the model states ([`ReconstructedFlight::beyond_limits`]). Where the flight predicts two markers
//! at each other's places, they are exchanged and the search is repeated ([`ReconstructedFlight::exchanges`]).
//!
//! **What is checked** by something that did not make it: the full equations of motion of the tree, joints prescribed, fly from
//! the first frame to the last and must meet every orientation; residuals must be those that fits of single frames leave,
//! which know no law of flight (χ² per degree of freedom); no angular momentum that varies, and no centre of mass that leaves its
//! parabola, no drag, no push and no other places of the markers may fit clearly better ([`Departure`], the score test of C. R. Rao); markers of a
//! planar body must stay in planes; the covariance must be finite. Small errors of the masses, and a drag that noise hides, are *not* seen:
//! intervals hold for the given body in a vacuum.
//!
//! Cost: some 60 times O(m f (n d)²/2) for m markers in f frames, n knots and d degrees of freedom.
//!
//! Sources: M. R. Yeadon, J. Biomech. 23 (1990) 67 and 75, for bodies in flight; G. Wahba, *Spline Models for Observational
//! Data*, SIAM 1990, for splines as priors; D. A. Harville, J. Am. Stat. Assoc. 72 (1977) 320, for restricted likelihood; C. R. Rao,
//! Proc. Camb. Phil. Soc. 44 (1948) 50, for the score test.

mod attitude;
mod check;
mod departure;
mod exchange;
mod flight;
mod joints;
mod normal;
mod options;
mod plane;
mod prior;
mod problem;
mod report;
mod score;
mod search;
mod start;
mod unknowns;

pub use crate::noise::MarkerNoise;
pub(crate) use attitude::read_orientation;
pub use flight::{
    BeyondLimit, Departure, Exchange, FlightFrame, Quantity, ReconstructedFlight, ReconstructionStatus,
};
pub use options::ReconstructionOptions;
pub use problem::FlightReconstruction;
pub(crate) use report::{counting_of, travelling};

use crate::fit::FitError;
use crate::phases::PhaseError;
use crate::recording::RecordingError;
use somersault_core::argument::ArgumentError;
use somersault_core::spline::SplineError;
use somersault_multibody::DynamicsError;
use somersault_multibody::flight::FlightError;

/// Why no flight can be reconstructed.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ReconstructionError {
    /// An argument that is not allowed.
    #[error(transparent)]
    Argument(#[from] ArgumentError),
    /// The markers, or the fit of a frame.
    #[error(transparent)]
    Fit(#[from] FitError),
    /// The model cannot fly.
    #[error(transparent)]
    Flight(#[from] FlightError),
    /// A configuration is not the model's, or a body has no inertia.
    #[error(transparent)]
    Model(#[from] DynamicsError),
    /// There are no such splines.
    #[error(transparent)]
    Spline(#[from] SplineError),
    /// A part of a recording.
    #[error(transparent)]
    Recording(#[from] RecordingError),
    /// Take-off and entry cannot be sought.
    #[error(transparent)]
    Phase(#[from] PhaseError),
    /// Joints are hinges, slides and balls.
    #[error(
        "the joints of a reconstructed flight are revolute, prismatic and spherical, but that of `{body}` is {joint}"
    )]
    Joint {
        /// The body it carries.
        body: String,
        /// Its kind.
        joint: &'static str,
    },
    /// Too few frames show the body.
    #[error("a flight needs at least {least} frames that have markers, found {found}")]
    TooFewFrames {
        /// Frames needed.
        least: usize,
        /// Frames there are.
        found: usize,
    },
    /// The derivatives of so many frames take too much memory.
    #[error("a flight whose joints have so many coefficients may have {limit} frames, found {found}")]
    TooManyFrames {
        /// Frames there are.
        found: usize,
        /// Frames allowed.
        limit: usize,
    },
    /// Splines of so many knots take too much memory.
    #[error(
        "joints may have {limit} coefficients together, found {found}: the knots are too close for this recording"
    )]
    TooManyUnknowns {
        /// Unknowns requested.
        found: usize,
        /// Unknowns allowed.
        limit: usize,
    },
    /// The model has no gravity whose size could be sought.
    #[error("gravity is sought as a multiple of that of the model, which has none")]
    NoGravity,
}
