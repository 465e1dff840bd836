//! Momentum-reduced flight: conservation, closed forms, full dynamics, derivatives, bad input.

use crate::Drive;
use nalgebra::{Matrix3, Quaternion, UnitQuaternion, Vector3};
use num_dual::Dual64;
use somersault::integrators::driver::IntegrateError;
use somersault::multibody::flight::{Flight, FlightData, FlightError, FlightSystem, ShapeMotion, TakeOff};
use somersault::multibody::models::Diver;
use somersault::multibody::motion::{Coordinates, TreeState, TreeSystem};
use somersault::multibody::{Data, DynamicsError, Joint, Link, MassProperties, Model, ModelBuilder, Split};
use somersault::prelude::*;
use somersault_core::argument::ArgumentError;
use somersault_testkit::order::{Sampling, estimate};
use somersault_testkit::trees::{Random, humanoid, random_configuration};
use std::f64::consts::PI;

/// A humanoid's joints, or any others, each swinging as ½ a sin(ω t + φ) about a posture; quaternions
/// turn about a fixed axis of the child by that angle.
#[derive(Clone)]
struct Swing {
    posture: Vec<f64>,
    /// For each joint: where its numbers are in q and v of the shape, how many numbers in v.
    joints: Vec<(usize, usize, usize)>,
    amplitudes: Vec<f64>,
    frequencies: Vec<f64>,
}

impl Swing {
    fn new(model: &Model, random: &mut Random, size: f64) -> Self {
        let (q0, v0) = (model.positions_of(0).end, model.velocities_of(0).end);
        let q = random_configuration(random, model).unwrap();
        let mut joints = Vec::new();
        for i in 1..model.n_bodies() {
            let (q, v) = (model.positions_of(i), model.velocities_of(i));
            if !v.is_empty() {
                joints.push((q.start - q0, v.start - v0, v.len()));
            }
        }
        let n = model.n_velocities() - v0;
        Self {
            posture: q[q0..].to_vec(),
            joints,
            amplitudes: random.numbers(n, size),
            frequencies: (0..n).map(|_| random.within(1.0, 4.0)).collect(),
        }
    }

    /// Displacement of degree of freedom `k` and its rate, by the sine of its joint.
    fn phase(&self, k: usize, t: f64) -> (f64, f64) {
        let w = self.frequencies[k];
        ((w * t).sin(), w * (w * t).cos())
    }
}

/// Every joint moves along one direction a of its group, q = q₀ ⊕ a sin ωt, so v = a ω cos ωt.
impl ShapeMotion for Swing {
    fn evaluate(&self, t: f64, q: &mut [f64], v: &mut [f64]) {
        for &(at, first, n) in &self.joints {
            let (sin, rate) = self.phase(first, t);
            let a = &self.amplitudes[first..first + n];
            for i in 0..n {
                v[first + i] = a[i] * rate;
            }
            match n {
                1 => q[at] = self.posture[at] + a[0] * sin,
                3 => {
                    let turn = UnitQuaternion::from_scaled_axis(Vector3::new(a[0], a[1], a[2]) * sin);
                    let p = &self.posture[at..at + 4];
                    let moved = UnitQuaternion::new_unchecked(Quaternion::new(p[3], p[0], p[1], p[2])) * turn;
                    q[at..at + 4].copy_from_slice(moved.coords.as_slice());
                }
                _ => unreachable!("hinges, slides and balls only"),
            }
        }
    }
}

/// A tree of bodies with hinges, slides and ball joints under a root of the given kind.
pub(crate) fn flying_tree(random: &mut Random, root: Joint, n: usize) -> Model {
    let mut builder = ModelBuilder::new().with_gravity(random.vector(10.0));
    let placed = |random: &mut Random, link: Link| link.at(random.vector(0.5)).turned(random.rotation());
    let link = Link::root("b0", root, random.body());
    builder.add(placed(random, link)).unwrap();
    for i in 1..n {
        let joint = match random.below(4) {
            0 => Joint::Fixed,
            1 => Joint::Revolute { axis: random.vector(1.0) },
            2 => Joint::Prismatic { axis: random.vector(1.0) },
            _ => Joint::Spherical,
        };
        let parent = format!("b{}", i - 1 - random.below(i.min(3)));
        let link = Link::child(format!("b{i}"), parent, joint, random.body());
        builder.add(placed(random, link)).unwrap();
    }
    builder.build().unwrap()
}

