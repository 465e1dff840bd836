//! The stretch of frames that keeps to a parabola.

use super::record::{LEAST_FRAMES, Record};
use nalgebra::{Matrix2, Vector2};
use std::ops::Range;

/// A stretch and its parabola.
#[derive(Debug, Clone)]
pub(super) struct Stretch {
    pub(super) frames: Range<usize>,
    /// Σ (3 − r²/s²).
    pub(super) score: f64,
    /// Downwards, m/s².
    pub(super) gravity: f64,
    /// Root of the mean of r², m.
    pub(super) rms: f64,
}

/// Squares of residuals, over s², by which a frame counts nothing.
const WORTH: f64 = 3.0;
/// The longest flight, s.
const LONGEST: f64 = 10.0;
/// Height of the arc over its chord, in sizes of residuals, by which a stretch is no rest.
const LEAST_ARC: f64 = 6.0;
/// Rounds in which the size of the residuals is estimated.
const ROUNDS: usize = 6;

/// The stretch of `frames` that maximises the score at the size `s` of residuals, with the curvature `gravity`, or
/// with any that makes an arc.
pub(super) fn best(record: &Record, frames: Range<usize>, gravity: Option<f64>, s: f64) -> Option<Stretch> {
    let curve = gravity.unwrap_or(0.0);
    let mut found: Option<Stretch> = None;
    for i in frames.clone() {
        // powers of the time since the first frame, and their products with y
        let mut sum = [0.0; 8];
        for j in i + 1..=frames.end {
            let (t, z) = (record.times[j - 1] - record.times[i], record.heights[j - 1] - record.heights[i]);
            if t > LONGEST {
                break;
            }
            let (y, u) = (z + 0.5 * curve * t * t, t * t);
            for (sum, x) in sum.iter_mut().zip([t, u, u * t, u * u, y, y * t, y * u, y * y]) {
                *sum += x;
            }
            if j - i < LEAST_FRAMES {
                continue;
            }
            let n = (j - i) as f64;
            let m = sum[0] / n;
            // moments about the mean time
            let tt = sum[1] - m * sum[0];
            let ty = sum[5] - m * sum[4];
            let yy = sum[7] - sum[4] * sum[4] / n;
            let mut squares = yy - ty * ty / tt;
            let mut own = curve;
            if gravity.is_none() {
                // t² beyond its line
                let (q, tq) = (sum[1], sum[2] - m * sum[1]);
                let qq = sum[3] - q * q / n - tq * tq / tt;
                let qy = sum[6] - q * sum[4] / n - tq * ty / tt;
                squares -= qy * qy / qq;
                own = -2.0 * qy / qq;
                if own * t * t / 8.0 < LEAST_ARC * s {
                    continue;
                }
            }
            let score = WORTH * n - squares.max(0.0) / (s * s);
            if found.as_ref().is_none_or(|best| score > best.score) {
                let rms = (squares.max(0.0) / (n - 2.0)).sqrt();
                found = Some(Stretch { frames: i..j, score, gravity: own, rms });
            }
        }
    }
    found
}

/// The same with the size of residuals that the stretch has, which is returned with it.
pub(super) fn settled(record: &Record, gravity: Option<f64>) -> Option<(Stretch, f64)> {
    let white = size_of_differences(record);
    let mut s = 1.5 * white;
    let mut found = best(record, 0..record.times.len(), gravity, s)?;
    for _ in 1..ROUNDS {
        let next = (1.15 * found.rms).clamp(1.2 * white, 1.6 * s);
        if (next / s - 1.0).abs() < 0.05 {
            break;
        }
        s = next;
        found = best(record, 0..record.times.len(), gravity, s)?;
    }
    Some((found, s))
}

/// Standard deviation of white noise, by the middle of the third differences; at least that of rounding.
fn size_of_differences(record: &Record) -> f64 {
    let mut sizes: Vec<f64> =
        record.heights.windows(4).map(|z| (z[3] - 3.0 * z[2] + 3.0 * z[1] - z[0]).abs()).collect();
    sizes.sort_unstable_by(f64::total_cmp);
    // the middle of |x| is 0.6745 standard deviations, and the variance of third differences 20 times that of x
    let size = sizes[sizes.len() / 2] / (0.6745 * 20f64.sqrt());
    let largest = record.heights.iter().fold(0.0_f64, |largest, z| largest.max(z.abs()));
    size.max(1e-9 * largest).max(f64::MIN_POSITIVE.sqrt())
}

/// The curvature of the frames by least squares at their noise, and its standard deviation.
pub(super) fn curvature(weighed: &[[f64; 4]]) -> Option<[f64; 2]> {
    // rows: 1, t, −½ t², z, whitened
    let mut known = Matrix2::zeros();
    let (mut by_third, mut by_z) = (Vector2::zeros(), Vector2::zeros());
    let (mut third, mut product) = (0.0, 0.0);
    for [a, b, c, z] in weighed {
        let base = Vector2::new(*a, *b);
        known += base * base.transpose();
        by_third += base * *c;
        by_z += base * *z;
        third += c * c;
        product += c * z;
    }
    let solved = known.try_inverse()? * by_third;
    let precision = third - by_third.dot(&solved);
    (precision > 0.0).then(|| [(product - solved.dot(&by_z)) / precision, precision.sqrt().recip()])
}
