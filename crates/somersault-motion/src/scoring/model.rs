//! From motions with scores to a score for a motion.

use super::learnt::{self, Basis, Heading, Unseen};
use super::options::ScoringOptions;
use super::regression::Regression;
use super::vector::Normalized;
use super::{Features, Groups, Performance, RegressionMethod, ScoringError, Tuning, VectorOptions};
use crate::analysis::Pca;
use nalgebra::DMatrix;
use somersault_core::argument::{expect_least, expect_length, expect_range};

/// What a model was taught.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Learnt {
    /// The motions' vectors, a row each.
    pub(super) vectors: DMatrix<f64>,
    /// Their distances to the others, each left out.
    pub(super) distances: Vec<f64>,
    /// Their scores less predictions of models that have not seen them.
    pub(super) errors: Vec<f64>,
    /// Their scores.
    pub(super) scores: Vec<f64>,
    /// Least and greatest size of markers, m.
    pub(super) sizes: [f64; 2],
}

/// A score with its interval, and how far the motion is from the training motions.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Score {
    /// The score. It may be beyond the scale, since the regression is a straight line.
    pub value: f64,
    /// Prediction interval: where the judge's score of a motion like the training motions lies with the probability requested, on
    /// average over such motions. As wide as the errors of the training motions by models that have not seen them; infinite where
    /// there are too few of them, fewer than 19 at 95 %.
    pub interval: [f64; 2],
    /// Distance of the motion to the nearest training motion, over the greatest such distance among the training motions, each
    /// left out in turn.
    pub distance: f64,
}

impl Score {
    /// Whether the motion is as near to the training motions as they are to each other, at a distance of at most 1. Else the model says
    /// nothing about it, whatever the value: units, axes or names may be mistaken, or it is another kind of motion.
    pub fn is_inside(&self) -> bool {
        self.distance <= 1.0
    }
}

/// A trained model. It knows what it was taught: names and kind of the features, lengths in m, z up, the heading, scores and their scale.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(try_from = "super::storage::Stored", into = "super::storage::Stored")]
pub struct ScoringModel {
    pub(super) vector: VectorOptions,
    pub(super) features: Features,
    pub(super) heading: Heading,
    /// The first PCA, of all frames.
    pub(super) eigenpostures: Pca,
    /// Of the scores over the second PCA, of the motions' vectors.
    pub(super) regression: Regression,
    pub(super) scale: [f64; 2],
    pub(super) learnt: Learnt,
    pub(super) synthetic: bool,
}

impl ScoringModel {
    /// Learns from motions and their scores. There must be two motions more than components, so that one can be
    /// left out. All must have the features of the first, which are found by name; what else they have is not used.
    pub fn train(
        motions: &[Performance],
        scores: &[f64],
        options: &ScoringOptions,
    ) -> Result<Self, ScoringError> {
        Self::train_in_groups(motions, scores, &Groups::single(motions.len()), options)
    }

    /// As [`train`](Self::train), with intervals and distances for motions of a group that is not among the training motions, such as of
    /// another athlete: the errors by which intervals are as wide are those of whole groups left out.
    pub fn train_in_groups(
        motions: &[Performance],
        scores: &[f64],
        groups: &Groups,
        options: &ScoringOptions,
    ) -> Result<Self, ScoringError> {
        expect_length("groups", groups.n_motions(), motions.len())?;
        options.check(groups, scores, 2)?;
        let (features, motions_at) = normalize(motions, &options.vector)?;
        let sizes = learnt::sizes(features.kind, &motions_at)?;
        let basis = Basis::of(features.kind, &motions_at, &options.vector, |_| false)?;
        let vectors = basis.describe(&options.vector, &motions_at)?.vectors;
        let Unseen { distances, errors } = Unseen::of(features.kind, &motions_at, scores, groups, options)?;
        let regression = Regression::of(&vectors, scores, options)?;
        Ok(Self {
            vector: options.vector,
            features,
            heading: basis.heading,
            eigenpostures: basis.eigenpostures,
            regression,
            scale: options.scale,
            learnt: Learnt { vectors, distances, errors, scores: scores.to_vec(), sizes },
            synthetic: motions.iter().any(Performance::is_synthetic),
        })
    }

