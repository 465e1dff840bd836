//! How a flight is reconstructed.

use super::{MarkerNoise, ReconstructionError};
use crate::fit::BodyScale;
use somersault_core::argument::{expect_positive, expect_range};

/// Choices for a reconstruction.
#[derive(Debug, Clone, PartialEq)]
pub struct ReconstructionOptions {
    /// Time between the knots of the joints' splines, s.
    pub knot_spacing: f64,
    /// The size of the body.
    pub scale: BodyScale,
    /// Whether g is sought: a multiple of the model's that differs from 1 says that the rate of the frames or the unit is wrong.
    pub seek_gravity: bool,
    /// Distance, in standard deviations, from which on a point counts less (Huber's loss); squares without.
    pub threshold: Option<f64>,
    /// The noise where it is known; else it is estimated.
    pub noise: Option<MarkerNoise>,
    /// First and last time that belong to the flight, s. Without them it is sought where the recording may be longer ([`phases`](crate::phases));
    /// all frames are taken where none is found.
    pub interval: Option<(f64, f64)>,
    /// Iterations over all frames, at most, between estimates of the noise.
    pub max_iterations: usize,
}

impl Default for ReconstructionOptions {
    /// Knots every 0.07 s, a size of 1 ± 0.1, the model's gravity, Huber's loss from 4 standard deviations, noise that is
    /// estimated, the frames between take-off and entry as they are found, 50 iterations.
    fn default() -> Self {
        Self {
            knot_spacing: 0.07,
            scale: BodyScale::Sought { mean: 1.0, deviation: 0.1 },
            seek_gravity: false,
            threshold: Some(4.0),
            noise: None,
            interval: None,
            max_iterations: 50,
        }
    }
}

impl ReconstructionOptions {
    /// Fails where a number is out of range.
    pub(super) fn validate(&self) -> Result<(), ReconstructionError> {
        expect_positive("knot_spacing", self.knot_spacing)?;
        self.scale.validate()?;
        if let Some(threshold) = self.threshold {
            expect_range("threshold", threshold, "from 1 to 1000", |x| (1.0..=1e3).contains(&x))?;
        }
        if let Some(noise) = &self.noise {
            noise.validate()?;
        }
        if let Some((start, end)) = self.interval {
            expect_range("start of the interval", start, "finite", f64::is_finite)?;
            expect_range("end of the interval", end, "after its start", |x| x > start && x.is_finite())?;
        }
        expect_range("max_iterations", self.max_iterations as f64, "at least 1", |x| x >= 1.0)?;
        Ok(())
    }
}
