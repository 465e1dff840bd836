//! Why integrations fail.

use crate::fault::Fault;
use crate::stepper::StepError;
use somersault_core::argument::ArgumentError;

/// Why an integration could not start or could not continue.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum IntegrateError {
    /// An argument that is not allowed.
    #[error(transparent)]
    Argument(#[from] ArgumentError),
    /// An interval that is empty, reversed or not finite.
    #[error("`interval` must run forward between finite times, found ({start}, {end})")]
    Interval {
        /// Start given.
        start: f64,
        /// End given.
        end: f64,
    },
    /// More steps than an integration can count, or a step too small to change the time.
    #[error("`dt` = {dt} is too small for the interval ({start}, {end}): times would not advance")]
    TooManySteps {
        /// Step given.
        dt: f64,
        /// Start of the interval.
        start: f64,
        /// End of the interval.
        end: f64,
    },
    /// The initial state is not finite.
    #[error("`state` must be finite, found {found}")]
    InitialState {
        /// Which part was not.
        found: &'static str,
    },
    /// The state stopped being finite: the motion, or the method, is unstable at this step size.
    #[error("the state stopped being finite in the step that ends at t = {t}")]
    NonFinite {
        /// End of the step.
        t: f64,
    },
    /// The method has no error estimate to adapt its step by, nor one by [doubling](crate::doubling).
    #[error(
        "method `{method}` has no error estimate and remembers previous steps, so that its steps are not adapted: give it a fixed step, or take a one-step method"
    )]
    NoErrorEstimate {
        /// The method.
        method: &'static str,
    },
    /// The method needs inertia and torque, which the system does not give.
    #[error("method `{method}` is for rigid bodies only: take one whose scope is any system")]
    RigidBodiesOnly {
        /// The method.
        method: &'static str,
    },
    /// The equations of motion have no value, for what reason says the source.
    #[error("in the step at t = {t}: {source}")]
    Fault {
        /// Start or end of the step, as the method or the driver reports it.
        t: f64,
        /// What was wrong, as the system says.
        source: Fault,
    },
    /// Forces have a state of their own, for which the state of the system has no place.
    #[error("the forces have variables that the state does not hold: {remedy}")]
    Variables {
        /// What to do.
        remedy: &'static str,
    },
    /// A step failed.
    #[error(transparent)]
    Step(#[from] StepError),
    /// The step size control fell below what the time can resolve.
    #[error("the step size fell to {h:e} at t = {t}; the tolerances cannot be met")]
    StepSize {
        /// Time reached.
        t: f64,
        /// Step tried.
        h: f64,
    },
    /// The step budget was spent.
    #[error("`max_steps` = {max_steps} steps were spent at t = {t}")]
    Budget {
        /// Steps allowed.
        max_steps: usize,
        /// Time reached.
        t: f64,
    },
}

impl IntegrateError {
    /// The error of a run backwards, from that of the run of reversed time by which it was made: its times have the other sign.
    pub fn backwards(self) -> Self {
        match self {
            Self::TooManySteps { dt, start, end } => Self::TooManySteps { dt, start: -start, end: -end },
            Self::NonFinite { t } => Self::NonFinite { t: -t },
            Self::Fault { t, source } => Self::Fault { t: -t, source },
            Self::StepSize { t, h } => Self::StepSize { t: -t, h },
            Self::Budget { max_steps, t } => Self::Budget { max_steps, t: -t },
            Self::Step(error) => Self::Step(error.backwards()),
            error @ (Self::Argument(_)
            | Self::Interval { .. }
            | Self::InitialState { .. }
            | Self::NoErrorEstimate { .. }
            | Self::RigidBodiesOnly { .. }
            | Self::Variables { .. }) => error,
        }
    }

    /// Whether a shorter step may help: the equation of an implicit one was not solved, or it is beyond what the method allows.
    pub(crate) fn is_of_the_step(&self) -> bool {
        match self {
            Self::Step(error) => !error.is_refusal(),
            Self::Argument(_)
            | Self::Interval { .. }
            | Self::TooManySteps { .. }
            | Self::InitialState { .. }
            | Self::NonFinite { .. }
            | Self::NoErrorEstimate { .. }
            | Self::RigidBodiesOnly { .. }
            | Self::Fault { .. }
            | Self::Variables { .. }
            | Self::StepSize { .. }
            | Self::Budget { .. } => false,
        }
    }
}
