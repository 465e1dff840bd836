//! Extremals from boundary states and horizon alone: of a problem that collocation solves by [`ProblemTravel`], of any system by
//! [`cold_start`], of trees by [`TreeTravel`], of the two-link arm from the way it folds by [`ArmTravel`].
//!
//! For the arm:
//!
//! 1. A spline that folds at the start and unfolds at the end goes down to minimum effort, by least squares: the torques of a
//!    driven arm follow from its motion (`least_effort`).
//! 2. Its torques are optimal for λ_v = −MΓu and λ_q = C_vᵀμ − λ̇_v, μ = −Γu, which makes it a list of nodes.
//! 3. Multiple shooting takes these to rounding.
//!
//! With torque limits the extremal without them is led there by continuation. Where shooting fails from the spline, the
//! arm is led from a rest instead: folded, to travel folded, to unfold at the ends. Where that stops early too, the thesis'
//! problem is led to it in all its parameters at once.

mod least_effort;
mod linearised;
mod posed;
mod tree;

use crate::budget::Budget;
use crate::continuation::{Continuation, ContinuationResult, Member, Stage};
use crate::flow::Work;
use crate::shooting::{End, MultipleShooting, ShootingError, ShootingStatus, graded_times};
use crate::system::{ArmMinimumTorque, OptimalControlSystem, VectorField};
pub(crate) use least_effort::Torque;
use least_effort::{Driven, Spline};
pub use linearised::cold_start;
use nalgebra::DVector;
pub use posed::ProblemTravel;
use somersault_core::argument::ArgumentError;
use std::f64::consts::PI;
pub use tree::TreeTravel;

impl Driven for ArmMinimumTorque {
    fn weights(&self) -> Vec<f64> {
        self.weights().to_vec()
    }

    fn torque_into(&self, motion: &[f64], torque: &mut Torque) {
        self.inverse_dynamics(motion, torque);
    }
}

/// From rest to rest in a given time, link 2 folded to one side on the way.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ArmTravel {
    /// The arm with its cost and limits.
    pub system: ArmMinimumTorque,
    /// θ₁ and θ₂ at the start, rad.
    pub initial: [f64; 2],
    /// θ₁ and θ₂ at the end, rad.
    pub last: [f64; 2],
    /// θ₂ on the way, rad: π or −π.
    pub fold: f64,
    /// Time to travel, s.
    pub horizon: f64,
}

impl Default for ArmTravel {
    /// The thesis' problem (8.4).
    fn default() -> Self {
        Self {
            system: ArmMinimumTorque::default(),
            initial: [-0.5 * PI, 0.05],
            last: [0.5 * PI, 0.05],
            fold: PI,
            horizon: 10.0,
        }
    }
}

/// The way to an [`ArmTravel`], and how far it was gone.
#[derive(Debug, Clone, PartialEq)]
pub struct Travelled {
    /// The extremal with the counts of all attempts, the steps of the descents among its iterations.
    pub continued: ContinuationResult,
    /// The arm whose motion that is: with the limits reached, where the continuation to the limits stopped early.
    pub system: ArmMinimumTorque,
}

/// The longest horizon, s: beyond it are millions of nodes.
const LONGEST: f64 = 1e4;

/// Newton steps allowed from the spline.
const DIRECT: usize = 40;

/// Longest segments on the way from the thesis' problem, s.
const LED: f64 = 0.1;

/// Relative fall of the effort in a step at which the descent ends.
const ENOUGH: f64 = 1e-5;

/// What is tried in turn: the longest segments, s, and the part of the time in which the first motion folds. The shortest
/// segments, at the ends, are a quarter of the longest.
const ATTEMPTS: [(f64, f64); 6] =
    [(0.4, 0.25), (0.2, 0.25), (0.1, 0.25), (0.1, 0.1), (0.1, 0.45), (0.05, 0.25)];

/// What the attempts from splines cost.
#[derive(Default)]
struct Spent {
    failures: usize,
    iterations: usize,
    work: Work,
}

impl ArmTravel {
    /// Solves with the settings of `continuation`. What comes back has arrived if its `s` is one and its extremal has
    /// converged.
    pub fn solve(&self, continuation: &Continuation) -> Result<Travelled, ShootingError> {
        self.solve_as(continuation, |arm| arm)
    }