pub(crate) fn take_off(random: &mut Random, momentum: f64) -> TakeOff {
    TakeOff {
        time: random.within(-1.0, 1.0),
        center_of_mass: random.vector(3.0),
        velocity: random.vector(5.0),
        angular_momentum: random.vector(momentum),
    }
}

/// Orientation numbers of the root.
pub(crate) fn orientation(random: &mut Random, model: &Model) -> Vec<f64> {
    let q = random_configuration(random, model).unwrap();
    if model.joint(0) == Some(&Joint::Planar) { q[2..3].to_vec() } else { q[3..7].to_vec() }
}

/// By how much the momentum of the completed state (relative to L, and to ċ) and its centre of mass
/// (relative to its distance) are off.
struct Balance<'f> {
    system: &'f FlightSystem<'f, dyn ShapeMotion + 'f>,
    normal: Option<Vector3<f64>>,
    momentum: f64,
    center: f64,
}

impl<'f> Balance<'f> {
    fn new(system: &'f FlightSystem<'f, dyn ShapeMotion + 'f>) -> Self {
        let model = system.flight().model();
        let is_planar = model.joint(0) == Some(&Joint::Planar);
        let normal = is_planar.then(|| model.placement(0).unwrap().rotation * Vector3::z());
        Self { system, normal, momentum: 0.0, center: 0.0 }
    }

    fn look(&mut self, t: f64, x: &TreeState) {
        let flight = self.system.flight();
        let model = flight.model();
        let mut w = somersault::integrators::system::System::workspace(self.system);
        let (q, v) = self.system.complete(&mut w, t, x).unwrap();
        let mut data = Data::new(model);
        let centroidal = model.centroidal(&mut data, q).unwrap();
        let momentum = centroidal.momentum(v).unwrap();
        let velocity = flight.center_of_mass_velocity(t);
        let mut linear = momentum.linear / model.mass() - velocity;
        let mut center = centroidal.center_of_mass - flight.center_of_mass(t);
        let mut angular = momentum.angular - flight.take_off().angular_momentum;
        if let Some(n) = self.normal {
            linear -= n * n.dot(&linear);
            center -= n * n.dot(&center);
            angular = n * n.dot(&angular);
        }
        let angular = angular.norm() / flight.take_off().angular_momentum.norm();
        let linear = linear.norm() / (1.0 + velocity.norm());
        self.momentum = self.momentum.max(angular).max(linear);
        self.center = self.center.max(center.norm() / (1.0 + flight.center_of_mass(t).norm()));
    }
}

impl Observer<Coordinates> for Balance<'_> {
    fn observe(&mut self, step: &mut Step<'_, Coordinates>) -> Flow {
        self.look(step.t_after, step.after);
        Flow::Continue
    }
}

/// The flight with a shape behind a pointer, so that the methods are compiled for one type of system whatever moves the joints.
fn flying<'f>(flight: Flight<'f>, shape: &'f dyn ShapeMotion) -> FlightSystem<'f, dyn ShapeMotion + 'f> {
    FlightSystem::new(flight, shape)
}

#[test]
fn momentum_is_exactly_constant_and_the_centre_of_mass_on_its_parabola_in_reduced_flight() {
    let divers = [Diver::planar(), Diver::spatial()].map(|diver| diver.model().unwrap());
    let mut trees: Vec<Model> = divers.into_iter().chain([humanoid().unwrap()]).collect();
    let mut random = Random::new(1);
    for root in [Joint::Free, Joint::Planar] {
        for _ in 0..10 {
            let n = 2 + random.below(20);
            trees.push(flying_tree(&mut random, root, n));
        }
    }
    for (i, model) in trees.iter().enumerate() {
        let flight = Flight::try_new(model, take_off(&mut random, 20.0)).unwrap();
        let swing = Swing::new(model, &mut random, 1.0);
        let system = flying(flight, &swing);
        let start = system.state(&orientation(&mut random, model)).unwrap();
        let grid = TimeGrid::try_with_steps(0.0, 2.0, 100).unwrap();
        for method in [Method::Euler, Method::Cf4] {
            let mut balance = Balance::new(&system);
            Run::new(&system, method, grid).observed_by(&mut balance).from(&start).unwrap();
            let Balance { momentum, center, .. } = balance;
            assert!(momentum < 1e-13 && center < 1e-13, "tree {i}, {method}: {momentum:e} {center:e}");
        }
    }
}

