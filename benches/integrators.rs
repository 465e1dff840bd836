//! Time per step of every method in the table: a free box and a heavy body under weight and drag.
//!
//! `cargo bench --bench integrators`; criterion reports the time of one element, which is one step.

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use somersault::integrators::stepper::Scope;
use somersault::prelude::*;
use std::hint::black_box;
use std::time::Duration;

const STEPS: u64 = 10_000;

fn compare<F: ForceModel>(c: &mut Criterion, group: &str, forces: F, applies: impl Fn(&MethodInfo) -> bool) {
    let body = RigidBody::try_box(1.0, Vector3::new(1.0, 2.0, 5.0) / 10f64.cbrt()).expect("a box");
    let system = RigidBodySystem::new(body, forces);
    let start = RigidBodyState::spinning(Vector3::new(1.0, 2.0, 3.0));
    let grid = TimeGrid::try_with_steps(0.0, 5.0, STEPS).expect("a forward interval");
    let mut group = c.benchmark_group(group);
    group.throughput(Throughput::Elements(STEPS));
    for method in Method::ALL.into_iter().filter(|m| applies(&m.info())) {
        group.bench_function(method.info().name, |b| {
            b.iter(|| method.integrate(Options::default(), &system, black_box(&start), &grid, &mut ()))
        });
    }
    group.finish();
}

fn free(c: &mut Criterion) {
    compare(c, "free", (), |_| true);
}

fn forced(c: &mut Criterion) {
    let weight = ConstantForce { force: Vector3::new(0.0, 0.0, -9.81), point: Vector3::new(0.0, 0.0, 0.1) };
    let drag = Drag { linear: 0.1, quadratic: 0.0, angular: 0.01 };
    compare(c, "forced", (weight, drag), |info| info.scope != Scope::TorqueFree);
}

criterion_group! {
    name = steps;
    config = Criterion::default()
        .sample_size(20)
        .warm_up_time(Duration::from_millis(300))
        .measurement_time(Duration::from_millis(1000));
    targets = free, forced
}
criterion_main!(steps);
