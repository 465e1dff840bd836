//! A leg on a slider spring, whose motion is piecewise linear: matrix exponentials give it to any digit.

use crate::Torques;
use nalgebra::{Matrix5, Vector3, Vector4};
use somersault_contact::contacts::Contact;
use somersault_contact::laws::compliant::CompliantLaw;
use somersault_contact::surface::HalfSpace;
use somersault_contact::tree::{LinkContact, TouchingState, TreeInContact};
use somersault_integrators::driver::{Adaptive, Steps};
use somersault_integrators::events::Location;
use somersault_integrators::methods::Method;
use somersault_integrators::run::Run;
use somersault_multibody::motion::{TreeForces, TreeSystem};
use somersault_multibody::{Joint, Link, MassProperties, Model};
use std::sync::Arc;

/// A body on a spring leg with a foot, which slide along the vertical; a force along the leg.
pub(crate) struct Slider {
    /// Masses of body and foot, kg.
    pub(crate) body: f64,
    pub(crate) foot: f64,
    /// Stiffness and damping of the leg, N/m and N s/m.
    pub(crate) spring: f64,
    pub(crate) damping: f64,
    /// Those of the ground.
    pub(crate) ground: f64,
    pub(crate) loss: f64,
}

/// Length of the leg at rest, m.
const LENGTH: f64 = 0.5;
const GRAVITY: f64 = 9.81;

/// A leg that is moved by its contacts as fast as by its spring.
pub(crate) const LEG: Slider =
    Slider { body: 4.0, foot: 0.6, spring: 2500.0, damping: 12.0, ground: 2e4, loss: 25.0 };

impl TreeForces for Slider {
    fn add_torque(&self, _: f64, q: &[f64], _: &[f64], torque: &mut [f64]) {
        torque[1] -= self.spring * q[1];
    }
    fn potential(&self, q: &[f64]) -> Option<f64> {
        Some(0.5 * self.spring * q[1] * q[1])
    }
}

impl Slider {
    pub(crate) fn model(&self) -> Model {
        let mass = |mass| MassProperties::point(mass, Vector3::zeros());
        let mut builder = Model::builder();
        let up = Joint::Prismatic { axis: Vector3::z() };
        let down = Joint::Prismatic { axis: -Vector3::z() };
        builder.add(Link::root("body", up, mass(self.body))).unwrap();
        let foot = Link::child("foot", "body", down, mass(self.foot)).at(-Vector3::z() * LENGTH);
        builder.add(foot.with_damping(self.damping)).unwrap();
        builder.build().unwrap()
    }

    pub(crate) fn contacts(&self) -> Vec<LinkContact> {
        let law = CompliantLaw::try_new(self.ground, self.loss).unwrap();
        let contact = Contact::try_new(Vector3::zeros(), Arc::new(HalfSpace::ground()), law).unwrap();
        vec![LinkContact::new("foot", "foot", contact)]
    }

    /// Heights of body and foot, and their rates.
    pub(crate) fn heights(x: &TouchingState) -> Vector4<f64> {
        let (q, p) = (x.configuration.0.as_slice(), x.rate.base.as_slice());
        Vector4::new(q[0], q[0] - LENGTH - q[1], p[0], p[0] - p[1])
    }

    /// The equations of (height of the body, height of the foot, their rates, 1).
    fn matrix(&self, is_closed: bool) -> Matrix5<f64> {
        let (k, c) = (self.spring, self.damping);
        let (ground, loss) = if is_closed { (self.ground, self.loss) } else { (0.0, 0.0) };
        let (m, f) = (self.body, self.foot);
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

    /// Times of touch-down and release up to an end, and heights and rates there, from such a start.
    pub(crate) fn reference(&self, start: &Vector4<f64>, end: f64) -> (Vec<f64>, Vector4<f64>) {
        let (mut y, mut t, mut is_closed, mut events) = (start.push(1.0), 0.0, false, Vec::new());
        loop {
            let a = self.matrix(is_closed);
            let margin = |s: f64| {
                let z = (a * s).exp() * y;
                let margin = z[1] + self.loss / self.ground * z[3].max(0.0);
                if is_closed { -margin } else { margin }
            };
            // No contact and no flight of these legs is shorter than a tenth of a millisecond.
            let step = 1e-4;
            let mut s = step;
            while t + s < end && margin(s) > 0.0 {
                s += step;
            }
            if t + s >= end {
                return (events, ((a * (end - t)).exp() * y).fixed_rows::<4>(0).into_owned());
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
}

#[test]
fn a_leg_on_a_slider_spring_is_that_of_matrix_exponentials() {
    let model = LEG.model();
    let tree = TreeSystem::new(&model, Box::new(LEG) as Torques);
    let system = TreeInContact::try_new(tree, LEG.contacts(), vec![]).unwrap();
    // The body at 0.8 m, the leg 0.01 m longer than at rest.
    let start = system.unstretched(model.state(&[0.8, 0.01], &[0.3, 0.0]).unwrap());
    let (times, end) = LEG.reference(&Slider::heights(&start), 1.5);
    assert!(times.len() >= 6, "{times:?}");
    let steps = Steps::adapted((0.0, 1.5), Adaptive::with_tolerances(1e-14, 1e-14));
    let run = Run::new(&system, Method::Rkmk8, steps).locating(Location::default()).from(&start).unwrap();
    assert_eq!(run.events.len(), times.len());
    for (event, t) in run.events.iter().zip(&times) {
        assert!((event.t - t).abs() < 1e-12, "{} {t}", event.t);
    }
    let off = (Slider::heights(&run.state) - end).abs();
    assert!(off.fixed_rows::<2>(0).max() < 1e-12 && off.max() < 1e-11, "{off} {end}");
}
