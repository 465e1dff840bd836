//! Contacts between bodies: momentum, restitution, order, balls in a row.

use nalgebra::{UnitQuaternion, Vector3};
use somersault_contact::ContactError;
use somersault_contact::bodies::{BodiesInContact, BodyContacts, BodySphere, SpherePair};
use somersault_contact::contacts::Contact;
use somersault_contact::event::EventKind;
use somersault_contact::laws::ContactLaw;
use somersault_contact::laws::compliant::CompliantLaw;
use somersault_contact::laws::coulomb::CoulombFriction;
use somersault_contact::laws::hunt_crossley::HuntCrossley;
use somersault_contact::laws::regularised::RegularisedFriction;
use somersault_contact::laws::resistance::Resistance;
use somersault_contact::surface::HalfSpace;
use somersault_core::argument::ArgumentError;
use somersault_core::{Inertia, lie::so3};
use somersault_integrators::body::RigidBody;
use somersault_integrators::driver::TimeGrid;
use somersault_integrators::events::{Frozen, Located, Location};
use somersault_integrators::force::Gravity;
use somersault_integrators::methods::{Dop853, Method, RungeKuttaMuntheKaas, RungeKuttaMuntheKaas4};
use somersault_integrators::run::Run;
use somersault_integrators::state::{Pose, State, Twist};
use somersault_integrators::stepper::Stepper;
use somersault_integrators::system::{CountMismatch, Interaction};
use somersault_testkit::order::slope;
use std::sync::Arc;

type System = BodiesInContact<Gravity>;
type Bodies = State<Vec<Pose>>;

fn ball(mass: f64, radius: f64) -> RigidBody {
    RigidBody::try_new(mass, Inertia::try_sphere(mass, radius).unwrap()).unwrap()
}

fn free(bodies: Vec<RigidBody>, contacts: BodyContacts) -> System {
    let forces = vec![Gravity { acceleration: Vector3::zeros() }; bodies.len()];
    System::try_new(bodies, forces, contacts).unwrap()
}

fn pair(first: usize, second: usize, radii: (f64, f64), law: impl Into<ContactLaw>) -> SpherePair {
    let sphere = |body, radius| BodySphere::try_new(body, Vector3::zeros(), radius).unwrap();
    SpherePair::try_new(sphere(first, radii.0), sphere(second, radii.1), law).unwrap()
}

fn run<M: for<'a> Stepper<Frozen<'a, System>>>(
    stepper: &M,
    system: &System,
    start: &Bodies,
    end: f64,
    dt: f64,
) -> Located<Vec<Pose>, EventKind> {
    let grid = TimeGrid::try_new(0.0, end, dt).unwrap();
    Run::by_stepper(system, stepper, grid).locating(Location::as_given()).from(start).unwrap()
}

/// Momentum, and angular momentum about the origin.
fn momenta(system: &System, x: &Bodies) -> (Vector3<f64>, Vector3<f64>) {
    let mut sum = (Vector3::zeros(), Vector3::zeros());
    for (i, body) in system.bodies().iter().enumerate() {
        let state = State { configuration: x.configuration[i], rate: x.rate[i] };
        let momentum = state.velocity() * body.mass();
        sum.0 += momentum;
        sum.1 += state.position().cross(&momentum) + body.angular_momentum(&state);
    }
    sum
}

fn energy(system: &System, x: &Bodies) -> f64 {
    let kinetic: f64 = system
        .bodies()
        .iter()
        .enumerate()
        .map(|(i, b)| b.kinetic_energy(&State { configuration: x.configuration[i], rate: x.rate[i] }))
        .sum();
    kinetic + system.interaction().energy(system.bodies(), x)
}

/// Positions, orientations, velocities and angular velocities taken together.
fn distance(x: &Bodies, y: &Bodies) -> f64 {
    let poses = x.configuration.iter().zip(&y.configuration);
    let rates = x.rate.iter().zip(&y.rate);
    let of_poses = poses.map(|(a, b)| {
        (a.position - b.position).norm_squared() + so3::angle_between(&a.orientation, &b.orientation).powi(2)
    });
    let of_rates =
        rates.map(|(u, v)| (u.linear - v.linear).norm_squared() + (u.angular - v.angular).norm_squared());
    (of_poses.sum::<f64>() + of_rates.sum::<f64>()).sqrt()
}

