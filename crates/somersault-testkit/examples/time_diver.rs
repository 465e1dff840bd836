//! Times the dynamics of the spatial diver: `cargo run --release -p somersault-testkit --example time_diver`.
//!
//! Prints a name and the least microseconds per call on each line, of a state where a call takes many, in the same way
//! as `benches/peers/pinocchio.cpp`; with the argument `urdf` prints the diver as URDF instead. For statistics see
//! `benches/multibody.rs`.

use somersault_multibody::{Data, DerivativeData, DynamicsError, LaneData, LaneDerivativeData, urdf};
use somersault_testkit::trees::{State, diver};
use std::error::Error;
use std::hint::black_box;
use std::time::Instant;

/// States of a call that takes many.
const STATES: usize = 256;

/// The least time of a call over 200 samples of 200 calls, μs.
fn report(name: &str, call: impl FnMut() -> Result<(), DynamicsError>) -> Result<(), DynamicsError> {
    report_of(name, 200, 1, call)
}

/// The least time of a state over 200 samples of `calls` calls for `states` of them, μs.
fn report_of(
    name: &str,
    calls: usize,
    states: usize,
    mut call: impl FnMut() -> Result<(), DynamicsError>,
) -> Result<(), DynamicsError> {
    let mut best = f64::INFINITY;
    for _ in 0..200 {
        let start = Instant::now();
        for _ in 0..calls {
            call()?;
        }
        best = best.min(start.elapsed().as_secs_f64() / (calls * states) as f64);
    }
    println!("{name} {:.4}", best * 1e6);
    Ok(())
}

fn main() -> Result<(), Box<dyn Error>> {
    let State { model, q, v, a, torque } = diver();
    if std::env::args().nth(1).as_deref() == Some("urdf") {
        println!("{}", urdf::write(&model, "diver")?);
        return Ok(());
    }
    let (mut data, mut work) = (Data::new(&model), DerivativeData::new(&model));
    report("rnea", || {
        model.inverse_dynamics(&mut data, black_box(&q), &v, &a, &[]).map(|x| _ = black_box(x))
    })?;
    report("crba", || model.mass_matrix(&mut data, black_box(&q)).map(|x| _ = black_box(x)))?;
    report("aba", || {
        model.forward_dynamics(&mut data, black_box(&q), &v, &torque, &[]).map(|x| _ = black_box(x))
    })?;
    report("rnea_partials", || {
        model.inverse_dynamics_partials(&mut work, black_box(&q), &v, &a, &[]).map(|x| _ = black_box(x))
    })?;
    report("aba_partials", || {
        model.forward_dynamics_partials(&mut work, black_box(&q), &v, &torque, &[]).map(|x| _ = black_box(x))
    })?;
    let many = |x: &[f64]| x.repeat(STATES);
    let (q, v, a, torque) = (many(&q), many(&v), many(&a), many(&torque));
    let (mut lanes, mut out) = (LaneData::new(&model), torque.clone());
    report_of("rnea_many", 1, STATES, || {
        model.inverse_dynamics_many(&mut lanes, black_box(&q), &v, &a, &[], &mut out)
    })?;
    let (n, mut work) = (model.n_velocities(), LaneDerivativeData::new(&model));
    let (mut matrices, mut rows) = (vec![0.0; STATES * n * n], vec![0.0; STATES * (n + 3 * n * n)]);
    report_of("crba_many", 1, STATES, || model.mass_matrix_many(&mut lanes, black_box(&q), &mut matrices))?;
    report_of("aba_many", 1, STATES, || {
        model.forward_dynamics_many(&mut lanes, black_box(&q), &v, &torque, &[], &mut out)
    })?;
    report_of("rnea_partials_many", 1, STATES, || {
        model.inverse_dynamics_partials_many(&mut work, black_box(&q), &v, &a, &[], &mut rows)
    })?;
    report_of("aba_partials_many", 1, STATES, || {
        model.forward_dynamics_partials_many(&mut work, black_box(&q), &v, &torque, &[], &mut rows)
    })?;
    Ok(())
}
