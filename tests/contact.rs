//! Contact with located events: references, orders with and without location, cases, bad input.

use nalgebra::Vector3;
use somersault_contact::ContactError;
use somersault_contact::contacts::{BodyInContact, Contact, Contacts};
use somersault_contact::driver::{integrate_hybrid, integrate_located};
use somersault_contact::event::{EventKind, Interrupted, Interruption, Located, Location};
use somersault_contact::hybrid::{Frozen, Guard, Hybrid};
use somersault_contact::law::CompliantLaw;
use somersault_contact::models::{BouncingBall, SpinningTop};
use somersault_contact::surface::{Cylinder, HalfSpace, SignedDistance, Solid, Sphere, Surface};
use somersault_core::so3;
use somersault_integrators::body::RigidBody;
use somersault_integrators::driver::{IntegrateError, Observer, Status, TimeGrid};
use somersault_integrators::force::{ForceModel, Gravity};
use somersault_integrators::methods::{Method, Options, RungeKutta4};
use somersault_integrators::solution::Recorder;
use somersault_integrators::state::{Pose, RigidBodyState};
use somersault_integrators::stepper::Scope;
use somersault_integrators::system::System;
use somersault_testkit::order::slope;
use somersault_testkit::{bouncing_ball, spinning_top};
use std::sync::Arc;

type Run = Located<Pose>;

fn try_run<F: ForceModel>(
    method: Method,
    system: &BodyInContact<F>,
    start: &RigidBodyState,
    end: f64,
    dt: f64,
    observer: &mut impl Observer<Pose>,
) -> Result<Run, Box<Interrupted<Pose>>> {
    let grid = TimeGrid::try_new(0.0, end, dt).unwrap();
    integrate_located(method, Options::default(), system, start, &grid, &Location::default(), observer)
}

fn run<F: ForceModel>(
    method: Method,
    system: &BodyInContact<F>,
    start: &RigidBodyState,
    end: f64,
    dt: f64,
) -> Run {
    try_run(method, system, start, end, dt, &mut ()).unwrap()
}

fn kinds(run: &Run) -> Vec<EventKind> {
    run.events.iter().map(|e| e.kind).collect()
}

// ---------------------------------------------------------------------------------------------- ball

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

/// Root mean square over step sizes within an octave: where steps fall relative to contacts matters.
fn octave(base: u32, sizes: u32, error: impl Fn(u32) -> f64) -> f64 {
    let sum: f64 = (0..sizes).map(|i| error(base + base * i / (2 * sizes)).powi(2)).sum();
    (sum / f64::from(sizes)).sqrt()
}

#[test]
fn every_method_keeps_its_order_on_the_bouncing_ball_with_location() {
    const END: f64 = 1.3;
    let (exact, switches) = BALL.run(DROP, END);
    assert_eq!(switches.len(), 4, "{switches:?}");
    let ball = ball();
    for method in Method::ALL {
        let order = f64::from(method.info().orders.translation_with_velocity);
        let mut points = Vec::new();
        let bases =
            if order > 4.0 { [16, 20, 26, 32, 40, 64, 128] } else { [60, 120, 240, 480, 960, 1920, 3840] };
        for base in bases {
            let error = octave(base, 5, |n| {
                let run = run(method, &ball.system, &ball.at(DROP.x, DROP.v), END, END / f64::from(n));
                if run.events.len() == 4 { ball_error(&run.state, exact) } else { f64::NAN }
            });
            if error.is_finite() && error > if order > 4.0 { 1e-12 } else { 3e-11 } {
                points.push((END / f64::from(base), error));
            }
        }
        let last = &points[points.len().saturating_sub(4)..];
        let found = slope(last);
        println!("{method:10} order {order} found {found:.2} {:.1e}", last.last().unwrap().1);
        assert!((found - order).abs() < 0.35, "{method}: {found} {points:?}");
    }
}

#[test]
fn every_method_falls_to_first_order_on_the_bouncing_ball_without_location() {
    const END: f64 = 1.3;
    let (exact, _) = BALL.run(DROP, END);
    let ball = ball();
    for method in Method::ALL {
        let points: Vec<(f64, f64)> = [1000, 2000, 4000, 8000]
            .into_iter()
            .map(|base| {
                let error = octave(base, 24, |n| {
                    let grid = TimeGrid::try_with_steps(0.0, END, n.into()).unwrap();
                    let start = ball.at(DROP.x, DROP.v);
                    let end =
                        method.integrate(Options::default(), &ball.system, &start, &grid, &mut ()).unwrap();
                    ball_error(&end.state, exact)
                });
                (END / f64::from(base), error)
            })
            .collect();
        let found = slope(&points);
        println!("{method:10} {found:.2} {:.1e}", points[3].1);
        assert!((found - 1.0).abs() < 0.25, "{method}: {found} {points:?}");
    }
}

