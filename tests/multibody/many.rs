//! Dynamics of many states at once, beside those of one.

use crate::Torques;
use nalgebra::{Matrix3, Vector3};
use somersault::integrators::driver::IntegrateError;
use somersault::integrators::methods::RungeKuttaMuntheKaas4;
use somersault::multibody::motion::{
    BodyWrenches, HeldTorques, RolloutError, TreeEnsemble, TreeForces, TreeSystem, rollout,
};
use somersault::multibody::{
    Data, DerivativeData, DynamicsError, Force, Joint, LaneData, LaneDerivativeData, Link, MassProperties,
    Model, Partials, Velocities,
};
use somersault::prelude::*;
use somersault_core::argument::ArgumentError;
use somersault_core::cancel::CancellationToken;
use somersault_core::lanes::InstructionSet;
use somersault_testkit::trees::{Case, Random, State, cases, diver, geared_diver, random_configuration};

/// States of a tree, one after the other.
struct States {
    q: Vec<f64>,
    v: Vec<f64>,
    input: Vec<f64>,
    wrenches: Vec<f64>,
}

fn states(model: &Model, random: &mut Random, count: usize) -> States {
    let n = model.n_velocities();
    let mut q = Vec::new();
    for _ in 0..count {
        q.extend(random_configuration(random, model).unwrap());
    }
    let (v, input) = (random.numbers(count * n, 2.0), random.numbers(count * n, 5.0));
    States { q, v, input, wrenches: random.numbers(count * 6 * model.n_bodies(), 5.0) }
}

fn bits(x: &[f64]) -> Vec<u64> {
    x.iter().map(|x| x.to_bits()).collect()
}

/// Inverse and forward dynamics, the mass matrix, and partials of inverse and forward dynamics.
type All = [Vec<f64>; 5];

/// The result and its partials, these row by row.
fn row(partials: Partials<'_>) -> Vec<f64> {
    let mut row = partials.value.to_vec();
    for matrix in [partials.q, partials.v, partials.input] {
        row.extend(matrix.transpose().as_slice());
    }
    row
}

/// Of each state alone, NaN for a state that has no result.
fn alone(model: &Model, states: &States, has_wrenches: bool) -> All {
    let (n_q, n, n_f) = (model.n_positions(), model.n_velocities(), 6 * model.n_bodies());
    let (mut data, mut work) = (Data::new(model), DerivativeData::new(model));
    let mut found = All::default();
    for i in 0..states.v.len() / n {
        let part = |x: &'_ [f64], n: usize| x[i * n..(i + 1) * n].to_vec();
        let (q, v, input) = (part(&states.q, n_q), part(&states.v, n), part(&states.input, n));
        let force =
            |f: &[f64]| Force::new(Vector3::from_column_slice(&f[..3]), Vector3::from_column_slice(&f[3..]));
        let wrenches: Vec<_> = part(&states.wrenches, n_f).chunks(6).map(force).collect();
        let wrenches = if has_wrenches { &wrenches[..] } else { &[] };
        found[0].extend(model.inverse_dynamics(&mut data, &q, &v, &input, wrenches).unwrap());
        match model.forward_dynamics(&mut data, &q, &v, &input, wrenches) {
            Ok(a) => found[1].extend(a),
            Err(_) => found[1].extend(vec![f64::NAN; n]),
        }
        found[2].extend(model.mass_matrix(&mut data, &q).unwrap().as_slice());
        found[3].extend(row(model.inverse_dynamics_partials(&mut work, &q, &v, &input, wrenches).unwrap()));
        match model.forward_dynamics_partials(&mut work, &q, &v, &input, wrenches) {
            Ok(partials) => found[4].extend(row(partials)),
            Err(_) => found[4].extend(vec![f64::NAN; n + 3 * n * n]),
        }
    }
    found
}

/// Of all states at once.
fn together(model: &Model, states: &States, has_wrenches: bool, set: InstructionSet) -> All {
    let States { q, v, input, wrenches } = states;
    let wrenches = if has_wrenches { &wrenches[..] } else { &[] };
    let n = model.n_velocities();
    let count = v.len() / n;
    let mut data = LaneData::with_instructions(model, set);
    let mut work = LaneDerivativeData::with_instructions(model, set);
    let mut found = [n, n, n * n, n + 3 * n * n, n + 3 * n * n].map(|length| vec![0.0; count * length]);
    let [inverse, forward, mass, inverse_partials, forward_partials] = &mut found;
    model.inverse_dynamics_many(&mut data, q, v, input, wrenches, inverse).unwrap();
    model.forward_dynamics_many(&mut data, q, v, input, wrenches, forward).unwrap();
    model.mass_matrix_many(&mut data, q, mass).unwrap();
    model.inverse_dynamics_partials_many(&mut work, q, v, input, wrenches, inverse_partials).unwrap();
    model.forward_dynamics_partials_many(&mut work, q, v, input, wrenches, forward_partials).unwrap();
    found
}

