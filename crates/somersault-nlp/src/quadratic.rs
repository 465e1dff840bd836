//! Convex quadratic programs by clarabel, with the rows of a program's bounds.
//!
//! ```text
//! minimise  qᵀ p + ½ pᵀ (H + σ 1) p  ( + ρ Σ t )
//! subject to  l ≤ p ≤ u,  l_c ≤ J p ( + t⁻ − t⁺ ) ≤ u_c,  ( t ≥ 0 )
//! ```
//! What is in brackets is the elastic mode: with it there is always a solution, of least violation where ρ is
//! large. The pattern never changes, so clarabel orders and allocates once.

use crate::kkt::Activity;
use crate::nlp::{Bounds, Pattern};
use clarabel::algebra::CscMatrix;
use clarabel::solver::{DefaultSettings, DefaultSolver, IPSolver, SolverStatus, SupportedConeT};
use std::time::Instant;

/// One row of clarabel's A p + s = b: a bound of row `row`, of variables first.
struct Row {
    row: usize,
    side: Activity,
}

enum Source {
    Jacobian(usize),
    One,
}

/// Data of a quadratic program; bounds are of variables first, constraints after.
pub(crate) struct Quadratic<'a> {
    pub(crate) gradient: &'a [f64],
    pub(crate) hessian: &'a [f64],
    pub(crate) shift: f64,
    pub(crate) jacobian: &'a [f64],
    pub(crate) lower: &'a [f64],
    pub(crate) upper: &'a [f64],
    /// When it is given up.
    pub(crate) deadline: Option<Instant>,
}

/// How a quadratic program ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Outcome {
    Solved,
    Infeasible,
    Failed,
}

/// A solver for quadratic programs of one structure.
pub(crate) struct QuadraticSolver {
    n: usize,
    rows: Vec<Row>,
    n_equalities: usize,
    p_matrix: CscMatrix<f64>,
    hessian_at: Vec<usize>,
    diagonal_at: Vec<usize>,
    a_matrix: CscMatrix<f64>,
    a_sources: Vec<(Source, f64)>,
    q: Vec<f64>,
    b: Vec<f64>,
    solver: Option<DefaultSolver<f64>>,
}

impl QuadraticSolver {
    /// For programs with these patterns and with bounds where `variables` and `constraints` have them.
    pub(crate) fn new(
        hessian: &Pattern,
        jacobian: &Pattern,
        variables: &Bounds,
        constraints: &Bounds,
        elastic: bool,
    ) -> Self {
        let (n, m) = (jacobian.n_columns(), jacobian.n_rows);
        let bound = |i: usize| {
            if i < n {
                (variables.lower[i], variables.upper[i])
            } else {
                (constraints.lower[i - n], constraints.upper[i - n])
            }
        };
        let is_equal = |&i: &usize| bound(i).0 == bound(i).1;
        let mut rows: Vec<Row> =
            (0..n + m).filter(is_equal).map(|row| Row { row, side: Activity::Equal }).collect();
        let n_equalities = rows.len();
        for row in (0..n + m).filter(|i| !is_equal(i)) {
            let (lower, upper) = bound(row);
            if upper.is_finite() {
                rows.push(Row { row, side: Activity::Upper });
            }
            if lower.is_finite() {
                rows.push(Row { row, side: Activity::Lower });
            }
        }

        // (column, row, source, sign), for clarabel's A.
        let mut entries: Vec<(usize, usize, Source, f64)> = Vec::new();
        let mut rows_of = vec![Vec::new(); m];
        let mut n_columns = n;
        let mut n_rows = rows.len();
        for (k, Row { row, side }) in rows.iter().enumerate() {
            let sign = if *side == Activity::Lower { -1.0 } else { 1.0 };
            if *row < n {
                entries.push((*row, k, Source::One, sign));
                continue;
            }
            rows_of[row - n].push((k, sign));
            if elastic {
                let slacks: &[f64] = if *side == Activity::Equal { &[1.0, -1.0] } else { &[-1.0] };
                for &slack in slacks {
                    entries.push((n_columns, k, Source::One, slack));
                    entries.push((n_columns, n_rows, Source::One, -1.0));
                    n_columns += 1;
                    n_rows += 1;
                }
            }
        }
        for (k, i, j) in jacobian.entries() {
            for &(row, sign) in &rows_of[i] {
                entries.push((j, row, Source::Jacobian(k), sign));
            }
        }
        entries.sort_by_key(|e| (e.0, e.1));
        let pattern = Pattern::from_entries(n_rows, n_columns, entries.iter().map(|e| (e.1, e.0)));
        let a_values = vec![0.0; entries.len()];
        let a_matrix = CscMatrix::new(n_rows, n_columns, pattern.columns, pattern.rows, a_values);

        let diagonal = (0..n).map(|i| (i, i)).collect();
        let curved = hessian.entries().map(|(_, i, j)| (i, j)).collect();
        let (pattern, [hessian_at, diagonal_at]) =
            Pattern::with_places_of(n_columns, n_columns, [curved, diagonal]);
        let p_values = vec![0.0; pattern.n_entries()];
        Self {
            n,
            n_equalities,
            p_matrix: CscMatrix::new(n_columns, n_columns, pattern.columns, pattern.rows, p_values),
            hessian_at,
            diagonal_at,
            a_matrix,
            a_sources: entries.into_iter().map(|e| (e.2, e.3)).collect(),
            q: vec![0.0; n_columns],
            b: vec![0.0; n_rows],
            rows,
            solver: None,
        }
    }