#[test]
fn the_events_of_the_ball_are_those_of_the_closed_form() {
    let (_, switches) = BALL.run(DROP, 3.0);
    let ball = ball();
    let run = run(Method::RkmkB, &ball.system, &ball.at(DROP.x, DROP.v), 3.0, 1e-4);
    assert_eq!(run.events.len(), switches.len());
    for (event, switch) in run.events.iter().zip(&switches) {
        assert!((event.t - switch.t).abs() < 1e-11, "{} {}", event.t, switch.t);
        assert_eq!(event.kind == EventKind::TouchDown, switch.begins);
        assert_eq!(event.guard, 0);
        assert!((event.impulse - switch.impulse).abs() < 1e-10, "{} {}", event.impulse, switch.impulse);
    }
}

#[test]
fn restitution_measured_is_restitution_asked() {
    for e in [1.0, 0.9, 0.5, 0.2, (-2.0f64).exp(), 0.1, 0.01] {
        let law = CompliantLaw::from_restitution(2.0, 5e3, e).unwrap();
        assert!((law.restitution(2.0).unwrap() / e - 1.0).abs() < 1e-12);
        let ground = Arc::new(HalfSpace::ground());
        let contact = Contact::try_new(Vector3::zeros(), ground, law).unwrap();
        let body = RigidBody::try_box(2.0, Vector3::repeat(0.1)).unwrap();
        let system = BodyInContact::new(body, ((), Contacts::new(vec![contact])));
        let mut start = RigidBodyState::default();
        (start.configuration.position.z, start.rate.linear.z) = (0.01, -1.5);
        // With e = 0.01 the damper dominates: ζ = 9.2 and the fast exponent is 900/s.
        let run = run(Method::Rkmk, &system, &start, 0.5, 1e-5);
        assert_eq!(kinds(&run), [EventKind::TouchDown, EventKind::Release]);
        let measured = run.state.velocity().z / 1.5;
        assert!((measured - e).abs() < 1e-9, "{e}: {measured}");
    }
}

// ----------------------------------------------------------------------------------------------- top

fn reduced_top() -> spinning_top::SpinningTop {
    let frequency = 100.0 * std::f64::consts::PI;
    spinning_top::SpinningTop {
        mass: 0.2,
        across: 0.817e-4,
        about: 1.6e-4,
        length: 0.05,
        stiffness: 0.2 * frequency * frequency,
        damping: 2.0 * 0.2 * frequency * 0.1,
        gravity: 9.81,
    }
}

fn reduced_run(end: f64, dt: f64) -> (spinning_top::TopState, Vec<f64>) {
    reduced_top().run(0.05, 0.25f64.atan(), 32.0 * std::f64::consts::PI, end, dt)
}

/// Errors of position, orientation, velocity and angular velocity.
fn top_errors(state: &RigidBodyState, exact: &spinning_top::TopState) -> [f64; 4] {
    [
        (state.position() - Vector3::new(0.0, 0.0, exact.height)).norm(),
        so3::angle_between(state.orientation(), &exact.orientation),
        (state.velocity() - Vector3::new(0.0, 0.0, exact.climb)).norm(),
        (state.angular_velocity() - exact.angular_velocity).norm(),
    ]
}

#[test]
fn the_top_agrees_with_reduced_coordinates() {
    let top = SpinningTop::thesis().unwrap();
    let (exact, switches) = reduced_run(0.1, 1e-6);
    let run = run(Method::RkmkB, &top.system, &top.start, 0.1, 2e-6);
    let errors = top_errors(&run.state, &exact);
    println!("{errors:?} switches {}", switches.len());
    assert!(errors.iter().zip([1e-14, 1e-11, 1e-12, 1e-9]).all(|(e, bound)| *e < bound), "{errors:?}");
    assert_eq!(run.events.len(), switches.len());
    for (event, t) in run.events.iter().zip(&switches) {
        assert!((event.t - t).abs() < 1e-12, "{} {t}", event.t);
    }
}