/// Eleven states: whole groups of lanes and a part of one, with every set of instructions.
#[test]
fn rows_of_many_states_have_the_bits_that_they_have_alone() {
    const COUNT: usize = 11;
    for (seed, case) in cases(60).enumerate() {
        let Case { model, mut random, .. } = case;
        let n = model.n_velocities();
        if n == 0 {
            continue;
        }
        let states = states(&model, &mut random, COUNT);
        for has_wrenches in [false, true] {
            let expected = alone(&model, &states, has_wrenches);
            for set in InstructionSet::supported() {
                let found = together(&model, &states, has_wrenches, set);
                let [found, expected] = [&found, &expected].map(|all| all.each_ref().map(|x| bits(x)));
                assert_eq!(found, expected, "seed {seed}, {}", set.name());
            }
        }
    }
}

#[test]
fn one_row_stands_for_all_states() {
    let State { model, q, v, torque, .. } = diver();
    let n = v.len();
    let velocities: Vec<f64> = (0..5).flat_map(|i| v.iter().map(move |v| v * f64::from(i))).collect();
    let mut found = vec![0.0; 5 * n];
    let mut data = LaneData::new(&model);
    model.forward_dynamics_many(&mut data, &q, &velocities, &torque, &[], &mut found).unwrap();
    let mut data = Data::new(&model);
    for (v, found) in velocities.chunks(n).zip(found.chunks(n)) {
        assert_eq!(model.forward_dynamics(&mut data, &q, v, &torque, &[]).unwrap(), found);
    }
}

#[test]
fn joints_that_follow_others_have_many_states_too() {
    let model = geared_diver().model;
    let states = states(&model, &mut Random::new(5), 9);
    let expected = alone(&model, &states, false);
    assert_eq!(together(&model, &states, false, InstructionSet::detect()), expected);
}

/// NaN in the fourth and the tenth of eleven states.
#[test]
fn a_state_without_a_result_does_not_touch_the_others() {
    let model = diver().model;
    let n = model.n_velocities();
    let mut states = states(&model, &mut Random::new(6), 11);
    for i in [3, 9] {
        states.v[i * n + 8] = f64::NAN;
    }
    let expected = alone(&model, &states, false);
    let count = states.v.len() / n;
    for set in InstructionSet::supported() {
        let found = together(&model, &states, false, set);
        for (k, (found, expected)) in found.iter().zip(&expected).enumerate() {
            let rows = found.chunks(found.len() / count).zip(expected.chunks(expected.len() / count));
            for (i, (found, expected)) in rows.enumerate() {
                // the mass matrix does not depend on v
                let is_without = [3, 9].contains(&i) && k != 2;
                assert_eq!(found.iter().any(|x| x.is_nan()), is_without, "{}", set.name());
                assert!(found.iter().zip(expected).all(|(a, b)| a == b || a.is_nan() && b.is_nan()));
            }
        }
    }
}

/// A slider, a hinge on it and a slider on that, which carries all mass: at the angle 0 both slide along one line.
fn sliders() -> Model {
    let slides = Joint::Prismatic { axis: Vector3::x() };
    let turns = Joint::Revolute { axis: Vector3::z() };
    let solid = MassProperties { mass: 1.0, center: Vector3::y(), inertia: Matrix3::identity() };
    let mut builder = Model::builder();
    builder.add(Link::root("slider", slides, MassProperties::massless())).unwrap();
    builder.add(Link::child("arm", "slider", turns, MassProperties::massless())).unwrap();
    builder.add(Link::child("bob", "arm", slides, solid)).unwrap();
    builder.build().unwrap()
}

