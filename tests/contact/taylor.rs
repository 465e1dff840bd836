//! The Taylor series method in contact: against a closed form, and against the method of order 8 in random scenes.

use nalgebra::{UnitQuaternion, Vector3};
use somersault::prelude::*;
use somersault_contact::bodies::{BodiesInContact, BodyContacts};
use somersault_contact::contacts::{BodyInContact, Contact, Contacts};
use somersault_contact::event::EventKind;
use somersault_contact::laws::compliant::CompliantLaw;
use somersault_contact::laws::coulomb::CoulombFriction;
use somersault_contact::laws::{ContactLaw, hunt_crossley::HuntCrossley};
use somersault_contact::models::{BouncingBall, SpinningTop};
use somersault_contact::stretches::WithStretches;
use somersault_contact::studies::{self, Stepping};
use somersault_contact::surface::{HalfSpace, Solid, SphericalSurface, Surface};
use somersault_core::random::SplitMix64;
use somersault_integrators::driver::IntegrateError;
use somersault_integrators::events::{Event, Interruption, Location};
use somersault_integrators::methods::{Dop853, RungeKuttaMuntheKaas, TaylorSeries};
use somersault_integrators::state::{Pose, RigidBodiesState};
use somersault_integrators::stepper::StepError;
use somersault_integrators::studies::silent;
use somersault_testkit::bouncing_ball;
use std::sync::Arc;

/// Here methods are given by their types, so that of the table no others are compiled for the systems of these tests.
const RKMK8: RungeKuttaMuntheKaas<Dop853> = RungeKuttaMuntheKaas(Dop853);

fn adapted(end: f64, tolerance: f64) -> Steps {
    Steps::adapted((0.0, end), Adaptive::with_tolerances(tolerance, tolerance))
}

#[test]
fn a_ball_bounces_as_in_closed_form() {
    let exact = bouncing_ball::BouncingBall { mass: 1.0, stiffness: 400.0, damping: 4.0, gravity: 9.81 };
    let drop = bouncing_ball::Motion { x: 0.5, v: 0.0 };
    let law = CompliantLaw::try_new(exact.stiffness, exact.damping).unwrap();
    let ball = BouncingBall::try_new(exact.mass, 0.1, law).unwrap();
    let (end, switches) = exact.run(drop, 1.3);
    let run = Run::new(&ball.system, Method::Taylor16, adapted(1.3, 1e-12)).locating(Location::default());
    let found = run.from(&ball.at(drop.x, drop.v)).unwrap();
    let error = (found.state.position().z - 0.1 - end.x).hypot(found.state.velocity().z - end.v);
    assert!(error < 1e-11, "{error:e}");
    for (event, switch) in found.events.iter().zip(&switches) {
        assert!((event.t - switch.t).abs() < 1e-12, "{} {}", event.t, switch.t);
    }
    assert_eq!(found.events.len(), switches.len());
}

#[test]
fn the_order_is_kept_through_the_events_of_the_top() {
    let problem = studies::spinning_top(&SpinningTop::thesis().unwrap(), 0.1).unwrap();
    let dts: Vec<f64> = (0..6).map(|k| 8e-3 * 0.5f64.powf(0.25 * f64::from(k))).collect();
    let (options, stepping) = (Options::default(), Stepping::Located);
    let study =
        studies::convergence(&problem, Method::Taylor16, options, stepping, &dts, 8, &mut silent).unwrap();
    for found in [study.orders.orientation, study.orders.velocity, study.orders.angular_velocity] {
        assert!(found.is_some_and(|order| order > 15.0), "{study:?}");
    }
}

struct Scene {
    body: RigidBody,
    contacts: Vec<Contact>,
    forces: (Gravity, ConstantForce),
    start: RigidBodyState,
}

/// A body with points and balls above two planes, thrown.
fn scene(seed: u64) -> Scene {
    let mut random = SplitMix64::new(seed);
    let mut vector = |size: f64| Vector3::from_fn(|_, _| size * (2.0 * random.unit() - 1.0));
    let turn = UnitQuaternion::from_scaled_axis(vector(2.0));
    let inertia = Inertia::try_box(0.7, Vector3::new(0.2, 0.3, 0.5)).unwrap().rotated(&turn).unwrap();
    let planes: [Arc<dyn Surface>; 2] = [
        Arc::new(HalfSpace::ground()),
        Arc::new(HalfSpace::try_new(vector(0.1), Vector3::z() + vector(0.4)).unwrap()),
    ];
    let contacts = (0..4)
        .map(|i| {
            let spring = 400.0 * (1.2 + vector(1.0).x);
            let law = CompliantLaw::try_new(spring, 4.0 * (1.0 + vector(1.0).y)).unwrap();
            let place = vector(0.2);
            if i % 2 == 0 {
                Contact::try_new(place, planes[i / 2].clone(), law).unwrap()
            } else {
                Contact::try_ball(place, 0.05, planes[i / 2].clone(), law).unwrap()
            }
        })
        .collect();
    let force = ConstantForce { force: vector(1.0), point: vector(0.1) };
    let orientation = UnitQuaternion::from_scaled_axis(vector(3.0));
    let start = RigidBodyState::new(Vector3::new(0.0, 0.0, 0.6), orientation, vector(1.0), vector(4.0));
    let body = RigidBody::try_new(0.7, inertia).unwrap();
    Scene { body, contacts, forces: (Gravity::earth(), force), start }
}

