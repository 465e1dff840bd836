//! What the named models do.

use crate::RKMK8;
use somersault_contact::event::EventKind::{self, Release, Slip, Stick, TouchDown};
use somersault_contact::laws::ContactMode;
use somersault_contact::models::{
    JointActuator, ModelError, PlanarBiped, Quadruped, Ragdoll, Springboard, TreeContactSystem,
};
use somersault_contact::tree::{Ledger, TouchingState, TreeInContact};
use somersault_integrators::driver::{Adaptive, Steps};
use somersault_integrators::events::Location;
use somersault_integrators::run::Run;
use somersault_multibody::motion::TreeForces;

/// State at a time, and what happened at which contact.
fn run(scene: &TreeContactSystem, end: f64) -> (TouchingState, Vec<(String, EventKind)>) {
    let system = scene.in_contact().unwrap();
    let start = system.unstretched(scene.start().unwrap());
    let steps = Steps::adapted((0.0, end), Adaptive::with_tolerances(1e-8, 1e-10));
    let run =
        Run::by_embedded_stepper(&system, &RKMK8, steps).locating(Location::default()).from(&start).unwrap();
    // guards are those of gaps, and then those of friction
    let name = |guard: usize| scene.contacts[guard % scene.contacts.len()].name().to_owned();
    (run.state, run.events.iter().map(|event| (name(event.guard), event.kind)).collect())
}

fn energy<F: TreeForces>(system: &TreeInContact<'_, F>, x: &TouchingState) -> f64 {
    let Ledger { kinetic, potential, elastic, .. } = system.ledger(x);
    kinetic + potential + elastic
}

#[test]
fn actuators_drive_joints_of_one_degree_of_freedom() {
    let model = PlanarBiped::example().unwrap().system().unwrap().model;
    let refused = JointActuator::at_joint_of(&model, "trunk").unwrap_err();
    assert_eq!(refused.to_string(), "the joint of `trunk` must have one degree of freedom, found 3");
    assert!(matches!(JointActuator::at_joint_of(&model, "tail"), Err(ModelError::Dynamics(_))));
    let springboard = Springboard { length: f64::NAN, ..Springboard::example().unwrap() };
    assert_eq!(
        springboard.system().unwrap_err().to_string(),
        "`length` must lie between 0 and 20, found NaN"
    );
}

#[test]
fn a_planar_biped_steps_from_its_left_foot_to_its_right_one() {
    let (_, events) = run(&PlanarBiped::example().unwrap().system().unwrap(), 1.0);
    let first = [("left foot", TouchDown), ("left foot", Stick), ("right foot", TouchDown)];
    let found: Vec<_> = events.iter().map(|(name, kind)| (name.as_str(), *kind)).collect();
    assert_eq!(found[..3], first);
}

#[test]
fn a_springboard_throws_its_diver_up_with_a_forward_somersault() {
    let (end, events) = run(&Springboard::example().unwrap().system().unwrap(), 1.0);
    let kinds: Vec<_> = events.iter().map(|(_, kind)| *kind).collect();
    assert_eq!(kinds.first(), Some(&TouchDown));
    assert_eq!(kinds.last(), Some(&Release), "{kinds:?}");
    // q = (board, x, z, trunk, hip, knee): it leans forward, which is negative, and turns on
    let (lean, turn) = (end.configuration.0.as_slice()[3], end.rate.base.as_slice()[3]);
    assert!(lean < -0.5 && turn < -1.0, "{lean} {turn}");
}

#[test]
fn a_quadruped_lands_and_comes_to_rest_on_its_feet() {
    let scene = Quadruped::example().unwrap().system().unwrap();
    let (end, _) = run(&scene, 5.0);
    let system = scene.in_contact().unwrap();
    let closed = system.touches(&end).into_iter().filter(|touch| touch.mode == ContactMode::Closed);
    let feet: Vec<_> = closed.map(|touch| scene.contacts[touch.contact].name()).collect();
    assert_eq!(feet, ["lf_shank", "rf_shank", "lh_shank", "rh_shank"]);
    let speed = end.rate.base.as_slice().iter().fold(0.0, |most: f64, v| most.max(v.abs()));
    assert!(speed < 1e-4, "{speed}");
}

#[test]
fn a_ragdoll_falls_and_loses_energy() {
    let scene = Ragdoll::example().unwrap().system().unwrap();
    let system = scene.in_contact().unwrap();
    let start = system.unstretched(scene.start().unwrap());
    let (end, events) = run(&scene, 1.0);
    let touched = events.iter().filter(|(_, kind)| *kind == TouchDown).count();
    let slid = events.iter().filter(|(_, kind)| *kind == Slip).count();
    assert!(touched > 5 && slid > 1, "{events:?}");
    assert!(energy(&system, &end) < energy(&system, &start) - 100.0);
}
