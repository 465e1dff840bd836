//! Steps towards feasibility alone: least squares, damped, within bounds.
//!
//! ```text
//! minimise  ½ Σ (violations of l ≤ c + J p ≤ u)² + ½ σ ‖p‖²   subject to  l_z ≤ z + p ≤ u_z
//! ```
//! A working set of bounds and of rows that are violated at the end of the step, exchanged as for Newton's step. At first
//! it has the rows that are violated now and the bounds that hold variables against their pull.

use super::Subproblem;
use crate::kkt::Activity;
use crate::program::Point;

/// Exchanges of working sets before the last one is taken.
const EXCHANGES: usize = 30;
/// Distance at which a variable is at its bound.
const AT_BOUND: f64 = 1e-12;

/// What a step of restoration leaves.
pub(crate) struct Rest {
    /// Half the sum of squared violations, linearised.
    pub(crate) squared_violation: f64,
    /// Whether the working set is the right one.
    pub(crate) is_settled: bool,
}

impl Subproblem {
    /// The step that makes half the sum of squared linearised violations and ½ σ ‖p‖² least within the bounds.
    /// None if it cannot be computed.
    pub(crate) fn restore(&mut self, point: &Point, shift: f64) -> Option<Rest> {
        self.set_bounds(point);
        let n = point.z.len();
        let beyond = |i: usize| -self.lower[i].max(0.0) - self.upper[i].min(0.0);
        let violations: Vec<f64> = (n..self.lower.len()).map(beyond).collect();
        let mut slope = vec![0.0; n];
        self.structure.jacobian.add_transposed_product(&point.jacobian, &violations, &mut slope);
        let is_near = |bound: f64, z: f64| bound.abs() <= AT_BOUND * z.abs().max(1.0);
        for i in 0..self.trial_set.len() {
            let is_lower = if i < n {
                slope[i] > 0.0 && is_near(self.lower[i], point.z[i])
            } else {
                self.lower[i] > 0.0
            };
            let is_upper = if i < n {
                slope[i] < 0.0 && is_near(self.upper[i], point.z[i])
            } else {
                self.upper[i] < 0.0
            };
            self.trial_set[i] = if self.lower[i] == self.upper[i] {
                Activity::Equal
            } else if is_lower {
                Activity::Lower
            } else if is_upper {
                Activity::Upper
            } else {
                Activity::Free
            };
        }
        let no_gradient = vec![0.0; n];
        let mut is_settled = false;
        self.p.fill(0.0);
        self.y.fill(0.0);
        for _ in 0..=EXCHANGES {
            self.set_targets();
            if !self.kkt.factor_least_squares(shift, &point.jacobian, &self.trial_set)
                || !self.kkt.solve(&no_gradient, &self.targets, &mut self.p, &mut self.y)
            {
                return None;
            }
            if !self.exchange(point) {
                is_settled = true;
                break;
            }
        }
        self.shift = shift;
        for i in 0..n {
            self.p[i] = self.p[i].max(self.lower[i]).min(self.upper[i]);
        }
        self.jp.fill(0.0);
        self.structure.jacobian.add_product(&point.jacobian, &self.p, &mut self.jp);
        let left = |i: usize| (self.lower[n + i] - self.jp[i]).max(self.jp[i] - self.upper[n + i]).max(0.0);
        let squared_violation = (0..self.jp.len()).map(|i| 0.5 * left(i) * left(i)).sum();
        Some(Rest { squared_violation, is_settled })
    }
}