    /// The same with every arm as `watch` returns it: a system that equals the arm until it is to stop, from when on its
    /// field is NaN. Whatever runs then ends.
    pub fn solve_as<W: VectorField + Sync + Clone>(
        &self,
        continuation: &Continuation,
        watch: impl Fn(ArmMinimumTorque) -> W,
    ) -> Result<Travelled, ShootingError> {
        continuation.polish.check_tolerance()?;
        if self.horizon.is_nan() || self.horizon <= 0.0 || self.horizon > LONGEST {
            let allowed = "positive and at most 10 000 s";
            return Err(
                ArgumentError::OutOfRange { argument: "horizon", allowed, found: self.horizon }.into()
            );
        }
        if !self.fold.is_finite() {
            return Err(
                ArgumentError::OutOfRange { argument: "fold", allowed: "finite", found: self.fold }.into()
            );
        }
        for (argument, angles) in [("initial", self.initial), ("last", self.last)] {
            if let Some(&found) = angles.iter().find(|angle| !angle.is_finite()) {
                return Err(ArgumentError::OutOfRange { argument, allowed: "finite", found }.into());
            }
        }
        let [initial, last] = [self.initial, self.last].map(|[one, two]| vec![one, two, 0.0, 0.0]);
        let ends = [End::try_state(&initial)?, End::try_state(&last)?];
        let limits = self.system.torque_limits();
        let free = self.system.without_torque_limits();
        let watched = watch(free);
        let budget = continuation.polish.limits.start();
        let goes_on = || budget.reached().is_none() && watched.field(&[0.0; 8]).iter().all(|h| h.is_finite());
        let mut reached = free;
        let shooting = MultipleShooting { max_iterations: DIRECT, ..continuation.polish };
        let mut spent = Spent::default();
        let mut direct = None;
        let mut best: Option<ContinuationResult> = None;
        for (longest, folding) in ATTEMPTS {
            if !goes_on() {
                break;
            }
            let times = graded_times(self.horizon, 0.25 * longest, longest)?;
            let (nodes, descents) = self.guess(&times, folding, &goes_on);
            spent.iterations += descents;
            let Ok(extremal) = shooting.solve_within(&budget, &watched, &ends, &times, &nodes) else {
                spent.failures += 1;
                continue;
            };
            spent.iterations += extremal.iterations;
            spent.work += extremal.work;
            let found = ContinuationResult::of_one(extremal, Stage::LeastEffort, &budget);
            // at a floor no other way leads lower
            if matches!(found.extremal.status, ShootingStatus::Converged | ShootingStatus::Floor) {
                direct = Some(found);
                break;
            }
            best = Some(found);
            spent.failures += 1;
        }
        let mut found = match direct {
            Some(found) => found,
            None => self.led(&budget, continuation, &watched, &watch, [initial, last], best)?,
        };
        found.steps[1] += spent.failures;
        found.iterations += spent.iterations;
        found.work += spent.work;
        if limits.iter().any(|limit| limit.is_finite()) && found.arrived() {
            let mut peaks = [0.0f64; 2];
            for p in &found.extremal.nodes {
                let mut u = [0.0; 2];
                // the controls of the arm are two
                let _ = free.control_into(p.as_slice(), &mut u);
                peaks = [peaks[0].max(u[0].abs()), peaks[1].max(u[1].abs())];
            }
            let limited = |s: f64| free.limited_towards(limits, peaks, s);
            let family =
                |s: f64| Member { system: watch(limited(s)), ends: ends.clone(), horizon: self.horizon };
            let fractions: Vec<f64> = found.extremal.times.iter().map(|t| t / self.horizon).collect();
            let nodes = &found.extremal.nodes;
            found = match continuation.follow_within(&budget, Stage::Limits, family, &fractions, nodes) {
                Ok(along) => {
                    reached = if along.s == 1.0 { self.system } else { limited(along.s) };
                    along.after(&found)
                }
                Err(error) => ContinuationResult { s: 0.0, ..found.stopped(Stage::Limits, error, &budget) },
            };
        }
        Ok(Travelled { continued: found, system: reached })
    }

    /// By continuation from other problems, where shooting fails from the splines; `best` is what that left.
    fn led<W: VectorField + Sync + Clone>(
        &self,
        budget: &Budget,
        continuation: &Continuation,
        watched: &W,
        watch: &impl Fn(ArmMinimumTorque) -> W,
        ends: [Vec<f64>; 2],
        best: Option<ContinuationResult>,
    ) -> Result<ContinuationResult, ShootingError> {
        let folded = match (self.by_continuation(budget, continuation, watched, ends), best) {
            (Ok(folded), _) => folded,
            (Err(_), Some(best)) => best,
            (Err(error), None) => return Err(error),
        };
        if folded.arrived() || budget.reached().is_some() {
            return Ok(folded);
        }
        Ok(match self.by_thesis(budget, continuation, watch)? {
            Some(led) if led.arrived() => led.after(&folded),
            Some(led) => folded.after(&led),
            None => folded,
        })
    }

