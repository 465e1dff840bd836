//! How a motion is smoothed.

use super::{MarkerNoise, SmoothingError};
use crate::fit::BodyScale;
use somersault_core::argument::expect_range;

/// Choices for a smoother.
#[derive(Debug, Clone, PartialEq)]
pub struct SmoothingOptions {
    /// The size of the body.
    pub scale: BodyScale,
    /// Distance, in standard deviations, from which on a point counts less (Huber's loss); squares without.
    pub threshold: Option<f64>,
    /// The noise where it is known; else it is estimated.
    pub noise: Option<MarkerNoise>,
    /// Degrees of freedom of Student's distribution, which the third derivatives of a step have: few let some steps be much rougher than the
    /// others, as a blow is. They are normal without.
    pub freedom: Option<f64>,
    /// Iterations, at most, between estimates of the noise and of the roughness.
    pub max_iterations: usize,
}

impl Default for SmoothingOptions {
    /// A size of 1 ± 0.1, Huber's loss from 4 standard deviations, noise that is estimated, 3 degrees of freedom, 50 iterations.
    fn default() -> Self {
        Self {
            scale: BodyScale::Sought { mean: 1.0, deviation: 0.1 },
            threshold: Some(4.0),
            noise: None,
            freedom: Some(3.0),
            max_iterations: 50,
        }
    }
}

impl SmoothingOptions {
    /// Fails where a number is out of range.
    pub(super) fn validate(&self) -> Result<(), SmoothingError> {
        self.scale.validate()?;
        if let Some(threshold) = self.threshold {
            expect_range("threshold", threshold, "from 1 to 1000", |x| (1.0..=1e3).contains(&x))?;
        }
        if let Some(noise) = &self.noise {
            noise.validate()?;
        }
        if let Some(freedom) = self.freedom {
            expect_range("freedom", freedom, "from 1 to 1000", |x| (1.0..=1e3).contains(&x))?;
        }
        expect_range("max_iterations", self.max_iterations as f64, "at least 1", |x| x >= 1.0)?;
        Ok(())
    }
}
