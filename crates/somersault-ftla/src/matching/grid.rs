//! The grid search of appendix G.
//!
//! Around a centre at each end lie three values of each held costate. The pair of grid points, one from each grid, with the
//! least mismatch decides: a grid whose point is its centre is halved, another one is moved to have the point as its centre.
//!
//! # Deviations
//! Each grid is halved or moved by itself; appendix G leaves open whether one may be halved while the other moves.

use super::{Branch, Counts, MatchStatus, Matching, MatchingError, MatchingResult};
use crate::budget::Limits;
use crate::system::HamiltonianSystem;
use nalgebra::DVector;
use rayon::prelude::*;
use somersault_core::argument::ArgumentError;

/// Settings of the search.
#[derive(Debug, Clone, PartialEq)]
pub struct GridSearch {
    /// δλ at the start and at the end, one for each held costate.
    pub spacing: [Vec<f64>; 2],
    /// Mismatch at which to stop.
    pub tolerance: f64,
    /// Stops when every spacing is below this fraction of the first.
    pub finest: f64,
    /// Rounds allowed.
    pub max_rounds: usize,
    /// What the search may spend.
    pub limits: Limits,
}

/// Costates that a grid may have: of three values each there are half a million points at each end.
const MOST_HELD: usize = 12;

impl GridSearch {
    /// Runs the search around the costates that `matching` was given.
    pub fn run<S: HamiltonianSystem + Sync>(
        &self,
        matching: &Matching<'_, S>,
    ) -> Result<MatchingResult, MatchingError> {
        Matching::<S>::check_search(self.tolerance, self.max_rounds)?;
        let held = matching.held().to_vec();
        for spacing in &self.spacing {
            if spacing.len() != held.len() {
                let (expected, found) = (held.len(), spacing.len());
                return Err(ArgumentError::Length { argument: "spacing", expected, found }.into());
            }
            if let Some(&found) = spacing.iter().find(|s| s.is_nan() || **s <= 0.0) {
                return Err(
                    ArgumentError::OutOfRange { argument: "spacing", allowed: "positive", found }.into()
                );
            }
        }
        if held.len() > MOST_HELD {
            let (argument, allowed, found) = ("held", "at most 12 costates for a grid", held.len() as f64);
            return Err(ArgumentError::OutOfRange { argument, allowed, found }.into());
        }
        let budget = self.limits.start();
        let matching = &matching.within(&budget);
        let mut center = matching.ends.each_ref().map(|p| held_of(&held, p));
        let mut near = matching.ends.clone();
        let mut scale = [1.0f64; 2];
        let points = 3usize.pow(held.len() as u32);
        let mut counts = Counts::default();
        let mut best: Option<([Branch; 2], f64)> = None;
        let status = loop {
            if counts.rounds == self.max_rounds {
                break MatchStatus::MaxRounds;
            }
            counts.rounds += 1;
            counts.branches += 2 * points;
            let value = |which: usize, point: usize| -> Vec<f64> {
                let digit = |k: usize| (point / 3usize.pow(k as u32) % 3) as f64 - 1.0;
                let spacing = self.spacing[which].iter().enumerate();
                spacing.map(|(k, s)| center[which][k] + digit(k) * s * scale[which]).collect()
            };
            let branches: Vec<Option<Branch>> = (0..2 * points)
                .into_par_iter()
                .map(|index| {
                    let (which, point) = (index / points, index % points);
                    matching.branch(which, &value(which, point), &near[which], &counts.evaluations).ok()
                })
                .collect();
            let mut least: Option<(usize, usize, f64)> = None;
            for (i, first) in branches[..points].iter().enumerate() {
                for (j, second) in branches[points..].iter().enumerate() {
                    let (Some(first), Some(second)) = (first, second) else { continue };
                    let mismatch = (&first.meeting - &second.meeting).norm();
                    if least.is_none_or(|(_, _, m)| mismatch < m) {
                        least = Some((i, j, mismatch));
                    }
                }
            }
            let reached = budget.reached().is_some();
            let Some((i, j, mismatch)) = least else {
                break if reached { MatchStatus::LimitReached } else { MatchStatus::NoStart };
            };
            let pair = [branches[i].clone(), branches[points + j].clone()];
            if let [Some(first), Some(second)] = pair {
                near = [first.end.clone(), second.end.clone()];
                if best.as_ref().is_none_or(|(_, m)| mismatch < *m) {
                    best = Some(([first, second], mismatch));
                }
            }
            if mismatch <= self.tolerance {
                break MatchStatus::Matched;
            }
            if reached {
                break MatchStatus::LimitReached;
            }
            let moved = [value(0, i), value(1, j)];
            for (which, point) in [i, j].into_iter().enumerate() {
                if point == points / 2 {
                    scale[which] *= 0.5;
                }
            }
            center = moved;
            if scale[0].max(scale[1]) < self.finest {
                break MatchStatus::Exhausted;
            }
        };
        Ok(match &best {
            Some(([first, second], _)) => matching.report([first, second], status, counts),
            None => matching.unmatched(status, counts),
        })
    }
}

impl Default for GridSearch {
    /// Spacings must be given; mismatch 2e-3, finest 1e-4, 100 rounds, without limits.
    fn default() -> Self {
        let spacing = [Vec::new(), Vec::new()];
        Self { spacing, tolerance: 2e-3, finest: 1e-4, max_rounds: 100, limits: Limits::default() }
    }
}

/// The held costates of `p`.
pub(super) fn held_of(held: &[usize], p: &DVector<f64>) -> Vec<f64> {
    held.iter().map(|&i| p[p.len() / 2 + i]).collect()
}
