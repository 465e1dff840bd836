//! Points and weights of quadrature.
//!
//! Rules on [0, 1] are arrays of points with their weights, ∫₀¹ f ≈ Σ w f(s). Those on equal intervals are the weights of their
//! n + 1 nodes.

/// Gauss' rule of three points, exact to degree 5.
pub const GAUSS_3: [(f64, f64); 3] =
    [(0.112_701_665_379_258_3, 5.0 / 18.0), (0.5, 8.0 / 18.0), (0.887_298_334_620_741_7, 5.0 / 18.0)];

/// Gauss' rule of four points, exact to degree 7.
pub const GAUSS_4: [(f64, f64); 4] = [
    (0.069_431_844_202_973_71, 0.173_927_422_568_726_93),
    (0.330_009_478_207_571_9, 0.326_072_577_431_273_07),
    (0.669_990_521_792_428_1, 0.326_072_577_431_273_07),
    (0.930_568_155_797_026_3, 0.173_927_422_568_726_93),
];

/// Gauss' rule of five points, exact to degree 9.
pub const GAUSS_5: [(f64, f64); 5] = [
    (0.046_910_077_030_668_02, 0.118_463_442_528_094_56),
    (0.230_765_344_947_158_5, 0.239_314_335_249_683_26),
    (0.5, 0.284_444_444_444_444_44),
    (0.769_234_655_052_841_5, 0.239_314_335_249_683_26),
    (0.953_089_922_969_331_9, 0.118_463_442_528_094_56),
];

/// Points in [−1, 1) and weights of the Legendre–Gauss–Radau rule over [−1, 1], exact to degree 2n − 2, n at least 1.
///
/// The points τ₁ = −1 < … < τ_n < 1 are the roots of P_{n−1} + P_n. Cost O(n²).
pub fn radau(n: usize) -> (Vec<f64>, Vec<f64>) {
    let (mut points, mut weights) = (Vec::with_capacity(n + 1), Vec::with_capacity(n));
    let size = n as f64;
    points.push(-1.0);
    weights.push(2.0 / (size * size));
    for i in 1..n {
        let mut x = -(std::f64::consts::TAU * i as f64 / (2.0 * size - 1.0)).cos();
        // Newton converges quadratically from here; a few steps more only keep the rounding.
        for _ in 0..8 {
            let (before, last) = legendre(n, x);
            x -= (1.0 - x) / size * (before + last) / (before - last);
        }
        let (before, _) = legendre(n, x);
        points.push(x);
        weights.push((1.0 - x) / (size * before).powi(2));
    }
    (points, weights)
}

/// P_{n−1} and P_n at x.
fn legendre(n: usize, x: f64) -> (f64, f64) {
    let (mut before, mut last) = (1.0, x);
    for k in 1..n {
        let k = k as f64;
        (before, last) = (last, ((2.0 * k + 1.0) * x * last - k * before) / (k + 1.0));
    }
    (before, last)
}

/// The value at the start of each of n equal intervals of [0, 1], as Euler's method takes it.
pub fn left_rectangles(n: usize) -> Vec<f64> {
    let mut weights = vec![1.0 / n as f64; n + 1];
    weights[n] = 0.0;
    weights
}

/// The trapezoidal rule over [0, 1] on n equal intervals, n at least 1, with Gregory's end corrections: order 4.
/// Below six intervals, where the corrections would overlap, the closed Newton–Cotes formula.
pub fn gregory(n: usize) -> Vec<f64> {
    let mut weights = match n {
        1 => vec![0.5, 0.5],
        2 => vec![1.0 / 3.0, 4.0 / 3.0, 1.0 / 3.0],
        3 => vec![3.0 / 8.0, 9.0 / 8.0, 9.0 / 8.0, 3.0 / 8.0],
        4 => vec![14.0 / 45.0, 64.0 / 45.0, 24.0 / 45.0, 64.0 / 45.0, 14.0 / 45.0],
        5 => vec![95.0 / 288.0, 375.0 / 288.0, 250.0 / 288.0, 250.0 / 288.0, 375.0 / 288.0, 95.0 / 288.0],
        _ => {
            let mut weights = vec![1.0; n + 1];
            for (i, correction) in [9.0 / 24.0, 28.0 / 24.0, 23.0 / 24.0].into_iter().enumerate() {
                weights[i] = correction;
                weights[n - i] = correction;
            }
            weights
        }
    };
    weights.iter_mut().for_each(|w| *w /= n as f64);
    weights
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The largest error of a rule over [0, 1] for the powers up to a degree.
    fn error(degree: i32, rule: impl Iterator<Item = (f64, f64)> + Clone) -> f64 {
        let of_power = |k| rule.clone().map(|(s, w)| w * s.powi(k)).sum::<f64>() - 1.0 / f64::from(k + 1);
        (0..=degree).map(of_power).fold(0.0, |worst, error| worst.max(error.abs()))
    }

    fn on_grid(weights: Vec<f64>) -> impl Iterator<Item = (f64, f64)> + Clone {
        let n = (weights.len() - 1) as f64;
        weights.into_iter().enumerate().map(move |(k, w)| (k as f64 / n, w))
    }

    #[test]
    fn gauss_rules_are_exact_to_their_degree_and_no_further() {
        let (three, four, five) = (GAUSS_3.into_iter(), GAUSS_4.into_iter(), GAUSS_5.into_iter());
        assert!(error(5, three.clone()) < 2e-16 && error(6, three) > 1e-4);
        assert!(error(7, four.clone()) < 2e-16 && error(8, four) > 1e-5);
        assert!(error(9, five.clone()) < 2e-16 && error(10, five) > 1e-6);
    }

    #[test]
    fn radau_rules_are_exact_to_degree_2n_minus_2_and_no_further() {
        for n in 1..=8 {
            let (points, weights) = radau(n);
            let rule = points.into_iter().zip(weights).map(|(tau, w)| (0.5 * (1.0 + tau), 0.5 * w));
            let degree = 2 * n as i32 - 2;
            assert!(error(degree, rule.clone()) < 1e-15, "{n}");
            assert!(error(degree + 1, rule) > 1e-9, "{n}");
        }
    }

    #[test]
    fn rules_on_equal_intervals_are_exact_to_degree_three() {
        for n in 2..40 {
            assert!(error(3, on_grid(gregory(n))) < 1e-15, "{n}");
        }
        assert!(error(1, on_grid(gregory(1))) < 1e-15);
        assert!(error(0, on_grid(left_rectangles(7))) < 1e-15);
    }
}
