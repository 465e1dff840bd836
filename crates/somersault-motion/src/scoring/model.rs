//! From motions with scores to a score for a motion.

use super::regression::ComponentScores;
use super::vector::Normalized;
use super::{Performance, ScoringError, VectorOptions, expect_least, expect_length, expect_numbers};
use crate::analysis::{Pca, eigenpostures};
use nalgebra::DMatrix;

/// Choices for a scoring model.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ScoringOptions {
    /// What a motion's vector has.
    pub vector: VectorOptions,
    /// Components of the second PCA; none lets cross-validation choose.
    pub n_components: Option<usize>,
    /// The most that cross-validation may choose.
    pub max_components: usize,
}

impl ScoringOptions {
    /// The vector of the thesis; components by cross-validation, at most five.
    pub fn thesis() -> Self {
        Self { vector: VectorOptions::thesis(), n_components: None, max_components: 5 }
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
                return Err(ScoringError::Range { argument, allowed: "at least 1", found: 0.0 });
            }
        }
        expect_least("motions", n_motions, self.most().saturating_add(least))?;
        expect_length("scores", scores.len(), n_motions)?;
        expect_numbers("scores", scores)
    }

    /// The most components that are asked for.
    pub(super) fn most(&self) -> usize {
        self.n_components.unwrap_or(self.max_components)
    }
}

/// A trained model.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(try_from = "super::storage::Stored", into = "super::storage::Stored")]
pub struct ScoringModel {
    pub(super) vector: VectorOptions,
    /// The first PCA, of all frames.
    pub(super) eigenpostures: Pca,
    /// The second PCA, of the motions' vectors.
    pub(super) eigenmotions: Pca,
    pub(super) intercept: f64,
    pub(super) coefficients: Vec<f64>,
    pub(super) synthetic: bool,
}

impl ScoringModel {
    /// Learns from motions and their scores. There must be two motions more than components, so that one can be
    /// left out.
    pub fn train(
        motions: &[Performance],
        scores: &[f64],
        options: &ScoringOptions,
    ) -> Result<Self, ScoringError> {
        options.check(motions.len(), scores, 2)?;
        let motions_at = normalize(motions, &options.vector)?;
        let eigenpostures = eigenpostures_of(&motions_at, &options.vector, None)?;
        let vectors = options.vector.vectors(&eigenpostures, &motions_at)?;
        let eigenmotions = Pca::fit(&vectors, options.most())?;
        let total = eigenmotions.total_variance() * (scores.len() - 1) as f64;
        let components = ComponentScores::new(eigenmotions.scores(&vectors)?, vec![1.0; scores.len()], total);
        let n_components = options.n_components.unwrap_or_else(|| components.choose(scores));
        let mut coefficients = components.coefficients(scores);
        coefficients.truncate(n_components);
        let (intercept, eigenmotions) = (components.mean(scores), eigenmotions.truncated(n_components));
        let synthetic = motions.iter().any(Performance::is_synthetic);
        Ok(Self { vector: options.vector, eigenpostures, eigenmotions, intercept, coefficients, synthetic })
    }

    /// The score of a motion. Its postures must have as many numbers as those learnt from.
    pub fn score(&self, motion: &Performance) -> Result<f64, ScoringError> {
        let motion = motion.normalized(self.vector.n_frames)?;
        let vector = self.vector.vectors(&self.eigenpostures, std::slice::from_ref(&motion))?;
        let weights = self.eigenmotions.scores(&vector)?;
        Ok(self.intercept + weights.iter().zip(&self.coefficients).map(|(s, b)| s * b).sum::<f64>())
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

    /// Whether it has learnt from motions that are made up: then its scores say nothing about real ones.
    pub fn is_synthetic(&self) -> bool {
        self.synthetic
    }

    /// What goes into a motion's vector.
    pub fn vector_options(&self) -> &VectorOptions {
        &self.vector
    }
}

/// The motions at the frames of their vectors.
pub(super) fn normalize(
    motions: &[Performance],
    options: &VectorOptions,
) -> Result<Vec<Normalized>, ScoringError> {
    motions.iter().map(|motion| motion.normalized(options.n_frames)).collect()
}

/// The eigenpostures of all motions but the one left out.
pub(super) fn eigenpostures_of(
    motions: &[Normalized],
    options: &VectorOptions,
    left_out: Option<usize>,
) -> Result<Pca, ScoringError> {
    let learnt = motions.iter().enumerate().filter(|(i, _)| Some(*i) != left_out);
    let postures: Vec<DMatrix<f64>> = learnt.map(|(_, motion)| motion.postures.clone()).collect();
    let rows: usize = postures.iter().map(DMatrix::nrows).sum();
    let most = postures.first().map_or(0, DMatrix::ncols).min(rows.saturating_sub(1));
    if options.n_eigenweights > most {
        let (argument, found) = ("n_eigenweights", options.n_eigenweights);
        return Err(ScoringError::TooMany { argument, most, found });
    }
    Ok(eigenpostures::common(&postures, options.n_eigenweights)?)
}
