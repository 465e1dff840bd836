//! What solvers do where there is no solution, where functions fail, and when they are asked to stop.

use crate::problems::{D, FREE, Functions, INF, POSITIVE, Problem, ZERO, published, waechter_biegler};
use crate::sqp::solve;
use num_dual::DualNum;
use somersault_nlp::{
    Bounds, Curvature, EvaluationError, Flow, Globalisation, GradientDescent, HessianSource, InteriorPoint,
    Lbfgs, Limits, Nlp, NlpSolver, NoHessian, Pattern, Report, SolverError, Sqp, Start, Status, Structure,
};
use std::time::Duration;

/// A program that asks first whether it may be evaluated.
pub(crate) struct Guarded<'a, N> {
    pub(crate) inner: N,
    pub(crate) guard: &'a mut dyn FnMut(&[f64]) -> Result<(), EvaluationError>,
}

impl<N: Nlp> Nlp for Guarded<'_, N> {
    fn structure(&self) -> &Structure {
        self.inner.structure()
    }

    fn evaluate(&mut self, z: &[f64], constraints: &mut [f64]) -> Result<f64, EvaluationError> {
        (self.guard)(z)?;
        self.inner.evaluate(z, constraints)
    }

    fn differentiate(
        &mut self,
        z: &[f64],
        gradient: &mut [f64],
        jacobian: &mut [f64],
    ) -> Result<(), EvaluationError> {
        self.inner.differentiate(z, gradient, jacobian)
    }

    fn curvature(&self) -> Curvature {
        self.inner.curvature()
    }

    fn hessian(
        &mut self,
        z: &[f64],
        cost_factor: f64,
        multipliers: &[f64],
        hessian: &mut [f64],
    ) -> Result<(), EvaluationError> {
        self.inner.hessian(z, cost_factor, multipliers, hessian)
    }
}

fn problem(start: &[f64], variables: &[(f64, f64)], constraints: &[(f64, f64)], f: Functions) -> Problem {
    Problem::new("", start, variables, constraints, f64::NAN, f)
}

fn named(name: &str) -> Problem {
    published().into_iter().find(|p| p.name == name).unwrap()
}

/// Every Hessian with every globalisation, and with crossover.
pub(crate) fn variants() -> [Sqp; 6] {
    use Globalisation::{Filter, Merit};
    use HessianSource::{Offered, QuasiNewton};
    [
        (Offered, Merit, false),
        (QuasiNewton, Merit, false),
        (Offered, Filter, false),
        (QuasiNewton, Filter, false),
        (Offered, Filter, true),
        (QuasiNewton, Filter, true),
    ]
    .map(|(hessian, globalisation, crossover)| Sqp {
        hessian,
        globalisation,
        crossover,
        ..Sqp::default()
    })
}

fn squares(x: &[D]) -> D {
    x[0] * x[0] + x[1] * x[1]
}

#[test]
fn contradictory_constraints_end_where_their_violation_is_least() {
    // The sum of squared violations of x² + y² ≤ 1 and x + y ≥ 3 is least at x = y = t with 4 t³ = 3: its slope is
    // 8 t (2 t² − 1) − 4 (3 − 2 t). The sum itself has its corner at t = 1/√2.
    let problem =
        problem(&[2.0, -1.0], &[], &[(-INF, 1.0), (3.0, INF)], |x| vec![x[0], squares(x), x[0] + x[1]]);
    for solver in variants() {
        let report = solve(&solver, &problem);
        assert_eq!(report.status, Status::Infeasible, "{report:?}");
        let t = 0.75f64.cbrt();
        assert!(report.z.iter().all(|z| (z - t).abs() < 1e-4), "{report:?}");
        assert!(report.residuals.feasibility > 0.1);
    }
}

#[test]
fn contradictory_linear_constraints_are_infeasible() {
    let problem =
        problem(&[0.0, 0.0], &[], &[(1.0, INF), (-INF, 0.0)], |x| vec![squares(x), x[0] + x[1], x[0] + x[1]]);
    for solver in variants() {
        assert_eq!(solve(&solver, &problem).status, Status::Infeasible);
    }
}

#[test]
fn the_start_of_waechter_and_biegler_leads_to_the_minimum() {
    // At (−1, 0, 0) the sum |x₁² − x₂ − 1| + |x₁ − x₃ − ½| is least among all neighbours with x₂, x₃ ≥ 0: along +x₁
    // the first grows with slope 2, along −x₁ the second with slope 1. The sum of squares falls along +x₁.
    for solver in variants() {
        let report = solve(&solver, &waechter_biegler());
        assert_eq!(report.status, Status::Converged, "{solver:?} {report:?}");
        for (z, expected) in report.z.iter().zip([1.0, 0.0, 0.5]) {
            assert!((z - expected).abs() < 1e-7, "{solver:?} {report:?}");
        }
    }
}

