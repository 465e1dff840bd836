//! From motions with scores to a score for a motion.

use super::learnt::{self, Basis, Heading};
use super::regression::ComponentScores;
use super::vector::Normalized;
use super::{Features, Performance, ScoringError, VectorOptions};
use crate::analysis::Pca;
use nalgebra::DMatrix;
use somersault_core::argument::{ArgumentError, expect_least, expect_length, expect_squarable};

/// Choices for a scoring model.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ScoringOptions {
    /// What a motion's vector has.
    pub vector: VectorOptions,
    /// Components of the second PCA; none lets cross-validation choose.
    pub n_components: Option<usize>,
    /// The most that cross-validation may choose.
    pub max_components: usize,
    /// Least and greatest score there is. What is learnt from must be within; what is predicted may not be.
    pub scale: [f64; 2],
}

impl ScoringOptions {
    /// The vector of the thesis; components by cross-validation, at most five; scores from 0 to 10, as in diving.
    pub fn thesis() -> Self {
        Self { vector: VectorOptions::thesis(), n_components: None, max_components: 5, scale: [0.0, 10.0] }
    }

    /// Fails unless the scale is one and all scores are on it.
    pub fn expect_scale(&self, scores: &[f64]) -> Result<(), ScoringError> {
        let [least, greatest] = self.scale;
        if !(least < greatest && least.is_finite() && greatest.is_finite()) {
            return Err(ScoringError::Scale { least, greatest });
        }
        match scores.iter().position(|score| !(least..=greatest).contains(score)) {
            Some(motion) => {
                Err(ScoringError::OutsideScale { motion, found: scores[motion], least, greatest })
            }
            None => Ok(()),
        }
    }

    /// Fails unless every motion has a score, and there are as many as `least` beside the components.
    pub(super) fn check(&self, n_motions: usize, scores: &[f64], least: usize) -> Result<(), ScoringError> {
        let argument = if self.n_components.is_some() { "n_components" } else { "max_components" };
        for (argument, found) in [
            (argument, self.most()),
            ("n_frames", self.vector.n_frames),
            ("n_eigenweights", self.vector.n_eigenweights),
        ] {
            if found == 0 {
                return Err(ArgumentError::OutOfRange { argument, allowed: "at least 1", found: 0.0 }.into());
            }
        }
        expect_least("motions", n_motions, self.most().saturating_add(least))?;
        expect_length("scores", scores.len(), n_motions)?;
        expect_squarable("scores", scores)?;
        self.expect_scale(scores)
    }

    /// The most components that are requested.
    pub(super) fn most(&self) -> usize {
        self.n_components.unwrap_or(self.max_components)
    }
}

/// What a model was taught.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Learnt {
    /// The motions' vectors, a row each.
    pub(super) vectors: DMatrix<f64>,
    /// Their distances to the others, each left out.
    pub(super) distances: Vec<f64>,
    /// Their scores.
    pub(super) scores: Vec<f64>,
    /// Least and greatest size of markers, m.
    pub(super) sizes: [f64; 2],
}

/// A score, and how far the motion is from the training motions.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Score {
    /// The score. It may be beyond the scale, since the regression is a straight line.
    pub value: f64,
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
    /// The second PCA, of the motions' vectors.
    pub(super) eigenmotions: Pca,
    pub(super) intercept: f64,
    pub(super) coefficients: Vec<f64>,
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
        options.check(motions.len(), scores, 2)?;
        let (features, motions_at) = normalize(motions, &options.vector)?;
        let sizes = learnt::sizes(features.kind, &motions_at)?;
        let basis = Basis::of(features.kind, &motions_at, &options.vector, |_| false)?;
        let vectors = basis.describe(&options.vector, &motions_at)?.vectors;
        let distances = learnt::distances(features.kind, &motions_at, &options.vector)?;
        let eigenmotions = Pca::fit(&vectors, options.most())?;
        let components = ComponentScores::of(&eigenmotions, &vectors)?;
        let n_components = options.n_components.unwrap_or_else(|| components.choose(scores));
        let mut coefficients = components.coefficients(scores);
        coefficients.truncate(n_components);
        Ok(Self {
            vector: options.vector,
            features,
            heading: basis.heading,
            eigenpostures: basis.eigenpostures,
            eigenmotions: eigenmotions.truncated(n_components),
            intercept: components.mean(scores),
            coefficients,
            scale: options.scale,
            learnt: Learnt { vectors, distances, scores: scores.to_vec(), sizes },
            synthetic: motions.iter().any(Performance::is_synthetic),
        })
    }

    /// The score of a motion, which must have the features learnt, by name. Fails where its markers are more than twice as far apart
    /// as the training motions, or less than half: they are in another unit.
    pub fn score(&self, motion: &Performance) -> Result<Score, ScoringError> {
        let motion = motion.normalized(&self.features, self.vector.n_frames)?;
        learnt::expect_size(self.features.kind, &motion, None, self.learnt.sizes)?;
        let (vector, rest) = self.vector.vector(&self.eigenpostures, &self.heading.turned(&motion))?;
        let weights = self.eigenmotions.scores(&DMatrix::from_rows(std::slice::from_ref(&vector)))?;
        let value = self.intercept + weights.iter().zip(&self.coefficients).map(|(s, b)| s * b).sum::<f64>();
        let nearest = learnt::distance(&vector, rest, &self.learnt.vectors, |_| true);
        Ok(Score { value, distance: nearest / learnt::greatest(&self.learnt.distances) })
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

    /// The basis of motions, the thesis' Eigendives.
    pub fn eigenmotions(&self) -> &Pca {
        &self.eigenmotions
    }

    /// What a unit of each Eigendive's weight adds to the score.
    pub fn coefficients(&self) -> &[f64] {
        &self.coefficients
    }

    /// The score of the mean motion.
    pub fn intercept(&self) -> f64 {
        self.intercept
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
