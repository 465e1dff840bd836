//! No allocation per step: the number of allocations of a run does not depend on its length.

use somersault::integrators::state::RigidBodiesState;
use somersault::integrators::system::{RigidBodiesSystem, RigidSystem, StateOf};
use somersault::prelude::*;
use somersault_testkit::allocations::{Counting, allocations};

#[global_allocator]
static ALLOCATOR: Counting = Counting;

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

#[test]
fn no_step_allocates_for_one_body_or_several() {
    let weight = ConstantForce { force: Vector3::new(0.0, 0.0, -4.0), point: Vector3::new(0.1, 0.0, 0.5) };
    let forces = (weight, Drag { linear: 0.2, quadratic: 0.1, angular: 0.1 });
    let together = RigidBodiesState::from_bodies(&starts());
    for method in Method::ALL {
        let free = RigidBodySystem::free(boxes()[0]);
        check_fixed(method, &free, &starts()[0]);
        let several = RigidBodiesSystem::try_new(boxes(), vec![(); 3], ()).unwrap();
        check_fixed(method, &several, &together);
        if method.info().orders.rotation_with_torque.is_some() {
            check_fixed(method, &RigidBodySystem::new(boxes()[0], forces), &starts()[0]);
            let several = RigidBodiesSystem::try_new(boxes(), vec![forces; 3], ()).unwrap();
            check_fixed(method, &several, &together);
        }
        if method.info().embedded.is_some() {
            check_adaptive(method, &free, &starts()[0]);
            check_adaptive(method, &several, &together);
        }
    }
}

#[test]
fn located_steps_allocate_nothing_between_events() {
    use somersault::contact::models::SpinningTop;
    use somersault::integrators::events::Location;

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
fn no_step_allocates_for_a_tree_or_its_flight() {
    use somersault::multibody::flight::{Flight, FlightSystem, TakeOff};
    use somersault::multibody::motion::{Coordinates, TreeState, TreeSystem};
    use somersault::multibody::{Force, Velocities, motion::BodyWrenches, motion::TreeForces};

    /// A torque and a wrench on every joint and body.
    struct Steady;

    impl TreeForces for Steady {
        fn add_torque(&self, _: f64, _: &[f64], _: &[f64], torque: &mut [f64]) {
            torque[6..].iter_mut().for_each(|t| *t += 0.1);
        }
        fn wrenches(&self) -> Option<&dyn BodyWrenches> {
            Some(self)
        }
    }

    impl BodyWrenches for Steady {
        fn add_wrenches(&self, _: f64, _: &Velocities<'_>, wrenches: &mut [Force<f64>]) {
            wrenches.iter_mut().for_each(|w| w.linear.z += 0.5);
        }
    }

    fn check(
        method: Method,
        system: &impl System<Configuration = Coordinates, Forms = OneForm>,
        start: &TreeState,
    ) {
        let fixed = |steps: u32| {
            let grid = TimeGrid::try_new(0.0, 0.001 * (f64::from(steps) - 0.5), 0.001).unwrap();
            allocations(|| {
                Run::new(system, method, grid).from(start).unwrap();
            })
        };
        assert_eq!(fixed(20), fixed(200), "{method}");
        if method.info().embedded.is_some() {
            let control = Adaptive { max_step: 0.001, ..Adaptive::default() };
            let adaptive = |end| {
                allocations(|| {
                    let interval = (0.0, end);
                    Run::new(system, method, Steps::adapted(interval, control)).from(start).unwrap();
                })
            };
            assert_eq!(adaptive(0.02), adaptive(0.2), "{method}");
        }
    }

    let model = somersault_testkit::trees::humanoid().unwrap();
    let n = model.n_velocities();
    let start = model.state(&model.neutral(), &vec![0.3; n]).unwrap();
    let free = TreeSystem::new(&model, Steady);
    let split = somersault::multibody::Split::new((0..n).map(|k| k >= 6).collect());
    let drive = |t: f64, _: &[f64], _: &[f64], a: &mut [f64]| a.fill(t);
    let driven = TreeSystem::new(&model, ()).driven(split, drive).unwrap();
    let take_off = TakeOff {
        time: 0.0,
        center_of_mass: Vector3::zeros(),
        velocity: Vector3::z(),
        angular_momentum: Vector3::new(10.0, 20.0, 0.0),
    };
    let neutral = model.neutral();
    let shape = |t: f64, q: &mut [f64], v: &mut [f64]| {
        q.copy_from_slice(&neutral[7..]);
        q[0] = t;
        v.fill(0.0);
        v[0] = 1.0;
    };
    let flight = FlightSystem::new(Flight::try_new(&model, take_off).unwrap(), &shape);
    let turned = flight.state(&[0.0, 0.0, 0.0, 1.0]).unwrap();
    for method in Method::ALL {
        let info = method.info();
        use somersault::integrators::stepper::{Scope, Variables};
        if info.scope == Scope::AnySystem && info.variables == Variables::World {
            check(method, &free, &start);
            check(method, &driven, &start);
            check(method, &flight, &turned);
        }
    }
}

#[test]
fn sensitivities_allocate_nothing_between_events() {
    use somersault::contact::models::SpinningTop;
    use somersault::contact::sensitivity::{Differentiation, Parameter, SensitivityError, SensitivityRun};

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

#[test]
fn dynamics_of_trees_and_their_partials_allocate_nothing() {
    use somersault::multibody::{Axes, Data, DerivativeData, Split, Transform};
    use somersault_testkit::trees::{State, diver};

    let State { model, q, v, a, torque } = diver();
    let n = model.n_velocities();
    let (mut data, mut work) = (Data::new(&model), DerivativeData::new(&model));
    let split = Split::new((0..n).map(|k| k >= 6).collect());
    let (mut acceleration, mut force) = (a.clone(), torque.clone());
    let mut jacobian = nalgebra::DMatrix::zeros(6, n);
    let found = allocations(|| {
        model.inverse_dynamics(&mut data, &q, &v, &a, &[]).unwrap();
        model.mass_matrix(&mut data, &q).unwrap();
        model.forward_dynamics(&mut data, &q, &v, &torque, &[]).unwrap();
        model.hybrid_dynamics(&mut data, &split, &q, &v, &mut acceleration, &mut force, &[]).unwrap();
        model.centroidal(&mut data, &q).unwrap().momentum(&v).unwrap();
        let positions = model.positions(&mut data, &q).unwrap();
        positions.jacobian_into(3, &Transform::identity(), Axes::World, &mut jacobian).unwrap();
        model.inverse_dynamics_partials(&mut work, &q, &v, &a, &[]).unwrap();
        model.forward_dynamics_partials(&mut work, &q, &v, &torque, &[]).unwrap();
        model.hybrid_dynamics_partials(&mut work, &split, &q, &v, &a, &[]).unwrap();
        model.momentum_partials(&mut work, &q, &v).unwrap();
    });
    assert_eq!(found, 0);
}
