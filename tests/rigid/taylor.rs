//! The Taylor series method: its motions against closed forms and another method, and what it refuses.

use somersault::integrators::driver::IntegrateError;
use somersault::integrators::force::{BoxedForce, CentralGravity, ScheduledTorque, Wrench};
use somersault::integrators::methods::{Dop853, RungeKuttaMuntheKaas, TaylorSeries};
use somersault::integrators::orbit::{Elements, Orbit};
use somersault::integrators::reversal::{TimeReversed, reversed};
use somersault::integrators::rotors::LinearSchedule;
use somersault::integrators::run::ByEmbeddedStepper;
use somersault::integrators::satellite::{Field, GravityGradient, MagneticDipole};
use somersault::integrators::state::{Configuration, Pose, Rate, RigidBodiesState, Tolerances, Twist};
use somersault::integrators::stepper::{EmbeddedStepper, StepError, weighed_error};
use somersault::integrators::system::{Gravitation, RigidBodiesSystem};
use somersault::prelude::*;
use somersault_testkit::order::slope;
use somersault_testkit::problems::under;
use somersault_testkit::trees::Random;

/// Here methods are given by their types, so that of the table no others are compiled for the systems of these tests.
const RKMK8: RungeKuttaMuntheKaas<Dop853> = RungeKuttaMuntheKaas(Dop853);

fn by_series<S: System>(
    system: &S,
    steps: impl Into<Steps>,
) -> Run<'_, S, ByEmbeddedStepper<'static, TaylorSeries>> {
    Run::by_embedded_stepper(system, &TaylorSeries, steps)
}

fn body() -> RigidBody {
    RigidBody::try_principal(1.3, Vector3::new(1.0, 2.0, 2.5)).unwrap()
}

/// Its axes are not the principal ones.
fn skewed() -> RigidBody {
    let turn = UnitQuaternion::from_euler_angles(0.4, -0.7, 1.1);
    RigidBody::try_new(0.8, body().inertia().rotated(&turn).unwrap()).unwrap()
}

fn start() -> RigidBodyState {
    RigidBodyState::new(
        Vector3::new(0.3, -0.2, 1.1),
        UnitQuaternion::from_euler_angles(0.3, -0.5, 0.9),
        Vector3::new(-0.4, 0.6, 0.2),
        Vector3::new(1.2, -0.8, 2.0),
    )
}

/// The largest of the differences of position, velocity and angular velocity, and of the angle between orientations.
fn gap(a: &RigidBodyState, b: &RigidBodyState) -> f64 {
    [
        (a.position() - b.position()).norm(),
        (a.velocity() - b.velocity()).norm(),
        (a.angular_velocity() - b.angular_velocity()).norm(),
        a.orientation().angle_to(b.orientation()),
    ]
    .into_iter()
    .fold(0.0, f64::max)
}

fn adapted(end: f64, tolerance: f64) -> Steps {
    Steps::adapted((0.0, end), Adaptive::with_tolerances(tolerance, tolerance))
}

/// Each force that has a series.
fn forces() -> Vec<(&'static str, BoxedForce)> {
    let (a, b) = (Vector3::new(0.7, -0.4, 0.5), Vector3::new(0.2, 0.3, -0.6));
    let spring = |attachment, damping, rest_length| Spring {
        anchor: Vector3::new(0.5, 0.4, -1.5),
        attachment,
        stiffness: 4.0,
        damping,
        rest_length,
    };
    vec![
        ("gravity", Box::new(Gravity::earth())),
        ("force at a point", Box::new(ConstantForce { force: a, point: b })),
        ("torque in the world", Box::new(ConstantTorque::World(a))),
        ("torque in the body", Box::new(ConstantTorque::Body(b))),
        ("drag", Box::new(Drag { linear: 0.3, quadratic: 0.0, angular: 0.2 })),
        ("quadratic drag", Box::new(Drag { linear: 0.1, quadratic: 0.4, angular: 0.0 })),
        ("spring", Box::new(spring(Vector3::zeros(), 0.0, 0.0))),
        ("spring with a length", Box::new(spring(Vector3::zeros(), 0.0, 0.7))),
        ("spring off centre", Box::new(spring(b, 0.0, 0.7))),
        ("damped spring off centre", Box::new(spring(b, 0.9, 0.7))),
        (
            "attraction",
            Box::new(CentralGravity { gravitational_parameter: 3.0, centre: Vector3::new(3.0, -2.0, 1.0) }),
        ),
        ("dipole", Box::new(MagneticDipole { moment: a, field: Field::Uniform(b) })),
    ]
}