#[test]
fn the_top_switches_seven_times_in_one_second() {
    let top = SpinningTop::thesis().unwrap();
    let run = run(Method::RkmkB, &top.system, &top.start, 1.0, 1e-5);
    let (_, switches) = reduced_run(0.12, 1e-6);
    assert_eq!((run.events.len(), switches.len()), (7, 7));
    // The last touch-down is for good.
    let times = [
        0.017445853280,
        0.027213663447,
        0.032316032230,
        0.043684337214,
        0.064507673346,
        0.091446342689,
        0.103428677790,
    ];
    for ((event, t), printed) in run.events.iter().zip(&switches).zip(times) {
        assert!((event.t - t).abs() < 2e-11, "{} {t}", event.t);
        assert!((event.t - printed).abs() < 1e-11, "{} {printed}", event.t);
    }
    assert_eq!(run.events[6].kind, EventKind::TouchDown);
}

#[test]
fn rkmk_is_fourth_order_on_the_top_with_location_and_first_without() {
    let top = SpinningTop::thesis().unwrap();
    let (exact, _) = reduced_run(0.1, 1e-6);
    for method in [Method::Rkmk, Method::RkmkB, Method::RkmkL] {
        let mut located: [Vec<(f64, f64)>; 4] = Default::default();
        for base in [200, 400, 800, 1600] {
            let mut errors = [0.0; 4];
            for i in 0..5 {
                let n = base + base * i / 10;
                let run = run(method, &top.system, &top.start, 0.1, 0.1 / f64::from(n));
                let found = top_errors(&run.state, &exact);
                (0..4).for_each(|k| errors[k] += found[k].powi(2));
            }
            (0..4).for_each(|k| located[k].push((0.1 / f64::from(base), errors[k].sqrt())));
        }
        let mut straddled: [Vec<(f64, f64)>; 4] = Default::default();
        for base in [1000, 2000, 4000, 8000] {
            let mut errors = [0.0; 4];
            for i in 0..24 {
                let n = base + base * i / 48;
                let grid = TimeGrid::try_with_steps(0.0, 0.1, n).unwrap();
                let end =
                    method.integrate(Options::default(), &top.system, &top.start, &grid, &mut ()).unwrap();
                let found = top_errors(&end.state, &exact);
                (0..4).for_each(|k| errors[k] += found[k].powi(2));
            }
            (0..4).for_each(|k| straddled[k].push((0.1 / base as f64, errors[k].sqrt())));
        }
        for (name, with, without) in
            [("position", 0), ("orientation", 1), ("velocity", 2), ("angular velocity", 3)]
                .map(|(name, k)| (name, slope(&located[k]), slope(&straddled[k])))
        {
            println!("{method} {name}: {with:.2} with, {without:.2} without");
            assert!((with - 4.0).abs() < 0.4, "{method} {name}: {with} {located:?}");
            assert!((without - 1.0).abs() < 0.3, "{method} {name}: {without} {straddled:?}");
        }
    }
}

/// Kinetic energy, weight and springs.
fn energy(system: &BodyInContact<Gravity>, x: &RigidBodyState) -> f64 {
    let omega = x.orientation().inverse_transform_vector(x.angular_velocity());
    let kinetic = 0.5 * system.body.mass() * x.velocity().norm_squared()
        + 0.5 * omega.dot(&system.body.inertia().momentum(&omega));
    let weight = -system.body.mass() * system.forces.0.acceleration.dot(x.position());
    kinetic + weight + system.forces.1.energy(x)
}

#[test]
fn the_energy_of_the_top_never_grows_beyond_rounding() {
    let top = SpinningTop::thesis().unwrap();
    for dt in [4e-4, 2e-4, 1e-5] {
        let mut recorder = Recorder::new(0.0, &top.start, 1);
        try_run(Method::RkmkB, &top.system, &top.start, 0.3, dt, &mut recorder).unwrap();
        let states = recorder.into_solution().states;
        let energies: Vec<f64> = states.iter().map(|x| energy(&top.system, x)).collect();
        let growth = energies.windows(2).map(|w| w[1] - w[0]).fold(0.0, f64::max);
        assert!(growth < 1e-15 && energies[0] - energies[energies.len() - 1] > 1e-3, "{dt}: {growth:e}");
    }
}

// --------------------------------------------------------------------------------------------- cases

/// A particle-like body with its centre as contact, under a uniform acceleration along z.
fn particle(
    stiffness: f64,
    damping: f64,
    surface: Arc<dyn Surface>,
    acceleration: f64,
) -> BodyInContact<Gravity> {
    let law = CompliantLaw::try_new(stiffness, damping).unwrap();
    let contact = Contact::try_new(Vector3::zeros(), surface, law).unwrap();
    let body = RigidBody::try_box(1.0, Vector3::repeat(0.1)).unwrap();
    let gravity = Gravity { acceleration: Vector3::new(0.0, 0.0, acceleration) };
    BodyInContact::new(body, (gravity, Contacts::new(vec![contact])))
}

