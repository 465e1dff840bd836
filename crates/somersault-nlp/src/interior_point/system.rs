//! The linear system of a step.
//!
//! With Σ = z / distance for variables and slacks and D = Σ_s + δ_w the slacks are eliminated:
//!
//! ```text
//! | W + Σ_x + δ_w   Jᵀ           | | dx |   | −r_x             |
//! | J               −1/D − δ_c   | | dy | = | −r − r_s / D     |     ds = (dy − r_s) / D
//! ```
//! Rows of equalities have no slack and −δ_c alone. That δ_c is never zero makes the step one of the proximal method of
//! multipliers: exact in the limit, since dy vanishes there, and defined where rows are dependent. W is regularised by δ_w
//! until as many pivots are positive as there are variables, so that steps lead downhill (Wächter & Biegler 2006, algorithm IC).

use crate::error::SolverError;
use crate::hessian::Hessian;
use crate::nlp::Pattern;
use crate::program::max_norm;
use crate::saddle::Saddle;

/// First, least and largest δ_w, and how it grows and shrinks.
const FIRST_SHIFT: f64 = 1e-4;
const LEAST_SHIFT: f64 = 1e-20;
const LARGEST_SHIFT: f64 = 1e40;
const FIRST_GROWTH: f64 = 100.0;
const GROWTH: f64 = 8.0;
const DECAY: f64 = 1.0 / 3.0;
/// Steps of refinement, and the residual relative to its terms that is accurate, and that is enough.
const REFINEMENTS: usize = 10;
const ACCURATE: f64 = 1e-14;
const ENOUGH: f64 = 1e-6;

/// What rows and variables are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Role {
    /// A variable or slack that moves, with bounds or without.
    Moving,
    /// A variable, or slack of an equality, that its bounds fix.
    Fixed,
    /// A row without bounds, which is left out.
    Idle,
}

/// What a matrix is made of; entries of `curvature` and `roles` are of variables, then of slacks.
pub(super) struct Parts<'a> {
    /// None for a matrix of zeros.
    pub(super) hessian: Option<&'a Hessian>,
    pub(super) jacobian: &'a [f64],
    pub(super) row_scales: &'a [f64],
    pub(super) curvature: &'a [f64],
    pub(super) roles: &'a [Role],
    pub(super) dual_regularisation: f64,
}

/// The right-hand side of a step, and the step.
pub(super) struct Step {
    /// Gradients of the Lagrangian of the barrier problem: of variables, then of slacks.
    pub(super) slope: Vec<f64>,
    /// c − s.
    pub(super) violation: Vec<f64>,
    /// Of variables, then of slacks.
    pub(super) primal: Vec<f64>,
    /// Of the multipliers of rows.
    pub(super) dual: Vec<f64>,
}

impl Step {
    pub(super) fn new(n: usize, m: usize) -> Self {
        Self {
            slope: vec![0.0; n + m],
            violation: vec![0.0; m],
            primal: vec![0.0; n + m],
            dual: vec![0.0; m],
        }
    }
}

pub(super) struct System {
    n: usize,
    hessian: Pattern,
    jacobian: Pattern,
    saddle: Saddle,
    /// Of the slacks that move; 1 elsewhere.
    slack_curvature: Vec<f64>,
    right: Vec<f64>,
    solution: Vec<f64>,
    residual: Vec<f64>,
    /// δ_w of the last matrix that needed one, and of the last matrix.
    last_shift: f64,
    pub(super) shift: f64,
}

impl System {
    pub(super) fn try_new(hessian: &Pattern, jacobian: &Pattern) -> Result<Self, SolverError> {
        let (n, m) = (jacobian.n_columns(), jacobian.n_rows);
        Ok(Self {
            n,
            saddle: Saddle::try_new(hessian, jacobian)?,
            hessian: hessian.clone(),
            jacobian: jacobian.clone(),
            slack_curvature: vec![1.0; m],
            right: vec![0.0; n + m],
            solution: vec![0.0; n + m],
            residual: vec![0.0; n + m],
            last_shift: 0.0,
            shift: 0.0,
        })
    }

    pub(super) fn n_factorisations(&self) -> usize {
        self.saddle.count
    }

