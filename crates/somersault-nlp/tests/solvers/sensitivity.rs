//! Derivatives of solutions against closed forms and differences of solves.

use crate::hock_schittkowski::all;
use crate::problems::{Differentiated, FREE, INF, Problem, ZERO};
use num_dual::DualNum;
use somersault_nlp::{
    Held, NlpSolver, NoDerivative, Report, Sensitivity, Sqp, Start, Status, negative_curvature,
};

/// The point of x₁ + p x₂ ≥ 1 nearest to the origin, with p a variable that is fixed: x = (1, p)/(1 + p²).
fn nearest(p: f64) -> Problem {
    let variables = [FREE, FREE, (p, p)];
    Problem::new("nearest point", &[1.0, 1.0, p], &variables, &[(1.0, INF)], 1.0 / (1.0 + p * p), |z| {
        vec![z[0] * z[0] + z[1] * z[1], z[0] + z[1] * z[2]]
    })
}

fn sensitivity(program: &mut Differentiated, report: &Report) -> Result<Sensitivity, NoDerivative> {
    Sensitivity::try_new(program, &report.z, &report.constraint_multipliers)
}

fn solved(problem: &Problem, start: &Start) -> Report {
    let solver = Sqp { stationarity_tol: 1e-11, feasibility_tol: 1e-12, ..Sqp::default() };
    solver.solve(&mut problem.program(), start, &mut |_| somersault_nlp::Flow::Continue).unwrap()
}

#[test]
fn derivatives_of_the_nearest_point_are_its_closed_form() {
    let problem = nearest(2.0);
    let report = solved(&problem, &problem.start.as_slice().into());
    assert_eq!(report.status, Status::Converged);
    let mut program = problem.program();
    let mut sensitivity = sensitivity(&mut program, &report).unwrap();
    assert!(sensitivity.weakly_active().is_empty());
    let by_slope = sensitivity.derivative(Held::Variable(2)).unwrap();
    for (found, exact) in by_slope.z.iter().zip([-0.16, -0.12, 1.0]) {
        assert!((found - exact).abs() < 1e-12, "{by_slope:?}");
    }
    assert!((by_slope.cost + 0.16).abs() < 1e-12);
    assert!((by_slope.constraint_multipliers[0] - 0.32).abs() < 1e-12, "{by_slope:?}");
    // x = v (1, p)/(1 + p²) for a bound of v
    let by_bound = sensitivity.derivative(Held::Constraint(0)).unwrap();
    assert!((by_bound.z[0] - 0.2).abs() < 1e-12 && (by_bound.z[1] - 0.4).abs() < 1e-12);
    assert!((by_bound.cost - 0.4).abs() < 1e-12);
    for free in [Held::Variable(0), Held::Variable(7), Held::Constraint(3)] {
        assert!(matches!(sensitivity.derivative(free), Err(NoDerivative::NotHeld(found)) if found == free));
    }
}

/// Moves a value that holds the solution, from both sides.
fn moved(problem: &Problem, held: Held, by: f64) -> Problem {
    let mut moved = problem.clone();
    let pair = match held {
        Held::Variable(i) => &mut moved.variables[i],
        Held::Constraint(i) => &mut moved.constraints[i],
    };
    *pair = (pair.0 + by, pair.1 + by);
    moved
}

#[test]
fn derivatives_of_published_problems_are_differences_of_their_solutions() {
    let mut compared = 0;
    for problem in all() {
        let report = solved(&problem, &problem.start.as_slice().into());
        let mut program = problem.program();
        let Ok(mut sensitivity) = sensitivity(&mut program, &report) else { continue };
        if !sensitivity.weakly_active().is_empty() {
            continue;
        }
        let of_variables = (0..problem.variables.len()).map(Held::Variable);
        for held in of_variables.chain((0..problem.constraints.len()).map(Held::Constraint)) {
            let Ok(exact) = sensitivity.derivative(held) else { continue };
            let (lower, upper) = match held {
                Held::Variable(i) => problem.variables[i],
                Held::Constraint(i) => problem.constraints[i],
            };
            // tolerances are relative to bounds
            let h =
                [lower, upper].iter().filter(|x| x.is_finite()).fold(1.0, |a: f64, b| a.max(b.abs())) * 1e-5;
            let [less, more] = [-h, h].map(|by| solved(&moved(&problem, held, by), &report.start()));
            if !(less.status.is_converged() && more.status.is_converged()) {
                continue;
            }
            let size = exact.z.iter().fold(1.0, |a: f64, b| a.max(b.abs()));
            // a solution that bends too much for the difference says nothing
            let bend = |i: usize| (less.z[i] + more.z[i] - 2.0 * report.z[i]).abs() / h;
            if (0..report.z.len()).any(|i| bend(i) > 1e-3 * size) {
                continue;
            }
            for (i, exact) in exact.z.iter().enumerate() {
                let difference = (more.z[i] - less.z[i]) / (2.0 * h);
                assert!(
                    (exact - difference).abs() < 1e-4 * size,
                    "{}, {held:?}, variable {i}: {exact} but {difference}",
                    problem.name
                );
            }
            let slope = (more.cost - less.cost) / (2.0 * h);
            // what rounding and the tolerance leave of a cost
            let noise = 1e-12 * report.cost.abs() / h;
            assert!(
                (exact.cost - slope).abs() < 1e-4 * slope.abs().max(size) + noise,
                "{}, {held:?}: {} but {slope}, noise {noise}",
                problem.name,
                exact.cost
            );
            compared += 1;
        }
    }
    assert!(compared > 100, "{compared}");
}