fn at(z: f64, velocity: f64) -> RigidBodyState {
    let mut state = RigidBodyState::default();
    (state.configuration.position.z, state.rate.linear.z) = (z, velocity);
    state
}

fn gap(run: &Run) -> (f64, f64) {
    (run.state.position().z, run.state.velocity().z)
}

#[test]
fn a_touch_and_release_within_one_step_are_both_found() {
    // Pushed up at 2 m/s², the body dips into the ground for 0.06 s; the step is 0.4 s.
    let system = particle(1.0, 0.1, Arc::new(HalfSpace::ground()), 2.0);
    for depth in [1e-3, 1e-5, 1e-7, 1e-9] {
        let start = at(0.1, -(4.0f64 * (0.1 + depth)).sqrt());
        for method in [Method::RkmkB, Method::Rkmk8B, Method::Ab4, Method::Rk4L, Method::Lgvi] {
            let (coarse, fine) =
                (run(method, &system, &start, 1.0, 0.4), run(Method::Rkmk8, &system, &start, 1.0, 1e-3));
            let found = [EventKind::TouchDown, EventKind::Release];
            assert_eq!((kinds(&coarse), kinds(&fine)), (found.to_vec(), found.to_vec()), "{method} {depth}");
            assert!((gap(&coarse).0 - gap(&fine).0).abs() < 1e-5, "{method} {depth}");
        }
    }
    // The tip of a spinning body comes around and leaves again.
    let law = CompliantLaw::try_new(50.0, 0.5).unwrap();
    let tip = Contact::try_new(Vector3::new(0.0, 0.0, -0.5), Arc::new(HalfSpace::ground()), law).unwrap();
    let body = RigidBody::try_box(1.0, Vector3::repeat(0.5)).unwrap();
    let system = BodyInContact::new(body, ((), Contacts::new(vec![tip])));
    let mut start = at(0.499, 0.0);
    start.configuration.orientation = so3::exp(&Vector3::new(-0.5, 0.0, 0.0));
    start.rate.angular.x = 1.0;
    let (coarse, fine) =
        (run(Method::RkmkB, &system, &start, 1.0, 0.25), run(Method::Rkmk8B, &system, &start, 1.0, 1e-3));
    assert_eq!(
        (kinds(&coarse), kinds(&fine)),
        (vec![EventKind::TouchDown, EventKind::Release], kinds(&coarse))
    );
    assert!((gap(&coarse).0 - gap(&fine).0).abs() < 1e-4);
}

#[test]
fn a_lapse_of_contact_is_found_by_long_steps_as_by_short_ones() {
    // Pressed to the ground but for a while, in which the force of the contact vanishes.
    let law = CompliantLaw::try_new(100.0, 1.0).unwrap();
    let contact = Contact::try_new(Vector3::zeros(), Arc::new(HalfSpace::ground()), law).unwrap();
    let body = RigidBody::try_box(1.0, Vector3::repeat(0.1)).unwrap();
    let pull = |t: f64, _: &RigidBody, _: &RigidBodyState| somersault_integrators::force::Wrench {
        force: Vector3::new(0.0, 0.0, -1.0 + 1.35 * (-200.0 * (t - 0.5).powi(2)).exp()),
        torque: Vector3::zeros(),
    };
    let system = BodyInContact::new(body, (pull, Contacts::new(vec![contact])));
    let start = at(-0.01, 0.0);
    let fine = run(Method::Rkmk8B, &system, &start, 0.8, 1e-3);
    assert_eq!(kinds(&fine), [EventKind::Release, EventKind::TouchDown]);
    let coarse = run(Method::Rkmk8B, &system, &start, 0.8, 0.05);
    assert_eq!(kinds(&coarse), kinds(&fine));
    assert!((gap(&coarse).0 - gap(&fine).0).abs() < 1e-4);
}