    /// Factors with the least δ_w, `floor` or more, that makes the inertia right. False if none does.
    pub(super) fn factor(&mut self, parts: &Parts<'_>, floor: f64) -> bool {
        let mut shift = floor;
        let mut growth = if self.last_shift == 0.0 { FIRST_GROWTH } else { GROWTH };
        loop {
            self.assemble(parts, shift);
            self.saddle.count += 1;
            if self.saddle.factor() && self.saddle.n_positive() == self.n {
                break;
            }
            shift = if shift == floor {
                let next = if self.last_shift == 0.0 {
                    FIRST_SHIFT
                } else {
                    (DECAY * self.last_shift).max(LEAST_SHIFT)
                };
                next.max(2.0 * floor)
            } else {
                let next = growth * shift;
                growth = GROWTH;
                next
            };
            if shift > LARGEST_SHIFT {
                return false;
            }
        }
        if shift > 0.0 {
            self.last_shift = shift;
        }
        self.shift = shift;
        true
    }

    fn assemble(&mut self, parts: &Parts<'_>, shift: f64) {
        let n = self.n;
        let moves = |i: usize| parts.roles[i] == Role::Moving;
        let Saddle { values, hessian_at, jacobian_at, diagonal_at, .. } = &mut self.saddle;
        values.fill(0.0);
        if let Some(hessian) = parts.hessian {
            for (k, i, j) in self.hessian.entries() {
                if moves(i) && moves(j) {
                    values[hessian_at[k]] += hessian.values[k];
                }
            }
        }
        for (k, i, j) in self.jacobian.entries() {
            if parts.roles[n + i] != Role::Idle && moves(j) {
                values[jacobian_at[k]] = parts.row_scales[i] * parts.jacobian[k];
            }
        }
        for i in 0..n {
            values[diagonal_at[i]] += if moves(i) { parts.curvature[i] + shift } else { 1.0 };
        }
        for (i, curvature) in self.slack_curvature.iter_mut().enumerate() {
            values[diagonal_at[n + i]] = match parts.roles[n + i] {
                Role::Moving => {
                    *curvature = parts.curvature[n + i] + shift;
                    -1.0 / *curvature - parts.dual_regularisation
                }
                Role::Fixed => -parts.dual_regularisation,
                Role::Idle => -1.0,
            };
        }
    }

    /// Solves with what was factored last. False where rounding leaves no digits.
    pub(super) fn solve(&mut self, roles: &[Role], step: &mut Step) -> bool {
        let n = self.n;
        for i in 0..n {
            self.right[i] = if roles[i] == Role::Moving { -step.slope[i] } else { 0.0 };
        }
        for (i, violation) in step.violation.iter().enumerate() {
            self.right[n + i] = match roles[n + i] {
                Role::Moving => -violation - step.slope[n + i] / self.slack_curvature[i],
                Role::Fixed => -violation,
                Role::Idle => 0.0,
            };
        }
        if !self.refine() {
            return false;
        }
        let (x, y) = self.solution.split_at(n);
        step.primal[..n].copy_from_slice(x);
        step.dual.copy_from_slice(y);
        for (i, dy) in y.iter().enumerate() {
            step.primal[n + i] = match roles[n + i] {
                Role::Moving => (dy - step.slope[n + i]) / self.slack_curvature[i],
                Role::Fixed | Role::Idle => 0.0,
            };
        }
        true
    }

    /// The solution, improved until its residual is rounding.
    fn refine(&mut self) -> bool {
        self.solution.copy_from_slice(&self.right);
        self.saddle.solve(&mut self.solution);
        let size = max_norm(&self.right);
        let mut last = f64::INFINITY;
        let mut ratio = 0.0;
        for _ in 0..REFINEMENTS {
            self.residual.fill(0.0);
            self.saddle.add_product(&self.solution, &mut self.residual);
            for (residual, right) in self.residual.iter_mut().zip(&self.right) {
                *residual = right - *residual;
            }
            let terms = (size + max_norm(&self.solution).min(1e6 * size)).max(f64::MIN_POSITIVE);
            ratio = max_norm(&self.residual) / terms;
            if !ratio.is_finite() || ratio <= ACCURATE || (ratio <= ENOUGH && ratio > 0.5 * last) {
                break;
            }
            last = ratio;
            self.saddle.solve(&mut self.residual);
            self.solution.iter_mut().zip(&self.residual).for_each(|(x, r)| *x += r);
        }
        ratio <= ENOUGH && self.solution.iter().all(|x| x.is_finite())
    }
}