    /// The score of a motion with its interval of 95 %, see [`score_at_level`](Self::score_at_level).
    pub fn score(&self, motion: &Performance) -> Result<Score, ScoringError> {
        self.score_at_level(motion, 0.95)
    }

    /// The score of a motion, which must have the features learnt, by name, with a prediction interval of `level`, between 0 and 1. Fails
    /// where its markers are more than twice as far apart as the training motions, or less than half: they are in another unit.
    pub fn score_at_level(&self, motion: &Performance, level: f64) -> Result<Score, ScoringError> {
        expect_range("level", level, "between 0 and 1", |level| level > 0.0 && level < 1.0)?;
        let motion = motion.normalized(&self.features, self.vector.n_frames)?;
        learnt::expect_size(self.features.kind, &motion, None, self.learnt.sizes)?;
        let (vector, rest) = self.vector.vector(&self.eigenpostures, &self.heading.turned(&motion))?;
        let value = self.regression.predict(&DMatrix::from_rows(std::slice::from_ref(&vector)))?[0];
        let nearest = learnt::distance(&vector, rest, &self.learnt.vectors, |_| true);
        let width = learnt::half_width(&self.learnt.errors, level);
        let distance = nearest / learnt::greatest(&self.learnt.distances);
        Ok(Score { value, interval: [value - width, value + width], distance })
    }

    /// What the numbers of a posture are, and their names.
    pub fn features(&self) -> &Features {
        &self.features
    }

    /// Number of motions it has learnt from.
    pub fn n_motions(&self) -> usize {
        self.learnt.scores.len()
    }

    /// The scores it has learnt from.
    pub fn scores(&self) -> &[f64] {
        &self.learnt.scores
    }

    /// Least and greatest score there is.
    pub fn scale(&self) -> [f64; 2] {
        self.scale
    }

    /// The basis of postures.
    pub fn eigenpostures(&self) -> &Pca {
        &self.eigenpostures
    }

    /// The basis of motions, the thesis' Eigendives: those that a regression on principal components uses, or all.
    pub fn eigenmotions(&self) -> &Pca {
        &self.regression.eigenmotions
    }

    /// How scores are regressed on vectors.
    pub fn method(&self) -> RegressionMethod {
        self.regression.method
    }

    /// The number of components or the penalty that was requested, or that cross-validation chose.
    pub fn tuning(&self) -> Tuning {
        self.regression.tuning
    }

    /// What a unit of each Eigendive's weight adds to the score.
    pub fn coefficients(&self) -> &[f64] {
        &self.regression.coefficients
    }

    /// The score of the mean motion.
    pub fn intercept(&self) -> f64 {
        self.regression.intercept
    }

    /// Whether it has learnt from synthetic motions: then its scores say nothing about real ones.
    pub fn is_synthetic(&self) -> bool {
        self.synthetic
    }

    /// What goes into a motion's vector.
    pub fn vector_options(&self) -> &VectorOptions {
        &self.vector
    }
}

/// The features of the first motion, and all motions by them at the frames of their vectors.
pub(super) fn normalize(
    motions: &[Performance],
    options: &VectorOptions,
) -> Result<(Features, Vec<Normalized>), ScoringError> {
    expect_least("motions", motions.len(), 1)?;
    let features = motions[0].features().clone();
    let normalized = |(i, motion): (usize, &Performance)| {
        let of_motion = |source| ScoringError::Motion { motion: i, source: Box::new(source) };
        motion.normalized(&features, options.n_frames).map_err(of_motion)
    };
    let normalized = motions.iter().enumerate().map(normalized).collect::<Result<_, _>>()?;
    Ok((features, normalized))
}
