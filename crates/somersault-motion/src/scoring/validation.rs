//! How well motions are scored that the model has not seen.

use super::learnt::{self, Basis, Described};
use super::model::normalize;
use super::options::RegressionMethod;
use super::regression::{Fold, Predicted, Sample};
use super::statistics::{Coefficients, Correlation, ValidationOptions, resampled};
use super::{Groups, Performance, ScoringError, ScoringOptions, Tuning};
use nalgebra::DMatrix;
use rayon::prelude::*;
use somersault_core::argument::{ArgumentError, expect_least, expect_length, expect_squarable};
use somersault_core::cancel::CancellationToken;

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

/// Leave-one-out predictions and their errors; in groups, those of leaving each group out.
#[derive(Debug, Clone, PartialEq)]
pub struct Validation {
    /// The score of each motion by a model of all others, or of all other groups.
    pub predictions: Vec<f64>,
    /// Distance of each motion to the others, over the greatest that one of the others has
    /// ([`Score::distance`](super::Score::distance)). The farthest of all is always beyond 1; far beyond, it is unlike the others.
    pub distances: Vec<f64>,
    /// Components or penalty of that model.
    pub tunings: Vec<Tuning>,
    /// Root mean square of the errors.
    pub rms_error: f64,
    /// Pearson's correlation of scores with predictions less the mean of the other scores.
    pub pearson: Correlation,
    /// Spearman's, of the same.
    pub spearman: Correlation,
    /// The mean of the others; a straight line over the duration, and over each feature given.
    pub baselines: Vec<Baseline>,
    /// Whether some of the motions are synthetic.
    pub synthetic: bool,
}

impl Validation {
    /// 1 − Σ(y − ŷ)²/Σ(y − ȳ)², with predictions ŷ and means ȳ of the others: the fraction of the squared error of a prediction by the mean
    /// that the model saves. Zero or below where it is no better than that, which it is on average where scores mean nothing.
    pub fn r_squared(&self) -> f64 {
        1.0 - (self.rms_error / self.baselines[0].rms_error).powi(2)
    }
}

/// Leaves out each motion in turn, or each group of them ([`validate_cancellable`]), and scores it by a model of the others: bases, tuning
/// and regression are rebuilt each time, so that no error is smaller for a choice that has seen it. `features` are single numbers of each motion, by name,
/// for further baselines.
///
/// **What is correlated.** The mean of the others falls where the score left out is high: it is correlated by
/// −1 with any scores, and so in part are predictions, which contain it. So correlations are of what a
/// prediction differs by from that mean; of the mean itself only errors are compared.
///
/// **What a correlation is checked against.** With scores that mean nothing these correlations still lean to the
/// negative. For a single standardised feature with correlation z/√n they come to about (z² − 1)/(|z| √n): a
/// slope fitted without a motion turns away from it, the more visibly the smaller the slope. Neither zero nor a
/// bootstrap of the pairs, which takes predictions for given, is then a yardstick. Here:
///
/// - *Intervals* are percentiles over resamples of the motions, or of whole groups, each with models of its own: resampled motions
///   are left out in turn, with all their copies, and scored by the regression on the others. So the interval
///   holds how much the models themselves depend on which motions there were. On scores that mean nothing it
///   contains 0 at least as often as its level says. Those of few groups, less than ten, may be too narrow.
/// - *p-values* are fractions of shuffles of the scores, validated in the same way, that are correlated at least
///   as much: exact for any number of motions. In groups the means of groups are shuffled among groups and what scores differ by from them within
///   groups, so that scores that only tell athletes from each other are no finding.
///
/// Eigenpostures do not depend on scores: for shuffles they stay those of all motions but those left out, and for resamples those of all.
///
/// **Cost** for n motions, in r axes of their vectors, r < n: a resample takes one decomposition, O(n³), and O(n r) for each motion
/// left out and number of components, in place of a decomposition for each; a group of several motions takes one. A shuffle takes O(n) for each motion and
/// number of components, O(n r) for each penalty, and O(n r) for each number of components of partial least squares.
///
/// Sources: P. Golland and B. Fischl, *Permutation tests for classification*, IPMI 2003, 330–341; B. Phipson
/// and G. K. Smyth, *Permutation p-values should never be zero*, Stat. Appl. Genet. Mol. Biol. 9 (2010), 39; B.
/// J. Parker, S. Günter and J. Bedo, *Stratification bias in low signal microarray studies*, BMC Bioinformatics
/// 8 (2007), 326, on the lean; S. Varma and R. Simon, *Bias in error estimation when using cross-validation for model selection*, BMC
/// Bioinformatics 7 (2006), 91, on choices within each fold.
pub fn validate(
    motions: &[Performance],
    scores: &[f64],
    options: &ScoringOptions,
    validation: &ValidationOptions,
    features: &[(&str, &[f64])],
) -> Result<Validation, ScoringError> {
    let (single, token) = (Groups::single(motions.len()), CancellationToken::new());
    validate_cancellable(motions, scores, &single, options, validation, features, &token)
}

