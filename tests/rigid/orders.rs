//! Orders: of every method in every kind of motion, of dense output, of adaptive runs against their
//! tolerances; and what must not depend on how a run is cut or bundled.

use rayon::prelude::*;
use somersault::integrators::driver::IntegrateError;
use somersault::integrators::engine::Engine;
use somersault::integrators::force::BoxedForce;
use somersault::integrators::methods::{
    Coefficients, EmbeddedCoefficients, RungeKutta4, RungeKuttaMuntheKaas, RungeKuttaMuntheKaas4, Visitor,
};
use somersault::integrators::state::{Pose, Rate, RigidBodiesState, Tolerances};
use somersault::integrators::stepper::{StepError, Variables};
use somersault::integrators::system::{Form, MomentumForm, RateOf, RigidBodiesSystem, RigidSystem, StateOf};
use somersault::integrators::tableau::{DenseWeights, ErrorWeights, Tableau};
use somersault::prelude::*;
use somersault_testkit::order::{OrderEstimate, Sampling, estimate, estimate_all, slope};
use somersault_testkit::problems::{
    Problem, asymmetric_body, for_orders, heavy_top, orbit, thesis_case, under,
};
use std::collections::BTreeMap;

/// High orders meet round-off within few points, low ones need many steps.
fn sampling(order: u8) -> Sampling {
    match order {
        0..2 => Sampling { first: 64, ceiling: 0.3, ..Sampling::default() },
        2..5 => Sampling { last: 3_000, floor: 2e-11, ..Sampling::default() },
        5..12 => Sampling { floor: 3e-13, ..Sampling::default() },
        // A step a tenth shorter has a fifth of the error.
        _ => Sampling { ratio: 1.1, floor: 3e-13, ceiling: 1e-6, points: 8, ..Sampling::default() },
    }
}

/// How far a slope may be from its order; between high orders the points lie before the asymptotic range, of rates and of curves
/// more than of configurations.
fn slack(order: u8, of_configuration: bool) -> f64 {
    match (order, of_configuration) {
        (0..5, _) => 0.2,
        (5..8, true) => 0.35,
        (5..8, false) => 0.5,
        (8..12, true) => 0.45,
        (8..12, false) => 0.8,
        (_, true) => 0.9,
        (_, false) => 1.6,
    }
}

/// Whether a slope says the order, or more.
fn says_at_least(estimate: &OrderEstimate, order: u8, slack: f64) -> bool {
    let exact = estimate.points[0].1 < 1e-13;
    exact || estimate.slope.is_some_and(|slope| slope > f64::from(order) - slack)
}

/// Whether a slope says the order and no more.
fn says(estimate: &OrderEstimate, order: u8, slack: f64) -> bool {
    says_at_least(estimate, order, slack)
        && estimate.slope.is_some_and(|slope| slope < f64::from(order) + slack)
}

