//! One solve of a program of Python's.

use super::program::PythonProgram;
use crate::core::error::Error;
use crate::core::waiting::with_solution;
use crate::ocp::solver::{Watcher, duration, status_name};
use pyo3::prelude::*;
use somersault::nlp::{
    self, Bounds, InteriorPoint, Iteration, Lbfgs, Limits, NlpSolver, Pattern, SolverError, Sqp, Start,
    Structure,
};

/// Status, x, multipliers of constraints and bounds, cost, residuals, steps and counts.
type Found = (String, Vec<f64>, Vec<f64>, Vec<f64>, f64, (f64, f64, f64), usize, (usize, usize, usize));

fn found(report: nlp::Report) -> Found {
    let nlp::Report { residuals, counts, .. } = report;
    (
        status_name(report.status).to_owned(),
        report.z,
        report.constraint_multipliers,
        report.bound_multipliers,
        report.cost,
        (residuals.stationarity, residuals.feasibility, residuals.complementarity),
        report.iterations,
        (counts.evaluations, counts.gradients, counts.hessians),
    )
}

/// Solves a nonlinear program by ``'ipm'``, ``'sqp'`` or ``'lbfgs'``. Patterns are compressed columns, that of the Hessian the
/// upper triangle; `evaluate(x)` gives the cost and an array of constraints, `differentiate(x)` the gradient and the values of
/// the Jacobian, `hessian(x, cost_factor, multipliers)` those of the Hessian of the Lagrangian.
///
/// Args:
///     method: Name of the solver.
///     start: x, and multipliers of constraints and of bounds, both empty for a cold start.
///     bounds: Lower and upper bounds of x.
///     rows: Lower and upper bounds of the constraints.
///     jacobian: Starts of columns, and the row of each entry.
///     hessian: The same of the Hessian.
///     functions: `evaluate`, `differentiate` and `hessian`, the last None where there is none.
///     tol: Tolerance of all residuals.
///     max_iterations: Limit of steps.
///     max_evaluations: Limit of evaluations.
///     max_time: Limit of time in seconds.
///     callback: Called as `callback(iteration, x, cost, residual)`; what is true ends the solve.
///
/// Returns:
///     Status, x, multipliers of constraints and bounds, cost, residuals of stationarity, feasibility and complementarity, steps,
///     and counts of evaluations, gradients and Hessians.
#[pyfunction]
#[pyo3(signature = (method, start, bounds, rows, jacobian, hessian, functions, *, tol=None, max_iterations=None,
    max_evaluations=None, max_time=None, callback=None))]
pub(crate) fn solve_program(
    py: Python<'_>,
    method: &str,
    start: (Vec<f64>, Vec<f64>, Vec<f64>),
    bounds: (Vec<f64>, Vec<f64>),
    rows: (Vec<f64>, Vec<f64>),
    jacobian: (Vec<usize>, Vec<usize>),
    hessian: (Vec<usize>, Vec<usize>),
    functions: (Py<PyAny>, Py<PyAny>, Option<Py<PyAny>>),
    tol: Option<f64>,
    max_iterations: Option<usize>,
    max_evaluations: Option<usize>,
    max_time: Option<f64>,
    callback: Option<&Bound<'_, PyAny>>,
) -> Result<Found, Error> {
    let (evaluate, differentiate, second) = functions;
    let (n, m) = (bounds.0.len(), rows.0.len());
    let mut program = PythonProgram {
        structure: Structure {
            variables: Bounds { lower: bounds.0, upper: bounds.1 },
            constraints: Bounds { lower: rows.0, upper: rows.1 },
            jacobian: Pattern { n_rows: m, columns: jacobian.0, rows: jacobian.1 },
            hessian: Pattern { n_rows: n, columns: hessian.0, rows: hessian.1 },
        },
        evaluate,
        differentiate,
        hessian: second,
    };
    let (z, constraint_multipliers, bound_multipliers) = start;
    let start = Start { z, constraint_multipliers, bound_multipliers, hessian: None };
    let max_time = duration(max_time)?;
    let solver: Box<dyn NlpSolver> = match method {
        "ipm" => {
            let default = InteriorPoint::default();
            Box::new(InteriorPoint {
                stationarity_tol: tol.unwrap_or(default.stationarity_tol),
                feasibility_tol: tol.unwrap_or(default.feasibility_tol),
                complementarity_tol: tol.unwrap_or(default.complementarity_tol),
                max_iterations: max_iterations.unwrap_or(default.max_iterations),
                max_evaluations,
                max_time,
                ..default
            })
        }
        "sqp" => {
            let default = Sqp::default();
            Box::new(Sqp {
                stationarity_tol: tol.unwrap_or(default.stationarity_tol),
                feasibility_tol: tol.unwrap_or(default.feasibility_tol),
                complementarity_tol: tol.unwrap_or(default.complementarity_tol),
                max_iterations: max_iterations.unwrap_or(default.max_iterations),
                max_evaluations,
                max_time,
                ..default
            })
        }
        "lbfgs" => {
            let default = Limits::default();
            let limits = Limits {
                stationarity_tol: tol.unwrap_or(default.stationarity_tol),
                max_iterations: max_iterations.unwrap_or(default.max_iterations),
                max_evaluations,
                max_time,
                ..default
            };
            Box::new(Lbfgs { limits, ..Lbfgs::default() })
        }
        other => {
            return Err(Error::input(format!("`method` must be 'ipm', 'sqp' or 'lbfgs', found '{other}'")));
        }
    };
    let mut watcher = Watcher::new(callback)?;
    let solved = solver.solve(&mut program, &start, &mut |iteration: &Iteration<'_>| watcher.look(iteration));
    let report = match solved {
        Ok(report) => report,
        Err(SolverError::Failed { source, report }) => {
            let error = Error::failed(source).into();
            return Err(with_solution(py, error, found(*report)));
        }
        Err(error) => return Err(error.into()),
    };
    match watcher.into_raised() {
        Some(error) => Err(with_solution(py, error, found(report))),
        None => Ok(found(report)),
    }
}
