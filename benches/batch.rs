//! Steps per second of a batch of free bodies, beside the arithmetic the processor can do at most.
//!
//! A step counts 141 operations (module documentation of `batch::free`), so 141 × steps per second over the peak of the same
//! instructions is the share of the peak in use. `/1000` shows the kernel, `/100` also the copying in and out.

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use nalgebra::{UnitQuaternion, Vector3};
use rayon::ThreadPoolBuilder;
use somersault::core::cancel::CancellationToken;
use somersault_integrators::batch::{AdaptedRuns, ForcedRuns, FreeBodyBatch, FreeRuns, InstructionSet, Runs};
use somersault_integrators::body::RigidBody;
use somersault_integrators::driver::{Adaptive, Steps, TimeGrid};
use somersault_integrators::force::{BoxedForce, Drag, ForceModel, Gravity, Spring};
use somersault_integrators::methods::Method;
use somersault_integrators::orbit::{Elements, Orbit};
use somersault_integrators::satellite::{Field, GravityGradient, MagneticDipole};
use somersault_integrators::state::RigidBodyState;
use somersault_integrators::system::RigidBodySystem;
use std::hint::black_box;
use std::time::Duration;

const BODIES: usize = 10_000;

fn free_bodies() -> FreeBodyBatch {
    let spread = |i: usize| (i as f64).sin();
    let moments: Vec<_> = (0..BODIES).map(|i| Vector3::new(1.0, 1.5 + 0.3 * spread(i), 2.0)).collect();
    let omega: Vec<_> = (0..BODIES).map(|i| Vector3::new(1.0, spread(i), spread(i + 1))).collect();
    FreeBodyBatch::try_new(&moments, &vec![UnitQuaternion::identity(); BODIES], &omega).unwrap()
}

fn steps_per_second(c: &mut Criterion) {
    let mut group = c.benchmark_group("batch of 10000 free bodies");
    let mut batch = free_bodies();
    let dt = vec![0.01; BODIES];
    for threads in [1, 2] {
        let pool = ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        for set in InstructionSet::supported() {
            for steps in [100, 1000] {
                let label = format!("{} on {threads} threads", set.name());
                group.throughput(Throughput::Elements(BODIES as u64 * steps));
                group.bench_function(BenchmarkId::new(label, steps), |b| {
                    let steps = vec![steps; BODIES];
                    b.iter(|| pool.install(|| batch.advance_with(set, &dt, &steps).unwrap()));
                });
            }
        }
    }
}

/// From rigid bodies and states to states: the kernel, and the frames changed before and after.
fn rigid_bodies(c: &mut Criterion) {
    let steps = 100;
    let side = |i: usize| 1.0 + 0.3 * (i as f64).sin();
    let bodies: Vec<_> =
        (0..BODIES).map(|i| RigidBody::try_box(1.0, Vector3::new(1.0, 2.0, side(i))).unwrap()).collect();
    let states: Vec<_> =
        (0..BODIES).map(|i| RigidBodyState::spinning(Vector3::new(1.0, side(i), 0.5))).collect();
    let grids = vec![TimeGrid::try_with_steps(0.0, 1.0, steps).unwrap(); BODIES];
    let systems: Vec<_> = bodies.iter().map(|body| RigidBodySystem::free(*body)).collect();
    let mut group = c.benchmark_group("batch of 10000 rigid bodies, 100 steps");
    group.throughput(Throughput::Elements(BODIES as u64 * steps));
    for threads in [1, 2] {
        let pool = ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        group.bench_function(BenchmarkId::new("integrate", threads), |b| {
            b.iter(|| pool.install(|| FreeRuns::new(&bodies, &grids).from(&states).unwrap()));
        });
        group.bench_function(BenchmarkId::new("integrate_by rkmk_b", threads), |b| {
            b.iter(|| pool.install(|| Runs::new(&systems, Method::RkmkB, &grids).from(&states).unwrap()));
        });
    }
}

/// The same under gravity, drag and a damped spring at a corner: in lanes, and one at a time on each core.
fn forced_bodies(c: &mut Criterion) {
    let side = |i: usize| 1.0 + 0.3 * (i as f64).sin();
    let bodies: Vec<_> =
        (0..BODIES).map(|i| RigidBody::try_box(1.0, Vector3::new(1.0, 2.0, side(i))).unwrap()).collect();
    let states: Vec<_> =
        (0..BODIES).map(|i| RigidBodyState::spinning(Vector3::new(1.0, side(i), 0.5))).collect();
    let grids = vec![TimeGrid::try_with_steps(0.0, 1.0, 100).unwrap(); BODIES];
    let spring = Spring {
        anchor: Vector3::new(0.0, 0.0, 3.0),
        attachment: Vector3::new(0.5, 1.0, 0.5),
        stiffness: 20.0,
        damping: 0.3,
        rest_length: 1.0,
    };
    let drag = Drag { linear: 0.1, quadratic: 0.05, angular: 0.02 };
    let forces = || -> Vec<BoxedForce> { vec![Box::new(Gravity::earth()), Box::new(drag), Box::new(spring)] };
    let systems: Vec<_> = bodies.iter().map(|body| RigidBodySystem::new(*body, forces())).collect();
    let terms_of = |body: &RigidBody| {
        let mut terms = Vec::new();
        assert!(forces().add_terms(body, &mut terms));
        terms
    };
    let terms: Vec<_> = bodies.iter().map(terms_of).collect();
    let mut group = c.benchmark_group("batch of 10000 forced bodies, 100 steps");
    group.throughput(Throughput::Elements(BODIES as u64 * 100));
    for threads in [1, 2] {
        let pool = ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        group.bench_function(BenchmarkId::new("in lanes", threads), |b| {
            b.iter(|| {
                pool.install(|| ForcedRuns::try_new(&bodies, &grids, &terms).unwrap().from(&states).unwrap())
            });
        });
        let settings = Adaptive::with_tolerances(1e-9, 1e-9);
        let adapted = vec![Steps::adapted((0.0, 1.0), settings); BODIES];
        let token = CancellationToken::new();
        group.bench_function(BenchmarkId::new("adapted in lanes", threads), |b| {
            let runs = AdaptedRuns::try_new(&bodies, (0.0, 1.0), settings, &terms).unwrap();
            b.iter(|| pool.install(|| runs.recorded(&states, &[1.0], &token).unwrap()));
        });
        group.bench_function(BenchmarkId::new("adapted rkmk8_b one at a time", threads), |b| {
            b.iter(|| pool.install(|| Runs::new(&systems, Method::Rkmk8B, &adapted).from(&states).unwrap()));
        });
        group.bench_function(BenchmarkId::new("rkmk_b one at a time", threads), |b| {
            b.iter(|| pool.install(|| Runs::new(&systems, Method::RkmkB, &grids).from(&states).unwrap()));
        });
    }
}

