//! Where there is no derivative, and bad input.

use crate::located_differences::RKMK8;
use nalgebra::Vector3;
use somersault_contact::contacts::{BodyInContact, Contact, Contacts};
use somersault_contact::laws::compliant::CompliantLaw;
use somersault_contact::models::BouncingBall;
use somersault_contact::sensitivity::{
    Differentiation, Parameter, SensitivityError, SensitivityRun, Side, Undifferentiated,
};
use somersault_contact::surface::HalfSpace;
use somersault_integrators::body::RigidBody;
use somersault_integrators::driver::{Adaptive, IntegrateError, Steps, TimeGrid};
use somersault_integrators::events::Interruption;
use somersault_integrators::force::{Gravity, Wrench};
use somersault_integrators::methods::Method;
use somersault_integrators::state::RigidBodyState;
use std::sync::Arc;

fn ball() -> BouncingBall {
    BouncingBall::try_new(1.0, 0.1, CompliantLaw::try_new(400.0, 4.0).unwrap()).unwrap()
}

fn at(z: f64, velocity: f64) -> RigidBodyState {
    let mut state = RigidBodyState::default();
    (state.configuration.position.z, state.rate.linear.z) = (z, velocity);
    state
}

#[test]
fn a_graze_is_an_error_that_keeps_the_solution() {
    // Pushed up at 2 m/s², the body comes down to the ground and turns there.
    let law = |damping| CompliantLaw::try_new(50.0, damping).unwrap();
    let system = |damping| {
        let contact =
            Contact::try_new(Vector3::zeros(), Arc::new(HalfSpace::ground()), law(damping)).unwrap();
        let up = Gravity { acceleration: Vector3::new(0.0, 0.0, 2.0) };
        let body = RigidBody::try_box(1.0, Vector3::repeat(0.1)).unwrap();
        BodyInContact::new(body, (up, Contacts::new(vec![contact])))
    };
    // Turned around at a depth, or at a height above the ground where that is negative.
    let dip = |depth: f64| at(0.25, -(4.0 * (0.25 + depth)).sqrt());
    let run = |damping, depth, grazing| {
        let grid = TimeGrid::try_new(0.0, 1.0, 1e-2).unwrap();
        let by = Differentiation { grazing, ..Differentiation::default() };
        SensitivityRun::by_stepper(&system(damping), &by, &RKMK8, grid).from(&dip(depth))
    };
    let grazing_of = |error: Box<Undifferentiated>| match error.reason {
        SensitivityError::Grazing(grazing) => grazing,
        _ => panic!("{error}"),
    };
    for (depth, side) in [(1e-8, Side::Touching), (-1e-8, Side::Missing)] {
        let error = run(0.5, depth, 5e-8).unwrap_err();
        assert_eq!(error.so_far.run.t, 1.0);
        assert_eq!(error.so_far.run.events.len(), if depth > 0.0 { 2 } else { 0 });
        assert!(error.so_far.state.iter().all(|d| d.is_finite()));
        let message = error.to_string();
        assert!(message.starts_with("contact 0 is grazed at t = 0."), "{message}");
        assert!(message.ends_with(&format!("motions that {side}")), "{message}");
        let grazing = grazing_of(error);
        // The gap is ½ · 2 (t − ½)² − depth, and the way that the point covers 1 m.
        assert!((grazing.gap + depth).abs() < 1e-12 && (grazing.bound - 5e-8).abs() < 1e-10, "{grazing:?}");
        assert!((grazing.t - 0.5).abs() < 1e-3 && grazing.side == side, "{grazing:?}");
    }
    // Deeper, higher, or without damping, there is a derivative.
    assert!(run(0.5, 1e-7, 5e-8).is_ok() && run(0.5, -1e-7, 5e-8).is_ok() && run(0.0, 1e-8, 5e-8).is_ok());
    // An exact graze, and a miss by a picometre, with the least bound: they gave −0.2997 and 0.6 in silence.
    for (depth, least) in [(0.0, 0.0), (1e-12, -1e-12), (-1e-12, 1e-12)] {
        for grazing in [1e-300, Differentiation::default().grazing] {
            let found = grazing_of(run(0.5, depth, grazing).unwrap_err());
            assert!((found.gap - least).abs() < 1e-13, "{depth}: {found:?}");
            assert!((found.bound - f64::EPSILON.sqrt()).abs() < 1e-10, "{found:?}");
        }
    }
}

