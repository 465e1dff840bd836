//! No allocation per step between events: the number of allocations of a run does not depend on its length.

use somersault::contact::models::SpinningTop;
use somersault::contact::sensitivity::{Differentiation, Parameter, SensitivityError, SensitivityRun};
use somersault::integrators::events::Location;
use somersault::prelude::*;
use somersault_testkit::allocations::allocations;

#[test]
fn located_steps_allocate_nothing_between_events() {
    let top = SpinningTop::thesis().unwrap();
    let located = |method: Method, start: &RigidBodyState, steps| {
        let grid = TimeGrid::try_with_steps(0.0, 1e-5 * steps as f64, steps).unwrap();
        Run::new(&top.system, method, grid).locating(Location::default()).from(start).unwrap()
    };
    // In flight from the start; held for good after 0.2 s.
    let held = located(Method::RkmkB, &top.start, 20_000).state;
    for method in Method::ALL {
        if method.info().scope == somersault::integrators::stepper::Scope::TorqueFree {
            continue;
        }
        for start in [&top.start, &held] {
            assert_eq!(located(method, start, 1000).event_count, 0, "{method}");
            let [short, long] = [10, 1000].map(|n| allocations(|| drop(located(method, start, n))));
            assert_eq!(short, long, "{method}");
        }
    }
}

#[test]
fn sensitivities_allocate_nothing_between_events() {
    let top = SpinningTop::thesis().unwrap();
    let by = Differentiation::by([Parameter::Mass]);
    let run = |method: Method, start: &RigidBodyState, steps| {
        let grid = TimeGrid::try_with_steps(0.0, 1e-5 * steps as f64, steps).unwrap();
        SensitivityRun::new(&top.system, &by, method, grid).from(start)
    };
    let held = run(Method::Rkmk, &top.start, 20_000).unwrap().run.state;
    for method in Method::ALL {
        for start in [&top.start, &held] {
            match run(method, start, 1000) {
                Ok(found) => {
                    assert_eq!(found.run.event_count, 0, "{method}");
                    let [short, long] = [10, 1000].map(|n| allocations(|| drop(run(method, start, n))));
                    assert_eq!(short, long, "{method}");
                }
                Err(error) => assert!(matches!(error.reason, SensitivityError::Method { .. }), "{method}"),
            }
        }
    }
}
