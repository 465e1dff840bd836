//! Surfaces that bodies of the tree carry: boards, platforms, conveyors.

use crate::{RKMK8, passive};
use nalgebra::{Matrix3, Vector3};
use somersault_contact::contacts::Contact;
use somersault_contact::laws::ContactLaw;
use somersault_contact::laws::compliant::CompliantLaw;
use somersault_contact::laws::coulomb::CoulombFriction;
use somersault_contact::surface::{HalfSpace, Solid, SphericalSurface, Surface};
use somersault_contact::tree::{LinkContact, TouchingState, TreeInContact};
use somersault_integrators::driver::{Adaptive, Steps, TimeGrid};
use somersault_integrators::events::Location;
use somersault_integrators::methods::Method;
use somersault_integrators::run::Run;
use somersault_multibody::motion::TreeSystem;
use somersault_multibody::{Joint, Link, MassProperties, Model, Split};
use std::sync::Arc;

fn law() -> ContactLaw {
    let friction = CoulombFriction::try_new(0.4, 4e3, 30.0).unwrap();
    ContactLaw::from(CompliantLaw::try_new(5e3, 15.0).unwrap()).with_friction(friction)
}

fn solid(mass: f64, moments: [f64; 3]) -> MassProperties {
    let inertia = Matrix3::from_diagonal(&Vector3::from(moments));
    MassProperties { mass, center: Vector3::zeros(), inertia }
}

/// A stand with a carrier on some joint, and a free body.
fn model(joint: Joint, gravity: f64) -> Model {
    let mut builder = Model::builder().with_gravity(-Vector3::z() * gravity);
    builder.add(Link::root("stand", Joint::Fixed, solid(1.0, [1.0; 3]))).unwrap();
    builder.add(Link::child("carrier", "stand", joint, solid(3.0, [0.3, 0.4, 0.5]))).unwrap();
    builder.add(Link::child("body", "stand", Joint::Free, solid(1.2, [0.02, 0.03, 0.025]))).unwrap();
    builder.build().unwrap()
}

fn touches(surface: Arc<dyn Surface>, base: Option<&str>) -> Vec<LinkContact> {
    let places = [(0.1, 0.1), (0.1, -0.1), (-0.1, 0.1), (-0.1, -0.1)];
    let contact = |(k, (x, y)): (usize, (f64, f64))| {
        let point = Vector3::new(x, y, -0.05);
        let contact = Contact::try_ball(point, 0.02, surface.clone(), law()).unwrap();
        let contact = LinkContact::new(format!("c{k}"), "body", contact);
        base.map_or(contact.clone(), |base| contact.on(base))
    };
    places.into_iter().enumerate().map(contact).collect()
}

/// Where the free body is after its carrier's n numbers.
fn body(x: &TouchingState, n: usize) -> Vec<f64> {
    x.configuration.0.as_slice()[n..].to_vec()
}

const PLACE: [f64; 7] = [0.0, 0.0, 0.12, 0.0, 0.0, 0.0, 1.0];
const RATE: [f64; 6] = [0.5, 0.2, -0.8, 0.4, -0.6, 1.0];

#[test]
fn a_surface_that_a_body_carries_at_rest_is_that_of_the_world() {
    let model = model(Joint::Fixed, 9.81);
    let ground: Arc<dyn Surface> = Arc::new(HalfSpace::ground());
    let run = |base: Option<&str>| {
        let contacts = touches(ground.clone(), base);
        let system = TreeInContact::try_new(TreeSystem::new(&model, passive()), contacts, vec![]).unwrap();
        let start = system.unstretched(model.state(&PLACE, &RATE).unwrap());
        let grid = TimeGrid::try_new(0.0, 0.4, 1e-3).unwrap();
        let run = Run::new(&system, Method::Rkmk8, grid).locating(Location::as_given());
        run.from(&start).unwrap()
    };
    let [world, carried] = [None, Some("carrier")].map(run);
    assert!(world.event_count > 6 && world.event_count == carried.event_count);
    let [a, b] = [&world, &carried].map(|run| body(&run.state, 0));
    assert!(a.iter().zip(&b).all(|(a, b)| (a - b).abs() < 1e-11), "{a:?} {b:?}");
}

