//! Constraints as costs.

use somersault_nlp::{Bounds, Pattern};

/// Entry and clearances as costs ½ μ Σ violation² instead of constraints.
#[derive(Debug, Clone)]
pub(super) struct Soft {
    /// μ.
    pub(super) weight: f64,
    /// The bounds that are violated.
    pub(super) bounds: Bounds,
    /// Violations at the last point.
    pub(super) violations: Vec<f64>,
}

impl Soft {
    /// What the violations at the last point are as multipliers of constraints.
    pub(super) fn multipliers(&self) -> Vec<f64> {
        self.violations.iter().map(|v| self.weight * v).collect()
    }

    /// Leaves the violations of the rows from `first` on, and returns what they cost.
    pub(super) fn evaluate(&mut self, constraints: &[f64], first: usize) -> f64 {
        let Bounds { lower, upper } = &self.bounds;
        for row in first..constraints.len() {
            let value = constraints[row];
            self.violations[row] = (value - upper[row]).max(0.0) + (value - lower[row]).min(0.0);
        }
        0.5 * self.weight * self.violations.iter().map(|v| v * v).sum::<f64>()
    }

    /// μ Jᵀ J of the violated rows.
    pub(super) fn add_hessian(
        &self,
        pattern: &Pattern,
        jacobian: &[f64],
        first: usize,
        factor: f64,
        hessian: &mut [f64],
    ) {
        let n = pattern.n_columns();
        let mut row = vec![0.0; n];
        for violated in (first..pattern.n_rows).filter(|row| self.violations[*row] != 0.0) {
            for (column, value) in row.iter_mut().enumerate() {
                *value = pattern.value(jacobian, violated, column);
            }
            let mut at = 0;
            for j in 0..n {
                for i in 0..=j {
                    hessian[at] += factor * self.weight * row[i] * row[j];
                    at += 1;
                }
            }
        }
    }
}
