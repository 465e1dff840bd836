//! Models fitted to markers (thesis 4.2).
//!
//! In each frame scale s, pose of the root and shape of the model are sought that bring its markers nearest to the
//! measured ones y_k:
//!
//! ```text
//! minimise  ½ Σ_k c_k ρ(‖x_k − y_k‖²),    x_k = r + s d_k(q)
//! ```
//! over the markers k that the frame has. r is the origin of the root, d_k the place of the marker from there, in the axes of the
//! world, c_k the marker's weight times that of its point in the recording, and ρ the [`Loss`]. The shape is that of all joints within their limits, or the
//! weights w of eigenpostures with w ≥ 0 and Σ w ≤ 1 ([`Shape`]).
//!
//! Method: Levenberg–Marquardt with the Jacobians of the tree, on the group of each joint; every step minimises the
//! quadratic model exactly over bounds and sum ([`quadratic`]), so that iterates are feasible. A loss other than squares
//! enters by reweighting. A frame starts where the one before ended; the first, from the best of several postures, each
//! laid over the markers. That leads frames into wrong minima, which three things then leave: every eighth frame is
//! begun from these postures too, and so is each whose joints turned by more than a radian since the frame before, or
//! whose cost is more than 4 times the median; in each frame every joint is turned through its range; and what is lower leads its neighbours,
//! on both sides, as long as any gets lower. Nothing proves a minimum of so many angles to be the lowest.
//!
//! A search that converged is not yet a success: every unknown of every frame has a status ([`UnknownStatus`]), and frames whose
//! residual is more than 4 % of the spread of their markers are checked against the mirror image of the model ([`FitStatus::Mirrored`]).
//!
//! Cost: O(markers × degrees of freedom²) an iteration, without allocation.

mod align;
mod estimate;
mod frame;
mod markers;
mod minima;
mod motion;
mod options;
mod problem;
mod protocols;
pub mod quadratic;
mod starts;

pub use estimate::Estimate;
pub(crate) use frame::rms_of_markers;
pub use frame::{FitStatus, FrameFit, UnknownStatus};
pub use markers::{Marker, MarkerSet};
pub use motion::MotionFit;
pub use options::{BodyScale, FitOptions, Loss, Scale, Shape};
pub use problem::MarkerFit;
pub(crate) use problem::Targets;
pub use protocols::MarkerProtocol;

use somersault_core::argument::{ArgumentError, expect_positive, expect_squarable};
use somersault_multibody::{DynamicsError, ModelError};

/// Why a model cannot be fitted.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum FitError {
    /// An argument that is not allowed.
    #[error(transparent)]
    Argument(#[from] ArgumentError),
    /// A body or the size of a configuration is not the model's.
    #[error(transparent)]
    Model(#[from] DynamicsError),
    /// There is no marker to fit.
    #[error("`markers` must have at least one marker, found none")]
    NoMarkers,
    /// One of the markers.
    #[error("marker `{name}`: {source}")]
    Marker {
        /// Its name.
        name: String,
        /// What is wrong with it.
        source: Box<FitError>,
    },
    /// Two markers of one name.
    #[error("a marker named `{name}` was given before")]
    DuplicateMarker {
        /// The name.
        name: String,
    },
    /// The diver on which markers are to be has no model.
    #[error(transparent)]
    Diver(#[from] ModelError),
    /// There is no protocol of that name.
    #[error("`protocol` must be one of {}, found `{name}`", MarkerProtocol::ALL.map(|(_, name)| name).join(", "))]
    UnknownProtocol {
        /// What was given.
        name: String,
    },
    /// An offset is of no marker.
    #[error("`offsets` names no marker `{name}`")]
    NoSuchMarker {
        /// The name.
        name: String,
    },
    /// The recording has none of the model's markers.
    #[error("the recording has none of the markers {expected}; it has {found}")]
    NoCommonMarker {
        /// Names of the model's markers.
        expected: String,
        /// Names in the recording.
        found: String,
    },
    /// The bounds of the scale cross or are not positive.
    #[error("the bounds of the scale must be positive and grow, found {lower} and {upper}")]
    ScaleBounds {
        /// Lower bound.
        lower: f64,
        /// Upper bound.
        upper: f64,
    },
    /// The caller said that it is not to continue.
    #[error("the fit was interrupted")]
    Interrupted,
    /// Eigenpostures are combinations of coordinates; rotations of a ball joint are not coordinates.
    #[error("eigenpostures need joints of one coordinate, but that of `{body}` has {found}")]
    JointOfManyCoordinates {
        /// The body it carries.
        body: String,
        /// Its coordinates.
        found: usize,
    },
}

fn expect_positive_squarable(argument: &'static str, found: f64) -> Result<(), ArgumentError> {
    expect_squarable(argument, [&expect_positive(argument, found)?])
}
