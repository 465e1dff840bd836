//! Recordings in one convention: metres, seconds, z up.
//!
//! A [`MarkerRecording`] has the positions of named markers, with gaps; a [`SkeletonRecording`] has the
//! rotations of a tree of joints; a [`KeypointRecording`] has key points in pictures or in space with their weights; a
//! [`ChannelRecording`] has named numbers of any kind. What a file's numbers mean is a [`Convention`], which the caller gives where
//! the format does not say.

mod channels;
mod convention;
mod keypoints;
mod markers;
mod rotations;
mod skeleton;
mod spline;

pub use channels::ChannelRecording;
pub use convention::{Axis, Convention, LengthUnit};
pub use keypoints::KeypointRecording;
pub use markers::MarkerRecording;
pub use rotations::RotationCurve;
pub use skeleton::{Skeleton, SkeletonJoint, SkeletonRecording};
pub use spline::CubicSpline;

use somersault_core::argument::ArgumentError;
use somersault_multibody::ModelError;

/// Why numbers are not a recording, or what was asked of it cannot be done.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum RecordingError {
    /// An argument that is not allowed.
    #[error(transparent)]
    Argument(#[from] ArgumentError),
    /// Nothing was recorded.
    #[error("a recording needs at least one of `{argument}`, found none")]
    Empty {
        /// Frames, markers or joints.
        argument: &'static str,
    },
    /// A number is NaN or infinite.
    #[error("`{argument}` must be finite, but is not in frame {frame}")]
    NonFinite {
        /// Name of the argument.
        argument: &'static str,
        /// Frame, from 0.
        frame: usize,
    },
    /// Times must grow.
    #[error("`times` must grow, but frame {frame} is at {found} s after {before} s")]
    TimesNotGrowing {
        /// Frame, from 0.
        frame: usize,
        /// Its time.
        found: f64,
        /// Time of the frame before.
        before: f64,
    },
    /// Two markers or joints of one name.
    #[error("`{name}` occurs twice among the names")]
    DuplicateName {
        /// The name.
        name: String,
    },
    /// There is no marker or joint of this name.
    #[error("nothing is named `{name}`")]
    UnknownName {
        /// The name.
        name: String,
    },
    /// The parent of a joint does not come before it, or a second joint has none.
    #[error("joint {joint} must have a parent among the joints before it, and only the first has none")]
    Parent {
        /// Number of the joint.
        joint: usize,
    },
    /// Rotations must be unit quaternions.
    #[error("a rotation in frame {frame} has the norm {found}, allowed is 1 to a rounding of 1e-9")]
    NotARotation {
        /// Frame, from 0.
        frame: usize,
        /// Norm found.
        found: f64,
    },
    /// Times requested are outside of the recording.
    #[error("{found} s is not between {first} and {last} s, where there are frames")]
    OutsideOfRecording {
        /// Time requested.
        found: f64,
        /// Time of the first frame.
        first: f64,
        /// Time of the last frame.
        last: f64,
    },
    /// Two axes of a convention lie on one line.
    #[error("`up` and `forward` must be perpendicular, found {up:?} and {forward:?}")]
    ParallelAxes {
        /// The axis that points up.
        up: Axis,
        /// The axis that points forward.
        forward: Axis,
    },
    /// Key points have two or three coordinates.
    #[error("points must have 2 or 3 coordinates, found {found}")]
    Dimensions {
        /// Number found.
        found: usize,
    },
    /// A weight is not allowed.
    #[error("`weights` must be {allowed}, found {found} in frame {frame}")]
    Weight {
        /// Frame, from 0.
        frame: usize,
        /// What it may be.
        allowed: &'static str,
        /// Weight found.
        found: f64,
    },
    /// What was recorded are no positions in space.
    #[error("a recording of markers or of a skeleton is needed, found {found}")]
    NoPositions {
        /// What there is.
        found: &'static str,
    },
    /// The joints make no model.
    #[error(transparent)]
    Model(#[from] ModelError),
}

impl RecordingError {
    /// The frame that is wrong, if it is one, from 0.
    pub(crate) fn frame(&self) -> Option<usize> {
        match self {
            Self::NonFinite { frame, .. }
            | Self::TimesNotGrowing { frame, .. }
            | Self::Weight { frame, .. }
            | Self::NotARotation { frame, .. } => Some(*frame),
            _ => None,
        }
    }
}

/// Fails unless there is a time, all are finite and they grow.
pub(crate) fn expect_times(times: &[f64]) -> Result<(), RecordingError> {
    if times.is_empty() {
        return Err(RecordingError::Empty { argument: "frames" });
    }
    if let Some(frame) = times.iter().position(|t| !t.is_finite()) {
        return Err(RecordingError::NonFinite { argument: "times", frame });
    }
    match times.windows(2).position(|pair| pair[1] <= pair[0]) {
        Some(i) => {
            Err(RecordingError::TimesNotGrowing { frame: i + 1, found: times[i + 1], before: times[i] })
        }
        None => Ok(()),
    }
}

/// Fails unless every time is between those of the first and the last frame.
pub(crate) fn expect_within(times: &[f64], asked: &[f64]) -> Result<(), RecordingError> {
    let (first, last) = (times[0], times[times.len() - 1]);
    match asked.iter().find(|t| !(first..=last).contains(*t)) {
        Some(&found) => Err(RecordingError::OutsideOfRecording { found, first, last }),
        None => Ok(()),
    }
}

/// `n` times at equal distances from the first to the last of `times`; the first alone for n = 1.
pub fn uniform_times(times: &[f64], n: usize) -> Vec<f64> {
    let (Some(&first), Some(&last)) = (times.first(), times.last()) else { return Vec::new() };
    let share = |i: usize| if n > 1 { i as f64 / (n - 1) as f64 } else { 0.0 };
    // weighed, not stepped: the last is met exactly
    (0..n).map(|i| first * (1.0 - share(i)) + last * share(i)).collect()
}

pub(crate) fn expect_unique<'a>(names: impl IntoIterator<Item = &'a str>) -> Result<(), RecordingError> {
    let mut seen = std::collections::HashSet::new();
    match names.into_iter().find(|name| !seen.insert(*name)) {
        Some(name) => Err(RecordingError::DuplicateName { name: name.to_owned() }),
        None => Ok(()),
    }
}
