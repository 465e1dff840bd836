//! No allocation per step of a tree, nor by its dynamics and their partials.

use crate::{Drive, Torques};
use somersault::integrators::stepper::{Scope, Variables};
use somersault::multibody::flight::{Flight, FlightSystem, TakeOff};
use somersault::multibody::motion::{BodyWrenches, Coordinates, TreeForces, TreeState, TreeSystem};
use somersault::multibody::{
    Axes, Data, DerivativeData, Force, LaneData, LaneDerivativeData, Model, SecondDerivativeData, Split,
    Transform, Velocities,
};
use somersault::prelude::*;
use somersault_testkit::allocations::allocations;
use somersault_testkit::trees::{State, diver, geared_diver, humanoid};

#[test]
fn no_step_allocates_for_a_tree_or_its_flight() {
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
        fixed(20);
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

    let model = humanoid().unwrap();
    let n = model.n_velocities();
    let start = model.state(&model.neutral(), &vec![0.3; n]).unwrap();
    let free = TreeSystem::new(&model, Box::new(Steady) as Torques);
    let split = Split::new((0..n).map(|k| k >= 6).collect());
    let drive: Drive<'_> = Box::new(|t: f64, _: &[f64], _: &[f64], a: &mut [f64]| a.fill(t));
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
        if info.scope == Scope::AnySystem && info.variables == Variables::World {
            check(method, &free, &start);
            check(method, &driven, &start);
            check(method, &flight, &turned);
        }
    }
}

#[test]
fn dynamics_of_trees_and_their_partials_allocate_nothing() {
    let check = |model: &Model, q: &[f64], v: &[f64], a: &[f64], torque: &[f64]| {
        let n = model.n_velocities();
        let (mut data, mut work) = (Data::new(model), DerivativeData::new(model));
        let (mut lanes, mut lane_work) = (LaneData::new(model), LaneDerivativeData::new(model));
        let mut many = vec![0.0; 11 * n];
        let mut rows = vec![0.0; 11 * (n + 3 * n * n)];
        let mut second = SecondDerivativeData::default();
        let directions = vec![0.5; 11 * (q.len() + 2 * n)];
        let mut second_rows = vec![0.0; 12 * 3 * n];
        let mut differentiate_twice = || {
            let rows = &mut second_rows;
            model
                .inverse_dynamics_second_derivatives(&mut second, q, v, a, &[], v, &directions, rows)
                .unwrap();
        };
        // the first use makes the workspace
        differentiate_twice();
        let split = Split::new((0..n).map(|k| k >= 6).collect());
        let (mut acceleration, mut force) = (a.to_vec(), torque.to_vec());
        let mut jacobian = nalgebra::DMatrix::zeros(6, n);
        let found = allocations(|| {
            model.inverse_dynamics(&mut data, q, v, a, &[]).unwrap();
            model.mass_matrix(&mut data, q).unwrap();
            model.forward_dynamics(&mut data, q, v, torque, &[]).unwrap();
            model.hybrid_dynamics(&mut data, &split, q, v, &mut acceleration, &mut force, &[]).unwrap();
            model.centroidal(&mut data, q).unwrap().momentum(v).unwrap();
            let positions = model.positions(&mut data, q).unwrap();
            positions.jacobian_into(3, &Transform::identity(), Axes::World, &mut jacobian).unwrap();
            model.inverse_dynamics_partials(&mut work, q, v, a, &[]).unwrap();
            model.forward_dynamics_partials(&mut work, q, v, torque, &[]).unwrap();
            model.hybrid_dynamics_partials(&mut work, &split, q, v, a, &[]).unwrap();
            model.momentum_partials(&mut work, q, v).unwrap();
            differentiate_twice();
            model.inverse_dynamics_many(&mut lanes, q, v, a, &[], &mut many).unwrap();
            model.forward_dynamics_many(&mut lanes, q, v, torque, &[], &mut many).unwrap();
            model.mass_matrix_many(&mut lanes, q, &mut rows[..11 * n * n]).unwrap();
            model.inverse_dynamics_partials_many(&mut lane_work, q, v, a, &[], &mut rows).unwrap();
            model.forward_dynamics_partials_many(&mut lane_work, q, v, torque, &[], &mut rows).unwrap();
        });
        assert_eq!(found, 0);
    };
    let State { model, q, v, a, torque } = diver();
    check(&model, &q, &v, &a, &torque);
    // and where a joint follows another
    let State { model, q, v, a, torque } = geared_diver();
    check(&model, &q, &v, &a, &torque);
}
