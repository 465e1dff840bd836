//! No allocation per step between events: the number of allocations of a run does not depend on its length.

use crate::{in_contact, passive};
use somersault_contact::models::HoppingLeg;
use somersault_contact::sensitivity::{Differentiation, EndCost, Parameter, SensitivityRun};
use somersault_contact::tree::TreeInContact;
use somersault_integrators::driver::{Flow, TimeGrid};
use somersault_integrators::events::Location;
use somersault_integrators::methods::Method;
use somersault_integrators::run::Run;
use somersault_multibody::TreeParameter;
use somersault_multibody::motion::{Between, Knots, TreeSystem};
use somersault_testkit::allocations::allocations;

#[test]
fn located_steps_of_a_tree_allocate_nothing_between_events() {
    let leg = HoppingLeg::example().unwrap().system().unwrap();
    let driven = in_contact(&leg);
    let passive =
        TreeInContact::try_new(TreeSystem::new(&leg.model, passive()), leg.contacts.clone(), vec![]);
    let passive = passive.unwrap();
    let flight = driven.unstretched(leg.start().unwrap());
    let grid = TimeGrid::try_new(0.0, 0.045, 1e-4).unwrap();
    // In contact, between its first stick and its slip.
    let held = Run::new(&driven, Method::Rkmk8, grid).locating(Location::default()).from(&flight);
    let held = held.unwrap().state;
    for method in [Method::Rk4, Method::Rkmk, Method::Rkmk8, Method::Ab4, Method::Radau5] {
        for (t, start) in [(0.0, &flight), (0.045, &held)] {
            let run = |steps: u64| {
                let grid = TimeGrid::try_with_steps(t, t + 1e-5 * steps as f64, steps).unwrap();
                let run = Run::new(&driven, method, grid).locating(Location::default());
                let run = run.from(start).unwrap();
                assert_eq!(run.event_count, 0, "{method}");
                let run = Run::new(&passive, method, grid).locating(Location::default());
                assert_eq!(run.from(&flight).unwrap().event_count, 0, "{method}");
            };
            let [short, long] = [10, 200].map(|n| allocations(|| run(n)));
            assert_eq!(short, long, "{method}");
        }
    }
}

#[test]
fn gradients_of_a_tree_allocate_nothing_per_step() {
    let leg = HoppingLeg::example().unwrap().system().unwrap();
    let system = in_contact(&leg);
    let flight = system.unstretched(leg.start().unwrap());
    let grid = TimeGrid::try_new(0.0, 0.045, 1e-4).unwrap();
    let held = Run::new(&system, Method::Rkmk8, grid).locating(Location::default()).from(&flight);
    let held = held.unwrap().state;
    let knots = Knots::try_new(&[0.0, 1.0], Between::Line).unwrap();
    let parameters = [
        Parameter::normal(0, "stiffness"),
        Parameter::JointForceAt(4, knots, 1),
        Parameter::Tree(TreeParameter::Mass(1)),
        Parameter::Tree(TreeParameter::Placement(2, nalgebra::Vector3::z())),
    ];
    let weights = [1.0; 5];
    let cost = EndCost { by_motion: &weights, by_velocity: &weights, by_event_times: &[] };
    for (t, start) in [(0.0, &flight), (0.045, &held)] {
        let by = Differentiation {
            stretches: start.rate.variables.clone(),
            ..Differentiation::by(parameters.clone())
        };
        let start = start.base();
        for method in [Method::Rk4, Method::Rkmk8] {
            let run = |steps: u64| {
                let grid = TimeGrid::try_with_steps(t, t + 1e-5 * steps as f64, steps).unwrap();
                SensitivityRun::new(&system, &by, method, grid)
            };
            let [short, long] = [10, 200].map(|n| allocations(|| drop(run(n).from(&start).unwrap())));
            assert_eq!(short, long, "columns by {method}");
            let back = |steps: u64| {
                let mut recorded = run(steps).recorded_from(&start).unwrap();
                recorded.gradient(&cost, None, &mut |_| Flow::Continue).unwrap();
            };
            let [short, long] = [10, 200].map(|n| allocations(|| back(n)));
            assert_eq!(short, long, "adjoint by {method}");
        }
    }
}