/// s̈ of a swing.
fn shape_acceleration(swing: &Swing, t: f64, out: &mut [f64]) {
    for &(_, first, n) in &swing.joints {
        let w = swing.frequencies[first];
        for k in first..first + n {
            out[k] = -swing.amplitudes[k] * w * w * (w * t).sin();
        }
    }
}

/// Integrates flight and hybrid dynamics with the same joint motion, returns the largest difference in q
/// and v at the end.
fn difference_from_full_dynamics(model: &Model, random: &mut Random) -> f64 {
    let swing = Swing::new(model, random, 0.8);
    let mut take_off = take_off(random, 10.0);
    take_off.time = 0.0;
    if model.joint(0) == Some(&Joint::Planar) {
        // in the plane nothing else can be
        let n = model.placement(0).unwrap().rotation * Vector3::z();
        take_off.angular_momentum = n * n.dot(&take_off.angular_momentum);
    }
    let flight = Flight::try_new(model, take_off).unwrap();
    let system = flying(flight, &swing);
    let start = system.state(&orientation(random, model)).unwrap();
    let control = Adaptive::with_tolerances(1e-13, 1e-13);
    let end = Run::new(&system, Method::Rkmk8, Steps::adapted((0.0, 1.0), control)).from(&start).unwrap();
    let mut w = somersault::integrators::system::System::workspace(&system);
    let (q, v) = system.complete(&mut w, 0.0, &start).unwrap();
    let full_start = model.state(q, v).unwrap();
    let (q, v) = system.complete(&mut w, 1.0, &end.state).unwrap();
    let n_root = model.velocities_of(0).end;
    let split = Split::new((0..model.n_velocities()).map(|k| k >= n_root).collect());
    let drive: Drive<'_> = Box::new(|t: f64, _: &[f64], _: &[f64], a: &mut [f64]| {
        shape_acceleration(&swing, t, &mut a[n_root..]);
    });
    let full = TreeSystem::new(model, ()).driven(split, drive).unwrap();
    let full_end =
        Run::new(&full, Method::Rkmk8, Steps::adapted((0.0, 1.0), control)).from(&full_start).unwrap();
    let (mut dq, mut full_v) = (vec![0.0; v.len()], vec![0.0; v.len()]);
    model.difference(q, full_end.state.configuration.as_slice(), &mut dq).unwrap();
    model.joint_velocities(&full_end.state, &mut full_v).unwrap();
    full_v.iter().zip(v).map(|(a, b)| a - b).chain(dq).fold(0.0, |m, d| m.max(d.abs()))
}

#[test]
fn reduced_flight_is_the_full_dynamics_with_driven_joints() {
    let mut random = Random::new(2);
    for diver in [Diver::planar(), Diver::spatial()] {
        let off = difference_from_full_dynamics(&diver.model().unwrap(), &mut random);
        assert!(off < 1e-10, "{diver:?}: {off:e}");
    }
    for root in [Joint::Free, Joint::Planar] {
        for i in 0..8 {
            let n = 2 + random.below(10);
            let model = flying_tree(&mut random, root, n);
            let off = difference_from_full_dynamics(&model, &mut random);
            assert!(off < 1e-10, "{root:?} {i}: {off:e}");
        }
    }
}

fn flat(mass: f64, center: f64, inertia: f64) -> MassProperties {
    // a plate in the x–y plane, as thin as the triangle inequality allows
    let inertia = Matrix3::from_diagonal(&Vector3::new(0.5 * inertia, 0.5 * inertia, inertia));
    MassProperties { mass, center: Vector3::new(center, 0.0, 0.0), inertia }
}