/// Satellites on one orbit under the gradient of gravity and a dipole's field: evaluated for several bodies at once, and one at a time.
fn satellites(c: &mut Criterion) {
    let side = |i: usize| 1.0 + 0.3 * (i as f64).sin();
    let bodies: Vec<_> =
        (0..BODIES).map(|i| RigidBody::try_box(1.0, Vector3::new(1.0, 2.0, side(i))).unwrap()).collect();
    let states: Vec<_> =
        (0..BODIES).map(|i| RigidBodyState::spinning(Vector3::new(1e-3, 1e-3 * side(i), 0.0))).collect();
    let grids = vec![TimeGrid::try_with_steps(0.0, 1000.0, 100).unwrap(); BODIES];
    let elements = Elements { eccentricity: 0.1, ..Elements::circle(Elements::EARTH, 7e6) };
    let orbit = Orbit::try_new(elements).unwrap();
    let field = Field::Dipole { orbit, strength: Vector3::z() * -7.8e15 };
    let dipole = MagneticDipole { moment: Vector3::new(0.0, 0.0, 1e-3), field };
    let forces = || -> Vec<BoxedForce> { vec![Box::new(GravityGradient { orbit }), Box::new(dipole)] };
    let systems: Vec<_> = bodies.iter().map(|body| RigidBodySystem::new(*body, forces())).collect();
    let (acting, terms) = (forces(), vec![Vec::new(); BODIES]);
    let acting: Vec<&(dyn ForceModel + Sync)> = acting.iter().map(|force| &**force as _).collect();
    let lists = vec![&acting[..]; BODIES];
    let mut group = c.benchmark_group("batch of 10000 satellites, 100 steps");
    group.throughput(Throughput::Elements(BODIES as u64 * 100));
    let pool = ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    group.bench_function("in lanes", |b| {
        let runs = ForcedRuns::try_new(&bodies, &grids, &terms).unwrap().with_forces(&lists).unwrap();
        b.iter(|| pool.install(|| runs.from(&states).unwrap()));
    });
    group.bench_function("rkmk_b one at a time", |b| {
        b.iter(|| pool.install(|| Runs::new(&systems, Method::RkmkB, &grids).from(&states).unwrap()));
    });
}

/// Rounds of the loops that measure the peak; each has as many independent sums as hide the latency.
#[cfg(target_arch = "x86_64")]
const ROUNDS: u64 = 100_000;

#[cfg(target_arch = "x86_64")]
fn arithmetic_peak(c: &mut Criterion) {
    use std::arch::x86_64::*;

    #[target_feature(enable = "avx2,fma")]
    fn avx2(a: f64, b: f64) {
        let (a, b) = (_mm256_set1_pd(a), _mm256_set1_pd(b));
        let mut sums = [a; 12];
        for _ in 0..ROUNDS {
            for sum in &mut sums {
                *sum = _mm256_fmadd_pd(*sum, a, b);
            }
        }
        black_box(sums);
    }

    #[target_feature(enable = "avx512f")]
    fn avx512(a: f64, b: f64) {
        let (a, b) = (_mm512_set1_pd(a), _mm512_set1_pd(b));
        let mut sums = [a; 16];
        for _ in 0..ROUNDS {
            for sum in &mut sums {
                *sum = _mm512_fmadd_pd(*sum, a, b);
            }
        }
        black_box(sums);
    }

    let mut group = c.benchmark_group("arithmetic peak, operations");
    if is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma") {
        group.throughput(Throughput::Elements(ROUNDS * 12 * 4 * 2));
        // SAFETY: the processor has just been asked for these instructions.
        group.bench_function("avx2", |b| b.iter(|| unsafe { avx2(black_box(0.999), black_box(0.001)) }));
    }
    if is_x86_feature_detected!("avx512f") {
        group.throughput(Throughput::Elements(ROUNDS * 16 * 8 * 2));
        // SAFETY: the processor has just been asked for these instructions.
        group.bench_function("avx512", |b| b.iter(|| unsafe { avx512(black_box(0.999), black_box(0.001)) }));
    }
}

#[cfg(not(target_arch = "x86_64"))]
fn arithmetic_peak(_: &mut Criterion) {}

criterion_group! {
    name = benches;
    config = Criterion::default().sample_size(10).warm_up_time(Duration::from_millis(300)).measurement_time(Duration::from_secs(2));
    targets = arithmetic_peak, steps_per_second, rigid_bodies, forced_bodies, satellites
}
criterion_main!(benches);
