//! Linear regression on principal components, of motions that may count more than once.
//!
//! The scores s_k of the motions in their components are orthogonal, Σ_i c_i s_ik s_il = 0 for k ≠ l with c the
//! counts, so each coefficient is found by itself and does not depend on how many there are:
//!
//! ```text
//! b_k = Σ_i c_i s_ik (y_i − ȳ) / λ_k,   λ_k = Σ_i c_i s_ik²
//! ```
//! For validation the same is had from the Gram matrix of the motions' vectors, n × n, by the eigenvectors of
//! its weighted and centred part: a model without a motion, or of a resample, then costs O(n³) whatever the
//! length of the vectors.

use super::options::ScoringOptions;
use crate::analysis::{AnalysisError, Pca};
use nalgebra::{DMatrix, SymmetricEigen};

/// Motions in their principal components.
pub(super) struct ComponentScores {
    /// A row for each motion, a column for each component.
    scores: DMatrix<f64>,
    /// λ; zero where a component has no variance to speak of.
    squares: Vec<f64>,
    counts: Vec<f64>,
}

/// Fraction of the variance below which a component says nothing: what rounding leaves of it.
const NOTHING: f64 = 1e-13;

impl ComponentScores {
    /// Of motions' vectors in their components, each counted once.
    pub(super) fn of(eigenmotions: &Pca, vectors: &DMatrix<f64>) -> Result<Self, AnalysisError> {
        let n = vectors.nrows();
        let total = eigenmotions.total_variance() * (n - 1) as f64;
        Ok(Self::new(eigenmotions.scores(vectors)?, vec![1.0; n], total))
    }

    /// `total` is the sum of the squares in all directions.
    pub(super) fn new(scores: DMatrix<f64>, counts: Vec<f64>, total: f64) -> Self {
        let square = |column: nalgebra::DVectorView<f64>| -> f64 {
            let square = column.iter().zip(&counts).map(|(s, c)| c * s * s).sum();
            if square > NOTHING * total { square } else { 0.0 }
        };
        let squares = scores.column_iter().map(square).collect();
        Self { scores, squares, counts }
    }

    pub(super) fn mean(&self, y: &[f64]) -> f64 {
        let sums = y.iter().zip(&self.counts).fold([0.0; 2], |[sum, n], (y, c)| [sum + c * y, n + c]);
        sums[0] / sums[1]
    }

    /// b.
    pub(super) fn coefficients(&self, y: &[f64]) -> Vec<f64> {
        let mean = self.mean(y);
        let coefficient = |(column, square): (nalgebra::DVectorView<f64>, &f64)| {
            let terms = column.iter().zip(&self.counts).zip(y);
            let product: f64 = terms.map(|((s, c), y)| c * s * (y - mean)).sum();
            if *square > 0.0 { product / square } else { 0.0 }
        };
        self.scores.column_iter().zip(&self.squares).map(coefficient).collect()
    }

    /// The number of components with the least squared error of leaving one motion out, by its leverage h: e/(1
    /// − c h). The components themselves stay: they do not depend on y.
    pub(super) fn choose(&self, y: &[f64]) -> usize {
        let (mean, coefficients) = (self.mean(y), self.coefficients(y));
        let total: f64 = self.counts.iter().sum();
        let mut errors: Vec<f64> = y.iter().map(|y| y - mean).collect();
        let mut leverages = vec![1.0 / total; y.len()];
        let mut best = (f64::INFINITY, 1);
        for (k, (column, square)) in self.scores.column_iter().zip(&self.squares).enumerate() {
            if *square == 0.0 {
                break;
            }
            let mut press = 0.0;
            for (i, s) in column.iter().enumerate() {
                errors[i] -= coefficients[k] * s;
                leverages[i] += s * s / square;
                // a motion that alone decides a coefficient cannot be predicted without it
                let rest = (1.0 - self.counts[i] * leverages[i]).max(f64::EPSILON);
                press += self.counts[i] * (errors[i] / rest).powi(2);
            }
            if press < best.0 {
                best = (press, k + 1);
            }
        }
        best.1
    }
}

/// Scores over the principal components of motions' vectors, each counted once.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Regression {
    /// The components.
    pub(super) eigenmotions: Pca,
    /// The mean of the scores.
    pub(super) intercept: f64,
    /// b.
    pub(super) coefficients: Vec<f64>,
}