fn at(positions: &[f64], velocities: &[f64]) -> Bodies {
    let pose = |x: &f64| Pose { position: Vector3::x() * *x, ..Pose::default() };
    let twist = |v: &f64| Twist { linear: Vector3::x() * *v, ..Twist::default() };
    State {
        configuration: positions.iter().map(pose).collect(),
        rate: velocities.iter().map(twist).collect(),
    }
}

#[test]
fn contacts_of_pairs_exert_no_net_force_or_torque() {
    let resistance = Resistance::try_new(1e-3, 2e-3, 0.1).unwrap();
    let compliant = ContactLaw::from(CompliantLaw::try_new(1e4, 10.0).unwrap());
    let laws = [
        compliant.clone().with_friction(CoulombFriction::try_new(0.3, 0.0, 100.0).unwrap()),
        compliant.with_friction(RegularisedFriction::try_new(0.3, 0.1).unwrap()),
        ContactLaw::from(HuntCrossley::try_new(1e5, 0.1).unwrap()),
    ];
    for law in laws.map(|law| law.with_resistance(resistance)) {
        // Off the centres of mass, turned and turning.
        let sphere = |body, centre, radius| BodySphere::try_new(body, centre, radius).unwrap();
        let pair = SpherePair::try_new(
            sphere(0, Vector3::new(0.1, 0.02, -0.03), 0.2),
            sphere(1, Vector3::new(-0.04, 0.05, 0.01), 0.3),
            law.clone(),
        )
        .unwrap();
        let contacts = BodyContacts::try_new(2, vec![], vec![pair]).unwrap();
        let bodies = [ball(1.0, 0.2), ball(2.0, 0.3)];
        let mut x = at(&[0.0, 0.6], &[1.0, -0.5]);
        x.configuration[0].orientation = UnitQuaternion::new(Vector3::new(0.1, 0.2, 0.3));
        x.configuration[1].orientation = UnitQuaternion::new(Vector3::new(-0.3, 0.1, -0.2));
        (x.rate[0].angular, x.rate[1].angular) = (Vector3::new(1.0, 2.0, 3.0), Vector3::new(-4.0, 1.0, 2.0));
        x.configuration[1].position = Vector3::new(0.4, 0.1, -0.1);
        let mut wrenches = vec![Twist::default(); 2];
        contacts.add_wrenches(0.0, &bodies, &x, &mut wrenches);
        let force = wrenches[0].linear + wrenches[1].linear;
        let about = |i: usize| x.configuration[i].position.cross(&wrenches[i].linear) + wrenches[i].angular;
        let size = wrenches[0].linear.norm();
        assert!(size > 1.0 && wrenches[0].angular.norm() > 0.01, "{wrenches:?}");
        assert!(force.norm() < 1e-15 * size, "{law:?}: {force:?}");
        assert!((about(0) + about(1)).norm() < 1e-15 * size, "{law:?}: {:?}", about(0) + about(1));
    }
}

#[test]
fn a_central_impact_of_two_balls_has_the_restitution_asked() {
    let (m, n) = (1.0, 3.0);
    let effective = m * n / (m + n);
    for e in [1.0, 0.8, 0.4] {
        let compliant = CompliantLaw::from_restitution(effective, 1e4, e).unwrap();
        let hertz = HuntCrossley::from_restitution(1e5, e, 3.0).unwrap();
        for (law, bound) in [(ContactLaw::from(compliant), 1e-10), (ContactLaw::from(hertz), 1e-8)] {
            let contacts = BodyContacts::try_new(2, vec![], vec![pair(0, 1, (0.1, 0.15), law)]).unwrap();
            let system = free(vec![ball(m, 0.1), ball(n, 0.15)], contacts);
            let start = at(&[0.0, 0.26], &[2.0, -1.0]);
            let run = run(&RungeKuttaMuntheKaas(Dop853), &system, &start, 0.2, 2e-5);
            let kinds: Vec<_> = run.events.iter().map(|e| e.kind).collect();
            assert_eq!(kinds, [EventKind::TouchDown, EventKind::Release]);
            let (v, w) = (run.state.rate[0].linear.x, run.state.rate[1].linear.x);
            let mean = (m * 2.0 - n) / (m + n);
            assert!(((w - v) / 3.0 - e).abs() < bound, "{e}: {:e}", (w - v) / 3.0 - e);
            assert!((m * v + n * w - (m + n) * mean).abs() < 1e-14, "{e}");
            let impulse = effective * 3.0 * (1.0 + e);
            assert!(
                (run.events[1].impulse - impulse).abs() < 1e-7,
                "{e}: {:e}",
                run.events[1].impulse - impulse
            );
        }
    }
}

