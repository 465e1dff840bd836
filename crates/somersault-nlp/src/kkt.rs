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
//! positive definite, also where rows are dependent. Where a pivot vanishes, as it may where H has zeros, the factors are
//! those with δ 1 added. Both are taken out again by iterative refinement, and where that stands still, as it does where rows
//! hardly differ, by GMRES on the residual with the factors as preconditioner (Saad 2003, algorithm 9.5), which a few
//! directions of slow convergence do not hold up. A pivot of δ loses as many digits of the factors as δ is small: where GMRES
//! ends, too, a larger δ follows. By
//! Sylvester's law of inertia H + (σ + δ) 1 is positive definite on the null space of A where exactly n pivots are positive.

use crate::error::SolverError;
use crate::nlp::Pattern;
use crate::program::max_norm;
use crate::saddle::Saddle;
use nalgebra::DMatrix;

/// What a row of the working set is held at.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Activity {
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
/// δ relative to ‖H‖.
const PRIMAL_REGULARISATION: f64 = 1e-9;

/// Pivots below this, relative to the largest entry of H, count as zero.
const SMALLEST_PIVOT: f64 = 1e-13;
const REFINEMENTS: usize = 10;
/// Cycles of GMRES, and steps of each.
const CYCLES: usize = 6;
const KRYLOV: usize = 12;
/// Decrease of the residual that ends a cycle: no more digits are to be had of it.
const DIGITS: f64 = 1e-12;
/// Residual, relative to its terms, of a solution that is used.
const ACCURACY: f64 = 1e-9;

/// The matrix, its factors, and what they were made from.
pub(crate) struct Kkt {
    n: usize,
    m: usize,
    hessian_pattern: Pattern,
    jacobian_pattern: Pattern,
    saddle: Saddle,
    hessian: Vec<f64>,
    no_hessian: Vec<f64>,
    jacobian: Vec<f64>,
    active: Vec<Activity>,
    shift: f64,
    /// Of rows that may be left: 1 for least squares, 0 for constraints.
    compliance: f64,
    row_norms: Vec<f64>,
    /// Those of δ relative to ‖H‖ that are tried, until no pivot is zero and a solve is accurate.
    regularisations: &'static [f64],
    /// How many of them were tried, and the δ of the factors.
    tried: usize,
    added: f64,
    residual: Vec<f64>,
    /// Where a solve started.
    start: Vec<f64>,
    krylov: Krylov,
}

/// Room for a cycle of GMRES: basis, what the preconditioner makes of it, and the triangular factor of the Hessenberg matrix.
struct Krylov {
    basis: Vec<Vec<f64>>,
    directions: Vec<Vec<f64>>,
    triangle: DMatrix<f64>,
    rotations: [(f64, f64); KRYLOV],
    projected: [f64; KRYLOV + 1],
}

