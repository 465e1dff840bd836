//! Principal components.
//!
//! ```text
//! X − 1 x̄ᵀ = U S Vᵀ,    components: columns of V,    scores: (X − 1 x̄ᵀ) V,    variances: S²/(n − 1)
//! ```
//! for n samples, the rows of X. By singular values of the triangle of its QR factors, never of XᵀX: small components keep
//! their digits, all singular values are accurate to a rounding of the largest. The sign of a component is chosen so that
//! its largest entry is positive, as in scikit-learn.
//!
//! Source: I. T. Jolliffe, *Principal Component Analysis*, Springer 2002.

use super::{AnalysisError, expect_finite};
use crate::singular::SingularValues;
use nalgebra::{DMatrix, DVector};
use somersault_core::argument::{expect_least, expect_length};

/// Mean and principal components of samples.
///
/// ```
/// use nalgebra::DMatrix;
/// use somersault_motion::analysis::Pca;
///
/// // points near a line
/// let samples = DMatrix::from_row_slice(4, 2, &[0.0, 0.1, 1.0, 0.9, 2.0, 2.1, 3.0, 2.9]);
/// let pca = Pca::fit(&samples, 1)?;
/// assert!(pca.explained_variance_ratio()[0] > 0.99);
/// # Ok::<(), somersault_motion::analysis::AnalysisError>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Pca {
    mean: DVector<f64>,
    components: DMatrix<f64>,
    variance: Vec<f64>,
    total_variance: f64,
    n_samples: usize,
}

/// What rounding may leave of the components' products.
const ORTHONORMAL: f64 = 1e-9;

impl Pca {
    /// The first `n_components` of `samples`, a sample in each row. At least one component, at most one less
    /// than there are samples. Cost O(n p min(n, p)).
    pub fn fit(samples: &DMatrix<f64>, n_components: usize) -> Result<Self, AnalysisError> {
        let (n, p) = samples.shape();
        expect_least("samples", n, 2)?;
        let most = (n - 1).min(p);
        if n_components == 0 || n_components > most {
            return Err(AnalysisError::Components {
                argument: "n_components",
                found: n_components,
                most,
                samples: n,
                features: p,
            });
        }
        expect_finite("samples", samples)?;
        let mean = samples.row_mean().transpose();
        let (singular, mut components) = right_singular_vectors(samples, &mean, n_components)?;
        let total: f64 = singular.iter().map(|s| s * s).sum();
        // what is left of equal samples after their mean is rounding
        if total.sqrt() <= 1e-14 * (total + n as f64 * mean.norm_squared()).sqrt() {
            return Err(AnalysisError::NoVariance);
        }
        for mut component in components.column_iter_mut() {
            if component[component.iamax()] < 0.0 {
                component.neg_mut();
            }
        }
        let variance = singular[..n_components].iter().map(|s| s * s / (n - 1) as f64).collect();
        Ok(Self { mean, components, variance, total_variance: total / (n - 1) as f64, n_samples: n })
    }

    /// From its parts, as files hold them: `components` has a column of unit length for each, perpendicular to all others;
    /// `variance` falls, is not negative, and adds up to `total_variance` at most.
    pub fn from_parts(
        mean: DVector<f64>,
        components: DMatrix<f64>,
        variance: Vec<f64>,
        total_variance: f64,
        n_samples: usize,
    ) -> Result<Self, AnalysisError> {
        expect_length("rows of components", components.nrows(), mean.len())?;
        expect_length("variance", variance.len(), components.ncols())?;
        expect_finite("components", &components)?;
        if !mean.iter().chain(&variance).chain([&total_variance]).all(|x| x.is_finite()) {
            return Err(AnalysisError::NonFinite { argument: "mean or variance", row: 0 });
        }
        let part = |argument, allowed| Err(AnalysisError::Parts { argument, allowed });
        if n_samples < 2 {
            return part("n_samples", "at least 2");
        }
        let k = components.ncols();
        if k == 0 || k > (n_samples - 1).min(mean.len()) {
            return part(
                "components",
                "at least one, less than samples and at most as many as numbers in one",
            );
        }
        if (components.tr_mul(&components) - DMatrix::identity(k, k)).amax() > ORTHONORMAL {
            return part("components", "of unit length and perpendicular to each other, to 1e-9");
        }
        if variance.windows(2).any(|v| v[1] > v[0]) || variance[k - 1] < 0.0 {
            return part("variance", "falling and not negative");
        }
        if !(total_variance > 0.0 && variance.iter().sum::<f64>() <= total_variance * (1.0 + ORTHONORMAL)) {
            return part("total_variance", "positive, and at least what the components have");
        }
        Ok(Self { mean, components, variance, total_variance, n_samples })
    }