fn gap(a: &RigidBodyState, b: &RigidBodyState) -> f64 {
    (a.position() - b.position()).norm() + a.orientation().angle_to(b.orientation())
}

/// Each contact amplifies errors, by less than a thousand here.
#[test]
fn random_bodies_on_planes_move_as_by_another_method() {
    let mut events = 0;
    for seed in 0..20 {
        let Scene { body, contacts, forces, start } = scene(seed);
        let system = BodyInContact::new(body, (forces, Contacts::new(contacts)));
        let series = Run::by_embedded_stepper(&system, &TaylorSeries, adapted(0.7, 1e-12));
        let found = series.locating(Location::default()).from(&start).unwrap();
        let order_8 = Run::by_embedded_stepper(&system, &RKMK8, adapted(0.7, 1e-13));
        let fine = order_8.locating(Location::default()).from(&start).unwrap();
        let kinds = |events: &[Event<Pose, EventKind>]| -> Vec<_> {
            events.iter().map(|event| (event.guard, event.kind)).collect()
        };
        assert_eq!(kinds(&found.events), kinds(&fine.events), "{seed}");
        assert!(gap(&found.state, &fine.state) < 1e-9, "{seed}: {:e}", gap(&found.state, &fine.state));
        events += found.events.len();
    }
    assert!(events > 60, "{events}");
}

/// With stretches, and for several bodies, the same steps are made.
#[test]
fn the_same_body_moves_the_same_in_every_system() {
    let Scene { body, contacts, forces, start } = scene(3);
    let system = BodyInContact::new(body, (forces, Contacts::new(contacts.clone())));
    let grid = TimeGrid::try_with_steps(0.0, 0.6, 60).unwrap();
    let run = Run::by_stepper(&system, &TaylorSeries, grid).locating(Location::default());
    let alone = run.from(&start).unwrap();
    assert!(alone.events.len() > 2);

    let with = WithStretches(&system);
    let run = Run::by_stepper(&with, &TaylorSeries, grid).locating(Location::default());
    assert_eq!(run.from(&with.unstretched(start)).unwrap().state.base(), alone.state);

    let on_surfaces = contacts.into_iter().map(|contact| (1, contact)).collect();
    let both = BodyContacts::try_new(2, on_surfaces, vec![]).unwrap();
    let both = BodiesInContact::try_new(vec![body; 2], vec![forces; 2], both).unwrap();
    let states = RigidBodiesState::from_bodies(&[start; 2]);
    let run =
        Run::by_stepper(&both, &TaylorSeries, grid).locating(Location::default()).from(&states).unwrap();
    assert_eq!(run.state.body(1), Some(alone.state));
    assert_eq!(run.events.len(), alone.events.len());
}

#[test]
fn contacts_without_series_are_refused_before_they_touch() {
    let Scene { body, forces, start, .. } = scene(1);
    let plane: Arc<dyn Surface> = Arc::new(HalfSpace::ground());
    let bowl: Arc<dyn Surface> =
        Arc::new(SphericalSurface::try_new(Vector3::z() * 5.0, 5.0, Solid::Outside).unwrap());
    let law = CompliantLaw::try_new(400.0, 4.0).unwrap();
    let rough = ContactLaw::from(law).with_friction(CoulombFriction::try_new(0.3, 1e3, 1.0).unwrap());
    let hard = HuntCrossley::try_new(1e4, 0.3).unwrap();
    for contact in [
        Contact::try_new(Vector3::x(), plane.clone(), rough).unwrap(),
        Contact::try_new(Vector3::x(), plane.clone(), hard).unwrap(),
        Contact::try_new(Vector3::x(), bowl, law).unwrap(),
        Contact::try_rim(Vector3::zeros(), Vector3::z(), 0.1, HalfSpace::ground(), law).unwrap(),
    ] {
        let system = BodyInContact::new(body, (forces, Contacts::new(vec![contact])));
        let with = WithStretches(&system);
        let run =
            Run::by_embedded_stepper(&with, &TaylorSeries, adapted(1.0, 1e-9)).locating(Location::default());
        let error = run.from(&with.unstretched(start)).unwrap_err().reason;
        let refused = StepError::NoSeries { method: "taylor16" };
        assert_eq!(error, Interruption::Integrate(IntegrateError::Step(refused)));
    }
}
