//! Collocation on problems whose lowest cost is known.
//!
//! `cargo run --release -p somersault-ocp --example collocation_optima` solves all of them to 10⁻⁶ and 10⁻⁸ and lists status,
//! cost, its error and its estimate. `-- 1e-7 Goddard` takes that tolerance and the problems with that in their name.

#[path = "../../../tests/collocation/known.rs"]
mod known;

use somersault_nlp::Flow;
use somersault_ocp::collocation::{Collocation, CollocationStatus};
use std::error::Error;
use std::time::Instant;

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let tolerances = match arguments.first() {
        Some(tolerance) => vec![tolerance.parse()?],
        None => vec![1e-6, 1e-8],
    };
    let wanted = arguments.get(1).map_or("", String::as_str);
    for tolerance in tolerances {
        for known in known::ALL.iter().filter(|known| known.name.contains(wanted)) {
            let collocation = Collocation { tolerance, ..Collocation::default() };
            let began = Instant::now();
            let report = collocation.solve(&mut known.problem(), &[known.mesh()], &mut |_| Flow::Continue)?;
            let error = (report.cost - known.cost).abs() / known.cost.abs().max(1.0);
            let is_false = report.status == CollocationStatus::Converged && error > 10.0 * tolerance;
            let points: usize = report.phases.iter().map(|phase| phase.mesh().n_points()).sum();
            println!(
                "{tolerance:.0e} {:32} {:?}{} cost {:.12} error {error:.1e}, {} | {} meshes {points} points {} steps {:.2} s",
                known.name,
                report.status,
                if is_false { " FALSE" } else { "" },
                report.cost,
                report
                    .accuracy()
                    .shortfall(tolerance)
                    .unwrap_or_else(|| format!("estimate {:.1e}", report.accuracy().cost)),
                report.history.len(),
                report.history.iter().map(|mesh| mesh.iterations).sum::<usize>(),
                began.elapsed().as_secs_f64(),
            );
        }
    }
    Ok(())
}
