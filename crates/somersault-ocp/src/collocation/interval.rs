//! Lower and upper bound of a quantity.

use std::fmt;

/// Bounds this large bound nothing and say nothing about sizes (as in IPOPT).
pub(super) const NO_BOUND: f64 = 1e19;

/// What a quantity may be.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Interval {
    /// −∞ where there is no bound.
    pub lower: f64,
    /// ∞ where there is no bound.
    pub upper: f64,
}

impl Interval {
    /// Anything.
    pub const FREE: Self = Self { lower: f64::NEG_INFINITY, upper: f64::INFINITY };

    /// From `lower` to `upper`.
    pub fn new(lower: f64, upper: f64) -> Self {
        Self { lower, upper }
    }

    /// `value` and nothing else.
    pub fn fixed(value: f64) -> Self {
        Self::new(value, value)
    }

    /// At least `lower`.
    pub fn at_least(lower: f64) -> Self {
        Self::new(lower, f64::INFINITY)
    }

    /// At most `upper`.
    pub fn at_most(upper: f64) -> Self {
        Self::new(f64::NEG_INFINITY, upper)
    }

    /// Whether there is one value only.
    pub fn is_fixed(&self) -> bool {
        self.lower == self.upper
    }

    /// Whether there is a finite value within.
    pub fn is_possible(&self) -> bool {
        self.lower <= self.upper && self.lower < f64::INFINITY && self.upper > f64::NEG_INFINITY
    }

    /// The larger of its finite bounds.
    pub(super) fn size(&self) -> f64 {
        [self.lower, self.upper].iter().filter(|x| x.abs() < NO_BOUND).fold(0.0, |m, x| m.max(x.abs()))
    }

    pub(super) fn clamp(&self, x: f64) -> f64 {
        x.max(self.lower).min(self.upper)
    }

    /// How far `x` is outside.
    pub fn distance(&self, x: f64) -> f64 {
        (self.lower - x).max(x - self.upper).max(0.0)
    }

    pub(super) fn intersection(&self, other: &Self) -> Self {
        Self::new(self.lower.max(other.lower), self.upper.min(other.upper))
    }
}

impl fmt::Display for Interval {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.is_fixed() {
            write!(f, "{}", self.lower)
        } else {
            write!(f, "[{}, {}]", self.lower, self.upper)
        }
    }
}

/// Fixed.
impl From<f64> for Interval {
    fn from(value: f64) -> Self {
        Self::fixed(value)
    }
}

/// Lower and upper bound.
impl From<(f64, f64)> for Interval {
    fn from((lower, upper): (f64, f64)) -> Self {
        Self::new(lower, upper)
    }
}
