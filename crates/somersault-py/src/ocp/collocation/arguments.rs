//! Bounds as Python gives them.

use somersault::ocp::collocation::Interval;

/// Pairs of bounds.
pub(super) fn intervals_of(pairs: Vec<(f64, f64)>) -> Vec<Interval> {
    pairs.into_iter().map(|(lower, upper)| Interval::new(lower, upper)).collect()
}
