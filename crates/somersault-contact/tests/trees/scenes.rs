//! The bouncing chain and the hopping leg against references that were computed independently.

use crate::{in_contact, passive};
use nalgebra::{Matrix3, UnitQuaternion, Vector3};
use somersault_contact::contacts::Contact;
use somersault_contact::event::EventKind::{self, Release, Slip, Stick, TouchDown};
use somersault_contact::laws::compliant::CompliantLaw;
use somersault_contact::models::HoppingLeg;
use somersault_contact::surface::HalfSpace;
use somersault_contact::tree::{LinkContact, TouchingState, TreeInContact};
use somersault_integrators::augmented::Augmented;
use somersault_integrators::driver::{Adaptive, Steps};
use somersault_integrators::events::{Located, Location};
use somersault_integrators::methods::Method;
use somersault_integrators::run::Run;
use somersault_multibody::motion::{Coordinates, TreeForces, TreeSystem};
use somersault_multibody::{Data, Joint, Link, MassProperties, Model};
use std::f64::consts::FRAC_PI_2;
use std::sync::Arc;

/// The chain S1a: a hinge that is free in a vertical plane, and two links on it.
pub(crate) fn chain() -> (Model, Vec<LinkContact>) {
    let down = -Vector3::y();
    let mass = |mass, center: f64, moment| MassProperties {
        mass,
        center: down * center,
        inertia: Matrix3::from_diagonal_element(moment),
    };
    let plane = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), FRAC_PI_2);
    let mut builder = Model::builder();
    builder.add(Link::root("first", Joint::Planar, mass(1.2, 0.22, 0.03)).turned(plane)).unwrap();
    let hinge = Joint::Revolute { axis: Vector3::z() };
    builder.add(Link::child("second", "first", hinge, mass(0.8, 0.17, 0.012))).unwrap();
    let law = CompliantLaw::try_new(2e4, 8.0).unwrap();
    let of = |name: &str, link: &str, length: f64| {
        let contact = Contact::try_new(down * length, Arc::new(HalfSpace::ground()), law).unwrap();
        LinkContact::new(name, link, contact)
    };
    let contacts = vec![of("hinge", "first", 0.0), of("tip 1", "first", 0.5), of("tip 2", "second", 0.4)];
    (builder.build().unwrap(), contacts)
}

/// Where the chain starts.
pub(crate) fn chain_start<F: TreeForces>(system: &TreeInContact<'_, F>) -> TouchingState {
    let (a1, a2): (f64, f64) = (1.1, -0.7);
    let (s, c) = a1.sin_cos();
    let q = [0.0, 0.45, a1, a2 - a1];
    let v = [c * 0.3, -s * 0.3, 0.5, -1.0 - 0.5];
    system.unstretched(system.model().state(&q, &v).unwrap())
}

/// Places and absolute angles, and their rates, of a leg or a chain.
pub(crate) fn absolute(x: &TouchingState) -> (Vec<f64>, Vec<f64>) {
    let sum = |numbers: &[f64]| {
        let mut angle = 0.0;
        let angles = numbers[2..].iter().map(|turn| {
            angle += turn;
            angle
        });
        let angles: Vec<f64> = angles.collect();
        [numbers[..2].to_vec(), angles].concat()
    };
    (sum(x.configuration.0.as_slice()), sum(x.rate.base.as_slice()))
}

/// A run of the leg by adapted steps.
type Hops = Located<Augmented<Coordinates>, EventKind>;

fn adapted(end: f64, tolerance: f64) -> Steps {
    Steps::adapted((0.0, end), Adaptive::with_tolerances(tolerance, tolerance))
}

/// Equations in minimal coordinates by another program, integrated by DOP853 with located events at 1e-13.
#[test]
fn a_chain_bounces_to_the_digits_of_the_reference() {
    let (model, contacts) = chain();
    let system = TreeInContact::try_new(TreeSystem::new(&model, passive()), contacts, vec![]).unwrap();
    let start = chain_start(&system);
    let run = Run::new(&system, Method::Rkmk8, adapted(1.0, 1e-13));
    let run = run.locating(Location::default()).from(&start).unwrap();
    assert_eq!(run.event_count, 20);
    assert!(run.events.iter().enumerate().all(|(i, e)| e.kind == [TouchDown, Release][i % 2]));
    let (q, _) = absolute(&run.state);
    assert!((q[0] - 0.2870122749).abs() < 1e-10 && (q[3] + 1.4221795545).abs() < 1e-10, "{q:?}");
}

/// As the chain.
#[test]
fn a_leg_hops_to_the_digits_of_the_reference() {
    let leg = HoppingLeg::example().unwrap().system().unwrap();
    let (model, system) = (&leg.model, in_contact(&leg));
    let start = system.unstretched(leg.start().unwrap());
    let run = |method, tolerance| -> Hops {
        let run = Run::new(&system, method, adapted(0.6, tolerance));
        run.locating(Location::default()).from(&start).unwrap()
    };
    let run = run(Method::Rkmk8, 1e-13);
    let kinds: Vec<_> = run.events.iter().map(|e| e.kind).collect();
    let first = [TouchDown, Stick, Slip, Release];
    let second = [TouchDown, Slip, Stick, Slip, Release];
    let third = [TouchDown, Slip, Stick, Slip, Stick, Slip, Release];
    assert_eq!(kinds, [&first[..], &second, &third].concat());
    let (q, v) = absolute(&run.state);
    let places = [0.4375132884, 0.4852733922, -1.4596027138, 0.5776539853, -0.7019944517];
    let rates = [0.8495829077, -0.7132407446, -7.3488609609, -0.4159140744, -2.6811647382];
    for (found, expected) in q.iter().zip(&places).chain(v.iter().zip(&rates)) {
        assert!((found - expected).abs() < 1e-9, "{found} {expected}");
    }
    // The vertical impulses of the three stances are what gravity and the change of momentum ask for.
    let impulse: f64 = run.events.iter().map(|e| e.impulse).sum();
    let (mut data, mut joint) = (Data::new(model), vec![0.0; 5]);
    let mut momentum = |x: &TouchingState| {
        let base = x.base();
        model.joint_velocities(&base, &mut joint).unwrap();
        let found = model.centroidal(&mut data, base.configuration.as_slice()).unwrap();
        found.momentum(&joint).unwrap().linear.z
    };
    let gained = momentum(&run.state) - momentum(&start) + 6.5 * 9.81 * 0.6;
    assert!((impulse - gained).abs() < 1e-4 * gained, "{impulse} {gained}");
}
