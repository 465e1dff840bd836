//! Recordings as files that [`readers`](crate::readers), and other programs, read.
//!
//! | Format | Here | Of | Numbers |
//! |---|---|---|---|
//! | CSV | [`csv`] | markers | all digits |
//! | TRC | [`trc`] | markers | all digits |
//! | C3D, point data | [`c3d`] | markers | single precision |
//! | BVH | [`bvh`] | skeletons | rotations as angles, to rounding |
//! | GLB (glTF) | [`glb`] | skeletons, markers | single precision |
//! | MOT, STO | [`mot`] | channels | all digits; angles in degrees to rounding |
//! | motions of DeepMimic (JSON) | [`joint_motion`] | skeletons of that format | to rounding |
//!
//! Lengths are written in the unit and the axes of a [`Convention`]; those in m with z up keep all their digits.
//!
//! BVH and motions of DeepMimic have no time of their first frame: who reads them finds it at t = 0, and all
//! times earlier by that of the recording's first frame. CSV and TRC keep times as they are; C3D keeps that of the first frame
//! and a rate.

pub mod bvh;
pub mod c3d;
pub mod csv;
pub mod glb;
pub mod joint_motion;
pub mod mot;
pub mod trc;

use crate::recording::Convention;
use nalgebra::Vector3;

/// Why a recording cannot be written in a format.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum WriteError {
    /// A name that the format cannot hold.
    #[error("`{name}` cannot be a name in this format, allowed are {allowed}")]
    Name {
        /// The name.
        name: String,
        /// What names may be.
        allowed: &'static str,
    },
    /// The format has one time for all frames.
    #[error(
        "frames must be at equal times, but frame {frame} is at {found} s and not at {expected} s; resample them"
    )]
    UnevenTimes {
        /// Frame, from 0.
        frame: usize,
        /// Its time.
        found: f64,
        /// Its time, were they equal.
        expected: f64,
    },
    /// More than the format can count.
    #[error("the format holds {most} {quantity} at most, found {found}")]
    TooMany {
        /// What is counted.
        quantity: &'static str,
        /// Their number.
        found: usize,
        /// The greatest number.
        most: usize,
    },
    /// A number that the format cannot hold in its unit and precision.
    #[error(
        "{quantity} {found} in frame {frame} is outside of the range of the format's numbers in its unit"
    )]
    OutOfRange {
        /// What the number is.
        quantity: &'static str,
        /// The number, m or s.
        found: f64,
        /// Frame, from 0.
        frame: usize,
    },
    /// A line of a list of judged motions has another number of features than the list has names.
    #[error("motion {motion} must have {expected} features, as many as names, found {found}")]
    Features {
        /// Number of the motion, from 0.
        motion: usize,
        /// Number of names.
        expected: usize,
        /// Number of features.
        found: usize,
    },
    /// A score or a feature is NaN or infinite.
    #[error("score and features must be finite, found {found} in motion {motion}")]
    NonFinite {
        /// Number of the motion, from 0.
        motion: usize,
        /// The number.
        found: f64,
    },
    /// A set of judged motions has another number of recordings than of lines.
    #[error("a list of {expected} motions needs as many recordings, found {found}")]
    Recordings {
        /// Number of lines.
        expected: usize,
        /// Number of recordings.
        found: usize,
    },
    /// A skeleton stands still, and the format has nothing to say of it in a frame.
    #[error("at least one joint must turn or move in this format, but none does")]
    NoChannels,
    /// The skeleton is not that of the format.
    #[error("joint {joint} of this format is `{expected}`, found `{found}`")]
    Joint {
        /// Number of the joint.
        joint: usize,
        /// Name of the format's joint.
        expected: &'static str,
        /// Name found; empty where there is none.
        found: String,
    },
    /// A joint turns about another axis than the format's.
    #[error("`{joint}` turns about one axis in this format, but in frame {frame} about another too")]
    Hinge {
        /// The joint.
        joint: &'static str,
        /// Frame, from 0.
        frame: usize,
    },
}

/// A position in the axes and the unit of the file.
fn file_position(
    convention: &Convention,
    quantity: &'static str,
    x: &Vector3<f64>,
    frame: usize,
) -> Result<Vector3<f64>, WriteError> {
    let inside = convention.file_position(x);
    match inside.iter().all(|x| x.is_finite()) {
        true => Ok(inside),
        false => Err(WriteError::OutOfRange { quantity, found: x.amax(), frame }),
    }
}

/// The time of a frame, s; times must be equally far apart to a billionth of the whole. One frame gets 10 ms.
fn time_step(times: &[f64]) -> Result<f64, WriteError> {
    let [first, second, ..] = times else { return Ok(0.01) };
    let (step, whole) = (second - first, times[times.len() - 1] - first);
    if !whole.is_finite() {
        return Err(WriteError::OutOfRange { quantity: "a time", found: *first, frame: 0 });
    }
    let expected = |i: usize| first + i as f64 * step;
    match (0..times.len()).find(|&i| (times[i] - expected(i)).abs() > 1e-9 * whole) {
        Some(frame) => Err(WriteError::UnevenTimes { frame, found: times[frame], expected: expected(frame) }),
        None => Ok(step),
    }
}

/// Names without a control character, blanks around them or one of these characters.
pub(crate) fn expect_name(name: &str, without: &[char], allowed: &'static str) -> Result<(), WriteError> {
    let bad = |c: char| c.is_control() || without.contains(&c);
    if name.is_empty() || name.trim() != name || name.contains(bad) {
        return Err(WriteError::Name { name: name.to_owned(), allowed });
    }
    Ok(())
}
