//! Cost with gradient of the swing-up of thesis A.2, case G; the cases of Table A.1 solved; the dives; the arm of 8.4.
//!
//! `cargo bench --bench ocp`. Cases of Table A.1 start from cart and pendulum on straight lines, as no knowledge of the
//! solution, set-up included; the dives from their templates; the arm from a folded guess, set-up included.

use criterion::{Criterion, criterion_group, criterion_main};
use somersault::core::Scalar;
use somersault::dives::{Dive, DiveSearch};
use somersault::multibody::models::TwoLinkArm;
use somersault::nlp::{Flow, Nlp, NlpSolver, Sqp};
use somersault::ocp::collocation::{Collocation, Guess, Mesh, Phase, Point, Problem, Terms, TreeDynamics};
use somersault::ocp::swing_up::CartPendulumProblem;
use std::f64::consts::{FRAC_PI_2, PI};
use std::hint::black_box;
use std::time::Duration;

/// Free parameters of the cases of Table A.1.
const CASES: [(char, usize); 7] =
    [('A', 5), ('B', 10), ('C', 15), ('D', 20), ('E', 30), ('F', 40), ('G', 50)];

fn swing_up(c: &mut Criterion) {
    let mut group = c.benchmark_group("swing-up");
    let problem = CartPendulumProblem::with_parameters(50);
    let z = problem.swing_up().expect("valid").straight_line();
    let mut nlp = problem.single_shooting().expect("valid");
    let mut gradient = vec![0.0; z.len()];
    group.bench_function("cost and gradient, case G", |b| {
        b.iter(|| {
            let cost = nlp.evaluate(black_box(&z), &mut []).expect("finite");
            nlp.differentiate(black_box(&z), &mut gradient, &mut []).expect("finite");
            cost + gradient[0]
        })
    });
    group.sample_size(10).measurement_time(Duration::from_secs(2));
    for (case, p) in CASES {
        let problem = CartPendulumProblem::with_parameters(p);
        group.bench_function(format!("solve case {case}"), |b| {
            b.iter(|| {
                let mut nlp = black_box(&problem).swing_up().expect("valid");
                let start = nlp.start(&nlp.straight_line()).expect("as long as the parameters");
                let report = Sqp::default().solve(&mut nlp, &start, &mut |_| Flow::Continue);
                let report = report.expect("well posed");
                assert!(report.status.is_converged());
                report.cost
            })
        });
    }
    group.finish();
}

fn dives(c: &mut Criterion) {
    let mut group = c.benchmark_group("dive");
    group.sample_size(10);
    let planar = Dive::forward_pike().and_then(|dive| dive.program()).expect("valid");
    group.bench_function("107B, solve", |b| {
        b.iter(|| {
            let z = planar.start(&Dive::pike_template()).expect("valid");
            let report = DiveSearch::direct().solve(&planar, z, &mut |_| Flow::Continue).expect("well posed");
            assert!(report.status.is_converged());
            report.cost
        })
    });
    let mut spatial = Dive::forward_twisting().program().expect("valid");
    let z = spatial.start(&Dive::twisting_template(2.0)).expect("valid");
    let structure = spatial.structure().clone();
    let mut constraints = vec![0.0; structure.constraints.len()];
    let (mut gradient, mut jacobian) = (vec![0.0; z.len()], vec![0.0; structure.jacobian.n_entries()]);
    group.bench_function("5174D, one evaluation with derivatives", |b| {
        b.iter(|| {
            let cost = spatial.evaluate(black_box(&z), &mut constraints).expect("finite");
            spatial.differentiate(black_box(&z), &mut gradient, &mut jacobian).expect("finite");
            cost + gradient[0]
        })
    });
    group.bench_function("5174D, solve from the template", |b| {
        b.iter(|| {
            let z = spatial.start(&Dive::twisting_template(2.0)).expect("valid");
            let report =
                DiveSearch::staged().solve(&spatial, z, &mut |_| Flow::Continue).expect("well posed");
            assert!(report.status.is_converged());
            report.cost
        })
    });
    group.finish();
}

/// ½ (u₁² + ½ u₂²), (8.7) with γ = (1, 0.5).
struct Effort;

impl Terms for Effort {
    fn running_cost<T: Scalar>(&self, at: &Point<'_, T>) -> T {
        let [u1, u2] = [at.control[0], at.control[1]];
        let half = nalgebra::convert::<f64, T>(0.5);
        (u1 * u1 + u2 * u2 * half) * half
    }
}

fn arm(c: &mut Criterion) {
    let (first, last) = ([-FRAC_PI_2, 0.05, 0.0, 0.0], [FRAC_PI_2, 0.05, 0.0, 0.0]);
    let folded = |angle: f64| vec![angle, PI, PI / 10.0, 0.0];
    let guess = Guess {
        times: vec![0.0, 1.0, 9.0, 10.0],
        states: vec![first.to_vec(), folded(-0.4 * PI), folded(0.4 * PI), last.to_vec()],
        controls: vec![vec![0.0; 2]; 4],
        parameters: Vec::new(),
    };
    let model = TwoLinkArm::default().model().expect("valid");
    let mut group = c.benchmark_group("collocation");
    group.sample_size(10);
    group.bench_function("arm, 1e-6, set-up included", |b| {
        b.iter(|| {
            let dynamics = TreeDynamics::try_fully_actuated(&model).expect("hinges");
            let phase = Phase::of_tree(dynamics, Effort).initial_state(first).final_state(last);
            let phase = phase.horizon(0.0, 10.0).guess(guess.clone());
            let collocation = Collocation { tolerance: 1e-6, ..Collocation::default() };
            let mesh = Mesh::try_uniform(40, 4).expect("positive");
            let mut problem = Problem::try_new(phase).expect("well posed");
            collocation.solve(&mut problem, &[mesh], &mut |_| Flow::Continue).expect("well posed").cost
        })
    });
    group.finish();
}

criterion_group!(benches, swing_up, dives, arm);
criterion_main!(benches);
