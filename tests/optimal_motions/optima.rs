//! Motion problems with optima in closed form: a block on a rail, m = 1, moved by ½ ∫ F² dt.
//!
//! A cubic from (0, v₀) to (Δ, v₁) in time h costs (2/h)(v₀² + v₀v₁ + v₁²) − (6Δ/h²)(v₀ + v₁) + 6Δ²/h³, and no motion
//! between the same ends costs less. Splines hold all of the optima below, and Runge–Kutta steps make no error along
//! them, so that answers are those of continuous time.

use nalgebra::Vector3;
use somersault_core::spline::UniformBasis;
use somersault_multibody::joint_motion::{Condition, EigenpostureBase, End, SplineMotion};
use somersault_multibody::{Joint, Link, MassProperties, Model, Split};
use somersault_nlp::{Bounds, Flow, Globalisation, NlpSolver, Report, Sqp};
use somersault_ocp::OcpError;
use somersault_ocp::dynamics::Tree;
use somersault_ocp::problem::{At, Loss, MotionProblem, MotionProblemBuilder};
use somersault_ocp::shooting::{Drive, Duration, Phase, Scheme, Shooting, ShootingOptions, Start};
use somersault_ocp::term::{Displacement, Entries, Function, Part};
use somersault_ocp::transcription::{NodeSizes, Transcription};

const STEPS: usize = 20;

fn block(active: bool) -> Tree {
    let mut builder = Model::builder();
    let rail = Joint::Prismatic { axis: Vector3::x() };
    builder.add(Link::root("block", rail, MassProperties::point(1.0, Vector3::zeros()))).unwrap();
    Tree::try_new(builder.build().unwrap(), Split::new(vec![active])).unwrap()
}

fn phase(degree: usize, conditions: &[Condition], duration: Duration) -> Phase {
    let basis = UniformBasis::try_new(degree, degree + 1).unwrap();
    let motion = SplineMotion::try_new(basis, EigenpostureBase::joints(1), conditions).unwrap();
    Phase { motion, n_steps: STEPS, duration, n_segments: 1 }
}

type Builder = MotionProblemBuilder<Shooting<Tree>>;

/// The block at 0 with velocity `v`, pushed by forces of these degrees, one for each phase.
fn pushed(v: f64, degree: usize, durations: &[Duration]) -> Builder {
    let phases = durations.iter().map(|duration| phase(degree, &[], *duration)).collect();
    let drive = Drive::Torque { dofs: vec![0] };
    let options = ShootingOptions { scheme: Scheme::RungeKutta4, drive };
    MotionProblem::builder(
        Shooting::try_new(block(false), Start::fixed(&[0.0], &[v]), phases, options).unwrap(),
    )
}

fn sizes(builder: &Builder) -> NodeSizes {
    builder.transcription().outline().sizes
}

/// Adds ½ ∫ F² dt.
fn with_effort(builder: Builder) -> Builder {
    let force = Entries::try_new(&sizes(&builder), Part::Torque, &[0]).unwrap();
    builder.lagrange(force, Loss::half_squares(1)).unwrap()
}

/// Adds the time at the end.
fn with_time(builder: Builder) -> Builder {
    let time = Entries::try_new(&sizes(&builder), Part::Time, &[0]).unwrap();
    builder.mayer(At::End, time, Loss::Linear { weights: vec![1.0] }).unwrap()
}

fn between(lower: f64, upper: f64) -> Bounds {
    Bounds { lower: vec![lower], upper: vec![upper] }
}

/// The position relative to `x`.
fn from(x: f64) -> Displacement<Tree> {
    Displacement::try_new(block(false), &[x], &[0]).unwrap()
}

/// Asks for a position and a velocity at the end.
fn to(builder: Builder, x: f64, v: f64) -> Builder {
    let velocity = Entries::try_new(&sizes(&builder), Part::Velocity, &[0]).unwrap();
    let builder = builder.constrain(At::End, from(x), between(0.0, 0.0)).unwrap();
    builder.constrain(At::End, velocity, between(v, v)).unwrap()
}