/// Two plates on a hinge, at distances a and b from it: (A + B cos φ) θ̇ + (I₂ + μ(b² + ab cos φ)) φ̇ = L
/// with μ = m₁m₂/(m₁ + m₂), A = I₁ + I₂ + μ(a² + b²), B = 2μab; θ turns the first, φ the second against it.
#[test]
fn two_plates_on_a_hinge_turn_by_the_integral_over_the_hinge_angle() {
    let (m1, m2, i1, i2, a, b) = (3.0, 1.2, 0.4, 0.09, 0.35, 0.28);
    let mut builder = ModelBuilder::new().with_gravity(Vector3::new(0.0, -9.81, 0.0));
    builder.add(Link::root("first", Joint::Planar, flat(m1, -a, i1))).unwrap();
    let hinge = Joint::Revolute { axis: Vector3::z() };
    builder.add(Link::child("second", "first", hinge, flat(m2, b, i2))).unwrap();
    let model = builder.build().unwrap();
    let take_off = TakeOff {
        time: 0.0,
        center_of_mass: Vector3::zeros(),
        velocity: Vector3::new(1.0, 3.0, 0.0),
        angular_momentum: Vector3::zeros(),
    };
    let (from, to, duration) = (-0.4, 2.3, 0.8);
    let shape = |t: f64, q: &mut [f64], v: &mut [f64]| {
        // a smooth step
        let (s, w) = (t / duration, PI / duration);
        q[0] = from + (to - from) * 0.5 * (1.0 - (PI * s).cos());
        v[0] = (to - from) * 0.5 * w * (PI * s).sin();
    };
    let system = flying(Flight::try_new(&model, take_off).unwrap(), &shape);
    let start = system.state(&[0.3]).unwrap();
    let grid = TimeGrid::try_with_steps(0.0, duration, 60).unwrap();
    let end = Run::new(&system, Method::Rkmk8, grid).from(&start).unwrap().state;
    // ∫ (c + d cos φ)/(A + B cos φ) dφ with c = I₂ + μb², d = B/2
    let mu = m1 * m2 / (m1 + m2);
    let (big_a, big_b) = (i1 + i2 + mu * (a * a + b * b), 2.0 * mu * a * b);
    let primitive = |phi: f64| {
        let root = (big_a * big_a - big_b * big_b).sqrt();
        let of_reciprocal =
            2.0 / root * (((big_a - big_b) / (big_a + big_b)).sqrt() * (0.5 * phi).tan()).atan();
        0.5 * phi + (i2 + mu * b * b - 0.5 * big_a) * of_reciprocal
    };
    let expected = 0.3 - (primitive(to) - primitive(from));
    let found = end.configuration.as_slice()[0];
    assert!((found - expected).abs() < 1e-13, "{found} {expected}");
    // at both ends the plates are at rest against each other, so all stands still
    let mut w = somersault::integrators::system::System::workspace(&system);
    let (_, v) = system.complete(&mut w, duration, &end).unwrap();
    assert!(v[2].abs() < 1e-15);
}

/// A falling cat: without angular momentum a closed loop of shapes turns the body, and by the same angle
/// at any pace.
#[test]
fn a_cat_without_angular_momentum_turns_by_its_loop_and_not_by_its_pace() {
    let mut builder = ModelBuilder::new();
    let half = MassProperties::rod(2.0, Vector3::zeros(), Vector3::new(0.4, 0.0, 0.0));
    let mut half = MassProperties { inertia: half.inertia + Matrix3::identity() * 0.02, ..half };
    half.center = Vector3::new(0.2, 0.0, 0.0);
    builder.add(Link::root("front", Joint::Free, half)).unwrap();
    builder.add(Link::child("rear", "front", Joint::Spherical, half)).unwrap();
    let model = builder.build().unwrap();
    let take_off = TakeOff {
        time: 0.0,
        center_of_mass: Vector3::zeros(),
        velocity: Vector3::zeros(),
        angular_momentum: Vector3::zeros(),
    };
    // the back bends and the bend runs round: the rear's axis on a cone about the front's
    let run = |pace: &dyn Fn(f64) -> (f64, f64)| {
        let shape = |t: f64, q: &mut [f64], v: &mut [f64]| {
            let (u, rate) = pace(t);
            let (s, c) = (2.0 * PI * u).sin_cos();
            let bend = Vector3::new(0.0, c, s) * 2.2;
            let turned = UnitQuaternion::from_scaled_axis(bend);
            q[..4].copy_from_slice(turned.coords.as_slice());
            let bend_rate = Vector3::new(0.0, -s, c) * (2.2 * 2.0 * PI * rate);
            v[..3].copy_from_slice(so3::dexp(&-bend, &bend_rate).as_slice());
        };
        let system = flying(Flight::try_new(&model, take_off).unwrap(), &shape);
        let start = system.state(&[0.0, 0.0, 0.0, 1.0]).unwrap();
        let grid = TimeGrid::try_with_steps(0.0, 1.0, 400).unwrap();
        let end = Run::new(&system, Method::Rkmk8, grid).from(&start).unwrap();
        let q = end.state.configuration.as_slice();
        UnitQuaternion::new_unchecked(Quaternion::new(q[3], q[0], q[1], q[2]))
    };
    let even = run(&|t| (t, 1.0));
    let uneven = run(&|t| (t * t * (3.0 - 2.0 * t), 6.0 * t * (1.0 - t)));
    assert!(so3::angle_between(&even, &uneven) < 1e-12);
    let turn = so3::angle_between(&even, &UnitQuaternion::identity());
    assert!(turn > 0.5, "{turn}");
    // back along the same way
    let back = run(&|t| (0.5 - 0.5 * (2.0 * PI * t).cos(), PI * (2.0 * PI * t).sin()));
    assert!(so3::angle_between(&back, &UnitQuaternion::identity()) < 1e-12);
}