#[test]
fn grazing_completes_and_changes_next_to_nothing() {
    let system = particle(100.0, 2.0, Arc::new(HalfSpace::ground()), 2.0);
    for depth in [0.0, 1e-18, 1e-16, 1e-15, 1e-14, 1e-12, -1e-12, -1e-15] {
        let start = at(0.1, -(4.0f64 * (0.1 + depth)).sqrt());
        for dt in [0.1, 0.0317, 0.01] {
            let run = run(Method::RkmkB, &system, &start, 1.0, dt);
            assert!(
                run.events.len().is_multiple_of(2) && run.events.len() <= 4,
                "{depth} {dt}: {:?}",
                kinds(&run)
            );
            let free = 0.1 + start.velocity().z + 1.0;
            assert!((gap(&run).0 - free).abs() < 1e-7, "{depth} {dt}: {}", gap(&run).0 - free);
        }
    }
}

#[test]
fn a_start_on_the_surface_belongs_to_what_follows() {
    let ball = ball();
    // Going in: in contact from the start, so that the first event is a release.
    let down = run(Method::Rkmk8B, &ball.system, &ball.at(0.0, -2.0), 0.5, 1e-3);
    let (exact, switches) = BALL.run(bouncing_ball::Motion { x: 0.0, v: -2.0 }, 0.5);
    assert_eq!(kinds(&down)[0], EventKind::Release);
    assert!((down.events[0].t - switches[1].t).abs() < 1e-12 && ball_error(&down.state, exact) < 1e-12);
    // Going out: free.
    let up = run(Method::Rkmk8B, &ball.system, &ball.at(0.0, 1.0), 0.1, 1e-3);
    assert!(up.events.is_empty() && (up.state.velocity().z - (1.0 - 0.981)).abs() < 1e-14);
    // At rest: falls into contact within a rounding of the height.
    let rest = run(Method::Rkmk8B, &ball.system, &ball.at(0.0, 0.0), 0.3, 1e-3);
    assert_eq!(kinds(&rest)[0], EventKind::TouchDown);
    let (exact, _) = BALL.run(bouncing_ball::Motion { x: 0.0, v: 0.0 }, 0.3);
    assert!(rest.events[0].t < 1e-7 && ball_error(&rest.state, exact) < 1e-12);
}

#[test]
fn points_that_touch_together_are_handled_together() {
    let body = RigidBody::try_box(1.0, Vector3::new(0.2, 0.3, 0.1)).unwrap();
    let law = CompliantLaw::try_new(400.0, 4.0).unwrap();
    let ground = Arc::new(HalfSpace::ground());
    let corners = [(1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0)]
        .map(|(x, y)| Contact::try_new(Vector3::new(0.1 * x, 0.15 * y, -0.05), ground.clone(), law).unwrap());
    let system = BodyInContact::new(body, (Gravity::earth(), Contacts::new(corners.to_vec())));
    for method in [Method::RkmkB, Method::Rk4, Method::Ab4L, Method::Lgvi, Method::Split4] {
        let run = run(method, &system, &at(0.25, 0.0), 0.6, 1e-3);
        assert!(run.events.len() >= 8, "{method}");
        for group in run.events.chunks(4) {
            assert!(
                group.iter().all(|e| e.kind == group[0].kind && (e.t - group[0].t).abs() < 1e-13),
                "{method}"
            );
            assert!(group.iter().all(|e| (e.impulse - group[0].impulse).abs() < 1e-11), "{method}");
        }
        let tilt = so3::angle_between(run.state.orientation(), &nalgebra::UnitQuaternion::identity());
        assert!(tilt < 1e-11, "{method}: {tilt:e}");
    }
}

#[test]
fn a_point_released_below_the_surface_engages_again() {
    let reference = bouncing_ball::BouncingBall { damping: 36.0, ..BALL };
    let start = bouncing_ball::Motion { x: -0.01, v: 0.12 };
    let (exact, switches) = reference.run(start, 0.2);
    let law = CompliantLaw::try_new(400.0, 36.0).unwrap();
    let ball = BouncingBall::try_new(1.0, 0.1, law).unwrap();
    let run = run(Method::Rkmk8B, &ball.system, &ball.at(start.x, start.v), 0.2, 1e-3);
    assert_eq!(kinds(&run)[0], EventKind::ReEngagement);
    assert_eq!(run.events.len(), switches.len());
    assert!((run.events[0].t - switches[0].t).abs() < 1e-13 && ball_error(&run.state, exact) < 1e-12);
}

#[test]
fn a_ball_comes_to_rest_in_permanent_contact() {
    let ball = ball();
    let run = run(Method::RkmkB, &ball.system, &ball.at(DROP.x, DROP.v), 30.0, 1e-2);
    assert_eq!(run.events.last().unwrap().kind, EventKind::TouchDown);
    let rest = bouncing_ball::Motion { x: -BALL.mass * BALL.gravity / BALL.stiffness, v: 0.0 };
    assert!(ball_error(&run.state, rest) < 1e-12, "{:e}", ball_error(&run.state, rest));
    assert!(run.events.last().unwrap().t < 10.0 && run.status == Status::Finished);
}

