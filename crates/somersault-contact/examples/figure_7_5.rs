//! Figure 7.5 of the thesis with located events and without, as one table.
//!
//! `cargo run --release -p somersault-contact --example figure_7_5`

use somersault_contact::models::SpinningTop;
use somersault_contact::studies::{Stepping, convergence, errors, spinning_top};
use somersault_integrators::driver::TimeGrid;
use somersault_integrators::events::Location;
use somersault_integrators::methods::{Method, Options};
use somersault_integrators::run::Run;
use somersault_integrators::studies::silent;

/// Step sizes at which the order shows, and how many to average over: fine ones where the first order is
/// looked for, coarse ones where the fifth and the eighth would soon be lost in rounding.
fn sampling(method: Method, stepping: Stepping) -> (Vec<f64>, u32) {
    let (first, ratio, count, sizes) = match stepping {
        Stepping::Straddling if method.info().orders.rotation > 2 => (2.5e-4, 0.5, 6, 48),
        Stepping::Straddling => (3.125e-5, 0.5, 4, 24),
        Stepping::Located if method.info().orders.rotation > 4 => {
            (8e-3, std::f64::consts::FRAC_1_SQRT_2, 13, 8)
        }
        Stepping::Located => (2e-3, 0.5, 11, 1),
    };
    ((0..count).map(|k| first * f64::powi(ratio, k)).collect(), sizes)
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let top = SpinningTop::thesis()?;
    let options = Options::default();
    let (early, late) = (spinning_top(&top, 0.1)?, spinning_top(&top, 1.0)?);

    let grid = TimeGrid::try_new(0.0, 1.0, 1e-4)?;
    let run = Run::new(&top.system, Method::Rkmk8B, grid).locating(Location::default()).from(&top.start)?;
    println!("{} switches in 1 s:", run.events.len());
    for event in &run.events {
        println!("  {:.12} s {:?}", event.t, event.kind);
    }
    for (problem, steps) in [(&early, 100_000), (&late, 1_000_000)] {
        let off = errors(problem, Method::Rkmk, options, Stepping::Straddling, steps)?;
        println!("the thesis' reference, rkmk at 1e-6 s without location, at {} s: {off:?}", problem.t_end());
    }

    println!(
        "\nOrders at 0.1 s (without location, of the geometric mean over 24 or 48 step sizes an octave); error of the \
         orientation at 1 s, rad, for steps of 1e-2 to 1e-6 s; the largest step with which the top still \
         stands after 1 s.\n"
    );
    println!(
        "| method | steps | position | orientation | velocity | angular velocity | 1e-2 | 1e-3 | 1e-4 | 1e-5 | 1e-6 | stands |"
    );
    println!("|---|---|---:|---:|---:|---:|---:|---:|---:|---:|---:|---:|");
    for method in Method::ALL.into_iter().filter(|m| m.info().takes_any_forces()) {
        for (stepping, name) in [(Stepping::Located, "located"), (Stepping::Straddling, "straddling")] {
            let (dts, sizes) = sampling(method, stepping);
            let orders = convergence(&early, method, options, stepping, &dts, sizes, &mut silent)?.orders;
            print!("| {method} | {name} |");
            for order in [orders.position, orders.orientation, orders.velocity, orders.angular_velocity] {
                print!(" {} |", order.map_or("–".to_owned(), |p| format!("{p:.2}")));
            }
            for steps in [100, 1_000, 10_000, 100_000, 1_000_000] {
                print!(" {:.1e} |", errors(&late, method, options, stepping, steps)?.orientation);
            }
            let mut stands = None;
            for steps in [10_000, 5_000, 2_000, 1_000, 500, 200, 100] {
                // The height of a top that stands is within a millimetre of the reference.
                if errors(&late, method, options, stepping, steps)?.position > 1e-3 {
                    break;
                }
                stands = Some(1.0 / steps as f64);
            }
            println!(" {} |", stands.map_or("–".to_owned(), |dt| format!("{dt:.0e}")));
        }
    }
    Ok(())
}