#[test]
fn a_rigid_shape_flies_as_the_exact_free_body() {
    let body = RigidBody::try_box(1.3, Vector3::new(0.3, 0.5, 0.9)).unwrap();
    let lone =
        MassProperties { mass: body.mass(), center: Vector3::zeros(), inertia: *body.inertia().tensor() };
    let mut builder = ModelBuilder::new();
    builder.add(Link::root("body", Joint::Free, lone)).unwrap();
    let model = builder.build().unwrap();
    let omega = Vector3::new(1.5, -0.9, 2.4);
    let exact = FreeBody::try_new(&body, &RigidBodyState::spinning(omega)).unwrap().at(2.0).unwrap();
    let take_off = TakeOff {
        time: 0.0,
        center_of_mass: Vector3::zeros(),
        velocity: Vector3::zeros(),
        angular_momentum: body.inertia().momentum(&omega),
    };
    let rigid = |_: f64, _: &mut [f64], _: &mut [f64]| {};
    let system = flying(Flight::try_new(&model, take_off).unwrap(), &rigid);
    let start = system.state(&[0.0, 0.0, 0.0, 1.0]).unwrap();
    for method in
        [Method::Heun, Method::Rkmk, Method::Cf4, Method::Imid, Method::Rkmk3, Method::Rkmk5, Method::Rkmk8]
    {
        let order = f64::from(method.info().orders.rotation);
        let sampling =
            Sampling { first: if order > 5.0 { 6 } else { 16 }, last: 4000, ..Sampling::default() };
        let found = estimate(2.0, &sampling, |steps| {
            let grid = TimeGrid::try_with_steps(0.0, 2.0, steps).unwrap();
            let end = Run::new(&system, method, grid).from(&start).ok()?.state;
            let q = end.configuration.as_slice();
            let turn = UnitQuaternion::new_unchecked(Quaternion::new(q[3], q[0], q[1], q[2]));
            Some(so3::angle_between(&turn, exact.orientation()))
        });
        assert!(found.slope.is_some_and(|s| s > order - 0.25), "{method}: {found:?}");
    }
}

#[test]
fn curves_between_the_steps_of_a_flight_are_the_flight() {
    let model = Diver::spatial().model().unwrap();
    let mut random = Random::new(5);
    let take_off = TakeOff { time: 0.0, ..take_off(&mut random, 30.0) };
    let swing = Swing::new(&model, &mut random, 0.5);
    let system = flying(Flight::try_new(&model, take_off).unwrap(), &swing);
    let start = system.state(&orientation(&mut random, &model)).unwrap();
    let control = Adaptive::with_tolerances(1e-11, 1e-11);
    let mut recorder = Recorder::new(0.0, &start, 1).with_dense_output();
    Run::new(&system, Method::Rkmk8, Steps::adapted((0.0, 1.7), control))
        .observed_by(&mut recorder)
        .from(&start)
        .unwrap();
    let between = recorder.into_solution().at(0.9).unwrap();
    let grid = TimeGrid::try_with_steps(0.0, 0.9, 500).unwrap();
    let there = Run::new(&system, Method::Rkmk8, grid).from(&start).unwrap().state;
    let turn = |x: &TreeState| {
        let q = x.configuration.as_slice();
        UnitQuaternion::new_unchecked(Quaternion::new(q[3], q[0], q[1], q[2]))
    };
    let off = so3::angle_between(&turn(&between), &turn(&there));
    assert!(off < 1e-9, "{off:e}");
}