fn together() -> Vec<BoxedForce> {
    forces().into_iter().map(|(_, force)| force).collect()
}

#[test]
fn the_terms_of_a_force_sum_to_its_wrench() {
    let mut random = Random::new(3);
    for (name, force) in forces() {
        for body in [body(), skewed()] {
            let mut terms = Vec::new();
            assert!(force.add_terms(&body, &mut terms), "{name}");
            for _ in 0..20 {
                let [r, v, w] = [2.0, 3.0, 4.0].map(|size| random.vector(size));
                let x = RigidBodyState::new(r, random.rotation(), v, w);
                let sum = terms.iter().fold(Wrench::default(), |sum, term| sum + term.wrench(&x));
                let wrench = force.wrench(0.0, &body, &x);
                assert!((sum.force - wrench.force).norm() < 1e-13 * (1.0 + wrench.force.norm()), "{name}");
                assert!((sum.torque - wrench.torque).norm() < 1e-13 * (1.0 + wrench.torque.norm()), "{name}");
            }
        }
    }
}

/// Against the method of order 8, whose error at the end is below 1e-12.
#[test]
fn motions_under_each_force_are_those_of_another_method() {
    let check = |name: &str, system: &RigidBodySystem<Vec<BoxedForce>>| {
        let fine =
            Run::by_embedded_stepper(system, &RKMK8, adapted(2.0, 1e-13)).from(&start()).unwrap().state;
        let ours = by_series(system, adapted(2.0, 1e-13)).from(&start());
        let ours = ours.unwrap_or_else(|error| panic!("{name}: {error}"));
        assert!(gap(&ours.state, &fine) < 5e-12, "{name}: {:e}", gap(&ours.state, &fine));
    };
    for body in [body(), skewed()] {
        for (name, force) in forces() {
            check(name, &RigidBodySystem::new(body, vec![force]));
        }
        check("all", &RigidBodySystem::new(body, together()));
    }
}

/// One that has a series, springs and centres near the body among them.
fn random_force(random: &mut Random) -> BoxedForce {
    let some = |random: &mut Random, most| if random.below(2) == 0 { 0.0 } else { random.within(0.0, most) };
    match random.below(8) {
        0 => Box::new(Gravity::earth()),
        1 => Box::new(ConstantForce { force: random.vector(1.0), point: random.vector(0.3) }),
        2 => Box::new(ConstantTorque::World(random.vector(1.0))),
        3 => Box::new(Drag { linear: random.within(0.0, 0.6), quadratic: 0.0, angular: 0.3 }),
        4 => Box::new(Drag { linear: 0.0, quadratic: random.within(0.0, 0.6), angular: 0.0 }),
        5 => Box::new(Spring {
            anchor: random.vector(1.5),
            attachment: some(random, 0.5) * random.vector(1.0),
            stiffness: random.within(1.0, 30.0),
            damping: some(random, 1.0),
            rest_length: some(random, 1.0),
        }),
        6 => {
            Box::new(MagneticDipole { moment: random.vector(1.0), field: Field::Uniform(random.vector(1.0)) })
        }
        _ => Box::new(CentralGravity {
            gravitational_parameter: random.within(0.5, 4.0),
            centre: random.vector(3.0),
        }),
    }
}

