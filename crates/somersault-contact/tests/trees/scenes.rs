//! The bouncing chain and the hopping leg against references that were computed independently.

use nalgebra::{Matrix3, UnitQuaternion, Vector3};
use somersault_contact::contacts::Contact;
use somersault_contact::event::EventKind;
use somersault_contact::laws::compliant::CompliantLaw;
use somersault_contact::models::HoppingLeg;
use somersault_contact::surface::HalfSpace;
use somersault_contact::tree::{LinkContact, TouchingState, TreeInContact};
use somersault_integrators::augmented::Augmented;
use somersault_integrators::driver::{Adaptive, Steps, TimeGrid};
use somersault_integrators::events::{Located, Location};
use somersault_integrators::methods::Method;
use somersault_integrators::run::Run;
use somersault_multibody::motion::{Coordinates, TreeForces, TreeSystem};
use somersault_multibody::{Joint, Link, MassProperties, Model};
use std::f64::consts::FRAC_PI_2;
use std::sync::Arc;

pub type Run2 = Located<Augmented<Coordinates>, EventKind>;

/// The chain S1a: a hinge that is free in a vertical plane, and two links on it.
pub fn chain() -> (Model, Vec<LinkContact>) {
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
pub fn chain_start<F: TreeForces>(system: &TreeInContact<'_, F>) -> TouchingState {
    let (a1, a2): (f64, f64) = (1.1, -0.7);
    let (s, c) = a1.sin_cos();
    let q = [0.0, 0.45, a1, a2 - a1];
    let v = [c * 0.3, -s * 0.3, 0.5, -1.0 - 0.5];
    system.unstretched(system.model().state(&q, &v).unwrap())
}

/// Places and absolute angles, and their rates, of a leg or a chain.
pub fn absolute(x: &TouchingState) -> (Vec<f64>, Vec<f64>) {
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

#[test]
fn a_chain_bounces_to_the_digits_of_the_reference() {
    let (model, contacts) = chain();
    let system = TreeInContact::try_new(TreeSystem::new(&model, ()), contacts, vec![]).unwrap();
    let start = chain_start(&system);
    let steps = Steps::adapted((0.0, 1.0), Adaptive::with_tolerances(1e-13, 1e-13));
    let run = Run::new(&system, Method::Rkmk8, steps).locating(Location::default()).from(&start).unwrap();
    println!("{} steps {} rejected {} trials", run.steps, run.rejected, run.trials);
    for e in &run.events { println!("{:.10} {:?} {}", e.t, e.kind, e.guard); }
    let (q, _) = absolute(&run.state);
    println!("{q:?}");
    assert_eq!(run.event_count, 20);
    assert!((q[0] - 0.2870122749).abs() < 1e-9 && (q[3] + 1.4221795545).abs() < 1e-9, "{q:?}");
}

#[test]
fn a_leg_hops_to_the_digits_of_the_reference() {
    let leg = HoppingLeg::example().unwrap();
    let model = leg.model().unwrap();
    let torques = |t: f64, _: &[f64], _: &[f64], torque: &mut [f64]| leg.add_torques(t, torque);
    let system =
        TreeInContact::try_new(TreeSystem::new(&model, torques), leg.contacts().unwrap(), vec![]).unwrap();
    let (q, v) = leg.start();
    let start = system.unstretched(model.state(&q, &v).unwrap());
    let steps = Steps::adapted((0.0, 0.6), Adaptive::with_tolerances(1e-13, 1e-13));
    let run = Run::new(&system, Method::Rkmk8, steps).locating(Location::default()).from(&start).unwrap();
    println!("{} steps {} rejected {} trials", run.steps, run.rejected, run.trials);
    for e in &run.events { println!("{:.10} {:?} {}", e.t, e.kind, e.guard); }
    let (q, v) = absolute(&run.state);
    println!("{q:?} {v:?}");
    assert_eq!(run.event_count, 16);
    let places = [0.4375132884, 0.4852733922, -1.4596027138, 0.5776539853, -0.7019944517];
    let rates = [0.8495829077, -0.7132407446, -7.3488609609, -0.4159140744, -2.6811647382];
    for (found, expected) in q.iter().zip(&places).chain(v.iter().zip(&rates)) {
        assert!((found - expected).abs() < 2e-9, "{found} {expected}");
    }
    let _ = TimeGrid::try_new(0.0, 1.0, 1.0);
}