/// The orders that the documentation of `FlightSystem` claims.
#[test]
fn orientation_in_flight_has_the_order_of_the_method() {
    let model = humanoid().unwrap();
    let mut random = Random::new(4);
    let flight = Flight::try_new(&model, take_off(&mut random, 20.0)).unwrap();
    let swing = Swing::new(&model, &mut random, 1.2);
    let system = flying(flight, &swing);
    let start = system.state(&orientation(&mut random, &model)).unwrap();
    let end = |method: Method, steps| {
        let grid = TimeGrid::try_with_steps(0.0, 2.0, steps).unwrap();
        let x = Run::new(&system, method, grid).from(&start).ok()?.state;
        let q = x.configuration.as_slice();
        Some(UnitQuaternion::new_unchecked(Quaternion::new(q[3], q[0], q[1], q[2])))
    };
    let reference = end(Method::Rkmk8, 2000).unwrap();
    for method in Method::ALL {
        let info = method.info();
        if end(method, 10).is_none() {
            continue;
        }
        let order = match info.name {
            "sie" | "siabm2" | "siabm4" => 1,
            _ => info.orders.rotation_with_torque.unwrap(),
        };
        let first = match order {
            1 => 1024,
            2 => 128,
            3..=5 => 16,
            _ => 8,
        };
        // 2000 steps of order eight leave a few roundings in the reference
        let sampling = Sampling { first, last: 12_000, floor: 5e-13, ..Sampling::default() };
        let found =
            estimate(2.0, &sampling, |steps| Some(so3::angle_between(&end(method, steps)?, &reference)));
        let order = f64::from(order);
        let fits = |s: f64| s > order - 0.25 && (s < order + 0.5 || order > 4.0);
        assert!(found.slope.is_some_and(fits), "{method}: {found:?}");
    }
}

fn duals(x: &[f64]) -> Vec<Dual64> {
    x.iter().map(|&x| Dual64::from_re(x)).collect()
}

fn dual(x: Vector3<f64>, dx: Vector3<f64>) -> Vector3<Dual64> {
    x.zip_map(&dx, Dual64::new)
}