/// Bounces without loss for some time and returns the number of events and the drift of the energy.
fn bounce(end: f64) -> (u64, f64) {
    let system = particle(1e4, 0.0, Arc::new(HalfSpace::ground()), -9.81);
    let start = at(0.001, 0.0);
    let grid = TimeGrid::try_new(0.0, end, 5e-3).unwrap();
    let location = Location { keep_events: false, ..Location::default() };
    let (method, options) = (Method::Rkmk8B, Options::default());
    let run = integrate_located(method, options, &system, &start, &grid, &location, &mut ()).unwrap();
    println!("{} steps, {} trials, {} events", run.steps, run.trials, run.event_count);
    assert!(run.events.is_empty() && run.status == Status::Finished);
    (run.event_count, energy(&system, &run.state) / energy(&system, &start) - 1.0)
}

#[test]
fn a_hundred_thousand_contacts_complete() {
    let (events, drift) = bounce(7250.0);
    println!("{events} events, energy drift {drift:e}");
    assert!(events >= 200_000 && drift.abs() < 1e-4, "{events} {drift:e}");
}

#[test]
#[ignore = "takes some ten times as long as all others"]
fn a_million_contacts_complete() {
    let (events, drift) = bounce(72_500.0);
    println!("{events} events, energy drift {drift:e}");
    assert!(events >= 2_000_000 && drift.abs() < 1e-3, "{events} {drift:e}");
}

/// Dry friction on a line: v̇ = −sign v, which slides along v = 0 and has no motion there.
#[derive(Debug)]
struct DryFriction;

impl System for DryFriction {
    type Configuration = Pose;
    type Workspace = ();
    fn workspace(&self) {}
    fn acceleration(
        &self,
        w: &mut (),
        t: f64,
        x: &RigidBodyState,
        out: &mut somersault_integrators::state::Twist,
    ) {
        self.acceleration_in(&self.mode(t, x), w, t, x, out);
    }
}

impl Hybrid for DryFriction {
    type Mode = bool;
    fn mode(&self, _: f64, x: &RigidBodyState) -> bool {
        x.velocity().x < 0.0
    }
    fn guards(&self, _: &bool, _: f64, x: &RigidBodyState, out: &mut Vec<Guard>) {
        out.push(Guard { gap: x.velocity().x, ..Guard::default() });
    }
    fn acceleration_in(
        &self,
        backward: &bool,
        (): &mut (),
        _: f64,
        _: &RigidBodyState,
        out: &mut somersault_integrators::state::Twist,
    ) {
        *out = Default::default();
        out.linear.x = if *backward { 1.0 } else { -1.0 };
    }
}

#[test]
fn chattering_ends_in_an_error_that_keeps_the_solution() {
    let mut start = RigidBodyState::default();
    start.rate.linear.x = 1.0;
    let frozen = Frozen::new(DryFriction, 0.0, &start);
    let grid = TimeGrid::try_new(0.0, 2.0, 0.15).unwrap();
    let mut recorder = Recorder::new(0.0, &start, 1);
    let error = integrate_hybrid(&frozen, &RungeKutta4, &start, &grid, &Location::default(), &mut recorder)
        .unwrap_err();
    assert!(matches!(error.reason, Interruption::Chattering { .. }), "{error}");
    let (t, x) = (error.so_far.t, error.so_far.state);
    assert!((t - 1.0).abs() < 1e-9 && (x.position().x - 0.5).abs() < 1e-9 && x.velocity().x.abs() < 1e-9);
    assert_eq!(error.so_far.events.len() as u64, error.so_far.event_count);
    assert!((error.so_far.events[0].t - 1.0).abs() < 1e-15);
    assert_eq!(recorder.into_solution().times.last(), Some(&t));
}

#[test]
fn any_stepper_on_any_system_with_modes_gives_what_the_table_gives() {
    let ball = ball();
    let start = ball.at(DROP.x, DROP.v);
    let frozen = Frozen::new(ball.system.clone(), 0.0, &start);
    let grid = TimeGrid::try_new(0.0, 2.0, 0.01).unwrap();
    let own = integrate_hybrid(&frozen, &RungeKutta4, &start, &grid, &Location::default(), &mut ()).unwrap();
    let table = run(Method::Rk4, &ball.system, &start, 2.0, 0.01);
    assert_eq!((own.state, own.steps, own.trials), (table.state, table.steps, table.trials));
}

