//! The noise of heights in flight, by restricted likelihood on a grid.

use super::record::Record;
use crate::noise::{MarkerNoise, whitening};
use nalgebra::{Matrix2, Vector2};
use std::ops::Range;

/// Fractions of the variance that may be correlated, and over which times, s.
const CORRELATED: [f64; 5] = [0.3, 0.5, 0.7, 0.85, 0.95];
const TIMES: [f64; 4] = [0.05, 0.1, 0.2, 0.4];

/// Least noise, over the largest height: less is lost in the rounding of squares.
const LEAST: f64 = 1e-5;

/// The noise of `frames`, which keep to a parabola of this curvature.
pub(super) fn noise_of(record: &Record, frames: Range<usize>, gravity: f64) -> MarkerNoise {
    let correlated = CORRELATED.iter().flat_map(|share| TIMES.map(|time| (*share, time)));
    let largest = record.heights.iter().fold(f64::MIN_POSITIVE, |largest, z| largest.max(z.abs()));
    let least = LEAST * largest;
    let mut best = (f64::NEG_INFINITY, MarkerNoise::white(least));
    for (share, time) in std::iter::once((0.0, TIMES[1])).chain(correlated) {
        let noise = MarkerNoise { size: 1.0, correlated: share, time };
        let (rows, log) = weighed(record, frames.clone(), &noise);
        let mut known = Matrix2::zeros();
        let (mut by_height, mut squares) = (Vector2::zeros(), 0.0);
        for [a, b, c, z] in &rows {
            let (base, y) = (Vector2::new(*a, *b), z - gravity * c);
            known += base * base.transpose();
            by_height += base * y;
            squares += y * y;
        }
        let Some(solved) = known.try_inverse().map(|inverse| inverse * by_height) else { continue };
        let n = rows.len() as f64 - 2.0;
        let variance = ((squares - by_height.dot(&solved)) / n).max(least * least);
        let likelihood = -0.5 * (n * variance.ln() + log + known.determinant().ln());
        if likelihood > best.0 {
            best = (likelihood, MarkerNoise { size: variance.sqrt(), ..noise });
        }
    }
    best.1
}

/// Rows 1, t, −½ t² and z of `frames`, t from their middle, as innovations over the size of the noise; and the logarithm of the
/// determinant of the correlations.
pub(super) fn weighed(record: &Record, frames: Range<usize>, noise: &MarkerNoise) -> (Vec<[f64; 4]>, f64) {
    let times = &record.times[frames.clone()];
    let middle = 0.5 * (times[0] + times[times.len() - 1]);
    let (steps, log) = whitening(noise, times.iter().map(|t| (*t, 1.0)));
    let mut means = [0.0; 4];
    let rows = frames.zip(&steps).map(|(i, step)| {
        let t = record.times[i] - middle;
        let mut row = [1.0, t, -0.5 * t * t, record.heights[i]];
        step.whiten(1.0 / noise.size, &mut means, &mut row);
        row
    });
    (rows.collect(), log)
}
