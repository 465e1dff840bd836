//! Steps too long for a contact gain no energy: they are divided, or refused by name.

use nalgebra::Vector3;
use somersault_contact::bodies::{BodiesInContact, BodyContacts, BodySphere, SpherePair};
use somersault_contact::contacts::{BodyInContact, Contact, Contacts};
use somersault_contact::laws::ContactLaw;
use somersault_contact::laws::compliant::CompliantLaw;
use somersault_contact::laws::hunt_crossley::HuntCrossley;
use somersault_contact::models::FallingBox;
use somersault_contact::surface::HalfSpace;
use somersault_core::{Inertia, lie::so3};
use somersault_integrators::body::RigidBody;
use somersault_integrators::driver::TimeGrid;
use somersault_integrators::events::{HybridBodies, Interruption, LocatedResult, Location, StiffSteps};
use somersault_integrators::force::Gravity;
use somersault_integrators::methods::Method;
use somersault_integrators::run::Run;
use somersault_integrators::state::{Pose, RigidBodyState, State};
use somersault_integrators::system::StateOf;
use std::sync::Arc;

const STIFFNESS: f64 = 1e6;

fn ball(mass: f64) -> RigidBody {
    RigidBody::try_new(mass, Inertia::try_sphere(mass, 0.05).unwrap()).unwrap()
}

fn dropped(law: impl Into<ContactLaw>, gravity: f64) -> BodyInContact<Gravity> {
    let contact = Contact::try_new(Vector3::zeros(), Arc::new(HalfSpace::ground()), law).unwrap();
    let gravity = Gravity { acceleration: Vector3::new(0.0, 0.0, -gravity) };
    BodyInContact::new(ball(1.0), (gravity, Contacts::new(vec![contact])))
}

fn at(z: f64, velocity: f64) -> RigidBodyState {
    let mut state = RigidBodyState::default();
    (state.configuration.position.z, state.rate.linear.z) = (z, velocity);
    state
}

fn run<H: HybridBodies>(
    method: Method,
    system: &H,
    start: &StateOf<H>,
    end: f64,
    dt: f64,
    stiff: StiffSteps,
) -> LocatedResult<H> {
    let location = Location { stiff, ..Location::default() };
    let grid = TimeGrid::try_new(0.0, end, dt).unwrap();
    Run::new(system, method, grid).locating(location).from(start)
}

/// The energy at the end relative to that at the start, or nothing where the run is refused by name.
fn energy_left<H: HybridBodies>(
    method: Method,
    system: &H,
    start: &StateOf<H>,
    (end, dt): (f64, f64),
    energy: impl Fn(&StateOf<H>) -> f64,
) -> Option<f64> {
    match run(method, system, start, end, dt, Location::default().stiff) {
        Ok(found) => Some(energy(&found.state) / energy(start)),
        Err(broken) => match broken.reason {
            Interruption::EnergyGain { .. } | Interruption::StepTooLong { .. } => None,
            other => panic!("{method} {dt}: {other}"),
        },
    }
}

/// From a tenth of the longest stable step of the contact to a hundred times it.
fn steps(rate: f64) -> impl Iterator<Item = f64> {
    (0..7).map(move |i| 2.8 / rate * 0.1 * 1000f64.powf(f64::from(i) / 6.0))
}

const METHODS: [Method; 9] = [
    Method::Heun,
    Method::Rk4,
    Method::RkmkB,
    Method::Rkmk5,
    Method::Rkmk8B,
    Method::Ab4,
    Method::Sv,
    Method::Split4,
    Method::Lgvi,
];

