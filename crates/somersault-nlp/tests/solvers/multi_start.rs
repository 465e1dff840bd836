//! Many starts.

use crate::behaviour::Guarded;
use crate::problems::Problem;
use somersault_nlp::{
    Bounds, EvaluationError, FailureCause, Flow, MultiStart, MultiStartReport, NlpSolver, SolverError, Sqp,
    Start, Status, samples,
};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

/// The six-hump camel back of Dixon & Szegő, Towards Global Optimisation 2 (1978), page 97: two minima of
/// −1.0316285, two of −0.2154638, two of 2.1042503.
fn camel() -> Problem {
    Problem::new("camel", &[0.0, 0.0], &[(-3.0, 3.0), (-2.0, 2.0)], &[], f64::NAN, |x| {
        let (a, b) = (x[0] * x[0], x[1] * x[1]);
        vec![(a * a / 3.0 - a * 2.1 + 4.0) * a + x[0] * x[1] + (b * 4.0 - 4.0) * b]
    })
}

fn range() -> Bounds {
    Bounds { lower: vec![-2.0, -1.0], upper: vec![2.0, 1.0] }
}

fn run(threads: usize, starts: &[Start]) -> MultiStartReport {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
    let solver = MultiStart::new(Sqp::default());
    pool.install(|| solver.solve(|| camel().program(), starts, || false)).unwrap()
}

#[test]
fn all_minima_of_the_camel_are_found_and_ranked() {
    let starts = samples(&range(), 64, 1).unwrap();
    let found = run(2, &starts);
    let costs: Vec<f64> = found.minima.iter().map(|m| m.report.cost).collect();
    println!("{costs:?} {:?}", found.minima.iter().map(|m| m.starts.len()).collect::<Vec<_>>());
    for (pair, published) in [-1.0316285, -0.2154638, 2.1042503].into_iter().enumerate() {
        for cost in &costs[2 * pair..2 * pair + 2] {
            assert!((cost - published).abs() < 1e-6, "{costs:?}");
        }
    }
    let mut all: Vec<usize> = found.minima.iter().flat_map(|m| m.starts.clone()).collect();
    all.extend(found.failures.iter().map(|f| f.start));
    all.sort_unstable();
    assert_eq!(all, (0..64).collect::<Vec<_>>());
}

#[test]
fn the_answer_does_not_depend_on_the_number_of_threads() {
    let starts = samples(&range(), 40, 7).unwrap();
    assert_eq!(run(1, &starts).minima, run(2, &starts).minima);
}

#[test]
fn samples_visit_each_part_of_a_range_once() {
    let starts = samples(&range(), 10, 3).unwrap();
    assert_eq!(starts, samples(&range(), 10, 3).unwrap());
    assert_ne!(starts, samples(&range(), 10, 4).unwrap());
    for i in 0..2 {
        let (lower, upper) = (range().lower[i], range().upper[i]);
        let mut parts: Vec<usize> =
            starts.iter().map(|s| ((s.z[i] - lower) / (upper - lower) * 10.0) as usize).collect();
        parts.sort_unstable();
        assert_eq!(parts, (0..10).collect::<Vec<_>>());
    }
}

#[test]
fn a_wide_distance_merges_minima() {
    let starts = samples(&range(), 30, 2).unwrap();
    let wide = MultiStart { solver: Sqp::default(), distance_tol: 10.0 };
    let found = wide.solve(|| camel().program(), &starts, || false).unwrap();
    assert_eq!(found.minima.len(), 1);
}

#[test]
fn a_stop_is_honoured_before_and_during_solves() {
    let starts = samples(&range(), 8, 1).unwrap();
    let solver = MultiStart::new(Sqp::default());
    let found = solver.solve(|| camel().program(), &starts, || true).unwrap();
    assert_eq!(found.failures.len(), 8);
    assert!(found.failures.iter().all(|f| matches!(f.cause, FailureCause::Skipped)));

    let asked = AtomicUsize::new(0);
    let flag = AtomicBool::new(false);
    let stop = || {
        if asked.fetch_add(1, Ordering::Relaxed) == 2 {
            flag.store(true, Ordering::Relaxed);
        }
        flag.load(Ordering::Relaxed)
    };
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    let found = pool.install(|| solver.solve(|| camel().program(), &starts, stop)).unwrap();
    assert!(found.minima.is_empty());
    let stopped =
        |cause: &FailureCause| matches!(cause, FailureCause::Ended(r) if r.status == Status::Interrupted);
    assert_eq!(found.failures.iter().filter(|f| stopped(&f.cause)).count(), 1);
    assert!(found.is_interrupted() && found.unfinished().len() == 1);
}

