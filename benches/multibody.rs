//! Time per call of the dynamics of the spatial diver, 27 degrees of freedom (thesis Table 3.2), and of their
//! partials.
//!
//! `cargo bench --bench multibody`; `benches/peers/multibody.py` times Pinocchio on the same tree and state.

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use nalgebra::Vector3;
use num_dual::Dual64;
use somersault::core::cancel::CancellationToken;
use somersault::core::lanes::InstructionSet;
use somersault::integrators::methods::RungeKuttaMuntheKaas4;
use somersault::multibody::flight::{
    Flight, FlightChange, FlightData, FlightShapes, FlightSystem, HeldPosture, JointCurves, KnownFlight,
    TakeOff,
};
use somersault::multibody::models::{BallJointedDiver, Diver, Posture};
use somersault::multibody::motion::{HeldTorques, TreeSystem, rollout};
use somersault::multibody::{
    Data, DerivativeData, LaneData, LaneDerivativeData, SecondDerivativeData, Split,
};
use somersault::prelude::{Method, Run, TimeGrid};
use somersault_testkit::trees::{Random, State, diver, geared_diver, humanoid, random_configuration};
use std::f64::consts::PI;
use std::hint::black_box;
use std::time::Duration;

fn diver_dynamics(c: &mut Criterion) {
    let State { model, q, v, a, torque } = diver();
    let n = model.n_velocities();
    let mut data = Data::new(&model);
    let mut group = c.benchmark_group("diver");
    group.bench_function("rnea", |b| {
        b.iter(|| model.inverse_dynamics(&mut data, black_box(&q), &v, &a, &[]).map(|t| t[0]))
    });
    group.bench_function("crba", |b| {
        b.iter(|| model.mass_matrix(&mut data, black_box(&q)).map(|m| m[(0, 0)]))
    });
    group.bench_function("aba", |b| {
        b.iter(|| model.forward_dynamics(&mut data, black_box(&q), &v, &torque, &[]).map(|a| a[0]))
    });
    let split = Split::new((0..n).map(|k| k >= 6).collect());
    let (mut acceleration, mut force) = (a.clone(), torque.clone());
    group.bench_function("hybrid", |b| {
        b.iter(|| {
            model.hybrid_dynamics(&mut data, &split, black_box(&q), &v, &mut acceleration, &mut force, &[])
        })
    });
    group.bench_function("centroidal", |b| {
        b.iter(|| model.centroidal(&mut data, black_box(&q)).map(|c| c.matrix[(0, 0)]))
    });
    let mut work = DerivativeData::new(&model);
    group.bench_function("rnea_partials", |b| {
        b.iter(|| model.inverse_dynamics_partials(&mut work, black_box(&q), &v, &a, &[]).map(|p| p.q[(0, 0)]))
    });
    group.bench_function("aba_partials", |b| {
        b.iter(|| {
            model.forward_dynamics_partials(&mut work, black_box(&q), &v, &torque, &[]).map(|p| p.q[(0, 0)])
        })
    });
    group.bench_function("hybrid_partials", |b| {
        b.iter(|| {
            let q = black_box(&q);
            model.hybrid_dynamics_partials(&mut work, &split, q, &v, &a, &[]).map(|p| p.q[(0, 0)])
        })
    });
    // along each position and velocity, as exact Hessians of optimal control ask for them
    let (n_q, mut second) = (model.n_positions(), SecondDerivativeData::default());
    let length = n_q + 2 * n;
    let mut directions = vec![0.0; 2 * n * length];
    directions.chunks_mut(length).enumerate().for_each(|(k, row)| row[k + n_q - n] = 1.0);
    let mut rows = vec![0.0; (2 * n + 1) * 3 * n];
    group.bench_function("rnea_second_derivatives", |b| {
        b.iter(|| {
            let q = black_box(&q);
            model.inverse_dynamics_second_derivatives(&mut second, q, &v, &a, &[], &v, &directions, &mut rows)
        })
    });
    let dual = model.cast::<Dual64>();
    let mut work_of_duals = DerivativeData::new(&dual);
    let state: Vec<Dual64> = q.iter().chain(&v).chain(&a).map(|&x| Dual64::from_re(x)).collect();
    group.bench_function("rnea_second_derivatives, dual numbers", |b| {
        b.iter(|| {
            let mut sum = 0.0;
            for direction in directions.chunks(length) {
                let moved: Vec<_> =
                    black_box(&state).iter().zip(direction).map(|(x, d)| Dual64::new(x.re, *d)).collect();
                let (q, rest) = moved.split_at(n_q);
                let (v, a) = rest.split_at(n);
                let found =
                    dual.inverse_dynamics_partials(&mut work_of_duals, q, v, a, &[]).expect("lengths fit");
                sum += found.q[(0, 0)].eps;
            }
            sum
        })
    });
    group.bench_function("momentum_partials", |b| {
        b.iter(|| model.momentum_partials(&mut work, black_box(&q), &v).map(|p| p.q[(0, 0)]))
    });
    group.finish();
}

