//! Joint motions with parameters.
//!
//! Channels c(t) are splines; joints follow them by a constant base: a channel for each joint (thesis
//! appendix A), or the weights of eigenpostures (2.11):
//!
//! ```text
//! q_a(t) = φ₀ + Σ_i c_i(t) (φ_i − φ₀),    c_i(t) = Σ_j C_ij b_j(t)
//! ```
//! Conditions at the ends are linear in the coefficients C and are imposed by elimination, which leaves
//! C = C₀ + E p with the free parameters p. The same splines serve for joint torques (2.3).
//!
//! Sources: thesis, 2.4 and appendices A, B; H. Prautzsch, W. Boehm and M. Paluszny, *Bézier and B-Spline
//! Techniques*, Springer 2002.

mod base;
mod elimination;
mod spline;

pub use base::EigenpostureBase;
pub use elimination::{Condition, End};
pub use spline::SplineMotion;

use somersault_core::argument::ArgumentError;
use somersault_core::spline::SplineError;

/// Why there is no such joint motion.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum JointMotionError {
    /// The basis of splines does not exist.
    #[error(transparent)]
    Spline(#[from] SplineError),
    /// An argument that is not allowed.
    #[error(transparent)]
    Argument(#[from] ArgumentError),
    /// A time outside of the motion.
    #[error("`{argument}[{index}]` must be a fraction of the duration, from 0 to 1, found {found}")]
    Fraction {
        /// Name of the argument.
        argument: &'static str,
        /// Which entry.
        index: usize,
        /// What it is.
        found: f64,
    },
    /// There is no memory for so many variables.
    #[error("all channels together may have {limit} coefficients, found {found}")]
    TooManyCoefficients {
        /// Coefficients requested.
        found: usize,
        /// Coefficients allowed.
        limit: usize,
    },
    /// Some weights would describe the same posture.
    #[error("the differences of `postures` to the first have rank {rank}, not {expected}")]
    DependentPostures {
        /// Their rank.
        rank: usize,
        /// Their number.
        expected: usize,
    },
    /// Conditions at the ends contradict or repeat each other, or are more than there are coefficients.
    #[error(
        "`conditions` of channel {channel} cannot all be met: number {condition} depends on those before it"
    )]
    DependentConditions {
        /// The channel.
        channel: usize,
        /// The condition.
        condition: usize,
    },
}

/// Each from 0 to 1.
fn expect_fractions(argument: &'static str, fractions: &[f64]) -> Result<(), JointMotionError> {
    match fractions.iter().position(|fraction| !(0.0..=1.0).contains(fraction)) {
        None => Ok(()),
        Some(index) => Err(JointMotionError::Fraction { argument, index, found: fractions[index] }),
    }
}
