//! The interior-point method on problems with published optima, without feasible points, and at random.

use crate::infeasible::{slope_of_violation, without_feasible_points};
use crate::problems::{FREE, POSITIVE, Problem, ZERO, published, waechter_biegler};
use crate::random::Quadratic;
use crate::sqp::{kkt, solve};
use num_dual::DualNum;
use somersault_nlp::{
    Bounds, Curvature, EvaluationError, Flow, HessianSource, InteriorPoint, Nlp, NlpSolver, Pattern, Start,
    Status, Structure,
};

fn solves_published_problems(solver: &InteriorPoint, most_steps: usize) {
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
        if report.status != Status::Converged || error > 1e-6 || residuals.iter().any(|r| *r > 1e-6 * scale) {
            failures.push(problem.name);
        }
        steps.push(report.iterations);
    }
    steps.sort_unstable();
    let (median, sum) = (steps[(steps.len() - 1) / 2], steps.iter().sum::<usize>());
    println!("{solver:?}: median {median}, sum {sum}");
    assert!(failures.is_empty(), "{solver:?}: {failures:?}");
    assert!(median <= most_steps, "{solver:?}: {median}");
}

#[test]
fn exact_hessians_reach_published_optima() {
    solves_published_problems(&InteriorPoint::default(), 12);
}

#[test]
fn quasi_newton_reaches_published_optima() {
    solves_published_problems(
        &InteriorPoint { hessian: HessianSource::QuasiNewton, ..InteriorPoint::default() },
        20,
    );
}

#[test]
fn programs_without_feasible_points_are_infeasible_where_their_violation_is_least() {
    let mut failures = Vec::new();
    for problem in without_feasible_points() {
        let report = solve(&InteriorPoint::default(), &problem);
        let (slope, violation) = slope_of_violation(&problem, &report);
        println!("{} {:?} {} {slope:.1e} {violation:.1e}", problem.name, report.status, report.iterations);
        if report.status != Status::Infeasible || report.residuals.feasibility < 0.02 {
            failures.push(problem.name);
        }
    }
    assert!(failures.is_empty(), "{failures:?}");
}

#[test]
fn random_quadratic_programs_are_solved_and_contradicted_ones_infeasible() {
    let solver = InteriorPoint::default();
    let (mut failures, mut steps) = (Vec::new(), 0);
    for seed in 0..200u64 {
        let (n, m) = (1 + seed as usize % 12, (seed as usize * 7) % 17);
        let rank = if seed % 3 == 0 { n / 2 } else { n };
        for concave in [0.0, 0.5] {
            let mut program = Quadratic::new(n, m, rank, concave, seed);
            let report =
                solver.solve(&mut program, &Start::from(vec![1.0; n]), &mut |_| Flow::Continue).unwrap();
            steps += report.iterations;
            let error = program.error(&report);
            if report.status != Status::Converged || error > 1e-6 {
                failures
                    .push(format!("{seed} {concave} {:?} {error:.1e} {}", report.status, report.iterations));
            }
        }
        let mut program = Quadratic::new(n, 3 + m, n, 0.0, seed).contradicted();
        let report = solver.solve(&mut program, &Start::from(vec![1.0; n]), &mut |_| Flow::Continue).unwrap();
        if report.status != Status::Infeasible || report.residuals.feasibility < 0.1 {
            failures.push(format!("contradicted {seed} {:?} {}", report.status, report.iterations));
        }
    }
    println!("{steps} steps");
    assert!(failures.is_empty(), "{failures:#?}");
}

/// ½ ‖D v‖² − Σ v over a square of `k` × `k` nodes between 0 and the distance to its edge: the torsion of an elastic–plastic
/// bar (R. Glowinski, Numerical Methods for Nonlinear Variational Problems, 1984; CUTEst TORSION).
struct Torsion {
    k: usize,
    structure: Structure,
    linear: f64,
}

