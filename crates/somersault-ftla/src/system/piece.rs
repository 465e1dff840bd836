//! Fields that are smooth in pieces: controls that reach and leave their bounds.
//!
//! For K strictly convex in u and bounds that do not move, u* = argmin K is continuous (Berge), and by the envelope theorem
//! ∇H* = ∇K at u*. So H* is once continuously differentiable across the surface g(p) = 0 at which a control reaches a bound,
//! the field h = J∇H* is continuous there, and its Jacobian jumps. For a motion that crosses the surface at a speed
//! ġ = ∇gᵀh ≠ 0, with h⁻ before it and h⁺ after it, Φ takes the jump
//!
//! ```text
//! S = 1 + (h⁺ − h⁻) ∇gᵀ / ġ  =  1:
//! ```
//! the transition matrix goes on as it is, with the other Jacobian.
//!
//! A [`Piece`] says of each switch on which side of its surface the field is taken. The field of a piece goes on smoothly
//! beyond the piece, so that the flow can step across and search for the crossing.

use super::SystemError;
use somersault_core::argument::ArgumentError;

/// Where a control is with respect to its bounds.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Side {
    /// At its lower bound.
    Lower,
    /// Between its bounds.
    #[default]
    Free,
    /// At its upper bound.
    Upper,
}

/// One smooth piece of a field over N numbers: of each of its switches, at most N, a side.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Piece<const N: usize> {
    /// The sides; those past the number of switches stay free.
    pub sides: [Side; N],
}

impl<const N: usize> Piece<N> {
    /// Every control between its bounds.
    pub const FREE: Self = Self { sides: [Side::Free; N] };
}

impl<const N: usize> Default for Piece<N> {
    fn default() -> Self {
        Self::FREE
    }
}

/// Bounds of one control.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Bounds {
    pub(super) lower: f64,
    pub(super) upper: f64,
}

impl Bounds {
    /// The side that the minimiser `free` of a convex K is on.
    #[inline(always)]
    pub(super) fn side(self, free: f64) -> Side {
        if free < self.lower {
            Side::Lower
        } else if free > self.upper {
            Side::Upper
        } else {
            Side::Free
        }
    }

    /// The control on a side, `free` between the bounds.
    #[inline(always)]
    pub(super) fn control(self, side: Side, free: f64) -> f64 {
        match side {
            Side::Lower => self.lower,
            Side::Free => free,
            Side::Upper => self.upper,
        }
    }

    /// Positive while `side` holds: between the bounds the distances from them, at a bound the slope of K against it.
    pub(super) fn margin(self, side: Side, control: f64, slope: f64) -> f64 {
        let (below, above) = (control - self.lower, self.upper - control);
        match side {
            Side::Lower => slope,
            Side::Upper => -slope,
            Side::Free if below.is_infinite() => above,
            Side::Free if above.is_infinite() => below,
            Side::Free => below * above / (below + above),
        }
    }
}

/// Bounds ±`limit`, which must be positive and may be infinite.
pub(super) fn expect_limit(found: f64) -> Result<Bounds, SystemError> {
    if found > 0.0 {
        Ok(Bounds { lower: -found, upper: found })
    } else {
        Err(SystemError::Argument(ArgumentError::OutOfRange {
            argument: "limits",
            allowed: "positive",
            found,
        }))
    }
}
