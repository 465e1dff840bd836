//! Models scaled to a person: the sizes of segments, and where markers are on them.
//!
//! A model is made for a body of usual proportions, and markers are never quite where a protocol has them. A [`ModelScaler`] finds both from
//! a recording, of a person who stands still, or better moves all joints:
//!
//! ```text
//! minimise  ½ Σ_f Σ_k c_k ρ(‖x_k(q_f, s) + R_k o_k − y_fk‖²)/σ² + ½ (a/σ_a)² + ½ Σ_g (d_g/σ_d)² + ½ Σ_k ‖o_k‖²/σ_o²
//! ```
//! over the configurations q_f of up to 50 frames, the sizes s = exp(a + d_g) of the groups g of bodies and axes ([`ScaleGroup`]), and the offsets o_k
//! of markers in the axes of their bodies. c_k is the weight of a marker, ρ Huber's loss; the size a of the whole, the proportions d_g and the offsets are
//! normal before the markers are looked at. A point p of a body, or a joint that it carries, goes to diag(s) p
//! ([`Model::scaled`](somersault_multibody::Model::scaled)).
//!
//! Method: Gauss–Newton with damping over sizes and offsets, which are all that frames have in common: each frame is brought to its own minimum between steps of
//! these, and its unknowns are eliminated from them (variable projection). A step takes O(F (n³ + n m²)) for F frames of n degrees of freedom and m common
//! unknowns. It begins with fits of single frames of one size ([`MarkerFit`](crate::fit::MarkerFit)). The noise σ is that of the residuals over the coordinates
//! beyond the unknowns. Residuals of frames near each other are alike, for noise is correlated and skin moves with joints: σ² is larger by the sum of
//! their correlations, as if there were so many times fewer frames. Deviations are those of the inverse of the Hessian of data and prior
//! without the configurations, in which points count less whose bodies may be turned further than linearisation follows, as a straight arm about itself.
//!
//! **What is checked**: residuals must not be larger than a twentieth of the spread of the markers, unless the noise is given; frames fitted again to the scaled model must not be nearer to the markers, nor to their mirror image; where a marker is seen, and the size of a
//! group, must not be far from what was taken for possible; a twentieth of the points may be outliers; joints must not be far beyond their limits. [`GroupScale::is_seen`] says of which groups
//! the markers say next to nothing. Between a segment that is longer and a marker that is further out the prior decides, as it
//! does for every method that has markers only. A body whose joints move as those of the model cannot is *not* always seen: legs that spread, of a model
//! whose hips are hinges, make the pelvis wide.
//!
//! Sources: B.-W. Lu, J. J. O'Connor, J. Biomech. 32 (1999) 129, for the fit of a model to all markers; M. Andersen *et al.*, Comput. Methods Biomech. Biomed. Eng. 13
//! (2010) 171, for sizes and places of markers as unknowns; K. Werling *et al.*, PLoS ONE 18 (2023) e0295152, for priors of both; G. Golub, V. Pereyra, SIAM J. Numer. Anal. 10
//! (1973) 413, for variable projection. Scaling keeps masses, as that
//! of OpenSim may: S. L. Delp *et al.*, IEEE Trans. Biomed. Eng. 54 (2007) 1940.

mod groups;
mod options;
mod problem;
mod scaled;
mod search;

pub use groups::ScaleGroup;
pub use options::ScalingOptions;
pub use problem::ModelScaler;
pub use scaled::{GroupScale, MarkerOffset, ScaledModel, ScalingStatus};

use crate::fit::FitError;
use crate::recording::RecordingError;
use somersault_core::argument::ArgumentError;
use somersault_multibody::{DynamicsError, ModelError};

/// Why no model can be scaled.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ScalingError {
    /// An argument that is not allowed.
    #[error(transparent)]
    Argument(#[from] ArgumentError),
    /// The markers, or the fit of a frame.
    #[error(transparent)]
    Fit(#[from] FitError),
    /// A configuration or a body is not the model's.
    #[error(transparent)]
    Dynamics(#[from] DynamicsError),
    /// A model of this size cannot be.
    #[error(transparent)]
    Model(#[from] ModelError),
    /// A part of a recording.
    #[error(transparent)]
    Recording(#[from] RecordingError),
    /// Two groups of one name.
    #[error("a group named `{name}` was given before")]
    DuplicateGroup {
        /// The name.
        name: String,
    },
    /// A group has nothing to scale.
    #[error("group `{name}` must have at least one body, and at least one axis of each")]
    EmptyGroup {
        /// Its name.
        name: String,
    },
    /// An axis of a body is in two groups.
    #[error("the {axis} axis of `{body}` is in the groups `{first}` and `{second}`, but may be in one only")]
    InTwoGroups {
        /// The body.
        body: String,
        /// `x`, `y` or `z`.
        axis: char,
        /// One group.
        first: String,
        /// The other.
        second: String,
    },
    /// Too few frames show the body; one does not tell noise from offsets.
    #[error(
        "a model needs at least {least} frames with markers, found {found}; one is enough where `noise` is given"
    )]
    TooFewFrames {
        /// Frames needed.
        least: usize,
        /// Frames there are.
        found: usize,
    },
    /// So many frames and markers take too much memory.
    #[error(
        "{n_markers} markers in {n_frames} frames take more than 1 GB: take fewer frames by `max_frames`, or fewer markers"
    )]
    TooManyMarkers {
        /// Markers of the model.
        n_markers: usize,
        /// Frames that may be taken.
        n_frames: usize,
    },
}
