//! Arguments as Python gives them, refused by their names.

use crate::core::convert::{a_type, integer};
use crate::core::error::Error;
use pyo3::prelude::*;

/// Most entries of anything that is kept in memory: steps, coefficients, starts.
const MOST: i64 = 1_000_000;

/// A sequence of integers, or None.
pub(crate) fn integers_or_none(value: &Bound<'_, PyAny>) -> PyResult<Option<Vec<i64>>> {
    if value.is_none() {
        return Ok(None);
    }
    value.try_iter()?.map(|item| integer(&item?)).collect::<PyResult<Vec<_>>>().map(Some)
}

/// A number of things of which there are at least `least` and no more than memory has room for.
pub(crate) fn count(argument: &str, found: i64, least: i64) -> Result<usize, Error> {
    match usize::try_from(found) {
        Ok(n) if (least..=MOST).contains(&found) => Ok(n),
        _ => Err(Error::input(format!("`{argument}` must be from {least} to {MOST}, found {found}"))),
    }
}

/// A limit, which may be as large as it likes.
pub(crate) fn limit(argument: &str, found: Option<i64>, least: i64) -> Result<Option<usize>, Error> {
    let Some(found) = found else { return Ok(None) };
    match usize::try_from(found) {
        Ok(n) if found >= least => Ok(Some(n)),
        _ => Err(Error::input(format!("`{argument}` must be at least {least}, found {found}"))),
    }
}

/// The number of one of `n` things, or of any where that is not known yet.
pub(crate) fn index(argument: &str, found: i64) -> Result<usize, Error> {
    usize::try_from(found)
        .map_err(|_| Error::input(format!("`{argument}` must not be negative, found {found}")))
}

/// Starts of a search that were given; none is a slip where not all of them are the library's.
pub(crate) fn starts_or_none<'py>(
    starts: Option<Vec<Bound<'py, PyAny>>>,
    n_starts: usize,
) -> Result<Vec<Bound<'py, PyAny>>, Error> {
    match starts {
        Some(starts) if starts.is_empty() => {
            Err(Error::input("`starts` must have at least one row, or be left out, found none".to_owned()))
        }
        None if n_starts == 0 => {
            Err(Error::input("`n_starts` must be positive where no `starts` are given, found 0"))
        }
        starts => Ok(starts.unwrap_or_default()),
    }
}

/// Where a random sequence begins.
pub(crate) fn seed_of(found: i64) -> Result<u64, Error> {
    u64::try_from(found).map_err(|_| Error::input(format!("`seed` must be from 0 to 2⁶³ − 1, found {found}")))
}

/// A tolerance; below rounding it is refused, since no search can end by it.
pub(crate) fn tolerance(argument: &str, found: Option<f64>) -> Result<Option<f64>, Error> {
    match found {
        Some(x) if !(x >= 1e-15 && x.is_finite()) => Err(Error::input(format!(
            "`{argument}` must be finite and at least 1e-15, below which is rounding, found {x}"
        ))),
        found => Ok(found),
    }
}

/// A number, by the name of its argument.
pub(crate) fn number(argument: &str, value: &Bound<'_, PyAny>) -> Result<f64, Error> {
    value
        .extract()
        .map_err(|_| Error::input(format!("`{argument}` must be a number, found {}", a_type(value))))
}

/// A number, or the two ends of a range; finite and in order.
pub(crate) fn number_or_range(argument: &str, value: &Bound<'_, PyAny>) -> Result<(f64, f64), Error> {
    let range = match value.extract::<(f64, f64)>() {
        Ok(range) => range,
        Err(_) => {
            let number: f64 = value.extract().map_err(|_| {
                let found = a_type(value);
                Error::input(format!("`{argument}` must be a number or a pair of numbers, found {found}"))
            })?;
            (number, number)
        }
    };
    Ok(range)
}