/// As [`validate`], with the motions of a group left out together, and ends with [`ScoringError::Interrupted`] within a resample of the
/// cancellation.
pub fn validate_cancellable(
    motions: &[Performance],
    scores: &[f64],
    groups: &Groups,
    options: &ScoringOptions,
    validation: &ValidationOptions,
    features: &[(&str, &[f64])],
    token: &CancellationToken,
) -> Result<Validation, ScoringError> {
    expect_length("groups", groups.n_motions(), motions.len())?;
    options.check(groups, scores, 3)?;
    // with four only the resample that has all of them can be validated, and the interval would be a point
    expect_least("motions", motions.len(), 5)?;
    let range = |argument, allowed, found| {
        Err(ScoringError::Argument(ArgumentError::OutOfRange { argument, allowed, found }))
    };
    // the interval of one would be a point
    if validation.n_resamples < 2 {
        return range("n_resamples", "at least 2", validation.n_resamples as f64);
    }
    if !(validation.level > 0.0 && validation.level < 1.0) {
        return range("level", "between 0 and 1", validation.level);
    }
    if scores.iter().all(|score| *score == scores[0]) {
        return Err(ScoringError::Constant { argument: "scores" });
    }
    let folds = Folds::try_new(motions, groups, options, token)?;
    let found = folds.leave_out(scores);
    let predictions: Vec<f64> = found.iter().map(|found| found.mean + found.difference).collect();
    let tunings = found.iter().map(|found| found.tuning).collect();
    let means: Vec<f64> = found.iter().map(|found| found.mean).collect();
    let differences: Vec<f64> = found.iter().map(|found| found.difference).collect();
    let value = Coefficients::try_new(&differences, scores)?;
    let [pearson, spearman] = resampled(
        value,
        scores,
        validation,
        groups,
        token,
        |counts| folds.resampled(counts, scores),
        |shuffled| {
            let found = folds.leave_out(shuffled);
            let differences: Vec<f64> = found.iter().map(|found| found.difference).collect();
            Coefficients::try_new(&differences, shuffled).ok()
        },
    )?;
    let without = |i: usize, values: &[f64]| -> Vec<f64> {
        let others = values.iter().enumerate().filter(|(k, _)| groups.of(*k) != groups.of(i));
        others.map(|(_, value)| *value).collect()
    };
    let baseline = |name: &str, predictions: Vec<f64>| Baseline {
        name: name.to_owned(),
        rms_error: rms_error(&predictions, scores),
        predictions,
    };
    let mut baselines = vec![baseline("mean", means)];
    let durations: Vec<f64> = motions.iter().map(Performance::duration).collect();
    for (name, values) in [("duration", &durations[..])].iter().chain(features) {
        if baselines.iter().any(|known: &Baseline| known.name == *name) {
            return Err(ScoringError::DuplicateBaseline { name: (*name).to_owned() });
        }
        expect_length("features", values.len(), scores.len())?;
        expect_squarable("features", *values)?;
        let by_line = |i: usize| line(&without(i, values), &without(i, scores), values[i]);
        baselines.push(baseline(name, (0..scores.len()).map(by_line).collect()));
    }
    let rms_error = rms_error(&predictions, scores);
    let synthetic = motions.iter().any(Performance::is_synthetic);
    let distances = folds.relative_distances();
    Ok(Validation { predictions, distances, tunings, rms_error, pearson, spearman, baselines, synthetic })
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

/// What a model of the other groups says of a motion.
struct LeftOut {
    /// The mean of the other scores.
    mean: f64,
    /// What the prediction differs by from that.
    difference: f64,
    tuning: Tuning,
}

/// What leaving each group out needs of the motions; scores may change.
struct Folds<'a> {
    groups: &'a Groups,
    options: &'a ScoringOptions,
    /// Products of the motions' vectors with each other, for the eigenpostures of all.
    gram: DMatrix<f64>,
    /// The distance of each motion to the others, in the eigenpostures of these.
    distances: Vec<f64>,
    /// The motions without each group, in the eigenpostures of these.
    without: Vec<Fold<'static>>,
}

/// Products of vectors with each other, about a point near them, so that products keep their digits.
fn gram(described: &mut Described) -> DMatrix<f64> {
    let vectors = &mut described.vectors;
    let centre = vectors.row_mean();
    vectors.row_iter_mut().for_each(|mut row| row -= &centre);
    &*vectors * vectors.transpose()
}

