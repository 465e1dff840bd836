//! Transition matrices of the two-link arm over 3.5 s at 1e-9, for a cloud of points within 1e-4 of the optimal p(0); and
//! the thesis' motion to 1e-11 from its boundary states and the fold.
//!
//! `cargo bench --bench ftla`; the throughput is in points per second on one core, the cold start on all.

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use nalgebra::DVector;
use somersault::ftla::cold_start::ArmTravel;
use somersault::ftla::continuation::Continuation;
use somersault::ftla::flow::{FlowTolerances, VariationalFlow};
use somersault::ftla::shooting::ShootingStatus;
use somersault::ftla::system::ArmMinimumTorque;
use somersault_testkit::trees::Random;
use std::f64::consts::FRAC_PI_2;
use std::hint::black_box;

/// Start of the thesis' motion, from the continuation of `crates/somersault-ftla/tests/ftla/extremals.rs`.
const START: [f64; 8] = [
    -FRAC_PI_2,
    0.05,
    0.0,
    0.0,
    -0.20342284657942628,
    -0.013000184725439342,
    -1.3301476310359088,
    -0.12234910357574813,
];

fn transition_matrices(c: &mut Criterion) {
    let arm = ArmMinimumTorque::default();
    let tolerances = FlowTolerances { relative: 1e-9, absolute: 1e-9 };
    let flow = VariationalFlow::try_new(&arm, tolerances).expect("tolerances in range");
    let mut random = Random::new(35);
    let cloud: Vec<DVector<f64>> = (0..100)
        .map(|_| DVector::from_row_slice(&START) + DVector::from_vec(random.numbers(8, 1e-4)))
        .collect();
    let mut group = c.benchmark_group("transition");
    group.throughput(Throughput::Elements(cloud.len() as u64));
    group.sample_size(20);
    group.bench_function("arm, 3.5 s", |b| {
        b.iter(|| {
            let ends =
                cloud.iter().map(|p| flow.transition(black_box(p), 3.5).expect("regular").matrix[(0, 0)]);
            ends.sum::<f64>()
        })
    });
    group.bench_function("arm, 3.5 s, state alone", |b| {
        b.iter(|| cloud.iter().map(|p| flow.state(black_box(p), 3.5).expect("regular")[0]).sum::<f64>())
    });
    group.finish();
}

fn cold_start(c: &mut Criterion) {
    let thesis = ArmTravel::default();
    let mut group = c.benchmark_group("cold start");
    group.sample_size(20);
    group.bench_function("arm, 10 s", |b| {
        b.iter(|| {
            let found = black_box(&thesis).solve(&Continuation::default()).expect("well posed").continued;
            assert_eq!(found.extremal.status, ShootingStatus::Converged);
            found.extremal.residual
        })
    });
    group.finish();
}

criterion_group!(benches, transition_matrices, cold_start);
criterion_main!(benches);