#[test]
fn the_first_state_without_a_result_is_named() {
    let model = sliders();
    let q: Vec<f64> = [0.3, 0.7, 0.0, 0.4, 0.0, 0.1].into_iter().flat_map(|turn| [0.1, turn, 0.2]).collect();
    let (mut data, mut found, zero) = (LaneData::new(&model), vec![0.0; q.len()], [0.0; 3]);
    let error = model.forward_dynamics_many(&mut data, &q, &zero, &zero, &[], &mut found).unwrap_err();
    let DynamicsError::InState { index: 2, source } = error else { panic!("{error}") };
    assert_eq!(*source, DynamicsError::Singular { joint: "slider".to_owned() });
    let mut rows = vec![0.0; 6 * 30];
    let mut work = LaneDerivativeData::new(&model);
    let found_with_partials =
        model.forward_dynamics_partials_many(&mut work, &q, &zero, &zero, &[], &mut rows).unwrap_err();
    assert!(matches!(found_with_partials, DynamicsError::InState { index: 2, .. }), "{found_with_partials}");
    for (found, length) in [(&found, 3), (&rows, 30)] {
        let missing: Vec<_> = found.chunks(length).map(|a| a.iter().all(|x| x.is_nan())).collect();
        assert_eq!(missing, [false, false, true, false, true, false]);
    }
}

#[test]
fn lengths_of_many_states_must_fit() {
    let State { model, q, v, torque, .. } = diver();
    let n = v.len();
    let mut data = LaneData::new(&model);
    let mut out = vec![0.0; 3 * n];
    let mut check =
        |q: &[f64], v: &[f64], torque: &[f64], wrenches: &[f64], length: usize, argument: &str| {
            let error = model
                .forward_dynamics_many(&mut data, q, v, torque, wrenches, &mut out[..length])
                .unwrap_err();
            let DynamicsError::Argument(ArgumentError::Length { argument: found, .. }) = error else {
                panic!("{error}")
            };
            assert_eq!(found, argument);
        };
    check(&q[1..], &v, &torque, &[], 3 * n, "q");
    check(&q, &[v.clone(), v.clone()].concat(), &torque, &[], 3 * n, "v");
    check(&q, &v, &torque[1..], &[], 3 * n, "torque");
    check(&q, &v, &torque, &[0.0; 5], 3 * n, "wrenches");
    check(&q, &v, &torque, &[], 3 * n - 1, "acceleration");
    let mut work = LaneDerivativeData::new(&model);
    let mut rows = vec![0.0; 3 * (n + 3 * n * n)];
    let error = model.inverse_dynamics_partials_many(&mut work, &q, &v, &torque[1..], &[], &mut rows);
    let expected = ArgumentError::Length { argument: "a", expected: 3 * n, found: n - 1 };
    assert_eq!(error, Err(expected.into()));
    let error = model.mass_matrix_many(&mut data, &q, &mut rows[..n * n + 1]);
    let expected = ArgumentError::Length { argument: "matrices", expected: n * n, found: n * n + 1 };
    assert_eq!(error, Err(expected.into()));
    let mut foreign = LaneData::new(&geared_diver().model);
    let error = model.forward_dynamics_many(&mut foreign, &q, &v, &torque, &[], &mut out);
    assert_eq!(error, Err(DynamicsError::ForeignData));
}

/// Springs of their own on the joints of each copy, and a wrench on every body of one of them.
#[test]
fn copies_of_a_tree_move_as_each_does_alone() {
    struct Spring {
        stiffness: f64,
        pushes: bool,
    }

    impl TreeForces for Spring {
        fn add_torque(&self, _: f64, q: &[f64], v: &[f64], torque: &mut [f64]) {
            for k in 6..torque.len() {
                torque[k] -= self.stiffness * q[k + 1] + 0.01 * v[k];
            }
        }
        fn wrenches(&self) -> Option<&dyn BodyWrenches> {
            self.pushes.then_some(self)
        }
    }

    impl BodyWrenches for Spring {
        fn add_wrenches(&self, t: f64, bodies: &Velocities<'_>, wrenches: &mut [Force<f64>]) {
            let push = 0.5 + t * bodies.velocity(0).unwrap().angular.x;
            wrenches.iter_mut().for_each(|wrench| wrench.linear.z += push);
        }
    }

    let model = diver().model;
    let (n_q, n) = (model.n_positions(), model.n_velocities());
    let States { q, v, .. } = states(&model, &mut Random::new(7), 5);
    let forces = |i: usize| Box::new(Spring { stiffness: 0.1 * i as f64, pushes: i == 3 }) as Torques;
    let grid = TimeGrid::try_new(0.0, 1e-3, 1e-4).unwrap();

    let ensemble = TreeEnsemble::new(&model, (0..5).map(forces).collect::<Vec<_>>());
    let start = ensemble.state(&q, &v).unwrap();
    let end = Run::by_stepper(&ensemble, &RungeKuttaMuntheKaas4, grid).from(&start).unwrap().state;
    let mut velocities = vec![0.0; 5 * n];
    ensemble.joint_velocities(&end, &mut velocities).unwrap();

    for i in 0..5 {
        let system = TreeSystem::new(&model, forces(i));
        let start = model.state(&q[i * n_q..][..n_q], &v[i * n..][..n]).unwrap();
        let alone = Run::by_stepper(&system, &RungeKuttaMuntheKaas4, grid).from(&start).unwrap().state;
        let mut own = vec![0.0; n];
        model.joint_velocities(&alone, &mut own).unwrap();
        assert_eq!(&end.configuration.as_slice()[i * n_q..][..n_q], alone.configuration.as_slice(), "{i}");
        assert_eq!(&velocities[i * n..][..n], own, "{i}");
    }
}