impl Torsion {
    fn new(k: usize, load: f64) -> Self {
        let step = 1.0 / (k + 1) as f64;
        let mut variables = Bounds::default();
        for i in 0..k * k {
            let edge = |j: usize| (j + 1).min(k - j) as f64 * step;
            let distance = edge(i / k).min(edge(i % k));
            variables.push(-distance, distance);
        }
        let below = (0..k * k).flat_map(move |j| {
            let (left, up) = (j % k > 0, j >= k);
            [Some((j, j)), left.then(|| (j - 1, j)), up.then(|| (j - k, j))].into_iter().flatten()
        });
        let structure = Structure {
            hessian: Pattern::from_entries(k * k, k * k, below),
            jacobian: Pattern::from_entries(0, k * k, []),
            constraints: Bounds::default(),
            variables,
        };
        Self { k, structure, linear: load * step * step }
    }

    /// The product of the five-point stencil.
    fn stencil(&self, z: &[f64], i: usize) -> f64 {
        let k = self.k;
        let at = |is_there: bool, j: usize| if is_there { z[j] } else { 0.0 };
        4.0 * z[i]
            - at(!i.is_multiple_of(k), i.wrapping_sub(1))
            - at(i % k + 1 < k, i + 1)
            - at(i >= k, i.wrapping_sub(k))
            - at(i + k < k * k, i + k)
    }
}

impl Nlp for Torsion {
    fn structure(&self) -> &Structure {
        &self.structure
    }

    fn evaluate(&mut self, z: &[f64], _: &mut [f64]) -> Result<f64, EvaluationError> {
        Ok((0..z.len()).map(|i| (0.5 * self.stencil(z, i) - self.linear) * z[i]).sum())
    }

    fn differentiate(
        &mut self,
        z: &[f64],
        gradient: &mut [f64],
        _: &mut [f64],
    ) -> Result<(), EvaluationError> {
        for (i, slope) in gradient.iter_mut().enumerate() {
            *slope = self.stencil(z, i) - self.linear;
        }
        Ok(())
    }

    fn curvature(&self) -> Curvature {
        Curvature::Exact
    }

    fn hessian(
        &mut self,
        _: &[f64],
        cost_factor: f64,
        _: &[f64],
        hessian: &mut [f64],
    ) -> Result<(), EvaluationError> {
        for (k, i, j) in self.structure.hessian.entries() {
            hessian[k] = cost_factor * if i == j { 4.0 } else { -1.0 };
        }
        Ok(())
    }
}

#[test]
fn a_bar_in_torsion_of_20000_variables_takes_few_steps() {
    let mut bar = Torsion::new(141, 5.0);
    let n = bar.structure.variables.len();
    let began = std::time::Instant::now();
    let report = InteriorPoint::default()
        .solve(&mut bar, &Start::from(vec![0.0; n]), &mut |_| Flow::Continue)
        .unwrap();
    println!("{:?} {} {:?} {:?}", report.status, report.iterations, report.counts, began.elapsed());
    assert_eq!(report.status, Status::Converged);
    assert!(report.iterations <= 25, "{}", report.iterations);
    let plastic = (0..n).filter(|&i| bar.structure.variables.upper[i] - report.z[i] < 1e-4).count();
    println!("{plastic} plastic, cost {:.10}", report.cost);
    // symmetric as the bar is, and held where it is plastic
    let k = bar.k;
    for i in 0..n {
        assert!((report.z[i] - report.z[n - 1 - i]).abs() < 1e-6);
        assert!((report.z[i] - report.z[i % k * k + i / k]).abs() < 1e-6);
        let slope = bar.stencil(&report.z, i) - bar.linear;
        assert!((slope + report.bound_multipliers[i]).abs() < 1e-7);
    }
    assert!(plastic > n / 10, "{plastic}");
}

#[test]
fn a_warm_start_takes_fewer_steps() {
    let problems = published();
    let solver = InteriorPoint::default();
    let (mut cold, mut warm) = (0, 0);
    for problem in &problems {
        let report = solve(&solver, problem);
        let again = solver.solve(&mut problem.program(), &report.start(), &mut |_| Flow::Continue).unwrap();
        assert!(again.status.is_converged(), "{} {again:?}", problem.name);
        cold += report.iterations;
        warm += again.iterations;
    }
    println!("{cold} steps from the start, {warm} from the end");
    assert!(2 * warm < cold, "{cold} {warm}");
}

