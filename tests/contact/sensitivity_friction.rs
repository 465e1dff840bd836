//! The derivative of motions with friction: closed forms, differences of located runs.

use crate::located_differences::{agrees_with_differences, differentiate};
use nalgebra::Vector3;
use somersault_contact::contacts::{BodyInContact, Contact, Contacts};
use somersault_contact::event::EventKind;
use somersault_contact::friction::{CoulombFriction, CreepFriction, RegularisedFriction, Resistance};
use somersault_contact::interface::ContactLaw;
use somersault_contact::law::CompliantLaw;
use somersault_contact::models::{RollingDisk, SlidingBlock, TippeTop};
use somersault_contact::sensitivity::{Parameter, Sensitivities};
use somersault_contact::surface::HalfSpace;
use somersault_integrators::body::RigidBody;
use somersault_integrators::force::{Gravity, Wrench};
use somersault_integrators::state::RigidBodyState;
use somersault_integrators::variation::Tangent;
use somersault_testkit::order::slope;
use std::sync::Arc;

const G: f64 = 9.81;

/// ε in the parameter that column `k` of the twelve and `N` stands for, zero in the others.
fn changes<const N: usize>(k: usize, epsilon: f64) -> [f64; N] {
    std::array::from_fn(|i| if i + 12 == k { epsilon } else { 0.0 })
}

fn kinds(found: &Sensitivities) -> Vec<EventKind> {
    found.run.events.iter().map(|e| e.kind).collect()
}

#[test]
fn the_derivative_of_the_stopping_place_is_that_of_its_closed_form() {
    // x = v²/(2 μ g) and t = v/(μ g), straight along the velocity.
    let (coefficient, speed) = (0.4, 2.0);
    let friction = CoulombFriction::try_new(coefficient, 2e3, 5.0).unwrap();
    let law = CompliantLaw::try_new(5e4, 50.0).unwrap();
    let block = SlidingBlock::try_new(1.5, Vector3::new(0.2, 0.2, 0.1), law, friction).unwrap();
    let stop = speed / (coefficient * G);
    for end in [0.3, stop + 0.2] {
        let found =
            differentiate(&block.system, &block.sliding(speed), &[Parameter::Friction(0)], (0.0, end), 1e-3)
                .unwrap();
        let (state, friction) = (&found.state, found.parameters.column(0));
        let stopped = end > stop;
        assert_eq!(kinds(&found), if stopped { vec![EventKind::Stick] } else { vec![] });
        let rest = (1.0 - end / stop).max(0.0);
        // dx/dv, dvx/dv, dy/dvy, dvy/dvy, dx/dμ, dvx/dμ: a sideways velocity w grows and shrinks with the
        // other, y = w x/v, and v' = v − μ g t.
        let travelled =
            if stopped { 0.5 * speed * stop } else { speed * end - 0.5 * coefficient * G * end * end };
        let expected = [
            (state[(0, 6)], if stopped { stop } else { end }),
            (state[(6, 6)], if stopped { 0.0 } else { 1.0 }),
            (state[(1, 7)], travelled / speed),
            (state[(7, 7)], rest),
            (friction[0], if stopped { -0.5 * G * stop * stop } else { -0.5 * G * end * end }),
            (friction[6], if stopped { 0.0 } else { -G * end }),
            (state[(0, 0)], 1.0),
            (state[(0, 7)], 0.0),
        ];
        for (k, (found, expected)) in expected.into_iter().enumerate() {
            let sideways = stopped && (k == 2 || k == 3);
            let error = (found - expected).abs();
            assert!(sideways || error < 1e-12, "{end} {k}: {found} {expected}");
        }
        if stopped {
            let times = found.event_times.column(0);
            assert!((times[6] - 1.0 / (coefficient * G)).abs() < 1e-12, "{}", times[6]);
            assert!((times[12] + stop / coefficient).abs() < 1e-12 && times[7].abs() < 1e-12, "{times}");
        }
    }
}

#[test]
fn sideways_columns_are_of_second_order_where_sliding_stops() {
    let (coefficient, speed) = (0.4, 2.0);
    let friction = CoulombFriction::try_new(coefficient, 2e3, 5.0).unwrap();
    let law = CompliantLaw::try_new(5e4, 50.0).unwrap();
    let block = SlidingBlock::try_new(1.5, Vector3::new(0.2, 0.2, 0.1), law, friction).unwrap();
    let stop = speed / (coefficient * G);
    let mut points = Vec::new();
    for steps in [100, 200, 400, 800] {
        // Root mean square over steps within an octave: where the stop falls within a step matters.
        let mut squares = 0.0;
        for i in 0..12 {
            let dt = 1.0 / f64::from(steps + steps * i / 24);
            let found =
                differentiate(&block.system, &block.sliding(speed), &[], (0.0, stop + 0.1), dt).unwrap();
            // y = w x/v.
            squares += (found.state[(1, 7)] - 0.5 * stop).powi(2);
            assert!(found.state[(7, 7)].abs() < 1e-12, "{}", found.state[(7, 7)]);
        }
        points.push((1.0 / f64::from(steps), squares.sqrt()));
    }
    let found = slope(&points);
    println!("{found:.2} {points:?}");
    assert!((found - 2.0).abs() < 0.3 && points[3].1 < 1e-5, "{found} {points:?}");
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
    let by = [Parameter::Stiffness(0), Parameter::Damping(0), Parameter::Friction(0), Parameter::Mass];
    let (system, start) = dragged(0, 0.0);
    let found = differentiate(&system, &start, &by, (0.0, 1.1), 2e-4).unwrap();
    println!("{:?}", found.run.events.iter().map(|e| (e.t, e.kind)).collect::<Vec<_>>());
    let kinds = kinds(&found);
    use EventKind::{Slip, Stick, TouchDown};
    assert_eq!(kinds, [TouchDown, Stick, Slip, Stick, Slip]);
    // Runs that are pushed sideways have lost their order where they stop: no difference tells.
    let mut steps = [[1e-5; 12].as_slice(), &[1e-1, 1e-1, 1e-5, 1e-5]].concat();
    steps[7] = 0.0;
    agrees_with_differences(&found, dragged, &steps, (1.1, 2e-4), 1e-6);
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
    let by = [Parameter::Stiffness(0), Parameter::Damping(0), Parameter::Friction(0), Parameter::Mass];
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
    let friction = CreepFriction::try_new(0.2 + coefficient, 8.0).unwrap();
    let disk = RollingDisk::try_new(0.8, 0.2, law, friction).unwrap();
    // The steady motion of a disk on softer springs sits lower; the start is to be the same.
    let mut start = disk.steady(1.1, 3.0).unwrap();
    start.configuration.position.z = 0.2 * 1.1f64.sin() + 0.018;
    start.rate.linear.x += 0.8;
    (disk.system, Tangent::unit(k).moved(&start, epsilon))
}

#[test]
fn the_derivative_of_a_disk_on_its_rim_is_the_difference_of_located_runs() {
    let by = [Parameter::Stiffness(0), Parameter::Damping(0), Parameter::Friction(0)];
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
    let by = [Parameter::Stiffness(0), Parameter::Damping(0), Parameter::Friction(0), Parameter::Mass];
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
