//! Where a search starts.

use super::bounds::PhaseBounds;
use super::error::{CollocationError, expect_length};
use super::function::Sizes;
use super::interval::Interval;

/// States and controls at times, straight lines between them.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Guess {
    /// At least two, increasing; the first and the last are the horizon.
    pub times: Vec<f64>,
    /// x at each time. A quaternion is brought to unit norm and joins the one before it by the shorter turn; zeros in all rows stand
    /// for that between the ends.
    pub states: Vec<Vec<f64>>,
    /// u at each time.
    pub controls: Vec<Vec<f64>>,
    /// p.
    pub parameters: Vec<f64>,
}

/// The value nearest to zero, of finite size.
fn nearest_to_zero(interval: &Interval) -> f64 {
    interval.clamp(0.0)
}

/// Where a state may begin or end: the middle of two finite bounds, else what is nearest to zero.
pub(super) fn middle(interval: &Interval) -> f64 {
    let middle = 0.5 * (interval.lower + interval.upper);
    if middle.is_finite() { middle } else { nearest_to_zero(interval) }
}

impl Guess {
    /// A straight line between the ends, controls nearest to zero. A free end is the other one.
    pub(super) fn straight(bounds: &PhaseBounds, quaternions: &[usize]) -> Self {
        let is_open = |i: &Interval| i.lower == f64::NEG_INFINITY && i.upper == f64::INFINITY;
        let end = |here: &Interval, other: &Interval| middle(if is_open(here) { other } else { here });
        let ends = || bounds.initial_state.iter().zip(&bounds.final_state);
        let start = middle(&bounds.initial_time);
        let finish = middle(&bounds.final_time);
        // a horizon that is open at its end lasts a second
        let finish = if finish > start { finish } else { bounds.final_time.clamp(start + 1.0) };
        let controls: Vec<f64> = bounds.control.iter().map(nearest_to_zero).collect();
        let mut states: Vec<Vec<f64>> =
            vec![ends().map(|(a, b)| end(a, b)).collect(), ends().map(|(a, b)| end(b, a)).collect()];
        // zeros, which are completed later
        for row in &mut states {
            quaternions.iter().for_each(|&first| row[first..first + 4].fill(0.0));
        }
        Self {
            times: vec![start, finish],
            states,
            controls: vec![controls.clone(), controls],
            parameters: bounds.parameters.iter().map(nearest_to_zero).collect(),
        }
    }

    pub(super) fn validate(&self, phase: Option<usize>, sizes: &Sizes) -> Result<(), CollocationError> {
        let n = self.times.len();
        if n < 2 {
            return Err(CollocationError::Length {
                phase,
                argument: "times of the guess",
                expected: 2,
                found: n,
            });
        }
        expect_length(phase, "states of the guess", self.states.len(), n)?;
        expect_length(phase, "controls of the guess", self.controls.len(), n)?;
        expect_length(phase, "parameters of the guess", self.parameters.len(), sizes.parameters)?;
        for (argument, rows, width) in [
            ("a state of the guess", &self.states, sizes.states),
            ("a control of the guess", &self.controls, sizes.controls),
        ] {
            for row in rows {
                expect_length(phase, argument, row.len(), width)?;
            }
        }
        let rows = self.states.iter().chain(&self.controls).chain([&self.times, &self.parameters]);
        if let Some(&found) = rows.flatten().find(|x| !x.is_finite()) {
            return Err(CollocationError::NonFinite { phase, argument: "guess", found });
        }
        match (1..n).find(|&i| self.times[i] <= self.times[i - 1]) {
            Some(entry) => Err(CollocationError::GuessTimes { phase, entry }),
            None => Ok(()),
        }
    }

    /// The horizon.
    pub(crate) fn interval(&self) -> (f64, f64) {
        (self.times[0], self.times[self.times.len() - 1])
    }

    /// x and u where a fraction of the duration has passed.
    pub(crate) fn at_fraction(&self, fraction: f64, state: &mut [f64], control: &mut [f64]) {
        let (start, end) = self.interval();
        let passed = |time: f64| (time - start) / (end - start);
        let i = self.times.partition_point(|&time| passed(time) <= fraction).clamp(1, self.times.len() - 1);
        let (before, after) = (passed(self.times[i - 1]), passed(self.times[i]));
        let fraction = ((fraction - before) / (after - before)).clamp(0.0, 1.0);
        let line = |rows: &[Vec<f64>], out: &mut [f64]| {
            for (j, x) in out.iter_mut().enumerate() {
                *x = rows[i - 1][j] + fraction * (rows[i][j] - rows[i - 1][j]);
            }
        };
        line(&self.states, state);
        line(&self.controls, control);
    }
}
