//! Recordings as files that [`readers`](crate::readers), and other programs, read.
//!
//! | Format | Here | Of | Numbers |
//! |---|---|---|---|
//! | CSV | [`csv`] | markers | all digits |
//! | TRC | [`trc`] | markers | all digits |
//! | C3D, point data | [`c3d`] | markers | single precision |
//! | BVH | [`bvh`] | skeletons | rotations as angles, to rounding |
//! | motions of DeepMimic (JSON) | [`joint_motion`] | skeletons of that format | to rounding |
//!
//! Lengths are written in the unit and the axes of a [`Convention`](crate::recording::Convention); those in m
//! with z up keep all their digits.

pub mod bvh;
pub mod c3d;
pub mod csv;
pub mod joint_motion;
pub mod trc;

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

/// The time of a frame, s; times must be equally far apart to a billionth of the whole. One frame gets 10 ms.
fn time_step(times: &[f64]) -> Result<f64, WriteError> {
    let [first, second, ..] = times else { return Ok(0.01) };
    let (step, whole) = (second - first, times[times.len() - 1] - first);
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