    /// By way of travelling folded.
    fn by_continuation<S: VectorField + Sync + Clone>(
        &self,
        budget: &Budget,
        continuation: &Continuation,
        system: &S,
        ends: [Vec<f64>; 2],
    ) -> Result<ContinuationResult, ShootingError> {
        let rest = |angle: f64| vec![angle, self.fold, 0.0, 0.0];
        let middle = rest(0.5 * (self.initial[0] + self.last[0]));
        let folded = [rest(self.initial[0]), rest(self.last[0])];
        let longest = ATTEMPTS[0].0 / self.horizon;
        let fractions = graded_times(1.0, 0.25 * longest, longest)?;
        let stages = [[middle.clone(), middle], folded, ends];
        continuation.through_within(budget, system, &stages, self.horizon, &fractions)
    }

    /// By way of the thesis' problem folded to the same side, whose parameters, ends and horizon go to these; nothing if
    /// that is not solved.
    fn by_thesis<W: VectorField + Sync>(
        &self,
        budget: &Budget,
        continuation: &Continuation,
        watch: &impl Fn(ArmMinimumTorque) -> W,
    ) -> Result<Option<ContinuationResult>, ShootingError> {
        let thesis = Self { fold: PI.copysign(self.fold), ..Self::default() };
        let end = |[one, two]: [f64; 2]| End::from_values([one, two, 0.0, 0.0].into_iter());
        let times = graded_times(thesis.horizon, 0.25 * LED, LED)?;
        let (nodes, descents) = thesis.guess(&times, ATTEMPTS[0].1, &|| true);
        let ends = [end(thesis.initial), end(thesis.last)];
        let start = continuation.polish.solve_within(budget, &watch(thesis.system), &ends, &times, &nodes);
        let Some(start) = start.ok().filter(|start| start.status == ShootingStatus::Converged) else {
            return Ok(None);
        };
        let family = |s: f64| {
            let pair = |a: [f64; 2], b: [f64; 2]| [0, 1].map(|i| a[i] + s * (b[i] - a[i]));
            let ends = [end(pair(thesis.initial, self.initial)), end(pair(thesis.last, self.last))];
            let horizon = thesis.horizon + s * (self.horizon - thesis.horizon);
            Member { system: watch(thesis.system.towards(&self.system, s)), ends, horizon }
        };
        let fractions: Vec<f64> = times.iter().map(|t| t / thesis.horizon).collect();
        // a first member that fails, from its own solution, has lost its values: the search has been stopped
        let found = continuation.follow_within(budget, Stage::FromThesis, family, &fractions, &start.nodes);
        let Ok(mut found) = found else { return Ok(None) };
        found.iterations += descents + start.iterations;
        found.work += start.work;
        Ok(Some(found))
    }

    /// Nodes from the motion of minimum effort, and the steps that it took.
    fn guess(&self, times: &[f64], folding: f64, goes_on: &impl Fn() -> bool) -> (Vec<DVector<f64>>, usize) {
        let knots = times.iter().flat_map(|&t| self.folded(t, folding)).collect();
        let mut spline = Spline { degrees: 2, times: times.to_vec(), knots };
        let steps = spline.descend(&self.system, ENOUGH, 100, goes_on);
        (spline.nodes(&self.system), steps)
    }

    /// θ₁ by the cubic between the ends, θ₂ folding in a part `folding` of the time and unfolding in as much.
    fn folded(&self, t: f64, folding: f64) -> [f64; 6] {
        let (x, way, h) = (t / self.horizon, self.last[0] - self.initial[0], self.horizon);
        let one = [
            self.initial[0] + way * x * x * (3.0 - 2.0 * x),
            way * 6.0 * x * (1.0 - x) / h,
            way * (6.0 - 12.0 * x) / (h * h),
        ];
        let (from, since, sign) =
            if x > 0.5 { (self.last[1], h - t, -1.0) } else { (self.initial[1], t, 1.0) };
        let (turn, duration) = (self.fold - from, folding * h);
        let y = (since / duration).min(1.0);
        let z = 1.0 - y;
        let two = [
            from + turn * (1.0 - z.powi(4) * (1.0 + 4.0 * y)),
            sign * turn * 20.0 * y * z.powi(3) / duration,
            turn * 20.0 * z * z * (1.0 - 4.0 * y) / (duration * duration),
        ];
        [one[0], two[0], one[1], two[1], one[2], two[2]]
    }
}
