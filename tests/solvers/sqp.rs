//! Sequential quadratic programming on problems with published optima.

use crate::problems::{Problem, published};
use somersault_ocp::nlp::Nlp;
use somersault_ocp::solver::{Flow, HessianSource, NlpSolver, Report, Sqp, Start, Status};

pub(crate) fn solve(solver: &dyn NlpSolver, problem: &Problem) -> Report {
    let start = Start::from(problem.start.as_slice());
    solver.solve(&mut problem.program(), &start, &mut |_| Flow::Continue).expect("the problem is well posed")
}

/// Residuals without any scale, computed from the definitions: stationarity, violation, complementarity.
pub(crate) fn kkt(problem: &Problem, report: &Report) -> [f64; 3] {
    let mut program = problem.program();
    let (n, m) = (problem.start.len(), problem.constraints.len());
    let (mut c, mut g, mut jac) = (vec![0.0; m], vec![0.0; n], vec![0.0; n * m]);
    program.evaluate(&report.z, &mut c).unwrap();
    program.differentiate(&report.z, &mut g, &mut jac).unwrap();
    let mut worst = [0.0f64; 3];
    for i in 0..n {
        let y: f64 = (0..m).map(|k| jac[i * m + k] * report.constraint_multipliers[k]).sum();
        worst[0] = worst[0].max((g[i] + y + report.bound_multipliers[i]).abs());
    }
    let rows = report.z.iter().zip(&report.bound_multipliers).zip(&problem.variables);
    let more = c.iter().zip(&report.constraint_multipliers).zip(&problem.constraints);
    for ((&value, &y), &(lower, upper)) in rows.chain(more) {
        worst[1] = worst[1].max(lower - value).max(value - upper);
        let bound = if y > 0.0 { upper } else { lower };
        if y != 0.0 {
            assert!(bound.is_finite(), "{}: multiplier {y} without a bound", problem.name);
            worst[2] = worst[2].max(y.abs() * (value - bound).abs());
        }
    }
    worst
}

fn reaches_published_optima(source: HessianSource) {
    let solver = Sqp { hessian: source, ..Sqp::default() };
    let mut failures = Vec::new();
    for problem in published() {
        let report = solve(&solver, &problem);
        let error = (report.cost - problem.optimum).abs() / problem.optimum.abs().max(1.0);
        let residuals = kkt(&problem, &report);
        println!(
            "{:20} {:?} {:.10} error {error:.1e} kkt {residuals:?} iterations {} {:?}",
            problem.name, report.status, report.cost, report.iterations, report.counts
        );
        let scale = report.constraint_multipliers.iter().fold(1.0f64, |s, y| s.max(y.abs()));
        if report.status != Status::Converged || error > 2e-8 || residuals.iter().any(|r| *r > 1e-6 * scale) {
            failures.push(problem.name);
        }
    }
    assert!(failures.is_empty(), "{failures:?}");
}

#[test]
fn exact_hessians_reach_published_optima() {
    reaches_published_optima(HessianSource::Offered);
}

#[test]
fn quasi_newton_reaches_published_optima() {
    reaches_published_optima(HessianSource::QuasiNewton);
}
