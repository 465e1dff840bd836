//! A leg on a slider spring, whose motion is piecewise linear: matrix exponentials give it to any digit.

use nalgebra::{Matrix5, Vector3, Vector5};
use somersault_contact::contacts::Contact;
use somersault_contact::laws::compliant::CompliantLaw;
use somersault_contact::surface::HalfSpace;
use somersault_contact::tree::{LinkContact, TreeInContact};
use somersault_integrators::driver::{Adaptive, Steps};
use somersault_integrators::events::Location;
use somersault_integrators::methods::Method;
use somersault_integrators::run::Run;
use somersault_multibody::motion::{TreeForces, TreeSystem};
use somersault_multibody::{Joint, Link, MassProperties, Model};
use std::sync::Arc;

const BODY: f64 = 4.0;
const FOOT: f64 = 0.6;
const LENGTH: f64 = 0.5;
const SPRING: f64 = 2500.0;
const DAMPING: f64 = 12.0;
const GROUND: f64 = 2e4;
const LOSS: f64 = 25.0;
const GRAVITY: f64 = 9.81;

/// A spring along the leg.
pub(crate) struct Leg;

impl TreeForces for Leg {
    fn add_torque(&self, _: f64, q: &[f64], _: &[f64], torque: &mut [f64]) {
        torque[1] -= SPRING * q[1];
    }
    fn potential(&self, q: &[f64]) -> Option<f64> {
        Some(0.5 * SPRING * q[1] * q[1])
    }
}

pub(crate) fn slider() -> Model {
    let mass = |mass| MassProperties::point(mass, Vector3::zeros());
    let mut builder = Model::builder();
    let up = Joint::Prismatic { axis: Vector3::z() };
    let down = Joint::Prismatic { axis: -Vector3::z() };
    builder.add(Link::root("body", up, mass(BODY))).unwrap();
    let foot = Link::child("foot", "body", down, mass(FOOT)).at(-Vector3::z() * LENGTH);
    builder.add(foot.with_damping(DAMPING)).unwrap();
    builder.build().unwrap()
}

pub(crate) fn foot() -> Vec<LinkContact> {
    let law = CompliantLaw::try_new(GROUND, LOSS).unwrap();
    let contact = Contact::try_new(Vector3::zeros(), Arc::new(HalfSpace::ground()), law).unwrap();
    vec![LinkContact::new("foot", "foot", contact)]
}

/// The equations of (height of the body, height of the foot, their rates, 1).
fn matrix(is_closed: bool) -> Matrix5<f64> {
    let (k, c) = (SPRING, DAMPING);
    let (ground, loss) = if is_closed { (GROUND, LOSS) } else { (0.0, 0.0) };
    let (m, f) = (BODY, FOOT);
    // The leg is longer than at rest by e = z_b − L − z_f; it pulls body and foot together by k e + c ė.
    #[rustfmt::skip]
    let matrix = Matrix5::new(
        0.0, 0.0, 1.0, 0.0, 0.0,
        0.0, 0.0, 0.0, 1.0, 0.0,
        -k / m, k / m, -c / m, c / m, k * LENGTH / m - GRAVITY,
        k / f, -(k + ground) / f, c / f, -(c + loss) / f, -k * LENGTH / f - GRAVITY,
        0.0, 0.0, 0.0, 0.0, 0.0,
    );
    matrix
}

/// Times of touch-down and release up to an end, and the state there.
fn reference(mut y: Vector5<f64>, end: f64) -> (Vec<f64>, Vector5<f64>) {
    let (mut t, mut is_closed, mut events) = (0.0, false, Vec::new());
    loop {
        let a = matrix(is_closed);
        let margin = |s: f64| {
            let z = (a * s).exp() * y;
            let margin = z[1] + LOSS / GROUND * z[3].max(0.0);
            if is_closed { -margin } else { margin }
        };
        // No contact and no flight of this leg is shorter than a tenth of a millisecond.
        let step = 1e-4;
        let mut s = step;
        while t + s < end && margin(s) > 0.0 {
            s += step;
        }
        if t + s >= end {
            return (events, (a * (end - t)).exp() * y);
        }
        let (mut low, mut high) = (s - step, s);
        while high - low > 1e-16 {
            let middle = 0.5 * (low + high);
            if middle <= low || middle >= high {
                break;
            }
            if margin(middle) > 0.0 { low = middle } else { high = middle }
        }
        y = (a * high).exp() * y;
        t += high;
        events.push(t);
        is_closed = !is_closed;
    }
}

#[test]
fn a_leg_on_a_slider_spring_is_that_of_matrix_exponentials() {
    let model = slider();
    let system = TreeInContact::try_new(TreeSystem::new(&model, Leg), foot(), vec![]).unwrap();
    // The body at 0.8 m, the leg 0.01 m longer than at rest.
    let start = system.unstretched(model.state(&[0.8, 0.01], &[0.3, 0.0]).unwrap());
    let (times, end) = reference(Vector5::new(0.8, 0.8 - LENGTH - 0.01, 0.3, 0.3, 1.0), 1.5);
    assert!(times.len() >= 6, "{times:?}");
    let steps = Steps::adapted((0.0, 1.5), Adaptive::with_tolerances(1e-14, 1e-14));
    let run = Run::new(&system, Method::Rkmk8, steps).locating(Location::default()).from(&start).unwrap();
    assert_eq!(run.events.len(), times.len());
    for (event, t) in run.events.iter().zip(&times) {
        assert!((event.t - t).abs() < 1e-12, "{} {t}", event.t);
    }
    let (q, p) = (run.state.configuration.0.as_slice(), run.state.rate.base.as_slice());
    assert!((q[0] - end[0]).abs() < 1e-12 && (q[0] - LENGTH - q[1] - end[1]).abs() < 1e-12, "{q:?} {end}");
    assert!((p[0] - end[2]).abs() < 1e-11 && (p[0] - p[1] - end[3]).abs() < 1e-11, "{p:?} {end}");
}
