//! Cubic splines through points, with the "not a knot" ends of SciPy's `CubicSpline`.
//!
//! Twice continuously differentiable; the third derivative is also continuous at the second and the last knot
//! but one, so that cubics are reproduced exactly. Two points give a line, three a parabola. The error of a
//! smooth curve is O(h⁴).
//!
//! Source: C. de Boor, *A Practical Guide to Splines*, Springer 2001, chapter IV.

use super::{RecordingError, expect_times};
use nalgebra::SVector;
use somersault_core::argument::expect_length;

/// The curve through points at growing times.
#[derive(Debug, Clone, PartialEq)]
pub struct CubicSpline<const D: usize> {
    times: Vec<f64>,
    values: Vec<SVector<f64, D>>,
    slopes: Vec<SVector<f64, D>>,
}

impl<const D: usize> CubicSpline<D> {
    /// Through `values` at `times`. Cost O(n).
    pub fn try_new(times: Vec<f64>, values: Vec<SVector<f64, D>>) -> Result<Self, RecordingError> {
        expect_times(&times)?;
        expect_length("values", values.len(), times.len())?;
        if let Some(frame) = values.iter().position(|v| !v.iter().all(|x| x.is_finite())) {
            return Err(RecordingError::NonFinite { argument: "values", frame });
        }
        let slopes = slopes(&times, &values);
        Ok(Self { times, values, slopes })
    }

    /// The value at `t`; outside of the times the outermost cubics continue.
    pub fn evaluate(&self, t: f64) -> SVector<f64, D> {
        let n = self.times.len();
        if n == 1 {
            return self.values[0];
        }
        let i = self.times.partition_point(|x| *x <= t).clamp(1, n - 1) - 1;
        let h = self.times[i + 1] - self.times[i];
        let x = (t - self.times[i]) / h;
        if x == 1.0 {
            return self.values[i + 1];
        }
        let rise = self.values[i + 1] - self.values[i];
        let (a, b) = (self.slopes[i] * h - rise, rise - self.slopes[i + 1] * h);
        self.values[i] + rise * x + (a * (1.0 - x) + b * x) * (x * (1.0 - x))
    }

    /// The first derivative at `t`, 1/s.
    pub fn derivative(&self, t: f64) -> SVector<f64, D> {
        let n = self.times.len();
        if n == 1 {
            return SVector::zeros();
        }
        let i = self.times.partition_point(|x| *x <= t).clamp(1, n - 1) - 1;
        let h = self.times[i + 1] - self.times[i];
        let x = (t - self.times[i]) / h;
        let rise = (self.values[i + 1] - self.values[i]) / h;
        let (a, b) = (self.slopes[i] - rise, rise - self.slopes[i + 1]);
        rise + a * ((1.0 - x) * (1.0 - 3.0 * x)) + b * (x * (2.0 - 3.0 * x))
    }
}

/// The derivatives at the knots: a tridiagonal system, which needs no pivots.
fn slopes<const D: usize>(times: &[f64], values: &[SVector<f64, D>]) -> Vec<SVector<f64, D>> {
    let n = times.len();
    let h: Vec<f64> = times.windows(2).map(|w| w[1] - w[0]).collect();
    let chord: Vec<_> = (0..n - 1).map(|i| (values[i + 1] - values[i]) / h[i]).collect();
    match n {
        1 => return vec![SVector::zeros()],
        2 => return vec![chord[0]; 2],
        3 => {
            let middle = (chord[0] * h[1] + chord[1] * h[0]) / (h[0] + h[1]);
            return vec![chord[0] * 2.0 - middle, middle, chord[1] * 2.0 - middle];
        }
        // from here on each end has a condition of its own
        4.. => {}
        0 => return Vec::new(),
    }
    let first = h[0] + h[1];
    let last = h[n - 2] + h[n - 3];
    // rows (lower, diagonal, upper); eliminated from the top
    let mut upper = vec![first / h[1]];
    let right = (chord[0] * ((h[0] + 2.0 * first) * h[1]) + chord[1] * (h[0] * h[0])) / first;
    let mut slopes = vec![right / h[1]];
    for i in 1..n {
        let (lower, diagonal, above, right) = if i < n - 1 {
            let right = (chord[i - 1] * h[i] + chord[i] * h[i - 1]) * 3.0;
            (h[i], 2.0 * (h[i - 1] + h[i]), h[i - 1], right)
        } else {
            let right =
                chord[n - 3] * (h[n - 2] * h[n - 2]) + chord[n - 2] * ((2.0 * last + h[n - 2]) * h[n - 3]);
            (last, h[n - 3], 0.0, right / last)
        };
        let pivot = diagonal - lower * upper[i - 1];
        upper.push(above / pivot);
        let before = slopes[i - 1];
        slopes.push((right - before * lower) / pivot);
    }
    for i in (0..n - 1).rev() {
        let after = slopes[i + 1];
        slopes[i] -= after * upper[i];
    }
    slopes
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector1;

    fn through(times: &[f64], f: impl Fn(f64) -> f64) -> CubicSpline<1> {
        CubicSpline::try_new(times.to_vec(), times.iter().map(|&t| Vector1::new(f(t))).collect()).unwrap()
    }

    #[test]
    fn cubics_are_reproduced() {
        let times = [0.0, 0.4, 0.5, 1.3, 2.0, 2.1];
        let cubic = |t: f64| 1.0 - 2.0 * t + 0.5 * t * t + 0.3 * t * t * t;
        for n in 4..=times.len() {
            let spline = through(&times[..n], cubic);
            for t in [-0.3, 0.0, 0.2, 0.45, 0.5, 1.0, 1.29, 2.3] {
                assert!((spline.evaluate(t)[0] - cubic(t)).abs() < 1e-13, "{n} points, at {t}");
            }
        }
        let spline = through(&times, cubic);
        for t in [-0.3, 0.0, 0.45, 1.0, 2.1] {
            assert!((spline.derivative(t)[0] - (-2.0 + t + 0.9 * t * t)).abs() < 1e-12, "at {t}");
        }
        let parabola = |t: f64| t * t - t;
        assert!((through(&times[..3], parabola).evaluate(0.27)[0] - parabola(0.27)).abs() < 1e-15);
        assert!((through(&times[..2], |t| 3.0 * t).evaluate(0.3)[0] - 0.9).abs() < 1e-15);
        assert_eq!(through(&times[..1], |_| 7.0).evaluate(5.0)[0], 7.0);
        assert_eq!(through(&times[..1], |_| 7.0).derivative(5.0)[0], 0.0);
    }

    #[test]
    fn knots_are_met_exactly() {
        let times = [0.0, 0.1, 0.35, 0.7, 1.0];
        let spline = through(&times, |t| (9.0 * t).sin());
        for t in times {
            assert_eq!(spline.evaluate(t)[0], (9.0 * t).sin());
        }
    }

    #[test]
    fn the_spline_is_scipys() {
        // scipy.interpolate.CubicSpline(t, sin(5 t)), SciPy 1.17.1
        let spline = through(&[0.0, 0.1, 0.35, 0.7, 1.0, 1.2], |t| (5.0 * t).sin());
        let golden = [
            (0.05, 0.25084916446932715),
            (0.2, 0.8349908178834149),
            (0.5, 0.5676906277511126),
            (1.1, -0.7545532410428077),
        ];
        for (t, value) in golden {
            assert!((spline.evaluate(t)[0] - value).abs() < 1e-14, "at {t}: {}", spline.evaluate(t)[0]);
        }
    }
}
