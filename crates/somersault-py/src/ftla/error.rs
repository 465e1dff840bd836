//! Errors of the analysis as Python exceptions.

use crate::core::error::{Class, Error, inputs};
use numpy::PyArray1;
use pyo3::prelude::*;
use somersault::ftla::flow::FlowError;
use somersault::ftla::matching::MatchingError;
use somersault::ftla::placement::PlacementError;
use somersault::ftla::shooting::ShootingError;
use somersault::ftla::spectrum::SpectrumError;
use somersault::ftla::system::SystemError;

inputs!(MatchingError, PlacementError, SpectrumError);

impl From<SystemError> for Error {
    fn from(error: SystemError) -> Self {
        match error {
            SystemError::Model(error) => error.into(),
            SystemError::Dynamics(error) => error.into(),
            SystemError::Argument(_) | SystemError::NoStateCostate { .. } => Self::own(Class::Input, &error),
            error => Self::own(Class::Evaluation, &error),
        }
    }
}

/// An exception that tells where a motion ended.
fn with_place(class: Class, message: String, t: f64, state: &[f64]) -> Error {
    Python::attach(|py| {
        let error = PyErr::from(Error::Own { class, message });
        let value = error.value(py);
        // An exception that takes no attributes is still the one to raise.
        let _ = value.setattr("t", t).and_then(|()| value.setattr("state", PyArray1::from_slice(py, state)));
        Error::Raised(error)
    })
}

/// What ended a motion, with what the system says of it.
pub(super) fn told(error: &FlowError) -> String {
    match error {
        FlowError::NonFinite { source: Some(why), .. } => format!("{error}: {why}"),
        error => error.to_string(),
    }
}

/// The error of a motion, after words that say which motion it was.
pub(super) fn of_motion(which: &str, error: FlowError) -> Error {
    let message = format!("{which}{}", told(&error));
    match error {
        FlowError::NonFinite { t, state, .. } => with_place(Class::Evaluation, message, t, &state),
        FlowError::StepUnderflow { t, state }
        | FlowError::LeftDomain { t, state }
        | FlowError::TooManySteps { t, state, .. }
        | FlowError::LimitReached { t, state, .. } => with_place(Class::Integration, message, t, &state),
        error => Error::own(Class::Input, &error),
    }
}

impl From<FlowError> for Error {
    fn from(error: FlowError) -> Self {
        of_motion("", error)
    }
}

impl From<ShootingError> for Error {
    fn from(error: ShootingError) -> Self {
        match error {
            ShootingError::Guess { segment, source } => {
                of_motion(&format!("segment {segment} of the guess: "), source)
            }
            error @ ShootingError::NoMotion => Self::own(Class::Evaluation, &error),
            error => Self::own(Class::Input, &error),
        }
    }
}