    /// Solves; p, multipliers of bounds and constraints, and which of them are active. `weight` is the ρ of the
    /// elastic mode.
    pub(crate) fn solve(
        &mut self,
        data: &Quadratic<'_>,
        weight: f64,
        p: &mut [f64],
        y: &mut [f64],
        active: &mut [Activity],
    ) -> Outcome {
        // Clarabel's tolerances are absolute: the largest weight is one.
        let scale = 1.0 / weight.max(1.0);
        self.fill(data, weight, scale);
        let mut outcome = self.run(true, data.deadline);
        if outcome == Outcome::Failed {
            // The scaling of the first data may have become useless.
            self.solver = None;
            outcome = self.run(false, data.deadline);
        }
        let Some(solver) = &self.solver else { return Outcome::Failed };
        if outcome != Outcome::Solved {
            return outcome;
        }
        let solution = &solver.solution;
        for i in 0..self.n {
            p[i] = solution.x[i].max(data.lower[i]).min(data.upper[i]);
        }
        y.fill(0.0);
        active.fill(Activity::Free);
        for (k, Row { row, side }) in self.rows.iter().enumerate() {
            let multiplier = solution.z[k] / scale;
            y[*row] += if *side == Activity::Lower { -multiplier } else { multiplier };
            if *side == Activity::Equal || solution.z[k] > solution.s[k] {
                active[*row] = *side;
            }
        }
        if p.iter().chain(y.iter()).all(|x| x.is_finite()) { Outcome::Solved } else { Outcome::Failed }
    }

    fn fill(&mut self, data: &Quadratic<'_>, weight: f64, scale: f64) {
        let values = &mut self.p_matrix.nzval;
        values.fill(0.0);
        for (&k, &h) in self.hessian_at.iter().zip(data.hessian) {
            values[k] += scale * h;
        }
        for &k in &self.diagonal_at {
            values[k] += scale * data.shift;
        }
        for (value, (source, sign)) in self.a_matrix.nzval.iter_mut().zip(&self.a_sources) {
            *value = match source {
                Source::Jacobian(k) => sign * data.jacobian[*k],
                Source::One => *sign,
            };
        }
        self.q.fill(scale * weight);
        for (q, g) in self.q.iter_mut().zip(data.gradient) {
            *q = scale * g;
        }
        self.b.fill(0.0);
        for (b, Row { row, side }) in self.b.iter_mut().zip(&self.rows) {
            *b = if *side == Activity::Lower { -data.lower[*row] } else { data.upper[*row] };
        }
    }

    fn run(&mut self, reuse: bool, deadline: Option<Instant>) -> Outcome {
        let left = deadline.map(|deadline| deadline.saturating_duration_since(Instant::now()));
        let time_limit = left.map_or(f64::INFINITY, |left| left.as_secs_f64());
        if time_limit == 0.0 {
            return Outcome::Failed;
        }
        let updated = reuse
            && self.solver.as_mut().is_some_and(|solver| {
                let settings = DefaultSettings { time_limit, ..solver.settings().clone() };
                solver.update_settings(settings).is_ok()
                    && solver
                        .update_data(&self.p_matrix.nzval, &self.q, &self.a_matrix.nzval, &self.b)
                        .is_ok()
            });
        if !updated {
            let n_inequalities = self.b.len() - self.n_equalities;
            let cones = [
                SupportedConeT::ZeroConeT(self.n_equalities),
                SupportedConeT::NonnegativeConeT(n_inequalities),
            ];
            let settings = DefaultSettings {
                verbose: false,
                presolve_enable: false,
                max_iter: 100,
                tol_gap_abs: 1e-12,
                tol_gap_rel: 1e-12,
                tol_feas: 1e-12,
                max_threads: 1,
                time_limit,
                ..DefaultSettings::default()
            };
            self.solver =
                DefaultSolver::new(&self.p_matrix, &self.q, &self.a_matrix, &self.b, &cones, settings).ok();
        }
        let Some(solver) = &mut self.solver else { return Outcome::Failed };
        solver.solve();
        match solver.solution.status {
            SolverStatus::Solved | SolverStatus::AlmostSolved => Outcome::Solved,
            SolverStatus::PrimalInfeasible | SolverStatus::AlmostPrimalInfeasible => Outcome::Infeasible,
            _ => Outcome::Failed,
        }
    }
}
