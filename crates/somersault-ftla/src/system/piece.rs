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
//! the transition matrix continues as it is, with the other Jacobian.
//!
//! A [`Piece`] says of each switch on which side of its surface the field is taken. The field of a piece continues smoothly
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

/// One smooth piece of a field: of each of its switches a side.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Piece {
    /// The sides up to the last one that is not free.
    sides: Vec<Side>,
}

impl Piece {
    /// Every control between its bounds.
    pub const FREE: Self = Self { sides: Vec::new() };

    /// The side of switch `i`.
    #[inline(always)]
    pub fn side(&self, i: usize) -> Side {
        self.sides.get(i).copied().unwrap_or(Side::Free)
    }

    /// Puts switch `i` on another side.
    pub fn set(&mut self, i: usize, side: Side) {
        if i >= self.sides.len() {
            self.sides.resize(i + 1, Side::Free);
        }
        self.sides[i] = side;
        let bound = self.sides.iter().rposition(|side| *side != Side::Free);
        self.sides.truncate(bound.map_or(0, |last| last + 1));
    }

    /// The same with switch `i` on another side.
    pub fn with(&self, i: usize, side: Side) -> Self {
        let mut other = self.clone();
        other.set(i, side);
        other
    }
}

impl FromIterator<Side> for Piece {
    fn from_iter<I: IntoIterator<Item = Side>>(sides: I) -> Self {
        let mut piece = Self::FREE;
        sides.into_iter().enumerate().for_each(|(i, side)| piece.set(i, side));
        piece
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
