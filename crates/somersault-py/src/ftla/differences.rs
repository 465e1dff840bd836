//! Derivatives that users write, checked against differences of what they are derivatives of.

use super::run::Run;
use crate::core::error::Error;
use somersault::core::differences::{Contradiction, Differences, Slopes};

/// Slopes of a function of `n` arguments with `m` values; none where it has no value.
pub(super) fn slopes_of(
    at: &[f64],
    m: usize,
    mut function: impl FnMut(&[f64]) -> Option<Vec<f64>>,
) -> Option<Slopes> {
    let size = at.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
    let sizes = vec![if size > 0.0 { 1e-2 * size } else { 1.0 }; at.len()];
    let mut values = |points: &[f64], values: &mut [f64]| {
        let mut pairs = points.chunks_exact(at.len()).zip(values.chunks_exact_mut(m));
        pairs.try_for_each(|(point, out)| {
            out.copy_from_slice(&function(point).ok_or(())?);
            Ok::<(), ()>(())
        })
    };
    Slopes::try_of(at, &sizes, m, Differences::OF_ROUNDED, &mut values).unwrap_or(None)
}

/// Ends a run in which a derivative, `written` row by row as a callable gave it, is not that of `function`.
pub(super) fn expect_derivative(
    run: &Run,
    name: &str,
    function: &str,
    written: &[f64],
    slopes: Option<&Slopes>,
) {
    // what has no value is told by whoever needs it
    let slopes = slopes.filter(|_| written.iter().all(|d| d.is_finite()));
    let wrong = slopes.and_then(|slopes| Some((slopes.contradicted(written)?, slopes.n_columns())));
    let Some((Contradiction { row, column, found, expected }, n)) = wrong.filter(|_| !run.is_stopped())
    else {
        return;
    };
    let entry = row * n + column;
    run.stop(
        Error::input(format!(
            "`{name}` must be the derivative of `{function}`: entry {entry}, counted row by row from 0, is {found}, and \
             differences of `{function}` give {expected}"
        ))
        .into(),
    );
}
