//! Bounds of variables and slacks, and the logarithmic barrier that stands in for them.

use super::system::Role;
use crate::nlp::Structure;

/// Weight of the linear term that keeps variables with one bound from running away (Wächter & Biegler 2006, section 3.7).
const DAMPING: f64 = 1e-5;
/// Distance of the start from its bounds, relative to their size and to the gap between them.
const PUSH: f64 = 1e-2;
/// The same of a warm start.
const WARM_PUSH: f64 = 1e-6;
/// Fraction by which a multiplier may leave μ / distance.
const NEIGHBOURHOOD: f64 = 1e10;
/// Lower and upper bounds of variables, then of slacks, and what each is.
pub(super) struct Walls {
    pub(super) lower: Vec<f64>,
    pub(super) upper: Vec<f64>,
    pub(super) roles: Vec<Role>,
}

impl Walls {
    pub(super) fn new(structure: &Structure, row_scales: &[f64]) -> Self {
        let Structure { variables, constraints, .. } = structure;
        let n = variables.len();
        let (mut lower, mut upper) = (variables.lower.clone(), variables.upper.clone());
        let mut roles: Vec<Role> =
            (0..n).map(|i| if lower[i] == upper[i] { Role::Fixed } else { Role::Moving }).collect();
        for (i, scale) in row_scales.iter().enumerate() {
            let (low, high) = (scale * constraints.lower[i], scale * constraints.upper[i]);
            lower.push(low);
            upper.push(high);
            roles.push(match (low == high, low.is_finite() || high.is_finite()) {
                (true, _) => Role::Fixed,
                (false, true) => Role::Moving,
                (false, false) => Role::Idle,
            });
        }
        Self { lower, upper, roles }
    }

    pub(super) fn len(&self) -> usize {
        self.roles.len()
    }

    /// Moves an entry between its bounds, away from them.
    pub(super) fn push(&self, i: usize, value: f64, is_warm: bool) -> f64 {
        let (lower, upper) = (self.lower[i], self.upper[i]);
        if self.roles[i] != Role::Moving {
            return if self.roles[i] == Role::Fixed { lower } else { value };
        }
        let share = if is_warm { WARM_PUSH } else { PUSH };
        let least = |bound: f64| (share * bound.abs().max(1.0)).min(share * (upper - lower));
        let mut value = value;
        if upper.is_finite() {
            value = value.min(upper - least(upper));
        }
        if lower.is_finite() {
            value = value.max(lower + least(lower));
        }
        value
    }

    /// Distance to the lower bound, which is positive: no less than rounding.
    pub(super) fn above(&self, i: usize, w: f64) -> f64 {
        (w - self.lower[i]).max(f64::EPSILON * self.lower[i].abs().max(1e-8))
    }

    /// Distance to the upper bound.
    pub(super) fn below(&self, i: usize, w: f64) -> f64 {
        (self.upper[i] - w).max(f64::EPSILON * self.upper[i].abs().max(1e-8))
    }

    fn has_lower(&self, i: usize) -> bool {
        self.roles[i] == Role::Moving && self.lower[i].is_finite()
    }

    fn has_upper(&self, i: usize) -> bool {
        self.roles[i] == Role::Moving && self.upper[i].is_finite()
    }

    /// −μ Σ ln distance, and its damping.
    pub(super) fn barrier(&self, w: &[f64], mu: f64) -> f64 {
        let mut sum = 0.0;
        for (i, &w) in w.iter().enumerate() {
            let (lower, upper) = (self.has_lower(i), self.has_upper(i));
            if lower {
                sum -= self.above(i, w).ln();
            }
            if upper {
                sum -= self.below(i, w).ln();
            }
            if lower && !upper {
                sum += DAMPING * self.above(i, w);
            } else if upper && !lower {
                sum += DAMPING * self.below(i, w);
            }
        }
        mu * sum
    }

    /// The derivative of the barrier in one entry.
    pub(super) fn slope(&self, i: usize, w: f64, mu: f64) -> f64 {
        let (lower, upper) = (self.has_lower(i), self.has_upper(i));
        let mut slope = 0.0;
        if lower {
            slope -= mu / self.above(i, w);
        }
        if upper {
            slope += mu / self.below(i, w);
        }
        if lower && !upper {
            slope += DAMPING * mu;
        } else if upper && !lower {
            slope -= DAMPING * mu;
        }
        slope
    }
}

/// Multipliers of the lower and of the upper bounds, both positive; zero where there is no bound.
#[derive(Clone)]
pub(super) struct Multipliers {
    pub(super) lower: Vec<f64>,
    pub(super) upper: Vec<f64>,
}