/// The same diver with an elbow that follows the other one: the mass matrix and its sparse factors in the place of
/// articulated inertias.
fn geared_dynamics(c: &mut Criterion) {
    let State { model, q, v, a, torque } = geared_diver();
    let (mut data, mut work) = (Data::new(&model), DerivativeData::new(&model));
    let mut group = c.benchmark_group("geared diver");
    group.bench_function("rnea", |b| {
        b.iter(|| model.inverse_dynamics(&mut data, black_box(&q), &v, &a, &[]).map(|t| t[0]))
    });
    group.bench_function("forward", |b| {
        b.iter(|| model.forward_dynamics(&mut data, black_box(&q), &v, &torque, &[]).map(|a| a[0]))
    });
    group.bench_function("forward_partials", |b| {
        b.iter(|| {
            model.forward_dynamics_partials(&mut work, black_box(&q), &v, &torque, &[]).map(|p| p.q[(0, 0)])
        })
    });
    group.finish();
}

/// Many states of the diver, a thousand at a time on one core: one by one, and in the lanes of each set of instructions.
fn many_states(c: &mut Criterion) {
    const COUNT: usize = 1024;
    let model = diver().model;
    let (n_q, n) = (model.n_positions(), model.n_velocities());
    let mut random = Random::new(28);
    let mut q = Vec::with_capacity(COUNT * n_q);
    for _ in 0..COUNT {
        q.extend(random_configuration(&mut random, &model).expect("lengths fit"));
    }
    let [v, input] = [(); 2].map(|()| random.numbers(COUNT * n, 2.0));
    let mut out = vec![0.0; COUNT * n];
    let length = n + 3 * n * n;
    let mut rows = vec![0.0; COUNT * length];
    let mut group = c.benchmark_group("1024 states of the diver");
    group.throughput(Throughput::Elements(COUNT as u64));
    let (mut data, mut work) = (Data::new(&model), DerivativeData::new(&model));
    group.bench_function("a step of a rollout", |b| {
        let grid = TimeGrid::try_new(0.0, 1e-3, 1e-3).expect("an interval");
        let (torques, token) = (HeldTorques::default(), CancellationToken::new());
        b.iter(|| rollout(&model, &q, &v, &grid, &torques, 1, &token).expect("the diver moves"))
    });
    group.bench_function("a step, one by one", |b| {
        let grid = TimeGrid::try_new(0.0, 1e-3, 1e-3).expect("an interval");
        let system = TreeSystem::new(&model, ());
        b.iter(|| {
            for (q, v) in q.chunks_exact(n_q).zip(v.chunks_exact(n)) {
                let start = model.state(q, v).expect("lengths fit");
                let run = Run::by_stepper(&system, &RungeKuttaMuntheKaas4, grid);
                black_box(run.from(&start).expect("the diver moves"));
            }
        })
    });
    group.bench_function("rnea, one by one", |b| {
        b.iter(|| {
            for (i, out) in out.chunks_mut(n).enumerate() {
                let (q, v, a) = (&q[i * n_q..][..n_q], &v[i * n..][..n], &input[i * n..][..n]);
                out.copy_from_slice(model.inverse_dynamics(&mut data, q, v, a, &[]).expect("lengths fit"));
            }
        })
    });
    group.bench_function("aba, one by one", |b| {
        b.iter(|| {
            for (i, out) in out.chunks_mut(n).enumerate() {
                let (q, v, torque) = (&q[i * n_q..][..n_q], &v[i * n..][..n], &input[i * n..][..n]);
                out.copy_from_slice(model.forward_dynamics(&mut data, q, v, torque, &[]).expect("a mass"));
            }
        })
    });
    group.bench_function("aba_partials, one by one", |b| {
        b.iter(|| {
            for (i, row) in rows.chunks_mut(length).enumerate() {
                let (q, v, torque) = (&q[i * n_q..][..n_q], &v[i * n..][..n], &input[i * n..][..n]);
                let found = model.forward_dynamics_partials(&mut work, q, v, torque, &[]).expect("a mass");
                let (value, matrices) = row.split_at_mut(n);
                value.copy_from_slice(found.value);
                for (matrix, to) in [found.q, found.v, found.input].iter().zip(matrices.chunks_mut(n * n)) {
                    to.copy_from_slice(matrix.as_slice());
                }
            }
        })
    });
    for set in InstructionSet::supported() {
        let mut data = LaneData::with_instructions(&model, set);
        let mut work = LaneDerivativeData::with_instructions(&model, set);
        group.bench_function(BenchmarkId::new("rnea", set.name()), |b| {
            b.iter(|| model.inverse_dynamics_many(&mut data, black_box(&q), &v, &input, &[], &mut out))
        });
        group.bench_function(BenchmarkId::new("aba", set.name()), |b| {
            b.iter(|| model.forward_dynamics_many(&mut data, black_box(&q), &v, &input, &[], &mut out))
        });
        group.bench_function(BenchmarkId::new("aba_partials", set.name()), |b| {
            b.iter(|| {
                model.forward_dynamics_partials_many(&mut work, black_box(&q), &v, &input, &[], &mut rows)
            })
        });
    }
    group.finish();
}