#[test]
fn dependent_constraints_do_not_disturb() {
    // x + y = 1 twice and 2 (x + y) ≥ 2, nearest to the origin at (½, ½).
    let problem = problem(&[3.0, -4.0], &[], &[ZERO, ZERO, POSITIVE], |x| {
        let c = x[0] + x[1] - 1.0;
        vec![squares(x), c, c, c * 2.0]
    });
    for solver in variants() {
        let report = solve(&solver, &problem);
        assert_eq!(report.status, Status::Converged, "{report:?}");
        assert!((report.cost - 0.5).abs() < 1e-8);
    }
}

#[test]
fn a_minimum_without_multipliers_is_approached() {
    // HS 13: the constraint qualification fails at the minimum (1, 0), f = 1, which has no multipliers.
    let problem = problem(&[-2.0, -2.0], &[POSITIVE; 2], &[POSITIVE], |x| {
        vec![(x[0] - 2.0).powi(2) + x[1] * x[1], (-x[0] + 1.0).powi(3) - x[1]]
    });
    for solver in variants() {
        let report = solve(&solver, &problem);
        println!("{report:?}");
        assert!((report.cost - 1.0).abs() < 1e-2, "{report:?}");
        assert!(report.residuals.feasibility < 1e-6, "{report:?}");
    }
}

#[test]
fn unbounded_costs_are_told() {
    let falling: [Functions; 2] = [|x| vec![-x[0], x[0] - x[1]], |x| vec![-squares(x), x[0] - x[1]]];
    for functions in falling {
        for solver in variants() {
            let report = solve(&solver, &problem(&[1.0, 1.0], &[], &[ZERO], functions));
            assert_eq!(report.status, Status::Unbounded, "{report:?}");
        }
    }
}

#[test]
fn steps_into_undefined_regions_are_shortened() {
    // x − ln x, least at 1, is NaN for x < 0; Newton's step from 10 leads to −80.
    let problem = problem(&[10.0], &[], &[], |x| vec![x[0] - x[0].ln()]);
    let solvers: [&dyn NlpSolver; 4] =
        [&variants()[0], &variants()[1], &Lbfgs::default(), &GradientDescent::default()];
    for solver in solvers {
        let report = solve(solver, &problem);
        assert_eq!(report.status, Status::Converged, "{report:?}");
        assert!((report.z[0] - 1.0).abs() < 1e-5, "{report:?}");
    }
}

#[test]
fn a_start_without_a_value_is_told() {
    let problem = problem(&[-1.0], &[], &[], |x| vec![x[0] - x[0].ln()]);
    let solvers: [&dyn NlpSolver; 3] = [&variants()[0], &Lbfgs::default(), &GradientDescent::default()];
    for solver in solvers {
        let report = solve(solver, &problem);
        assert_eq!(report.status, Status::Undefined);
        assert_eq!(report.z, [-1.0]);
    }
}

#[derive(Debug)]
struct Key;

impl std::fmt::Display for Key {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("the user pressed a key")
    }
}

impl std::error::Error for Key {}

#[test]
fn a_program_without_variables_has_its_only_point() {
    let constant = Problem::new("constant", &[], &[], &[], 3.0, |_| vec![D::from(3.0)]);
    let solvers: [&dyn NlpSolver; 3] = [&Sqp::default(), &InteriorPoint::default(), &Lbfgs::default()];
    for solver in solvers {
        let report = solver.solve(&mut constant.program(), &[].as_slice().into(), &mut |_| Flow::Continue);
        let report = report.unwrap();
        assert_eq!((report.status, report.cost, report.z.len()), (Status::Converged, 3.0, 0));
    }
    let impossible = Problem::new("impossible", &[], &[], &[ZERO], 3.0, |_| vec![D::from(3.0), D::from(1.0)]);
    for solver in &solvers[..2] {
        let report = solver.solve(&mut impossible.program(), &[].as_slice().into(), &mut |_| Flow::Continue);
        assert_eq!(report.unwrap().status, Status::Infeasible);
    }
}

#[test]
fn errors_of_the_user_come_out_with_the_best_iterate() {
    let rosenbrock = named("extended Rosenbrock");
    let solvers: [&dyn NlpSolver; 3] = [&variants()[0], &Lbfgs::default(), &GradientDescent::default()];
    for solver in solvers {
        for limit in [0, 8] {
            let mut evaluations = 0;
            let mut guard = |_: &[f64]| {
                evaluations += 1;
                if evaluations > limit { Err(EvaluationError::Failed(Box::new(Key))) } else { Ok(()) }
            };
            let mut program = Guarded { inner: rosenbrock.program(), guard: &mut guard };
            let start = Start::from(rosenbrock.start.as_slice());
            let mut least = f64::INFINITY;
            let outcome = solver.solve(&mut program, &start, &mut |iteration| {
                least = least.min(iteration.cost);
                Flow::Continue
            });
            let Err(SolverError::Failed { source, report }) = outcome else { panic!("{outcome:?}") };
            assert!(source.downcast_ref::<Key>().is_some());
            assert_eq!(report.status, Status::Failed);
            if limit == 0 {
                assert_eq!(report.z, rosenbrock.start);
                assert!(report.cost.is_nan());
            } else {
                assert_eq!(report.cost, least);
            }
        }
    }
}

