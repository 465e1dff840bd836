//! Models as JSON: versioned, and checked when they come back. Numbers keep all their digits.

use super::learnt::Heading;
use super::model::Learnt;
use super::regression::Regression;
use super::{FeatureKind, Features, RegressionMethod, ScoringModel, ScoringOptions, Tuning, VectorOptions};
use crate::analysis::{AnalysisError, Pca};
use crate::recording::expect_unique;
use nalgebra::{DMatrix, DVector};
use serde::{Deserialize, Serialize};
use somersault_core::argument::expect_length;

const FORMAT: &str = "somersault scoring model";
const VERSION: u32 = 4;
/// What lengths and axes of a model are in, and where it faces.
const CONVENTION: [&str; 3] = ["m", "z", "turned about z to the nearest to the reference"];
/// Rounding of numbers that follow from others.
const ROUNDING: f64 = 1e-9;

/// Why text is not a model.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum StorageError {
    /// Not JSON, or without something that a model has.
    #[error("line {line}: not a scoring model: {reason}")]
    Json {
        /// Line, from 1.
        line: usize,
        /// What the parser says.
        reason: String,
    },
    /// Another format, or a version that this one does not know.
    #[error("found `{format}` of version {version}, allowed is `{FORMAT}` of version {VERSION}")]
    Version {
        /// Format found.
        format: String,
        /// Version found.
        version: u32,
    },
    /// Numbers that follow from each other do not.
    #[error("`{part}` of the model must be {allowed}")]
    Sense {
        /// Name of the part.
        part: &'static str,
        /// What it may be.
        allowed: &'static str,
    },
    /// The parts do not fit together.
    #[error("the parts of the model do not fit: {0}")]
    Parts(#[from] AnalysisError),
}

#[derive(Serialize, Deserialize)]
struct StoredPca {
    mean: Vec<f64>,
    /// Component by component.
    components: Vec<Vec<f64>>,
    variance: Vec<f64>,
    total_variance: f64,
    n_samples: usize,
}

#[derive(Serialize, Deserialize)]
struct StoredHeading {
    convention: String,
    /// The reference, frame by frame.
    postures: Vec<Vec<f64>>,
    path: Vec<Vec<f64>>,
}

#[derive(Serialize, Deserialize)]
struct StoredLearnt {
    scores: Vec<f64>,
    /// Distances of the motions to the others.
    distances: Vec<f64>,
    /// Scores less predictions of models that have not seen the motions.
    errors: Vec<f64>,
    /// Least and greatest size of markers, m.
    sizes: [f64; 2],
    /// Motion by motion.
    vectors: Vec<Vec<f64>>,
}

#[derive(Serialize, Deserialize)]
pub(super) struct Stored {
    format: String,
    version: u32,
    /// Whether it has learnt from synthetic motions.
    synthetic: bool,
    features: Features,
    /// Of lengths.
    unit: String,
    up: String,
    heading: StoredHeading,
    vector: VectorOptions,
    /// Least and greatest score.
    scale: [f64; 2],
    method: RegressionMethod,
    tuning: Tuning,
    intercept: f64,
    coefficients: Vec<f64>,
    eigenpostures: StoredPca,
    eigenmotions: StoredPca,
    learnt: StoredLearnt,
}

/// What every version has.
#[derive(Deserialize)]
struct Head {
    format: String,
    version: u32,
}

impl From<&Pca> for StoredPca {
    fn from(pca: &Pca) -> Self {
        Self {
            mean: pca.mean().as_slice().to_vec(),
            components: pca.components().column_iter().map(|c| c.iter().copied().collect()).collect(),
            variance: pca.explained_variance().to_vec(),
            total_variance: pca.total_variance(),
            n_samples: pca.n_samples(),
        }
    }
}

impl StoredPca {
    fn pca(self) -> Result<Pca, AnalysisError> {
        for component in &self.components {
            expect_length("entries of a component", component.len(), self.mean.len())?;
        }
        let components = DMatrix::from_vec(self.mean.len(), self.components.len(), self.components.concat());
        Pca::from_parts(
            DVector::from_vec(self.mean),
            components,
            self.variance,
            self.total_variance,
            self.n_samples,
        )
    }
}

