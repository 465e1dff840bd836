//! Joints that follow others: everything equals the full tree under q = G q_r + o, and what is built wrongly is refused.

use crate::derivatives::{contracted, random_directions};
use nalgebra::{DMatrix, DVector, Vector3};
use num_dual::Dual64;
use somersault::multibody::flight::{Flight, FlightData, FlightDerivatives, FlightShapes};
use somersault::multibody::motion::TreeSystem;
use somersault::multibody::{
    Axes, Data, DerivativeData, Force, Joint, Link, MassProperties, Model, ModelBuilder, ModelError,
    SecondDerivativeData, Split, Transform,
};
use somersault::prelude::*;
use somersault_testkit::trees::{Random, random_configuration, random_tree, random_wrenches};

/// A tree whose joints follow others, the same tree whose joints do not, and the map between them.
struct Coupled {
    model: Model,
    full: Model,
    /// q_full = g_q q + o, quaternions among them.
    g_q: DMatrix<f64>,
    offset: DVector<f64>,
    g: DMatrix<f64>,
    random: Random,
}

impl Coupled {
    fn spread(&self, q: &[f64]) -> Vec<f64> {
        (&self.g_q * DVector::from_column_slice(q) + &self.offset).as_slice().to_vec()
    }

    fn rates(&self, v: &[f64]) -> Vec<f64> {
        (&self.g * DVector::from_column_slice(v)).as_slice().to_vec()
    }

    fn gather(&self, full: &[f64]) -> Vec<f64> {
        self.g.tr_mul(&DVector::from_column_slice(full)).as_slice().to_vec()
    }
}

/// A random tree, some of whose hinges and slides follow earlier or later ones, in chains too.
fn coupled(seed: u64, free_root: bool) -> Option<Coupled> {
    let mut random = Random::new(seed);
    let size = 3 + random.below(25);
    let full = random_tree(&mut random, size, 0.3).ok()?;
    let mut links = full.links().to_vec();
    if free_root {
        let mass = *links[0].mass_properties();
        links[0] = Link::root("b0", Joint::Free, mass);
    }
    let single: Vec<usize> = (1..links.len()).filter(|&i| links[i].joint().n_velocities() == 1).collect();
    let mut follows: Vec<Option<(usize, f64, f64)>> = vec![None; links.len()];
    for &i in &single {
        let leader = single[random.below(single.len())];
        // a later one, or one that already leads to the end: no cycle
        let mut end = leader;
        while let Some((next, _, _)) = follows[end] {
            end = next;
        }
        if random.below(2) == 0 && end != i {
            follows[i] = Some((leader, random.within(-2.0, 2.0), random.within(-0.5, 0.5)));
        }
    }
    if follows.iter().all(Option::is_none) {
        return None;
    }
    let build = |links: &[Link]| {
        let mut builder = ModelBuilder::new().with_gravity(*full.gravity());
        for link in links {
            builder.add(link.clone()).unwrap();
        }
        builder.build().unwrap()
    };
    let full = build(&links);
    for (i, follows) in follows.iter().enumerate() {
        if let Some((leader, multiplier, offset)) = follows {
            links[i] = links[i].clone().following(format!("b{leader}"), *multiplier, *offset);
        }
    }
    let model = build(&links);
    let mut g_q = DMatrix::zeros(full.n_positions(), model.n_positions());
    let mut g = DMatrix::zeros(full.n_velocities(), model.n_velocities());
    let mut offset = DVector::zeros(full.n_positions());
    for i in 0..links.len() {
        let (mut end, mut factor, mut shift) = (i, 1.0, 0.0);
        while let Some((next, m, o)) = follows[end] {
            (end, factor, shift) = (next, factor * m, shift + factor * o);
        }
        for (row, column) in full.positions_of(i).zip(model.positions_of(end)) {
            g_q[(row, column)] = factor;
            offset[row] = shift;
        }
        for (row, column) in full.velocities_of(i).zip(model.velocities_of(end)) {
            g[(row, column)] = factor;
        }
    }
    Some(Coupled { model, full, g_q, offset, g, random })
}

fn all() -> impl Iterator<Item = Coupled> {
    (0..120).filter_map(|seed| coupled(seed, seed % 3 == 0))
}

fn close(found: &[f64], expected: &[f64], tolerance: f64) {
    assert_eq!(found.len(), expected.len());
    let scale = expected.iter().fold(1.0, |m: f64, x| m.max(x.abs()));
    for (x, y) in found.iter().zip(expected) {
        assert!((x - y).abs() <= tolerance * scale, "{x} is not {y}, of {scale}");
    }
}

