//! Extremals of trees of hinges and sliders, by way of the motion of minimum effort.
//!
//! With every degree of freedom driven the torques follow from the motion, so that a spline goes down to minimum effort and
//! tells the costates, as for the arm. What is passive is driven at first, at the weight γ/(1 − s), and released as s goes
//! to one; then limits come down from the largest torques to their own.

use super::least_effort::{Driven, Spline, Torque};
use super::linearised::{cold_start_within, expect_states};
use super::{DIRECT, Spent};
use crate::budget::Budget;
use crate::continuation::{Continuation, ContinuationResult, Member, Stage};
use crate::shooting::{End, MultipleShooting, ShootingError, graded_times};
use crate::system::{OptimalControlSystem, TreeMinimumTorque, VectorField};

/// From state to state in a given time.
#[derive(Debug, Clone, Copy)]
pub struct TreeTravel<'a> {
    /// The tree with its cost, its limits and what is passive.
    pub system: &'a TreeMinimumTorque,
    /// Coordinates and velocities at the start.
    pub initial: &'a [f64],
    /// Those at the end.
    pub last: &'a [f64],
    /// Time to travel, s.
    pub horizon: f64,
}

/// Longest segments as parts of the horizon, tried in turn; the shortest, at the ends, are a quarter.
const ATTEMPTS: [f64; 4] = [1.0 / 24.0, 1.0 / 48.0, 1.0 / 96.0, 1.0 / 192.0];

/// Relative fall of the effort in a step at which the descent ends: λ_q, a third derivative, needs more than the cost.
const ENOUGH: f64 = 1e-9;

/// The largest defect of a guess, relative to the size of its entry.
const ROUGH: f64 = 0.1;

impl Driven for TreeMinimumTorque {
    fn weights(&self) -> Vec<f64> {
        self.weights().to_vec()
    }

    fn torque_into(&self, motion: &[f64], torque: &mut Torque) {
        self.inverse_dynamics(motion, torque);
    }
}

