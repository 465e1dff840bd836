//! Programs without feasible points end as such, where their violation is least; those that have some do not.

use crate::behaviour::variants;
use crate::problems::{D, FREE, INF, POSITIVE, Problem, ZERO};
use crate::sqp::solve;
use num_dual::DualNum;
use somersault_nlp::{Nlp, Report, Status};

/// Slope of half the sum of squared violations where bounds do not hold it, over the largest entry of the Jacobian and the
/// largest violation; and that violation.
pub(crate) fn slope_of_violation(problem: &Problem, report: &Report) -> (f64, f64) {
    let mut program = problem.program();
    let (n, m) = (problem.start.len(), problem.constraints.len());
    let (mut c, mut g, mut jac) = (vec![0.0; m], vec![0.0; n], vec![0.0; n * m]);
    program.evaluate(&report.z, &mut c).unwrap();
    program.differentiate(&report.z, &mut g, &mut jac).unwrap();
    let beyond = |k: usize| {
        let (lower, upper) = problem.constraints[k];
        (c[k] - upper).max(0.0) - (lower - c[k]).max(0.0)
    };
    let mut slope = 0.0f64;
    for i in 0..n {
        let pull: f64 = (0..m).map(|k| jac[i * m + k] * beyond(k)).sum();
        let (lower, upper) = problem.variables[i];
        let is_held = if pull > 0.0 { report.z[i] < lower + 1e-9 } else { report.z[i] > upper - 1e-9 };
        slope = slope.max(if is_held { 0.0 } else { pull.abs() });
    }
    let violation = (0..m).fold(0.0f64, |v, k| v.max(beyond(k).abs()));
    let size = jac.iter().fold(1e-300, |s: f64, j| s.max(j.abs()));
    (slope / (size * violation), violation)
}

pub(crate) fn without_feasible_points() -> Vec<Problem> {
    let problem = |name, start: &[f64], variables: &[(f64, f64)], constraints: &[(f64, f64)], f| {
        Problem::new(name, start, variables, constraints, f64::NAN, f)
    };
    vec![
        problem("two ends at once", &[0.3, 0.1], &[], &[ZERO, ZERO], |x| {
            vec![x[0] * x[0] + x[1] * x[1], x[0] - x[1] - 1.0, x[0] - x[1] - 2.0]
        }),
        problem("two circles", &[0.3, -2.0], &[], &[ZERO, ZERO], |x| {
            let r = x[0] * x[0] + x[1] * x[1];
            vec![x[0], r - 1.0, r - 4.0]
        }),
        problem("a row that nothing moves", &[0.3, 0.1], &[], &[ZERO, ZERO], |x| {
            vec![x[0] * x[0], x[0] + x[1] - 1.0, D::from(2.0)]
        }),
        problem("nothing moves at all", &[0.3], &[], &[ZERO], |x| vec![x[0] * x[0], D::from(2.0)]),
        problem("an end that is fixed elsewhere", &[0.0, 0.5], &[(0.0, 0.0), FREE], &[POSITIVE, ZERO], |x| {
            vec![x[1] * x[1], x[0] - 0.5, x[0] + x[1] - 1.0]
        }),
        problem("a target out of reach", &[0.1; 8], &[(-1.0, 1.0); 8], &[ZERO], |x| {
            let sum = |power: i32| {
                x.iter().enumerate().fold(D::from(0.0), |s, (k, x)| s + x.powi(power) * (k as f64 - 2.5))
            };
            vec![sum(2) * sum(2), sum(1) - 50.0]
        }),
        problem("a target out of reach of sines", &[0.01; 6], &[(-0.1, 0.1); 6], &[ZERO, ZERO], |x| {
            let sum = |shift: f64| x.iter().fold(D::from(0.0), |s, x| s + (*x + shift).sin());
            vec![x.iter().fold(D::from(0.0), |s, x| s + *x * *x), sum(0.0) - 3.0, sum(1.5) - 5.9]
        }),
        // R. Byrd, F. Curtis & J. Nocedal, SIAM J. Optim. 20 (2010) 2281-2299, problems "isolated" and "unique"
        problem("isolated", &[3.0, 2.0], &[], &[(-INF, 0.0); 4], |x| {
            let (p, q) = (x[0] * x[0] + 1.0, x[1] * x[1] + 1.0);
            vec![x[0] + x[1], p - x[1], p + x[1], q - x[0], q + x[0]]
        }),
        problem("unique", &[3.0, 2.0], &[], &[POSITIVE; 2], |x| {
            vec![x[0] + x[1], x[1] - x[0] * x[0] - 1.0, (x[1].exp() - 1.0) * -0.3]
        }),
    ]
}

#[test]
fn programs_without_feasible_points_are_infeasible_where_their_violation_is_least() {
    for problem in without_feasible_points() {
        for solver in variants() {
            let report = solve(&solver, &problem);
            let (slope, violation) = slope_of_violation(&problem, &report);
            println!(
                "{} {:?} {} {slope:.1e} {violation:.1e}",
                problem.name, report.status, report.iterations
            );
            assert_eq!(report.status, Status::Infeasible, "{} {solver:?} {report:?}", problem.name);
            assert!(slope < 1e-4 && violation > 0.1, "{} {solver:?} {slope} {violation}", problem.name);
            assert!(report.residuals.feasibility > 0.02, "{} {report:?}", problem.name);
            assert!(report.iterations < 150, "{} {solver:?} {}", problem.name, report.iterations);
        }
    }
}

#[test]
fn programs_with_hardly_a_feasible_point_are_not_infeasible() {
    let problem = |name, start: &[f64], variables: &[(f64, f64)], constraints: &[(f64, f64)], f| {
        Problem::new(name, start, variables, constraints, f64::NAN, f)
    };
    let problems = [
        problem("a corner of the bounds", &[-1.0, 0.3], &[(-2.0, 1.0); 2], &[ZERO], |x| {
            vec![x[0] * x[0] - x[1], x[0] + x[1] - 2.0]
        }),
        problem("a weak lever", &[0.0, 0.5], &[], &[ZERO, ZERO], |x| {
            vec![x[1] * x[1], x[0] * 1e-5 + x[1] - 1.0, x[1]]
        }),
        problem("two circles that touch", &[3.0, 1.0], &[], &[(-INF, 0.0); 2], |x| {
            let disc = |centre: f64| (x[0] - centre).powi(2) + x[1] * x[1] - 1.0;
            vec![x[1], disc(1.0), disc(-1.0)]
        }),
        problem("a disc of no size", &[1.0, 1.0], &[], &[(-INF, 0.0)], |x| {
            vec![x[0], x[0] * x[0] + x[1] * x[1]]
        }),
        problem("an equality twice", &[5.0, -3.0], &[], &[ZERO, ZERO], |x| {
            let c = x[0] * x[0] + x[1] - 1.0;
            vec![x[0] * x[0] + x[1] * x[1], c, c * 3.0]
        }),
    ];
    for problem in problems {
        for solver in variants() {
            let report = solve(&solver, &problem);
            println!("{} {:?} {} {:?}", problem.name, report.status, report.iterations, report.residuals);
            assert_ne!(report.status, Status::Infeasible, "{} {solver:?} {report:?}", problem.name);
            assert!(report.residuals.feasibility < 1e-6, "{} {solver:?} {report:?}", problem.name);
        }
    }
}