    /// The first `n` components alone, at most as many as there are.
    pub(crate) fn truncated(mut self, n: usize) -> Self {
        let n = n.min(self.n_components());
        self.components = self.components.columns(0, n).into_owned();
        self.variance.truncate(n);
        self
    }

    /// Mean of the samples.
    pub fn mean(&self) -> &DVector<f64> {
        &self.mean
    }

    /// The components, a column of unit length each, that of the largest variance first.
    pub fn components(&self) -> &DMatrix<f64> {
        &self.components
    }

    /// Number of components.
    pub fn n_components(&self) -> usize {
        self.components.ncols()
    }

    /// Number of samples it is of.
    pub fn n_samples(&self) -> usize {
        self.n_samples
    }

    /// Variance of the scores of each component, with n − 1 in the denominator.
    pub fn explained_variance(&self) -> &[f64] {
        &self.variance
    }

    /// Variance of the samples in all directions.
    pub fn total_variance(&self) -> f64 {
        self.total_variance
    }

    /// Fraction of each component in the variance of the samples.
    pub fn explained_variance_ratio(&self) -> Vec<f64> {
        self.variance.iter().map(|v| v / self.total_variance).collect()
    }

    /// What `samples` are in the components: a row for each, (x − x̄)ᵀ V.
    pub fn scores(&self, samples: &DMatrix<f64>) -> Result<DMatrix<f64>, AnalysisError> {
        expect_length("columns of samples", samples.ncols(), self.mean.len())?;
        expect_finite("samples", samples)?;
        let mut scores = samples * &self.components;
        let offset = self.components.tr_mul(&self.mean);
        for (mut column, offset) in scores.column_iter_mut().zip(&offset) {
            column.add_scalar_mut(-offset);
        }
        Ok(scores)
    }

    /// The samples that have these scores: x̄ + V s, in rows.
    pub fn reconstruct(&self, scores: &DMatrix<f64>) -> Result<DMatrix<f64>, AnalysisError> {
        expect_length("columns of scores", scores.ncols(), self.n_components())?;
        expect_finite("scores", scores)?;
        let mut samples = scores * self.components.transpose();
        for (mut column, mean) in samples.column_iter_mut().zip(&self.mean) {
            column.add_scalar_mut(*mean);
        }
        Ok(samples)
    }
}

/// All singular values of the centred samples, and the first `k` right singular vectors as columns.
fn right_singular_vectors(
    samples: &DMatrix<f64>,
    mean: &DVector<f64>,
    k: usize,
) -> Result<(Vec<f64>, DMatrix<f64>), AnalysisError> {
    // the long side of the matrix along its columns, which lie together in memory: of long samples the transpose
    let (n, p) = samples.shape();
    let mut centred = if p > n { samples.transpose() } else { samples.clone() };
    if p > n {
        centred.column_iter_mut().for_each(|mut sample| sample -= mean);
    } else {
        centred.column_iter_mut().zip(mean).for_each(|(mut column, mean)| column.add_scalar_mut(-mean));
    }
    let factors = centred.qr();
    let triangle = if p > n { factors.r().transpose() } else { factors.r() };
    let SingularValues { values, vectors, .. } =
        SingularValues::of(triangle).ok_or(AnalysisError::NoConvergence)?;
    let vectors = vectors.columns(0, k);
    Ok((values, if p > n { factors.q() * vectors } else { vectors.into_owned() }))
}