#[test]
fn derivatives_of_the_angular_velocity_are_those_of_dual_numbers_and_differences() {
    let mut random = Random::new(6);
    for case in 0..60 {
        let root = if case % 2 == 0 { Joint::Free } else { Joint::Planar };
        let n = 2 + random.below(20);
        let model = flying_tree(&mut random, root, n);
        let dofs = model.n_velocities();
        let n_root = model.velocities_of(0).end;
        let q = random_configuration(&mut random, &model).unwrap();
        let v = random.numbers(dofs, 2.0);
        let start = take_off(&mut random, 5.0);
        let flight = Flight::try_new(&model, start).unwrap();
        let mut data = FlightData::new(&model);
        let found = flight.derivatives(&mut data, &q, &v).unwrap();
        let omega = found.angular_velocity;
        // along a random direction of orientation, shape, shape velocity and L at once
        let mut dq = random.numbers(dofs, 1.0);
        if root == Joint::Planar {
            dq[..2].fill(0.0);
        } else {
            dq[..3].fill(0.0);
        }
        let (dv, dl) = (random.numbers(dofs, 1.0), random.vector(1.0));
        let turn = if root == Joint::Planar {
            Vector3::new(0.0, 0.0, dq[2])
        } else {
            Vector3::new(dq[3], dq[4], dq[5])
        };
        let mut expected = found.by_orientation * turn + found.by_angular_momentum * dl;
        for k in n_root..dofs {
            expected += found.by_shape[k - n_root] * dq[k] + found.by_shape_velocity[k - n_root] * dv[k];
        }
        let size = 1.0
            + found.by_shape.iter().chain(found.by_shape_velocity).map(Vector3::norm).fold(0.0, f64::max)
            + omega.norm();
        let wide = model.cast::<Dual64>();
        let lifted = TakeOff {
            time: Dual64::from_re(0.0),
            center_of_mass: dual(start.center_of_mass, Vector3::zeros()),
            velocity: dual(start.velocity, Vector3::zeros()),
            angular_momentum: dual(start.angular_momentum, dl),
        };
        let zero = vec![0.0; dofs];
        let step: Vec<Dual64> = zero.iter().zip(&dq).map(|(&x, &d)| Dual64::new(x, d)).collect();
        let mut moved = duals(&q);
        wide.displace(&duals(&q), &step, &mut moved).unwrap();
        let faster: Vec<Dual64> = v.iter().zip(&dv).map(|(&x, &d)| Dual64::new(x, d)).collect();
        let wide_flight = Flight::try_new(&wide, lifted).unwrap();
        let by_duals = wide_flight.angular_velocity(&mut FlightData::new(&wide), &moved, &faster).unwrap();
        assert!((by_duals.map(|x| x.re) - omega).norm() < 1e-13 * size);
        let off = (by_duals.map(|x| x.eps) - expected).norm();
        assert!(off < 1e-12 * size * dofs as f64, "case {case}: {off:e}");
        // central differences
        let at = |h: f64| {
            let take_off = TakeOff { angular_momentum: start.angular_momentum + dl * h, ..start };
            let flight = Flight::try_new(&model, take_off).unwrap();
            let step: Vec<f64> = dq.iter().map(|d| d * h).collect();
            let mut moved = q.clone();
            model.displace(&q, &step, &mut moved).unwrap();
            let faster: Vec<f64> = v.iter().zip(&dv).map(|(x, d)| x + d * h).collect();
            flight.angular_velocity(&mut FlightData::new(&model), &moved, &faster).unwrap()
        };
        let h = 1e-5;
        let off = ((at(h) - at(-h)) / (2.0 * h) - expected).norm();
        assert!(off < 1e-7 * size * dofs as f64, "case {case}: {off:e}");
    }
}

#[test]
fn accelerations_of_the_hybrid_dynamics_are_the_rates_of_reduced_flight() {
    let mut random = Random::new(10);
    for case in 0..40 {
        let root = if case % 2 == 0 { Joint::Free } else { Joint::Planar };
        let n = 2 + random.below(20);
        let model = flying_tree(&mut random, root, n);
        let (dofs, n_root) = (model.n_velocities(), model.velocities_of(0).end);
        let mut q = random_configuration(&mut random, &model).unwrap();
        let (mut v, mut a) = (random.numbers(dofs, 2.0), random.numbers(dofs, 5.0));
        let mut start = take_off(&mut random, 5.0);
        if root == Joint::Planar {
            let normal = model.placement(0).unwrap().rotation * Vector3::z();
            start.angular_momentum = normal * 3.0;
        }
        let flight = Flight::try_new(&model, start).unwrap();
        let mut data = FlightData::new(&model);
        flight.complete(&mut data, 0.3, &mut q, &mut v).unwrap();
        let found = flight.derivatives(&mut data, &q, &v).unwrap();
        let mut rate = found.by_orientation * found.angular_velocity;
        for k in n_root..dofs {
            rate += found.by_shape[k - n_root] * v[k] + found.by_shape_velocity[k - n_root] * a[k];
        }
        let split = Split::new((0..dofs).map(|k| k >= n_root).collect());
        let mut torque = vec![0.0; dofs];
        model.hybrid_dynamics(&mut Data::new(&model), &split, &q, &v, &mut a, &mut torque, &[]).unwrap();
        let angular = if root == Joint::Planar {
            rate.x = 0.0;
            rate.y = 0.0;
            Vector3::new(0.0, 0.0, a[2])
        } else {
            Vector3::new(a[3], a[4], a[5])
        };
        let off = (angular - rate).norm();
        assert!(off < 1e-11 * (1.0 + angular.norm()) * dofs as f64, "case {case}: {off:e} {angular}");
    }
}

