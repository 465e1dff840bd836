//! Extremals of trees of hinges and sliders, by way of the motion of least effort.
//!
//! With every degree of freedom driven the torques follow from the motion, so that a spline goes down to least effort and
//! tells the costates, as for the arm. What is passive is driven at first, at the weight γ/(1 − s), and released as s goes
//! to one; then limits come down from the largest torques to their own.

use super::least_effort::{Driven, Motion, Spline, Torque};
use super::linearised::{cold_start_within, expect_states};
use super::{DIRECT, Spent};
use crate::budget::Budget;
use crate::continuation::{Continuation, Continued, Member, Stage};
use crate::shooting::{End, Shooting, ShootingError, graded_times};
use crate::system::{OptimalControlSystem, TreeMinimumTorque, VectorField};
use nalgebra::SVector;

/// From state to state in a given time; `N` = 4`Q` for `Q` degrees of freedom.
#[derive(Debug, Clone, Copy)]
pub struct TreeTravel<'a, const Q: usize, const N: usize> {
    /// The tree with its cost, its limits and what is passive.
    pub system: &'a TreeMinimumTorque<N>,
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

impl<const Q: usize, const N: usize> Driven<Q> for TreeMinimumTorque<N> {
    fn weights(&self) -> [f64; Q] {
        std::array::from_fn(|i| self.weights()[i])
    }

    fn torque(&self, motion: &Motion<Q>) -> Torque<Q> {
        self.inverse_dynamics(motion)
    }
}

impl<const Q: usize, const N: usize> TreeTravel<'_, Q, N> {
    /// Solves with the settings of `continuation`, from a cubic between the ends. What comes back has arrived if its `s` is
    /// one and its extremal has converged; its counts are of all attempts.
    ///
    /// A tree with joints that turn freely, and one of which shooting fails from the spline, starts by
    /// [`cold_start`].
    pub fn solve(&self, continuation: &Continuation) -> Result<Continued<N>, ShootingError> {
        self.solve_as(continuation, |tree| tree)
    }

    /// The same with every tree as `watch` returns it: a system that equals the tree until it is to stop, from when on its
    /// field is NaN. Whatever runs then ends.
    pub fn solve_as<W: VectorField<N> + Sync>(
        &self,
        continuation: &Continuation,
        watch: impl Fn(TreeMinimumTorque<N>) -> W,
    ) -> Result<Continued<N>, ShootingError> {
        const { assert!(N == 4 * Q) };
        continuation.polish.check_tolerance()?;
        let ends = expect_states::<N>([self.initial, self.last], self.horizon)?;
        let whole = watch(self.system.clone());
        let budget = continuation.polish.limits.start();
        let mut spent = Spent::default();
        let mut found = None;
        if self.system.is_flat() {
            found = self.by_spline(&budget, continuation, &watch, ends, &mut spent)?;
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

    fn by_spline<W: VectorField<N> + Sync>(
        &self,
        budget: &Budget,
        continuation: &Continuation,
        watch: &impl Fn(TreeMinimumTorque<N>) -> W,
        ends: [End<N>; 2],
        spent: &mut Spent,
    ) -> Result<Option<Continued<N>>, ShootingError> {
        let driven = self.system.released(0.0);
        let watched = watch(driven.clone());
        let goes_on =
            || budget.reached().is_none() && watched.field(&SVector::zeros()).iter().all(|h| h.is_finite());
        let shooting = Shooting { max_iterations: DIRECT, ..continuation.polish };
        // only propagates
        let judging = Shooting { max_iterations: 0, ..shooting };
        let mut best: Option<Continued<N>> = None;
        for (k, part) in ATTEMPTS.into_iter().enumerate() {
            if !goes_on() {
                break;
            }
            let longest = part * self.horizon;
            let times = graded_times(self.horizon, 0.25 * longest, longest)?;
            let knots = times.iter().map(|&t| self.cubic(t)).collect();
            let mut spline = Spline::<Q> { times: times.clone(), knots };
            spent.iterations += spline.descend(&driven, ENOUGH, 100, goes_on);
            let nodes = spline.nodes(&driven);
            let Ok(guess) = judging.solve_within(budget, &watched, &ends, &times, &nodes) else {
                spent.failures += 1;
                continue;
            };
            spent.work += guess.work;
            if guess.residual > ROUGH && k + 1 < ATTEMPTS.len() {
                spent.failures += 1;
                continue;
            }
            let Ok(extremal) = shooting.solve_within(budget, &watched, &ends, &times, &nodes) else {
                spent.failures += 1;
                continue;
            };
            spent.iterations += extremal.iterations;
            spent.work += extremal.work;
            let found = Continued::of_one(extremal, Stage::LeastEffort, budget);
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
    fn restricted<W: VectorField<N> + Sync>(
        &self,
        budget: &Budget,
        continuation: &Continuation,
        watch: &impl Fn(TreeMinimumTorque<N>) -> W,
        ends: [End<N>; 2],
        mut found: Continued<N>,
    ) -> Continued<N> {
        let fractions: Vec<f64> = found.extremal.times.iter().map(|t| t / self.horizon).collect();
        let lead = |stage: Stage, found: Continued<N>, of: &dyn Fn(f64) -> TreeMinimumTorque<N>| {
            let family = |s: f64| Member { system: watch(of(s)), ends, horizon: self.horizon };
            match continuation.follow_within(budget, stage, family, &fractions, &found.extremal.nodes) {
                Ok(led) => led.after(&found),
                Err(error) => Continued { s: 0.0, ..found.stopped(stage, error, budget) },
            }
        };
        if !self.system.is_fully_driven() {
            found = lead(Stage::Release, found, &|s| self.system.released(s));
        }
        if found.arrived() && self.system.torque_limits().iter().any(|limit| limit.is_finite()) {
            let (free, mut peaks, mut u) = (self.system.released(1.0), [0.0f64; Q], [0.0; Q]);
            for p in &found.extremal.nodes {
                // the controls are as many as the degrees of freedom; without a value they leave the peaks
                let _ = free.control_into(p, &mut u);
                peaks.iter_mut().zip(&u).for_each(|(peak, u)| *peak = peak.max(u.abs()));
            }
            found = lead(Stage::Limits, found, &|s| self.system.limited_from(&peaks, s));
        }
        found
    }

    /// The cubic between the ends.
    fn cubic(&self, t: f64) -> Motion<Q> {
        let (h, s) = (self.horizon, t / self.horizon);
        let part = |x: &[f64], first: usize| SVector::<f64, Q>::from_column_slice(&x[first..first + Q]);
        let [from, to] = [self.initial, self.last].map(|x| [part(x, 0), part(x, Q) * h]);
        let way = to[0] - from[0];
        // from[0] + from[1] s + b s² + c s³
        let (b, c) = (way * 3.0 - from[1] * 2.0 - to[1], from[1] + to[1] - way * 2.0);
        let place = from[0] + from[1] * s + b * (s * s) + c * (s * s * s);
        [place, (from[1] + b * (2.0 * s) + c * (3.0 * s * s)) / h, (b * 2.0 + c * (6.0 * s)) / (h * h)]
    }
}
