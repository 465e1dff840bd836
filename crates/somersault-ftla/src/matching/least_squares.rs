//! The match by least squares, with conserved quantities.
//!
//! Unknown are the held costates at both ends, less one for each that is conserved: those are the same at both ends, as
//! λ₁ of the arm is, whose θ₁ is cyclic. Residuals are p⁺ − p⁻ at t_m and H⁺ − H⁻ at the ends, which costs no
//! propagation. Gauss–Newton steps with derivatives by differences, halved until the residual falls.

use super::grid::held_of;
use super::{Branch, Counts, MatchStatus, Matching, MatchingError, MatchingResult};
use crate::budget::{Budget, Limits};
use crate::system::HamiltonianSystem;
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use somersault_core::argument::ArgumentError;

/// Settings of the match.
#[derive(Debug, Clone, PartialEq)]
pub struct LeastSquares {
    /// Numbers, from 0, of held costates that are constant along motions.
    pub conserved: Vec<usize>,
    /// Mismatch at which to stop.
    pub tolerance: f64,
    /// Gauss–Newton steps allowed.
    pub max_rounds: usize,
    /// What the search may spend.
    pub limits: Limits,
}

impl Default for LeastSquares {
    /// Nothing conserved but H; 2e-3, 30 steps, without limits.
    fn default() -> Self {
        Self { conserved: Vec::new(), tolerance: 2e-3, max_rounds: 30, limits: Limits::default() }
    }
}

/// Relative step of the differences.
const DIFFERENCE: f64 = 1e-4;

/// Why nothing more can be tried.
fn ended(budget: &Budget) -> MatchStatus {
    if budget.reached().is_some() { MatchStatus::LimitReached } else { MatchStatus::Exhausted }
}

impl LeastSquares {
    /// Runs the match from the costates that `matching` was given.
    pub fn run<S: HamiltonianSystem + Sync>(
        &self,
        matching: &Matching<'_, S>,
    ) -> Result<MatchingResult, MatchingError> {
        Matching::<S>::check_search(self.tolerance, self.max_rounds)?;
        let budget = self.limits.start();
        let matching = &matching.within(&budget);
        let held = matching.held();
        if let Some(&found) = self.conserved.iter().find(|c| !held.contains(c)) {
            let allowed = "among the held costates";
            return Err(
                ArgumentError::OutOfRange { argument: "conserved", allowed, found: found as f64 }.into()
            );
        }
        let m = held.len();
        let shared: Vec<bool> = held.iter().map(|h| self.conserved.contains(h)).collect();
        // of each held costate at the end, its unknown
        let mut slots: Vec<usize> = (0..m).collect();
        let mut unknowns = m;
        for k in 0..m {
            if !shared[k] {
                slots[k] = unknowns;
                unknowns += 1;
            }
        }
        let mut z = vec![0.0; unknowns];
        let starts = matching.ends.each_ref().map(|p| held_of(held, p));
        for k in 0..m {
            z[slots[k]] = starts[1][k];
            z[k] = if shared[k] { 0.5 * (starts[0][k] + starts[1][k]) } else { starts[0][k] };
        }
        let values = |z: &[f64], which: usize| -> Vec<f64> {
            (0..m).map(|k| if which == 0 { z[k] } else { z[slots[k]] }).collect()
        };
        let mut counts = Counts::default();
        let both = |z: &[f64], near: &[_; 2], counts: &Counts| -> Option<[Branch; 2]> {
            let (first, second) = rayon::join(
                || matching.branch(0, &values(z, 0), &near[0], &counts.evaluations).ok(),
                || matching.branch(1, &values(z, 1), &near[1], &counts.evaluations).ok(),
            );
            Some([first?, second?])
        };
        let residual = |branches: [&Branch; 2]| -> DVector<f64> {
            let gap = &branches[0].meeting - &branches[1].meeting;
            let energy = branches.map(|branch| matching.flow.system().hamiltonian(branch.end.as_slice()));
            DVector::from_iterator(gap.len() + 1, gap.iter().copied().chain([energy[0] - energy[1]]))
        };
        counts.branches += 2;
        let Some(mut branches) = both(&z, &matching.ends, &counts) else {
            let reached = budget.reached().is_some();
            let status = if reached { MatchStatus::LimitReached } else { MatchStatus::NoStart };
            return Ok(matching.unmatched(status, counts));
        };
        let status = loop {
            let r = residual([&branches[0], &branches[1]]);
            if (&branches[0].meeting - &branches[1].meeting).norm() <= self.tolerance {
                break MatchStatus::Matched;
            }
            if unknowns == 0 {
                break MatchStatus::Exhausted;
            }
            if counts.rounds == self.max_rounds {
                break MatchStatus::MaxRounds;
            }
            if budget.reached().is_some() {
                break MatchStatus::LimitReached;
            }
            counts.rounds += 1;
            let near = [branches[0].end.clone(), branches[1].end.clone()];
            let largest = z.iter().fold(0.0, |s: f64, x| s.max(x.abs()));
            // costates that are all zero say nothing of their size
            let size = if largest > 0.0 { largest } else { 1e-3 };
            // an unknown of one end moves one branch, a shared one both
            let columns: Vec<Option<DVector<f64>>> = (0..unknowns)
                .into_par_iter()
                .map(|j| {
                    let mut moved = z.clone();
                    moved[j] += DIFFERENCE * size;
                    let touched = |which: usize| if which == 0 { j < m } else { slots.contains(&j) };
                    let branch = |which: usize| {
                        if touched(which) {
                            matching
                                .branch(which, &values(&moved, which), &near[which], &counts.evaluations)
                                .ok()
                        } else {
                            Some(branches[which].clone())
                        }
                    };
                    let (first, second) = (branch(0)?, branch(1)?);
                    Some((residual([&first, &second]) - &r) / (DIFFERENCE * size))
                })
                .collect();
            counts.branches += unknowns + shared.iter().filter(|s| **s).count();
            let Some(columns) = columns.into_iter().collect::<Option<Vec<_>>>() else {
                break ended(&budget);
            };
            let jacobian = DMatrix::from_columns(&columns);
            let Ok(step) = jacobian.svd(true, true).solve(&-&r, 1e-12) else { break MatchStatus::Exhausted };
            let mut fraction = 1.0;
            let next = loop {
                let trial: Vec<f64> = z.iter().zip(step.iter()).map(|(z, d)| z + fraction * d).collect();
                counts.branches += 2;
                if let Some(found) = both(&trial, &near, &counts)
                    && residual([&found[0], &found[1]]).norm() < (1.0 - 1e-2 * fraction) * r.norm()
                {
                    break Some((trial, found));
                }
                fraction *= 0.4;
                if fraction < 1e-2 {
                    break None;
                }
            };
            match next {
                Some((trial, found)) => (z, branches) = (trial, found),
                None => break ended(&budget),
            }
        };
        Ok(matching.report([&branches[0], &branches[1]], status, counts))
    }
}
