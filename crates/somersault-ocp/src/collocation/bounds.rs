//! The bounds of a phase.

use super::interval::Interval;

/// Of all its variables and rows.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct PhaseBounds {
    pub(crate) state: Vec<Interval>,
    pub(crate) control: Vec<Interval>,
    pub(crate) parameters: Vec<Interval>,
    pub(crate) initial_state: Vec<Interval>,
    pub(crate) final_state: Vec<Interval>,
    pub(crate) initial_time: Interval,
    pub(crate) final_time: Interval,
    pub(crate) path: Vec<Interval>,
    pub(crate) end: Vec<Interval>,
}
