//! Times the dynamics of the spatial diver: `cargo run --release -p somersault-testkit --example time_diver`.
//!
//! Prints a name and the least microseconds per call on each line, in the same way as `benches/peers/pinocchio.cpp`;
//! with the argument `urdf` prints the diver as URDF instead. For statistics see `benches/multibody.rs`.

use somersault_multibody::{Data, DerivativeData, DynamicsError, urdf};
use somersault_testkit::trees::{State, diver};
use std::error::Error;
use std::hint::black_box;
use std::time::Instant;

/// The least time of a call over 200 samples of 200 calls, μs.
fn report(name: &str, mut call: impl FnMut() -> Result<(), DynamicsError>) -> Result<(), DynamicsError> {
    let mut best = f64::INFINITY;
    for _ in 0..200 {
        let start = Instant::now();
        for _ in 0..200 {
            call()?;
        }
        best = best.min(start.elapsed().as_secs_f64() / 200.0);
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
    Ok(())
}