#[test]
fn curved_surfaces_hold_like_the_plane_that_touches_them() {
    let plane: Arc<dyn Surface> =
        Arc::new(HalfSpace::try_new(Vector3::new(0.0, 0.0, -1.0), Vector3::z()).unwrap());
    let bowl = Sphere::try_new(Vector3::zeros(), 1.0, Solid::Outside).unwrap();
    let hill = Sphere::try_new(Vector3::new(0.0, 0.0, -3.0), 2.0, Solid::Inside).unwrap();
    let gutter = Cylinder::try_new(Vector3::zeros(), Vector3::x(), 1.0, Solid::Outside).unwrap();
    let log = Cylinder::try_new(Vector3::new(0.0, 0.0, -1.5), Vector3::y(), 0.5, Solid::Inside).unwrap();
    let flat = run(Method::RkmkB, &particle(400.0, 4.0, plane, -9.81), &at(-0.5, 0.0), 1.3, 1e-3);
    for curved in [Arc::new(bowl) as Arc<dyn Surface>, Arc::new(hill), Arc::new(gutter), Arc::new(log)] {
        let found = run(Method::RkmkB, &particle(400.0, 4.0, curved, -9.81), &at(-0.5, 0.0), 1.3, 1e-3);
        assert_eq!(kinds(&found), kinds(&flat));
        assert!((found.state.position() - flat.state.position()).norm() < 1e-12);
    }
    // Off the axis of a bowl the energy of a body without damping stays.
    let system = particle(1e4, 0.0, Arc::new(bowl), -9.81);
    let mut start = at(-0.5, 0.0);
    (start.configuration.position.x, start.rate.linear.y) = (0.3, 0.7);
    let run = run(Method::Rkmk8B, &system, &start, 5.0, 1e-3);
    let drift = energy(&system, &run.state) - energy(&system, &start);
    assert!(run.events.len() > 10 && drift.abs() < 1e-10, "{} {drift:e}", run.events.len());
}

#[test]
fn dense_output_and_recorder_work_through_events() {
    let top = SpinningTop::thesis().unwrap();
    for method in [Method::RkmkB, Method::Rkmk8B, Method::Rk4L, Method::Ab4] {
        let mut recorder = Recorder::new(0.0, &top.start, 3).with_dense_output();
        let run = try_run(method, &top.system, &top.start, 0.1, 1e-4, &mut recorder).unwrap();
        let solution = recorder.into_solution();
        assert!(solution.times.windows(2).all(|w| w[0] < w[1]));
        assert_eq!((solution.times.last(), solution.segments.len()), (Some(&0.1), run.steps as usize));
        for event in &run.events {
            let there = solution.at(event.t).unwrap();
            assert!((there.position() - event.state.position()).norm() < 1e-14, "{method}");
            assert!((there.velocity() - event.state.velocity()).norm() < 1e-11, "{method}");
        }
        for i in 1..40 {
            let t = 0.0025 * f64::from(i) - 3e-5;
            let there = solution.at(t).unwrap();
            let (exact, _) = reduced_run(t, 1e-5);
            let errors = top_errors(&there, &exact);
            assert!(errors[0] < 1e-7 && errors[2] < 1e-4, "{method} {t}: {errors:?}");
        }
    }
}

#[test]
fn an_observer_may_stop_a_run_with_events() {
    struct Until(f64);
    impl Observer<Pose> for Until {
        fn observe(
            &mut self,
            step: &mut somersault_integrators::driver::Step<'_, Pose>,
        ) -> somersault_integrators::driver::Flow {
            use somersault_integrators::driver::Flow;
            if step.t_after > self.0 { Flow::Stop } else { Flow::Continue }
        }
    }
    let ball = ball();
    let run = try_run(Method::Rkmk, &ball.system, &ball.at(0.5, 0.0), 2.0, 0.01, &mut Until(0.4)).unwrap();
    assert!(run.status == Status::Stopped && (0.4..0.42).contains(&run.t) && run.events.len() == 1);
}

// ----------------------------------------------------------------------------------------- bad input

