//! Surfaces touched, or missed, so lightly that there is no derivative.

use std::fmt;

/// The motions next to one that grazes along which derivatives are taken.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Side {
    /// Those that touch.
    Touching,
    /// Those that miss.
    Missing,
}

impl fmt::Display for Side {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Touching => "touch",
            Self::Missing => "miss",
        })
    }
}

/// A surface touched, or missed, so lightly that there is no derivative.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Grazing {
    /// When.
    pub t: f64,
    /// Which contact.
    pub guard: usize,
    /// The least gap that the motion has, or would have without the force of the contact, m.
    pub gap: f64,
    /// Size of the least gap up to which there is no derivative, m.
    pub bound: f64,
    /// On which side the motion is: the derivatives kept are the one-sided derivatives on it.
    pub side: Side,
}
