//! Where the decision vector of a shooting has its parts.

use std::ops::Range;

/// The parts of z, in their order: ψ, the parameters of each phase, free durations, lifted states.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Layout {
    /// ψ: free displacements of the passive positions at the start, then free passive velocities.
    pub start: Range<usize>,
    /// The parameters p of the channels of each phase.
    pub parameters: Vec<Range<usize>>,
    /// The duration of each phase, where it is free.
    pub durations: Vec<Option<usize>>,
    /// The passive state at the start of each segment but the first: displacements of the positions from a
    /// reference, then velocities.
    pub lifted: Vec<Range<usize>>,
    /// Length of z.
    pub n_variables: usize,
}

impl Layout {
    pub(super) fn new(
        n_start: usize,
        phases: impl Iterator<Item = (usize, bool)>,
        n_lifted: usize,
        n_state: usize,
    ) -> Self {
        let mut at = 0;
        let mut take = |n: usize| {
            at += n;
            at - n..at
        };
        let start = take(n_start);
        let (n_parameters, free): (Vec<usize>, Vec<bool>) = phases.unzip();
        let parameters = n_parameters.into_iter().map(&mut take).collect();
        let durations = free.into_iter().map(|free| free.then(|| take(1).start)).collect();
        let lifted = (0..n_lifted).map(|_| take(n_state)).collect();
        Self { start, parameters, durations, lifted, n_variables: at }
    }
}