/// Two spinning balls that meet off centre.
fn collision() -> (System, Bodies) {
    let law = ContactLaw::from(CompliantLaw::try_new(2e3, 3.0).unwrap())
        .with_friction(CoulombFriction::try_new(0.3, 0.0, 20.0).unwrap());
    let contacts = BodyContacts::try_new(2, vec![], vec![pair(0, 1, (0.1, 0.12), law)]).unwrap();
    let system = free(vec![ball(1.0, 0.1), ball(1.5, 0.12)], contacts);
    let mut start = at(&[0.0, 0.3], &[1.0, -0.6]);
    start.configuration[1].position += Vector3::new(0.0, 0.06, 0.03);
    start.rate[0].angular = Vector3::new(5.0, -8.0, 12.0);
    start.rate[1].angular = Vector3::new(-3.0, 6.0, 9.0);
    (system, start)
}

#[test]
fn two_colliding_spinning_balls_keep_the_order_and_the_momenta() {
    let (system, start) = collision();
    let exact = run(&RungeKuttaMuntheKaas(Dop853), &system, &start, 0.3, 2e-4);
    let kinds: Vec<_> = exact.events.iter().map(|e| e.kind).collect();
    println!("{kinds:?}");
    assert!(kinds.contains(&EventKind::Stick) && kinds.last() == Some(&EventKind::Release));
    let mut points = Vec::new();
    for n in [75, 150, 300, 600] {
        let found = run(&RungeKuttaMuntheKaas4, &system, &start, 0.3, 0.3 / f64::from(n));
        assert_eq!(found.events.len(), exact.events.len());
        points.push((0.3 / f64::from(n), distance(&found.state, &exact.state)));
        let momentum = momenta(&system, &found.state).0 - momenta(&system, &start).0;
        assert!(momentum.norm() < 1e-14, "{n}: {momentum:?}");
    }
    println!("{points:?}");
    assert!((slope(&points) - 4.0).abs() < 0.4, "{} {points:?}", slope(&points));
    let turned = momenta(&system, &exact.state).1 - momenta(&system, &start).1;
    assert!(turned.norm() < 1e-13, "{turned:?}");
    assert!(energy(&system, &exact.state) < energy(&system, &start));
}

#[test]
fn methods_of_the_table_in_every_form_keep_their_order_on_colliding_balls() {
    let (system, start) = collision();
    let exact = run(&RungeKuttaMuntheKaas(Dop853), &system, &start, 0.3, 2e-4);
    let error = |method: Method, n: u64| {
        let grid = TimeGrid::try_with_steps(0.0, 0.3, n).unwrap();
        let run = Run::new(&system, method, grid).locating(Location::as_given());
        let found = run.from(&start).unwrap();
        distance(&found.state, &exact.state)
    };
    for (method, order) in [
        (Method::Rkmk, 4.0),
        (Method::RkmkL, 4.0),
        (Method::RkmkB, 4.0),
        (Method::Heun, 2.0),
        (Method::Lgvi, 2.0),
        (Method::Split2, 2.0),
        (Method::Ab2L, 2.0),
    ] {
        let points: Vec<_> =
            [150, 300, 600, 1200].into_iter().map(|n| (0.3 / n as f64, error(method, n))).collect();
        println!("{method}: {:.2} {points:?}", slope(&points));
        assert!((slope(&points) - order).abs() < 0.4, "{method}: {points:?}");
    }
}

#[test]
fn balls_hit_from_both_sides_at_once_are_handled_together() {
    let law = CompliantLaw::from_restitution(1.0, 1e4, 0.7).unwrap();
    let pairs = vec![pair(0, 1, (0.1, 0.1), law), pair(1, 2, (0.1, 0.1), law)];
    let system = free(vec![ball(1.0, 0.1); 3], BodyContacts::try_new(3, vec![], pairs).unwrap());
    let start = at(&[-0.25, 0.0, 0.25], &[1.0, 0.0, -1.0]);
    let run = run(&RungeKuttaMuntheKaas(Dop853), &system, &start, 0.3, 1e-3);
    assert_eq!(run.events.len(), 4);
    assert!(run.events.chunks(2).all(|both| both[0].t == both[1].t && both[0].kind == both[1].kind));
    let v = |i: usize| run.state.rate[i].linear.x;
    // The one in the middle stays; to the others it is a wall.
    assert_eq!(v(1), 0.0);
    assert!((v(0) + 0.7).abs() < 1e-9 && (v(2) - 0.7).abs() < 1e-9, "{} {}", v(0), v(2));
}