impl TreeTravel<'_> {
    /// Solves with the settings of `continuation`, from a cubic between the ends. What comes back has arrived if its `s` is
    /// one and its extremal has converged; its counts are of all attempts.
    ///
    /// A tree with joints that turn freely, and one of which shooting fails from the spline, starts by
    /// [`cold_start`](super::cold_start()).
    pub fn solve(&self, continuation: &Continuation) -> Result<ContinuationResult, ShootingError> {
        self.solve_as(continuation, |tree| tree)
    }

    /// The same with every tree as `watch` returns it: a system that equals the tree until it is to stop, from when on its
    /// field is NaN. Whatever runs then ends.
    pub fn solve_as<W: VectorField + Sync>(
        &self,
        continuation: &Continuation,
        watch: impl Fn(TreeMinimumTorque) -> W,
    ) -> Result<ContinuationResult, ShootingError> {
        continuation.polish.check_tolerance()?;
        let ends = expect_states(self.system.dimension(), [self.initial, self.last], self.horizon)?;
        let whole = watch(self.system.clone());
        let budget = continuation.polish.limits.start();
        let mut spent = Spent::default();
        let mut found = None;
        if self.system.is_flat() {
            found = self.by_spline(&budget, continuation, &watch, &ends, &mut spent)?;
        }
        let mut found = match found {
            Some(found) => found,
            None => {
                let (initial, last, horizon) = (self.initial, self.last, self.horizon);
                cold_start_within(&budget, &whole, initial, last, horizon, continuation)?
            }
        };
        found.steps[1] += spent.failures;
        found.iterations += spent.iterations;
        found.work += spent.work;
        Ok(found)
    }

    fn by_spline<W: VectorField + Sync>(
        &self,
        budget: &Budget,
        continuation: &Continuation,
        watch: &impl Fn(TreeMinimumTorque) -> W,
        ends: &[End; 2],
        spent: &mut Spent,
    ) -> Result<Option<ContinuationResult>, ShootingError> {
        let driven = self.system.released(0.0);
        let watched = watch(driven.clone());
        let zero = vec![0.0; self.system.dimension()];
        let goes_on = || budget.reached().is_none() && watched.field(&zero).iter().all(|h| h.is_finite());
        let shooting = MultipleShooting { max_iterations: DIRECT, ..continuation.polish };
        // only propagates
        let judging = MultipleShooting { max_iterations: 0, ..shooting };
        let mut best: Option<ContinuationResult> = None;
        for (k, part) in ATTEMPTS.into_iter().enumerate() {
            if !goes_on() {
                break;
            }
            let longest = part * self.horizon;
            let times = graded_times(self.horizon, 0.25 * longest, longest)?;
            let knots = times.iter().flat_map(|&t| self.cubic(t)).collect();
            let mut spline = Spline { degrees: self.initial.len() / 2, times: times.clone(), knots };
            spent.iterations += spline.descend(&driven, ENOUGH, 100, goes_on);
            let nodes = spline.nodes(&driven);
            let Ok(guess) = judging.solve_within(budget, &watched, ends, &times, &nodes) else {
                spent.failures += 1;
                continue;
            };
            spent.work += guess.work;
            if guess.residual > ROUGH && k + 1 < ATTEMPTS.len() {
                spent.failures += 1;
                continue;
            }
            let Ok(extremal) = shooting.solve_within(budget, &watched, ends, &times, &nodes) else {
                spent.failures += 1;
                continue;
            };
            spent.iterations += extremal.iterations;
            spent.work += extremal.work;
            let found = ContinuationResult::of_one(extremal, Stage::LeastEffort, budget);
            if !found.arrived() {
                spent.failures += 1;
                continue;
            }
            let mut found = self.restricted(budget, continuation, watch, ends, found);
            let arrived = found.arrived();
            if let Some(before) = &best {
                found = found.after(before);
            }
            best = Some(found);
            if arrived {
                break;
            }
        }
        Ok(best)
    }

    /// Without the torques that are not there, and with the limits.
    fn restricted<W: VectorField + Sync>(
        &self,
        budget: &Budget,
        continuation: &Continuation,
        watch: &impl Fn(TreeMinimumTorque) -> W,
        ends: &[End; 2],
        mut found: ContinuationResult,
    ) -> ContinuationResult {
        let fractions: Vec<f64> = found.extremal.times.iter().map(|t| t / self.horizon).collect();
        let lead = |stage: Stage, found: ContinuationResult, of: &dyn Fn(f64) -> TreeMinimumTorque| {
            let family = |s: f64| Member { system: watch(of(s)), ends: ends.clone(), horizon: self.horizon };
            match continuation.follow_within(budget, stage, family, &fractions, &found.extremal.nodes) {
                Ok(led) => led.after(&found),
                Err(error) => ContinuationResult { s: 0.0, ..found.stopped(stage, error, budget) },
            }
        };
        if !self.system.is_fully_driven() {
            found = lead(Stage::Release, found, &|s| self.system.released(s));
        }
        if found.arrived() && self.system.torque_limits().iter().any(|limit| limit.is_finite()) {
            let free = self.system.released(1.0);
            let (mut peaks, mut u) = (vec![0.0f64; free.n_controls()], vec![0.0; free.n_controls()]);
            for p in &found.extremal.nodes {
                // the controls are as many as the degrees of freedom; without a value they leave the peaks
                let _ = free.control_into(p.as_slice(), &mut u);
                peaks.iter_mut().zip(&u).for_each(|(peak, u)| *peak = peak.max(u.abs()));
            }
            found = lead(Stage::Limits, found, &|s| self.system.limited_from(&peaks, s));
        }
        found
    }

    /// The cubic between the ends: q, q̇ and q̈.
    fn cubic(&self, t: f64) -> Vec<f64> {
        let (h, s, n) = (self.horizon, t / self.horizon, self.initial.len() / 2);
        let mut motion = vec![0.0; 3 * n];
        for i in 0..n {
            let [from, to] = [self.initial, self.last].map(|x| [x[i], x[n + i] * h]);
            let way = to[0] - from[0];
            // from[0] + from[1] s + b s² + c s³
            let (b, c) = (way * 3.0 - from[1] * 2.0 - to[1], from[1] + to[1] - way * 2.0);
            motion[i] = from[0] + from[1] * s + b * (s * s) + c * (s * s * s);
            motion[n + i] = (from[1] + b * (2.0 * s) + c * (3.0 * s * s)) / h;
            motion[2 * n + i] = (b * 2.0 + c * (6.0 * s)) / (h * h);
        }
        motion
    }
}
