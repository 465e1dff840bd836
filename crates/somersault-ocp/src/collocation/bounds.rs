//! The bounds of a phase.

use super::interval::Interval;

/// Bounds of all variables and rows of a [`Phase`](super::Phase).
#[derive(Debug, Clone, PartialEq)]
pub struct PhaseBounds {
    /// Of x at all times.
    pub state: Vec<Interval>,
    /// Of u.
    pub control: Vec<Interval>,
    /// Of p.
    pub parameters: Vec<Interval>,
    /// Of x(t₀).
    pub initial_state: Vec<Interval>,
    /// Of x(t_f).
    pub final_state: Vec<Interval>,
    /// Of t₀.
    pub initial_time: Interval,
    /// Of t_f.
    pub final_time: Interval,
    /// Of the path constraints g.
    pub path: Vec<Interval>,
    /// Of the end constraints b.
    pub end: Vec<Interval>,
}
