//! Motions described: principal components, projection on a base, groups side by side.
//!
//! A motion is a matrix with a row for each frame. [`Pca`] finds the directions in which rows differ most; of
//! the postures of motions these are eigenpostures, their scores eigenweights ([`eigenpostures`]). [`project`]
//! goes the other way: from a chosen base to the weights that describe a motion best (thesis 4.2). [`Band`] is
//! what a group of motions has in common at each frame (Figure 4.1); [`DiveFaults`] what a dive is marked down
//! for.

pub mod eigenpostures;
mod faults;
mod groups;
mod landmarks;
mod pca;
mod projection;

pub use faults::DiveFaults;
pub use groups::{Band, GroupComparison, Panel, normalize_frames, somersaults};
pub(crate) use landmarks::Landmarks;
pub use pca::Pca;
pub use projection::{Projection, WeightBounds, project};

use crate::recording::RecordingError;
use somersault_core::argument::{ArgumentError, LARGEST};

/// Why numbers cannot be analysed.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum AnalysisError {
    /// An argument that is not allowed.
    #[error(transparent)]
    Argument(#[from] ArgumentError),
    /// More components than the samples can have.
    #[error(
        "`{argument}` must be between 1 and {most} for {samples} samples of {features} numbers, found {found}"
    )]
    Components {
        /// Name of the argument.
        argument: &'static str,
        /// Components requested.
        found: usize,
        /// Components there can be: one less than samples, and no more than numbers in a sample.
        most: usize,
        /// Samples.
        samples: usize,
        /// Numbers in a sample.
        features: usize,
    },
    /// A number is NaN or infinite.
    #[error("`{argument}` must be finite, but is not in row {row}")]
    NonFinite {
        /// Name of the argument.
        argument: &'static str,
        /// Row, from 0.
        row: usize,
    },
    /// A fault of a dive is NaN or infinite.
    #[error("`{fault}` must be finite, found {found}")]
    Fault {
        /// Name of the fault.
        fault: &'static str,
        /// Its value.
        found: f64,
    },
    /// A number is so large that its square overflows.
    #[error("`{argument}` must be within ±1e100, found {found:e} in row {row}")]
    TooLarge {
        /// Name of the argument.
        argument: &'static str,
        /// Row, from 0.
        row: usize,
        /// The number.
        found: f64,
    },
    /// A motion without markers in any frame has nothing to compare.
    #[error("`groups` must have markers in every motion, but motion {motion} of group {group} has none")]
    NothingSeen {
        /// Group, from 0.
        group: usize,
        /// Motion of the group, from 0.
        motion: usize,
    },
    /// Parts that are no principal components.
    #[error("`{argument}` must be {allowed}")]
    Parts {
        /// Name of the part.
        argument: &'static str,
        /// What it may be.
        allowed: &'static str,
    },
    /// The quaternion of a root is not of unit length.
    #[error(
        "`q` must have a unit quaternion for its root in every row, but in row {row} its norm is {found}"
    )]
    NotARotation {
        /// Row, from 0.
        row: usize,
        /// Norm found.
        found: f64,
    },
    /// Times or values through which there is no curve.
    #[error(transparent)]
    Recording(#[from] RecordingError),
    /// All samples are the same: there is no direction in which they differ.
    #[error("the samples do not differ")]
    NoVariance,
    /// The decomposition did not converge.
    #[error("the singular value decomposition did not converge")]
    NoConvergence,
    /// The root neither floats nor moves in a plane.
    #[error("the root of the model must have a free or a planar joint to turn")]
    Held,
    /// The model lacks a body, or a configuration is not the model's.
    #[error(transparent)]
    Model(#[from] somersault_multibody::DynamicsError),
}

/// Fails unless every number is finite, and its square too.
pub(crate) fn expect_finite(
    argument: &'static str,
    rows: &nalgebra::DMatrix<f64>,
) -> Result<(), AnalysisError> {
    let row = |k: usize| k % rows.nrows();
    if let Some(k) = rows.iter().position(|x| !x.is_finite()) {
        return Err(AnalysisError::NonFinite { argument, row: row(k) });
    }
    match rows.iter().position(|x| x.abs() > LARGEST) {
        Some(k) => Err(AnalysisError::TooLarge { argument, row: row(k), found: rows[k] }),
        None => Ok(()),
    }
}