/// Single coefficients of high degree vanish by chance, and the series of a length near zero hardly converges. Steps are chosen from random
/// states, from rest too, under up to three forces, and their errors found by `rkmk8`.
#[test]
fn the_error_of_a_step_that_is_chosen_is_within_its_tolerance() {
    let mut random = Random::new(11);
    let mut errors: Vec<f64> = Vec::new();
    for _ in 0..4000 {
        let moments = Vector3::new(1.0, random.within(0.6, 1.4), random.within(0.5, 1.5));
        let body = RigidBody::try_principal(1.0, moments * random.within(0.1, 2.0)).unwrap();
        let forces: Vec<BoxedForce> = (0..random.below(4)).map(|_| random_force(&mut random)).collect();
        let speed = [0.0, 1e-3, 1.0][random.below(3)];
        let x = RigidBodyState::new(
            random.vector(1.5),
            random.rotation(),
            random.vector(1.0) * speed,
            random.vector(1.0) * [0.0, 0.3, 5.0][random.below(3)],
        );
        let tolerance = 10f64.powf(random.within(-11.0, -4.0));
        let tolerances = Tolerances { absolute: tolerance, relative: tolerance };
        let system = RigidBodySystem::new(body, forces);
        let mut memory = TaylorSeries.start(&system, &x).unwrap();
        let longest = TaylorSeries.longest_step(&system, &x, &mut memory, &tolerances).unwrap().unwrap();
        let h = longest.min(3.0);
        let mut found = x;
        TaylorSeries.step(&system, 0.0, &x, h, &mut memory, &mut found).unwrap();
        let fine = Run::by_embedded_stepper(&system, &RKMK8, adapted(h, 1e-15)).from(&x).unwrap().state;
        let mut displacement = Twist::default();
        found.configuration.difference(&fine.configuration, &mut displacement);
        let mut change = found.rate;
        change.axpy(-1.0, &fine.rate);
        errors.push(weighed_error(&x, &found, &displacement, &change, &tolerances));
    }
    errors.sort_by(f64::total_cmp);
    let [rare, largest] = [errors[errors.len() - 1 - errors.len() / 100], errors[errors.len() - 1]];
    assert!(rare < 1.0 && largest < 5.0, "{rare} {largest}");
}

#[test]
fn a_free_body_moves_as_the_exact_one() {
    for body in [body(), skewed(), RigidBody::try_principal(1.0, Vector3::repeat(1.0)).unwrap()] {
        let system = RigidBodySystem::free(body);
        let found = by_series(&system, adapted(10.0, 1e-13)).from(&start()).unwrap().state;
        let exact = FreeBody::try_new(&body, &start()).unwrap().at(10.0).unwrap();
        assert!(gap(&found, &exact) < 1e-11, "{:e}", gap(&found, &exact));
    }
}

/// The first term left out is that of h¹⁷.
#[test]
fn a_step_is_the_taylor_polynomial_of_degree_16() {
    let exact = FreeBody::try_new(&body(), &start()).unwrap();
    let system = RigidBodySystem::free(body());
    let errors = [0.9, 0.8, 0.7, 0.6].map(|h| {
        let grid = TimeGrid::try_with_steps(0.0, h, 1).unwrap();
        let found = by_series(&system, grid).from(&start()).unwrap().state;
        (h, gap(&found, &exact.at(h).unwrap()))
    });
    assert!(errors[3].1 > 1e-13, "{errors:?}");
    let power = slope(&errors);
    assert!((power - 17.0).abs() < 1.0, "{power} {errors:?}");
}

