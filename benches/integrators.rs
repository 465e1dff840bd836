//! Every method in the table: time per step for a free box and for a body under weight and drag, and the
//! work–precision table of the cases of thesis 7.2.1.
//!
//! `cargo bench --bench integrators`; criterion reports the time of one element, which is one step.

use criterion::{Criterion, Throughput, criterion_group};
use somersault::integrators::counted::Counted;
use somersault::integrators::stepper::Scope;
use somersault::integrators::studies::problem::Case;
use somersault::integrators::studies::silent;
use somersault::integrators::studies::work_precision::{StepChoice, work_precision};
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
            b.iter(|| Run::new(&system, method, grid).from(black_box(&start)))
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

/// Prints the least computation time, in ms, to reach each orientation error after ten seconds.
fn work_precision_table() {
    const ERRORS: [f64; 4] = [1e-2, 1e-4, 1e-6, 1e-9];
    // Three steps to a decade; beyond 10⁶ steps nothing is learnt that the slope does not say.
    let steps: Vec<_> = (0..=15).map(|k| StepChoice::Fixed(10f64.powf(-f64::from(k) / 3.0))).collect();
    let tolerances: Vec<_> = (3..=13).map(|k| StepChoice::Tolerance(10f64.powi(-k))).collect();
    for case in [Case::One, Case::Two, Case::Three] {
        println!("\nleast time in ms to an orientation error after 10 s, thesis 7.2.1 case {case:?}");
        println!("{:20}{:>10.0e}{:>10.0e}{:>10.0e}{:>10.0e}", "", ERRORS[0], ERRORS[1], ERRORS[2], ERRORS[3]);
        let problem = case.problem().expect("a case of the thesis");
        let counted = Counted::new(problem.system());
        for method in Method::ALL {
            let mut rows = vec![(method.to_string(), &steps)];
            if method.info().embedded.is_some() {
                rows.push((format!("{method} adaptive"), &tolerances));
            }
            for (name, choices) in rows {
                // One at a time: a step too large for a method ends that run, not the table.
                let points: Vec<_> = choices
                    .iter()
                    .filter_map(|choice| {
                        let options = Options::default();
                        work_precision(&problem, &counted, method, options, &[*choice], 2, &mut silent).ok()
                    })
                    .flatten()
                    .collect();
                print!("{name:20}");
                for error in ERRORS {
                    let reached = points.iter().filter(|p| p.errors.orientation <= error);
                    let least = reached.map(|p| p.seconds).fold(f64::INFINITY, f64::min);
                    if least.is_finite() { print!("{:>10.4}", 1e3 * least) } else { print!("{:>10}", "–") }
                }
                println!();
            }
        }
    }
}

criterion_group! {
    name = steps;
    config = Criterion::default()
        .sample_size(20)
        .warm_up_time(Duration::from_millis(300))
        .measurement_time(Duration::from_millis(1000));
    targets = free, forced
}

fn main() {
    steps();
    // Criterion's own arguments choose among its benchmarks; a run of all of them ends with the table.
    if std::env::args().skip(1).all(|argument| argument == "--bench") {
        work_precision_table();
    }
    Criterion::default().configure_from_args().final_summary();
}
