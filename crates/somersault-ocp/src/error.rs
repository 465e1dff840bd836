//! What can be wrong with a problem.

use somersault_core::argument::{ArgumentError, expect_length, expect_not_negative};
use somersault_multibody::joint_motion::JointMotionError;
use somersault_multibody::{DynamicsError, ModelError};

/// Why a problem cannot be posed.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum OcpError {
    /// The joint motion.
    #[error(transparent)]
    Motion(#[from] JointMotionError),
    /// The model, or what was asked of it.
    #[error(transparent)]
    Dynamics(#[from] DynamicsError),
    /// The description of the model.
    #[error(transparent)]
    Model(#[from] ModelError),
    /// An argument that is not allowed.
    #[error(transparent)]
    Argument(#[from] ArgumentError),
    /// Something has no second derivatives.
    #[error("{what} has no second derivatives, which an exact Hessian needs")]
    NoCurvature {
        /// What has none.
        what: String,
    },
    /// A lower bound lies above its upper one, or a bound is NaN or infinite on the wrong side.
    #[error("entry {index} of `{argument}` has bounds {lower} to {upper}, which nothing can meet")]
    ContradictoryBounds {
        /// Name of the argument.
        argument: String,
        /// The entry.
        index: usize,
        /// Lower bound.
        lower: f64,
        /// Upper bound.
        upper: f64,
    },
    /// The transcription has no variables.
    #[error(
        "the motion has nothing to vary: no entry of `start` is free, and `phases` have no free parameter of a spline and no free duration"
    )]
    NoVariables,
    /// Bounds leave one value to each variable.
    #[error("`variables` must leave something to vary, found all {n_variables} variables fixed")]
    NothingFree {
        /// Variables there are.
        n_variables: usize,
    },
    /// There is no such thing.
    #[error("`{argument}` must be below {limit}, found {found}")]
    OutOfRange {
        /// Name of the argument.
        argument: String,
        /// What is given.
        found: usize,
        /// First number that is too large.
        limit: usize,
    },
    /// There is no memory for so many.
    #[error("`{argument}` may be at most {limit}, for which there are tables of 4 GiB, found {found}")]
    TooLarge {
        /// Name of the argument.
        argument: String,
        /// What is given.
        found: usize,
        /// Largest number allowed.
        limit: usize,
    },
    /// A motion that a start is made of leaves all bounds.
    #[error("the motion that belongs to `{argument}` does not stay finite")]
    Diverges {
        /// Name of the argument.
        argument: String,
    },
    /// An axis has no direction.
    #[error("`{argument}` must not be zero")]
    Zero {
        /// Name of the argument.
        argument: String,
    },
    /// An active joint is no hinge or slider, or only part of a joint is active.
    #[error(
        "joint `{joint}` has {n_active} active of {n_velocities} degrees of freedom: active joints have one"
    )]
    ActiveJoint {
        /// Name of the body that the joint transports.
        joint: String,
        /// Active degrees of freedom.
        n_active: usize,
        /// All of them.
        n_velocities: usize,
    },
}

/// Why a problem has no motion of splines.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum NoSplines {
    /// It has several phases.
    #[error("splines take problems of one phase, found {found} phases")]
    SeveralPhases {
        /// How many.
        found: usize,
    },
    /// Nothing drives it.
    #[error("splines take problems with controls, found none")]
    NoControls,
    /// The start time is free.
    #[error("splines take a start time that is a number, found one that is free")]
    StartTime,
    /// The duration may be zero or has no end.
    #[error("splines take durations from above zero to a finite number, found {lower} to {upper}")]
    EndlessDuration {
        /// Shortest.
        lower: f64,
        /// Longest.
        upper: f64,
    },
    /// An end cost or end constraint depends on a state that is free at the start.
    #[error(
        "splines take end costs and end constraints of the final state, found one of an initial state that is free"
    )]
    FreeStart,
    /// Something has no value at the guess.
    #[error("splines need a value at the guess: {what}")]
    Undefined {
        /// What has none.
        what: String,
    },
    /// The program cannot be made.
    #[error(transparent)]
    Program(#[from] OcpError),
}

pub(crate) fn expect_below(argument: &str, found: usize, limit: usize) -> Result<(), OcpError> {
    if found < limit {
        Ok(())
    } else {
        Err(OcpError::OutOfRange { argument: argument.to_owned(), found, limit })
    }
}

/// Bytes that the tables of a transcription may take.
const MEMORY: usize = 4 << 30;

/// So few that tables with `bytes` for each are not too large.
pub(crate) fn expect_room(argument: &str, found: usize, bytes: usize) -> Result<(), OcpError> {
    let limit = MEMORY / bytes;
    if found <= limit {
        Ok(())
    } else {
        Err(OcpError::TooLarge { argument: argument.to_owned(), found, limit })
    }
}

/// Finite and not below zero, each of them.
pub(crate) fn expect_none_negative(argument: &'static str, values: &[f64]) -> Result<(), ArgumentError> {
    values.iter().try_for_each(|value| expect_not_negative(argument, *value).map(|_| ()))
}

/// Each lower bound at most its upper one, and neither infinite on the side that excludes everything.
pub(crate) fn expect_bounds(argument: &str, bounds: &somersault_nlp::Bounds) -> Result<(), OcpError> {
    expect_length("bounds.upper", bounds.upper.len(), bounds.lower.len())?;
    for (index, (&lower, &upper)) in bounds.lower.iter().zip(&bounds.upper).enumerate() {
        let possible = lower <= upper && lower < f64::INFINITY && upper > f64::NEG_INFINITY;
        if !possible {
            return Err(OcpError::ContradictoryBounds { argument: argument.to_owned(), index, lower, upper });
        }
    }
    Ok(())
}