impl Krylov {
    fn new(size: usize) -> Self {
        Self {
            basis: vec![vec![0.0; size]; KRYLOV + 1],
            directions: vec![vec![0.0; size]; KRYLOV],
            triangle: DMatrix::zeros(KRYLOV + 1, KRYLOV),
            rotations: [(1.0, 0.0); KRYLOV],
            projected: [0.0; KRYLOV + 1],
        }
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

fn add_scaled(to: &mut [f64], factor: f64, x: &[f64]) {
    to.iter_mut().zip(x).for_each(|(to, x)| *to += factor * x);
}

impl Kkt {
    /// For a Hessian and a Jacobian of these patterns.
    pub(crate) fn try_new(hessian: &Pattern, jacobian: &Pattern) -> Result<Self, SolverError> {
        let (n, m) = (jacobian.n_columns(), jacobian.n_rows);
        Ok(Self {
            n,
            m,
            saddle: Saddle::try_new(hessian, jacobian)?,
            hessian: vec![0.0; hessian.n_entries()],
            no_hessian: vec![0.0; hessian.n_entries()],
            jacobian: vec![0.0; jacobian.n_entries()],
            hessian_pattern: hessian.clone(),
            jacobian_pattern: jacobian.clone(),
            active: vec![Activity::Free; n + m],
            shift: 0.0,
            compliance: 0.0,
            row_norms: vec![0.0; m],
            regularisations: &[PRIMAL_REGULARISATION],
            tried: 0,
            added: 0.0,
            residual: vec![0.0; n + m],
            start: vec![0.0; n + m],
            krylov: Krylov::new(n + m),
        })
    }

    /// For solves whose factors need not be near the matrix.
    pub(crate) fn with_regularisations(self, regularisations: &'static [f64]) -> Self {
        Self { regularisations, ..self }
    }

    /// Factorisations so far.
    pub(crate) fn n_factorisations(&self) -> usize {
        self.saddle.count
    }

    /// Whether H + σ 1 is positive definite on the null space of the working set, by a margin that a solve can
    /// use. `active` has variables first.
    pub(crate) fn factor(
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
    pub(crate) fn factor_least_squares(&mut self, shift: f64, jacobian: &[f64], active: &[Activity]) -> bool {
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
        self.saddle.count += 1;
        self.hessian.copy_from_slice(hessian);
        self.jacobian.copy_from_slice(jacobian);
        self.active.copy_from_slice(active);
        self.shift = shift;
        let n = self.n;
        let free = |i: usize| active[i] == Activity::Free;
        let size = (max_norm(hessian) + shift).max(f64::MIN_POSITIVE);

        self.saddle.values.fill(0.0);
        self.row_norms.fill(0.0);
        for (k, i, j) in self.hessian_pattern.entries() {
            if free(i) && free(j) {
                self.saddle.values[self.saddle.hessian_at[k]] += hessian[k];
            }
        }
        for (k, i, j) in self.jacobian_pattern.entries() {
            if !free(n + i) && free(j) {
                self.saddle.values[self.saddle.jacobian_at[k]] = jacobian[k];
                self.row_norms[i] = self.row_norms[i].max(jacobian[k].abs());
            }
        }
        for i in 0..n {
            self.saddle.values[self.saddle.diagonal_at[i]] += if free(i) { shift } else { 1.0 };
        }
        for i in 0..self.m {
            let norm = self.row_norms[i];
            self.saddle.values[self.saddle.diagonal_at[n + i]] = if norm > 0.0 && self.compliance == 0.0 {
                -DUAL_REGULARISATION * norm * norm / size
            } else {
                -1.0
            };
        }
        (self.tried, self.added) = (0, 0.0);
        if !self.saddle.factor() && !self.regularise() || self.saddle.n_positive() != n {
            return false;
        }
        let smallest = self.saddle.smallest_positive();
        smallest.is_finite() && smallest > SMALLEST_PIVOT * size.min(1.0)
    }

    /// Raises δ to the next value of the list, and again while a pivot vanishes, and factors. False at the end of the list.
    fn regularise(&mut self) -> bool {
        let size = (max_norm(&self.hessian) + self.shift).max(f64::MIN_POSITIVE);
        while let Some(regularisation) = self.regularisations.get(self.tried) {
            for i in (0..self.n).filter(|&i| self.active[i] == Activity::Free) {
                self.saddle.values[self.saddle.diagonal_at[i]] += regularisation * size - self.added;
            }
            (self.tried, self.added) = (self.tried + 1, regularisation * size);
            if self.saddle.factor() {
                return true;
            }
        }
        false
    }

    /// Solves with what was factored last. `targets[i]` is the d of row i, read where it is in the set; y is zero
    /// elsewhere, and its first n entries are the multipliers of bounds. What p and y hold is where it starts: where rows
    /// hardly differ, multipliers stay near those. False where the rows contradict each
    /// other, or rounding leaves no digits.
    pub(crate) fn solve(&mut self, q: &[f64], targets: &[f64], p: &mut [f64], y: &mut [f64]) -> bool {
        let n = self.n;
        self.set_out(targets, p, y);
        self.start[..n].copy_from_slice(p);
        self.start[n..].copy_from_slice(&y[n..]);
        let mut accurate = self.improve(q, targets, p, &mut y[n..], REFINEMENTS, Self::refine);
        let mut is_factored = true;
        while !accurate && is_factored {
            p.copy_from_slice(&self.start[..n]);
            y[n..].copy_from_slice(&self.start[n..]);
            accurate = self.improve(q, targets, p, &mut y[n..], CYCLES, Self::cycle);
            is_factored = self.added > 0.0 && !accurate && self.regularise();
        }
        self.hold(q, p, y) && accurate
    }

    /// Solves without taking ε out again: A p − ε (y − y₀) = d for the multipliers y₀ that y holds, so that rows which hardly
    /// differ are met as far as their multipliers need not be huge for it. False where rounding leaves no digits.
    pub(crate) fn solve_near(&mut self, q: &[f64], targets: &[f64], p: &mut [f64], y: &mut [f64]) -> bool {
        let n = self.n;
        self.set_out(targets, p, y);
        self.residuals(q, targets, p, &y[n..]);
        self.refine(p, &mut y[n..]);
        self.hold(q, p, y)
    }

    /// Brings p and y to where a solve may start.
    fn set_out(&self, targets: &[f64], p: &mut [f64], y: &mut [f64]) {
        let n = self.n;
        for i in 0..n {
            p[i] = if self.active[i] == Activity::Free { p[i] } else { targets[i] };
        }
        for (y, activity) in y[n..].iter_mut().zip(&self.active[n..]) {
            *y = if *activity == Activity::Free { 0.0 } else { *y };
        }
        if !p.iter().chain(&*y).all(|x| x.is_finite()) {
            p.fill(0.0);
            y.fill(0.0);
        }
    }

    /// Writes the multipliers of bounds: what holds a variable there is what stationarity lacks. Whether all numbers are finite.
    fn hold(&mut self, q: &[f64], p: &[f64], y: &mut [f64]) -> bool {
        let n = self.n;
        self.dual_residual(q, p, &y[n..]);
        for i in 0..n {
            y[i] = if self.active[i] == Activity::Free { 0.0 } else { self.residual[i] };
        }
        p.iter().chain(y.iter()).all(|x| x.is_finite())
    }

    /// Takes `most` steps, or as many as help. Whether the residual is small in the end.
    fn improve(
        &mut self,
        q: &[f64],
        targets: &[f64],
        p: &mut [f64],
        y: &mut [f64],
        most: usize,
        step: fn(&mut Self, &mut [f64], &mut [f64]),
    ) -> bool {
        let mut last = f64::INFINITY;
        let mut accurate = false;
        for _ in 0..most {
            let error = self.residuals(q, targets, p, y);
            accurate = error <= ACCURACY;
            if error.is_nan() || error <= f64::EPSILON || (accurate && error > 0.3 * last) {
                break;
            }
            last = error;
            step(self, p, y);
        }
        accurate
    }

    /// Plain refinement: adds what the factors make of the residual.
    fn refine(&mut self, p: &mut [f64], y: &mut [f64]) {
        self.saddle.solve(&mut self.residual);
        add_scaled(p, 1.0, &self.residual[..self.n]);
        add_scaled(y, 1.0, &self.residual[self.n..]);
    }

    /// One cycle of GMRES for the correction that the residual calls for.
    fn cycle(&mut self, p: &mut [f64], y: &mut [f64]) {
        let n = self.n;
        let mut krylov = std::mem::replace(&mut self.krylov, Krylov::new(0));
        let Krylov { basis, directions, triangle, rotations, projected } = &mut krylov;
        let norm = dot(&self.residual, &self.residual).sqrt();
        basis[0].iter_mut().zip(&self.residual).for_each(|(v, r)| *v = r / norm);
        projected.fill(0.0);
        projected[0] = norm;
        let mut steps = 0;
        for k in 0..KRYLOV {
            directions[k].copy_from_slice(&basis[k]);
            self.saddle.solve(&mut directions[k]);
            if !directions[k].iter().all(|x| x.is_finite()) {
                break;
            }
            self.apply(&directions[k]);
            for i in 0..=k {
                triangle[(i, k)] = dot(&self.residual, &basis[i]);
                add_scaled(&mut self.residual, -triangle[(i, k)], &basis[i]);
            }
            let rest = dot(&self.residual, &self.residual).sqrt();
            for i in 0..k {
                let (c, s) = rotations[i];
                let (a, b) = (triangle[(i, k)], triangle[(i + 1, k)]);
                (triangle[(i, k)], triangle[(i + 1, k)]) = (c * a + s * b, c * b - s * a);
            }
            let diagonal = triangle[(k, k)].hypot(rest);
            if !(diagonal > 0.0 && diagonal.is_finite()) {
                break;
            }
            let (c, s) = (triangle[(k, k)] / diagonal, rest / diagonal);
            rotations[k] = (c, s);
            triangle[(k, k)] = diagonal;
            triangle[(k + 1, k)] = 0.0;
            (projected[k], projected[k + 1]) = (c * projected[k], -s * projected[k]);
            steps = k + 1;
            if projected[k + 1].abs() <= DIGITS * norm || rest == 0.0 {
                break;
            }
            basis[k + 1].iter_mut().zip(&self.residual).for_each(|(v, r)| *v = r / rest);
        }
        for i in (0..steps).rev() {
            let known: f64 = (i + 1..steps).map(|j| triangle[(i, j)] * projected[j]).sum();
            projected[i] = (projected[i] - known) / triangle[(i, i)];
        }
        for (factor, direction) in projected[..steps].iter().zip(&*directions) {
            add_scaled(p, *factor, &direction[..n]);
            add_scaled(y, *factor, &direction[n..]);
        }
        self.krylov = krylov;
    }

    /// Leaves the product of the matrix and a vector in the residual.
    fn apply(&mut self, x: &[f64]) {
        let (p, y) = x.split_at(self.n);
        self.residual.fill(0.0);
        let (dual, primal) = self.residual.split_at_mut(self.n);
        self.hessian_pattern.add_symmetric_product(&self.hessian, p, dual);
        self.jacobian_pattern.add_transposed_product(&self.jacobian, y, dual);
        self.jacobian_pattern.add_product(&self.jacobian, p, primal);
        for (i, r) in dual.iter_mut().enumerate() {
            *r = if self.active[i] == Activity::Free { *r + self.shift * p[i] } else { p[i] };
        }
        for (i, r) in primal.iter_mut().enumerate() {
            let is_held = self.active[self.n + i] != Activity::Free;
            *r = if is_held && self.row_norms[i] > 0.0 { *r - self.compliance * y[i] } else { -y[i] };
        }
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
