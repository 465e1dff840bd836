//! Contact with adapted steps: events, tolerances, dense output, what is kept when a run breaks off.

use nalgebra::Vector3;
use somersault_contact::contacts::{BodyInContact, Contact, Contacts};
use somersault_contact::event::EventKind;
use somersault_contact::laws::compliant::CompliantLaw;
use somersault_contact::models::{BouncingBall, SpinningTop};
use somersault_contact::surface::{SignedDistance, Surface};
use somersault_core::argument::ArgumentError;
use somersault_integrators::body::RigidBody;
use somersault_integrators::driver::{Adaptive, IntegrateError, Status, Steps, TimeGrid};
use somersault_integrators::events::{Interruption, LocatedResult, Location};
use somersault_integrators::force::{Gravity, ScheduledTorque};
use somersault_integrators::methods::{Dop853, Method, RungeKutta4, RungeKuttaMuntheKaas};
use somersault_integrators::rotors::LinearSchedule;
use somersault_integrators::run::Run;
use somersault_integrators::solution::Recorder;
use somersault_integrators::state::{Pose, RigidBodyState};
use somersault_integrators::studies::problem::Errors;
use somersault_testkit::{bouncing_ball, spinning_top};
use std::sync::Arc;

const EMBEDDED: [Method; 6] =
    [Method::Rkmk3, Method::Rkmk5, Method::Rkmk8, Method::Rkmk3B, Method::Rkmk5B, Method::Rkmk8B];

const BALL: bouncing_ball::BouncingBall =
    bouncing_ball::BouncingBall { mass: 1.0, stiffness: 400.0, damping: 4.0, gravity: 9.81 };
const DROP: bouncing_ball::Motion = bouncing_ball::Motion { x: 0.5, v: 0.0 };

fn ball() -> BouncingBall {
    BouncingBall::try_new(BALL.mass, 0.1, CompliantLaw::try_new(BALL.stiffness, BALL.damping).unwrap())
        .unwrap()
}

fn ball_error(state: &RigidBodyState, exact: bouncing_ball::Motion) -> f64 {
    (state.position().z - 0.1 - exact.x).hypot(state.velocity().z - exact.v)
}

fn run(
    method: Method,
    system: &BodyInContact<Gravity>,
    start: &RigidBodyState,
    end: f64,
    settings: &Adaptive,
    recorder: &mut Recorder<Pose>,
) -> LocatedResult<BodyInContact<Gravity>> {
    let run = Run::new(system, method, Steps::adapted((0.0, end), *settings));
    run.locating(Location::default()).observed_by(recorder).from(start)
}

fn tolerance(tolerance: f64) -> Adaptive {
    Adaptive::with_tolerances(tolerance, tolerance)
}

fn recorder(start: &RigidBodyState) -> Recorder<Pose> {
    Recorder::new(0.0, start, 1)
}

#[test]
fn far_from_contacts_the_steps_are_those_of_the_plain_driver() {
    let mut top = SpinningTop::thesis().unwrap();
    // On the ground the tip touches after 17.4 ms; near it steps are shortened until they are proved clear.
    top.start.configuration.position.z += 0.2;
    for method in EMBEDDED {
        let settings = tolerance(1e-8);
        let mut plain = recorder(&top.start);
        let expected = Run::new(&top.system, method, Steps::adapted((0.0, 0.017), settings))
            .observed_by(&mut plain)
            .from(&top.start)
            .unwrap();
        let mut located = recorder(&top.start);
        let found = run(method, &top.system, &top.start, 0.017, &settings, &mut located).unwrap();
        assert_eq!((found.event_count, found.trials), (0, 0), "{method}");
        assert_eq!(
            (found.state, found.t, found.steps, found.rejected),
            (expected.state, expected.t, expected.steps, expected.rejected),
            "{method}"
        );
        assert_eq!(located.into_solution().times, plain.into_solution().times, "{method}");
    }
}