#[test]
fn a_flight_taken_from_a_state_passes_through_it() {
    let mut random = Random::new(9);
    for root in [Joint::Free, Joint::Planar] {
        for _ in 0..10 {
            let model = flying_tree(&mut random, root, 8);
            let q = random_configuration(&mut random, &model).unwrap();
            let v = random.numbers(model.n_velocities(), 2.0);
            let flight = Flight::from_state(&model, 0.7, &q, &v).unwrap();
            let n = model.velocities_of(0).end;
            let (mut again_q, mut again_v) = (q.clone(), v.clone());
            let positions = if root == Joint::Planar { 2 } else { 3 };
            again_q[..positions].fill(f64::NAN);
            again_v[..n].fill(f64::NAN);
            flight.complete(&mut FlightData::new(&model), 0.7, &mut again_q, &mut again_v).unwrap();
            let off = q.iter().zip(&again_q).chain(v.iter().zip(&again_v));
            assert!(off.clone().all(|(a, b)| (a - b).abs() < 1e-11), "{:?}", off.collect::<Vec<_>>());
        }
    }
}

#[test]
fn what_cannot_fly_is_refused_by_name() {
    let body = MassProperties { mass: 1.0, center: Vector3::zeros(), inertia: Matrix3::identity() };
    let tree = |link: Link| {
        let mut builder = ModelBuilder::new();
        builder.add(link).unwrap();
        builder.build().unwrap()
    };
    let start = TakeOff {
        time: 0.0,
        center_of_mass: Vector3::zeros(),
        velocity: Vector3::zeros(),
        angular_momentum: Vector3::zeros(),
    };
    let held = tree(Link::root("post", Joint::Spherical, body));
    let found = Flight::try_new(&held, start).unwrap_err();
    assert_eq!(found, FlightError::Held { root: "post".into(), found: Joint::Spherical });
    let damped = tree(Link::root("kite", Joint::Free, body).with_damping(0.1));
    let found = Flight::try_new(&damped, start).unwrap_err();
    assert_eq!(found, FlightError::Damped { root: "kite".into() });
    let model = tree(Link::root("body", Joint::Free, body));
    for argument in ["time", "center_of_mass", "velocity", "angular_momentum"] {
        let mut bad = start;
        match argument {
            "time" => bad.time = f64::NAN,
            "center_of_mass" => bad.center_of_mass.x = f64::INFINITY,
            "velocity" => bad.velocity.y = f64::NAN,
            _ => bad.angular_momentum.z = f64::NAN,
        }
        assert_eq!(Flight::try_new(&model, bad).unwrap_err(), FlightError::NonFinite { argument });
    }
    let found = Flight::from_state(&model, 0.0, &[0.0; 6], &[0.0; 6]).unwrap_err();
    let wrong = |argument, expected, found| {
        DynamicsError::Argument(ArgumentError::Length { argument, expected, found })
    };
    assert_eq!(found, FlightError::Dynamics(wrong("q", 7, 6)));
    let flight = Flight::try_new(&model, start).unwrap();
    let other = humanoid().unwrap();
    let found = flight.angular_velocity(&mut FlightData::new(&other), &model.neutral(), &[0.0; 6]);
    assert_eq!(found.unwrap_err(), DynamicsError::ForeignData);
    let rest = |_: f64, _: &mut [f64], _: &mut [f64]| {};
    let system = flying(flight, &rest);
    assert_eq!(system.state(&[0.0]).unwrap_err(), wrong("orientation", 4, 1));
    assert_eq!(system.state(&[0.0; 4]).unwrap_err(), DynamicsError::NoRotation { joint: "body".into() });
    // a needle has no inertia about its axis, but for rounding
    let rod = MassProperties::rod(1.0, Vector3::new(0.3, -0.2, 0.7), Vector3::new(-0.1, 1.3, 0.4));
    let needle = tree(Link::root("needle", Joint::Free, rod));
    let system = flying(Flight::try_new(&needle, start).unwrap(), &rest);
    let grid = TimeGrid::try_with_steps(0.0, 1.0, 4).unwrap();
    let first = system.state(&[0.0, 0.0, 0.0, 1.0]).unwrap();
    match Run::new(&system, Method::Rkmk, grid).from(&first) {
        Err(IntegrateError::Fault { source, .. }) => {
            assert_eq!(source.downcast_ref(), Some(&DynamicsError::Singular { joint: "needle".into() }));
        }
        other => panic!("{other:?}"),
    }
}