impl Regression {
    /// Of the components requested, or as many as cross-validation chooses, but two less than motions at most.
    pub(super) fn of(
        vectors: &DMatrix<f64>,
        scores: &[f64],
        options: &ScoringOptions,
    ) -> Result<Self, AnalysisError> {
        let most = options.most().min(vectors.nrows().saturating_sub(2)).max(1);
        let eigenmotions = Pca::fit(vectors, most)?;
        let components = ComponentScores::of(&eigenmotions, vectors)?;
        let n_components = options.n_components.unwrap_or_else(|| components.choose(scores));
        let mut coefficients = components.coefficients(scores);
        coefficients.truncate(n_components);
        let eigenmotions = eigenmotions.truncated(n_components);
        Ok(Self { eigenmotions, intercept: components.mean(scores), coefficients })
    }

    /// The score of each row of `vectors`.
    pub(super) fn predict(&self, vectors: &DMatrix<f64>) -> Result<Vec<f64>, AnalysisError> {
        let weights = self.eigenmotions.scores(vectors)?;
        let score = |weights: nalgebra::RowDVector<f64>| {
            self.intercept + weights.iter().zip(&self.coefficients).map(|(s, b)| s * b).sum::<f64>()
        };
        Ok(weights.row_iter().map(|row| score(row.into_owned())).collect())
    }
}

/// A motion left out, seen from the others.
pub(super) struct LeftOut {
    others: Vec<usize>,
    components: ComponentScores,
    /// Its own scores in the components of the others.
    own: Vec<f64>,
}

impl LeftOut {
    /// Motion `motion` against the others with their `counts`, in at most `most` components. None where fewer
    /// than three others count: two have one direction, and no error.
    pub(super) fn new(gram: &DMatrix<f64>, counts: &[f64], motion: usize, most: usize) -> Option<Self> {
        let others: Vec<usize> = (0..counts.len()).filter(|&i| i != motion && counts[i] > 0.0).collect();
        let n = others.len();
        if n < 3 {
            return None;
        }
        let weights: Vec<f64> = others.iter().map(|&i| counts[i]).collect();
        let total: f64 = weights.iter().sum();
        let mean_of = |i: usize| -> f64 {
            others.iter().zip(&weights).map(|(&j, c)| c * gram[(i, j)]).sum::<f64>() / total
        };
        let means: Vec<f64> = others.iter().map(|&i| mean_of(i)).collect();
        let mean = means.iter().zip(&weights).map(|(m, c)| c * m).sum::<f64>() / total;
        let centred = DMatrix::from_fn(n, n, |a, b| {
            let product = gram[(others[a], others[b])] - means[a] - means[b] + mean;
            product * (weights[a] * weights[b]).sqrt()
        });
        let trace = centred.trace();
        let eigen = SymmetricEigen::new(centred);
        let mut order: Vec<usize> = (0..n).collect();
        order.sort_by(|&a, &b| eigen.eigenvalues[b].total_cmp(&eigen.eigenvalues[a]));
        order.truncate(most.min(n - 2));
        let root = |k: usize| eigen.eigenvalues[order[k]].max(0.0).sqrt();
        let scores = DMatrix::from_fn(n, order.len(), |a, k| {
            eigen.eigenvectors[(a, order[k])] * root(k) / weights[a].sqrt()
        });
        let mean_own = mean_of(motion);
        let components = ComponentScores::new(scores, weights, trace);
        let own = (0..order.len()).map(|k| {
            if components.squares[k] == 0.0 {
                return 0.0;
            }
            let against = |a: usize| gram[(motion, others[a])] - means[a] - mean_own + mean;
            let column = eigen.eigenvectors.column(order[k]);
            (0..n).map(|a| against(a) * components.counts[a].sqrt() * column[a]).sum::<f64>() / root(k)
        });
        let own = own.collect();
        Some(Self { others, components, own })
    }

    /// The mean of the others' scores, what the prediction differs by from it, and the components it used:
    /// those given, or chosen by cross-validation among the others.
    pub(super) fn predict(&self, scores: &[f64], n_components: Option<usize>) -> (f64, f64, usize) {
        let y: Vec<f64> = self.others.iter().map(|&i| scores[i]).collect();
        let n = n_components.unwrap_or_else(|| self.components.choose(&y)).min(self.own.len());
        let coefficients = self.components.coefficients(&y);
        let difference = coefficients.iter().zip(&self.own).take(n).map(|(b, s)| b * s).sum();
        (self.components.mean(&y), difference, n)
    }
}
