//! How phases hang together.

use super::interval::Interval;

/// Which end of a phase.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum End {
    /// t₀.
    Start,
    /// t_f.
    Finish,
}

/// A number at an end of a phase.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Quantity {
    /// Entry of x there.
    State(usize),
    /// The time itself.
    Time,
    /// Entry of p.
    Parameter(usize),
}

/// A quantity of a phase.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Place {
    /// Number of the phase.
    pub phase: usize,
    /// Which end of it.
    pub end: End,
    /// What of it.
    pub quantity: Quantity,
}

/// `right` − `left` lies in `difference`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Linkage {
    /// What is subtracted.
    pub left: Place,
    /// What it is subtracted from.
    pub right: Place,
    /// What the difference may be.
    pub difference: Interval,
}

impl Linkage {
    /// A phase does not end before it begins.
    pub(super) fn forward(phase: usize) -> Self {
        let time = |end| Place { phase, end, quantity: Quantity::Time };
        Self { left: time(End::Start), right: time(End::Finish), difference: Interval::at_least(0.0) }
    }

    /// Time and all `n_states` states continue from the end of one phase to the start of the other.
    pub fn continuous(from: usize, to: usize, n_states: usize) -> Vec<Self> {
        let quantities = (0..n_states).map(Quantity::State).chain([Quantity::Time]);
        quantities
            .map(|quantity| Self {
                left: Place { phase: from, end: End::Finish, quantity },
                right: Place { phase: to, end: End::Start, quantity },
                difference: Interval::fixed(0.0),
            })
            .collect()
    }
}
