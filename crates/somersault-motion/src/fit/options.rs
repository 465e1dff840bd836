//! What is fitted, and how.

use super::{FitError, expect_positive_squarable};
use somersault_core::argument::{ArgumentError, expect_length, expect_range, expect_squarable};
use somersault_multibody::Model;
use somersault_multibody::joint_motion::EigenpostureBase;

/// What describes the posture of a model.
#[derive(Debug, Clone, PartialEq)]
pub enum Shape {
    /// The joints beside the root's, each within its limits.
    Joints,
    /// Weights of eigenpostures, w ≥ 0 and Σ w ≤ 1. A posture of the base has an entry for each coordinate of the
    /// joints beside the root's.
    Eigenpostures(EigenpostureBase),
}

/// How the size of the model is found.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Scale {
    /// It is known.
    Fixed(f64),
    /// It is fitted in each frame, within bounds: Figure 4.1c of the thesis.
    PerFrame {
        /// Lower bound.
        lower: f64,
        /// Upper bound.
        upper: f64,
    },
    /// One for the whole motion is fitted, within bounds: a body keeps its size.
    Common {
        /// Lower bound.
        lower: f64,
        /// Upper bound.
        upper: f64,
    },
}

impl Scale {
    /// Bounds of the scale within a frame.
    pub(super) fn bounds(self) -> [f64; 2] {
        match self {
            Self::Fixed(scale) => [scale, scale],
            Self::PerFrame { lower, upper } | Self::Common { lower, upper } => [lower, upper],
        }
    }
}

/// The size of the body over that of the model.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum BodyScale {
    /// It is known.
    Known(f64),
    /// It is sought, and is normal before the markers are looked at.
    Sought {
        /// Mean.
        mean: f64,
        /// Standard deviation.
        deviation: f64,
    },
}

impl BodyScale {
    /// Fails where a number is out of range.
    pub(crate) fn validate(self) -> Result<(), ArgumentError> {
        let size =
            |argument, x| expect_range(argument, x, "from 0.01 to 100", |x| (0.01..=100.0).contains(&x));
        match self {
            Self::Known(scale) => size("scale", scale)?,
            Self::Sought { mean, deviation } => {
                size("mean of the scale", mean)?;
                let allowed = "positive and at most 0.3 of its mean";
                let least = |x: f64| x > 0.0 && x <= 0.3 * mean;
                expect_range("deviation of the scale", deviation, allowed, least)?
            }
        };
        Ok(())
    }
}

/// ρ of a squared distance e²: how far markers count.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Loss {
    /// e².
    Squares,
    /// e² up to the threshold δ, m, then 2δe − δ².
    Huber(f64),
    /// δ² log(1 + e²/δ²), δ in m.
    Cauchy(f64),
}

impl Loss {
    /// ρ(e²) and ρ′(e²), the weight of the marker in least squares.
    pub(crate) fn evaluate(self, squared: f64) -> (f64, f64) {
        match self {
            Self::Huber(threshold) if squared > threshold * threshold => {
                let distance = squared.sqrt();
                (threshold * (2.0 * distance - threshold), threshold / distance)
            }
            Self::Squares | Self::Huber(_) => (squared, 1.0),
            Self::Cauchy(threshold) => {
                let share = squared / (threshold * threshold);
                (threshold * threshold * share.ln_1p(), 1.0 / (1.0 + share))
            }
        }
    }
}

/// Choices for a fit.
#[derive(Debug, Clone, PartialEq)]
pub struct FitOptions {
    /// Joints or eigenpostures.
    pub shape: Shape,
    /// How the size is found.
    pub scale: Scale,
    /// How distances count.
    pub loss: Loss,
    /// Postures to begin the first frame and every eighth with: coordinates of the joints beside the root's, or
    /// weights. Where there is none: the neutral posture and each of the base, or points throughout the joints' ranges.
    pub starts: Vec<Vec<f64>>,
    /// Iterations in a frame, at most.
    pub max_iterations: usize,
    /// A frame has converged when no unknown (m, rad) moves by more; or when the cost falls by less than 1e-12 of itself, or less than
    /// distances of 1e-11 of the coordinates make it, for angles that the markers do not determine never come to rest.
    pub step_tol: f64,
    /// Standard deviation of the noise in each coordinate of a marker of weight 1, m, where it is known; else the
    /// covariance is that of the residuals.
    pub noise: Option<f64>,
}

impl Default for FitOptions {
    /// Joints, scale 0.5 to 2 in each frame, squares, 1000 iterations, steps of 1e-9. Where residuals are large, as of a body that the
    /// model cannot follow, steps converge linearly, and hundreds are needed.
    fn default() -> Self {
        Self {
            shape: Shape::Joints,
            scale: Scale::PerFrame { lower: 0.5, upper: 2.0 },
            loss: Loss::Squares,
            starts: Vec::new(),
            max_iterations: 1000,
            step_tol: 1e-9,
            noise: None,
        }
    }
}

impl FitOptions {
    /// Fails where a number is out of range or does not suit the model.
    pub(super) fn validate(&self, model: &Model) -> Result<(), FitError> {
        let [lower, upper] = self.scale.bounds();
        if !(lower > 0.0 && upper >= lower && upper.is_finite()) {
            return Err(FitError::ScaleBounds { lower, upper });
        }
        expect_squarable("scale", [&upper])?;
        if let Loss::Huber(threshold) | Loss::Cauchy(threshold) = self.loss {
            expect_positive_squarable("threshold", threshold)?;
        }
        expect_positive_squarable("step_tol", self.step_tol)?;
        if let Some(noise) = self.noise {
            expect_positive_squarable("noise", noise)?;
        }
        let root = model.positions_of(0).len();
        let mut n_shape = model.n_positions() - root;
        if let Shape::Eigenpostures(base) = &self.shape {
            for (i, link) in model.links().iter().enumerate().skip(1) {
                let found = model.positions_of(i).len();
                if found > 1 {
                    let body = link.name().to_owned();
                    return Err(FitError::JointOfManyCoordinates { body, found });
                }
            }
            expect_length("postures of the base", base.n_joints(), n_shape)?;
            n_shape = base.n_weights();
        }
        for start in &self.starts {
            expect_length("starts", start.len(), n_shape)?;
            expect_squarable("starts", start)?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_are_the_derivatives_of_losses() {
        for loss in [Loss::Squares, Loss::Huber(0.1), Loss::Cauchy(0.1)] {
            for squared in [1e-6, 0.009, 0.011, 0.5] {
                let h = 1e-6 * squared;
                let difference = (loss.evaluate(squared + h).0 - loss.evaluate(squared - h).0) / (2.0 * h);
                assert!((loss.evaluate(squared).1 - difference).abs() < 1e-8, "{loss:?} at {squared}");
            }
        }
    }
}