#[test]
fn adapted_steps_agree_with_the_closed_form_to_the_tolerance() {
    const END: f64 = 1.3;
    let (exact, switches) = BALL.run(DROP, END);
    let ball = ball();
    let start = ball.at(DROP.x, DROP.v);
    for method in EMBEDDED {
        let mut last = f64::INFINITY;
        for tol in [1e-5, 1e-7, 1e-9, 1e-11] {
            let run = run(method, &ball.system, &start, END, &tolerance(tol), &mut recorder(&start)).unwrap();
            assert_eq!((run.events.len(), run.t, run.status), (switches.len(), END, Status::Finished));
            let error = ball_error(&run.state, exact);
            println!(
                "{method:8} {tol:.0e}: {error:.1e}, {} steps, {} rejected, {} trials",
                run.steps, run.rejected, run.trials
            );
            // The errors of all steps, and what two contacts make of them.
            let bound = 5.0 * run.steps as f64 * tol;
            assert!(error < bound, "{method} {tol:e}: {error:e}");
            assert!(error < last, "{method} {tol:e}: {error:e} {last:e}");
            last = error.max(1e-13);
            for (event, switch) in run.events.iter().zip(&switches) {
                assert!((event.t - switch.t).abs() < bound, "{method} {tol:e}");
                assert_eq!(event.kind == EventKind::TouchDown, switch.begins);
            }
        }
    }
}

#[test]
fn adapted_steps_agree_with_reduced_coordinates_on_the_top() {
    const END: f64 = 0.1;
    let top = SpinningTop::thesis().unwrap();
    let frequency = 100.0 * std::f64::consts::PI;
    let reduced = spinning_top::SpinningTop {
        mass: 0.2,
        across: 0.817e-4,
        about: 1.6e-4,
        length: 0.05,
        stiffness: 0.2 * frequency * frequency,
        damping: 2.0 * 0.2 * frequency * 0.1,
        gravity: 9.81,
    };
    let (exact, switches) = reduced.run(0.05, 0.25f64.atan(), 32.0 * std::f64::consts::PI, END, 1e-6);
    let exact = RigidBodyState::new(
        Vector3::new(0.0, 0.0, exact.height),
        exact.orientation,
        Vector3::new(0.0, 0.0, exact.climb),
        exact.angular_velocity,
    );
    for method in [Method::Rkmk5B, Method::Rkmk8B, Method::Rkmk8] {
        for tol in [1e-6, 1e-9, 1e-11] {
            let run = run(method, &top.system, &top.start, END, &tolerance(tol), &mut recorder(&top.start))
                .unwrap();
            let errors = Errors::between(&run.state, &exact);
            println!("{method:8} {tol:.0e}: {errors:?}, {} steps, {} rejected", run.steps, run.rejected);
            assert_eq!(run.events.len(), switches.len());
            // Angular velocities are of the size 100 rad/s and weighed by it.
            assert!(
                errors.angular_velocity < 3e3 * tol && errors.orientation < 50.0 * tol,
                "{method} {tol:e}: {errors:?}"
            );
        }
    }
}

#[test]
fn the_step_after_an_event_is_chosen_for_the_new_mode() {
    // From a flight of one step into a contact a thousand times as fast, and out of it: one or two steps are rejected.
    let ball = BouncingBall::try_new(1.0, 0.1, CompliantLaw::try_new(1e8, 100.0).unwrap()).unwrap();
    let start = ball.at(0.5, 0.0);
    let run =
        run(Method::Rkmk8B, &ball.system, &start, 3.0, &tolerance(1e-9), &mut recorder(&start)).unwrap();
    println!(
        "{} events, {} steps, {} rejected, {} trials",
        run.event_count, run.steps, run.rejected, run.trials
    );
    assert!(run.event_count >= 8);
    assert!(run.rejected <= 2 * run.event_count && run.steps <= 10 * run.event_count);
}