/// Of configurations and of rates, at the ends of steps and, by dense output, between them. In some problem a method must
/// have the order it states and no more.
#[test]
fn every_method_has_the_orders_of_its_info() {
    let problems = for_orders();
    let wrong: Vec<String> =
        Method::ALL.into_par_iter().flat_map_iter(|method| wrong_orders(method, &problems)).collect();
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// Where a method has not the orders that it states.
fn wrong_orders(method: Method, problems: &[Problem]) -> Vec<String> {
    let info = method.info();
    let mut wrong = Vec::new();
    // On ℝ³ or SO(3), the quantity and its order, and whether it was attained.
    let mut attained: BTreeMap<(bool, &str, u8), bool> = BTreeMap::new();
    for problem in problems {
        let (Some(order), Some(rate_order)) =
            (problem.stated(&info.orders), problem.stated(&info.rate_orders))
        else {
            continue;
        };
        let sampling = sampling(order);
        let at_ends = estimate_all(problem.duration, &sampling, |n| problem.errors_of(method, n));
        let within =
            estimate_all(problem.duration, &sampling, |n| problem.errors_within_a_step(method, n, 0.55));
        for (what, found, order) in [
            ("configuration", &at_ends[0], order),
            ("rate", &at_ends[1], rate_order),
            ("configuration within a step", &within[0], order.min(info.dense_order)),
            ("rate within a step", &within[1], rate_order.min(info.dense_order)),
        ] {
            let slack = slack(order, what == "configuration");
            // In double precision the errors of an order above 12 are round-off before the leading term tells.
            let attains = says(found, order, slack) || order > 12;
            *attained.entry((problem.kind.is_translation(), what, order)).or_default() |= attains;
            if !says_at_least(found, order, slack) {
                let (name, slope, used) = (problem.name, found.slope, &found.used);
                wrong.push(format!("{method} on {name}, {what}: order {order}, found {slope:?} {used:?}"));
            }
        }
    }
    let never = attained.into_iter().filter(|(_, attained)| !attained);
    wrong.extend(never.map(|((on_r3, what, order), _)| {
        let space = if on_r3 { "R^3" } else { "SO(3)" };
        format!("{method} on {space}, {what}: better than order {order} in every problem")
    }));
    wrong
}

/// `rkmk` with the commutator of its last line of the wrong sign.
struct Broken;

impl Scheme for Broken {
    const INFO: MethodInfo = MethodInfo::explicit("broken", "Broken", "nobody", 4);
}

impl<S: System> Stepper<S> for Broken {
    type Memory = (<RungeKuttaMuntheKaas4 as Stepper<S>>::Memory, S::Workspace);

    fn start(&self, system: &S, x: &StateOf<S>) -> Result<Self::Memory, StepError> {
        Ok((RungeKuttaMuntheKaas4.start(system, x)?, system.workspace()))
    }

    fn step(
        &self,
        system: &S,
        t: f64,
        x: &StateOf<S>,
        h: f64,
        (memory, workspace): &mut Self::Memory,
        out: &mut StateOf<S>,
    ) -> Result<(), StepError> {
        RungeKuttaMuntheKaas4.step(system, t, x, h, memory, out)?;
        // [v₁, v₄] ≈ h [v, a]: twice the right term too much.
        let (mut a, mut twice): (RateOf<S>, RateOf<S>) = (x.rate.clone(), x.rate.clone());
        system.acceleration(workspace, t, x, &mut a);
        twice.set_zero();
        twice.add_bracket(h * h * h / 6.0, &x.rate, &a);
        out.drift(&twice, 1.0);
        Ok(())
    }
}

#[test]
fn a_wrong_coefficient_is_caught() {
    let problem = asymmetric_body();
    let found = estimate(problem.duration, &sampling(4), |n| {
        let grid = TimeGrid::try_with_steps(0.0, problem.duration, n).unwrap();
        let end = Run::by_stepper(&problem.system, &Broken, grid).from(&problem.initial).unwrap();
        Some(problem.error(&end.state))
    });
    assert!(!says_at_least(&found, 4, 0.2), "{found:?}");
    assert!(says(&found, 2, 0.2), "{found:?}");
}

/// Ralston's method of order 3 with an embedded one of order 2 and a quadratic curve.
struct Ralston(Tableau, ErrorWeights, DenseWeights);

impl Ralston {
    fn new() -> Self {
        let a = [vec![], vec![0.5], vec![0.0, 0.75]];
        let b = [2.0 / 9.0, 1.0 / 3.0, 4.0 / 9.0];
        let tableau = Tableau::try_new(&a, &b, &[0.0, 0.5, 0.75]).unwrap();
        let error = ErrorWeights::try_new(&tableau, &[0.0, 1.0, 0.0]).unwrap();
        let dense =
            DenseWeights::try_new(&tableau, &[[1.0, 0.0, 0.0], [-7.0 / 9.0, 1.0 / 3.0, 4.0 / 9.0]]).unwrap();
        Self(tableau, error, dense)
    }
}

impl Coefficients for Ralston {
    const INFO: MethodInfo = MethodInfo {
        embedded: Some(2),
        dense_order: 3,
        ..MethodInfo::explicit("ralston", "Ralston", "A. Ralston (1962)", 3)
    };
    fn tableau(&self) -> &Tableau {
        &self.0
    }
    fn dense(&self) -> Option<&DenseWeights> {
        Some(&self.2)
    }
}

impl EmbeddedCoefficients for Ralston {
    fn error(&self) -> &ErrorWeights {
        &self.1
    }
}

#[test]
fn a_tableau_of_the_users_own_has_its_order_and_adapts() {
    let method = RungeKuttaMuntheKaas(Ralston::new());
    for problem in [asymmetric_body(), heavy_top(true)] {
        let found = estimate(problem.duration, &sampling(3), |n| {
            let grid = TimeGrid::try_with_steps(0.0, problem.duration, n).unwrap();
            let end = Run::by_stepper(&problem.system, &method, grid).from(&problem.initial).unwrap();
            Some(problem.error(&end.state))
        });
        assert!(says(&found, 3, 0.2), "{found:?}");
        let control = Adaptive::with_tolerances(1e-7, 1e-7);
        let interval = (0.0, problem.duration);
        let end = Run::by_embedded_stepper(&problem.system, &method, Steps::adapted(interval, control))
            .from(&problem.initial)
            .unwrap();
        assert!(problem.error(&end.state) < 1e-4);
    }
}

fn adaptive_run(
    method: Method,
    problem: &Problem,
    tolerance: f64,
) -> Result<Outcome<somersault::integrators::state::Pose>, IntegrateError> {
    let control = Adaptive::with_tolerances(tolerance, tolerance);
    let interval = (0.0, problem.duration);
    Run::new(&problem.system, method, Steps::adapted(interval, control)).from(&problem.initial)
}

#[test]
fn adaptive_errors_shrink_with_the_tolerance_over_four_decades() {
    let embedded: Vec<Method> = Method::ALL.into_iter().filter(|m| m.info().embedded.is_some()).collect();
    assert!(embedded.len() >= 6);
    for problem in [asymmetric_body(), heavy_top(true), thesis_case(1, 1.0)] {
        for &method in &embedded {
            let points: Vec<(f64, f64)> = (0..9)
                .map(|k| {
                    let tolerance = 1e-5 * 10f64.powf(-0.5 * f64::from(k));
                    (tolerance, problem.error(&adaptive_run(method, &problem, tolerance).unwrap().state))
                })
                .collect();
            let found = slope(&points);
            // The estimate of `radau5` is of order 3, so that its error falls by the power 5/4 of the tolerance.
            let most = if method == Method::Radau5 { 1.4 } else { 1.3 };
            assert!((0.8..most).contains(&found), "{method} on {}: {found} {points:?}", problem.name);
            let worst = points.iter().map(|(tolerance, e)| e / tolerance).fold(0.0, f64::max);
            assert!(worst < 500.0, "{method} on {}: {worst} {points:?}", problem.name);
        }
    }
}

/// Steps are doubled with errors of the size of the tolerance, of which there are as many as tolerance^(−1/(p+1)): the error at the end is
/// of the order of tolerance^(p/(p+1)).
#[test]
fn the_error_of_every_one_step_method_follows_its_tolerance() {
    let problems = [asymmetric_body(), heavy_top(true), orbit()];
    let doubled = Method::ALL.into_iter().filter(|m| m.info().embedded.is_none() && m.info().history == 0);
    let doubled: Vec<Method> = doubled.collect();
    assert!(doubled.len() >= 20);
    for (method, problem) in doubled.iter().flat_map(|m| problems.iter().map(move |p| (*m, p))) {
        let info = method.info();
        let Some(order) = problem.stated(&info.orders) else {
            let refused = adaptive_run(method, problem, 1e-5).map(|_| ());
            assert_eq!(refused, Err(StepError::Torque { method: info.name }.into()));
            continue;
        };
        let first = if order < 4 { 1e-4 } else { 1e-6 };
        let points: Vec<(f64, f64)> = (0..6)
            .map(|k| {
                let tolerance = first * 10f64.powf(-0.4 * f64::from(k));
                (tolerance, problem.error(&adaptive_run(method, problem, tolerance).unwrap().state))
            })
            .collect();
        if points.iter().all(|(_, error)| *error < 1e-12) {
            // a splitting whose flow is that of the problem
            continue;
        }
        let power = f64::from(order) / f64::from(order + 1);
        let found = slope(&points);
        // A factor of two over a decade; but where the angle of a step limits it the error is smaller than the tolerance asks for.
        let is_limited = info.angle_limit.is_some() && order >= 4;
        assert!(
            is_limited || (found - power).abs() < 0.3,
            "{method} on {}: {found} {power} {points:?}",
            problem.name
        );
        let worst = points.iter().map(|(tolerance, e)| e / tolerance.powf(power)).fold(0.0, f64::max);
        assert!(worst < 100.0, "{method} on {}: {worst} {points:?}", problem.name);
    }
}

#[test]
fn a_doubled_step_is_two_steps_of_the_method_and_a_rejected_one_leaves_nothing() {
    let tolerances = Tolerances { relative: 1e-6, absolute: 1e-6 };
    for problem in [asymmetric_body(), heavy_top(true)] {
        let Problem { system, initial, .. } = &problem;
        for method in Method::ALL.into_iter().filter(|m| m.info().is_adaptive()) {
            if problem.stated(&method.info().orders).is_none() {
                continue;
            }
            let attempt = |rejected: &[f64]| {
                let mut made = |engine: &mut dyn Engine<Pose>| {
                    let (from, to) = (engine.keep(initial), engine.keep(initial));
                    for &h in rejected {
                        // a step that the method refuses is rejected too
                        let _ = engine.attempt(0.0, h, from, to, &tolerances);
                        engine.reject();
                    }
                    let error = engine.attempt(0.0, 0.0625, from, to, &tolerances).unwrap();
                    let (mut before, mut after) = (*initial, *initial);
                    engine.read(from, &mut before);
                    engine.read(to, &mut after);
                    (error, before, after)
                };
                method.engage_adapted(Options::default(), system, initial, &mut made).unwrap()
            };
            let (error, before, after) = attempt(&[]);
            let again = attempt(&[0.25, 2.0, 0.125]);
            assert_eq!(again.1, before, "{method} on {}", problem.name);
            // `radau5` keeps its Jacobian, so that its iterations end elsewhere within their accuracy.
            let is_exact = method != Method::Radau5;
            let angle = again.2.orientation().angle_to(after.orientation());
            assert!(again.2 == after || (!is_exact && angle < 1e-12), "{method} on {}", problem.name);
            assert!(again.0 == error || !is_exact, "{method} on {}", problem.name);
            if method.info().embedded.is_none() {
                let grid = TimeGrid::try_with_steps(0.0, 0.0625, 2).unwrap();
                let two = Run::new(system, method, grid).from(initial).unwrap();
                assert_eq!(after, two.state, "{method} on {}", problem.name);
            }
        }
    }
}

#[test]
fn curves_of_doubled_steps_are_those_of_their_halves() {
    let problem = asymmetric_body();
    let Problem { system, initial, duration, .. } = &problem;
    let exact = FreeBody::try_new(system.body(0), initial).unwrap();
    let steps = Steps::adapted((0.0, *duration), Adaptive::with_tolerances(1e-9, 1e-9));
    // The curve of the second is made of the stages that a step leaves.
    let ralston = RungeKuttaMuntheKaas(Ralston::new());
    for which in 0..2 {
        let run = |recorder: Option<&mut Recorder<Pose>>| {
            let mut nobody = ();
            let observer: &mut dyn Observer<Pose> = match recorder {
                Some(recorder) => recorder,
                None => &mut nobody,
            };
            if which == 0 {
                Run::new(system, Method::Rkmk, steps).observed_by(observer).from(initial).unwrap()
            } else {
                Run::by_stepper(system, &ralston, steps).observed_by(observer).from(initial).unwrap()
            }
        };
        let mut recorder = Recorder::new(0.0, initial, 1).with_dense_output();
        let (seen, unseen) = (run(Some(&mut recorder)), run(None));
        assert_eq!((seen.state, seen.steps), (unseen.state, unseen.steps));
        let motion = recorder.into_solution();
        for pair in motion.times.windows(2) {
            for fraction in [0.2, 0.5, 0.8] {
                let t = pair[0] + fraction * (pair[1] - pair[0]);
                let error = motion.at(t).unwrap().orientation().angle_to(exact.at(t).unwrap().orientation());
                assert!(error < 2e-6, "{which} {t} {error}");
            }
        }
    }
}

/// Case 2 of 7.2.1, the flip of a box: counts of steps are work, and must not creep up.
#[test]
fn rkmk8_flips_the_box_to_a_billionth_in_a_hundred_and_seven_trials() {
    let problem = thesis_case(2, 10.0);
    let control = Adaptive::with_tolerances(1e-10, 1e-12);
    let end = Run::new(&problem.system, Method::Rkmk8B, Steps::adapted((0.0, 10.0), control))
        .from(&problem.initial)
        .unwrap();
    assert!(problem.error(&end.state) < 1.1e-9, "{:e}", problem.error(&end.state));
    assert!(end.steps + end.rejected <= 108, "{} {}", end.steps, end.rejected);
    assert!(end.rejected <= 8, "{}", end.rejected);
}

#[test]
fn a_wild_first_step_is_rejected_and_the_run_goes_on() {
    let problem = heavy_top(true);
    for method in Method::ALL.into_iter().filter(|m| m.info().embedded.is_some()) {
        let control = Adaptive { first_step: Some(1e3), ..Adaptive::with_tolerances(1e-8, 1e-8) };
        let interval = (0.0, problem.duration);
        let end = Run::new(&problem.system, method, Steps::adapted(interval, control))
            .from(&problem.initial)
            .unwrap();
        assert!(
            end.rejected > 0 && problem.error(&end.state) < 1e-5,
            "{method}: {:e}",
            problem.error(&end.state)
        );
    }
}

#[test]
fn a_force_that_is_not_a_number_for_long_steps_is_met_by_shorter_ones() {
    let body = RigidBody::try_box(1.0, Vector3::new(1.0, 2.0, 3.0)).unwrap();
    let cliff = |_: f64, _: &RigidBody, x: &RigidBodyState| Wrench {
        // Real only within the unit ball.
        force: -x.position() / (1.0 - x.position().norm_squared()).sqrt(),
        torque: Vector3::zeros(),
    };
    let system = under(body, cliff);
    let start = RigidBodyState::new(
        Vector3::new(0.9, 0.0, 0.0),
        UnitQuaternion::identity(),
        Vector3::new(0.1, 0.0, 0.0),
        Vector3::zeros(),
    );
    let control = Adaptive { first_step: Some(5.0), ..Adaptive::default() };
    for method in [Method::Rkmk3, Method::Rkmk5, Method::Rkmk8, Method::Rkmk8B] {
        let end = Run::new(&system, method, Steps::adapted((0.0, 5.0), control)).from(&start);
        let end = end.unwrap();
        assert!(end.rejected > 0 && end.state.is_finite(), "{method}");
    }
}

#[test]
fn momentum_form_keeps_angular_momentum_to_the_bit() {
    fn check<S: RigidSystem, M>(system: &S, initial: &StateOf<S>, stepper: &M)
    where
        M: for<'a> Stepper<MomentumForm<'a, S>>,
    {
        let form = MomentumForm(system);
        let start = form.encode(initial);
        let grid = TimeGrid::try_with_steps(0.0, 10.0, 1000).unwrap();
        let end = Run::by_stepper(&form, stepper, grid).from(&start).unwrap().state;
        assert_eq!(format!("{:?}", end.rate), format!("{:?}", start.rate));
    }
    let problem = asymmetric_body();
    check(&problem.system, &problem.initial, &RungeKutta4);
    check(&problem.system, &problem.initial, &RungeKuttaMuntheKaas4);
    check(&problem.system, &problem.initial, &RungeKuttaMuntheKaas(somersault::integrators::methods::Dop853));
    check(&problem.system, &problem.initial, &somersault::integrators::methods::CommutatorFree4);
}

#[test]
fn several_bodies_move_as_each_alone() {
    let boxes = [[1.0, 2.0, 3.0], [0.5, 0.4, 0.9], [2.0, 2.0, 1.0]]
        .map(|l| RigidBody::try_box(1.3, Vector3::from(l)).unwrap());
    let starts = [[1.0, 0.7, 2.0], [-2.0, 0.1, 0.3], [0.5, 3.0, -1.0]]
        .map(|w| RigidBodyState::spinning(Vector3::from(w)));
    let grid = TimeGrid::try_new(0.0, 1.0, 0.03).unwrap();
    let weight = ConstantForce { force: Vector3::new(0.0, 0.0, -4.0), point: Vector3::new(0.1, 0.0, 0.5) };
    let drag = Drag { linear: 0.2, quadratic: 0.1, angular: 0.1 };
    for method in Method::ALL {
        let torque = method.info().orders.rotation_with_torque.is_some();
        let forces = || if torque { vec![Box::new((weight, drag)) as BoxedForce] } else { Vec::new() };
        let system =
            RigidBodiesSystem::try_new(boxes.to_vec(), (0..3).map(|_| forces()).collect(), ()).unwrap();
        let end = Run::new(&system, method, grid).from(&RigidBodiesState::from_bodies(&starts)).unwrap();
        let together: Vec<RigidBodyState> = (0..3).map(|i| end.state.body(i).unwrap()).collect();
        for i in 0..3 {
            let system = RigidBodySystem::new(boxes[i], forces());
            let alone = Run::new(&system, method, grid).from(&starts[i]).unwrap().state;
            if matches!(method, Method::Imid | Method::Radau5) {
                // Their iterations end for all bodies at once, a rounding or so later than for one.
                assert!((alone.angular_velocity() - together[i].angular_velocity()).norm() < 1e-13);
            } else {
                assert_eq!(alone, together[i], "{method}, body {i}");
            }
        }
    }
}

#[test]
fn a_step_of_minus_h_takes_an_implicit_midpoint_step_back() {
    for problem in [asymmetric_body(), heavy_top(false)] {
        for h in [0.1, 0.02] {
            let stepper = somersault::integrators::methods::ImplicitMidpoint;
            let system = &problem.system;
            let mut memory = stepper.start(system, &problem.initial).unwrap();
            let (mut there, mut back) = (problem.initial, problem.initial);
            stepper.step(system, 0.0, &problem.initial, h, &mut memory, &mut there).unwrap();
            stepper.step(system, h, &there, -h, &mut memory, &mut back).unwrap();
            assert!(so3::angle_between(back.orientation(), problem.initial.orientation()) < 1e-14);
            assert!((back.angular_velocity() - problem.initial.angular_velocity()).norm() < 1e-14);
            assert!((back.position() - problem.initial.position()).norm() < 1e-14);
        }
    }
}

#[test]
fn an_implicit_step_too_large_is_a_typed_error() {
    let problem = asymmetric_body();
    let grid = TimeGrid::try_with_steps(0.0, 100.0, 10).unwrap();
    let found = Run::new(&problem.system, Method::Imid, grid).from(&problem.initial);
    match found {
        Err(IntegrateError::Step(StepError::NotConverged { method, t, iterations, residual })) => {
            assert_eq!((method, t), ("imid", 0.0));
            assert!(iterations > 1 && (residual.is_nan() || residual > 1e-11), "{iterations} {residual}");
        }
        other => panic!("{other:?}"),
    }
}

#[test]
fn the_splittings_are_exact_for_a_free_body_at_any_step() {
    let problem = asymmetric_body();
    for method in [Method::Split2, Method::Split4] {
        for steps in [1, 7] {
            assert!(problem.error_of(method, steps).unwrap() < 1e-14, "{method}");
        }
    }
}

#[test]
fn dense_output_meets_the_ends_of_every_step() {
    struct Ends(f64);
    impl Observer<somersault::integrators::state::Pose> for Ends {
        fn observe(&mut self, step: &mut Step<'_, somersault::integrators::state::Pose>) -> Flow {
            let curve = step.interpolant();
            let mut x = *step.before;
            curve.evaluate(step.t_before, &mut x);
            assert_eq!(x.position(), step.before.position());
            assert!(so3::angle_between(x.orientation(), step.before.orientation()) < 1e-15);
            for (t, end) in [(step.t_before, step.before), (step.t_after, step.after)] {
                curve.evaluate(t, &mut x);
                let worst = [
                    so3::angle_between(x.orientation(), end.orientation()),
                    (x.position() - end.position()).norm(),
                    (x.velocity() - end.velocity()).norm(),
                    (x.angular_velocity() - end.angular_velocity()).norm(),
                ];
                self.0 = worst.into_iter().fold(self.0, f64::max);
            }
            Flow::Continue
        }
    }
    for problem in [asymmetric_body(), heavy_top(true)] {
        for method in Method::ALL {
            if problem.stated(&method.info().orders).is_none() {
                continue;
            }
            let grid = TimeGrid::try_with_steps(0.0, 1.0, 40).unwrap();
            let mut ends = Ends(0.0);
            Run::new(&problem.system, method, grid).observed_by(&mut ends).from(&problem.initial).unwrap();
            assert!(ends.0 < 2e-14, "{method}: {:e}", ends.0);
        }
    }
}

/// Looking at the curves of a run does not change it.
#[test]
fn dense_output_leaves_the_run_as_it_is() {
    let problem = heavy_top(true);
    for method in Method::ALL {
        if method.info().orders.rotation_with_torque.is_none() {
            continue;
        }
        let grid = TimeGrid::try_new(0.0, 1.0, 0.03).unwrap();
        let plain = Run::new(&problem.system, method, grid).from(&problem.initial).unwrap();
        let mut recorder = Recorder::new(0.0, &problem.initial, 1).with_dense_output();
        let seen = Run::new(&problem.system, method, grid)
            .observed_by(&mut recorder)
            .from(&problem.initial)
            .unwrap();
        assert_eq!(plain.state, seen.state, "{method}");
    }
}

#[test]
fn a_step_that_does_not_divide_the_interval_keeps_the_order() {
    let problem = heavy_top(true);
    for method in Method::ALL {
        let Some(order) = method.info().orders.rotation_with_torque else { continue };
        let found = estimate(problem.duration, &sampling(order), |n| {
            // A last step of four tenths, of a method that must start anew for it.
            let dt = problem.duration / (n as f64 + 0.4);
            let grid = TimeGrid::try_new(0.0, problem.duration, dt).unwrap();
            assert_eq!(grid.steps(), n + 1);
            let end = Run::new(&problem.system, method, grid).from(&problem.initial).ok()?;
            assert_eq!(end.t, problem.duration);
            Some(problem.error(&end.state))
        });
        assert!(
            says_at_least(&found, order, slack(order, true))
                || found.slope.is_some_and(|s| s > f64::from(order) - 0.5),
            "{method}: {found:?}"
        );
    }
}

/// A memory restarted in the middle gives the run made of two runs.
#[test]
fn a_restart_forgets_all() {
    struct Halves<'a>(&'a Problem);
    impl Visitor<Pose> for Halves<'_> {
        type Output = ();
        fn visit<B: Form<Pose>, M: Stepper<B>>(self, form: B, stepper: M) {
            let h = 0.02;
            let run = |memory: &mut M::Memory, x: &StateOf<B>| {
                let (mut x, mut y) = (x.clone(), x.clone());
                for n in 0..10 {
                    stepper.step(&form, f64::from(n) * h, &x, h, memory, &mut y).unwrap();
                    std::mem::swap(&mut x, &mut y);
                }
                x
            };
            let start = form.encode(&self.0.initial);
            let mut memory = stepper.start(&form, &start).unwrap();
            let first = run(&mut memory, &start);
            stepper.restart(&mut memory);
            let second = run(&mut memory, &start);
            assert_eq!(format!("{first:?}"), format!("{second:?}"), "{}", M::INFO.name);
        }
    }
    for problem in [asymmetric_body(), heavy_top(true)] {
        for method in Method::ALL {
            if problem.stated(&method.info().orders).is_some() {
                method.visit(Options::default(), &problem.system, Halves(&problem));
            }
        }
    }
}

#[test]
fn twins_are_listed_with_their_variables() {
    for name in ["rkmk3_b", "rkmk5_b", "rkmk8_b", "cf4_b"] {
        let method: Method = name.parse().unwrap();
        assert_eq!(method.info().variables, Variables::Body);
    }
}