#[test]
fn second_derivatives_of_coupled_joints_are_those_over_dual_numbers() {
    for mut case in all() {
        let n = case.model.n_velocities();
        let q = random_configuration(&mut case.random, &case.model).unwrap();
        let [v, a, weights] = [(); 3].map(|()| case.random.numbers(n, 2.0));
        let directions = random_directions(&case.model, &q, &mut case.random, 5);
        let expected = contracted(&case.model.cast(), [&q, &v, &a, &weights], &[], &directions);
        let mut data = SecondDerivativeData::default();
        let mut rows = vec![f64::NAN; 6 * 3 * n];
        case.model
            .inverse_dynamics_second_derivatives(&mut data, &q, &v, &a, &[], &weights, &directions, &mut rows)
            .unwrap();
        close(&rows, &expected, 1e-13);
    }
}

#[test]
fn dynamics_of_coupled_joints_are_those_of_the_full_tree_projected() {
    let mut count = 0;
    for mut case in all() {
        count += 1;
        let n = case.model.n_velocities();
        let q = random_configuration(&mut case.random, &case.model).unwrap();
        let (v, a) = (case.random.numbers(n, 2.0), case.random.numbers(n, 5.0));
        let wrenches = random_wrenches(&mut case.random, &case.model);
        let (q_full, v_full, a_full) = (case.spread(&q), case.rates(&v), case.rates(&a));
        let (mut data, mut data_full) = (Data::new(&case.model), Data::new(&case.full));
        let expected =
            case.full.inverse_dynamics(&mut data_full, &q_full, &v_full, &a_full, &wrenches).unwrap();
        let torque = case.model.inverse_dynamics(&mut data, &q, &v, &a, &wrenches).unwrap().to_vec();
        close(&torque, &case.gather(expected), 1e-13);
        let expected = case.full.bias(&mut data_full, &q_full, &v_full).unwrap();
        close(case.model.bias(&mut data, &q, &v).unwrap(), &case.gather(expected), 1e-13);
        let expected = case.full.gravity_forces(&mut data_full, &q_full).unwrap();
        close(case.model.gravity_forces(&mut data, &q).unwrap(), &case.gather(expected), 1e-13);
        let expected = case.full.mass_matrix(&mut data_full, &q_full).unwrap();
        let expected = case.g.tr_mul(expected) * &case.g;
        let mass = case.model.mass_matrix(&mut data, &q).unwrap().clone();
        close(mass.as_slice(), expected.as_slice(), 1e-13);
        // what inverse dynamics needs gives the acceleration back, also where some of it is prescribed
        let condition = mass.symmetric_eigenvalues();
        let tolerance = f64::max(1e-11, 100.0 * f64::EPSILON * condition.max() / condition.min());
        let back = case.model.forward_dynamics(&mut data, &q, &v, &torque, &wrenches).unwrap();
        close(back, &a, tolerance);
        let active: Vec<bool> = (0..n).map(|_| case.random.below(2) == 0).collect();
        let (mut a_, mut torque_) = (vec![f64::NAN; n], vec![f64::NAN; n]);
        for k in 0..n {
            if active[k] { a_[k] = a[k] } else { torque_[k] = torque[k] }
        }
        let split = Split::new(active);
        case.model.hybrid_dynamics(&mut data, &split, &q, &v, &mut a_, &mut torque_, &wrenches).unwrap();
        close(&a_, &a, tolerance);
        close(&torque_, &torque, tolerance);
        // kinematics
        let mut jacobian = DMatrix::zeros(6, n);
        let mut jacobian_full = DMatrix::zeros(6, case.full.n_velocities());
        let frame = Transform::translation(Vector3::new(0.1, -0.2, 0.3));
        let last = case.model.n_bodies() - 1;
        let bodies = case.model.positions(&mut data, &q).unwrap();
        bodies.jacobian_into(last, &frame, Axes::World, &mut jacobian).unwrap();
        let bodies_full = case.full.positions(&mut data_full, &q_full).unwrap();
        bodies_full.jacobian_into(last, &frame, Axes::World, &mut jacobian_full).unwrap();
        assert_eq!(bodies.pose(last).unwrap(), bodies_full.pose(last).unwrap());
        close(jacobian.as_slice(), (jacobian_full * &case.g).as_slice(), 1e-13);
        let found = case.model.accelerations(&mut data, &q, &v, &a).unwrap();
        let expected = case.full.accelerations(&mut data_full, &q_full, &v_full, &a_full).unwrap();
        assert_eq!(found.acceleration(last).unwrap(), expected.acceleration(last).unwrap());
        assert_eq!(found.velocities().kinetic_energy(), expected.velocities().kinetic_energy());
        let twice = DVector::from_column_slice(&v).dot(&(&mass * DVector::from_column_slice(&v)));
        close(&[twice / 2.0], &[expected.velocities().kinetic_energy()], 1e-13);
        let found = case.model.centroidal(&mut data, &q).unwrap();
        let expected = case.full.centroidal(&mut data_full, &q_full).unwrap();
        close(found.matrix.as_slice(), (expected.matrix * &case.g).as_slice(), 1e-13);
    }
    assert!(count > 80, "{count}");
}