fn expect_format(format: String, version: u32) -> Result<(), StorageError> {
    if format == FORMAT && version == VERSION {
        Ok(())
    } else {
        Err(StorageError::Version { format, version })
    }
}

fn json_error(error: serde_json::Error) -> StorageError {
    StorageError::Json { line: error.line(), reason: error.to_string() }
}

impl ScoringModel {
    /// The model as JSON.
    pub fn to_json(&self) -> Result<String, StorageError> {
        serde_json::to_string_pretty(&Stored::from(self.clone())).map_err(json_error)
    }

    /// The model that [`to_json`](Self::to_json) wrote.
    pub fn from_json(text: &str) -> Result<Self, StorageError> {
        let Head { format, version } = serde_json::from_str(text).map_err(json_error)?;
        expect_format(format, version)?;
        serde_json::from_str::<Stored>(text).map_err(json_error)?.try_into()
    }
}

/// The rows of a matrix.
fn rows_of(m: &DMatrix<f64>) -> Vec<Vec<f64>> {
    m.row_iter().map(|row| row.iter().copied().collect()).collect()
}

/// A matrix from its rows, so many by so many and finite.
fn matrix(
    part: &'static str,
    rows: &[Vec<f64>],
    shape: (usize, usize),
) -> Result<DMatrix<f64>, StorageError> {
    let expect = |part, found, expected| expect_length(part, found, expected).map_err(AnalysisError::from);
    expect(part, rows.len(), shape.0)?;
    rows.iter().try_for_each(|row| expect(part, row.len(), shape.1))?;
    let found = DMatrix::from_row_iterator(shape.0, shape.1, rows.iter().flatten().copied());
    crate::analysis::expect_finite(part, &found)?;
    Ok(found)
}

impl From<ScoringModel> for Stored {
    fn from(model: ScoringModel) -> Self {
        let [unit, up, convention] = CONVENTION.map(str::to_owned);
        Self {
            format: FORMAT.to_owned(),
            version: VERSION,
            synthetic: model.synthetic,
            unit,
            up,
            heading: StoredHeading {
                convention,
                postures: rows_of(&model.heading.postures),
                path: rows_of(&model.heading.path),
            },
            features: model.features,
            vector: model.vector,
            scale: model.scale,
            eigenpostures: (&model.eigenpostures).into(),
            eigenmotions: (&model.regression.eigenmotions).into(),
            method: model.regression.method,
            tuning: model.regression.tuning,
            intercept: model.regression.intercept,
            coefficients: model.regression.coefficients,
            learnt: StoredLearnt {
                scores: model.learnt.scores,
                distances: model.learnt.distances,
                errors: model.learnt.errors,
                sizes: model.learnt.sizes,
                vectors: rows_of(&model.learnt.vectors),
            },
        }
    }
}

impl TryFrom<Stored> for ScoringModel {
    type Error = StorageError;

    fn try_from(stored: Stored) -> Result<Self, StorageError> {
        let Stored { format, version, .. } = stored;
        expect_format(format, version)?;
        let found = [&stored.unit, &stored.up, &stored.heading.convention];
        if found.iter().zip(CONVENTION).any(|(found, known)| *found != known) {
            return sense("unit, up and heading", "those of this version");
        }
        let (vector, coefficients, features) = (stored.vector, stored.coefficients, stored.features);
        expect_unique(features.names.iter().map(String::as_str)).map_err(AnalysisError::from)?;
        let (eigenpostures, eigenmotions) = (stored.eigenpostures.pca()?, stored.eigenmotions.pca()?);
        let expect =
            |part, found, expected| expect_length(part, found, expected).map_err(AnalysisError::from);
        expect("names of features", eigenpostures.mean().len(), features.n_numbers())?;
        expect("eigenpostures", eigenpostures.n_components(), vector.n_eigenweights)?;
        expect("entries of a motion's vector", eigenmotions.mean().len(), vector.length())?;
        expect("coefficients", coefficients.len(), eigenmotions.n_components())?;
        if vector.n_frames == 0 {
            return Err(AnalysisError::Parts { argument: "n_frames", allowed: "at least 1" }.into());
        }
        let heading = Heading {
            kind: features.kind,
            postures: matrix("heading", &stored.heading.postures, (vector.n_frames, features.n_numbers()))?,
            path: matrix("heading", &stored.heading.path, (vector.n_frames, 3))?,
        };
        let StoredLearnt { scores, distances, errors, sizes, vectors } = stored.learnt;
        let n = scores.len();
        let learnt = Learnt {
            vectors: matrix("vectors", &vectors, (n, vector.length()))?,
            distances,
            errors,
            scores,
            sizes,
        };
        let Stored { method, tuning, intercept, synthetic, scale, .. } = stored;
        let model = Self {
            vector,
            features,
            heading,
            eigenpostures,
            regression: Regression { eigenmotions, intercept, coefficients, method, tuning },
            scale,
            learnt,
            synthetic,
        };
        model.expect_sense()?;
        Ok(model)
    }
}