/// One evaluation of reduced flight, with and without derivatives, and a dive of 1.7 s in 200 steps.
fn reduced_flight(c: &mut Criterion) {
    let model = humanoid().expect("a tree");
    let mut random = Random::new(27);
    let q = random_configuration(&mut random, &model).expect("lengths fit");
    let v = random.numbers(model.n_velocities(), 2.0);
    let flight = Flight::from_state(&model, 0.0, &q, &v).expect("a free root");
    let mut data = FlightData::new(&model);
    let mut group = c.benchmark_group("flight");
    group.bench_function("angular velocity", |b| {
        b.iter(|| flight.angular_velocity(&mut data, black_box(&q), &v).map(|w| w.x))
    });
    group.bench_function("derivatives", |b| {
        b.iter(|| flight.derivatives(&mut data, black_box(&q), &v).map(|d| d.by_shape[0].x))
    });
    let count = 256;
    let (mut many, mut rates) = (Vec::new(), Vec::new());
    for _ in 0..count {
        many.extend(random_configuration(&mut random, &model).expect("lengths fit"));
        rates.extend(random.numbers(model.n_velocities(), 2.0));
    }
    let mut rows = vec![0.0; count * (6 * model.n_velocities() + 12)];
    for set in InstructionSet::supported() {
        let mut shapes = FlightShapes::with_instructions(set);
        group.bench_function(BenchmarkId::new("derivatives of 256 states", set.name()), |b| {
            b.iter(|| flight.derivatives_many(&mut shapes, black_box(&many), &rates, &mut rows))
        });
    }
    let swing = |t: f64, s: &mut [f64], rates: &mut [f64]| {
        s.copy_from_slice(&q[7..]);
        s[0] += (3.0 * t).sin();
        rates.fill(0.0);
        rates[0] = 3.0 * (3.0 * t).cos();
    };
    let system = FlightSystem::new(flight, &swing);
    let start = system.state(&q[3..7]).expect("a quaternion");
    let grid = TimeGrid::try_with_steps(0.0, 1.7, 200).expect("a grid");
    group.bench_function("dive of 200 steps", |b| {
        b.iter(|| {
            let start = black_box(&start);
            Run::new(&system, Method::Cf4, grid).from(start).map(|end| end.t)
        })
    });
    group.finish();
}

/// A somersault of 1.2 s with joints at 61 times, flown again with derivatives: of a pike that is opened later.
fn flown_again(c: &mut Criterion) {
    let mut group = c.benchmark_group("flight flown again");
    let balls = BallJointedDiver::new(Diver::spatial());
    let hinged = |diver: Diver| {
        let postures = [Posture::A, Posture::H].map(|p| diver.configuration(p).expect("a posture"));
        (diver.model().expect("valid"), postures)
    };
    let with_balls = [Posture::A, Posture::H].map(|p| balls.configuration(p).expect("a posture"));
    for (name, (model, [open, closed])) in [
        ("planar", hinged(Diver::planar())),
        ("spatial", hinged(Diver::spatial())),
        ("ball-jointed", (balls.model().expect("valid"), with_balls)),
    ] {
        let (root_q, root_v) = (model.positions_of(0).len(), model.velocities_of(0).len());
        let mut apart = vec![0.0; model.n_velocities()];
        model.difference(&open, &closed, &mut apart).expect("of the model");
        apart[..root_v].fill(0.0);
        let times: Vec<f64> = (0..=60).map(|i| 0.02 * f64::from(i)).collect();
        let (mut positions, mut velocities, mut q) = (Vec::new(), Vec::new(), open.clone());
        for t in &times {
            let w = PI / 1.2;
            let (folded, folding) = ((w * t).sin().powi(2), w * (2.0 * w * t).sin());
            let along: Vec<f64> = apart.iter().map(|x| x * folded).collect();
            model.displace(&open, &along, &mut q).expect("of the model");
            positions.extend_from_slice(&q[root_q..]);
            velocities.extend(apart[root_v..].iter().map(|x| x * folding));
        }
        let direction = apart[root_v..].iter().map(|x| 0.1 * x).collect();
        let curves = JointCurves::try_new(&model, times, positions, velocities).expect("rising times");
        let take_off = TakeOff {
            time: 0.0,
            center_of_mass: Vector3::zeros(),
            velocity: Vector3::new(1.0, 0.0, 4.0),
            angular_momentum: Vector3::y() * 45.0,
        };
        let at = model.joint(0).expect("a root").kind().orientation();
        let held = HeldPosture { times: [0.2, 0.5, 0.7, 1.0], direction };
        let known = KnownFlight::try_new(&model, take_off, &open[at], curves, held).expect("a free root");
        let change = FlightChange { opening: 0.05, ..FlightChange::default() };
        group.bench_function(name, |b| {
            b.iter(|| known.fly(black_box(&change)).map(|flown| flown.by_change[0]))
        });
    }
    group.finish();
}

criterion_group! {
    name = multibody;
    config = Criterion::default()
        .sample_size(30)
        .warm_up_time(Duration::from_millis(300))
        .measurement_time(Duration::from_millis(1000));
    targets = diver_dynamics, geared_dynamics, many_states, reduced_flight, flown_again
}
criterion_main!(multibody);
