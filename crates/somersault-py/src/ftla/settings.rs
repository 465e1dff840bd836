//! Accuracy and length of runs.

use super::watched::Watched;
use crate::core::convert::a_type;
use crate::core::error::Error;
use pyo3::prelude::*;
use somersault::ftla::budget::Limits;
use somersault::ftla::flow::{FlowError, FlowTolerances, VariationalFlow};
use std::time::Duration;

/// Steps of a run, unless a user allows another number.
const MAX_STEPS: usize = 100_000;

/// Accuracy and length of runs.
#[derive(Clone, Copy)]
pub(crate) struct Settings {
    pub(crate) tolerances: FlowTolerances,
    pub(crate) max_steps: usize,
}

/// Settings as they are pickled: `rtol`, `atol` and `max_steps`.
pub(crate) type Plain = (f64, f64, usize);

impl Settings {
    /// What is pickled of them.
    pub(crate) fn plain(&self) -> Plain {
        (self.tolerances.relative, self.tolerances.absolute, self.max_steps)
    }

    /// Pickled settings.
    pub(crate) fn of_plain((rtol, atol, max_steps): Plain) -> Result<Self, Error> {
        Ok(Self { tolerances: tolerances_of(rtol, atol)?, max_steps })
    }

    /// Runs of the usual length.
    pub(crate) fn new(tolerances: FlowTolerances) -> Self {
        Self { tolerances, max_steps: MAX_STEPS }
    }

    /// The flow of a system in a run.
    pub(crate) fn flow<'a>(&self, system: &'a Watched) -> Result<VariationalFlow<'a, Watched>, FlowError> {
        Ok(VariationalFlow::try_new(system, self.tolerances)?.with_max_steps(self.max_steps))
    }
}

/// Limits by the names that they have in Python, where they are given.
pub(crate) fn limits_of(
    max_time: Option<&Bound<'_, PyAny>>,
    max_evaluations: Option<&Bound<'_, PyAny>>,
) -> Result<Limits, Error> {
    let time = max_time.map(|value| {
        let wrong = || {
            Error::input(format!("`max_time` must be a positive number of seconds, found {}", shown(value)))
        };
        let seconds: f64 = value.extract().map_err(|_| wrong())?;
        match Duration::try_from_secs_f64(seconds) {
            Ok(time) if !time.is_zero() => Ok(time),
            Ok(_) | Err(_) => Err(wrong()),
        }
    });
    let evaluations = max_evaluations.map(|value| match value.extract::<usize>() {
        Ok(count) if count > 0 => Ok(count),
        Ok(_) | Err(_) => Err(Error::input(format!(
            "`max_evaluations` must be a positive whole number, found {}",
            shown(value)
        ))),
    });
    Ok(Limits { time: time.transpose()?, evaluations: evaluations.transpose()? })
}

/// A value as it is printed, for a message.
fn shown(value: &Bound<'_, PyAny>) -> String {
    value.repr().map_or_else(|_| a_type(value), |text| text.to_string())
}

/// FlowTolerances by the names that they have in Python.
pub(crate) fn tolerances_of(rtol: f64, atol: f64) -> Result<FlowTolerances, Error> {
    if !(1e-15..=0.1).contains(&rtol) {
        return Err(Error::input(format!("`rtol` must be from 1e-15 to 0.1, found {rtol}")));
    }
    if !atol.is_finite() || atol < 0.0 {
        return Err(Error::input(format!("`atol` must be finite and not negative, found {atol}")));
    }
    Ok(FlowTolerances { relative: rtol, absolute: atol })
}
