//! The extremals of the two-link arm from boundary states, horizon and fold alone.
//!
//! 1. A spline that folds at the start and unfolds at the end goes down to least effort, by least squares: the torques of a
//!    driven arm follow from its motion (`least_effort`).
//! 2. Its torques are optimal for λ_v = −MΓu and λ_q = C_vᵀμ − λ̇_v, μ = −Γu, which makes it a list of nodes.
//! 3. Multiple shooting takes these to rounding.
//!
//! With torque limits the extremal without them is led there by continuation. Where shooting fails from the spline, the
//! arm is led from a rest instead: folded, to travel folded, to unfold at the ends.

mod least_effort;

use crate::continuation::{Continuation, Continued, Member};
use crate::shooting::{End, Shooting, ShootingError, Status, graded_times};
use crate::system::{ArmMinimumTorque, OptimalControlSystem};
use least_effort::Spline;
pub(crate) use least_effort::{Motion, Torque};
use nalgebra::{SVector, Vector2};
use std::f64::consts::PI;

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

/// Newton steps allowed from the spline.
const DIRECT: usize = 40;

/// Part of an interval over which λ̇_v is taken.
const SIDE: f64 = 1e-3;

/// What is tried in turn: the longest segments, s, and the part of the time in which the first motion folds. The shortest
/// segments, at the ends, are a quarter of the longest.
const ATTEMPTS: [(f64, f64); 6] =
    [(0.4, 0.25), (0.2, 0.25), (0.1, 0.25), (0.1, 0.1), (0.1, 0.45), (0.05, 0.25)];

impl ArmTravel {
    /// Solves with the settings of `continuation`. What comes back has arrived if its `s` is one and its extremal has
    /// converged.
    pub fn solve(&self, continuation: &Continuation) -> Result<Continued<8>, ShootingError> {
        if !self.horizon.is_finite() || self.horizon <= 0.0 {
            let allowed = "positive and finite";
            return Err(ShootingError::Argument { argument: "horizon", allowed, found: self.horizon });
        }
        if !self.fold.is_finite() {
            return Err(ShootingError::Argument { argument: "fold", allowed: "finite", found: self.fold });
        }
        let [initial, last] = [self.initial, self.last].map(|[one, two]| vec![one, two, 0.0, 0.0]);
        let ends = [End::try_state(&initial)?, End::try_state(&last)?];
        let limits = self.system.torque_limits();
        let free = self.system.without_torque_limits();
        let shooting = Shooting { max_iterations: DIRECT, ..continuation.polish };
        let mut direct = None;
        for (longest, folding) in ATTEMPTS {
            let times = graded_times(self.horizon, 0.25 * longest, longest)?;
            let (nodes, descents) = self.guess(&times, folding);
            if let Ok(extremal) = shooting.solve(&free, &ends, &times, &nodes)
                && extremal.status == Status::Converged
            {
                let (iterations, work) = (extremal.iterations + descents, extremal.work);
                direct = Some(Continued { extremal, s: 1.0, steps: [1, 0], iterations, work });
                break;
            }
        }
        let mut found = match direct {
            Some(found) => found,
            None => self.by_continuation(continuation, &free, [initial, last])?,
        };
        if limits.iter().any(|limit| limit.is_finite()) && found.extremal.status == Status::Converged {
            let mut peaks = [0.0f64; 2];
            for p in &found.extremal.nodes {
                let mut u = [0.0; 2];
                // the controls of the arm are two
                let _ = free.control_into(p, &mut u);
                peaks = [peaks[0].max(u[0].abs()), peaks[1].max(u[1].abs())];
            }
            let family = |s: f64| Member {
                system: free.limited_towards(limits, peaks, s),
                ends,
                horizon: self.horizon,
            };
            let fractions: Vec<f64> = found.extremal.times.iter().map(|t| t / self.horizon).collect();
            let limited = continuation.follow(family, &fractions, &found.extremal.nodes)?;
            found = limited.after(&found);
        }
        Ok(found)
    }

    /// By way of travelling folded.
    fn by_continuation(
        &self,
        continuation: &Continuation,
        system: &ArmMinimumTorque,
        ends: [Vec<f64>; 2],
    ) -> Result<Continued<8>, ShootingError> {
        let rest = |angle: f64| vec![angle, self.fold, 0.0, 0.0];
        let middle = rest(0.5 * (self.initial[0] + self.last[0]));
        let folded = [rest(self.initial[0]), rest(self.last[0])];
        let longest = ATTEMPTS[0].0 / self.horizon;
        let fractions = graded_times(1.0, 0.25 * longest, longest)?;
        continuation.through(system, &[[middle.clone(), middle], folded, ends], self.horizon, &fractions)
    }

    /// Nodes from the motion of least effort, and the steps that it took.
    fn guess(&self, times: &[f64], folding: f64) -> (Vec<SVector<f64, 8>>, usize) {
        let knots = times.iter().map(|&t| self.folded(t, folding)).collect();
        let mut spline = Spline { times: times.to_vec(), knots };
        let steps = spline.descend(&self.system.weights(), |m| self.system.inverse_dynamics(m), 100);
        let costate = |motion: &Motion<2>| self.system.node_on(motion).fixed_rows::<2>(6).into_owned();
        let intervals = times.len() - 1;
        let node = |k: usize| {
            // λ̇_v to both sides of a knot, where q̈ has a kink
            let (early, late) = (k.saturating_sub(1), k.min(intervals - 1));
            let (before, after) = if k == 0 {
                (0.0, SIDE)
            } else if k == intervals {
                (1.0 - SIDE, 1.0)
            } else {
                (1.0 - SIDE, SIDE)
            };
            let (first, last) = (spline.at(early, before), spline.at(late, after));
            let time = |k: usize, s: f64| times[k] + s * (times[k + 1] - times[k]);
            let rate = (costate(&last) - costate(&first)) / (time(late, after) - time(early, before));
            let mut p = self.system.node_on(&spline.knots[k]);
            (p[4], p[5]) = (p[4] - rate.x, p[5] - rate.y);
            p
        };
        ((0..times.len()).map(node).collect(), steps)
    }

    /// θ₁ by the cubic between the ends, θ₂ folding in a part `folding` of the time and unfolding in as much.
    fn folded(&self, t: f64, folding: f64) -> Motion<2> {
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
        [0, 1, 2].map(|d| Vector2::new(one[d], two[d]))
    }
}