/// out_k = f at the arguments moved along k, by dual numbers.
fn columns(n: usize, mut f: impl FnMut(usize) -> Vec<Dual64>) -> DMatrix<f64> {
    DMatrix::from_columns(
        &(0..n).map(|k| DVector::from_iterator(n, f(k).iter().map(|x| x.eps))).collect::<Vec<_>>(),
    )
}

fn duals(x: &[f64]) -> Vec<Dual64> {
    x.iter().map(|x| Dual64::from_re(*x)).collect()
}

fn bumped(x: &[f64], k: usize) -> Vec<Dual64> {
    let mut x = duals(x);
    x[k].eps = 1.0;
    x
}

#[test]
fn partials_of_coupled_joints_equal_dual_numbers_and_differences() {
    for mut case in all().take(40) {
        let n = case.model.n_velocities();
        let q = random_configuration(&mut case.random, &case.model).unwrap();
        let (v, given) = (case.random.numbers(n, 2.0), case.random.numbers(n, 5.0));
        let wrenches = random_wrenches(&mut case.random, &case.model);
        let outer: Vec<Force<Dual64>> = wrenches
            .iter()
            .map(|w| Force::new(w.linear.map(Dual64::from_re), w.angular.map(Dual64::from_re)))
            .collect();
        let dual: Model<Dual64> = case.model.cast();
        let mut data = Data::new(&dual);
        let moved = |k: usize| {
            let (mut step, mut out) = (vec![Dual64::from_re(0.0); n], duals(&q));
            step[k].eps = 1.0;
            dual.displace(&duals(&q), &step, &mut out).unwrap();
            out
        };
        let mut work = DerivativeData::new(&case.model);
        let mut plain = Data::new(&case.model);
        let eigenvalues = case.model.mass_matrix(&mut plain, &q).unwrap().symmetric_eigenvalues();
        let tolerance = f64::max(1e-10, 300.0 * f64::EPSILON * eigenvalues.max() / eigenvalues.min());

        let found = case.model.inverse_dynamics_partials(&mut work, &q, &v, &given, &wrenches).unwrap();
        let mut inverse = |q: &[Dual64], v: &[Dual64], a: &[Dual64]| {
            dual.inverse_dynamics(&mut data, q, v, a, &outer).unwrap().to_vec()
        };
        let by_q = columns(n, |k| inverse(&moved(k), &duals(&v), &duals(&given)));
        let by_v = columns(n, |k| inverse(&duals(&q), &bumped(&v, k), &duals(&given)));
        let by_a = columns(n, |k| inverse(&duals(&q), &duals(&v), &bumped(&given, k)));
        close(found.q.as_slice(), by_q.as_slice(), 1e-12);
        close(found.v.as_slice(), by_v.as_slice(), 1e-12);
        close(found.input.as_slice(), by_a.as_slice(), 1e-12);

        let mut data = Data::new(&dual);
        let mut forward = |q: &[Dual64], v: &[Dual64], torque: &[Dual64]| {
            dual.forward_dynamics(&mut data, q, v, torque, &outer).unwrap().to_vec()
        };
        let found = case.model.forward_dynamics_partials(&mut work, &q, &v, &given, &wrenches).unwrap();
        close(
            found.q.as_slice(),
            columns(n, |k| forward(&moved(k), &duals(&v), &duals(&given))).as_slice(),
            tolerance,
        );
        close(
            found.v.as_slice(),
            columns(n, |k| forward(&duals(&q), &bumped(&v, k), &duals(&given))).as_slice(),
            tolerance,
        );
        close(
            found.input.as_slice(),
            columns(n, |k| forward(&duals(&q), &duals(&v), &bumped(&given, k))).as_slice(),
            tolerance,
        );

        let active: Vec<bool> = (0..n).map(|_| case.random.below(2) == 0).collect();
        let split = Split::new(active.clone());
        let mut data = Data::new(&dual);
        let mut hybrid = |q: &[Dual64], v: &[Dual64], known: &[Dual64]| {
            let (mut a, mut torque) = (known.to_vec(), known.to_vec());
            dual.hybrid_dynamics(&mut data, &split, q, v, &mut a, &mut torque, &outer).unwrap();
            (0..n).map(|k| if active[k] { torque[k] } else { a[k] }).collect::<Vec<_>>()
        };
        let found =
            case.model.hybrid_dynamics_partials(&mut work, &split, &q, &v, &given, &wrenches).unwrap();
        close(
            found.q.as_slice(),
            columns(n, |k| hybrid(&moved(k), &duals(&v), &duals(&given))).as_slice(),
            tolerance,
        );
        close(
            found.input.as_slice(),
            columns(n, |k| hybrid(&duals(&q), &duals(&v), &bumped(&given, k))).as_slice(),
            tolerance,
        );
        let value = found.value.to_vec();
        let by_v = found.v.clone();
        // central differences of the velocity, which no dual number is part of
        let h = 1e-5;
        let k = case.random.below(n);
        let mut shifted = |sign: f64| {
            let mut v = v.clone();
            v[k] += sign * h;
            let (mut a, mut torque) = (given.clone(), given.clone());
            case.model.hybrid_dynamics(&mut plain, &split, &q, &v, &mut a, &mut torque, &wrenches).unwrap();
            (0..n).map(|k| if active[k] { torque[k] } else { a[k] }).collect::<Vec<_>>()
        };
        let (after, before) = (shifted(1.0), shifted(-1.0));
        let difference: Vec<f64> = after.iter().zip(&before).map(|(x, y)| (x - y) / (2.0 * h)).collect();
        let scale = value.iter().fold(1.0, |m: f64, x| m.max(x.abs()));
        for (x, y) in by_v.column(k).iter().zip(&difference) {
            assert!((x - y).abs() < 1e-8 * scale, "{x} {y} of {scale}");
        }

        let q_full = case.spread(&q);
        let mut full = DerivativeData::new(&case.full);
        let expected = case.full.momentum_partials(&mut full, &q_full, &case.rates(&v)).unwrap();
        let found = case.model.momentum_partials(&mut work, &q, &v).unwrap();
        close(found.q.as_slice(), (expected.q * &case.g).as_slice(), 1e-12);
        close(found.v.as_slice(), (expected.v * &case.g).as_slice(), 1e-12);
        close(found.center_of_mass_q.as_slice(), (expected.center_of_mass_q * &case.g).as_slice(), 1e-12);
    }
}

