//! Surfaces that move as given functions of time.

use crate::{Motions, RKMK8};
use nalgebra::{Matrix3, UnitQuaternion, Vector3};
use somersault_contact::ContactError;
use somersault_contact::contacts::Contact;
use somersault_contact::laws::compliant::CompliantLaw;
use somersault_contact::surface::HalfSpace;
use somersault_contact::tree::{LinkContact, PlatformMotion, TreeInContact, TreeOnPlatforms};
use somersault_integrators::driver::TimeGrid;
use somersault_integrators::events::Location;
use somersault_integrators::run::Run;
use somersault_multibody::motion::Rates;
use somersault_multibody::{Joint, Link, MassProperties, Model};
use std::sync::Arc;

fn mass(joint: Joint) -> Model {
    let mass = MassProperties { mass: 2.0, center: Vector3::zeros(), inertia: Matrix3::identity() * 0.01 };
    let mut builder = Model::builder();
    builder.add(Link::root("mass", joint, mass)).unwrap();
    builder.build().unwrap()
}

/// Up and down by `amplitude` sin ωt.
fn heaving(amplitude: f64, omega: f64) -> impl Fn(f64, usize) -> PlatformMotion {
    move |t, _| {
        let (s, c) = (omega * t).sin_cos();
        PlatformMotion {
            position: Vector3::z() * (amplitude * s),
            velocity: Vector3::z() * (amplitude * omega * c),
            acceleration: Vector3::z() * (-amplitude * omega * omega * s),
            ..PlatformMotion::default()
        }
    }
}

/// Where a mass is that starts at rest on a spring and a damper on a table that heaves, and how fast: with the table y = a sin ωt,
/// m z̈ = −k (z − y) − c (ż − ẏ) − m g from z = −m g/k. Of z + m g/k = u + p, p the periodic part
/// Im((k + i c ω) a exp(iωt)/(k − m ω² + i c ω)) and u a damped oscillation that cancels p at t = 0.
fn on_a_table(t: f64, [m, k, c]: [f64; 3], a: f64, omega: f64) -> [f64; 2] {
    // Gain (k + i c ω)/(k − m ω² + i c ω) as real and imaginary part.
    let (x, y, w) = (k - m * omega * omega, c * omega, c * omega);
    let square = x * x + y * y;
    let (re, im) = ((k * x + w * y) / square, (w * x - k * y) / square);
    let periodic = |t: f64| {
        let (s, cos) = (omega * t).sin_cos();
        [a * (re * s + im * cos), a * omega * (re * cos - im * s)]
    };
    let [p0, dp0] = periodic(0.0);
    let decay = 0.5 * c / m;
    let rate = (k / m - decay * decay).sqrt();
    let (u0, du0) = (-p0, -dp0);
    let b = (du0 + decay * u0) / rate;
    let (s, cos) = (rate * t).sin_cos();
    let shrink = (-decay * t).exp();
    let u = shrink * (u0 * cos + b * s);
    let du = shrink * ((b * rate - decay * u0) * cos - (u0 * rate + decay * b) * s);
    let [p, dp] = periodic(t);
    [u + p - m * 9.81 / k, du + dp]
}

