//! One second of the spinning top of thesis 7.3.2 by a method of your choice; prints the direction of the
//! axis at the end. `benches/peers/contact.py` times it.
//!
//! `cargo run --release -p somersault-contact --example spinning_top -- rkmk8_b adaptive 1e-10 1000`: method,
//! `fixed` or `adaptive`, step or tolerance, number of runs.

use nalgebra::Vector3;
use somersault_contact::models::SpinningTop;
use somersault_integrators::driver::{Adaptive, Steps, TimeGrid};
use somersault_integrators::events::Location;
use somersault_integrators::methods::Method;
use somersault_integrators::run::Run;
use std::hint::black_box;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().collect();
    let [_, method, stepping, size, runs] = &arguments[..] else {
        return Err(
            "give a method, `fixed` or `adaptive`, a step or a tolerance, and a number of runs".into()
        );
    };
    let (method, size, runs): (Method, f64, u64) = (method.parse()?, size.parse()?, runs.parse()?);
    let top = SpinningTop::thesis()?;
    let steps = if stepping == "adaptive" {
        Steps::adapted((0.0, 1.0), Adaptive::with_tolerances(size, size))
    } else {
        TimeGrid::try_new(0.0, 1.0, size)?.into()
    };
    let mut state = top.start;
    for _ in 0..runs {
        let run = Run::new(&top.system, method, steps).locating(Location::default());
        state = black_box(run.from(black_box(&top.start))?.state);
    }
    let axis = state.orientation() * Vector3::z();
    println!("{:e} {:e} {:e}", axis.x, axis.y, axis.z);
    Ok(())
}