#[test]
fn in_a_cradle_with_gaps_only_the_last_ball_moves_on() {
    let law = CompliantLaw::try_new(1e5, 0.0).unwrap();
    let pairs = (0..3).map(|i| pair(i, i + 1, (0.1, 0.1), law)).collect();
    let system = free(vec![ball(1.0, 0.1); 4], BodyContacts::try_new(4, vec![], pairs).unwrap());
    let start = at(&[-0.3, 0.0, 0.21, 0.42], &[1.0, 0.0, 0.0, 0.0]);
    let run = run(&RungeKuttaMuntheKaas(Dop853), &system, &start, 0.3, 2e-4);
    let guards: Vec<usize> = run.events.iter().map(|e| e.guard).collect();
    assert_eq!(guards, [0, 0, 1, 1, 2, 2]);
    for (i, expected) in [0.0, 0.0, 0.0, 1.0].into_iter().enumerate() {
        let v = run.state.rate[i].linear.x;
        assert!((v - expected).abs() < 1e-10, "{i}: {v}");
    }
}

#[test]
fn a_ball_dropped_on_a_ball_on_the_ground_rests_on_it_by_symmetry() {
    let law = CompliantLaw::try_new(1e4, 60.0).unwrap();
    let ground = Contact::try_ball(Vector3::zeros(), 0.1, Arc::new(HalfSpace::ground()), law).unwrap();
    let contacts = BodyContacts::try_new(2, vec![(0, ground)], vec![pair(0, 1, (0.1, 0.1), law)]).unwrap();
    let bodies = vec![ball(1.0, 0.1); 2];
    let forces = vec![Gravity::earth(); 2];
    let system = System::try_new(bodies, forces, contacts).unwrap();
    let mut start = at(&[0.0, 0.0], &[0.0, 0.0]);
    (start.configuration[0].position.z, start.configuration[1].position.z) = (0.1, 0.35);
    let run = run(&RungeKuttaMuntheKaas4, &system, &start, 3.0, 1e-3);
    // Two weights on the lower spring, one on the upper.
    let lower = 0.1 - 2.0 * 9.81 / 1e4;
    let upper = lower + 0.2 - 9.81 / 1e4;
    let z = |i: usize| run.state.configuration[i].position.z;
    assert!((z(0) - lower).abs() < 1e-12 && (z(1) - upper).abs() < 1e-12, "{} {}", z(0), z(1));
}

#[test]
fn contacts_between_bodies_refuse_bad_input() {
    use ContactError::{Argument, NoBody, NonFinite, SameBody};
    let zero = Vector3::zeros();
    let law = CompliantLaw::try_new(1.0, 0.0).unwrap();
    let sphere = BodySphere::try_new(0, zero, 0.1).unwrap();
    assert!(matches!(
        BodySphere::try_new(0, zero, -0.1),
        Err(Argument(ArgumentError::NotPositive { argument: "radius", .. }))
    ));
    let bad = Vector3::new(0.0, f64::NAN, 0.0);
    assert!(matches!(BodySphere::try_new(0, bad, 0.1), Err(NonFinite { argument: "centre", .. })));
    assert_eq!(SpherePair::try_new(sphere, sphere, law).unwrap_err(), SameBody { body: 0 });
    let contacts = |bodies, pairs| BodyContacts::try_new(bodies, vec![], pairs).map(|_| ());
    assert_eq!(
        contacts(2, vec![pair(0, 2, (0.1, 0.1), law)]),
        Err(NoBody { argument: "pairs", found: 2, bodies: 2 })
    );
    let point = Contact::try_new(zero, Arc::new(HalfSpace::ground()), law).unwrap();
    let error = BodyContacts::try_new(1, vec![(3, point)], vec![]).unwrap_err();
    assert_eq!(error, NoBody { argument: "on_surfaces", found: 3, bodies: 1 });
    // Contacts made for two bodies do not fit a system of one.
    let contacts = BodyContacts::try_new(2, vec![], vec![]).unwrap();
    let error = System::try_new(vec![ball(1.0, 0.1)], vec![Gravity::earth()], contacts).unwrap_err();
    assert_eq!(error, CountMismatch { argument: "interaction", bodies: 1, found: 2 });
}
