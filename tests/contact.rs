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
use somersault_integrators::state::{Pose, RigidBodyState, State};
use somersault_integrators::stepper::Scope;
use somersault_integrators::system::System;
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

/// Slope of log error over log step, by least squares.
fn slope(points: &[(f64, f64)]) -> f64 {
    let n = points.len() as f64;
    let logs: Vec<(f64, f64)> = points.iter().map(|(h, e)| (h.ln(), e.ln())).collect();
    let (mx, my) = logs.iter().fold((0.0, 0.0), |(a, b), (x, y)| (a + x / n, b + y / n));
    let (xy, xx) =
        logs.iter().fold((0.0, 0.0), |(a, b), (x, y)| (a + (x - mx) * (y - my), b + (x - mx) * (x - mx)));
    xy / xx
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
    const END: f64 = 1.9;
    let (exact, switches) = BALL.run(DROP, END);
    assert_eq!(switches.len(), 4, "{switches:?}");
    let ball = ball();
    for method in Method::ALL {
        let order = f64::from(method.info().orders.translation_with_velocity);
        let mut points = Vec::new();
        for base in [60, 120, 240, 480, 960, 1920, 3840] {
            let error = octave(base, 5, |n| {
                let run = run(method, &ball.system, &ball.at(DROP.x, DROP.v), END, END / f64::from(n));
                if run.events.len() == 4 { ball_error(&run.state, exact) } else { f64::NAN }
            });
            if error.is_finite() && error > 3e-11 {
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
    const END: f64 = 1.9;
    let (exact, _) = BALL.run(DROP, END);
    let ball = ball();
    for method in Method::ALL {
        let points: Vec<(f64, f64)> = [1000, 2000, 4000, 8000, 16000]
            .into_iter()
            .map(|base| {
                let error = octave(base, 40, |n| {
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
        println!("{method:10} {found:.2} {:.1e}", points[4].1);
        assert!((found - 1.0).abs() < 0.25, "{method}: {found} {points:?}");
    }
}

#[test]
fn the_events_of_the_ball_are_those_of_the_closed_form() {
    let (_, switches) = BALL.run(DROP, 3.0);
    let ball = ball();
    let run = run(Method::RkmkB, &ball.system, &ball.at(DROP.x, DROP.v), 3.0, 5e-4);
    assert_eq!(run.events.len(), switches.len());
    for (event, switch) in run.events.iter().zip(&switches) {
        assert!((event.t - switch.t).abs() < 2e-10, "{} {}", event.t, switch.t);
        assert_eq!(event.kind == EventKind::TouchDown, switch.begins);
        assert_eq!(event.guard, 0);
        assert!((event.impulse - switch.impulse).abs() < 1e-9, "{} {}", event.impulse, switch.impulse);
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
fn the_switches_of_the_top_in_one_second() {
    let top = SpinningTop::thesis().unwrap();
    let run = run(Method::RkmkB, &top.system, &top.start, 1.0, 1e-5);
    for e in &run.events {
        println!("{:.12} {:?} {:.6e}", e.t, e.kind, e.impulse);
    }
}

#[test]
fn rkmk_is_fourth_order_on_the_top_with_location_and_first_without() {
    let top = SpinningTop::thesis().unwrap();
    let (exact, _) = reduced_run(0.1, 1e-6);
    for method in [Method::Rkmk, Method::RkmkB, Method::RkmkL] {
        let mut located: [Vec<(f64, f64)>; 4] = Default::default();
        for base in [100, 200, 400, 800] {
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
        for base in [1000, 2000, 4000, 8000, 16000] {
            let mut errors = [0.0; 4];
            for i in 0..40 {
                let n = base + base * i / 80;
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
