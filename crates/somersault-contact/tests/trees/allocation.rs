//! No allocation per step between events: the number of allocations of a run does not depend on its length.

use somersault_contact::models::HoppingLeg;
use somersault_contact::tree::TreeInContact;
use somersault_integrators::driver::TimeGrid;
use somersault_integrators::events::Location;
use somersault_integrators::methods::Method;
use somersault_integrators::run::Run;
use somersault_multibody::motion::TreeSystem;
use somersault_testkit::allocations::allocations;

#[test]
fn located_steps_of_a_tree_allocate_nothing_between_events() {
    let leg = HoppingLeg::example().unwrap().system().unwrap();
    let driven = leg.in_contact().unwrap();
    let passive = TreeInContact::try_new(TreeSystem::new(&leg.model, ()), leg.contacts.clone(), vec![]);
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