#[test]
fn a_run_of_copies_names_the_one_without_an_acceleration() {
    let model = sliders();
    let nothing = |_: f64, _: &[f64], _: &[f64], _: &mut [f64]| {};
    let ensemble = TreeEnsemble::new(&model, [0; 3].map(|_| Box::new(nothing) as Torques));
    let start = ensemble.state(&[0.1, 0.3, 0.2, 0.1, 0.0, 0.2, 0.1, 0.4, 0.2], &[0.0; 9]).unwrap();
    let grid = TimeGrid::try_new(0.0, 0.02, 2e-3).unwrap();
    let error = Run::by_stepper(&ensemble, &RungeKuttaMuntheKaas4, grid).from(&start).unwrap_err();
    assert!(matches!(error, IntegrateError::Fault { .. }), "{error}");
    assert!(error.to_string().contains("state 1"), "{error}");
}

#[test]
fn rollouts_are_motions_of_copies_alone_under_torques_held_for_a_step() {
    let model = diver().model;
    let (n_q, n) = (model.n_positions(), model.n_velocities());
    let (copies, steps) = (19, 7);
    let States { q, v, .. } = states(&model, &mut Random::new(5), copies);
    let values = Random::new(6).numbers(copies * steps * n, 3.0);
    let torques = HeldTorques { values: &values, copies, steps };
    // the last step is shorter
    let grid = TimeGrid::try_new(0.5, 0.5 + 6.5e-3, 1e-3).unwrap();
    let token = CancellationToken::new();
    let found = rollout(&model, &q, &v, &grid, &torques, 3, &token).unwrap();
    assert_eq!(found.times, [0, 3, 6, 7].map(|k| grid.time(k)));

    for copy in [0, 7, 15, 16, 18] {
        let mut x = model.state(&q[copy * n_q..][..n_q], &v[copy * n..][..n]).unwrap();
        for step in 0..steps {
            let row = values[(copy * steps + step) * n..][..n].to_vec();
            let held = move |_: f64, _: &[f64], _: &[f64], torque: &mut [f64]| torque.copy_from_slice(&row);
            let system = TreeSystem::new(&model, Box::new(held) as Torques);
            let [start, end] = [0, 1].map(|k| grid.time(step as u64 + k));
            let one = TimeGrid::try_new(start, end, end - start).unwrap();
            x = Run::by_stepper(&system, &RungeKuttaMuntheKaas4, one).from(&x).unwrap().state;
        }
        let mut velocities = vec![0.0; n];
        model.joint_velocities(&x, &mut velocities).unwrap();
        let at_end = copy * 4 + 3;
        let apart = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        // the lengths of the steps alone differ, in their last bits
        assert!(apart(&found.positions[at_end * n_q..][..n_q], x.configuration.as_slice()) < 1e-12);
        assert!(apart(&found.velocities[at_end * n..][..n], &velocities) < 1e-10);
    }
    token.cancel();
    let cancelled = rollout(&model, &q, &v, &grid, &torques, 1, &token);
    assert_eq!(cancelled, Err(RolloutError::Cancelled));
    let short = HeldTorques { values: &values[1..], ..torques };
    let refused = rollout(&model, &q, &v, &grid, &short, 1, &CancellationToken::new());
    assert!(matches!(
        refused,
        Err(RolloutError::Argument(ArgumentError::Length { argument: "torques", .. }))
    ));
}

#[test]
fn a_rollout_names_the_copy_without_an_acceleration() {
    let model = sliders();
    let q: Vec<f64> = (0..20).flat_map(|i| if i == 17 { [0.1, 0.0, 0.2] } else { [0.1, 0.3, 0.2] }).collect();
    let grid = TimeGrid::try_new(0.0, 0.02, 2e-3).unwrap();
    let found = rollout(&model, &q, &[0.0; 60], &grid, &HeldTorques::default(), 1, &CancellationToken::new());
    assert!(
        matches!(found, Err(RolloutError::Copy { copy: 17, source: IntegrateError::Fault { .. } })),
        "{found:?}"
    );
}
