//! Equality-constrained quadratic programs by one sparse factorisation.
//!
//! ```text
//! minimise qᵀ p + ½ pᵀ (H + σ 1) p   subject to   a p = d  for each row a of the working set
//!
//! | H + σ 1   Aᵀ |  | p |   | −q |
//! | A         −ε |  | y | = |  d |
//! ```
//! Rows are those of the unit matrix (bounds of variables) and of the Jacobian. The pattern is the same for
//! all working sets, so that AMD and the symbolic factorisation happen once: variables at bounds and
//! constraints out of the set keep a diagonal entry only. ε makes the matrix quasi-definite where H + σ 1 is
//! positive definite, also where rows are dependent; iterative refinement takes it out again. By Sylvester's
//! law of inertia H + σ 1 is positive definite on the null space of A where exactly n pivots are positive.

use super::program::max_norm;
use crate::nlp::Pattern;
use clarabel::algebra::CscMatrix;
use clarabel::qdldl::{QDLDLFactorisation, QDLDLSettings};

/// What a row of the working set is held at.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Activity {
    /// Not in the set.
    Free,
    /// Lower bound, with a multiplier that is not positive.
    Lower,
    /// Upper bound, with a multiplier that is not negative.
    Upper,
    /// Both, with any multiplier.
    Equal,
}

/// ε relative to squared row norm over ‖H‖.
const DUAL_REGULARISATION: f64 = 1e-8;
/// Pivots below this, relative to the largest entry of H, count as zero.
const SMALLEST_PIVOT: f64 = 1e-13;
const REFINEMENTS: usize = 10;
/// Residual, relative to its terms, of a solution that is used.
const ACCURACY: f64 = 1e-9;

/// The matrix, its factors, and what they were made from.
pub(super) struct Kkt {
    n: usize,
    m: usize,
    hessian_pattern: Pattern,
    jacobian_pattern: Pattern,
    factors: QDLDLFactorisation<f64>,
    entries: Vec<usize>,
    values: Vec<f64>,
    hessian_at: Vec<usize>,
    jacobian_at: Vec<usize>,
    diagonal_at: Vec<usize>,
    hessian: Vec<f64>,
    no_hessian: Vec<f64>,
    jacobian: Vec<f64>,
    active: Vec<Activity>,
    shift: f64,
    /// Of rows that may be left: 1 for least squares, 0 for constraints.
    compliance: f64,
    row_norms: Vec<f64>,
    residual: Vec<f64>,
    pub(super) count: usize,
}

impl Kkt {
    /// For a Hessian and a Jacobian of these patterns.
    pub(super) fn new(hessian: &Pattern, jacobian: &Pattern) -> Self {
        let (n, m) = (jacobian.n_columns(), jacobian.n_rows);
        let diagonal = (0..n + m).map(|i| (i, i)).collect();
        let upper_left = hessian.entries().map(|(_, i, j)| (i, j)).collect();
        let upper_right = jacobian.entries().map(|(_, i, j)| (j, n + i)).collect();
        let (pattern, [diagonal_at, hessian_at, jacobian_at]) =
            Pattern::with_places_of(n + m, n + m, [diagonal, upper_left, upper_right]);
        let n_entries = pattern.n_entries();
        let settings = QDLDLSettings { logical: true, regularize_enable: false, ..QDLDLSettings::default() };
        let matrix = CscMatrix::new(n + m, n + m, pattern.columns, pattern.rows, vec![1.0; n_entries]);
        Self {
            n,
            m,
            factors: QDLDLFactorisation::new(&matrix, Some(settings))
                .expect("each column has its diagonal entry, and none below"),
            entries: (0..n_entries).collect(),
            values: vec![0.0; n_entries],
            hessian_at,
            jacobian_at,
            diagonal_at,
            hessian: vec![0.0; hessian.n_entries()],
            no_hessian: vec![0.0; hessian.n_entries()],
            jacobian: vec![0.0; jacobian.n_entries()],
            hessian_pattern: hessian.clone(),
            jacobian_pattern: jacobian.clone(),
            active: vec![Activity::Free; n + m],
            shift: 0.0,
            compliance: 0.0,
            row_norms: vec![0.0; m],
            residual: vec![0.0; n + m],
            count: 0,
        }
    }

    /// Whether H + σ 1 is positive definite on the null space of the working set, by a margin that a solve can
    /// use. `active` has variables first.
    pub(super) fn factor(
        &mut self,
        hessian: &[f64],
        shift: f64,
        jacobian: &[f64],
        active: &[Activity],
    ) -> bool {
        self.compliance = 0.0;
        self.refactor(hessian, shift, jacobian, active)
    }

    /// For rows that are met in the sense of least squares: minimise qᵀ p + ½ σ ‖p‖² + ½ ‖A p − d‖², y = A p − d.
    pub(super) fn factor_least_squares(&mut self, shift: f64, jacobian: &[f64], active: &[Activity]) -> bool {
        self.compliance = 1.0;
        let zero = std::mem::take(&mut self.no_hessian);
        let done = self.refactor(&zero, shift, jacobian, active);
        self.no_hessian = zero;
        done
    }

