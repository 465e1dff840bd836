//! Steepest descent and L-BFGS.

use crate::problems::{D, Problem, published};
use crate::sqp::{kkt, solve};
use num_dual::DualNum;
use somersault_nlp::{GradientDescent, Lbfgs, Limits, Status};

#[test]
fn lbfgs_reaches_published_optima_within_bounds() {
    let unconstrained: Vec<Problem> =
        published().into_iter().filter(|problem| problem.constraints.is_empty()).collect();
    assert!(unconstrained.len() >= 5);
    let limits = Limits { stationarity_tol: 1e-8, ..Limits::default() };
    for problem in unconstrained {
        let report = solve(&Lbfgs { memory: 10, limits: limits.clone() }, &problem);
        println!("{} {:?} {} {:?}", problem.name, report.status, report.iterations, report.counts);
        assert_eq!(report.status, Status::Converged, "{}: {report:?}", problem.name);
        assert!((report.cost - problem.optimum).abs() < 1e-8, "{}: {}", problem.name, report.cost);
        assert!(kkt(&problem, &report).iter().all(|r| *r < 1e-6));
    }
}

/// Σ κⁱ xᵢ² / 2 with condition number κ⁴ = 10⁴.
fn ellipsoid() -> Problem {
    Problem::new("ellipsoid", &[1.0; 5], &[], &[], 0.0, |x| {
        let term = |(i, x): (usize, &D)| x.powi(2) * (0.5 * 10f64.powi(i as i32));
        vec![x.iter().enumerate().map(term).fold(D::from(0.0), |s, t| s + t)]
    })
}

#[test]
fn steepest_descent_is_slow_where_lbfgs_is_not() {
    let descent = solve(&GradientDescent::default(), &ellipsoid());
    let lbfgs = solve(&Lbfgs::default(), &ellipsoid());
    println!("{} {}", descent.iterations, lbfgs.iterations);
    assert_eq!((descent.status, lbfgs.status), (Status::Converged, Status::Converged));
    assert!(descent.iterations > 10 * lbfgs.iterations);
}

#[test]
fn costs_never_rise() {
    let problem = ellipsoid();
    let mut last = f64::INFINITY;
    let start = problem.start.as_slice().into();
    use somersault_nlp::{Flow, NlpSolver};
    GradientDescent::default()
        .solve(&mut problem.program(), &start, &mut |iteration| {
            assert!(iteration.cost < last);
            last = iteration.cost;
            Flow::Continue
        })
        .unwrap();
}

#[test]
fn unbounded_costs_are_told() {
    let problem = Problem::new("slope", &[0.0], &[], &[], f64::NAN, |x| vec![-x[0]]);
    assert_eq!(solve(&GradientDescent::default(), &problem).status, Status::Unbounded);
}