#[test]
fn dense_output_meets_the_events_of_adapted_steps_and_the_closed_form_between_them() {
    const END: f64 = 1.3;
    let ball = ball();
    let start = ball.at(DROP.x, DROP.v);
    for method in [Method::Rkmk5, Method::Rkmk8, Method::Rkmk8B] {
        let mut recorder = Recorder::new(0.0, &start, 1).with_dense_output();
        let run = run(method, &ball.system, &start, END, &tolerance(1e-10), &mut recorder).unwrap();
        let solution = recorder.into_solution();
        assert!(solution.times.windows(2).all(|w| w[0] < w[1]));
        assert_eq!((solution.times.last(), solution.segments.len()), (Some(&END), run.steps as usize));
        for event in &run.events {
            let there = solution.at(event.t).unwrap();
            let off = Errors::between(&there, &event.state);
            assert!(off.position < 1e-14 && off.velocity < 1e-13, "{method}: {off:?}");
        }
        for i in 1..130 {
            let t = 0.01 * f64::from(i) + 0.003;
            let there = solution.at(t.min(END)).unwrap();
            let error = ball_error(&there, BALL.run(DROP, t.min(END)).0);
            // Orders 4 and 7 between the steps of methods of orders 5 and 8.
            let bound = if method == Method::Rkmk5 { 1e-7 } else { 1e-8 };
            assert!(error < bound, "{method} {t}: {error:e}");
        }
    }
}

/// A ground that is known down to some depth only.
#[derive(Debug)]
struct Known {
    ground: f64,
    down_to: f64,
}

impl Surface for Known {
    fn signed_distance(&self, point: &Vector3<f64>) -> SignedDistance {
        let distance = if point.z < self.down_to { f64::NAN } else { point.z - self.ground };
        SignedDistance { distance, gradient: Vector3::z() }
    }
    fn lipschitz(&self) -> f64 {
        1.0
    }
}

fn on(surface: Known) -> BodyInContact<Gravity> {
    let law = CompliantLaw::try_new(400.0, 4.0).unwrap();
    let contact = Contact::try_new(Vector3::zeros(), Arc::new(surface), law).unwrap();
    let body = RigidBody::try_box(1.0, Vector3::repeat(0.1)).unwrap();
    BodyInContact::new(body, (Gravity::earth(), Contacts::new(vec![contact])))
}

fn at(z: f64) -> RigidBodyState {
    let mut state = RigidBodyState::default();
    state.configuration.position.z = z;
    state
}

#[test]
fn a_surface_that_returns_nan_ends_an_adapted_run_where_it_does_and_keeps_the_solution() {
    let system = on(Known { ground: 0.0, down_to: 0.2 });
    let start = at(0.5);
    for method in [Method::Rkmk5, Method::Rkmk8B] {
        let mut recorder = recorder(&start);
        let error = run(method, &system, &start, 1.0, &tolerance(1e-9), &mut recorder).unwrap_err();
        assert!(
            matches!(error.reason, Interruption::NonFiniteGuard { guard: 0, gap, .. } if gap.is_nan()),
            "{error}"
        );
        // It falls below 0.2 m after √(0.6/g) s; the steps shrink until they get there to a rounding.
        let (t, z) = (error.so_far.t, error.so_far.state.position().z);
        assert!((t - (0.6f64 / 9.81).sqrt()).abs() < 1e-14 && z >= 0.2, "{method}: {t} {z}");
        let solution = recorder.into_solution();
        assert_eq!((solution.times.last(), solution.states.last()), (Some(&t), Some(&error.so_far.state)));
        assert!(error.so_far.rejected > 0);
    }
}

#[test]
fn a_step_beyond_what_is_known_of_a_surface_is_taken_back() {
    // The first steps in flight would end deep below ground, where nothing is known.
    let system = on(Known { ground: 0.0, down_to: -0.4 });
    let (start, settings) = (at(0.5), Adaptive { first_step: Some(0.9), ..tolerance(1e-10) });
    let run = run(Method::Rkmk8B, &system, &start, 1.3, &settings, &mut recorder(&start)).unwrap();
    let (exact, _) = BALL.run(DROP, 1.3);
    let off = (run.state.position().z - exact.x).hypot(run.state.velocity().z - exact.v);
    assert!(off < 1e-8 && run.rejected > 0, "{off:e}");
}

