//! Where a search starts.

use super::arguments::rows_of;
use super::result::CollocationResult;
use crate::core::convert::{a_type, finite_all, real_numbers, with_shape};
use crate::core::error::Error;
use pyo3::prelude::*;
use pyo3::types::PyTuple;
use somersault::ocp::collocation::{Guess, Interval};

/// `solve` takes its guess as times, states and controls, as states alone over the whole duration, or from an earlier result.
pub(super) fn guess_of(
    [n_states, n_controls]: [usize; 2],
    duration: Interval,
    value: &Bound<'_, PyAny>,
) -> Result<Guess, Error> {
    if let Ok(result) = value.cast::<CollocationResult>() {
        return Ok(result.get().phase().to_guess());
    }
    let at_rest = |n: usize| vec![vec![0.0; n_controls]; n];
    let states = |n: usize, value: &Bound<'_, PyAny>| -> Result<Vec<Vec<f64>>, Error> {
        let states = with_shape("states of the guess", &[n, n_states], value)
            .map_err(|error| error.with_names(&[("states of the guess", "guess")]))?;
        Ok(rows_of(&finite_all("guess", states)?, n_states))
    };
    if let Ok(tuple) = value.cast::<PyTuple>()
        && tuple.iter().any(|item| item.is_none() || item.len().is_ok_and(|n| n != n_states))
    {
        let Ok((t, x, u)) = value.extract::<(Bound<'_, PyAny>, Bound<'_, PyAny>, Bound<'_, PyAny>)>() else {
            return Err(Error::input(format!(
                "`guess` must be (times, states, controls or None) or states of length {n_states}, found a tuple of {}",
                tuple.len()
            )));
        };
        let times = finite_all("guess", real_numbers("guess", &t)?)?;
        let n = times.len();
        let controls = if u.is_none() {
            at_rest(n)
        } else {
            let controls = with_shape("controls of the guess", &[n, n_controls], &u)
                .map_err(|error| error.with_names(&[("controls of the guess", "guess")]))?;
            rows_of(&finite_all("guess", controls)?, n_controls)
        };
        let controls = if n_controls == 0 { at_rest(n) } else { controls };
        return Ok(Guess { states: states(n, &x)?, times, controls, parameters: Vec::new() });
    }
    let refused = |_| {
        let found = a_type(value);
        Error::input(format!(
            "`guess` must be states, (times, states, controls or None) or an earlier result, found {found}"
        ))
    };
    let n = value.len().map_err(refused)?;
    if n < 2 {
        return Err(Error::input(format!("`guess` must have at least 2 rows, found {n}")));
    }
    let end = if duration.upper.is_finite() { duration.upper } else { duration.lower };
    Ok(Guess {
        times: (0..n).map(|k| end * k as f64 / (n.max(2) - 1) as f64).collect(),
        states: states(n, value)?,
        controls: at_rest(n),
        parameters: Vec::new(),
    })
}