/// One step turns a body with equal moments by more than half a turn: nothing is special there.
#[test]
fn a_step_may_be_longer_than_half_a_turn() {
    let body = RigidBody::try_principal(1.0, Vector3::repeat(1.0)).unwrap();
    let start = RigidBodyState::spinning(Vector3::new(0.0, 0.0, 4.0));
    let grid = TimeGrid::try_with_steps(0.0, 1.0, 1).unwrap();
    let mut recorder = Recorder::new(0.0, &start, 1).with_dense_output();
    let run = by_series(&RigidBodySystem::free(body), grid).observed_by(&mut recorder).from(&start);
    let angle = |x: &RigidBodyState, angle: f64| {
        x.orientation().angle_to(&UnitQuaternion::from_axis_angle(&Vector3::z_axis(), angle))
    };
    // The first term left out, (θ/2)¹⁷/17!, is 4e-10.
    assert!(angle(&run.unwrap().state, 4.0) < 1e-9);
    let solution = recorder.into_solution();
    assert!(angle(&solution.at(0.9).unwrap(), 3.6) < 1e-9);
}

#[test]
fn a_run_back_ends_at_the_start() {
    for (name, force) in forces() {
        let system = RigidBodySystem::new(skewed(), vec![force]);
        let end = by_series(&system, adapted(1.5, 1e-13)).from(&start()).unwrap().state;
        let RigidBodySystem { body, forces } = system;
        let back = RigidBodySystem::new(body, TimeReversed(forces));
        let found = by_series(&back, adapted(1.5, 1e-13)).from(&reversed(&end)).unwrap().state;
        assert!(gap(&reversed(&found), &start()) < 1e-11, "{name}: {:e}", gap(&reversed(&found), &start()));
    }
}

#[test]
fn several_bodies_have_each_its_own_series() {
    let bodies = vec![body(), skewed()];
    let states = [start(), RigidBodyState::spinning(Vector3::new(0.1, 2.0, -0.3))];
    let forces = || vec![together(), vec![]];
    let system = RigidBodiesSystem::try_new(bodies.clone(), forces(), ()).unwrap();
    let grid = TimeGrid::try_with_steps(0.0, 1.0, 200).unwrap();
    let end = by_series(&system, grid).from(&RigidBodiesState::from_bodies(&states)).unwrap().state;
    for (i, force) in forces().into_iter().enumerate() {
        let alone = RigidBodySystem::new(bodies[i], force);
        let alone = by_series(&alone, grid).from(&states[i]).unwrap().state;
        assert_eq!(end.body(i), Some(alone), "{i}");
    }
}

/// A spring drawn exactly through its anchor has no direction there, and its series goes on with the wrong one.
#[test]
fn no_step_goes_through_the_anchor_of_a_spring() {
    let spring = Spring {
        anchor: Vector3::zeros(),
        attachment: Vector3::zeros(),
        stiffness: 10.0,
        damping: 0.0,
        rest_length: 0.5,
    };
    let start = RigidBodyState::new(
        Vector3::new(1.0, 0.0, 0.0),
        UnitQuaternion::identity(),
        Vector3::new(-6.0, 0.0, 0.0),
        Vector3::zeros(),
    );
    let system = under(body(), spring);
    let error = by_series(&system, adapted(1.0, 1e-10)).from(&start).unwrap_err();
    assert!(matches!(error, IntegrateError::StepSize { .. } | IntegrateError::Step(_)), "{error}");
    let grid = TimeGrid::try_with_steps(0.0, 1.0, 10).unwrap();
    let error = by_series(&system, grid).from(&start).unwrap_err();
    assert!(matches!(error, IntegrateError::Step(StepError::StepTooLarge { .. })), "{error}");
    // Past it at a distance the way is smooth.
    let past = RigidBodyState {
        configuration: Pose { position: Vector3::new(1.0, 0.05, 0.0), ..start.configuration },
        ..start
    };
    let found = by_series(&system, adapted(1.0, 1e-12)).from(&past).unwrap().state;
    let fine = Run::by_embedded_stepper(&system, &RKMK8, adapted(1.0, 1e-13)).from(&past).unwrap().state;
    assert!(gap(&found, &fine) < 1e-10, "{:e}", gap(&found, &fine));
}