#[test]
fn a_coupled_tree_flies_as_the_full_tree_does() {
    for mut case in (0..60).step_by(3).filter_map(|seed| coupled(seed, true)) {
        let n = case.model.n_velocities();
        let q = random_configuration(&mut case.random, &case.model).unwrap();
        let v = case.random.numbers(n, 2.0);
        let (q_full, v_full) = (case.spread(&q), case.rates(&v));
        let Ok(flight) = Flight::from_state(&case.model, 0.0, &q, &v) else { continue };
        let flight_full = Flight::from_state(&case.full, 0.0, &q_full, &v_full).unwrap();
        let (mut data, mut data_full) = (FlightData::new(&case.model), FlightData::new(&case.full));
        let found = flight.derivatives(&mut data, &q, &v).unwrap();
        let expected = flight_full.derivatives(&mut data_full, &q_full, &v_full).unwrap();
        close(found.angular_velocity.as_slice(), expected.angular_velocity.as_slice(), 1e-12);
        let mut shapes = FlightShapes::default();
        let (joints, rates) = ([&q[7..], &q[7..]].concat(), [&v[6..], &v[6..]].concat());
        flight.set_shapes(&mut shapes, 2, &joints, &rates, true).unwrap();
        let mut check = |_: usize, lane: FlightDerivatives<'_>| {
            assert_eq!((lane.by_shape, lane.by_shape_velocity), (found.by_shape, found.by_shape_velocity));
        };
        flight.derivatives_of_shapes(&mut shapes, &q[3..7].repeat(2), &mut check).unwrap();
        let matrix = |columns: &[Vector3<f64>]| DMatrix::from_fn(3, columns.len(), |i, k| columns[k][i]);
        let shape = case.g.view((6, 6), (case.g.nrows() - 6, case.g.ncols() - 6));
        for (found, expected) in
            [(found.by_shape, expected.by_shape), (found.by_shape_velocity, expected.by_shape_velocity)]
        {
            close(matrix(found).as_slice(), (matrix(expected) * shape).as_slice(), 1e-11);
        }
    }
}

