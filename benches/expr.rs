//! A traced function: tracing and differentiating it, and its values, Jacobian and Hessian at one point and at a thousand.
//!
//! `cargo bench --bench expr`; `benches/peers/expressions.py` times CasADi on such functions.

use criterion::{Criterion, criterion_group, criterion_main};
use somersault::expr::{Block, ExprError, ExprFunction};
use std::hint::black_box;
use std::time::Duration;

/// A cart with a pendulum.
fn cart_pendulum() -> Result<ExprFunction, ExprError> {
    ExprFunction::trace(vec![Block::new("x", [4]), Block::new("u", [])], |v| {
        let (x, u) = (&v[0], v[1][0]);
        let (s, c) = (x[1].sin(), x[1].cos());
        let total = 1.0 + 0.3 * (1.0 - c * c);
        let a = (u + 0.3 * s * (0.5 * x[3] * x[3] + 9.81 * c)) / total;
        let b = -(u * c + 0.15 * x[3] * x[3] * s * c + 1.3 * 9.81 * s) / (0.5 * total);
        vec![x[2], x[3], a, b]
    })
}

fn traced_functions(c: &mut Criterion) {
    let mut group = c.benchmark_group("traced cart-pendulum");
    group.bench_function("trace", |b| b.iter(cart_pendulum));
    group.bench_function("trace and differentiate twice", |b| {
        b.iter(|| {
            let f = cart_pendulum().expect("valid");
            f.hessian().map(|hessian| hessian.sparsity().rows.len())
        });
    });
    let f = cart_pendulum().expect("valid");
    let jacobian = f.jacobian().expect("valid").evaluator();
    let hessian = f.hessian().expect("valid").evaluator();
    for (name, mut evaluator) in [("values", f.evaluator()), ("Jacobian", jacobian), ("Hessian", hessian)] {
        let (n, m) = (evaluator.n_inputs(), evaluator.n_outputs());
        let points: Vec<f64> = (0..1000 * n).map(|k| 1.0 + 0.1 * (k as f64).sin()).collect();
        let mut values = vec![0.0; 1000 * m];
        group.bench_function(format!("{name}, one point"), |b| {
            b.iter(|| evaluator.evaluate(black_box(&points[..n]), &mut values[..m]));
        });
        group.bench_function(format!("{name}, a thousand points"), |b| {
            b.iter(|| evaluator.evaluate_many(black_box(&points), &mut values));
        });
    }
    group.finish();
}

criterion_group! {
    name = benches;
    config = Criterion::default().measurement_time(Duration::from_secs(2));
    targets = traced_functions
}
criterion_main!(benches);
