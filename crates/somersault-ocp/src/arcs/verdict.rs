//! What a certificate says.

use std::fmt;

/// What was found about a motion.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum Verdict {
    /// A strict local minimum: conditions of first order hold, and sufficient ones of second order.
    StrictMinimum,
    /// An extremal that is no minimum: its conjugate point is at this time.
    ConjugatePoint {
        /// t.
        time: f64,
    },
    /// An extremal that is no minimum.
    NotMinimum {
        /// Why.
        reason: String,
    },
    /// Conditions of first order hold, Legendre and Clebsch's and Kelley's among them; whether it is a minimum is not decided.
    FirstOrder {
        /// Why no condition of second order was decided.
        reason: String,
    },
    /// No extremal was found: the motion of collocation is what there is.
    Refused {
        /// Why.
        reason: String,
    },
}

impl Verdict {
    /// Whether the motion is an extremal that nothing speaks against: a strict local minimum, or one that holds all conditions of
    /// first order.
    pub fn is_certified(&self) -> bool {
        match self {
            Self::StrictMinimum | Self::FirstOrder { .. } => true,
            Self::ConjugatePoint { .. } | Self::NotMinimum { .. } | Self::Refused { .. } => false,
        }
    }
}

impl fmt::Display for Verdict {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::StrictMinimum => write!(f, "a strict local minimum"),
            Self::ConjugatePoint { time } => {
                write!(f, "an extremal and no minimum: its conjugate point is at t = {time:.10}")
            }
            Self::NotMinimum { reason } => write!(f, "an extremal and no minimum: {reason}"),
            Self::FirstOrder { reason } => {
                write!(
                    f,
                    "first-order and Kelley conditions hold; not decided whether it is a minimum: {reason}"
                )
            }
            Self::Refused { reason } => write!(f, "refused: {reason}"),
        }
    }
}
