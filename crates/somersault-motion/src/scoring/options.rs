//! Choices for a scoring model.

use super::{Groups, ScoringError, VectorOptions};
use somersault_core::argument::{
    ArgumentError, expect_least, expect_length, expect_positive, expect_squarable,
};

/// How scores are regressed on the vectors of motions.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum RegressionMethod {
    /// Least squares on the first principal components of the vectors (thesis 4.1.2).
    PrincipalComponents,
    /// Partial least squares: on the components that vary most together with the scores.
    PartialLeastSquares,
    /// Least squares with a penalty on the squares of all coefficients.
    Ridge,
}

impl std::fmt::Display for RegressionMethod {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::PrincipalComponents => "pcr",
            Self::PartialLeastSquares => "pls",
            Self::Ridge => "ridge",
        })
    }
}

/// What holds a regression back from fitting noise.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Tuning {
    /// The number of components, principal or of partial least squares.
    Components(usize),
    /// The penalty γ of ridge regression: it minimises Σ(y − ȳ − bᵀ(x − x̄))² + γ Σ‖x − x̄‖² ‖b‖², so that it has no unit.
    Penalty(f64),
}

/// Choices for a scoring model.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ScoringOptions {
    /// What a motion's vector has.
    pub vector: VectorOptions,
    /// How scores are regressed on vectors.
    pub method: RegressionMethod,
    /// Components of the regression; without a number cross-validation chooses. Not for ridge regression.
    pub n_components: Option<usize>,
    /// The most that cross-validation may choose.
    pub max_components: usize,
    /// Penalty of ridge regression, as in [`Tuning::Penalty`]; without one cross-validation chooses from 10⁻⁴ to 10. Only for ridge
    /// regression.
    pub penalty: Option<f64>,
    /// Least and greatest score there is. What is learnt from must be within; what is predicted may not be.
    pub scale: [f64; 2],
}

impl ScoringOptions {
    /// The vector of the thesis; principal components by cross-validation, at most five; scores from 0 to 10, as in diving.
    pub fn thesis() -> Self {
        Self {
            vector: VectorOptions::thesis(),
            method: RegressionMethod::PrincipalComponents,
            n_components: None,
            max_components: 5,
            penalty: None,
            scale: [0.0, 10.0],
        }
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

    /// Fails unless what is given for the regression is for its method.
    pub fn expect_tuning(&self) -> Result<(), ScoringError> {
        let method = self.method;
        match (method, self.n_components, self.penalty) {
            (RegressionMethod::Ridge, Some(_), _) => {
                Err(ScoringError::NotOfMethod { argument: "n_components", method, instead: "penalty" })
            }
            (RegressionMethod::Ridge, None, penalty) => {
                penalty.map_or(Ok(0.0), |penalty| expect_positive("penalty", penalty))?;
                Ok(())
            }
            (_, _, Some(_)) => {
                Err(ScoringError::NotOfMethod { argument: "penalty", method, instead: "n_components" })
            }
            _ => Ok(()),
        }
    }

    /// Fails unless every motion has a score and there are as many motions as `least` beside the components, also without any of
    /// the groups.
    pub(super) fn check(&self, groups: &Groups, scores: &[f64], least: usize) -> Result<(), ScoringError> {
        self.expect_tuning()?;
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
        let (n, least) = (groups.n_motions(), self.most().saturating_add(least));
        expect_least("motions", n, least)?;
        groups.expect_left(least - 1)?;
        expect_length("scores", scores.len(), n)?;
        expect_squarable("scores", scores)?;
        self.expect_scale(scores)
    }

    /// The most components that are requested; of ridge regression one, which it has at least.
    pub(super) fn most(&self) -> usize {
        match self.method {
            RegressionMethod::Ridge => 1,
            _ => self.n_components.unwrap_or(self.max_components),
        }
    }

    /// What is given for the regression; the rest is chosen by cross-validation.
    pub(super) fn tuning(&self) -> Option<Tuning> {
        match self.method {
            RegressionMethod::Ridge => self.penalty.map(Tuning::Penalty),
            _ => self.n_components.map(Tuning::Components),
        }
    }
}
