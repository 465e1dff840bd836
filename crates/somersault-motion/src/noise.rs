//! The noise of markers: white, and correlated in time.
//!
//! Each coordinate of a marker of weight c errs by σ/√c times n, where n has the variance 1, of which a fraction κ is correlated over
//! the time τ:
//!
//! ```text
//! E[n(t) n(t′)] = κ exp(−|t − t′|/τ) + (1 − κ) δ(t, t′)
//! ```
//! Coordinates and markers are independent. What a filter of R. E. Kalman predicts of a coordinate from the frames before leaves
//! innovations that are white: for each frame that has the marker, whatever gaps there are,
//!
//! ```text
//! ν = (x − m)/√S,  S = P + w,  m ← e^{−Δ/τ} (m + P (x − m)/S),  P ← e^{−2Δ/τ} P (1 − P/S) + κ (1 − e^{−2Δ/τ})
//! ```
//! with w = 1 − κ, and more where a robust loss trusts a point less.
//!
//! Source: A. C. Harvey, *Forecasting, Structural Time Series Models and the Kalman Filter*, Cambridge University Press 1989,
//! chapter 3.

use rand::{Rng, RngExt};
use serde::{Deserialize, Serialize};
use somersault_core::argument::{ArgumentError, expect_positive, expect_range};

/// The standard deviation of a variance, which rounding may leave below zero. NaN, of one that is not known, stays NaN.
pub(crate) fn standard_deviation(variance: f64) -> f64 {
    if variance < 0.0 { 0.0 } else { variance.sqrt() }
}

/// The noise of markers.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct MarkerNoise {
    /// Standard deviation σ of each coordinate of a marker of weight 1, m.
    pub size: f64,
    /// Fraction κ of the variance that is correlated in time, from 0 to 1.
    pub correlated: f64,
    /// Time τ over which it is, s.
    pub time: f64,
}

impl MarkerNoise {
    /// White noise.
    pub fn white(size: f64) -> Self {
        Self { size, correlated: 0.0, time: 0.1 }
    }

    /// The weight of a point of a marker by that in the recording and by Huber's loss: less where it is farther off than `threshold` standard
    /// deviations.
    pub(crate) fn trust(&self, weight: f64, recorded: f64, distance: f64, threshold: f64) -> f64 {
        let size = self.size / (weight * recorded).sqrt();
        recorded * (threshold / (distance / size)).min(1.0)
    }

    pub(crate) fn validate(&self) -> Result<(), ArgumentError> {
        expect_range("size of the noise", self.size, "between 1e-9 and 1e3 m", |x| {
            (1e-9..=1e3).contains(&x)
        })?;
        expect_range("correlated fraction of the noise", self.correlated, "from 0 to 1", |x| {
            (0.0..=1.0).contains(&x)
        })?;
        expect_positive("time of the noise", self.time)?;
        Ok(())
    }
}

/// What makes a coordinate's error white at one frame.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Whitening {
    /// What the prediction decays by since the frame before.
    pub(crate) decay: f64,
    /// What the innovation moves the prediction by.
    pub(crate) gain: f64,
    /// 1/√S.
    pub(crate) factor: f64,
}

impl Whitening {
    /// Replaces derivatives of a residual, at √c/σ = `weight`, by those of its innovation, and moves their predictions on.
    pub(crate) fn whiten(&self, weight: f64, means: &mut [f64], row: &mut [f64]) {
        let factor = self.factor * weight;
        if self.gain == 0.0 {
            row.iter_mut().for_each(|x| *x *= factor);
            return;
        }
        for (x, mean) in row.iter_mut().zip(means) {
            let predicted = *mean * self.decay;
            let innovation = *x - predicted;
            *x = innovation * factor;
            *mean = predicted + self.gain * innovation;
        }
    }
}

/// The value per degree of freedom that χ² with `n` of them exceeds as often as a normal number exceeds `z` standard deviations, by
/// E. B. Wilson and M. M. Hilferty.
pub(crate) fn chi_squared_quantile(n: usize, z: f64) -> f64 {
    let spread = 2.0 / (9.0 * n as f64);
    (1.0 - spread + z * spread.sqrt()).powi(3)
}

/// A number from the standard normal distribution, after G. E. P. Box and M. E. Muller, Ann. Math. Statist. 29
/// (1958), 610.
pub(crate) fn standard_normal(rng: &mut impl Rng) -> f64 {
    // 1 − u is never zero
    let (u, turn): (f64, f64) = (rng.random(), rng.random());
    (-2.0 * (1.0 - u).ln()).sqrt() * (std::f64::consts::TAU * turn).cos()
}

