//! Spatial trees against another program: two links on a ball joint in a bowl, and a wheel on a table that shakes, with friction.
//!
//! The literals are printed by tests/derivations/spatial_trees_in_contact.py: Pinocchio and DOP853 in pieces between located events.

use crate::{Motions, RKMK8, passive};
use nalgebra::{Matrix3, UnitQuaternion, Vector3};
use somersault_contact::contacts::Contact;
use somersault_contact::laws::ContactLaw;
use somersault_contact::laws::compliant::CompliantLaw;
use somersault_contact::laws::coulomb::CoulombFriction;
use somersault_contact::surface::{HalfSpace, Solid, SphericalSurface, Surface};
use somersault_contact::tree::{
    LinkContact, LinkPair, PlatformMotion, TouchingState, TreeInContact, TreeOnPlatforms,
};
use somersault_integrators::driver::{Adaptive, Steps};
use somersault_integrators::events::Location;
use somersault_integrators::run::Run;
use somersault_multibody::motion::{JointDrive, TreeForces, TreeSystem};
use somersault_multibody::{Joint, Link, MassProperties, Model};
use std::sync::Arc;

/// Mass, height of the centre of mass and moments of inertia about it.
type Solid3 = (f64, f64, [f64; 3]);

/// A free link and another one on a joint at a height of it.
fn tree(links: [Solid3; 2], joint: Joint, height: f64) -> Model {
    let [first, second] = links.map(|(mass, center, moments)| MassProperties {
        mass,
        center: Vector3::z() * center,
        inertia: Matrix3::from_diagonal(&Vector3::from(moments)),
    });
    let mut builder = Model::builder();
    builder.add(Link::root("first", Joint::Free, first)).unwrap();
    builder.add(Link::child("second", "first", joint, second).at(Vector3::z() * height)).unwrap();
    builder.build().unwrap()
}

fn law([k, c, mu, kt, ct]: [f64; 5]) -> ContactLaw {
    let friction = CoulombFriction::try_new(mu, kt, ct).unwrap();
    ContactLaw::from(CompliantLaw::try_new(k, c).unwrap()).with_friction(friction)
}

fn turned(turn: [f64; 3]) -> [f64; 4] {
    UnitQuaternion::new(Vector3::from(turn)).coords.into()
}

/// Where a run ends: its time, number of events, the times of the first and the last, q and v.
struct End<'a> {
    time: f64,
    events: (usize, [f64; 2]),
    q: &'a [f64],
    v: &'a [f64],
    tolerance: f64,
}

fn compare<F: TreeForces, D: JointDrive>(
    system: &TreeInContact<'_, F, D>,
    start: &TouchingState,
    end: &End<'_>,
) {
    let steps = Steps::adapted((0.0, end.time), Adaptive::with_tolerances(1e-13, 1e-13));
    let run =
        Run::by_embedded_stepper(system, &RKMK8, steps).locating(Location::default()).from(start).unwrap();
    let mut v = vec![0.0; system.model().n_velocities()];
    system.model().joint_velocities(&run.state.base(), &mut v).unwrap();
    let found = [run.state.configuration.0.as_slice(), &v];
    let off = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    let last = [run.events[0].t, run.events[run.events.len() - 1].t];
    println!(
        "q {:e}, v {:e}, events {:e}",
        off(found[0], end.q),
        off(found[1], end.v),
        off(&last, &end.events.1)
    );
    assert_eq!(run.events.len(), end.events.0);
    assert!(off(&last, &end.events.1) < end.tolerance, "{last:?}");
    assert!(off(found[0], end.q) < end.tolerance && off(found[1], end.v) < end.tolerance, "{found:?}");
}

