//! How well motions are scored that the model has not seen.

use super::learnt::{self, Basis};
use super::model::normalize;
use super::regression::LeftOut;
use super::statistics::{Coefficients, Correlation, ValidationOptions, resampled};
use super::{Performance, ScoringError, ScoringOptions};
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

/// Leave-one-out predictions and their errors.
#[derive(Debug, Clone, PartialEq)]
pub struct Validation {
    /// The score of each motion by a model of all others.
    pub predictions: Vec<f64>,
    /// Distance of each motion to the others, over the greatest that one of the others has
    /// ([`Score::distance`](super::Score::distance)). The farthest of all is always beyond 1; far beyond, it is unlike the others.
    pub distances: Vec<f64>,
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
    /// Whether some of the motions are synthetic.
    pub synthetic: bool,
}

/// Leaves out each motion in turn and scores it by a model of the others: bases, number of components and
/// regression are rebuilt each time. `features` are single numbers of each motion, by name, for further
/// baselines.
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
/// - *Intervals* are percentiles over resamples of the motions, each with models of its own: resampled motions
///   are left out in turn, with all their copies, and scored by the regression on the others. So the interval
///   holds how much the models themselves depend on which motions there were. On scores that mean nothing it
///   contains 0 at least as often as its level says.
/// - *p-values* are fractions of shuffles of the scores, validated in the same way, that are correlated at least
///   as much: exact for any number of motions.
///
/// Eigenpostures do not depend on scores; for resamples and shuffles they stay those of all motions but the one
/// left out. Cost: O(n⁴) for n motions a resample, O(n²) a shuffle.
///
/// Sources: P. Golland and B. Fischl, *Permutation tests for classification*, IPMI 2003, 330–341; B. Phipson
/// and G. K. Smyth, *Permutation p-values should never be zero*, Stat. Appl. Genet. Mol. Biol. 9 (2010), 39; B.
/// J. Parker, S. Günter and J. Bedo, *Stratification bias in low signal microarray studies*, BMC Bioinformatics
/// 8 (2007), 326, on the lean.
pub fn validate(
    motions: &[Performance],
    scores: &[f64],
    options: &ScoringOptions,
    validation: &ValidationOptions,
    features: &[(&str, &[f64])],
) -> Result<Validation, ScoringError> {
    validate_cancellable(motions, scores, options, validation, features, &CancellationToken::new())
}

/// As [`validate`], and ends with [`ScoringError::Interrupted`] within a resample of the cancellation.
pub fn validate_cancellable(
    motions: &[Performance],
    scores: &[f64],
    options: &ScoringOptions,
    validation: &ValidationOptions,
    features: &[(&str, &[f64])],
    token: &CancellationToken,
) -> Result<Validation, ScoringError> {
    options.check(motions.len(), scores, 3)?;
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
    let folds = Folds::try_new(motions, options)?;
    let found = folds.leave_out(scores);
    let predictions: Vec<f64> = found.iter().map(|(mean, difference, _)| mean + difference).collect();
    let n_components = found.iter().map(|(_, _, n)| *n).collect();
    let means: Vec<f64> = found.iter().map(|(mean, _, _)| *mean).collect();
    let differences: Vec<f64> = found.iter().map(|(_, difference, _)| *difference).collect();
    let value = Coefficients::try_new(&differences, scores)?;
    let [pearson, spearman] = resampled(
        value,
        validation,
        scores.len(),
        token,
        |counts| folds.resampled(counts, scores),
        |order| {
            let shuffled: Vec<f64> = order.iter().map(|&i| scores[i]).collect();
            let differences: Vec<f64> = folds.leave_out(&shuffled).iter().map(|(_, d, _)| *d).collect();
            Coefficients::try_new(&differences, &shuffled).ok()
        },
    )?;
    let without = |i: usize, values: &[f64]| {
        let mut rest = values.to_vec();
        rest.remove(i);
        rest
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
    Ok(Validation {
        predictions,
        distances,
        n_components,
        rms_error,
        pearson,
        spearman,
        baselines,
        synthetic,
    })
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

/// What leaving each motion out needs of the motions; scores may change.
struct Folds {
    /// Products of the motions' vectors with each other, for the eigenpostures of all but the motion left out.
    grams: Vec<DMatrix<f64>>,
    /// The distance of each motion to the others, in the eigenpostures of these.
    distances: Vec<f64>,
    left_out: Vec<LeftOut>,
    n_components: Option<usize>,
    most: usize,
}

impl Folds {
    fn try_new(motions: &[Performance], options: &ScoringOptions) -> Result<Self, ScoringError> {
        let (features, motions_at) = normalize(motions, &options.vector)?;
        learnt::sizes(features.kind, &motions_at)?;
        let gram = |i: usize| {
            let basis = Basis::of(features.kind, &motions_at, &options.vector, |k| k == i)?;
            let mut described = basis.describe(&options.vector, &motions_at)?;
            let distance = described.distance_of(i, |_| true);
            // about a point near them, so that products keep their digits
            let vectors = &mut described.vectors;
            let centre = vectors.row_mean();
            vectors.row_iter_mut().for_each(|mut row| row -= &centre);
            Ok::<_, ScoringError>((&*vectors * vectors.transpose(), distance))
        };
        let (grams, distances): (Vec<DMatrix<f64>>, Vec<f64>) =
            (0..motions.len()).into_par_iter().map(gram).collect::<Result<Vec<_>, _>>()?.into_iter().unzip();
        let once = vec![1.0; motions.len()];
        let most = options.most();
        let of = |(i, gram): (usize, &DMatrix<f64>)| LeftOut::new(gram, &once, i, most);
        let left_out = grams.iter().enumerate().filter_map(of).collect();
        Ok(Self { grams, distances, left_out, n_components: options.n_components, most })
    }

    /// The distance of each motion over the greatest of the others'.
    fn relative_distances(&self) -> Vec<f64> {
        let others = |i: usize| -> Vec<f64> {
            let all = self.distances.iter().enumerate();
            all.filter(|(j, _)| *j != i).map(|(_, distance)| *distance).collect()
        };
        self.distances
            .iter()
            .enumerate()
            .map(|(i, distance)| distance / learnt::greatest(&others(i)))
            .collect()
    }

    /// For each motion the mean of the others, what its prediction differs by from that, and the components
    /// used.
    fn leave_out(&self, scores: &[f64]) -> Vec<(f64, f64, usize)> {
        self.left_out.iter().map(|fold| fold.predict(scores, self.n_components)).collect()
    }

    /// The coefficients in a resample that has each motion so many times; none where too few are left.
    fn resampled(&self, counts: &[f64], scores: &[f64]) -> Option<Coefficients> {
        let (mut differences, mut given) = (Vec::new(), Vec::new());
        for (i, count) in counts.iter().enumerate().filter(|(_, count)| **count > 0.0) {
            let fold = LeftOut::new(&self.grams[i], counts, i, self.most)?;
            let (_, difference, _) = fold.predict(scores, self.n_components);
            for _ in 0..*count as usize {
                differences.push(difference);
                given.push(scores[i]);
            }
        }
        Coefficients::try_new(&differences, &given).ok()
    }
}
