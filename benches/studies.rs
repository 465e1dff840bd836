//! The studies of thesis chapter 6: the scan of Table 6.2 and the region of Table 6.1.
//!
//! `cargo bench --bench studies`; the scan reports the time of one step of one body.

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use somersault::integrators::studies::{energy, silent, stability};
use somersault::prelude::*;
use std::time::Duration;

fn scan(c: &mut Criterion) {
    let bodies = energy::prisms(100).expect("prisms");
    let setup = energy::EnergySetup::thesis();
    let steps = bodies.len() as u64 * 100;
    let mut group = c.benchmark_group("table_6_2");
    for method in Method::ALL {
        group.throughput(Throughput::Elements(steps));
        group.bench_function(method.info().name, |b| {
            b.iter(|| energy::energy(method, &setup, &bodies, &mut silent));
        });
    }
    group.throughput(Throughput::Elements(steps * Method::THESIS.len() as u64));
    group.bench_function("table_7_3", |b| {
        b.iter(|| Method::THESIS.map(|method| energy::energy(method, &setup, &bodies, &mut silent)));
    });
    group.finish();
}

fn region(c: &mut Criterion) {
    let mut group = c.benchmark_group("table_6_1");
    for method in [Method::Euler, Method::Sv, Method::Rk4, Method::Ab2, Method::Ab4] {
        group.bench_function(method.info().name, |b| {
            b.iter(|| stability::stability_region(method, Options::default(), &mut silent));
        });
    }
    group.finish();
}

criterion_group! {
    name = studies;
    config = Criterion::default()
        .sample_size(10)
        .warm_up_time(Duration::from_millis(300))
        .measurement_time(Duration::from_millis(2000));
    targets = scan, region
}
criterion_main!(studies);
