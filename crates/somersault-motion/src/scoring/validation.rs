//! How well motions are scored that the model has not seen.

use super::statistics::{Correlation, correlations};
use super::{Performance, ScoringError, ScoringModel, ScoringOptions, expect_least, expect_length};
use rayon::prelude::*;

/// Choices for a validation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ValidationOptions {
    /// Resamples of the bootstrap.
    pub n_resamples: usize,
    /// Level of the intervals, between 0 and 1.
    pub level: f64,
    /// Seed of the generator that draws them.
    pub seed: u64,
}

impl Default for ValidationOptions {
    /// 10 000 resamples, 95 %, seed 0.
    fn default() -> Self {
        Self { n_resamples: 10_000, level: 0.95, seed: 0 }
    }
}

/// A simple predictor, validated in the same way.
#[derive(Debug, Clone, PartialEq)]
pub struct Baseline {
    /// `mean`, `duration`, or the name given to a feature.
    pub name: String,
    /// Predictions, each by all other motions.
    pub predictions: Vec<f64>,
    /// Root mean square of their errors.
    pub rms_error: f64,
}

/// Leave-one-out predictions and what they are worth.
#[derive(Debug, Clone, PartialEq)]
pub struct Validation {
    /// The score of each motion by a model of all others.
    pub predictions: Vec<f64>,
    /// Components of that model.
    pub n_components: Vec<usize>,
    /// Root mean square of the errors.
    pub rms_error: f64,
    /// Pearson's correlation of scores with predictions less the mean of the other scores.
    pub pearson: Correlation,
    /// Spearman's, of the same.
    pub spearman: Correlation,
    /// The mean of the others; a straight line over the duration, and over each feature given.
    pub baselines: Vec<Baseline>,
}

/// Leaves out each motion in turn and scores it by a model of the others: bases, number of components and regression
/// are made anew each time. `features` are single numbers of each motion, by name, for further baselines.
///
/// The mean of the others falls where the score left out is high: it is correlated by −1 with any scores, and so in part are
/// predictions, which contain it. So correlations are of what a prediction differs by from that mean; of the mean
/// itself only errors are compared. With scores that mean nothing they still lean to the negative, since a
/// line fitted without a motion turns away from it: a negative correlation is no finding.
pub fn validate(
    motions: &[Performance],
    scores: &[f64],
    options: &ScoringOptions,
    validation: &ValidationOptions,
    features: &[(&str, &[f64])],
) -> Result<Validation, ScoringError> {
    expect_length("scores", scores.len(), motions.len())?;
    expect_least("motions", motions.len(), 3)?;
    expect_least("resamples", validation.n_resamples, 1)?;
    if !(validation.level > 0.0 && validation.level < 1.0) {
        return Err(ScoringError::NonFinite { argument: "level, between 0 and 1" });
    }
    let without = |i: usize, scores: &[f64]| {
        let mut rest = scores.to_vec();
        rest.remove(i);
        rest
    };
    let predict = |i: usize| {
        let mut others = motions.to_vec();
        let motion = others.remove(i);
        let model = ScoringModel::train(&others, &without(i, scores), options)?;
        Ok::<_, ScoringError>((model.score(&motion)?, model.coefficients().len()))
    };
    let found: Vec<(f64, usize)> =
        (0..motions.len()).into_par_iter().map(predict).collect::<Result<_, _>>()?;
    let (predictions, n_components): (Vec<f64>, Vec<usize>) = found.into_iter().unzip();
    let ValidationOptions { n_resamples, level, seed } = *validation;
    let means: Vec<f64> = (0..scores.len()).map(|i| line(&[], &without(i, scores), 0.0)).collect();
    let differences: Vec<f64> = predictions.iter().zip(&means).map(|(p, m)| p - m).collect();
    let [pearson, spearman] = correlations(&differences, scores, n_resamples, level, seed)?;

    let baseline = |name: &str, predictions: Vec<f64>| Baseline {
        name: name.to_owned(),
        rms_error: rms_error(&predictions, scores),
        predictions,
    };
    let mut baselines = vec![baseline("mean", means)];
    let durations: Vec<f64> = motions.iter().map(Performance::duration).collect();
    for (name, values) in [("duration", &durations[..])].iter().chain(features) {
        expect_length("features", values.len(), scores.len())?;
        if !values.iter().all(|x| x.is_finite()) {
            return Err(ScoringError::NonFinite { argument: "features" });
        }
        let by_line = |i: usize| line(&without(i, values), &without(i, scores), values[i]);
        baselines.push(baseline(name, (0..scores.len()).map(by_line).collect()));
    }
    let rms_error = rms_error(&predictions, scores);
    Ok(Validation { predictions, n_components, rms_error, pearson, spearman, baselines })
}

/// At `x0` the line of least squares through the points; their mean where x does not vary.
fn line(x: &[f64], y: &[f64], x0: f64) -> f64 {
    let mean = |v: &[f64]| v.iter().sum::<f64>() / v.len() as f64;
    let offset = mean(y);
    if x.is_empty() || x.iter().all(|v| *v == x[0]) {
        return offset;
    }
    let centre = mean(x);
    let (product, square) = x
        .iter()
        .zip(y)
        .fold((0.0, 0.0), |(p, s), (x, y)| (p + (x - centre) * (y - offset), s + (x - centre).powi(2)));
    offset + product / square * (x0 - centre)
}

fn rms_error(predictions: &[f64], scores: &[f64]) -> f64 {
    let sum: f64 = predictions.iter().zip(scores).map(|(p, s)| (p - s).powi(2)).sum();
    (sum / scores.len() as f64).sqrt()
}
