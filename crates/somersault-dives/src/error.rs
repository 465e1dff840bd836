//! What can be wrong with a dive.

use somersault_core::argument::{ArgumentError, expect_range};
use somersault_core::spline::SplineError;
use somersault_multibody::flight::FlightError;
use somersault_multibody::joint_motion::JointMotionError;
use somersault_multibody::models::PostureError;
use somersault_multibody::{DynamicsError, ModelError};

/// Why there is no such dive.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum DiveError {
    /// The spline or the base of eigenpostures does not exist.
    #[error(transparent)]
    Motion(#[from] JointMotionError),
    /// The diver has a size that none has.
    #[error(transparent)]
    Model(#[from] ModelError),
    /// A posture is unknown or not planar.
    #[error(transparent)]
    Posture(#[from] PostureError),
    /// The flight cannot be computed.
    #[error(transparent)]
    Flight(#[from] FlightError),
    /// Sizes do not fit the diver.
    #[error(transparent)]
    Dynamics(#[from] DynamicsError),
    /// A problem cannot be posed.
    #[error(transparent)]
    Problem(somersault_ocp::OcpError),
    /// A motion has no value.
    #[error("the motion of the dive: {0}")]
    Undefined(String),
    /// The literal form is that of thesis 3.1 alone.
    #[error("the literal form needs a planar dive by weights with fixed lean and duration")]
    NotLiteral,
    /// An argument that is not allowed.
    #[error(transparent)]
    Argument(#[from] ArgumentError),
    /// The joints have but one motion.
    #[error("`windows` and the postures at both ends leave none of the `n_par` coefficients free")]
    NothingFree,
    /// A weight or joint that its window never lets move.
    #[error(
        "`windows` must each leave a coefficient free, found [{lower}, {upper}] at number {channel}, which leaves none"
    )]
    EmptyWindow {
        /// Number of the channel.
        channel: usize,
        /// Where its window begins.
        lower: f64,
        /// Where it ends.
        upper: f64,
    },
    /// The momentum turns the other way than the somersaults.
    #[error(
        "`somersaults` and `momentum` must have one sign, found {turns:.3} turns from lean to entry and [{lower}, {upper}] kg m²/s"
    )]
    Opposed {
        /// Turns from the lean at take-off to the entry.
        turns: f64,
        /// Least momentum.
        lower: f64,
        /// Greatest momentum.
        upper: f64,
    },
    /// A range is empty or not finite.
    #[error("`{argument}` must have finite lower ≤ upper, found [{lower}, {upper}]")]
    Range {
        /// Name of the argument.
        argument: &'static str,
        /// Lower bound.
        lower: f64,
        /// Upper bound.
        upper: f64,
    },
    /// A posture is named that is not among those of the dive.
    #[error("`{argument}` must be among the {n_postures} postures of the dive, found number {found}")]
    NoSuchPosture {
        /// Name of the argument.
        argument: &'static str,
        /// Postures there are.
        n_postures: usize,
        /// Number given.
        found: usize,
    },
    /// A posture is outside of the range of a joint.
    #[error("posture {posture} has {found} rad at `{joint}`, whose range is [{lower}, {upper}]")]
    JointLimit {
        /// Number of the posture.
        posture: usize,
        /// Body that the joint transports.
        joint: String,
        /// Its angle.
        found: f64,
        /// Lower limit.
        lower: f64,
        /// Upper limit.
        upper: f64,
    },
    /// Key frames of a template are not in order.
    #[error(
        "`key_frames` must have at least 2 entries whose fractions rise from 0 to 1, found {found} at number {index}"
    )]
    KeyFrames {
        /// Which one.
        index: usize,
        /// Its fraction.
        found: f64,
    },
}

impl From<somersault_nlp::EvaluationError> for DiveError {
    fn from(error: somersault_nlp::EvaluationError) -> Self {
        Self::Undefined(error.to_string())
    }
}

impl From<SplineError> for DiveError {
    fn from(error: SplineError) -> Self {
        JointMotionError::from(error).into()
    }
}

/// An angle of at most a turn: more was meant in degrees.
pub(crate) fn expect_angle(argument: &'static str, found: f64) -> Result<f64, ArgumentError> {
    expect_range(argument, found, "from −2π to 2π rad", |angle| angle.abs() <= std::f64::consts::TAU)
}
