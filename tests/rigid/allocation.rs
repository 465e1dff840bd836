//! No allocation per step: the number of allocations of a run does not depend on its length.

use somersault::integrators::force::BoxedForce;
use somersault::integrators::state::RigidBodiesState;
use somersault::integrators::system::{RigidBodiesSystem, RigidSystem, StateOf};
use somersault::prelude::*;
use somersault_testkit::allocations::allocations;

fn boxes() -> Vec<RigidBody> {
    [[1.0, 2.0, 3.0], [0.5, 0.4, 0.9], [2.0, 2.0, 1.0]]
        .map(|l| RigidBody::try_box(1.3, Vector3::from(l)).unwrap())
        .to_vec()
}

fn starts() -> Vec<RigidBodyState> {
    [[1.0, 0.7, 2.0], [-2.0, 0.1, 0.3], [0.5, 3.0, -1.0]]
        .map(|w| RigidBodyState::spinning(Vector3::from(w)))
        .to_vec()
}

/// Runs of 20 and of 200 steps, the last one short, allocate alike.
fn check_fixed<S: RigidSystem>(method: Method, system: &S, start: &StateOf<S>) {
    let run = |steps: u32| {
        let grid = TimeGrid::try_new(0.0, 0.01 * (f64::from(steps) - 0.5), 0.01).unwrap();
        allocations(|| {
            Run::new(system, method, grid).from(start).unwrap();
        })
    };
    run(20);
    assert_eq!(run(20), run(200), "{method}");
}

fn check_adaptive<S: RigidSystem>(method: Method, system: &S, start: &StateOf<S>) {
    let run = |duration: f64| {
        let control = Adaptive { max_step: 0.01, ..Adaptive::default() };
        allocations(|| {
            let interval = (0.0, duration);
            Run::new(system, method, Steps::adapted(interval, control)).from(start).unwrap();
        })
    };
    run(0.2);
    assert_eq!(run(0.2), run(2.0), "{method}");
}

#[test]
fn the_counter_counts() {
    assert_eq!(allocations(|| drop(std::hint::black_box(Box::new(1)))), 1);
}

fn of_several(forces: impl Fn() -> Vec<BoxedForce>) -> RigidBodiesSystem<Vec<BoxedForce>> {
    RigidBodiesSystem::try_new(boxes(), (0..3).map(|_| forces()).collect(), ()).unwrap()
}

#[test]
fn no_step_allocates_for_one_body_or_several() {
    let weight = ConstantForce { force: Vector3::new(0.0, 0.0, -4.0), point: Vector3::new(0.1, 0.0, 0.5) };
    let drag = Drag { linear: 0.2, quadratic: 0.1, angular: 0.1 };
    let forced = || vec![Box::new((weight, drag)) as BoxedForce];
    let together = RigidBodiesState::from_bodies(&starts());
    for method in Method::ALL {
        let free = RigidBodySystem::free(boxes()[0]);
        check_fixed(method, &free, &starts()[0]);
        // Their forces are of one type with those below, and the methods are compiled once for both.
        let several = of_several(Vec::new);
        check_fixed(method, &several, &together);
        if method.info().orders.rotation_with_torque.is_some() {
            check_fixed(method, &RigidBodySystem::new(boxes()[0], forced()), &starts()[0]);
            check_fixed(method, &of_several(forced), &together);
        }
        if method.info().is_adaptive() {
            check_adaptive(method, &free, &starts()[0]);
            check_adaptive(method, &several, &together);
        }
    }
}
