//! Correlations and their intervals.

use super::{ScoringError, expect_least, expect_length};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// A coefficient with its bootstrap interval.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Correlation {
    /// The coefficient.
    pub value: f64,
    /// Lower and upper end of the percentile interval.
    pub interval: [f64; 2],
}

fn check(x: &[f64], y: &[f64]) -> Result<(), ScoringError> {
    expect_least("x", x.len(), 2)?;
    expect_length("y", y.len(), x.len())?;
    for (argument, values) in [("x", x), ("y", y)] {
        if !values.iter().all(|v| v.is_finite()) {
            return Err(ScoringError::NonFinite { argument });
        }
        if values.iter().all(|v| *v == values[0]) {
            return Err(ScoringError::Constant { argument });
        }
    }
    Ok(())
}

/// Pearson's r: the cosine between the deviations from the means.
pub fn pearson(x: &[f64], y: &[f64]) -> Result<f64, ScoringError> {
    check(x, y)?;
    Ok(coefficient(x, y))
}

/// Spearman's ρ: Pearson's r of the ranks; equal values share the mean of theirs.
pub fn spearman(x: &[f64], y: &[f64]) -> Result<f64, ScoringError> {
    check(x, y)?;
    Ok(coefficient(&ranks(x), &ranks(y)))
}

fn coefficient(x: &[f64], y: &[f64]) -> f64 {
    let mean = |v: &[f64]| v.iter().sum::<f64>() / v.len() as f64;
    let (a, b) = (mean(x), mean(y));
    let sums = x.iter().zip(y).fold([0.0; 3], |[xy, xx, yy], (x, y)| {
        [xy + (x - a) * (y - b), xx + (x - a).powi(2), yy + (y - b).powi(2)]
    });
    sums[0] / (sums[1] * sums[2]).sqrt()
}

fn ranks(x: &[f64]) -> Vec<f64> {
    let mut order: Vec<usize> = (0..x.len()).collect();
    order.sort_by(|&i, &j| x[i].total_cmp(&x[j]));
    let mut ranks = vec![0.0; x.len()];
    let mut first = 0;
    while first < order.len() {
        let tied = order[first..].iter().take_while(|&&i| x[i] == x[order[first]]).count();
        for &i in &order[first..first + tied] {
            ranks[i] = first as f64 + (tied as f64 + 1.0) / 2.0;
        }
        first += tied;
    }
    ranks
}

/// Pearson's and Spearman's coefficients with percentile intervals of `level`, from `n` resamples of the pairs drawn by
/// a generator of this `seed`. Resamples in which one side does not vary are drawn again, at most n times.
pub(super) fn correlations(
    x: &[f64],
    y: &[f64],
    n: usize,
    level: f64,
    seed: u64,
) -> Result<[Correlation; 2], ScoringError> {
    let values = [pearson(x, y)?, spearman(x, y)?];
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut found = [Vec::with_capacity(n), Vec::with_capacity(n)];
    let (mut a, mut b) = (x.to_vec(), y.to_vec());
    for _ in 0..2 * n {
        if found[0].len() == n {
            break;
        }
        for k in 0..x.len() {
            let i = rng.random_range(0..x.len());
            (a[k], b[k]) = (x[i], y[i]);
        }
        if check(&a, &b).is_ok() {
            found[0].push(coefficient(&a, &b));
            found[1].push(coefficient(&ranks(&a), &ranks(&b)));
        }
    }
    let interval = |coefficients: &mut Vec<f64>| {
        coefficients.sort_by(f64::total_cmp);
        let at = |share: f64| coefficients[(share * (coefficients.len() - 1) as f64).round() as usize];
        [at(0.5 * (1.0 - level)), at(0.5 * (1.0 + level))]
    };
    let [mut p, mut s] = found;
    expect_least("resamples that vary", p.len(), 1)?;
    Ok([
        Correlation { value: values[0], interval: interval(&mut p) },
        Correlation { value: values[1], interval: interval(&mut s) },
    ])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn coefficients_are_scipys() {
        // scipy.stats.pearsonr and spearmanr, SciPy 1.17.1
        let (x, y) = ([1.0, 2.0, 2.0, 4.0, 7.0, 3.0], [2.0, 1.0, 4.0, 4.0, 5.0, 9.0]);
        assert!((pearson(&x, &y).unwrap() - 0.3638104023173468).abs() < 1e-14);
        assert!((spearman(&x, &y).unwrap() - 0.6617647058823529).abs() < 1e-14);
        assert_eq!(pearson(&x, &[1.0; 6]), Err(ScoringError::Constant { argument: "y" }));
        assert!(matches!(spearman(&x, &[1.0]), Err(ScoringError::Length { .. })));
    }
}