fn sense<T>(part: &'static str, allowed: &'static str) -> Result<T, StorageError> {
    Err(StorageError::Sense { part, allowed })
}

impl ScoringModel {
    /// Fails unless what follows from the training motions does: means, components and coefficients, by the formulas by which they were
    /// found.
    fn expect_sense(&self) -> Result<(), StorageError> {
        let Learnt { vectors, distances, errors, scores, sizes } = &self.learnt;
        let Regression { eigenmotions, intercept, coefficients, method, tuning } = &self.regression;
        let n = scores.len();
        expect_length("distances", distances.len(), n).map_err(AnalysisError::from)?;
        expect_length("errors", errors.len(), n).map_err(AnalysisError::from)?;
        if !errors.iter().all(|error| error.is_finite()) {
            return sense("errors", "finite");
        }
        if !distances.iter().all(|d| *d >= 0.0 && d.is_finite()) {
            return sense("distances", "finite and not negative");
        }
        let markers = self.features.kind == FeatureKind::Markers;
        if !(sizes[0] <= sizes[1] && sizes[1].is_finite() && (sizes[0] > 0.0 || !markers)) {
            return sense("sizes", "positive, finite and growing");
        }
        let scale = ScoringOptions { scale: self.scale, ..ScoringOptions::thesis() };
        if scale.expect_scale(scores).is_err() {
            return sense("scores", "within the scale, whose ends grow");
        }
        if eigenmotions.n_samples() != n || self.eigenpostures.n_samples() != n * self.vector.n_frames {
            return sense("n_samples", "the number of motions, and of their frames");
        }
        let mean = vectors.row_mean().transpose();
        let size = vectors.amax();
        if (mean - eigenmotions.mean()).amax() > ROUNDING * size {
            return sense("eigenmotions.mean", "the mean of the vectors");
        }
        let is_tuning = match (method, tuning) {
            (RegressionMethod::Ridge, Tuning::Penalty(penalty)) => *penalty > 0.0 && penalty.is_finite(),
            (RegressionMethod::Ridge, _) | (_, Tuning::Penalty(_)) => false,
            (RegressionMethod::PrincipalComponents, Tuning::Components(k)) => *k == coefficients.len(),
            (RegressionMethod::PartialLeastSquares, Tuning::Components(k)) => (1..n).contains(k),
        };
        if !is_tuning {
            return sense(
                "tuning",
                "that of its method: components that there can be, or a positive penalty",
            );
        }
        let (mean_score, expected) = self.regression.expected(vectors, scores)?;
        let near = |found: f64, expected: f64, of: f64| (found - expected).abs() <= ROUNDING * of;
        let width = self.scale[1] - self.scale[0];
        if !near(*intercept, mean_score, self.scale[0].abs().max(width)) {
            return sense("intercept", "the mean of the scores");
        }
        let deviations = eigenmotions.explained_variance().iter().map(|v| v.sqrt());
        let mut all = coefficients.iter().zip(&expected).zip(deviations);
        // what a deviation of a component is worth in points
        if !all.all(|((found, expected), deviation)| near(found * deviation, expected * deviation, width)) {
            return sense("coefficients", "those of the regression of the scores on the vectors");
        }
        Ok(())
    }
}