/// On a belt that moves at a constant velocity everything is as on the ground, seen from the belt.
#[test]
fn a_conveyor_is_ground_that_moves() {
    let speed = 0.7;
    let model = model(Joint::Prismatic { axis: Vector3::x() }, 9.81);
    let ground: Arc<dyn Surface> = Arc::new(HalfSpace::ground());
    let run = |base: Option<&str>, start: f64| {
        let contacts = touches(ground.clone(), base);
        // The joint of the belt keeps its velocity, whatever force that takes.
        let split = Split::try_active(&model, &["carrier"]).unwrap();
        let still = |_: f64, _: &[f64], _: &[f64], out: &mut [f64]| out[0] = 0.0;
        let tree = TreeSystem::new(&model, ()).driven(split, still).unwrap();
        let system = TreeInContact::try_new(tree, contacts, vec![]).unwrap();
        let (q, mut v) = ([&[0.0][..], &PLACE].concat(), [&[start][..], &RATE].concat());
        v[1] += start;
        let state = system.unstretched(model.state(&q, &v).unwrap());
        let grid = TimeGrid::try_new(0.0, 0.4, 1e-3).unwrap();
        let run = Run::by_stepper(&system, &RKMK8, grid).locating(Location::as_given());
        run.from(&state).unwrap()
    };
    let (ground_run, belt) = (run(None, 0.0), run(Some("carrier"), speed));
    assert!(belt.event_count > 6 && belt.event_count == ground_run.event_count);
    let (a, mut b) = (body(&ground_run.state, 1), body(&belt.state, 1));
    b[0] -= 0.4 * speed;
    assert!(a.iter().zip(&b).all(|(a, b)| (a - b).abs() < 1e-10), "{a:?} {b:?}");
}

/// A body lands on a sphere that another one carries, both free: momentum is kept, energy is not created.
#[test]
fn what_a_body_carries_pushes_back() {
    let model = model(Joint::Free, 0.0);
    let ball = SphericalSurface::try_new(Vector3::new(0.0, 0.05, -0.5), 0.5, Solid::Inside).unwrap();
    let contacts = touches(Arc::new(ball), Some("carrier"));
    let system = TreeInContact::try_new(TreeSystem::new(&model, passive()), contacts, vec![]).unwrap();
    let carrier = ([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0], [0.1, 0.0, 0.3, 0.5, 0.9, -2.0]);
    let (q, v) = ([carrier.0, PLACE].concat(), [carrier.1, RATE].concat());
    let start = system.unstretched(model.state(&q, &v).unwrap());
    let steps = Steps::adapted((0.0, 1.0), Adaptive::with_tolerances(1e-12, 1e-12));
    let run = Run::new(&system, Method::Rkmk8, steps).locating(Location::default()).from(&start).unwrap();
    assert!(run.event_count > 6, "{}", run.event_count);
    let [before, after] = [&start, &run.state].map(|x| system.momentum(x).unwrap());
    assert!((after.linear - before.linear).norm() < 1e-10, "{before:?} {after:?}");
    assert!((after.angular - before.angular).norm() < 1e-10, "{before:?} {after:?}");
    let [before, after] = [&start, &run.state].map(|x| system.ledger(x).total());
    assert!(after < before - 0.01, "{before} {after}");
    let jacobian = system.contact_jacobian(0, &run.state).unwrap();
    let mut joint = nalgebra::DVector::zeros(12);
    model.joint_velocities(&run.state.base(), joint.as_mut_slice()).unwrap();
    let touch = system.touches(&run.state)[0];
    let expected = touch.sliding + touch.normal * touch.rate;
    assert!((jacobian * joint - expected).norm() < 1e-11);
}

/// Without losses a body on a board on a spring keeps its energy, while its contact turns with the board.
#[test]
fn energy_is_kept_on_a_board_that_turns() {
    let model = model(Joint::Free, 0.0);
    let normal = CompliantLaw::try_new(3e3, 0.0).unwrap();
    // Friction that holds all the time: its damper loses little.
    let grip = CoulombFriction::try_new(50.0, 2e3, 1e-3).unwrap();
    let law = ContactLaw::from(normal).with_friction(grip);
    let plane: Arc<dyn Surface> = Arc::new(HalfSpace::ground());
    let contact = Contact::try_new(Vector3::new(0.02, 0.0, -0.05), plane, law).unwrap();
    let contacts = vec![LinkContact::new("c", "body", contact).on("carrier")];
    let system = TreeInContact::try_new(TreeSystem::new(&model, passive()), contacts, vec![]).unwrap();
    let carrier = ([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0], [0.0, 0.0, 0.0, 0.0, 0.0, 6.0]);
    // Pressed into the board, and turning with it.
    let (q, v) = (
        [carrier.0, [0.0, 0.0, 0.03, 0.0, 0.0, 0.0, 1.0]].concat(),
        [carrier.1, [0.4, 0.2, -0.3, 0.0, 0.0, 6.0]].concat(),
    );
    let start = system.unstretched(model.state(&q, &v).unwrap());
    let steps = Steps::adapted((0.0, 0.02), Adaptive::with_tolerances(1e-12, 1e-12));
    let run = Run::new(&system, Method::Rkmk8, steps).locating(Location::default()).from(&start).unwrap();
    // It ends before the release, at which the energy of the stretch is lost.
    assert_eq!(run.event_count, 0);
    assert!(run.state.rate.variables[0].norm() > 2e-3);
    let [before, after] = [&start, &run.state].map(|x| system.ledger(x).total());
    // The damper of 1 g/s loses at most c v² t.
    assert!(after <= before + 1e-10 && before - after < 1e-3 * 0.5 * 0.5 * 0.02, "{before} {after}");
}
