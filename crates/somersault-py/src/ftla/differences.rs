//! Derivatives that users write, checked against differences of what they are derivatives of.

use super::run::Run;
use crate::core::error::Error;

/// Part of an argument that differences step by.
const STEP: f64 = 1e-5;

/// Part of itself by which an entry may differ from differences: a tenth of what is to be found.
const WRONG: f64 = 2e-4;

/// Rounding of a function in units of its value: functions of many terms lose some digits.
const ROUNDING: f64 = 1e-13;

/// Slopes of a function of `n` arguments with `m` values, row by row: the least and the largest value that they may have.
pub(super) struct Differences {
    least: Vec<f64>,
    largest: Vec<f64>,
}

impl Differences {
    /// At `at`, from slopes to both sides, since the function may have a kink there; none where it has no value.
    ///
    /// What a step to either side of half the length changes is allowed for, and rounding.
    pub(super) fn of(
        at: &[f64],
        m: usize,
        mut function: impl FnMut(&[f64]) -> Option<Vec<f64>>,
    ) -> Option<Self> {
        let n = at.len();
        let size = at.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
        let floor = if size > 0.0 { 1e-2 * size } else { 1.0 };
        let value = function(at)?;
        let mut found = Self { least: vec![0.0; m * n], largest: vec![0.0; m * n] };
        let mut moved = at.to_vec();
        for j in 0..n {
            let full = STEP * at[j].abs().max(floor);
            // to either side: by a whole step and by half of one
            let mut slopes = Vec::with_capacity(4);
            for step in [full, -full, 0.5 * full, -0.5 * full] {
                moved[j] = at[j] + step;
                let there = function(&moved)?;
                let by = moved[j] - at[j];
                slopes.push((0..m).map(|i| (there[i] - value[i]) / by).collect::<Vec<_>>());
            }
            moved[j] = at[j];
            for i in 0..m {
                let [right, left, near_right, near_left] = [0, 1, 2, 3].map(|k: usize| slopes[k][i]);
                let truncation = ((right + left) - (near_right + near_left)).abs();
                let slack = truncation + ROUNDING * value[i].abs() / (0.5 * full);
                found.least[i * n + j] = right.min(left) - slack;
                found.largest[i * n + j] = right.max(left) + slack;
            }
        }
        let finite = found.least.iter().chain(&found.largest).all(|x| x.is_finite());
        finite.then_some(found)
    }
}

/// Ends a run in which a derivative, `written` row by row as a callable gave it, is not that of `function`.
pub(super) fn expect_derivative(
    run: &Run,
    name: &str,
    function: &str,
    written: &[f64],
    differences: Option<&Differences>,
) {
    let Some(Differences { least, largest }) = differences else { return };
    let wrong = written.iter().zip(least.iter().zip(largest)).position(|(d, (least, largest))| {
        let slack = WRONG * d.abs().max(least.abs()).max(largest.abs());
        *d < least - slack || *d > largest + slack
    });
    if let Some(entry) = wrong.filter(|_| !run.is_stopped()) {
        let (found, expected) = (written[entry], 0.5 * (least[entry] + largest[entry]));
        run.stop(
            Error::input(format!(
                "`{name}` must be the derivative of `{function}`: entry {entry}, counted row by row from 0, is {found}, and \
                 differences of `{function}` give {expected}"
            ))
            .into(),
        );
    }
}