impl<'a> Folds<'a> {
    fn try_new(
        motions: &[Performance],
        groups: &'a Groups,
        options: &'a ScoringOptions,
        token: &CancellationToken,
    ) -> Result<Self, ScoringError> {
        let (features, motions_at) = normalize(motions, &options.vector)?;
        learnt::sizes(features.kind, &motions_at)?;
        let describe = |left_out: &(dyn Fn(usize) -> bool + Sync)| {
            Basis::of(features.kind, &motions_at, &options.vector, left_out)?
                .describe(&options.vector, &motions_at)
        };
        let without = |group: usize| {
            if token.is_cancelled() {
                return Err(ScoringError::Interrupted);
            }
            let mut described = describe(&|k| groups.of(k) == group)?;
            let own = &groups.motions()[group];
            let to_others = |i: &usize| described.distance_of(*i, |k| groups.of(k) != group);
            let distances: Vec<f64> = own.iter().map(to_others).collect();
            let mut counts = vec![1.0; motions.len()];
            own.iter().for_each(|&i| counts[i] = 0.0);
            let (sample, own) = Sample::of_gram(&gram(&mut described), &counts, most(options, &counts), own);
            Ok((Fold::new(sample, own), distances))
        };
        let found: Vec<_> =
            (0..groups.n_groups()).into_par_iter().map(without).collect::<Result<_, ScoringError>>()?;
        let mut distances = vec![0.0; motions.len()];
        let mut folds = Vec::with_capacity(found.len());
        for ((fold, of_group), own) in found.into_iter().zip(groups.motions()) {
            own.iter().zip(of_group).for_each(|(&i, distance)| distances[i] = distance);
            folds.push(fold);
        }
        Ok(Self { groups, options, gram: gram(&mut describe(&|_| false)?), distances, without: folds })
    }

    /// The distance of each motion over the greatest of those of other groups.
    fn relative_distances(&self) -> Vec<f64> {
        let others = |i: usize| -> Vec<f64> {
            let all = self.distances.iter().enumerate();
            all.filter(|(j, _)| self.groups.of(*j) != self.groups.of(i))
                .map(|(_, distance)| *distance)
                .collect()
        };
        self.distances
            .iter()
            .enumerate()
            .map(|(i, distance)| distance / learnt::greatest(&others(i)))
            .collect()
    }

    /// What the model without its group says of each motion.
    fn leave_out(&self, scores: &[f64]) -> Vec<LeftOut> {
        let mut found: Vec<Option<LeftOut>> = scores.iter().map(|_| None).collect();
        for (fold, own) in self.without.iter().zip(self.groups.motions()) {
            let Predicted { mean, differences, tuning } = fold.predict(scores, self.options);
            for (&i, difference) in own.iter().zip(differences) {
                found[i] = Some(LeftOut { mean, difference, tuning });
            }
        }
        // every motion is of one group
        found.into_iter().flatten().collect()
    }

    /// The coefficients in a resample that has each motion so many times; none where too few are left.
    fn resampled(&self, counts: &[f64], scores: &[f64]) -> Option<Coefficients> {
        let (sample, _) = Sample::of_gram(&self.gram, counts, usize::MAX, &[]);
        let n = sample.members().len();
        let (mut differences, mut given) = (Vec::new(), Vec::new());
        for (place, &i) in sample.members().iter().enumerate() {
            let own = &self.groups.motions()[self.groups.of(i)];
            if own[0] != i {
                continue;
            }
            if n < own.len() + 3 {
                return None;
            }
            let fold = if own.len() == 1 {
                Fold::without(&sample, place, self.options)
            } else {
                let mut others = counts.to_vec();
                own.iter().for_each(|&i| others[i] = 0.0);
                let (sample, own) = Sample::of_gram(&self.gram, &others, most(self.options, &others), own);
                Fold::new(sample, own)
            };
            let found = fold.predict(scores, self.options).differences;
            for (&i, difference) in own.iter().zip(found) {
                for _ in 0..counts[i] as usize {
                    differences.push(difference);
                    given.push(scores[i]);
                }
            }
        }
        Coefficients::try_new(&differences, &given).ok()
    }
}

/// Axes that a regression on motions with these counts needs.
fn most(options: &ScoringOptions, counts: &[f64]) -> usize {
    let n = counts.iter().filter(|count| **count > 0.0).count();
    match options.method {
        RegressionMethod::PrincipalComponents => options.most().min(n - 2),
        RegressionMethod::PartialLeastSquares | RegressionMethod::Ridge => n,
    }
}
