//! Bounds on splines at all times.
//!
//! Between two knots a spline is a polynomial and stays within the range of its Bézier points, which are linear in the
//! coefficients:
//!
//! ```text
//! β_k = Σ_{j ≤ k} C(k, j)/C(d, j) a_j,   s(u) = Σ a_j u^j on the interval, 0 ≤ u ≤ 1
//! ```
//! They lie nearer to the spline than its coefficients do: a spline that begins and ends at its bound needs its first d
//! coefficients there if these are bounded, but only one Bézier point. Cut into `pieces`, intervals have nearer ones.
//!
//! Source: G. Farin, *Curves and Surfaces for CAGD*, Morgan Kaufmann 2002, chapters 5 and 8.

use somersault_core::spline::UniformBasis;

/// One Bézier point: Σ factors_j c_{first + j}.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct BezierPoint {
    pub(crate) first: usize,
    pub(crate) factors: Vec<f64>,
}

/// The Bézier points of all intervals, each cut into `pieces`; points that neighbours share are given once.
pub(crate) fn bezier_points(basis: &UniformBasis, pieces: usize) -> Vec<BezierPoint> {
    let (d, n_intervals) = (basis.degree(), basis.n_intervals());
    let mut points = Vec::new();
    let mut values = vec![0.0; basis.n_active()];
    for interval in 0..n_intervals {
        for piece in 0..pieces {
            let fraction = (interval * pieces + piece) as f64 / (n_intervals * pieces) as f64;
            // derivatives by the fraction of a piece, over j!
            let length = 1.0 / (n_intervals * pieces) as f64;
            let mut scale = 1.0;
            let mut taylor = Vec::with_capacity(d + 1);
            for j in 0..=d {
                if j > 0 {
                    scale *= length / j as f64;
                }
                let first = basis.evaluate(fraction, j, &mut values);
                debug_assert_eq!(first, interval);
                taylor.push(values.iter().map(|b| b * scale).collect::<Vec<_>>());
            }
            let is_last = interval + 1 == n_intervals && piece + 1 == pieces;
            for k in 0..d + usize::from(is_last) {
                let mut factors = vec![0.0; d + 1];
                let mut ratio = 1.0;
                for (j, row) in taylor.iter().enumerate().take(k + 1) {
                    factors.iter_mut().zip(row).for_each(|(f, a)| *f += ratio * a);
                    ratio *= (k - j) as f64 / (d - j).max(1) as f64;
                }
                points.push(BezierPoint { first: interval, factors });
            }
        }
    }
    points
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Coefficients 0, 1, 2, … of degree 5 are x + 2 with x in intervals, whose Bézier points are as far apart from each
    /// other everywhere: at knots that rounding moves too.
    #[test]
    fn bezier_points_of_a_straight_line_are_on_it() {
        for (n, pieces) in (6..120).flat_map(|n| (1..=4).map(move |pieces| (n, pieces))) {
            let points = bezier_points(&UniformBasis::try_new(5, n).unwrap(), pieces);
            for (i, point) in points.iter().enumerate() {
                let found: f64 = (point.first..).zip(&point.factors).map(|(j, f)| j as f64 * f).sum();
                let expected = 2.0 + i as f64 / (5 * pieces) as f64;
                assert!((found - expected).abs() < 1e-9, "{n} {pieces} {i}: {found}, not {expected}");
            }
        }
    }

    #[test]
    fn bezier_points_give_the_spline() {
        for (degree, pieces) in [(3, 1), (5, 1), (5, 2)] {
            let basis = UniformBasis::try_new(degree, degree + 3).unwrap();
            let coefficients: Vec<f64> = (0..degree + 3).map(|j| (j as f64 * 1.3).sin()).collect();
            let points: Vec<f64> = bezier_points(&basis, pieces)
                .iter()
                .map(|p| p.factors.iter().zip(&coefficients[p.first..]).map(|(f, c)| f * c).sum())
                .collect();
            let n_pieces = 3 * pieces;
            assert_eq!(points.len(), n_pieces * degree + 1);
            let mut values = vec![0.0; degree + 1];
            for sample in 0..=50 {
                let fraction = f64::from(sample) / 50.0;
                let first = basis.evaluate(fraction, 0, &mut values);
                let expected: f64 = values.iter().zip(&coefficients[first..]).map(|(b, c)| b * c).sum();
                let piece = ((fraction * n_pieces as f64) as usize).min(n_pieces - 1);
                let u = fraction * n_pieces as f64 - piece as f64;
                let mut casteljau = points[piece * degree..=(piece + 1) * degree].to_vec();
                while casteljau.len() > 1 {
                    casteljau = casteljau.windows(2).map(|w| (1.0 - u) * w[0] + u * w[1]).collect();
                }
                assert!((casteljau[0] - expected).abs() < 1e-13, "{degree} {pieces} {fraction}");
            }
        }
    }
}
