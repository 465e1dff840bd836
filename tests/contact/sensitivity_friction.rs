//! The derivative of motions with friction: closed forms, differences of located runs.

use crate::located_differences::{agrees_with_differences, differentiate};
use nalgebra::Vector3;
use somersault_contact::contacts::{BodyInContact, Contact, Contacts};
use somersault_contact::event::EventKind;
use somersault_contact::laws::ContactLaw;
use somersault_contact::laws::compliant::CompliantLaw;
use somersault_contact::laws::coulomb::CoulombFriction;
use somersault_contact::laws::regularised::RegularisedFriction;
use somersault_contact::laws::resistance::Resistance;
use somersault_contact::models::{RollingDisk, TippeTop};
use somersault_contact::sensitivity::{Parameter, Sensitivities};
use somersault_contact::surface::{HalfSpace, Solid, SphericalSurface};
use somersault_integrators::body::RigidBody;
use somersault_integrators::force::{Gravity, Wrench};
use somersault_integrators::state::RigidBodyState;
use somersault_integrators::variation::Tangent;
use std::sync::Arc;

const G: f64 = 9.81;

/// ε in the parameter that column `k` of the twelve and `N` stands for, zero in the others.
fn changes<const N: usize>(k: usize, epsilon: f64) -> [f64; N] {
    std::array::from_fn(|i| if i + 12 == k { epsilon } else { 0.0 })
}

fn kinds(found: &Sensitivities) -> Vec<EventKind> {
    found.run.events.iter().map(|e| e.kind).collect()
}

type Driven = (Gravity, fn(f64, &RigidBody, &RigidBodyState) -> Wrench);

fn drive(t: f64, _: &RigidBody, _: &RigidBodyState) -> Wrench {
    Wrench { force: Vector3::x() * (8.0 * (9.0 * t).sin()), torque: Vector3::zeros() }
}

/// A block that falls on the ground and is dragged to and fro. Columns: the start, k, c, μ and the mass.
fn dragged(k: usize, epsilon: f64) -> (BodyInContact<Driven>, RigidBodyState) {
    let [stiffness, damping, coefficient, mass] = changes(k, epsilon);
    let friction = CoulombFriction::try_new(0.35 + coefficient, 600.0, 4.0).unwrap();
    let law = ContactLaw::from(CompliantLaw::try_new(3e3 + stiffness, 40.0 + damping).unwrap());
    let ground = Arc::new(HalfSpace::ground());
    let contact = Contact::try_new(Vector3::zeros(), ground, law.with_friction(friction)).unwrap();
    let inertia = *RigidBody::try_box(1.5, Vector3::new(0.2, 0.2, 0.1)).unwrap().inertia();
    let body = RigidBody::try_new(1.5 + mass, inertia).unwrap();
    let mut start = RigidBodyState::default();
    start.configuration.position.z = 0.01;
    start.rate.linear.x = 0.7;
    let forces: Driven = (Gravity::earth(), drive);
    (
        BodyInContact::new(body, (forces, Contacts::new(vec![contact]))),
        Tangent::unit(k).moved(&start, epsilon),
    )
}

#[test]
fn the_derivative_through_stick_and_slip_is_the_difference_of_located_runs() {
    let by = [
        Parameter::normal(0, "stiffness"),
        Parameter::normal(0, "damping"),
        Parameter::friction(0, "coefficient"),
        Parameter::Mass,
    ];
    let (system, start) = dragged(0, 0.0);
    let found = differentiate(&system, &start, &by, (0.0, 1.1), 2e-4).unwrap();
    println!("{:?}", found.run.events.iter().map(|e| (e.t, e.kind)).collect::<Vec<_>>());
    let kinds = kinds(&found);
    use EventKind::{Slip, Stick, TouchDown};
    assert_eq!(kinds, [TouchDown, Slip, Stick, Slip, Stick, Slip]);
    let steps = [[1e-5; 12].as_slice(), &[1e-1, 1e-1, 1e-5, 1e-5]].concat();
    agrees_with_differences(&found, dragged, &steps, (1.1, 2e-4), 1e-7);
}