#[test]
fn a_ball_that_bounces_gains_no_energy_at_any_step() {
    let (rate, mut refused, mut total) = (STIFFNESS.sqrt(), 0, 0);
    for ratio in [0.0, 0.05, 0.5, 2.0] {
        let damping = 2.0 * ratio * rate;
        let system = dropped(CompliantLaw::try_new(STIFFNESS, damping).unwrap(), 9.81);
        let spring = |x: &RigidBodyState| 0.5 * STIFFNESS * x.position().z.min(0.0).powi(2);
        let energy =
            |x: &RigidBodyState| 0.5 * x.velocity().norm_squared() + 9.81 * x.position().z + spring(x);
        for dt in steps(rate.max(damping)) {
            for method in METHODS {
                let left = energy_left(method, &system, &at(0.5, 0.0), (1.0, dt), energy);
                total += 1;
                refused += u32::from(left.is_none());
                assert!(left.is_none_or(|e| e < 1.0 + 1e-6), "{method} {dt} {ratio}: {left:?}");
                let info = method.info();
                assert!(left.is_some() || info.orders.translation < 4 || info.history > 0, "{method} {dt}");
            }
        }
    }
    println!("{refused} of {total} refused");
    assert!(refused * 4 < total, "{refused} of {total}");
}

#[test]
fn a_ball_at_a_wall_gains_no_energy_by_methods_that_would_give_it_some() {
    let (rate, mut refused) = (STIFFNESS.sqrt(), 0);
    for damping in [0.0, 0.1 * rate, rate] {
        let system = dropped(CompliantLaw::try_new(STIFFNESS, damping).unwrap(), 0.0);
        let energy = |x: &RigidBodyState| 0.5 * x.velocity().norm_squared();
        for dt in steps(rate) {
            for method in [Method::Euler, Method::Sie, Method::Mp, Method::Heun, Method::Ab2, Method::Siabm2]
            {
                let left = energy_left(method, &system, &at(0.1, -2.0), (0.2, dt), energy);
                refused += u32::from(left.is_none());
                assert!(left.is_none_or(|e| e < 1.0 + 1e-6), "{method} {dt} {damping}: {left:?}");
            }
        }
    }
    // Euler's method gives energy to an oscillator without damping whatever the step.
    assert!(refused > 0);
}

#[test]
fn hunt_and_crossleys_law_gains_no_energy_at_any_step() {
    for loss in [0.0, 0.3] {
        let stiffness = 1e8;
        let system = dropped(HuntCrossley::try_new(stiffness, loss).unwrap(), 9.81);
        let spring = |x: &RigidBodyState| 0.4 * stiffness * (-x.position().z).max(0.0).powf(2.5);
        let energy =
            |x: &RigidBodyState| 0.5 * x.velocity().norm_squared() + 9.81 * x.position().z + spring(x);
        // Of a fall from half a metre: x = (5/4 m v²/k)^{2/5}, k = 3/2 k √x.
        let depth = (1.25 * 9.81 / stiffness).powf(0.4);
        for dt in steps((1.5 * stiffness * depth.sqrt()).sqrt()) {
            for method in [Method::Rk4, Method::Rkmk5, Method::Rkmk8B, Method::Ab4] {
                let left = energy_left(method, &system, &at(0.5, 0.0), (1.0, dt), energy);
                assert!(left.is_none_or(|e| e < 1.0 + 1e-6), "{method} {dt} {loss}: {left:?}");
            }
        }
    }
}

#[test]
fn two_spheres_gain_no_energy_at_any_step() {
    let law = CompliantLaw::try_new(STIFFNESS, 20.0).unwrap();
    let spheres = [0, 1].map(|i| BodySphere::try_new(i, Vector3::zeros(), 0.05).unwrap());
    let pair = SpherePair::try_new(spheres[0], spheres[1], law).unwrap();
    let contacts = BodyContacts::try_new(2, vec![], vec![pair]).unwrap();
    let none = Gravity { acceleration: Vector3::zeros() };
    let system = BodiesInContact::try_new(vec![ball(0.1), ball(2.0)], vec![none, none], contacts).unwrap();
    let mut start = State { configuration: vec![Pose::default(); 2], rate: vec![Default::default(); 2] };
    start.configuration[0].position = Vector3::new(-0.3, 0.03, 0.0);
    start.rate[0].linear.x = 5.0;
    let energy = |x: &State<Vec<Pose>>| {
        let span = (x.configuration[0].position - x.configuration[1].position).norm() - 0.1;
        0.05 * x.rate[0].linear.norm_squared()
            + x.rate[1].linear.norm_squared()
            + 0.5 * STIFFNESS * span.min(0.0).powi(2)
    };
    for dt in steps((STIFFNESS * 10.5).sqrt()) {
        for method in [Method::Rk4, Method::Rkmk5, Method::Rkmk8B, Method::Ab4, Method::Sv] {
            let left = energy_left(method, &system, &start, (0.2, dt), energy);
            assert!(left.is_none_or(|e| e < 1.0 + 1e-6), "{method} {dt}: {left:?}");
        }
    }
}