/// The law pushes all the time, so that the equation is linear; it lands there after a fall in the next test.
#[test]
fn a_mass_on_a_table_that_heaves_follows_the_closed_form() {
    let [m, k, c] = [2.0, 2e3, 6.0];
    let (a, omega) = (1e-3, 25.0);
    let scene = TreeOnPlatforms::try_new(&mass(Joint::Prismatic { axis: Vector3::z() }), &["table"]).unwrap();
    let touch = |on: bool| {
        let law = CompliantLaw::try_new(k, c).unwrap();
        let contact = Contact::try_new(Vector3::zeros(), Arc::new(HalfSpace::ground()), law).unwrap();
        let contact = LinkContact::new("foot", "mass", contact);
        vec![if on { contact.on("table") } else { contact }]
    };
    let motion = heaving(a, omega);
    let (q, v) = scene.start(&[-m * 9.81 / k], &[0.0], |i| motion(0.0, i)).unwrap();
    let error = |h: f64| {
        let tree = scene.system((), &motion as Motions<'_>).unwrap();
        let system = TreeInContact::try_new(tree, touch(true), vec![]).unwrap();
        let start = system.unstretched(scene.model().state(&q, &v).unwrap());
        let grid = TimeGrid::try_new(0.0, 0.5, h).unwrap();
        let run = Run::by_stepper(&system, &RKMK8, grid).locating(Location::default()).from(&start).unwrap();
        assert_eq!(run.event_count, 0);
        let [z, rate] = on_a_table(0.5, [m, k, c], a, omega);
        let table = motion(0.5, 0).position.z - run.state.configuration.0.as_slice()[3];
        let rates: &Rates = &run.state.rate.base;
        let found = [run.state.configuration.0.as_slice()[0] - z, rates.as_slice()[0] - rate, table];
        found.iter().fold(0.0_f64, |largest, x| largest.max(x.abs()))
    };
    let [coarse, fine] = [error(0.02), error(0.01)];
    println!("{coarse:e} {fine:e}");
    assert!(error(2e-3) < 1e-13, "{:e}", error(2e-3));
    let order = (coarse / fine).log2();
    assert!(order > 7.0 && order < 9.5, "{order}");
}

/// A mass that is thrown up meets a table that comes to it, as a flight of both says; long steps do not miss it.
#[test]
fn a_table_that_comes_up_is_met_on_time() {
    let scene = TreeOnPlatforms::try_new(&mass(Joint::Free), &["table"]).unwrap();
    let law = CompliantLaw::try_new(1e5, 10.0).unwrap();
    let ground = Arc::new(HalfSpace::ground());
    let touch = Contact::try_new(Vector3::zeros(), ground, law).unwrap();
    let touches = vec![LinkContact::new("foot", "mass", touch).on("table")];
    // A thin blow: the table is at the height of the mass for some milliseconds.
    let motion = heaving(0.4, 30.0);
    let start = [&[0.0, 0.0, 0.39][..], &[0.0, 0.0, 0.0, 1.0]].concat();
    let (q, v) = scene.start(&start, &[0.0; 6], |i| motion(0.0, i)).unwrap();
    let tree = scene.system((), &motion as Motions<'_>).unwrap();
    let system = TreeInContact::try_new(tree, touches, vec![]).unwrap();
    let start = system.unstretched(scene.model().state(&q, &v).unwrap());
    let grid = TimeGrid::try_new(0.0, 0.1, 0.02).unwrap();
    let run = Run::by_stepper(&system, &RKMK8, grid).locating(Location::default()).from(&start).unwrap();
    let gap = |t: f64| 0.39 - 0.5 * 9.81 * t * t - 0.4 * (30.0 * t).sin();
    let (mut low, mut high) = (0.0, std::f64::consts::FRAC_PI_2 / 30.0);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if gap(middle) > 0.0 { low = middle } else { high = middle }
    }
    assert!((run.events[0].t - low).abs() < 1e-9, "{} {low}", run.events[0].t);
}

/// What stands on a table that turns and goes away is carried along: both are turned by the same motion.
#[test]
fn a_table_keeps_the_pose_of_its_motion() {
    let motion = |t: f64, _: usize| {
        // A turn about z, and a swing about the x-axis that turns with it.
        let (rate, about_z) = (3.0, UnitQuaternion::new(Vector3::z() * (3.0 * t)));
        let (swing, swing_rate) = (0.4 * (5.0 * t).sin(), 2.0 * (5.0 * t).cos());
        let axis = about_z * Vector3::x();
        let circle = |f: fn(f64) -> f64, g: fn(f64) -> f64| Vector3::new(g(2.0 * t), f(2.0 * t), 0.0);
        PlatformMotion {
            position: circle(f64::sin, f64::cos),
            velocity: Vector3::new(-(2.0 * t).sin(), (2.0 * t).cos(), 0.0) * 2.0,
            acceleration: circle(f64::sin, f64::cos) * -4.0,
            orientation: about_z * UnitQuaternion::new(Vector3::x() * swing),
            angular_velocity: Vector3::z() * rate + axis * swing_rate,
            angular_acceleration: Vector3::z().cross(&axis) * (rate * swing_rate) - axis * (25.0 * swing),
        }
    };
    PlatformMotion::check(|t| Ok::<_, ContactError>(motion(t, 0)), (0.0, 1.0)).unwrap();
    let scene = TreeOnPlatforms::try_new(&mass(Joint::Free), &["table"]).unwrap();
    let start = [0.0, 0.0, 5.0, 0.0, 0.0, 0.0, 1.0];
    let (q, v) = scene.start(&start, &[0.0; 6], |i| motion(0.0, i)).unwrap();
    let system =
        TreeInContact::try_new(scene.system((), &motion as Motions<'_>).unwrap(), vec![], vec![]).unwrap();
    let start = system.unstretched(scene.model().state(&q, &v).unwrap());
    let grid = TimeGrid::try_new(0.0, 1.0, 1e-2).unwrap();
    let run = Run::by_stepper(&system, &RKMK8, grid).from(&start).unwrap();
    let (found, _) = scene.start(&[0.0; 7], &[0.0; 6], |i| motion(1.0, i)).unwrap();
    let (found, q) = (&found[7..], &run.state.configuration.0.as_slice()[7..]);
    let sign = found[6].signum() * q[6].signum();
    let off = |k: usize| (found[k] - q[k] * if k < 3 { 1.0 } else { sign }).abs();
    assert!((0..7).all(|k| off(k) < 1e-12), "{found:?} {q:?}");
}

#[test]
fn wrong_platforms_are_refused_by_name() {
    let check = |motion: fn(f64) -> PlatformMotion, interval| {
        PlatformMotion::check(|t| Ok::<_, ContactError>(motion(t)), interval).unwrap_err().to_string()
    };
    let still = |_: f64| PlatformMotion { velocity: Vector3::x(), ..PlatformMotion::default() };
    let found = check(still, (0.0, 1.0));
    assert!(
        found.starts_with("`velocity` must be the derivative of the motion, found [1.0, 0.0, 0.0]"),
        "{found}"
    );
    let spinning = |t: f64| PlatformMotion {
        orientation: UnitQuaternion::new(Vector3::z() * t),
        ..PlatformMotion::default()
    };
    assert!(check(spinning, (0.0, 1.0)).starts_with("`angular_velocity` must be"));
    let nowhere = |_: f64| PlatformMotion { position: Vector3::x() * f64::NAN, ..PlatformMotion::default() };
    assert!(check(nowhere, (0.0, 1.0)).starts_with("`velocity` must be"));
    assert!(check(|_| PlatformMotion::default(), (1.0, 1.0)).starts_with("`interval` must run forward"));
    // Vibrations far faster than the interval and small beside the distance from the origin are no mistakes.
    for (distance, amplitude, omega, interval) in
        [(0.0, 1.0, 1e4, (0.0, 1.0)), (1e6, 1e-3, 1.0, (0.0, 1.0)), (0.0, 1.0, 1.0, (1e4, 1e4 + 1e-6))]
    {
        let shaking = |t: f64| PlatformMotion {
            position: Vector3::x() * (distance + amplitude * (omega * t).sin()),
            velocity: Vector3::x() * (amplitude * omega * (omega * t).cos()),
            acceleration: Vector3::x() * (-amplitude * omega * omega * (omega * t).sin()),
            ..PlatformMotion::default()
        };
        PlatformMotion::check(|t| Ok::<_, ContactError>(shaking(t)), interval).unwrap();
    }
    let model = mass(Joint::Free);
    let scene = TreeOnPlatforms::try_new(&model, &["table"]).unwrap();
    let short = scene.start(&[0.0], &[0.0; 6], |_| PlatformMotion::default()).unwrap_err();
    assert_eq!(short.to_string(), "`q` must have 7 entries, found 1");
    let twice = TreeOnPlatforms::try_new(&model, &["mass"]).unwrap_err();
    assert_eq!(twice.to_string(), "a body named `mass` was added before");
}
