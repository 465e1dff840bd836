//! Choices for a scoring model.

use super::{ScoringError, VectorOptions};
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
