//! Arguments that are whole numbers, pairs or lists of them, and limits, read under the names that they have in Python.

use crate::core::convert::a_type;
use crate::core::error::Error;
use pyo3::exceptions::PyOverflowError;
use pyo3::prelude::*;
use somersault::ftla::budget::Limits;
use std::time::Duration;

/// A whole number that is not negative.
fn whole_number(argument: &str, value: &Bound<'_, PyAny>) -> Result<usize, Error> {
    value.extract().map_err(|error: PyErr| {
        let found = if error.is_instance_of::<PyOverflowError>(value.py()) {
            value.to_string()
        } else {
            a_type(value)
        };
        Error::input(format!("`{argument}` must be a whole number that is not negative, found {found}"))
    })
}

fn entries<'py>(argument: &str, value: &Bound<'py, PyAny>) -> Result<Vec<Bound<'py, PyAny>>, Error> {
    crate::core::convert::entries(value)
        .map_err(|_| Error::input(format!("`{argument}` must be a sequence, found {}", a_type(value))))
}

fn whole_numbers(argument: &str, value: &Bound<'_, PyAny>) -> Result<Vec<usize>, Error> {
    entries(argument, value)?.iter().map(|entry| whole_number(argument, entry)).collect()
}

fn three(argument: &str, value: &Bound<'_, PyAny>) -> Result<(usize, usize, usize), Error> {
    match whole_numbers(argument, value)?[..] {
        [stable, center, unstable] => Ok((stable, center, unstable)),
        ref other => Err(Error::input(format!("`{argument}` must have 3 entries, found {}", other.len()))),
    }
}

fn two(argument: &str, value: &Bound<'_, PyAny>) -> Result<[f64; 2], Error> {
    let found = crate::core::convert::with_shape(argument, &[2], value)?;
    Ok([found[0], found[1]])
}

fn two_or_none(argument: &str, value: &Bound<'_, PyAny>) -> Result<Option<[f64; 2]>, Error> {
    if value.is_none() { Ok(None) } else { two(argument, value).map(Some) }
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

/// Functions for `from_py_with`, which receive no name.
macro_rules! named {
    ($($module:ident: $reader:ident -> $type:ty, [$($name:ident),*];)*) => {$(
        pub(super) mod $module {
            $(pub(in crate::ftla) fn $name(
                value: &pyo3::Bound<'_, pyo3::PyAny>,
            ) -> pyo3::PyResult<$type> {
                Ok(super::$reader(stringify!($name), value)?)
            })*
        }
    )*};
}

named! {
    whole: whole_number -> usize, [dimension, n_controls, n_states, max_iterations, max_rounds, max_steps, samples];
    wholes: whole_numbers -> Vec<usize>, [held, passive, conserved];
    triple: three -> (usize, usize, usize), [dims];
    pair: two -> [f64; 2], [masses, lengths, damping, weights];
    pair_or_none: two_or_none -> Option<[f64; 2]>, [torque_limits];
}
