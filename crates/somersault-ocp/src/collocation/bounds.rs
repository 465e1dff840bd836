//! The bounds of a phase.

use super::interval::Interval;

/// Of all its variables and rows.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct PhaseBounds {
    pub(super) state: Vec<Interval>,
    pub(super) control: Vec<Interval>,
    pub(super) parameters: Vec<Interval>,
    pub(super) initial_state: Vec<Interval>,
    pub(super) final_state: Vec<Interval>,
    pub(super) initial_time: Interval,
    pub(super) final_time: Interval,
    pub(super) path: Vec<Interval>,
    pub(super) end: Vec<Interval>,
}