/// Under g and drag c |v| v/m a body falls from rest by m/c ln cosh(t √(g c/m)).
#[test]
fn a_fall_from_rest_under_quadratic_drag_is_that_in_closed_form() {
    let (g, c, m) = (9.81, 0.7, body().mass());
    let drag = Drag { linear: 0.0, quadratic: c, angular: 0.0 };
    let system = under(body(), (Gravity::earth(), drag));
    let fallen = |t: f64| m / c * (t * (g * c / m).sqrt()).cosh().ln();
    let end = by_series(&system, adapted(3.0, 1e-12)).from(&RigidBodyState::default()).unwrap();
    assert!((end.state.position().z + fallen(3.0)).abs() < 1e-11);
    // At rest for good without a weight, whatever the step.
    let grid = TimeGrid::try_with_steps(0.0, 10.0, 1).unwrap();
    let still = by_series(&under(body(), drag), grid).from(&RigidBodyState::default()).unwrap();
    assert_eq!(still.state, RigidBodyState::default());
    // Thrown straight up it turns at rest, where |v| v has no series: the run ends there, and not behind.
    let mut thrown = RigidBodyState::default();
    thrown.rate.linear.z = 5.0;
    let found = by_series(&system, adapted(2.0, 1e-10)).from(&thrown).map(|end| end.state);
    assert!(found.is_err(), "{found:?}");
    // A little askew it does not.
    thrown.rate.linear.x = 0.05;
    let found = by_series(&system, adapted(2.0, 1e-12)).from(&thrown).unwrap().state;
    let fine = Run::by_embedded_stepper(&system, &RKMK8, adapted(2.0, 1e-13)).from(&thrown).unwrap().state;
    assert!(gap(&found, &fine) < 1e-10, "{:e}", gap(&found, &fine));
}

#[test]
fn forces_without_series_are_refused_by_name_of_what_is_allowed() {
    let orbit = Orbit::try_new(Elements::circle(Elements::EARTH, 7.0e6)).unwrap();
    let off = Field::Dipole { orbit, strength: Vector3::z() };
    let without: Vec<BoxedForce> = vec![
        Box::new(GravityGradient { orbit }),
        Box::new(ScheduledTorque {
            components: std::array::from_fn(|_| LinearSchedule::constant(1.0)),
            is_in_body: false,
        }),
        Box::new(MagneticDipole { moment: Vector3::x(), field: off }),
        Box::new(|_: f64, _: &RigidBody, _: &RigidBodyState| Wrench::default()),
    ];
    for force in without {
        let system = RigidBodySystem::new(body(), vec![Box::new(Gravity::earth()) as BoxedForce, force]);
        let error = by_series(&system, adapted(1.0, 1e-8)).from(&start()).unwrap_err();
        assert_eq!(error, IntegrateError::Step(StepError::NoSeries { method: "taylor16" }));
        assert!(error.to_string().contains("springs"), "{error}");
    }
    let system =
        RigidBodiesSystem::try_new(vec![body(); 2], vec![(), ()], Gravitation { constant: 1.0 }).unwrap();
    let states = RigidBodiesState::from_bodies(&[start(), RigidBodyState::spinning(Vector3::x())]);
    let error = by_series(&system, adapted(1.0, 1e-8)).from(&states).unwrap_err();
    assert_eq!(error, IntegrateError::Step(StepError::NoSeries { method: "taylor16" }));
}

#[test]
fn a_step_made_again_shorter_is_that_step() {
    let system = RigidBodySystem::new(skewed(), together());
    let step = |sizes: &[f64]| {
        let mut memory = TaylorSeries.start(&system, &start()).unwrap();
        let mut out = start();
        for &h in sizes {
            TaylorSeries.step(&system, 0.0, &start(), h, &mut memory, &mut out).unwrap();
        }
        out
    };
    assert_eq!(step(&[0.003, 0.0005]), step(&[0.0005]));
}