/// A cart that carries two arms; the second is geared to the first, the third slides as the first turns.
fn geared() -> Model {
    let rod = |length: f64| MassProperties::rod(1.0, Vector3::zeros(), Vector3::new(0.0, 0.0, -length));
    let bend = Joint::Revolute { axis: Vector3::y() };
    let mut builder = ModelBuilder::new();
    for link in [
        Link::root(
            "cart",
            Joint::Prismatic { axis: Vector3::x() },
            MassProperties::point(2.0, Vector3::zeros()),
        ),
        Link::child("second", "cart", bend, rod(0.5)).following("first", -1.5, 0.3),
        Link::child("first", "cart", bend, rod(1.0)),
        Link::child("slide", "first", Joint::Prismatic { axis: Vector3::z() }, rod(0.3))
            .following("second", 0.2, 0.1),
    ] {
        builder.add(link).unwrap();
    }
    builder.build().unwrap()
}

#[test]
fn a_geared_tree_keeps_its_energy_to_the_order_of_the_method() {
    let model = geared();
    assert_eq!((model.n_positions(), model.n_velocities()), (2, 2));
    let system = TreeSystem::new(&model, ());
    let start = model.state(&[0.0, 0.7], &[0.3, -1.0]).unwrap();
    let energy = |state: &somersault::multibody::motion::TreeState| {
        let mut data = Data::new(&model);
        let mut v = vec![0.0; 2];
        model.joint_velocities(state, &mut v).unwrap();
        let bodies = model.velocities(&mut data, state.configuration.as_slice(), &v).unwrap();
        bodies.kinetic_energy() + bodies.positions().potential_energy()
    };
    let error = |steps: u64| {
        let grid = TimeGrid::try_with_steps(0.0, 2.0, steps).unwrap();
        let end = Run::new(&system, Method::Rkmk, grid).from(&start).unwrap().state;
        (energy(&end) - energy(&start)).abs()
    };
    let (coarse, fine) = (error(200), error(400));
    let slope = (coarse / fine).log2();
    assert!(slope > 3.5, "energy error {coarse:e} {fine:e}, order {slope}");
    assert!(error(4000) < 1e-10 * energy(&start).abs());
}

#[test]
fn places_and_splits_know_who_follows() {
    let model = geared();
    let second = model.body("second").unwrap();
    assert_eq!(model.positions_of(second).len(), 0);
    assert_eq!(model.velocities_of(model.body("first").unwrap()), 1..2);
    assert_eq!(model.mimic(second).unwrap().leader, "first");
    // who follows is moved by who leads
    assert_eq!(Split::try_active(&model, &["slide"]).unwrap().active(), [false, true]);
}

#[test]
fn couplings_that_make_no_sense_are_refused() {
    let rod = MassProperties::rod(1.0, Vector3::zeros(), Vector3::z());
    let bend = Joint::Revolute { axis: Vector3::y() };
    let build = |links: Vec<Link>| {
        let mut builder = ModelBuilder::new();
        builder.add(Link::root("root", Joint::Free, rod))?;
        for link in links {
            builder.add(link)?;
        }
        builder.build().map(drop)
    };
    let a = || Link::child("a", "root", bend, rod);
    let b = || Link::child("b", "root", bend, rod);
    let refused = |links, expected: ModelError| assert_eq!(build(links), Err(expected));
    let none = || ModelError::UnknownLeader { name: "a".into(), leader: "c".into() };
    refused(vec![a().following("c", 1.0, 0.0)], none());
    let cycle = ModelError::MimicCycle { name: "a".into() };
    refused(vec![a().following("b", 1.0, 0.0), b().following("a", 1.0, 0.0)], cycle.clone());
    refused(vec![a().following("a", 1.0, 0.0)], cycle);
    refused(vec![a().following("root", 1.0, 0.0)], ModelError::NoSingleCoordinate { name: "root".into() });
    let ball = Link::child("a", "root", Joint::Spherical, rod).following("b", 1.0, 0.0);
    refused(vec![ball, b()], ModelError::NoSingleCoordinate { name: "a".into() });
    let infinite = ModelError::NonFinite { name: "a".into(), argument: "mimic" };
    refused(vec![a().following("b", f64::INFINITY, 0.0), b()], infinite);
    // a massless follower is moved with the rest
    let light = |name: &str| Link::child(name, "root", bend, MassProperties::massless());
    assert_eq!(build(vec![light("a").following("b", 1.0, 0.0), b()]), Ok(()));
    assert_eq!(build(vec![light("b"), a().following("b", 1.0, 0.0)]), Ok(()));
    let idle = || ModelError::CarriesNoMass { name: "b".into() };
    refused(vec![light("b"), light("a").following("b", 1.0, 0.0)], idle());
    refused(vec![light("b"), a().following("b", 0.0, 0.2)], idle());
}