#[test]
fn callbacks_stop_a_solve() {
    let rosenbrock = named("extended Rosenbrock");
    let solvers: [&dyn NlpSolver; 3] = [&variants()[0], &Lbfgs::default(), &GradientDescent::default()];
    for solver in solvers {
        let mut last = Vec::new();
        let report = solver
            .solve(&mut rosenbrock.program(), &Start::from(rosenbrock.start.as_slice()), &mut |iteration| {
                last = iteration.z.to_vec();
                if iteration.number == 3 { Flow::Stop } else { Flow::Continue }
            })
            .unwrap();
        assert_eq!((report.status, report.iterations), (Status::Stopped, 3));
        assert_eq!(report.z, last);
    }
}

#[test]
fn limits_are_kept() {
    let rosenbrock = named("extended Rosenbrock");
    let report = solve(&Sqp { max_iterations: 2, ..Sqp::default() }, &rosenbrock);
    assert_eq!((report.status, report.iterations), (Status::IterationLimit, 2));
    let report = solve(&Sqp { max_time: Some(Duration::ZERO), ..Sqp::default() }, &rosenbrock);
    assert_eq!((report.status, report.iterations), (Status::TimeLimit, 0));
}

/// One variable, z²/2, each evaluation slow and all but the first without a value.
struct Slow(Structure, usize);

impl Nlp for Slow {
    fn structure(&self) -> &Structure {
        &self.0
    }

    fn evaluate(&mut self, z: &[f64], _: &mut [f64]) -> Result<f64, EvaluationError> {
        self.1 += 1;
        std::thread::sleep(Duration::from_millis(20));
        if self.1 == 1 { Ok(0.5 * z[0] * z[0]) } else { Err(EvaluationError::Undefined { what: "z".into() }) }
    }

    fn differentiate(
        &mut self,
        z: &[f64],
        gradient: &mut [f64],
        _: &mut [f64],
    ) -> Result<(), EvaluationError> {
        gradient[0] = z[0];
        Ok(())
    }

    fn curvature(&self) -> Curvature {
        Curvature::None
    }

    fn hessian(&mut self, _: &[f64], _: f64, _: &[f64], _: &mut [f64]) -> Result<(), EvaluationError> {
        Err(NoHessian.into())
    }
}

#[test]
fn the_limit_of_time_holds_within_a_line_search() {
    let limit = Some(Duration::from_millis(50));
    let solvers: [&dyn NlpSolver; 3] = [
        &Sqp { max_time: limit, ..Sqp::default() },
        &Lbfgs { limits: Limits { max_time: limit, ..Limits::default() }, ..Lbfgs::default() },
        &GradientDescent { limits: Limits { max_time: limit, ..Limits::default() } },
    ];
    for (number, solver) in solvers.into_iter().enumerate() {
        let structure = Structure {
            variables: Bounds::free(1),
            constraints: Bounds::default(),
            jacobian: Pattern::dense(0, 1),
            hessian: Pattern::upper_triangle(1),
        };
        let mut slow = Slow(structure, 0);
        let report = solver.solve(&mut slow, &vec![1.0].into(), &mut |_| Flow::Continue).unwrap();
        // the first, and what begins within the limit
        assert_eq!((report.status, report.z), (Status::TimeLimit, vec![1.0]), "{number}");
        assert!(slow.1 <= 4, "{number}: {} evaluations", slow.1);
    }
}

#[test]
fn a_warm_start_saves_steps() {
    for solver in variants() {
        for name in ["HS 71", "HS 43", "HS 100", "HS 77"] {
            let problem = named(name);
            let cold = solve(&solver, &problem);
            let resume = |problem: &Problem| -> Report {
                solver.solve(&mut problem.program(), &cold.start(), &mut |_| Flow::Continue).unwrap()
            };
            assert_eq!(resume(&problem).iterations, 0, "{name}");
            let mut moved = problem.clone();
            for (lower, upper) in &mut moved.constraints {
                *lower += 1e-3;
                *upper += 1e-3;
            }
            let warm = resume(&moved);
            assert_eq!(warm.status, Status::Converged);
            let exact = solver.hessian == HessianSource::Offered;
            assert!(warm.iterations <= if exact { 3 } else { 8 }, "{name}: {}", warm.iterations);
            assert!(warm.iterations < cold.iterations, "{name}");
        }
    }
}