/// Balls on a bowl and a pair of balls stick and slip, their stretches turning with three curved planes. By 1e-11 and 1e-13 the
/// reference differs by 1.5e-11, and an end moves 175 times as far as the start.
#[test]
fn links_in_a_bowl_to_the_digits_of_the_reference() {
    let links = [(1.0, -0.12, [0.010, 0.012, 0.004]), (0.7, -0.1, [0.006, 0.005, 0.002])];
    let model = tree(links, Joint::Spherical, -0.25);
    let bowl: Arc<dyn Surface> =
        Arc::new(SphericalSurface::try_new(Vector3::z(), 1.0, Solid::Outside).unwrap());
    let law = law([2e4, 40.0, 0.4, 1.5e4, 50.0]);
    let ball = |name, link, height: f64, radius| {
        let contact = Contact::try_ball(Vector3::z() * height, radius, bowl.clone(), law.clone()).unwrap();
        LinkContact::new(name, link, contact)
    };
    let touches = vec![ball("head", "first", 0.0, 0.05), ball("tip", "second", -0.22, 0.04)];
    let (a, b) = (Vector3::new(0.1, 0.0, -0.05), Vector3::new(0.1, 0.0, -0.12));
    let pair = LinkPair::try_new("clap", ("first", a, 0.06), ("second", b, 0.05), law.clone()).unwrap();
    let system = TreeInContact::try_new(TreeSystem::new(&model, passive()), touches, vec![pair]).unwrap();
    let q = [&[0.0, 0.0, 0.62][..], &turned([0.3, 0.5, 0.2]), &turned([0.2, -0.4, 0.1])].concat();
    let v = [0.4, 0.2, 0.0, 1.0, 0.5, -0.8, 0.5, -7.0, 0.6];
    let end = End {
        time: 0.4,
        events: (18, [0.19877597848835402, 0.39086494393525395]),
        q: &[
            0.05611086080019,
            0.1637251369924,
            0.09519256977525,
            -0.04223541575372,
            -0.0227064927904,
            -0.5577844180151,
            0.8285994978642,
            0.7983699139619,
            0.5930431343533,
            0.1043753953701,
            0.003331383827071,
        ],
        v: &[
            -0.9264544235083,
            2.302537568902,
            -0.3376542912553,
            -12.24487174205,
            -9.412187340215,
            -4.241159818781,
            12.91881308988,
            13.44289190291,
            -7.889437834845,
        ],
        tolerance: 3e-11,
    };
    compare(&system, &system.unstretched(model.state(&q, &v).unwrap()), &end);
}

/// A rim of a wheel with a pendulum rolls and slips on a table that moves by 0.15 m sin 9 t. By 1e-11 and 1e-13 the reference differs
/// by 5e-12, and an end moves 71 times as far as the start.
#[test]
fn a_wheel_on_a_shaking_table_to_the_digits_of_the_reference() {
    let links = [(1.2, 0.0, [0.013, 0.025, 0.013]), (0.5, -0.12, [0.003, 0.003, 0.001])];
    let scene =
        TreeOnPlatforms::try_new(&tree(links, Joint::Revolute { axis: Vector3::y() }, 0.0), &["table"])
            .unwrap();
    let shaking = |t: f64, _: usize| {
        let (s, c) = (9.0 * t).sin_cos();
        PlatformMotion {
            position: Vector3::x() * (0.15 * s),
            velocity: Vector3::x() * (1.35 * c),
            acceleration: Vector3::x() * (-12.15 * s),
            ..PlatformMotion::default()
        }
    };
    let rim = |(k, side): (usize, f64)| {
        let law = law([2e4, 60.0, 0.4, 1.5e4, 60.0]);
        let centre = Vector3::y() * side;
        let contact = Contact::try_rim(centre, Vector3::y(), 0.2, HalfSpace::ground(), law).unwrap();
        LinkContact::new(format!("rim {k}"), "first", contact).on("table")
    };
    let touches = [-0.03, 0.03].into_iter().enumerate().map(rim).collect();
    let system =
        TreeInContact::try_new(scene.system((), &shaking as Motions<'_>).unwrap(), touches, vec![]).unwrap();
    let q = [&[0.0, 0.0, 0.24][..], &turned([0.25, 0.0, 0.1]), &[0.8]].concat();
    let v = [0.8, 0.1, 0.0, 0.3, 2.0, 0.1, 1.5];
    let (q, v) = scene.start(&q, &v, |k| shaking(0.0, k)).unwrap();
    let end = End {
        time: 0.7,
        events: (13, [0.09206157835720497, 0.5997900925620374]),
        q: &[
            0.2793043236159,
            -0.1689472817175,
            0.149247119535,
            0.2295002591084,
            0.3688203056399,
            0.8255529249526,
            0.3602271246299,
            -4.862800760557,
        ],
        v: &[
            -0.2735987647205,
            0.2477896765522,
            0.2428693340995,
            -3.058119320331,
            3.705429810908,
            -4.066148550593,
            -8.112476954636,
        ],
        tolerance: 1e-11,
    };
    compare(&system, &system.unstretched(scene.model().state(&q, &v).unwrap()), &end);
}