#[test]
fn failures_are_listed_beside_minima() {
    let mut starts = samples(&range(), 4, 1).unwrap();
    starts[1] = Start::from(vec![f64::NAN, 0.0]);
    starts[2] = Start::from(vec![0.0]);
    let found = run(2, &starts);
    assert_eq!(found.failures.iter().map(|f| f.start).collect::<Vec<_>>(), [1, 2]);
    let causes: Vec<&FailureCause> = found.failures.iter().map(|f| &f.cause).collect();
    assert!(matches!(causes[0], FailureCause::Error(SolverError::NotFinite { .. })));
    assert!(matches!(causes[1], FailureCause::Error(SolverError::Length { .. })));
}

#[test]
fn programs_without_a_value_anywhere_leave_failures_only() {
    fn never(_: &[f64]) -> Result<(), EvaluationError> {
        Err(EvaluationError::Undefined { what: "the cost".into() })
    }
    let solver = MultiStart::new(Sqp::default());
    let starts = samples(&range(), 3, 1).unwrap();
    let make = || Guarded { inner: camel().program(), guard: Box::leak(Box::new(never)) };
    let found = solver.solve(make, &starts, || false).unwrap();
    assert_eq!((found.minima.len(), found.failures.len()), (0, 3));
}

#[test]
fn bad_ranges_and_distances_are_named() {
    let message = |range: Bounds| samples(&range, 3, 0).unwrap_err().to_string();
    let backwards = message(Bounds { lower: vec![1.0], upper: vec![0.0] });
    assert!(backwards.starts_with("`range[0]` is from 1 to 0"), "{backwards}");
    let endless = message(Bounds::free(1));
    assert!(endless.starts_with("`range.lower[0]` is -inf"), "{endless}");
    let solver = MultiStart { solver: Sqp::default(), distance_tol: f64::NAN };
    let error = solver.solve(|| camel().program(), &[], || false).unwrap_err().to_string();
    assert!(error.starts_with("`distance_tol` is NaN"), "{error}");
}

/// x + y on the circle of radius √2, with its minimum −2 at (−1, −1).
fn circle() -> Problem {
    let free = (f64::NEG_INFINITY, f64::INFINITY);
    Problem::new("circle", &[2f64.sqrt(), 0.0], &[free; 2], &[(0.0, 0.0)], -2.0, |x| {
        vec![x[0] + x[1], x[0] * x[0] + x[1] * x[1] - 2.0]
    })
}

#[test]
fn a_feasible_start_is_not_the_best_one_for_that_alone() {
    let starts = [vec![2f64.sqrt(), 0.0], vec![-1.0, -0.99], vec![10.0, 10.0]].map(Start::from);
    let still = MultiStart::new(Sqp { max_iterations: 0, ..Sqp::default() });
    let found = still.solve(|| circle().program(), &starts, || false).unwrap();
    let unfinished: Vec<Vec<f64>> = found.unfinished().iter().map(|report| report.z.clone()).collect();
    assert_eq!(unfinished, [1, 0, 2].map(|k: usize| starts[k].z.clone()));
}

#[test]
fn a_feasible_start_is_not_returned_unchanged() {
    let start = Start::from(vec![2f64.sqrt(), 0.0]);
    for max_iterations in 1..5 {
        let solver = Sqp { max_iterations, ..Sqp::default() };
        let mut violations = Vec::new();
        let report = solver
            .solve(&mut circle().program(), &start, &mut |at| {
                violations.push((at.residuals.feasibility, at.cost));
                Flow::Continue
            })
            .unwrap();
        assert!(violations[1].0 > 1e-8, "the second point is feasible: {violations:?}");
        assert!(report.z != start.z && report.cost < 2f64.sqrt(), "{max_iterations}: {report:?}");
    }
}