#[test]
fn a_start_out_of_bounds_is_moved_within() {
    let mut problem = named("HS 71");
    problem.start = vec![-100.0, 100.0, 7.0, 0.0];
    let bounds = problem.variables.clone();
    let solver = Sqp::default();
    let report = solver
        .solve(&mut problem.program(), &Start::from(problem.start.as_slice()), &mut |iteration| {
            assert!(iteration.z.iter().zip(&bounds).all(|(z, b)| b.0 <= *z && *z <= b.1));
            Flow::Continue
        })
        .unwrap();
    assert_eq!(report.status, Status::Converged);
}

fn error(change: impl Fn(&mut Structure, &mut Start, &mut Sqp)) -> String {
    let problem = named("HS 71");
    let mut program = problem.program();
    let mut start = Start::from(problem.start.as_slice());
    let mut solver = Sqp::default();
    change(&mut program.structure, &mut start, &mut solver);
    match solver.solve(&mut program, &start, &mut |_| Flow::Continue) {
        Err(error) => error.to_string(),
        Ok(report) => panic!("{report:?}"),
    }
}

#[test]
fn bad_input_is_named() {
    let cases: [(String, &str); 14] = [
        (error(|_, start, _| start.z.truncate(3)), "`start.z` has 3 entries, the program asks for 4"),
        (error(|_, start, _| start.z[2] = f64::NAN), "`start.z[2]` is NaN"),
        (error(|_, start, _| start.z[0] = f64::INFINITY), "`start.z[0]` is inf"),
        (
            error(|_, start, _| start.constraint_multipliers = vec![1.0]),
            "`start.constraint_multipliers` has 1",
        ),
        (error(|s, _, _| s.variables.lower[1] = 6.0), "`variables[1]` is from 6 to 5"),
        (error(|s, _, _| s.variables.upper[3] = f64::NAN), "`variables[3]` is from 1 to NaN"),
        (error(|s, _, _| s.constraints.lower[0] = INF), "`constraints[0]` is from inf to inf"),
        (error(|s, _, _| s.constraints.upper.truncate(1)), "`constraints` has 1 entries"),
        (error(|s, _, _| s.jacobian = Pattern::dense(3, 4)), "`jacobian` is 3 × 4"),
        (error(|s, _, _| s.jacobian.rows[1] = 0), "`jacobian` has rows [0, 0] in column 0"),
        (error(|s, _, _| s.hessian = Pattern::dense(4, 4)), "`hessian` has rows [0, 1, 2, 3] in column 0"),
        (error(|s, _, _| s.hessian.columns[2] = 99), "`hessian` has columns that do not partition"),
        (
            error(|_, start, solver| {
                start.hessian = Some(vec![1.0]);
                solver.hessian = HessianSource::QuasiNewton;
            }),
            "`start.hessian` has 1 entries, the program asks for 10",
        ),
        (error(|_, _, solver| solver.stationarity_tol = -1.0), "`stationarity_tol` is -1"),
    ];
    for (found, expected) in cases {
        assert!(found.starts_with(expected), "{found}");
    }
}

#[test]
fn solvers_without_constraints_refuse_them() {
    let problem = named("HS 71");
    let solvers: [&dyn NlpSolver; 2] = [&Lbfgs::default(), &GradientDescent::default()];
    for solver in solvers {
        let start = Start::from(problem.start.as_slice());
        let outcome = solver.solve(&mut problem.program(), &start, &mut |_| Flow::Continue);
        assert!(matches!(outcome, Err(SolverError::Constrained { found: 2, .. })));
    }
}

#[test]
fn a_program_without_variables_is_solved() {
    let problem = problem(&[], &[], &[], |_| vec![D::from(1.0)]);
    let report = solve(&Sqp::default(), &problem);
    assert_eq!((report.status, report.cost), (Status::Converged, 1.0));
    let problem = self::problem(&[], &[], &[ZERO], |_| vec![D::from(1.0), D::from(2.0)]);
    assert_eq!(solve(&Sqp::default(), &problem).status, Status::Infeasible);
}

#[test]
fn fixed_variables_stay_where_they_are() {
    let problem = problem(&[0.0, 0.0, 0.0], &[(2.0, 2.0), FREE, FREE], &[ZERO], |x| {
        vec![squares(x) + (x[2] - x[0]).powi(2), x[0] + x[1] - 1.0]
    });
    for solver in variants() {
        let report = solve(&solver, &problem);
        assert_eq!(report.status, Status::Converged);
        assert_eq!(report.z[0], 2.0);
        assert!((report.z[1] + 1.0).abs() < 1e-8 && (report.z[2] - 2.0).abs() < 1e-8);
    }
}

#[test]
fn bounds_have_lengths() {
    let free = Bounds::free(3);
    assert_eq!((free.len(), free.is_empty()), (3, false));
}
