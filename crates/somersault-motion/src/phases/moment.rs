//! The probability of a take-off or an entry between frames.

use super::record::Record;
use crate::noise::{MarkerNoise, whitening};
use nalgebra::{DMatrix, DVector};
use std::ops::Range;

/// A take-off or an entry.
#[derive(Debug, Clone, Copy)]
pub(super) struct Moment {
    /// s.
    pub(super) mean: f64,
    pub(super) deviation: f64,
    /// Where it lies with 95 %.
    pub(super) bounds: [f64; 2],
    /// Probability that it lies beyond the frames that were used, or in the outermost part of the interval that was searched.
    pub(super) at_edge: f64,
    /// Probability that the record has no frame beyond it.
    pub(super) outside: f64,
}

/// Which end of the flight.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum End {
    TakeOff,
    Entry,
}

/// How far about the end of the stretch the moment is sought, and how closely, s.
pub(super) const REACH: f64 = 0.25;
const STEP: f64 = 0.005;
/// The outermost part of the interval that is searched, s.
const EDGE: f64 = 0.05;
/// Knots of the force beyond the moment, and their distance, s.
const N_KNOTS: usize = 20;
const SPACING: f64 = 0.05;
/// Standard deviations, over gravity, of the acceleration with which a force ends at once, of its change in 0.1 s, whose mean is as large, and
/// of what this changes by from knot to knot.
const JUMP: f64 = 2.0;
const SLOPE: f64 = 3.0;
const CHANGE: f64 = 6.0;
/// Columns: the line, the force, the height.
const N_FORCE: usize = 2 + N_KNOTS;
const N_COLUMNS: usize = 2 + N_FORCE + 1;
const N_LAST: usize = N_COLUMNS - 1;

impl Moment {
    /// From [`REACH`] inside of `near` to `reach` beyond it, by `frames`, of which those inside are in flight.
    pub(super) fn sought(
        record: &Record,
        frames: Range<usize>,
        end: End,
        (near, reach): (f64, f64),
        gravity: f64,
        noise: &MarkerNoise,
    ) -> Option<Self> {
        let times = record.times.get(frames.clone()).filter(|times| !times.is_empty())?;
        let (steps, _) = whitening(noise, times.iter().map(|t| (*t, 1.0)));
        let n = ((REACH + reach) / STEP).round() as usize;
        let start = near - if end == End::TakeOff { reach } else { REACH };
        let grid: Vec<f64> = (0..=n).map(|k| start + STEP * k as f64).collect();
        let mut weights = Vec::with_capacity(grid.len());
        for moment in &grid {
            let mut products = DMatrix::<f64>::zeros(N_COLUMNS, N_COLUMNS);
            let mut means = [0.0; N_COLUMNS];
            for (i, step) in frames.clone().zip(&steps) {
                let mut row = columns(record, i, end, *moment, near, gravity);
                step.whiten(1.0 / noise.size, &mut means, &mut row);
                for (k, x) in row.iter().enumerate() {
                    for (l, y) in row[..=k].iter().enumerate() {
                        products[(k, l)] += x * y;
                    }
                }
            }
            weights.push(log_evidence(products)?);
        }
        let largest = weights.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        weights.iter_mut().for_each(|w| *w = (*w - largest).exp());
        let sum: f64 = weights.iter().sum();
        weights.iter_mut().for_each(|w| *w /= sum);
        let all = || grid.iter().zip(&weights);
        let mean: f64 = all().map(|(t, w)| t * w).sum();
        let deviation = all().map(|(t, w)| (t - mean).powi(2) * w).sum::<f64>().sqrt();
        let beyond = |first: f64, last: f64| {
            let is_beyond = |t: f64| if end == End::TakeOff { t < first } else { t > last };
            all().filter(|(t, _)| is_beyond(**t)).map(|(_, w)| w).sum()
        };
        let outside = beyond(record.times[0], record.times[record.times.len() - 1]);
        let at_edge = beyond(times[0].max(start + EDGE), times[times.len() - 1].min(near + reach - EDGE));
        let at = |fraction: f64| {
            let mut below = 0.0;
            let found = all().find(|(_, w)| {
                below += **w;
                below >= fraction
            });
            found.map_or(near, |(t, _)| *t)
        };
        let bounds = [at(0.025) - 0.5 * STEP, at(0.975) + 0.5 * STEP];
        Some(Self { mean, deviation, bounds, at_edge, outside })
    }
}

/// Line, force and height of a frame.
fn columns(record: &Record, i: usize, end: End, moment: f64, near: f64, gravity: f64) -> [f64; N_COLUMNS] {
    let t = record.times[i] - near;
    let beyond = match end {
        End::TakeOff => moment - record.times[i],
        End::Entry => record.times[i] - moment,
    }
    .max(0.0);
    let slope = SLOPE / 0.6 * gravity * beyond.powi(3);
    std::array::from_fn(|k| match k {
        0 => 1.0,
        1 => t,
        2 => 0.5 * JUMP * gravity * beyond.powi(2),
        3 => slope,
        4..N_LAST => CHANGE / 0.6 * gravity * (beyond - SPACING * (k - 3) as f64).max(0.0).powi(3),
        // ground and water push upwards
        _ => record.heights[i] + 0.5 * gravity * t * t - slope,
    })
}

/// The logarithm of the probability of the heights, factors of the line and of the force integrated out, but for a constant.
fn log_evidence(mut products: DMatrix<f64>) -> Option<f64> {
    products.fill_upper_triangle_with_lower_triangle();
    let n = N_COLUMNS - 1;
    let mut matrix = products.view((0, 0), (n, n)).into_owned();
    for k in 2..n {
        matrix[(k, k)] += 1.0;
    }
    let right = DVector::from_fn(n, |k, _| products[(k, n)]);
    let factor = matrix.cholesky()?;
    let explained = right.dot(&factor.solve(&right));
    let log_determinant: f64 = factor.l_dirty().diagonal().iter().map(|x| 2.0 * x.ln()).sum();
    Some(-0.5 * (products[(n, n)] - explained + log_determinant))
}