impl Multipliers {
    /// All the same.
    pub(super) fn new(walls: &Walls, value: f64) -> Self {
        let of = |has: &dyn Fn(usize) -> bool| -> Vec<f64> {
            (0..walls.len()).map(|i| if has(i) { value } else { 0.0 }).collect()
        };
        Self { lower: of(&|i| walls.has_lower(i)), upper: of(&|i| walls.has_upper(i)) }
    }

    /// z / distance of both bounds.
    pub(super) fn curvature(&self, walls: &Walls, i: usize, w: f64) -> f64 {
        let mut curvature = 0.0;
        if walls.has_lower(i) {
            curvature += self.lower[i] / walls.above(i, w);
        }
        if walls.has_upper(i) {
            curvature += self.upper[i] / walls.below(i, w);
        }
        curvature
    }

    /// Newton's step of the multipliers for a step of the variables, taken as far as they stay positive; that fraction.
    pub(super) fn advance(
        &mut self,
        walls: &Walls,
        w: &[f64],
        step: &[f64],
        mu: f64,
        kept: f64,
        changes: &mut Self,
    ) -> f64 {
        let mut length: f64 = 1.0;
        for (i, (&w, &dw)) in w.iter().zip(step).enumerate() {
            let mut shorten = |z: f64, dz: f64| {
                if dz < 0.0 {
                    length = length.min(-kept * z / dz);
                }
                dz
            };
            if walls.has_lower(i) {
                let (z, distance) = (self.lower[i], walls.above(i, w));
                changes.lower[i] = shorten(z, mu / distance - z - z / distance * dw);
            }
            if walls.has_upper(i) {
                let (z, distance) = (self.upper[i], walls.below(i, w));
                changes.upper[i] = shorten(z, mu / distance - z + z / distance * dw);
            }
        }
        for (z, dz) in self.lower.iter_mut().zip(&changes.lower) {
            *z += length * dz;
        }
        for (z, dz) in self.upper.iter_mut().zip(&changes.upper) {
            *z += length * dz;
        }
        length
    }

    /// Keeps the multipliers near μ / distance.
    pub(super) fn confine(&mut self, walls: &Walls, w: &[f64], mu: f64) {
        for (i, &w) in w.iter().enumerate() {
            let confined = |z: f64, distance: f64| {
                z.max(mu / distance / NEIGHBOURHOOD).min(NEIGHBOURHOOD * mu / distance)
            };
            if walls.has_lower(i) {
                self.lower[i] = confined(self.lower[i], walls.above(i, w));
            }
            if walls.has_upper(i) {
                self.upper[i] = confined(self.upper[i], walls.below(i, w));
            }
        }
    }

    /// Largest |z · distance − μ|.
    pub(super) fn complementarity(&self, walls: &Walls, w: &[f64], mu: f64) -> f64 {
        let mut largest: f64 = 0.0;
        for (i, &w) in w.iter().enumerate() {
            if walls.has_lower(i) {
                largest = largest.max((self.lower[i] * walls.above(i, w) - mu).abs());
            }
            if walls.has_upper(i) {
                largest = largest.max((self.upper[i] * walls.below(i, w) - mu).abs());
            }
        }
        largest
    }

    /// Mean of z · distance; none without bounds.
    pub(super) fn mean_complementarity(&self, walls: &Walls, w: &[f64]) -> Option<f64> {
        let (mut sum, mut count) = (0.0, 0);
        for (i, &w) in w.iter().enumerate() {
            if walls.has_lower(i) {
                sum += self.lower[i] * walls.above(i, w);
                count += 1;
            }
            if walls.has_upper(i) {
                sum += self.upper[i] * walls.below(i, w);
                count += 1;
            }
        }
        (count > 0).then(|| sum / count as f64)
    }

    /// Sum of all, and how many there are.
    pub(super) fn sum(&self, walls: &Walls) -> (f64, usize) {
        let count =
            (0..walls.len()).map(|i| usize::from(walls.has_lower(i)) + usize::from(walls.has_upper(i))).sum();
        (self.lower.iter().chain(&self.upper).sum(), count)
    }
}

/// The largest fraction of a step that leaves `1 − kept` of each distance to a bound.
pub(super) fn longest(walls: &Walls, w: &[f64], step: &[f64], kept: f64) -> f64 {
    let mut length: f64 = 1.0;
    for (i, (&w, &dw)) in w.iter().zip(step).enumerate() {
        if dw < 0.0 && walls.has_lower(i) {
            length = length.min(-kept * walls.above(i, w) / dw);
        } else if dw > 0.0 && walls.has_upper(i) {
            length = length.min(kept * walls.below(i, w) / dw);
        }
    }
    length
}