#[test]
fn a_tumbling_box_gains_no_energy_at_any_step() {
    let law = CompliantLaw::try_new(STIFFNESS, 30.0).unwrap();
    let model = FallingBox::try_new(1.0, Vector3::new(0.3, 0.2, 0.1), law).unwrap();
    let mut start = model.on_corner(0.1, 0.4);
    start.configuration.orientation =
        so3::exp(&Vector3::new(0.3, 0.2, 0.1)) * start.configuration.orientation;
    start.rate.angular = Vector3::new(1.0, -2.0, 0.5);
    let system = &model.system;
    let energy = |x: &RigidBodyState| {
        system.body.kinetic_energy(x) + 9.81 * x.position().z + system.forces.1.energy(x)
    };
    // A corner moves about a third of the mass.
    for dt in steps((3.0 * STIFFNESS).sqrt()) {
        for method in [Method::Rk4, Method::Rkmk5B, Method::Rkmk8B] {
            let left = energy_left(method, system, &start, (0.5, dt), energy);
            assert!(left.is_some_and(|e| e < 1.0 + 1e-6), "{method} {dt}: {left:?}");
        }
    }
}

#[test]
fn the_parts_of_a_step_are_counted_and_a_limit_refuses_it() {
    let system = dropped(CompliantLaw::try_new(STIFFNESS, 100.0).unwrap(), 9.81);
    let start = at(0.5, 0.0);
    let free = run(Method::Rkmk8B, &system, &start, 0.3, 0.01, Location::default().stiff).unwrap();
    assert_eq!((free.event_count, free.substeps), (0, 0));
    let divided = run(Method::Rkmk8B, &system, &start, 0.5, 0.01, Location::default().stiff).unwrap();
    // ω = 1000/s, so that a contact of 3 ms takes about three steps of a millisecond.
    assert_eq!(divided.event_count, 2);
    assert!((3..8).contains(&divided.substeps), "{}", divided.substeps);
    let fine = run(Method::Rkmk8B, &system, &start, 0.5, 1e-5, Location::default().stiff).unwrap();
    assert_eq!(fine.substeps, 0);
    assert!((divided.state.velocity().z / fine.state.velocity().z - 1.0).abs() < 1e-5);
    let broken = run(Method::Rkmk8B, &system, &start, 0.5, 0.01, StiffSteps::Divide { most: 1 }).unwrap_err();
    assert!(
        matches!(broken.reason, Interruption::StepTooLong { dt: 0.01, parts: 10.0, most: 1, .. }),
        "{}",
        broken.reason
    );
    assert_eq!(broken.so_far.event_count, 1);
}

#[test]
fn a_method_that_cannot_but_gain_energy_is_refused_by_name() {
    let system = dropped(CompliantLaw::try_new(STIFFNESS, 0.0).unwrap(), 0.0);
    let found = run(Method::Euler, &system, &at(0.1, -2.0), 0.2, 1e-3, Location::default().stiff);
    let reason = found.unwrap_err().reason;
    assert!(matches!(reason, Interruption::EnergyGain { .. }), "{reason}");
    // As given, a step fifty times as long as the contact allows throws the ball off.
    let thrown = |stiff| run(Method::Rkmk5, &system, &at(0.1, -2.0), 0.2, 0.05, stiff).unwrap();
    let [given, divided] =
        [StiffSteps::AsGiven, Location::default().stiff].map(|stiff| thrown(stiff).state.velocity().norm());
    assert!(given > 1e6 && divided < 2.000_001, "{given} {divided}");
}