    fn refactor(&mut self, hessian: &[f64], shift: f64, jacobian: &[f64], active: &[Activity]) -> bool {
        if self.n == 0 {
            return false;
        }
        self.count += 1;
        self.hessian.copy_from_slice(hessian);
        self.jacobian.copy_from_slice(jacobian);
        self.active.copy_from_slice(active);
        self.shift = shift;
        let n = self.n;
        let free = |i: usize| active[i] == Activity::Free;
        let size = (max_norm(hessian) + shift).max(f64::MIN_POSITIVE);

        self.values.fill(0.0);
        self.row_norms.fill(0.0);
        for (k, i, j) in self.hessian_pattern.entries() {
            if free(i) && free(j) {
                self.values[self.hessian_at[k]] += hessian[k];
            }
        }
        for (k, i, j) in self.jacobian_pattern.entries() {
            if !free(n + i) && free(j) {
                self.values[self.jacobian_at[k]] = jacobian[k];
                self.row_norms[i] = self.row_norms[i].max(jacobian[k].abs());
            }
        }
        for i in 0..n {
            self.values[self.diagonal_at[i]] += if free(i) { shift } else { 1.0 };
        }
        for i in 0..self.m {
            let norm = self.row_norms[i];
            self.values[self.diagonal_at[n + i]] = if norm > 0.0 && self.compliance == 0.0 {
                -DUAL_REGULARISATION * norm * norm / size
            } else {
                -1.0
            };
        }
        self.factors.update_values(&self.entries, &self.values);
        if self.factors.refactor().is_err() || self.factors.positive_inertia() != n {
            return false;
        }
        let smallest = self.factors.D.iter().fold(f64::INFINITY, |s, &d| if d > 0.0 { s.min(d) } else { s });
        smallest.is_finite() && smallest > SMALLEST_PIVOT * size.min(1.0)
    }

    /// Solves with what was factored last. `targets[i]` is the d of row i, read where it is in the set; y is zero
    /// elsewhere, and its first n entries are the multipliers of bounds. False where the rows contradict each
    /// other, or rounding leaves no digits.
    pub(super) fn solve(&mut self, q: &[f64], targets: &[f64], p: &mut [f64], y: &mut [f64]) -> bool {
        let n = self.n;
        for i in 0..n {
            p[i] = if self.active[i] == Activity::Free { 0.0 } else { targets[i] };
        }
        y.fill(0.0);
        let mut last = f64::INFINITY;
        let mut accurate = false;
        for _ in 0..REFINEMENTS {
            let error = self.residuals(q, targets, p, &y[n..]);
            accurate = error <= ACCURACY;
            if !error.is_finite() || error <= f64::EPSILON || (accurate && error > 0.3 * last) {
                break;
            }
            last = error;
            self.factors.solve(&mut self.residual);
            for (x, correction) in p.iter_mut().zip(&self.residual) {
                *x += correction;
            }
            for (x, correction) in y[n..].iter_mut().zip(&self.residual[n..]) {
                *x += correction;
            }
        }
        // What holds a variable at its bound is what stationarity lacks there.
        self.dual_residual(q, p, &y[n..]);
        for i in 0..n {
            y[i] = if self.active[i] == Activity::Free { 0.0 } else { self.residual[i] };
        }
        accurate && p.iter().chain(y.iter()).all(|x| x.is_finite())
    }

    /// Leaves −q − (H + σ 1) p − Jᵀ y in the first n entries of the residual.
    fn dual_residual(&mut self, q: &[f64], p: &[f64], y: &[f64]) {
        let dual = &mut self.residual[..self.n];
        dual.fill(0.0);
        self.hessian_pattern.add_symmetric_product(&self.hessian, p, dual);
        self.jacobian_pattern.add_transposed_product(&self.jacobian, y, dual);
        for i in 0..self.n {
            dual[i] = -q[i] - self.shift * p[i] - dual[i];
        }
    }

    /// Leaves the residual of the whole system and returns its size, relative to the terms it is made of.
    fn residuals(&mut self, q: &[f64], targets: &[f64], p: &[f64], y: &[f64]) -> f64 {
        let n = self.n;
        self.dual_residual(q, p, y);
        let terms = max_norm(q).max(max_norm(y) * max_norm(&self.row_norms)).max(f64::MIN_POSITIVE);
        let mut error: f64 = 0.0;
        for i in 0..n {
            if self.active[i] == Activity::Free {
                error = error.max(self.residual[i].abs() / terms);
            } else {
                self.residual[i] = 0.0;
            }
        }
        let reach = max_norm(p).max(1e-6);
        let primal = &mut self.residual[n..];
        primal.fill(0.0);
        self.jacobian_pattern.add_product(&self.jacobian, p, primal);
        for (i, r) in primal.iter_mut().enumerate() {
            if self.active[n + i] == Activity::Free {
                *r = 0.0;
                continue;
            }
            *r = targets[n + i] - *r + self.compliance * y[i];
            let terms = self.row_norms[i] * reach + targets[n + i].abs() + self.compliance * y[i].abs();
            error = error.max(if *r == 0.0 { 0.0 } else { r.abs() / terms });
            if self.row_norms[i] == 0.0 && self.compliance == 0.0 {
                *r = 0.0;
            }
        }
        // A NaN would be lost in the maxima.
        if self.residual.iter().all(|r| r.is_finite()) { error } else { f64::NAN }
    }
}