#[test]
fn bad_input_is_refused_with_the_start_kept() {
    let ball = ball();
    let grid = TimeGrid::try_new(0.0, 0.5, 1e-2).unwrap();
    let attempt = |start: &RigidBodyState, by: Differentiation| {
        let error = SensitivityRun::by_stepper(&ball.system, &by, &RKMK8, grid).from(start).unwrap_err();
        assert_eq!((error.so_far.run.t, error.so_far.run.steps), (0.0, 0));
        assert!(error.so_far.run.events.is_empty() && error.so_far.event_times.is_empty());
        error.reason
    };
    let start = ball.at(0.5, 0.0);
    for parameter in [Parameter::normal(1, "stiffness"), Parameter::normal(7, "damping")] {
        let error = attempt(&start, Differentiation::by([Parameter::Mass, parameter]));
        assert!(matches!(error, SensitivityError::NoSuchContact { contacts: 1, .. }), "{error}");
    }
    for grazing in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        let error = attempt(&start, Differentiation { grazing, ..Differentiation::default() });
        assert!(error.to_string().starts_with("`grazing` must be positive and finite"), "{error}");
    }
    let error = attempt(&ball.at(f64::NAN, 0.0), Differentiation::default());
    let expected = |e: &SensitivityError| {
        matches!(e, SensitivityError::Run(Interruption::Integrate(IntegrateError::InitialState { .. })))
    };
    assert!(expected(&error), "{error}");
    let mut on_surface = ball.at(0.0, -1.0);
    on_surface.configuration.position.z = 0.1;
    let error = attempt(&on_surface, Differentiation::default());
    assert_eq!(error, SensitivityError::StartOnSurface { guard: 0 });
}

#[test]
fn a_derivative_that_is_not_a_number_ends_the_run_and_keeps_it() {
    let ball = ball();
    let grid = TimeGrid::try_new(0.0, 0.5, 1e-2).unwrap();
    let force = Vector3::repeat(f64::NAN);
    let by = Parameter::Force(Arc::new(move |t, _, _| Wrench {
        force: if t > 0.2 { force } else { Vector3::zeros() },
        torque: Vector3::zeros(),
    }));
    let (by, start) = (Differentiation::by([by]), ball.at(0.5, 0.0));
    let error = SensitivityRun::by_stepper(&ball.system, &by, &RKMK8, grid).from(&start).unwrap_err();
    let at = |e: &Undifferentiated| match e.reason {
        SensitivityError::Run(Interruption::Integrate(IntegrateError::NonFinite { t })) => t,
        _ => f64::NAN,
    };
    assert!((at(&error) - 0.21).abs() < 1e-12 && (error.so_far.run.t - 0.2).abs() < 1e-12, "{error}");
    assert!(error.so_far.state.iter().all(|d| d.is_finite()));
}

#[test]
fn methods_parameters_and_steps_that_cannot_be_are_refused() {
    let ball = ball();
    let grid = TimeGrid::try_new(0.0, 0.5, 1e-2).unwrap();
    let attempt = |method: Method, by: &[Parameter]| {
        let (start, by) = (ball.at(0.5, 0.0), Differentiation::by(by));
        let found = SensitivityRun::new(&ball.system, &by, method, grid).from(&start);
        found.map_err(|error| error.reason).map(|found| found.run.t)
    };
    for method in [Method::Lgvi, Method::Rk4L, Method::Split4] {
        let error = attempt(method, &[]).unwrap_err();
        assert_eq!(error, SensitivityError::Method { method: method.info().name });
    }
    assert_eq!((attempt(Method::Rkmk, &[]), attempt(Method::RkmkB, &[])), (Ok(0.5), Ok(0.5)));
    let error = attempt(Method::Rkmk, &[Parameter::friction(0, "coefficient")]).unwrap_err();
    assert_eq!(error, SensitivityError::NoFriction { contact: 0 });
    let adaptive = |method: Method| {
        let (start, by) = (ball.at(0.5, 0.0), Differentiation::default());
        let steps = Steps::adapted((0.0, 0.5), Adaptive::default());
        let found = SensitivityRun::new(&ball.system, &by, method, steps).from(&start);
        found.map_err(|error| error.reason).map(|found| found.run.t)
    };
    assert_eq!(adaptive(Method::Rkmk8B), Ok(0.5));
    assert_eq!(adaptive(Method::Heun), Ok(0.5));
    let error = adaptive(Method::Ab2).unwrap_err();
    assert!(error.to_string().contains("no error estimate"), "{error}");
    let stretches = vec![Vector3::zeros(); 3];
    let by = Differentiation { stretches, ..Differentiation::default() };
    let run = SensitivityRun::by_stepper(&ball.system, &by, &RKMK8, grid);
    let error = run.from(&ball.at(0.5, 0.0)).unwrap_err();
    assert!(error.to_string().starts_with("`stretches` must have"), "{error}");
}
