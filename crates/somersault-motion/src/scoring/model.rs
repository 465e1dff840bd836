//! From motions with scores to a score for a motion.

use super::{Performance, ScoringError, VectorOptions, expect_least, expect_length};
use crate::analysis::{Pca, eigenpostures};
use nalgebra::{DMatrix, DVector};

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

    /// The most components that are asked for.
    fn most(&self) -> usize {
        self.n_components.unwrap_or(self.max_components)
    }
}

/// A trained model.
#[derive(Debug, Clone, PartialEq)]
pub struct ScoringModel {
    pub(super) vector: VectorOptions,
    /// The first PCA, of all frames.
    pub(super) eigenpostures: Pca,
    /// The second PCA, of the motions' vectors.
    pub(super) eigenmotions: Pca,
    pub(super) intercept: f64,
    pub(super) coefficients: Vec<f64>,
}

impl ScoringModel {
    /// Learns from motions and their scores. There must be two motions more than components, so that one can be left out.
    pub fn train(
        motions: &[Performance],
        scores: &[f64],
        options: &ScoringOptions,
    ) -> Result<Self, ScoringError> {
        expect_least("components", options.most(), 1)?;
        expect_least("motions", motions.len(), options.most() + 2)?;
        expect_length("scores", scores.len(), motions.len())?;
        if !scores.iter().all(|s| s.is_finite()) {
            return Err(ScoringError::NonFinite { argument: "scores" });
        }
        let (eigenpostures, vectors) = describe(motions, &options.vector)?;
        let n_components = match options.n_components {
            Some(n) => n,
            None => choose_components(&vectors, scores, options.max_components)?,
        };
        let eigenmotions = Pca::fit(&vectors, n_components)?;
        let coefficients = regress(&eigenmotions, &vectors, scores)?;
        let intercept = mean(scores);
        Ok(Self { vector: options.vector, eigenpostures, eigenmotions, intercept, coefficients })
    }

    /// The score of a motion. Its postures must have as many numbers as those learnt from.
    pub fn score(&self, motion: &Performance) -> Result<f64, ScoringError> {
        let vector = self.vector.vector(&self.eigenpostures, motion)?;
        let weights =
            self.eigenmotions.scores(&DMatrix::from_row_slice(1, vector.len(), vector.as_slice()))?;
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

    /// What goes into a motion's vector.
    pub fn vector_options(&self) -> &VectorOptions {
        &self.vector
    }
}

/// The eigenpostures of motions and the vectors of the motions, a row each.
fn describe(motions: &[Performance], options: &VectorOptions) -> Result<(Pca, DMatrix<f64>), ScoringError> {
    let postures: Vec<DMatrix<f64>> = motions
        .iter()
        .map(|m| m.normalized(options.n_frames).map(|[postures, _]| postures))
        .collect::<Result<_, _>>()?;
    let eigenpostures = eigenpostures::common(&postures, options.n_eigenweights)?;
    let vectors: Vec<DVector<f64>> =
        motions.iter().map(|m| options.vector(&eigenpostures, m)).collect::<Result<_, _>>()?;
    let rows: Vec<_> = vectors.iter().map(DVector::transpose).collect();
    Ok((eigenpostures, DMatrix::from_rows(&rows)))
}

fn mean(x: &[f64]) -> f64 {
    x.iter().sum::<f64>() / x.len() as f64
}

/// Coefficients of least squares. Scores of components are orthogonal, so each is found by itself and does not depend on
/// how many there are.
fn regress(pca: &Pca, vectors: &DMatrix<f64>, scores: &[f64]) -> Result<Vec<f64>, ScoringError> {
    let weights = pca.scores(vectors)?;
    let offset = mean(scores);
    let coefficient = |(column, variance): (nalgebra::DVectorView<f64>, &f64)| {
        let product: f64 = column.iter().zip(scores).map(|(w, s)| w * (s - offset)).sum();
        // a component without variance says nothing
        let known = *variance > 1e-20 * pca.total_variance();
        if known { product / (variance * (scores.len() - 1) as f64) } else { 0.0 }
    };
    Ok(weights.column_iter().zip(pca.explained_variance()).map(coefficient).collect())
}

/// The number of components, up to `most`, with the least squared error of leaving one motion out. The eigenpostures stay:
/// they know nothing of scores.
fn choose_components(vectors: &DMatrix<f64>, scores: &[f64], most: usize) -> Result<usize, ScoringError> {
    let mut errors = vec![0.0; most];
    for left_out in 0..scores.len() {
        let rest = vectors.clone().remove_row(left_out);
        let mut known = scores.to_vec();
        let score = known.remove(left_out);
        let pca = Pca::fit(&rest, most)?;
        let coefficients = regress(&pca, &rest, &known)?;
        let weights = pca.scores(&vectors.rows(left_out, 1).into_owned())?;
        let mut predicted = mean(&known);
        for k in 0..most {
            predicted += weights[(0, k)] * coefficients[k];
            errors[k] += (predicted - score).powi(2);
        }
    }
    let best = (0..most).min_by(|&a, &b| errors[a].total_cmp(&errors[b]));
    Ok(best.map_or(1, |k| k + 1))
}