/// The noise of a recording with frames at `times` that has the least −2 ln of the evidence, which is given with the size at which it is
/// least: by a search over the fraction that is correlated and its time, from `from`.
pub(crate) fn most_likely<E>(
    from: MarkerNoise,
    times: &[f64],
    evidence: &mut dyn FnMut(MarkerNoise) -> Result<(f64, f64), E>,
) -> Result<MarkerNoise, E> {
    let duration = times[times.len() - 1] - times[0];
    let (spacing, longest) = (duration / (times.len() - 1) as f64, duration / 3.0);
    let of = |[share, time]: [f64; 2], size: f64| MarkerNoise {
        size,
        correlated: 1.0 / (1.0 + (-share).exp()),
        time: time.exp().clamp(spacing, longest.max(spacing)),
    };
    let begun = if from.correlated > 0.0 { from } else { MarkerNoise { correlated: 0.5, time: 0.1, ..from } };
    let share = begun.correlated.clamp(0.01, 0.99);
    let mut best = [(share / (1.0 - share)).ln(), begun.time.ln()];
    let mut found = evidence(of(best, from.size))?;
    let mut step = if from.correlated > 0.0 { [0.5, 0.35] } else { [1.5, 0.8] };
    while step[0] > 0.3 {
        let mut moved = false;
        for k in 0..2 {
            for sign in [1.0, -1.0] {
                let mut trial = best;
                trial[k] += sign * step[k];
                if trial[0].abs() > 6.0 || (trial[1] < spacing.ln() - 0.1 || trial[1] > longest.ln()) {
                    continue;
                }
                let of_trial = evidence(of(trial, found.1))?;
                if of_trial.0 < found.0 {
                    (best, found, moved) = (trial, of_trial, true);
                    break;
                }
            }
        }
        if !moved {
            step = step.map(|x| 0.5 * x);
        }
    }
    Ok(of(best, found.1))
}

/// The least of `value`, a function of the logarithm of the size, near `size`, and where it is: at the vertex of a parabola through
/// three values.
pub(crate) fn most_likely_size(size: f64, mut value: impl FnMut(f64) -> f64) -> (f64, f64) {
    let middle = size.ln();
    let [a, b, c] = [value(middle - WIDTH), value(middle), value(middle + WIDTH)];
    let bend = a - 2.0 * b + c;
    if bend <= 0.0 || !bend.is_finite() {
        return (b, size);
    }
    let shift = (0.5 * (a - c) / bend).clamp(-2.0, 2.0);
    let least = b - shift * 0.5 * (a - c) + 0.5 * shift * shift * bend;
    (least, (middle + shift * WIDTH).exp())
}

/// Distance of the logarithms of sizes of the noise between which a parabola is laid.
const WIDTH: f64 = 0.15;
/// The least fraction of the variance that is white: frames never repeat each other.
pub(crate) const LEAST_WHITE: f64 = 1e-3;

/// The filter of a marker over the times of the frames that have it, and Σ ln S; `trust` is 1, or less for points that count less.
pub(crate) fn whitening(
    noise: &MarkerNoise,
    frames: impl Iterator<Item = (f64, f64)>,
) -> (Vec<Whitening>, f64) {
    let share = noise.correlated.min(1.0 - LEAST_WHITE);
    let (mut before, mut variance, mut log) = (None, share, 0.0);
    let steps = frames.map(|(t, trust)| {
        let decay = before.map_or(0.0, |before: f64| (-(t - before) / noise.time).exp());
        variance = decay * decay * variance + share * (1.0 - decay * decay);
        before = Some(t);
        let total = variance + 1.0 - share + (1.0 / trust - 1.0);
        let gain = variance / total;
        variance *= 1.0 - gain;
        log += total.ln();
        Whitening { decay, gain, factor: total.sqrt().recip() }
    });
    let steps = steps.collect();
    (steps, log)
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{DMatrix, DVector};

    #[test]
    fn what_is_not_known_has_no_deviation() {
        assert_eq!([4.0, -1e-20].map(standard_deviation), [2.0, 0.0]);
        assert!(standard_deviation(f64::NAN).is_nan());
    }

    #[test]
    fn innovations_have_the_squares_and_the_determinant_of_the_covariance() {
        let noise = MarkerNoise { size: 1.0, correlated: 0.7, time: 0.15 };
        // a gap, uneven frames, and a point that counts half
        let times: [f64; 6] = [0.0, 0.01, 0.02, 0.05, 0.06, 0.075];
        let trust = [1.0, 1.0, 0.5, 1.0, 1.0, 1.0];
        let x = DVector::from_fn(6, |i, _| (3.0 * i as f64).sin());
        let covariance = DMatrix::from_fn(6, 6, |i, j| {
            let white = if i == j { 1.0 / trust[i] - 0.7 } else { 0.0 };
            white + 0.7 * (-(times[i] - times[j]).abs() / 0.15).exp()
        });
        let (steps, log) = whitening(&noise, times.into_iter().zip(trust));
        let (mut mean, mut squares) = (0.0, 0.0);
        for (step, x) in steps.iter().zip(x.iter()) {
            mean *= step.decay;
            squares += ((x - mean) * step.factor).powi(2);
            mean += step.gain * (x - mean);
        }
        let expected = x.dot(&(covariance.clone().try_inverse().unwrap() * &x));
        assert!((squares - expected).abs() < 1e-10 * expected, "{squares} {expected}");
        assert!((log - covariance.determinant().ln()).abs() < 1e-10);
    }
}