#[test]
fn points_without_derivatives_are_named() {
    let problem = nearest(2.0);
    let mut report = solved(&problem, &problem.start.as_slice().into());
    report.z[0] += 0.1;
    assert!(matches!(
        sensitivity(&mut problem.program(), &report),
        Err(NoDerivative::NotSolved { residual }) if residual > 1e-3
    ));
    // every point of a line is a minimum
    let valley =
        Problem::new("valley", &[1.0, 1.0], &[], &[ZERO], 0.0, |z| vec![(z[0] + z[1]).powi(2), z[0] + z[1]]);
    let report = solved(&valley, &valley.start.as_slice().into());
    assert!(matches!(sensitivity(&mut valley.program(), &report), Err(NoDerivative::NotIsolated)));
    // a bound at the free minimum holds by a multiplier of zero
    let touching = Problem::new("touch", &[0.5], &[(0.0, INF)], &[], 0.0, |z| vec![z[0] * z[0]]);
    let report = solved(&touching, &touching.start.as_slice().into());
    let mut program = touching.program();
    let sensitivity = sensitivity(&mut program, &report).unwrap();
    assert_eq!(sensitivity.weakly_active(), [Held::Variable(0)]);
}

/// Least x² − y² − ½ z² on the unit sphere: from (2, 0, 0) all is symmetric, and (1, 0, 0) is a maximum of all three.
fn on_the_sphere() -> Problem {
    Problem::new("on the sphere", &[2.0, 0.0, 0.0], &[], &[ZERO], -1.0, |z| {
        let squares = z.iter().fold(z[0] * 0.0, |sum, z| sum + *z * *z);
        vec![z[0] * z[0] - z[1] * z[1] - z[2] * z[2] * 0.5, squares - 1.0]
    })
}

#[test]
fn a_saddle_has_a_direction_of_negative_curvature_and_a_minimum_has_none() {
    let problem = on_the_sphere();
    let direction = |report: &Report| {
        negative_curvature(&mut problem.program(), &report.z, &report.constraint_multipliers).unwrap()
    };
    let saddle = solved(&problem, &problem.start.as_slice().into());
    assert_eq!(saddle.status, Status::Converged);
    assert!((saddle.cost - 1.0).abs() < 1e-9, "{}", saddle.cost);
    let along = direction(&saddle).expect("a direction");
    // tangent, and nearly along y, where the curvature −4 is twice that along z or more
    assert!(along[0].abs() < 1e-9 && along[1].abs() == 1.0 && along[2].abs() < 0.5, "{along:?}");
    let start: Vec<f64> = saddle.z.iter().zip(&along).map(|(z, d)| z + 0.3 * d).collect();
    let minimum = solved(&problem, &start.into());
    assert!((minimum.cost + 1.0).abs() < 1e-9, "{}", minimum.cost);
    assert_eq!(direction(&minimum), None);
    // a linear program has no curvature
    let linear = Problem::new("linear", &[1.0], &[(0.0, INF)], &[], 0.0, |z| vec![z[0]]);
    assert_eq!(negative_curvature(&mut linear.program(), &[0.0], &[]).unwrap(), None);
    // of a point that solves nothing there is nothing to say
    let unsolved = negative_curvature(&mut problem.program(), &[0.5, 0.1, 0.0], &[0.0]);
    assert!(matches!(unsolved, Err(NoDerivative::NotSolved { .. })));
}
