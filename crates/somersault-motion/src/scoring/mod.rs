//! Scores of motions (thesis 4.1).
//!
//! ```text
//! motions ── PCA of all frames ──→ eigenweights of each ──→ motion vector ── second PCA ──→ score = a + bᵀ s
//! ```
//! A motion is brought to a number of frames and turned about the vertical into one heading; its postures give
//! eigenweights on one basis for all motions, which with the path of the body and the duration make its vector
//! ([`VectorOptions`]). Markers and coordinates are found by name ([`Features`]). The scores s of the
//! vectors in their principal components are mapped linearly, by least squares on the first of them, by partial least squares or with a
//! penalty ([`RegressionMethod`]). How many components, or which penalty, is decided by leave-one-out cross-validation ([`Tuning`]).
//!
//! Every score has a prediction interval ([`Score::interval`]) and says how far the motion is from the training motions ([`Score::distance`]).
//!
//! How accurate that is, is measured by [`validate`]: every motion is scored by a model that has not seen it, in its
//! bases and its tuning neither, nor other motions of its athlete where [`Groups`] say so, with the correlation's interval and p-value and simple
//! predictors beside it.
//!
//! Source: N. F. Troje, *Decomposing biological motion*, J. Vision 2 (2002), 371–387.

mod downdate;
mod groups;
mod learnt;
mod model;
mod options;
mod panel;
mod regression;
mod statistics;
mod storage;
mod validation;
mod vector;

pub use groups::Groups;
pub use model::{Score, ScoringModel};
pub use options::{RegressionMethod, ScoringOptions, Tuning};
pub use panel::{PanelScore, panel_score};
pub use statistics::{Correlation, ValidationOptions, pearson, spearman};
pub use storage::StorageError;
pub use validation::{Baseline, Validation, validate, validate_cancellable};
pub use vector::{FeatureKind, Features, Performance, VectorOptions};

use crate::analysis::AnalysisError;
use crate::recording::RecordingError;
use somersault_core::argument::ArgumentError;

/// Why motions cannot be scored.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ScoringError {
    /// An argument that is not allowed.
    #[error(transparent)]
    Argument(#[from] ArgumentError),
    /// A feature of the name of another baseline.
    #[error("`features` must have names of their own, but a baseline named `{name}` is there already")]
    DuplicateBaseline {
        /// The name.
        name: String,
    },
    /// More components than motions can have.
    #[error("`{argument}` must be at most {most} for these motions, found {found}")]
    TooMany {
        /// Name of the argument.
        argument: &'static str,
        /// The most there can be.
        most: usize,
        /// Number requested.
        found: usize,
    },
    /// Something that the method of the regression does not have.
    #[error("`{argument}` must not be given for the method {method}, which has `{instead}`")]
    NotOfMethod {
        /// Name of the argument.
        argument: &'static str,
        /// The method.
        method: RegressionMethod,
        /// What the method has in its place.
        instead: &'static str,
    },
    /// Too few motions are left without a group.
    #[error(
        "`groups` must leave at least {least} motions without any of them, found {found} without that of motion {motion}"
    )]
    Group {
        /// The first motion of the group, from 0.
        motion: usize,
        /// Motions needed.
        least: usize,
        /// Motions left.
        found: usize,
    },
    /// A score is not on the scale.
    #[error(
        "`scores` must be within the scale {least} to {greatest}, found {found} of motion {motion}; give the `scale` if it is another"
    )]
    OutsideScale {
        /// Number of the motion, from 0.
        motion: usize,
        /// Its score.
        found: f64,
        /// Least score.
        least: f64,
        /// Greatest score.
        greatest: f64,
    },
    /// The ends of the scale do not grow, or one is not finite.
    #[error("`scale` must be two finite numbers that grow, found {least} and {greatest}")]
    Scale {
        /// Least score.
        least: f64,
        /// Greatest score.
        greatest: f64,
    },
    /// Markers where coordinates were learnt, or the other way round.
    #[error("the postures must be {expected}, found {found}")]
    Kind {
        /// What was learnt.
        expected: FeatureKind,
        /// What the motion has.
        found: FeatureKind,
    },
    /// Markers or coordinates that the motion lacks.
    #[error("the motion must have {missing}; it has {found}")]
    Names {
        /// Names of those that are missing.
        missing: String,
        /// Names of those it has.
        found: String,
    },
    /// Markers in another unit, or of something else.
    #[error(
        "{} must have markers {least:.3} m to {greatest:.3} m about their centre, rms, within a factor of 2, found {found:.3e} m; is the \
         unit right?",
        motion.map_or("the motion".to_owned(), |k| format!("motion {k}"))
    )]
    Size {
        /// Number of the motion, from 0, where there are several.
        motion: Option<usize>,
        /// Its size, m.
        found: f64,
        /// Least size learnt, m.
        least: f64,
        /// Greatest size learnt, m.
        greatest: f64,
    },
    /// One of several motions.
    #[error("motion {motion}: {source}")]
    Motion {
        /// Number of the motion, from 0.
        motion: usize,
        /// What is wrong with it.
        source: Box<ScoringError>,
    },
    /// A marker is missing.
    #[error("`recording` must have no gaps, but `{marker}` is missing in frame {frame}; fill them before")]
    Gap {
        /// The marker.
        marker: String,
        /// Frame, from 0.
        frame: usize,
    },
    /// Times do not grow.
    #[error(transparent)]
    Recording(#[from] RecordingError),
    /// The caller said that it is not to continue.
    #[error("the validation was interrupted")]
    Interrupted,
    /// Nothing is correlated with what is the same everywhere.
    #[error("`{argument}` does not vary")]
    Constant {
        /// Name of the argument.
        argument: &'static str,
    },
    /// The principal components do not exist.
    #[error(transparent)]
    Analysis(#[from] AnalysisError),
}