/// Solves by both globalisations, which agree.
fn solve(builder: Builder, z: &[f64]) -> (Report, MotionProblem<Shooting<Tree>>) {
    let mut problem = builder.build().unwrap();
    let [merit, filter] = [Globalisation::Merit, Globalisation::Filter].map(|globalisation| {
        let solver = Sqp { globalisation, ..Sqp::default() };
        let report = solver.solve(&mut problem, &z.to_vec().into(), &mut |_| Flow::Continue).unwrap();
        assert!(report.status.is_converged(), "{globalisation:?}: {} {:?}", report.status, report.residuals);
        report
    });
    assert!((merit.cost - filter.cost).abs() < 1e-7 * merit.cost, "{} and {}", merit.cost, filter.cost);
    problem.transcription_mut().rollout(&merit.z).unwrap();
    (merit, problem)
}

fn expect_cost(report: &Report, expected: f64) {
    assert!((report.cost - expected).abs() < 1e-7 * expected, "{} instead of {expected}", report.cost);
}

#[test]
fn splines_of_torque_find_the_cubic_from_rest_to_rest() {
    let (report, problem) =
        solve(to(with_effort(pushed(0.0, 1, &[Duration::Fixed(1.0)])), 1.0, 0.0), &[0.0; 2]);
    expect_cost(&report, 6.0);
    for k in 0..=STEPS {
        let node = problem.transcription().node(k);
        assert!(
            (node.torque[0] - (6.0 - 12.0 * node.time)).abs() < 1e-6,
            "F({}) = {}",
            node.time,
            node.torque[0]
        );
    }
}

/// 6/T³ + T is least where T⁴ = 18.
#[test]
fn a_free_horizon_is_as_long_as_its_price_says() {
    let free = Duration::Free { lower: 0.1, upper: 10.0 };
    let builder = to(with_time(with_effort(pushed(0.0, 1, &[free]))), 1.0, 0.0);
    let (report, problem) = solve(builder, &[0.0, 0.0, 1.0]);
    let duration = 18f64.powf(0.25);
    expect_cost(&report, 4.0 * duration / 3.0);
    assert!((problem.transcription().durations()[0] - duration).abs() < 1e-6);
}

/// Bryson and Denham's problem (Bryson & Ho 1975, section 3.11) where the ceiling ℓ is touched once, for 1/6 ≤ ℓ ≤ 1/4:
/// 2 + 6 (1 − 4 ℓ)². The force has a kink where it is touched, so there are two phases.
#[test]
fn a_path_constraint_is_touched_and_costs_what_bryson_and_ho_say() {
    for ceiling in [0.2, 0.24] {
        let builder = to(with_effort(pushed(1.0, 1, &[Duration::Fixed(0.5); 2])), 0.0, -1.0);
        let builder =
            builder.constrain(At::EveryNode, from(0.0), between(f64::NEG_INFINITY, ceiling)).unwrap();
        let n = builder.transcription().outline().n_variables();
        let (report, problem) = solve(builder, &vec![0.0; n]);
        expect_cost(&report, 2.0 + 6.0 * (1.0 - 4.0 * ceiling) * (1.0 - 4.0 * ceiling));
        let highest = (0..=2 * STEPS + 1).map(|k| problem.transcription().node(k).position[0]);
        assert!((highest.fold(0.0, f64::max) - ceiling).abs() < 1e-7);
    }
}

/// |F| ≤ 1: one second each way, as soon as the durations of both phases are free.
#[test]
fn bounded_forces_and_free_phases_switch_half_way() {
    let free = Duration::Free { lower: 0.1, upper: 10.0 };
    let mut builder = to(with_time(pushed(0.0, 0, &[free; 2])), 1.0, 0.0);
    let layout = builder.transcription().layout().clone();
    let mut z = vec![0.0; layout.n_variables];
    for variable in layout.parameters.iter().cloned().flatten() {
        builder = builder.bound_variable(variable, -1.0, 1.0).unwrap();
        z[variable] = if layout.parameters[0].contains(&variable) { 0.5 } else { -0.5 };
    }
    for variable in layout.durations.iter().flatten() {
        z[*variable] = 2.0;
    }
    let (report, problem) = solve(builder, &z);
    expect_cost(&report, 2.0);
    assert!(problem.transcription().durations().iter().all(|d| (d - 1.0).abs() < 1e-6));
}

