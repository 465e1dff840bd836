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

use somersault_core::spline::SplineError;

/// Why there is no such joint motion.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum JointMotionError {
    /// The basis of splines does not exist.
    #[error(transparent)]
    Spline(#[from] SplineError),
    /// Something has the wrong number of entries.
    #[error("`{argument}` must have {expected} entries, found {found}")]
    Length {
        /// Name of the argument.
        argument: &'static str,
        /// Entries it should have.
        expected: usize,
        /// Entries it has.
        found: usize,
    },
    /// A number is NaN or infinite.
    #[error("`{argument}` must be finite")]
    NonFinite {
        /// Name of the argument.
        argument: &'static str,
    },
    /// A time outside of the motion.
    #[error("`{argument}[{index}]` must be a share of the duration, from 0 to 1, found {found}")]
    Share {
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
        /// Coefficients asked for.
        found: usize,
        /// Coefficients allowed.
        limit: usize,
    },
    /// A base of eigenpostures needs a fundamental posture and one more.
    #[error("`postures` must have at least 2 entries, found {found}")]
    TooFewPostures {
        /// Postures given.
        found: usize,
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

pub(crate) fn expect_length(
    argument: &'static str,
    found: usize,
    expected: usize,
) -> Result<(), JointMotionError> {
    if found == expected { Ok(()) } else { Err(JointMotionError::Length { argument, expected, found }) }
}

/// Each from 0 to 1.
fn expect_shares(argument: &'static str, shares: &[f64]) -> Result<(), JointMotionError> {
    match shares.iter().position(|share| !(0.0..=1.0).contains(share)) {
        None => Ok(()),
        Some(index) => Err(JointMotionError::Share { argument, index, found: shares[index] }),
    }
}

pub(crate) fn expect_finite(argument: &'static str, values: &[f64]) -> Result<(), JointMotionError> {
    if values.iter().all(|x| x.is_finite()) { Ok(()) } else { Err(JointMotionError::NonFinite { argument }) }
}
