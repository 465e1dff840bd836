//! Programs whose rows depend on each other: published ones with each row again, three times as large, and the sum of all equalities.

use crate::behaviour::variants;
use crate::problems::{Differentiated, Problem, published};
use nalgebra::{DMatrix, DVector};
use somersault_nlp::{Bounds, Curvature, EvaluationError, Flow, Nlp, NlpSolver, Pattern, Start, Structure};

/// A program with rows that depend on its own: A c for a matrix A that begins with the identity.
struct Combined {
    program: Differentiated,
    rows: DMatrix<f64>,
    structure: Structure,
}

impl Combined {
    /// Each constraint again, three times as large, and the sum of all equalities.
    fn of(problem: &Problem) -> Self {
        let (n, m) = (problem.start.len(), problem.constraints.len());
        let is_equal = |k: usize| problem.constraints[k].0 == problem.constraints[k].1;
        let equalities = (0..m).filter(|&k| is_equal(k)).count();
        let n_rows = 2 * m + usize::from(equalities > 1);
        let rows = DMatrix::from_fn(n_rows, m, |i, k| match i {
            _ if i < m => f64::from(u8::from(i == k)),
            _ if i < 2 * m => 3.0 * f64::from(u8::from(i - m == k)),
            _ => f64::from(u8::from(is_equal(k))),
        });
        let mut constraints = Bounds::default();
        for i in 0..n_rows {
            let (lower, upper) = match i {
                _ if i < m => problem.constraints[i],
                _ if i < 2 * m => (3.0 * problem.constraints[i - m].0, 3.0 * problem.constraints[i - m].1),
                _ => {
                    let sum = (0..m).filter(|&k| is_equal(k)).map(|k| problem.constraints[k].0).sum();
                    (sum, sum)
                }
            };
            constraints.push(lower, upper);
        }
        let program = problem.program();
        let jacobian = Pattern::dense(n_rows, n);
        let structure = Structure { constraints, jacobian, ..program.structure.clone() };
        Self { program, rows, structure }
    }
}

impl Nlp for Combined {
    fn structure(&self) -> &Structure {
        &self.structure
    }

    fn evaluate(&mut self, z: &[f64], constraints: &mut [f64]) -> Result<f64, EvaluationError> {
        let mut own = DVector::zeros(self.rows.ncols());
        let cost = self.program.evaluate(z, own.as_mut_slice())?;
        constraints.copy_from_slice((&self.rows * own).as_slice());
        Ok(cost)
    }

    fn differentiate(
        &mut self,
        z: &[f64],
        gradient: &mut [f64],
        jacobian: &mut [f64],
    ) -> Result<(), EvaluationError> {
        let mut own = DMatrix::zeros(self.rows.ncols(), z.len());
        self.program.differentiate(z, gradient, own.as_mut_slice())?;
        jacobian.copy_from_slice((&self.rows * own).as_slice());
        Ok(())
    }

    fn curvature(&self) -> Curvature {
        Curvature::Exact
    }

    fn hessian(
        &mut self,
        z: &[f64],
        cost_factor: f64,
        multipliers: &[f64],
        hessian: &mut [f64],
    ) -> Result<(), EvaluationError> {
        let own = self.rows.transpose() * DVector::from_column_slice(multipliers);
        self.program.hessian(z, cost_factor, own.as_slice(), hessian)
    }
}

#[test]
fn published_optima_are_reached_where_all_rows_depend_on_others() {
    let mut failures = Vec::new();
    for problem in published().into_iter().filter(|problem| !problem.constraints.is_empty()) {
        for solver in variants() {
            let start = Start::from(problem.start.as_slice());
            let mut program = Combined::of(&problem);
            let report = solver.solve(&mut program, &start, &mut |_| Flow::Continue).unwrap();
            let error = (report.cost - problem.optimum).abs() / problem.optimum.abs().max(1.0);
            if !report.status.is_converged() || error > 1e-7 {
                failures.push(format!(
                    "{} {:?} {:?} {error:.1e} {}",
                    problem.name, solver.globalisation, report.status, report.iterations
                ));
            }
        }
    }
    assert!(failures.is_empty(), "{failures:#?}");
}
