//! Bad input gives a typed error that names the argument, what was found and what is allowed.

use somersault::integrators::body::BodyError;
use somersault::integrators::driver::IntegrateError;
use somersault::integrators::system::RigidBodiesSystem;
use somersault::prelude::*;
use somersault_core::argument::ArgumentError;
use somersault_testkit::problems::under;

fn body() -> RigidBody {
    RigidBody::try_box(1.0, Vector3::new(0.2, 0.4, 0.6)).unwrap()
}

fn run(
    state: &RigidBodyState,
    forces: impl ForceModel + Send + Sync + 'static,
) -> Result<(), IntegrateError> {
    let grid = TimeGrid::try_new(0.0, 1.0, 0.01).unwrap();
    let system = under(body(), forces);
    Run::new(&system, Method::Rkmk, grid).from(state).map(|_| ())
}

#[test]
fn intervals_and_steps() {
    use IntegrateError::{Argument, Interval, TooManySteps};
    let grid = |a, b, h| TimeGrid::try_new(a, b, h).unwrap_err();
    assert!(matches!(grid(1.0, 0.0, 0.1), Interval { start: 1.0, end: 0.0 }));
    assert!(matches!(grid(1.0, 1.0, 0.1), Interval { .. }));
    assert!(matches!(grid(f64::NAN, 1.0, 0.1), Interval { .. }));
    assert!(matches!(grid(0.0, f64::INFINITY, 0.1), Interval { .. }));
    assert!(matches!(grid(0.0, 1.0, 0.0), Argument(ArgumentError::NotPositive { argument: "dt", .. })));
    assert!(matches!(grid(0.0, 1.0, -0.1), Argument(ArgumentError::NotPositive { argument: "dt", .. })));
    assert!(matches!(grid(0.0, 1.0, f64::NAN), Argument(ArgumentError::NotPositive { argument: "dt", .. })));
    assert!(matches!(grid(0.0, 1.0, 1e-300), TooManySteps { .. }));
    assert!(matches!(grid(1e16, 1e16 + 4.0, 0.1), TooManySteps { .. }));
    assert_eq!(grid(0.0, 1.0, -0.1).to_string(), "`dt` must be positive and finite, found -0.1");
}

#[test]
fn a_step_larger_than_the_interval_is_one_shorter_step() {
    let grid = TimeGrid::try_new(0.0, 0.3, 1.0).unwrap();
    assert_eq!((grid.steps(), grid.time(1)), (1, 0.3));
}

#[test]
fn states() {
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        for axis in 0..3 {
            let mut position = RigidBodyState::default();
            position.configuration.position[axis] = bad;
            let mut velocity = RigidBodyState::default();
            velocity.rate.angular[axis] = bad;
            for state in [position, velocity] {
                assert!(matches!(run(&state, ()), Err(IntegrateError::InitialState { .. })), "{state:?}");
            }
        }
    }
}

#[test]
fn a_force_that_returns_nan_ends_the_run_with_its_time() {
    let force = |t: f64, _: &RigidBody, _: &RigidBodyState| Wrench {
        force: Vector3::repeat(if t > 0.5 { f64::NAN } else { 0.0 }),
        torque: Vector3::zeros(),
    };
    match run(&RigidBodyState::default(), force) {
        Err(IntegrateError::NonFinite { t }) => assert!((0.5..0.53).contains(&t), "{t}"),
        other => panic!("{other:?}"),
    }
}

#[test]
fn bodies() {
    let inertia = *body().inertia();
    for mass in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        assert!(matches!(RigidBody::try_new(mass, inertia), Err(BodyError::Mass { .. })), "{mass}");
    }
    let error = RigidBody::try_principal(1.0, Vector3::new(1.0, 1.0, 3.0)).unwrap_err();
    assert_eq!(
        error.to_string(),
        "the largest principal moment must not exceed the sum of the other two (triangle inequality), \
         found [1.0, 1.0, 3.0]"
    );
    let error = RigidBodiesSystem::try_new(vec![body(); 2], vec![(); 3], ()).unwrap_err();
    assert_eq!(error.to_string(), "`forces` must have one entry for each of the 2 bodies, found 3");
}

#[test]
fn unknown_methods_list_the_known_ones() {
    let error = "rk5".parse::<Method>().unwrap_err().to_string();
    assert!(error.starts_with("no method is named `rk5`; the methods are euler, sie, sv, "), "{error}");
    for method in Method::ALL {
        assert!(error.contains(method.info().name), "{method}");
        assert_eq!(method.info().name.parse::<Method>().unwrap(), method);
    }
}

#[test]
fn adaptive_settings() {
    let system = RigidBodySystem::free(body());
    let start = RigidBodyState::spinning(Vector3::new(1.0, 2.0, 3.0));
    let adapt = |method: Method, interval, control: Adaptive| {
        Run::new(&system, method, Steps::adapted(interval, control)).from(&start).map(|_| ())
    };
    for method in Method::ALL {
        let MethodInfo { name, history, .. } = method.info();
        match adapt(method, (0.0, 1.0), Adaptive::default()) {
            Ok(()) => assert_eq!(history, 0, "{method}"),
            Err(error) => {
                assert_eq!(error, IntegrateError::NoErrorEstimate { method: name });
                assert!(history > 0, "{method}");
            }
        }
    }
    let Some(method) = Method::ALL.into_iter().find(|m| m.info().embedded.is_some()) else { return };
    let wrong = |control| match adapt(method, (0.0, 1.0), control) {
        Err(IntegrateError::Argument(ArgumentError::NotPositive { argument, .. })) => argument,
        other => panic!("{other:?}"),
    };
    assert_eq!(wrong(Adaptive::with_tolerances(0.0, 1e-9)), "relative");
    assert_eq!(wrong(Adaptive::with_tolerances(1e-9, f64::NAN)), "absolute");
    assert_eq!(wrong(Adaptive { first_step: Some(-1.0), ..Adaptive::default() }), "first_step");
    assert_eq!(wrong(Adaptive { max_step: f64::NAN, ..Adaptive::default() }), "max_step");
    let still = |control| match adapt(method, (1.0, 2.0), control) {
        Err(IntegrateError::Argument(ArgumentError::OutOfRange { argument, found, .. })) => (argument, found),
        other => panic!("{other:?}"),
    };
    assert_eq!(still(Adaptive { first_step: Some(1e-17), ..Adaptive::default() }), ("first_step", 1e-17));
    assert_eq!(still(Adaptive { max_step: 1e-17, ..Adaptive::default() }), ("max_step", 1e-17));
    assert!(matches!(adapt(method, (1.0, 0.0), Adaptive::default()), Err(IntegrateError::Interval { .. })));
    assert!(matches!(
        adapt(method, (0.0, 1e6), Adaptive { max_steps: 10, ..Adaptive::default() }),
        Err(IntegrateError::Budget { max_steps: 10, .. })
    ));
}