/// A ball thrown onto the inside of a sphere, which slips and comes to roll. Columns: the start and μ.
fn bowled(k: usize, epsilon: f64) -> (BodyInContact<Gravity>, RigidBodyState) {
    let [coefficient] = changes(k, epsilon);
    let friction = CoulombFriction::try_new(0.25 + coefficient, 800.0, 20.0).unwrap();
    let law = ContactLaw::from(CompliantLaw::try_new(2e3, 20.0).unwrap()).with_friction(friction);
    let bowl = SphericalSurface::try_new(Vector3::new(0.0, 0.0, 1.0), 1.0, Solid::Outside).unwrap();
    let contact = Contact::try_ball(Vector3::zeros(), 0.1, Arc::new(bowl), law).unwrap();
    let inertia = somersault_core::Inertia::try_sphere(1.0, 0.1).unwrap();
    let body = RigidBody::try_new(1.0, inertia).unwrap();
    let mut start = RigidBodyState::default();
    start.configuration.position.z = 0.11;
    start.rate.linear = Vector3::new(1.0, 0.4, 0.0);
    start.rate.angular = Vector3::new(0.0, 0.0, 3.0);
    let system = BodyInContact::new(body, (Gravity::earth(), Contacts::new(vec![contact])));
    (system, Tangent::unit(k).moved(&start, epsilon))
}

#[test]
fn the_derivative_of_a_ball_that_comes_to_roll_in_a_bowl_is_the_difference_of_located_runs() {
    let (system, start) = bowled(0, 0.0);
    let found =
        differentiate(&system, &start, &[Parameter::friction(0, "coefficient")], (0.0, 0.5), 2e-4).unwrap();
    let kinds = kinds(&found);
    println!("{kinds:?}");
    assert!([EventKind::TouchDown, EventKind::Slip, EventKind::Stick].iter().all(|k| kinds.contains(k)));
    // A spin about the vertical hardly moves the events: its differences are taken over more.
    let mut steps = [1e-5; 13];
    steps[11] = 1e-2;
    agrees_with_differences(&found, bowled, &steps, (0.5, 2e-4), 1e-7);
}

/// A block on a rough spot, pulled until it breaks away from a static coefficient. Columns: the start and μ.
fn breaking(k: usize, epsilon: f64) -> (BodyInContact<Driven>, RigidBodyState) {
    let [coefficient] = changes(k, epsilon);
    let mu = 0.3 + coefficient;
    let friction = CoulombFriction::try_new(mu, 900.0, 20.0).unwrap().with_static(1.5 * mu).unwrap();
    let law = ContactLaw::from(CompliantLaw::try_new(3e3, 40.0).unwrap()).with_friction(friction);
    let contact = Contact::try_new(Vector3::zeros(), Arc::new(HalfSpace::ground()), law).unwrap();
    let body = RigidBody::try_box(1.5, Vector3::new(0.2, 0.2, 0.1)).unwrap();
    let mut start = RigidBodyState::default();
    start.configuration.position.z = -1.5 * G / 3e3;
    let forces: Driven = (Gravity::earth(), drive);
    (
        BodyInContact::new(body, (forces, Contacts::new(vec![contact]))),
        Tangent::unit(k).moved(&start, epsilon),
    )
}

#[test]
fn the_derivative_through_a_break_away_is_the_difference_of_located_runs() {
    let (system, start) = breaking(0, 0.0);
    let found =
        differentiate(&system, &start, &[Parameter::friction(0, "coefficient")], (0.0, 0.6), 2e-4).unwrap();
    println!("{:?}", kinds(&found));
    assert!(kinds(&found).contains(&EventKind::Slip));
    agrees_with_differences(&found, breaking, &[1e-5; 13], (0.6, 2e-4), 1e-7);
}

/// A box that slides and tumbles under regularised friction. Columns: the start, k, c and μ of the first
/// corner, and the mass.
fn tumbling(k: usize, epsilon: f64) -> (BodyInContact<Gravity>, RigidBodyState) {
    let [stiffness, damping, coefficient, mass] = changes(k, epsilon);
    let corner = |i: usize| {
        let point = Vector3::new([0.2, -0.2][i % 2], [0.15, -0.15][i / 2], -0.1);
        let (k, c, mu) = if i == 0 { (stiffness, damping, coefficient) } else { (0.0, 0.0, 0.0) };
        let friction = RegularisedFriction::try_new(0.3 + mu, 0.05).unwrap();
        let law = ContactLaw::from(CompliantLaw::try_new(900.0 + k, 6.0 + c).unwrap())
            .with_friction(friction)
            .with_resistance(Resistance::try_new(0.01, 0.02, 0.3).unwrap());
        Contact::try_new(point, Arc::new(HalfSpace::ground()), law).unwrap()
    };
    let inertia = *RigidBody::try_box(1.2, Vector3::new(0.4, 0.3, 0.2)).unwrap().inertia();
    let body = RigidBody::try_new(1.2 + mass, inertia).unwrap();
    let turn = nalgebra::UnitQuaternion::from_scaled_axis(Vector3::new(0.2, -0.15, 0.3));
    let start = RigidBodyState::new(
        Vector3::new(0.0, 0.0, 0.25),
        turn,
        Vector3::new(1.0, 0.3, 0.0),
        Vector3::new(0.3, 0.5, -0.4),
    );
    let contacts = Contacts::new((0..4).map(corner).collect());
    (BodyInContact::new(body, (Gravity::earth(), contacts)), Tangent::unit(k).moved(&start, epsilon))
}

