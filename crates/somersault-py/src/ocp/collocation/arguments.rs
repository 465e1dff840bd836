//! States, weights and bounds as Python gives them.

use crate::core::convert::{a_type, finite_all, numbers_or_one};
use crate::core::error::Error;
use crate::ocp::arguments::number_or_range;
use pyo3::prelude::*;
use somersault::ocp::collocation::Interval;

/// For each entry a number, a pair of bounds, or nothing.
pub(super) fn ends(argument: &str, n: usize, entries: &Bound<'_, PyAny>) -> Result<Vec<Interval>, Error> {
    let refused = |_| {
        let found = a_type(entries);
        Error::input(format!("`{argument}` must be a sequence of numbers, pairs or None, found {found}"))
    };
    let entry = |entry: PyResult<Bound<'_, PyAny>>| {
        let entry = entry?;
        if entry.is_none() {
            return Ok(Interval::FREE);
        }
        let (lower, upper) = number_or_range(argument, &entry)?;
        Ok::<_, Error>(Interval::new(lower, upper))
    };
    let found = entries.try_iter().map_err(refused)?.map(entry).collect::<Result<Vec<_>, Error>>()?;
    match found.len() {
        found if found != n => {
            Err(Error::input(format!("`{argument}` must have {n} entries, found {found}")))
        }
        _ => Ok(found),
    }
}

/// Rows of a matrix.
pub(super) fn rows_of(values: &[f64], width: usize) -> Vec<Vec<f64>> {
    values.chunks(width.max(1)).map(<[f64]>::to_vec).collect()
}

/// One number for each, finite.
pub(super) fn finite_numbers(
    argument: &str,
    n: usize,
    value: Option<&Bound<'_, PyAny>>,
    default: f64,
) -> Result<Vec<f64>, Error> {
    let Some(value) = value else { return Ok(vec![default; n]) };
    finite_all(argument, numbers_or_one(argument, n, value)?)
}

pub(super) fn weights(
    argument: &str,
    n: usize,
    value: Option<&Bound<'_, PyAny>>,
    default: f64,
) -> Result<Vec<f64>, Error> {
    let numbers = finite_numbers(argument, n, value, default)?;
    match numbers.iter().find(|x| **x < 0.0) {
        Some(found) => Err(Error::input(format!("`{argument}` must not be negative, found {found}"))),
        None => Ok(numbers),
    }
}

pub(super) fn intervals(
    names: [&str; 2],
    n: usize,
    lower: Option<&Bound<'_, PyAny>>,
    upper: Option<&Bound<'_, PyAny>>,
) -> Result<Vec<Interval>, Error> {
    let side = |name, value: Option<&Bound<'_, PyAny>>, default| match value {
        Some(value) => numbers_or_one(name, n, value),
        None => Ok(vec![default; n]),
    };
    let lower = side(names[0], lower, f64::NEG_INFINITY)?;
    let upper = side(names[1], upper, f64::INFINITY)?;
    Ok(lower.into_iter().zip(upper).map(|(lower, upper)| Interval::new(lower, upper)).collect())
}

/// Pairs of bounds.
pub(super) fn pairs(intervals: &[Interval]) -> Vec<(f64, f64)> {
    intervals.iter().map(|interval| (interval.lower, interval.upper)).collect()
}

pub(super) fn intervals_of(pairs: Vec<(f64, f64)>) -> Vec<Interval> {
    pairs.into_iter().map(|(lower, upper)| Interval::new(lower, upper)).collect()
}