#[test]
fn any_embedded_stepper_on_any_system_with_modes_gives_what_the_table_gives() {
    let (ball, settings) = (ball(), tolerance(1e-8));
    let start = ball.at(DROP.x, DROP.v);
    let (stepper, steps) = (RungeKuttaMuntheKaas(Dop853), Steps::adapted((0.0, 1.3), settings));
    let own = Run::by_embedded_stepper(&ball.system, &stepper, steps).locating(Location::default());
    let own = own.observed_by(&mut recorder(&start)).from(&start).unwrap();
    let table = run(Method::Rkmk8, &ball.system, &start, 1.3, &settings, &mut recorder(&start)).unwrap();
    assert_eq!((own.state, own.steps, own.trials), (table.state, table.steps, table.trials));
}

#[test]
fn adapted_runs_refuse_bad_input() {
    let ball = ball();
    let start = ball.at(DROP.x, DROP.v);
    let attempt = |method: Method, start: &RigidBodyState, interval: (f64, f64), settings: Adaptive| {
        let run = Run::new(&ball.system, method, Steps::adapted(interval, settings));
        let run = run.locating(Location::default()).observed_by(&mut recorder(start)).from(start);
        match run.unwrap_err().reason {
            Interruption::Integrate(error) => error,
            other => panic!("{other}"),
        }
    };
    use IntegrateError::{Argument, Budget, InitialState, Interval, NoErrorEstimate};
    let good = tolerance(1e-8);
    assert!(matches!(attempt(Method::Ab2, &start, (0.0, 1.0), good), NoErrorEstimate { method: "ab2" }));
    for interval in [(1.0, 1.0), (1.0, 0.0), (0.0, f64::NAN)] {
        assert!(matches!(attempt(Method::Rkmk5, &start, interval, good), Interval { .. }));
    }
    for (settings, name) in [
        (tolerance(-1e-8), "relative"),
        (Adaptive::with_tolerances(1e-8, 0.0), "absolute"),
        (Adaptive { first_step: Some(0.0), ..good }, "first_step"),
        (Adaptive { max_step: f64::NAN, ..good }, "max_step"),
    ] {
        let error = attempt(Method::Rkmk5, &start, (0.0, 1.0), settings);
        assert!(
            matches!(error, Argument(ArgumentError::NotPositive { argument, .. }) if argument == name),
            "{error}"
        );
    }
    let few = Adaptive { max_steps: 5, ..good };
    assert!(matches!(attempt(Method::Rkmk5, &start, (0.0, 1.0), few), Budget { max_steps: 5, .. }));
    let mut bad = start;
    bad.rate.linear.x = f64::NAN;
    assert!(matches!(attempt(Method::Rkmk5, &bad, (0.0, 1.0), good), InitialState { .. }));
}

/// In flight above a floor, about a principal axis: the angular momentum grows by the integral of the torque, which steps that end where the
/// schedule bends have exactly.
#[test]
fn steps_end_where_a_schedule_bends() {
    let pulse = LinearSchedule::try_new(vec![0.31, 0.32, 0.34], vec![0.0, 2.0, 0.0]).unwrap();
    let none = LinearSchedule::constant(0.0);
    let torque = ScheduledTorque { components: [none.clone(), none, pulse.clone()], is_in_body: true };
    let system = ball().system;
    let (body, (_, contacts)) = (system.body, system.forces.clone());
    let system = BodyInContact::new(body, (torque, contacts));
    let mut start = RigidBodyState::spinning(Vector3::z());
    start.configuration.position.z = 5.0;
    let spin = 1.0 + pulse.integral(1.0) / body.inertia().principal_moments().z;
    for steps in
        [Steps::adapted((0.0, 1.0), tolerance(1e-6)), TimeGrid::try_new(0.0, 1.0, 0.25).unwrap().into()]
    {
        // by their types, so that of the methods of the table no others are compiled for this system
        let doubled = Run::by_stepper(&system, &RungeKutta4, steps).locating(Location::default());
        let embedded = Run::by_embedded_stepper(&system, &RungeKuttaMuntheKaas(Dop853), steps)
            .locating(Location::default());
        for (method, found) in [("rk4", doubled.from(&start)), ("rkmk8", embedded.from(&start))] {
            let error = (found.unwrap().state.angular_velocity().z - spin).abs();
            assert!(error < 1e-13 * spin, "{method}: {error:e}");
        }
    }
}
