//! Two-link arms at random, from boundary states and fold alone. `benches/peers/ftla.py` runs the same problems.
//!
//! `cargo run --release -p somersault-ftla --example random_arms -- [count] [seed]` solves the problems in parallel and
//! writes JSON to standard output: each with its parameters, how it ended, residual, spread of the Hamiltonian, the largest
//! defect at a hundredth of the tolerance, cost, times and nodes. A summary goes to standard error.

use rayon::prelude::*;
use serde_json::{Value, json};
use somersault_ftla::cold_start::ArmTravel;
use somersault_ftla::continuation::Continuation;
use somersault_ftla::flow::{FlowTolerances, VariationalFlow};
use somersault_ftla::shooting::{Extremal, ShootingStatus};
use somersault_ftla::system::{ArmMinimumTorque, HamiltonianSystem};
use somersault_testkit::travels::{Travel, random_travels};
use std::error::Error;
use std::time::Instant;

/// What counts as solved: every defect and end condition, by segments re-integrated at 1e-14.
const SOLVED: f64 = 1e-8;

/// The largest defect at the tightest tolerance, and the cost.
fn confirm(system: &ArmMinimumTorque, extremal: &Extremal) -> Result<(f64, f64), Box<dyn Error>> {
    let flow = VariationalFlow::try_new(system, FlowTolerances { relative: 1e-14, absolute: 1e-16 })?;
    let (mut defect, mut cost) = (0.0f64, 0.0);
    for (pair, times) in extremal.nodes.windows(2).zip(extremal.times.windows(2)) {
        let (end, part) = flow.cost(&pair[0], times[1] - times[0])?;
        defect = defect.max((end - &pair[1]).amax());
        cost += part;
    }
    Ok((defect, cost))
}

fn solve(travel: &Travel) -> Result<Value, Box<dyn Error>> {
    let system = ArmMinimumTorque::try_new(travel.arm, [1.0, 0.5])?;
    let half = 0.5 * travel.travel;
    let Travel { fold, horizon, .. } = *travel;
    let problem = ArmTravel { system, initial: [-half, 0.05], last: [half, 0.05], fold, horizon };
    let began = Instant::now();
    let found = problem.solve(&Continuation::default())?.continued;
    let seconds = began.elapsed().as_secs_f64();
    let extremal = &found.extremal;
    let arrived = found.s == 1.0 && extremal.status == ShootingStatus::Converged;
    // a motion that did not arrive has neither
    let (defect, cost) = if arrived { confirm(&system, extremal)? } else { (f64::NAN, f64::NAN) };
    let [low, high] = extremal.range_of(|p| system.hamiltonian(p));
    let ends = [[-half, 0.05, 0.0, 0.0], [half, 0.05, 0.0, 0.0]];
    let nodes = [&extremal.nodes[0], &extremal.nodes[extremal.nodes.len() - 1]];
    let off = (0..2).flat_map(|e| (0..4).map(move |i| (e, i))).map(|(e, i)| (nodes[e][i] - ends[e][i]).abs());
    let off = off.fold(0.0, f64::max);
    Ok(json!({
        "masses": travel.arm.masses, "lengths": travel.arm.lengths, "damping": travel.arm.damping,
        "travel": travel.travel, "horizon": horizon, "fold": fold,
        "solved": arrived && defect.max(off) <= SOLVED, "claimed": arrived, "s": found.s,
        "residual": extremal.residual, "defect": defect.max(off), "hamiltonian_spread": high - low, "cost": cost,
        "seconds": seconds, "members": found.steps, "iterations": found.iterations,
        "evaluations": found.work.evaluations, "times": extremal.times,
        "nodes": extremal.nodes.iter().map(|p| p.as_slice().to_vec()).collect::<Vec<_>>(),
    }))
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let count = arguments.next().map_or(Ok(50), |text| text.parse())?;
    let seed = arguments.next().map_or(Ok(2017), |text| text.parse())?;
    let solved = |travel: &Travel| solve(travel).unwrap_or_else(|error| json!({"error": error.to_string()}));
    let results: Vec<Value> = random_travels(seed, count).par_iter().map(solved).collect();
    let number = |key: &str| results.iter().filter(|r| r[key] == json!(true)).count();
    eprintln!("{} of {count} solved to {SOLVED:e}, {} claimed", number("solved"), number("claimed"));
    println!("{}", serde_json::to_string(&results)?);
    Ok(())
}
