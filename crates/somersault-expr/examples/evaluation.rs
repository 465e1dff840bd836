//! Nanoseconds per point of values, Jacobian and Hessian, one point at a time and eight at a time, one core:
//! `cargo run --release -p somersault-expr --example evaluation`. `benches/peers/expressions.py` sets CasADi beside them.

use somersault_expr::{Block, Evaluator, ExprError, ExprFunction, Symbol};
use std::hint::black_box;
use std::time::Instant;

fn blocks(states: usize, controls: usize) -> Vec<Block> {
    vec![Block::new("x", [states]), Block::new("u", [controls])]
}

/// A rocket that climbs through thinning air (R. Goddard).
fn goddard() -> Result<ExprFunction, ExprError> {
    ExprFunction::trace(blocks(3, 1), |v| {
        let (r, speed, m, u) = (v[0][0], v[0][1], v[0][2], v[1][0]);
        let drag = 310.0 * speed * speed * (-500.0 * (r - 1.0)).exp();
        vec![speed, (3.5 * u - drag) / m - 1.0 / (r * r), -7.0 * u]
    })
}

/// A cart with a pendulum.
fn cart_pendulum() -> Result<ExprFunction, ExprError> {
    ExprFunction::trace(blocks(4, 1), |v| {
        let (x, u) = (&v[0], v[1][0]);
        let (s, c) = (x[1].sin(), x[1].cos());
        let total = 1.0 + 0.3 * (1.0 - c * c);
        let a = (u + 0.3 * s * (0.5 * x[3] * x[3] + 9.81 * c)) / total;
        let b = -(u * c + 0.15 * x[3] * x[3] * s * c + 1.3 * 9.81 * s) / (0.5 * total);
        vec![x[2], x[3], a, b]
    })
}

/// A rigid body with three torques: the quaternion and the angular velocity.
fn spacecraft() -> Result<ExprFunction, ExprError> {
    ExprFunction::trace(blocks(7, 3), |v| {
        let (q, w, u) = (&v[0][..4], &v[0][4..], &v[1]);
        let inertia = [1.0, 2.0, 2.5];
        vec![
            -0.5 * (q[1] * w[0] + q[2] * w[1] + q[3] * w[2]),
            0.5 * (q[0] * w[0] + q[2] * w[2] - q[3] * w[1]),
            0.5 * (q[0] * w[1] + q[3] * w[0] - q[1] * w[2]),
            0.5 * (q[0] * w[2] + q[1] * w[1] - q[2] * w[0]),
            (u[0] + (inertia[1] - inertia[2]) * w[1] * w[2]) / inertia[0],
            (u[1] + (inertia[2] - inertia[0]) * w[2] * w[0]) / inertia[1],
            (u[2] + (inertia[0] - inertia[1]) * w[0] * w[1]) / inertia[2],
        ]
    })
}

/// Five point masses on massless links with torques at the joints: M(q) q″ = τ − c(q, q′), by elimination.
fn chain() -> Result<ExprFunction, ExprError> {
    const N: usize = 5;
    ExprFunction::trace(blocks(2 * N, N), |v| {
        let (q, w, u) = (&v[0][..N], &v[0][N..], &v[1]);
        let mass = |i: usize, j: usize| (N - i.max(j)) as f64;
        let mut rows: Vec<Vec<Symbol<'_>>> = Vec::new();
        for i in 0..N {
            let mut row: Vec<_> = (0..N).map(|j| mass(i, j) * (q[i] - q[j]).cos()).collect();
            let mut right = u[i] - mass(i, i) * 9.81 * q[i].sin();
            if i + 1 < N {
                right = right - u[i + 1];
            }
            for j in 0..N {
                right = right - mass(i, j) * (q[i] - q[j]).sin() * (w[j] * w[j]);
            }
            row.push(right);
            rows.push(row);
        }
        for k in 0..N {
            for i in k + 1..N {
                let factor = rows[i][k] / rows[k][k];
                for j in k + 1..=N {
                    rows[i][j] = rows[i][j] - factor * rows[k][j];
                }
            }
        }
        let mut a = vec![q[0]; N];
        for k in (0..N).rev() {
            let mut right = rows[k][N];
            for j in k + 1..N {
                right = right - rows[k][j] * a[j];
            }
            a[k] = right / rows[k][k];
        }
        w.iter().copied().chain(a).collect()
    })
}

/// Nanoseconds per point, the least of fifteen runs.
fn nanoseconds(points: usize, mut run: impl FnMut()) -> f64 {
    run();
    (0..15)
        .map(|_| {
            let start = Instant::now();
            let mut rounds = 0;
            while start.elapsed().as_millis() < 20 {
                run();
                rounds += 1;
            }
            start.elapsed().as_secs_f64() * 1e9 / (rounds * points) as f64
        })
        .fold(f64::INFINITY, f64::min)
}

fn measure(name: &str, mut evaluator: Evaluator) -> Result<(), ExprError> {
    const POINTS: usize = 1000;
    let (n, m) = (evaluator.n_inputs(), evaluator.n_outputs());
    let inputs: Vec<f64> = (0..POINTS * n).map(|k| 1.0 + 0.1 * (k as f64).sin()).collect();
    let mut outputs = vec![0.0; POINTS * m];
    evaluator.evaluate_many(&inputs, &mut outputs)?;
    let one = nanoseconds(POINTS, || {
        for (x, y) in inputs.chunks_exact(n).zip(outputs.chunks_exact_mut(m)) {
            black_box(evaluator.evaluate(black_box(x), y)).ok();
        }
    });
    let many = nanoseconds(POINTS, || {
        black_box(evaluator.evaluate_many(black_box(&inputs), &mut outputs)).ok();
    });
    let instructions = evaluator.n_instructions();
    println!(
        "{{\"name\": \"{name}\", \"instructions\": {instructions}, \"one\": {one:.2}, \"eight\": {many:.2}}}"
    );
    Ok(())
}

fn main() -> Result<(), ExprError> {
    let functions = [
        ("Goddard", goddard()?),
        ("cart-pendulum", cart_pendulum()?),
        ("spacecraft", spacecraft()?),
        ("chain of five", chain()?),
    ];
    for (name, f) in functions {
        measure(&format!("{name}, values"), f.evaluator())?;
        measure(&format!("{name}, Jacobian"), f.jacobian()?.evaluator())?;
        measure(&format!("{name}, Hessian"), f.hessian()?.evaluator())?;
    }
    Ok(())
}