#[test]
fn the_derivative_with_regularised_friction_is_the_difference_of_located_runs() {
    let by = [
        Parameter::normal(0, "stiffness"),
        Parameter::normal(0, "damping"),
        Parameter::friction(0, "coefficient"),
        Parameter::Mass,
    ];
    let (system, start) = tumbling(0, 0.0);
    let found = differentiate(&system, &start, &by, (0.0, 0.6), 2e-4).unwrap();
    assert!((0..4).all(|i| found.run.events.iter().any(|e| e.guard == i)));
    let steps = [[1e-5; 12].as_slice(), &[1e-2, 1e-3, 1e-5, 1e-5]].concat();
    agrees_with_differences(&found, tumbling, &steps, (0.6, 2e-4), 1e-6);
}

/// A disk thrown on its rim. Columns: the start and k, c and μ.
fn disk(k: usize, epsilon: f64) -> (BodyInContact<Gravity>, RigidBodyState) {
    let [stiffness, damping, coefficient] = changes(k, epsilon);
    let law = CompliantLaw::try_new(4e3 + stiffness, 20.0 + damping).unwrap();
    let friction = CoulombFriction::try_new(0.2 + coefficient, 0.0, 8.0).unwrap();
    let disk = RollingDisk::try_new(0.8, 0.2, law, friction).unwrap();
    // The steady motion of a disk on softer springs sits lower; the start is to be the same.
    let mut start = disk.steady(1.1, 3.0).unwrap();
    start.configuration.position.z = 0.2 * 1.1f64.sin() + 0.018;
    start.rate.linear.x += 0.8;
    (disk.system, Tangent::unit(k).moved(&start, epsilon))
}

#[test]
fn the_derivative_of_a_disk_on_its_rim_is_the_difference_of_located_runs() {
    let by = [
        Parameter::normal(0, "stiffness"),
        Parameter::normal(0, "damping"),
        Parameter::friction(0, "coefficient"),
    ];
    let (system, start) = disk(0, 0.0);
    let found = differentiate(&system, &start, &by, (0.0, 0.8), 2e-4).unwrap();
    println!("{:?}", found.run.events.iter().map(|e| (e.t, e.kind)).collect::<Vec<_>>());
    let kinds = kinds(&found);
    assert!([EventKind::TouchDown, EventKind::Slip, EventKind::Stick].iter().all(|k| kinds.contains(k)));
    let steps = [[1e-5; 12].as_slice(), &[1e-1, 1e-3, 1e-5]].concat();
    agrees_with_differences(&found, disk, &steps, (0.8, 2e-4), 1e-6);
}

/// A tippe top that begins to invert. Columns: the start, k, c, μ and the mass.
fn tippe(k: usize, epsilon: f64) -> (BodyInContact<Gravity>, RigidBodyState) {
    let [stiffness, damping, coefficient, mass] = changes(k, epsilon);
    let law = ContactLaw::from(CompliantLaw::try_new(2e3 + stiffness, 2.0 + damping).unwrap())
        .with_friction(RegularisedFriction::try_new(0.3 + coefficient, 0.02).unwrap());
    let top = TippeTop::try_new(0.01 + mass, 0.02, 0.2, (1.6e-6, 1.7e-6), law).unwrap();
    let start = Tangent::unit(k).moved(&top.spinning(0.3, 120.0, -1e-4), epsilon);
    (top.system, start)
}

#[test]
fn the_derivative_of_a_tippe_top_is_the_difference_of_located_runs() {
    let by = [
        Parameter::normal(0, "stiffness"),
        Parameter::normal(0, "damping"),
        Parameter::friction(0, "coefficient"),
        Parameter::Mass,
    ];
    let (system, start) = tippe(0, 0.0);
    let found = differentiate(&system, &start, &by, (0.0, 0.3), 1e-4).unwrap();
    assert!(kinds(&found).contains(&EventKind::TouchDown));
    let steps = [[1e-7; 3], [1e-5; 3], [1e-5; 3], [1e-3; 3]]
        .as_flattened()
        .iter()
        .copied()
        .chain([1.0, 1e-2, 1e-5, 1e-7]);
    agrees_with_differences(&found, tippe, &steps.collect::<Vec<_>>(), (0.3, 1e-4), 1e-6);
}