#[test]
fn laws_surfaces_and_contacts_refuse_bad_input() {
    use ContactError::{Direction, Negative, NonFinite, NotPositive, Restitution};
    let law = CompliantLaw::try_new;
    for k in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        assert!(matches!(law(k, 1.0), Err(NotPositive { argument: "stiffness", .. })), "{k}");
    }
    for c in [-1.0, f64::NAN, f64::INFINITY] {
        assert!(matches!(law(1.0, c), Err(Negative { argument: "damping", .. })), "{c}");
    }
    let from = CompliantLaw::from_frequency;
    assert!(matches!(from(0.0, 1.0, 0.1), Err(NotPositive { argument: "mass", .. })));
    assert!(matches!(from(1.0, -1.0, 0.1), Err(NotPositive { argument: "frequency", .. })));
    assert!(matches!(from(1.0, 1.0, -0.1), Err(Negative { argument: "damping_ratio", .. })));
    let error = CompliantLaw::from_restitution(1.0, 1.0, 0.0).unwrap_err();
    assert_eq!(error, Restitution { found: 0.0 });
    assert_eq!(error.to_string(), "`restitution` must be above 0 and at most 1, found 0");
    assert_eq!(CompliantLaw::from_restitution(1.0, 9.0, 1.0).unwrap(), law(9.0, 0.0).unwrap());
    let zero = Vector3::zeros();
    assert!(matches!(HalfSpace::try_new(zero, zero), Err(Direction { argument: "normal", .. })));
    assert!(matches!(
        HalfSpace::try_new(zero, Vector3::new(1.0, f64::NAN, 0.0)),
        Err(Direction { argument: "normal", .. })
    ));
    assert!(matches!(Sphere::try_new(zero, 0.0, Solid::Inside), Err(NotPositive { argument: "radius", .. })));
    assert!(matches!(
        Cylinder::try_new(zero, zero, 1.0, Solid::Inside),
        Err(Direction { argument: "axis", .. })
    ));
    let point = Vector3::new(0.0, f64::INFINITY, 0.0);
    let ground = Arc::new(HalfSpace::ground());
    assert!(matches!(
        Contact::try_new(point, ground, law(1.0, 1.0).unwrap()),
        Err(NonFinite { argument: "point", .. })
    ));
}

/// A ground that cannot tell its height near z = 0.2.
#[derive(Debug)]
struct Torn;

impl Surface for Torn {
    fn signed_distance(&self, point: &Vector3<f64>) -> SignedDistance {
        let distance = if point.z < 0.2 { f64::NAN } else { point.z };
        SignedDistance { distance, gradient: Vector3::z() }
    }
}

#[test]
fn a_surface_that_returns_nan_ends_the_run_and_keeps_the_solution() {
    let system = particle(400.0, 4.0, Arc::new(Torn), -9.81);
    let mut recorder = Recorder::new(0.0, &at(0.5, 0.0), 1);
    let error = try_run(Method::Rkmk, &system, &at(0.5, 0.0), 1.0, 0.01, &mut recorder).unwrap_err();
    // It falls below 0.2 m after 0.2473 s.
    assert!(
        matches!(error.reason, Interruption::NonFiniteGuard { guard: 0, t, .. } if (t - 0.25).abs() < 1e-12)
    );
    assert!((error.so_far.t - 0.24).abs() < 1e-12 && error.so_far.state.position().z > 0.2);
    assert_eq!(recorder.into_solution().times.len(), 25);
}

#[test]
fn runs_refuse_bad_input() {
    let top = SpinningTop::thesis().unwrap();
    let grid = TimeGrid::try_new(0.0, 0.1, 1e-3).unwrap();
    let attempt = |method: Method, start: &RigidBodyState, max_event_rate| {
        let location = Location { max_event_rate, ..Location::default() };
        integrate_located(method, Options::default(), &top.system, start, &grid, &location, &mut ())
            .map(|_| ())
            .map_err(|e| e.reason)
    };
    for rate in [0.0, -1.0, f64::NAN] {
        assert!(matches!(
            attempt(Method::Rkmk, &top.start, rate),
            Err(Interruption::Integrate(IntegrateError::NotPositive { argument: "max_event_rate", .. }))
        ));
    }
    let mut bad = top.start;
    bad.rate.linear.x = f64::NAN;
    assert!(matches!(
        attempt(Method::Rkmk, &bad, 1e9),
        Err(Interruption::Integrate(IntegrateError::InitialState { .. }))
    ));
    for method in Method::ALL.into_iter().filter(|m| m.info().scope == Scope::TorqueFree) {
        let error = attempt(method, &top.start, 1e9).unwrap_err();
        assert!(error.to_string().contains("takes no torque"), "{error}");
    }
}
