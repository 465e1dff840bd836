//! Sequential quadratic programming on problems with published optima.

use crate::problems::{Problem, published, waechter_biegler};
use somersault_nlp::{Flow, Globalisation, HessianSource, Nlp, NlpSolver, Report, Sqp, Start, Status};

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
    let largest = report.constraint_multipliers.iter().fold(1.0f64, |l, y| l.max(y.abs()));
    let rows = report.z.iter().zip(&report.bound_multipliers).zip(&problem.variables);
    let more = c.iter().zip(&report.constraint_multipliers).zip(&problem.constraints);
    for ((&value, &y), &(lower, upper)) in rows.chain(more) {
        worst[1] = worst[1].max(lower - value).max(value - upper);
        let bound = if y > 0.0 { upper } else { lower };
        // less is rounding of the largest multiplier
        if y.abs() > f64::EPSILON * largest {
            assert!(bound.is_finite(), "{}: multiplier {y} without a bound", problem.name);
            worst[2] = worst[2].max(y.abs() * (value - bound).abs());
        }
    }
    worst
}

fn solves_published_problems(solver: &Sqp, most_steps: usize) {
    let mut failures = Vec::new();
    let mut steps = Vec::new();
    for problem in published().into_iter().chain([waechter_biegler()]) {
        let report = solve(solver, &problem);
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
        steps.push(report.iterations);
    }
    assert!(failures.is_empty(), "{solver:?}: {failures:?}");
    steps.sort_unstable();
    let (median, sum) = (steps[(steps.len() - 1) / 2], steps.iter().sum::<usize>());
    println!("{solver:?}: median {median}, sum {sum}");
    assert!(median <= most_steps, "{solver:?}: {median}");
}

#[test]
fn exact_hessians_reach_published_optima_in_six_steps_at_the_median() {
    for globalisation in [Globalisation::Merit, Globalisation::Filter] {
        solves_published_problems(&Sqp { globalisation, ..Sqp::default() }, 6);
    }
}

#[test]
fn quasi_newton_reaches_published_optima_in_nine_steps_at_the_median() {
    for globalisation in [Globalisation::Merit, Globalisation::Filter] {
        let hessian = HessianSource::QuasiNewton;
        solves_published_problems(&Sqp { hessian, globalisation, ..Sqp::default() }, 9);
    }
}
