//! Models as JSON: versioned, and checked when they come back. Numbers keep all their digits.

use super::{ScoringModel, VectorOptions};
use crate::analysis::{AnalysisError, Pca};
use nalgebra::{DMatrix, DVector};
use serde::{Deserialize, Serialize};

const FORMAT: &str = "somersault scoring model";
const VERSION: u32 = 1;

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
pub(super) struct Stored {
    format: String,
    version: u32,
    /// Whether it has learnt from motions that are made up.
    synthetic: bool,
    vector: VectorOptions,
    eigenpostures: StoredPca,
    eigenmotions: StoredPca,
    intercept: f64,
    coefficients: Vec<f64>,
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
            crate::analysis::expect_length("entries of a component", component.len(), self.mean.len())?;
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

impl From<ScoringModel> for Stored {
    fn from(model: ScoringModel) -> Self {
        Self {
            format: FORMAT.to_owned(),
            version: VERSION,
            synthetic: model.synthetic,
            vector: model.vector,
            eigenpostures: (&model.eigenpostures).into(),
            eigenmotions: (&model.eigenmotions).into(),
            intercept: model.intercept,
            coefficients: model.coefficients,
        }
    }
}

impl TryFrom<Stored> for ScoringModel {
    type Error = StorageError;

    fn try_from(stored: Stored) -> Result<Self, StorageError> {
        let Stored { format, version, .. } = stored;
        expect_format(format, version)?;
        let (vector, coefficients) = (stored.vector, stored.coefficients);
        let (eigenpostures, eigenmotions) = (stored.eigenpostures.pca()?, stored.eigenmotions.pca()?);
        let expect = crate::analysis::expect_length;
        expect("eigenpostures", eigenpostures.n_components(), vector.n_eigenweights)?;
        let per_frame = vector.n_eigenweights.saturating_add(if vector.path { 3 } else { 0 });
        let length = vector.n_frames.saturating_mul(per_frame).saturating_add(usize::from(vector.duration));
        expect("entries of a motion's vector", eigenmotions.mean().len(), length)?;
        expect("coefficients", coefficients.len(), eigenmotions.n_components())?;
        if vector.n_frames == 0 {
            return Err(AnalysisError::Parts { argument: "n_frames", allowed: "at least 1" }.into());
        }
        if !coefficients.iter().chain([&stored.intercept]).all(|x| x.is_finite()) {
            return Err(AnalysisError::NonFinite { argument: "coefficients", row: 0 }.into());
        }
        let (intercept, synthetic) = (stored.intercept, stored.synthetic);
        Ok(Self { vector, eigenpostures, eigenmotions, intercept, coefficients, synthetic })
    }
}