#[test]
fn limits_and_wishes_end_a_solve_with_its_best_iterate() {
    let problem = &published()[0];
    let start = Start::from(problem.start.as_slice());
    let status = |solver: &InteriorPoint| {
        solver.solve(&mut problem.program(), &start, &mut |_| Flow::Continue).unwrap().status
    };
    let solver = InteriorPoint::default();
    assert_eq!(status(&InteriorPoint { max_iterations: 3, ..solver.clone() }), Status::IterationLimit);
    assert_eq!(
        status(&InteriorPoint { max_evaluations: Some(3), ..solver.clone() }),
        Status::EvaluationLimit
    );
    let no_time = Some(std::time::Duration::ZERO);
    assert_eq!(status(&InteriorPoint { max_time: no_time, ..solver.clone() }), Status::TimeLimit);
    let stopped = solver
        .solve(&mut problem.program(), &start, &mut |i| {
            if i.number == 2 { Flow::Stop } else { Flow::Continue }
        })
        .unwrap();
    assert_eq!((stopped.status, stopped.iterations), (Status::Stopped, 2));
}

#[test]
fn unbounded_costs_and_missing_values_are_named() {
    let free = [FREE; 2];
    let unbounded = Problem::new("a plane", &[1.0, 1.0], &free, &[POSITIVE], f64::NAN, |x| {
        vec![-x[0] - x[1], x[0] - x[1]]
    });
    let report = solve(&InteriorPoint::default(), &unbounded);
    assert_eq!(report.status, Status::Unbounded, "{report:?}");
    let missing = Problem::new("a logarithm", &[-1.0], &[FREE], &[], f64::NAN, |x| vec![x[0].ln()]);
    assert_eq!(solve(&InteriorPoint::default(), &missing).status, Status::Undefined);
    // from 0.5 Newton's step leads where the logarithm has no value
    let stepped = Problem::new("x − ln x", &[5.0], &[FREE], &[], 1.0, |x| vec![x[0] - x[0].ln()]);
    let report = solve(&InteriorPoint::default(), &stepped);
    assert!(report.status.is_converged() && (report.cost - 1.0).abs() < 1e-9, "{report:?}");
}

#[test]
fn degenerate_programs_are_solved_or_stall_honestly() {
    // the gradients of the active rows depend on each other; twice the same row; HS 13, whose minimum has no multipliers
    let problem = |name, start: &[f64], variables: &[(f64, f64)], constraints: &[(f64, f64)], optimum, f| {
        Problem::new(name, start, variables, constraints, optimum, f)
    };
    let programs = [
        problem("an equality twice", &[5.0, -3.0], &[], &[ZERO, ZERO], 0.75, |x| {
            let c = x[0] * x[0] + x[1] - 1.0;
            vec![x[0] * x[0] + x[1] * x[1], c, c * 3.0]
        }),
        problem("three rows through a corner", &[3.0, 3.0], &[], &[POSITIVE; 3], 2.0, |x| {
            vec![x[0] * x[0] + x[1] * x[1], x[0] - 1.0, x[1] - 1.0, x[0] + x[1] - 2.0]
        }),
        problem("fixed and free", &[2.0, 5.0, 1.0], &[(3.0, 3.0), FREE, POSITIVE], &[ZERO, FREE], 5.0, |x| {
            vec![x[1] * x[1] + x[2], x[0] + x[1] - 5.0 + x[2], x[1] * x[2]]
        }),
    ];
    for problem in programs {
        let report = solve(&InteriorPoint::default(), &problem);
        println!("{} {report:?}", problem.name);
        assert_eq!(report.status, Status::Converged, "{} {report:?}", problem.name);
    }
    let corner = problem("HS 13", &[-2.0, -2.0], &[POSITIVE; 2], &[POSITIVE], 1.0, |x| {
        vec![(x[0] - 2.0).powi(2) + x[1] * x[1], (-x[0] + 1.0).powi(3) - x[1]]
    });
    let report = solve(&InteriorPoint::default(), &corner);
    println!("{report:?}");
    assert!((report.cost - 1.0).abs() < 0.05, "{report:?}");
    let largest = kkt(&corner, &report).into_iter().fold(0.0, f64::max);
    assert!(!report.status.is_converged() || largest < 1e-4, "{report:?}");
}
