//! Correlations and their intervals.

use super::{Groups, ScoringError};
use rand::seq::SliceRandom;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use somersault_core::argument::{expect_finite, expect_least, expect_length};
use somersault_core::cancel::CancellationToken;

/// Choices for a validation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ValidationOptions {
    /// Resamples of the bootstrap, and shuffles of the scores.
    pub n_resamples: usize,
    /// Level of the intervals, between 0 and 1.
    pub level: f64,
    /// Seed of the generator that draws them.
    pub seed: u64,
}

impl Default for ValidationOptions {
    /// 1000 resamples, 95 %, seed 0.
    fn default() -> Self {
        Self { n_resamples: 1000, level: 0.95, seed: 0 }
    }
}

/// A coefficient, how sure it is and what chance would make of it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Correlation {
    /// The coefficient.
    pub value: f64,
    /// Lower and upper end of the percentile interval over resamples.
    pub interval: [f64; 2],
    /// Fraction of shuffles, itself among them, with at least this coefficient: a small one is a finding.
    pub p_value: f64,
}

fn check(x: &[f64], y: &[f64]) -> Result<(), ScoringError> {
    expect_least("x", x.len(), 2)?;
    expect_length("y", y.len(), x.len())?;
    for (argument, values) in [("x", x), ("y", y)] {
        expect_finite(argument, values)?;
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
    let (x, y) = (deviations(x), deviations(y));
    let sums = x.iter().zip(&y).fold([0.0; 3], |[xy, xx, yy], (x, y)| [xy + x * y, xx + x * x, yy + y * y]);
    (sums[0] / (sums[1] * sums[2]).sqrt()).clamp(-1.0, 1.0)
}

/// Deviations from the mean over the largest of them: their squares neither overflow nor vanish.
fn deviations(x: &[f64]) -> Vec<f64> {
    let largest = |v: &[f64]| v.iter().fold(0.0_f64, |largest, x| largest.max(x.abs()));
    let scale = largest(x);
    let shares: Vec<f64> = x.iter().map(|x| x / scale).collect();
    let mean = shares.iter().sum::<f64>() / shares.len() as f64;
    let deviations: Vec<f64> = shares.iter().map(|x| x - mean).collect();
    let scale = largest(&deviations);
    deviations.iter().map(|x| x / scale).collect()
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

/// Pearson's and Spearman's coefficients.
#[derive(Debug, Clone, Copy)]
pub(super) struct Coefficients([f64; 2]);

impl Coefficients {
    pub(super) fn try_new(x: &[f64], y: &[f64]) -> Result<Self, ScoringError> {
        Ok(Self([pearson(x, y)?, spearman(x, y)?]))
    }
}

/// Scores in another order: the means of groups shuffled among groups, and what scores differ by from them within groups. Of single
/// motions any order is as likely.
fn shuffled(scores: &[f64], groups: &Groups, rng: &mut ChaCha8Rng) -> Vec<f64> {
    let mean = |own: &Vec<usize>| own.iter().map(|&i| scores[i]).sum::<f64>() / own.len() as f64;
    let means: Vec<f64> = groups.motions().iter().map(mean).collect();
    let mut order: Vec<usize> = (0..means.len()).collect();
    order.shuffle(rng);
    let mut shuffled = vec![0.0; scores.len()];
    for (group, own) in groups.motions().iter().enumerate() {
        let mut from = own.clone();
        from.shuffle(rng);
        for (&i, &from) in own.iter().zip(&from) {
            shuffled[i] = means[order[group]] + (scores[from] - means[group]);
        }
    }
    shuffled
}

/// The `value`s with percentile intervals over resamples of the groups, given by the counts of motions, and fractions of the
/// shuffles of the scores that reach them. Resamples that have no coefficient are left out, shuffles
/// count as 0. Every draw has a stream of its own, so that threads do not matter.
pub(super) fn resampled(
    value: Coefficients,
    scores: &[f64],
    options: &ValidationOptions,
    groups: &Groups,
    token: &CancellationToken,
    of_resample: impl Fn(&[f64]) -> Option<Coefficients> + Sync,
    of_shuffle: impl Fn(&[f64]) -> Option<Coefficients> + Sync,
) -> Result<[Correlation; 2], ScoringError> {
    let rng = |stream: usize| {
        let mut rng = ChaCha8Rng::seed_from_u64(options.seed);
        rng.set_stream(stream as u64);
        rng
    };
    let draws = 0..options.n_resamples;
    let resample = |k: usize| {
        if token.is_cancelled() {
            return None;
        }
        let n = groups.n_groups();
        let (mut rng, mut drawn) = (rng(2 * k), vec![0.0; n]);
        (0..n).for_each(|_| drawn[rng.random_range(0..n)] += 1.0);
        let counts: Vec<f64> = (0..scores.len()).map(|i| drawn[groups.of(i)]).collect();
        of_resample(&counts)
    };
    let resamples: Vec<Coefficients> = draws.clone().into_par_iter().filter_map(resample).collect();
    let shuffle = |k: usize| {
        if token.is_cancelled() {
            return None;
        }
        of_shuffle(&shuffled(scores, groups, &mut rng(2 * k + 1)))
    };
    let shuffles: Vec<Option<Coefficients>> = draws.into_par_iter().map(shuffle).collect();
    if token.is_cancelled() {
        return Err(ScoringError::Interrupted);
    }
    expect_least("resamples that vary", resamples.len(), 1)?;
    let correlation = |which: usize| {
        let value = value.0[which];
        let mut sorted: Vec<f64> = resamples.iter().map(|c| c.0[which]).collect();
        sorted.sort_by(f64::total_cmp);
        let at = |share: f64| sorted[(share * (sorted.len() - 1) as f64).round() as usize];
        let reached = shuffles.iter().filter(|c| c.map_or(0.0, |c| c.0[which]) >= value).count();
        Correlation {
            value,
            interval: [at(0.5 * (1.0 - options.level)), at(0.5 * (1.0 + options.level))],
            p_value: (reached + 1) as f64 / (shuffles.len() + 1) as f64,
        }
    };
    Ok([correlation(0), correlation(1)])
}

#[cfg(test)]
mod tests {
    use super::*;
    use somersault_core::argument::ArgumentError;

    #[test]
    fn coefficients_are_scipys() {
        // scipy.stats.pearsonr and spearmanr, SciPy 1.17.1
        let (x, y) = ([1.0, 2.0, 2.0, 4.0, 7.0, 3.0], [2.0, 1.0, 4.0, 4.0, 5.0, 9.0]);
        assert!((pearson(&x, &y).unwrap() - 0.3638104023173468).abs() < 1e-14);
        assert!((spearman(&x, &y).unwrap() - 0.6617647058823529).abs() < 1e-14);
        assert_eq!(pearson(&x, &[1.0; 6]), Err(ScoringError::Constant { argument: "y" }));
        assert!(matches!(spearman(&x, &[1.0]), Err(ScoringError::Argument(ArgumentError::Length { .. }))));
    }

    #[test]
    fn coefficients_do_not_depend_on_units() {
        let (x, y) = ([1.0, 2.0, 2.0, 4.0, 7.0, 3.0], [2.0, 1.0, 4.0, 4.0, 5.0, 9.0]);
        for scale in [1e-300, 1e-200, 1e200, 1e307] {
            let scaled = x.map(|x| x * scale);
            assert!((pearson(&scaled, &y).unwrap() - pearson(&x, &y).unwrap()).abs() < 1e-14, "{scale}");
            assert!((pearson(&y, &scaled).unwrap() - pearson(&x, &y).unwrap()).abs() < 1e-14, "{scale}");
            assert_eq!(spearman(&scaled, &y), spearman(&x, &y));
        }
        for k in 1..200 {
            let x: Vec<f64> = (0..7).map(|i| 0.1 + f64::from(i * k) / 3.0).collect();
            let r = pearson(&x, &x).unwrap();
            assert!(r <= 1.0 && r > 1.0 - 1e-15, "{r}");
        }
    }
}
