//! How a model is scaled.

use super::{ScaleGroup, ScalingError};
use somersault_core::argument::{expect_positive, expect_range};

/// Choices for a scaler.
#[derive(Debug, Clone, PartialEq)]
pub struct ScalingOptions {
    /// What is scaled by itself; the rest goes with the whole. Pairs of right and left, and widths, without ([`ScaleGroup::of_model`]).
    pub groups: Option<Vec<ScaleGroup>>,
    /// Standard deviation of the logarithm of the size of the whole body over that of the model.
    pub size_deviation: f64,
    /// Standard deviation of the logarithm of the size of each group over that of the whole.
    pub group_deviation: f64,
    /// Standard deviation of the place of each marker along each axis of its body, m; 0 for markers that are where they are said to be.
    pub offset_deviation: f64,
    /// Standard deviation of the noise in each coordinate of a marker of weight 1, m, where it is known.
    pub noise: Option<f64>,
    /// Distance, in standard deviations of the noise, from which on a point counts less (Huber's loss); squares without.
    pub threshold: Option<f64>,
    /// Frames that are taken, at most, equally many apart.
    pub max_frames: usize,
    /// Iterations, at most, between estimates of the noise.
    pub max_iterations: usize,
}

impl Default for ScalingOptions {
    /// A size within 10 %, proportions within 5 %, places within 10 mm, noise that is estimated, Huber's loss from 4 standard deviations, 50 frames, 100
    /// iterations.
    fn default() -> Self {
        Self {
            groups: None,
            size_deviation: 0.1,
            group_deviation: 0.05,
            offset_deviation: 0.01,
            noise: None,
            threshold: Some(4.0),
            max_frames: 50,
            max_iterations: 100,
        }
    }
}

impl ScalingOptions {
    /// Fails where a number is out of range.
    pub(super) fn validate(&self) -> Result<(), ScalingError> {
        let of_logarithm =
            |argument, x| expect_range(argument, x, "positive and at most 0.3", |x: f64| x > 0.0 && x <= 0.3);
        of_logarithm("size_deviation", self.size_deviation)?;
        of_logarithm("group_deviation", self.group_deviation)?;
        let allowed = "0, or from 1e-6 to 1 m";
        expect_range("offset_deviation", self.offset_deviation, allowed, |x| {
            x == 0.0 || (1e-6..=1.0).contains(&x)
        })?;
        if let Some(noise) = self.noise {
            expect_positive("noise", noise)?;
            expect_range("noise", noise, "between 1e-9 and 1e3 m", |x| (1e-9..=1e3).contains(&x))?;
        }
        if let Some(threshold) = self.threshold {
            expect_range("threshold", threshold, "from 1 to 1000", |x| (1.0..=1e3).contains(&x))?;
        }
        expect_range("max_frames", self.max_frames as f64, "from 1 to 1000", |x| (1.0..=1e3).contains(&x))?;
        expect_range("max_iterations", self.max_iterations as f64, "at least 1", |x| x >= 1.0)?;
        Ok(())
    }
}