/// ∫ F² dt ≤ 2 E: as E = 6/T³, no faster than (6/E)^⅓.
#[test]
fn a_budget_of_effort_limits_the_speed() {
    let free = Duration::Free { lower: 0.1, upper: 10.0 };
    let square = Function::new(
        "F²",
        1,
        |node, rows| {
            rows[0] = node.torque[0] * node.torque[0];
            Ok(())
        },
        |node, y, gradient| {
            gradient.torque[0] += 2.0 * node.torque[0] * y[0];
            Ok(())
        },
    );
    let budget = 2.0;
    let builder = to(with_time(pushed(0.0, 1, &[free])), 1.0, 0.0);
    let builder = builder.constrain_integral(At::EveryNode, square, between(0.0, 2.0 * budget)).unwrap();
    let (report, _) = solve(builder, &[1.0, -1.0, 2.0]);
    expect_cost(&report, (6.0 / budget).cbrt());
}

/// Driven to 0.6 at 0.3 s and to 1 at 1 s: two cubics, whose common velocity makes their sum least.
#[test]
fn phases_of_joint_motion_meet_with_the_best_velocity() {
    let at = |end, derivative, value| Condition { end, derivative, value };
    let (h, d) = ([0.3, 0.7], [0.6, 0.4]);
    let first = [at(End::Start, 0, 0.0), at(End::Start, 1, 0.0), at(End::Finish, 0, 0.6)];
    let second = [at(End::Finish, 0, 1.0), at(End::Finish, 1, 0.0)];
    let phases = vec![phase(3, &first, Duration::Fixed(h[0])), phase(3, &second, Duration::Fixed(h[1]))];
    let start = Start::fixed(&[0.0], &[0.0]);
    let shooting = Shooting::try_new(block(true), start, phases, ShootingOptions::default()).unwrap();
    let builder = with_effort(MotionProblem::builder(shooting));
    let n = builder.transcription().outline().n_variables();
    let (report, problem) = solve(builder, &vec![0.0; n]);
    let v = 1.5 * (d[0] / (h[0] * h[0]) + d[1] / (h[1] * h[1])) / (1.0 / h[0] + 1.0 / h[1]);
    let cost = |h: f64, d: f64| 2.0 / h * v * v - 6.0 * d / (h * h) * v + 6.0 * d * d / (h * h * h);
    expect_cost(&report, cost(h[0], d[0]) + cost(h[1], d[1]));
    assert!((problem.transcription().node(STEPS).velocity[0] - v).abs() < 1e-7);
}

/// ½ w (x(1) − 1)² instead of a constraint, the velocity free: x(1) = w/(3 + w).
#[test]
fn a_soft_end_falls_short_by_what_its_weight_allows() {
    for weight in [1.0, 30.0] {
        let loss = Loss::HalfSquares { weights: vec![weight], target: vec![0.0] };
        let builder =
            with_effort(pushed(0.0, 1, &[Duration::Fixed(1.0)])).mayer(At::End, from(1.0), loss).unwrap();
        let (report, problem) = solve(builder, &[0.0; 2]);
        expect_cost(&report, 1.5 * weight / (3.0 + weight));
        let end = problem.transcription().node(STEPS).position[0];
        assert!((end - weight / (3.0 + weight)).abs() < 1e-7, "{end}");
    }
}

#[test]
fn a_motion_with_nothing_to_vary_is_refused() {
    let at = |end, derivative, value| Condition { end, derivative, value };
    let ends =
        [at(End::Start, 0, 0.0), at(End::Start, 1, 0.0), at(End::Finish, 0, 1.0), at(End::Finish, 1, 0.0)];
    let driven = |duration| {
        let start = Start::fixed(&[0.0], &[0.0]);
        let phases = vec![phase(3, &ends, duration)];
        let shooting = Shooting::try_new(block(true), start, phases, ShootingOptions::default()).unwrap();
        with_effort(MotionProblem::builder(shooting)).build()
    };
    assert_eq!(driven(Duration::Fixed(1.0)).err(), Some(OcpError::NoVariables));
    assert!(driven(Duration::Free { lower: 0.5, upper: 2.0 }).is_ok());
    let held = |builder: Builder, variable| builder.bound_variable(variable, 0.0, 0.0).unwrap();
    let half = held(with_effort(pushed(0.0, 1, &[Duration::Fixed(1.0)])), 0);
    assert_eq!(held(half, 1).build().err(), Some(OcpError::NothingFree { n_variables: 2 }));
    assert!(held(with_effort(pushed(0.0, 1, &[Duration::Fixed(1.0)])), 0).build().is_ok());
}
