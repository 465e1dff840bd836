//! The two-link arm of thesis 8.4: its extremals, and what `benches/peers/ftla.py` times.
//!
//! `cargo run --release -p somersault-ftla --example arm` lists extremals with their costs, and the longer travels.
//! `-- cold 20` solves the thesis' problem 20 times from boundary states and fold, and prints the cost. `-- cloud 100 10`
//! prints, as JSON, 100 points within 1e-4 of the optimal p(0) and their transition matrices over 3.5 s at 1e-9, by
//! columns, having computed them 10 times.

use serde_json::json;
use somersault_ftla::cold_start::ArmTravel;
use somersault_ftla::continuation::{Continuation, ContinuationResult};
use somersault_ftla::flow::{FlowTolerances, VariationalFlow};
use somersault_ftla::nalgebra::DVector;
use somersault_ftla::shooting::ShootingStatus;
use somersault_ftla::system::{ArmMinimumTorque, HamiltonianSystem};
use somersault_testkit::trees::Random;
use std::error::Error;
use std::f64::consts::{PI, TAU};
use std::hint::black_box;
use std::time::Instant;

fn cost(found: &ContinuationResult, system: &ArmMinimumTorque) -> Result<f64, Box<dyn Error>> {
    Ok(found.extremal.cost(&VariationalFlow::try_new(system, FlowTolerances::default())?)?)
}

fn solve(travel: &ArmTravel) -> Result<ContinuationResult, Box<dyn Error>> {
    let found = travel.solve(&Continuation::default())?.continued;
    if found.s == 1.0 && found.extremal.status == ShootingStatus::Converged {
        Ok(found)
    } else {
        Err(format!("{travel:?}: {:?} at s = {}", found.extremal.status, found.s).into())
    }
}

fn list() -> Result<(), Box<dyn Error>> {
    let thesis = ArmTravel::default();
    let turned = |turns: f64, horizon: f64| ArmTravel {
        initial: [-turns * PI, 0.05],
        last: [turns * PI, 0.05],
        horizon,
        ..thesis
    };
    for (name, travel) in [
        ("thesis, θ₂ > 0", thesis),
        ("folded to θ₂ < 0", ArmTravel { fold: -PI, ..thesis }),
        ("to θ₂ less by a turn", ArmTravel { fold: -PI, last: [0.5 * PI, 0.05 - TAU], ..thesis }),
        ("2π in 20 s", turned(1.0, 20.0)),
        ("2π in 20 s, θ₂ < 0", ArmTravel { fold: -PI, ..turned(1.0, 20.0) }),
        ("4π in 40 s", turned(2.0, 40.0)),
        ("4π in 40 s, θ₂ < 0", ArmTravel { fold: -PI, ..turned(2.0, 40.0) }),
    ] {
        let began = Instant::now();
        let found = solve(&travel)?;
        let [low, high] = found.extremal.range_of(|p| travel.system.hamiltonian(p));
        println!(
            "{name}: cost {:.9}, residual {:.1e}, H within {:.1e}, {} segments, {} members, {} steps, {} evaluations, \
             {:.0?}",
            cost(&found, &travel.system)?,
            found.extremal.residual,
            high - low,
            found.extremal.links.len(),
            found.steps[0],
            found.iterations,
            found.work.evaluations,
            began.elapsed()
        );
    }
    Ok(())
}

fn cold(runs: usize) -> Result<(), Box<dyn Error>> {
    let thesis = ArmTravel::default();
    let mut last = 0.0;
    for _ in 0..runs {
        last = cost(&solve(black_box(&thesis))?, &thesis.system)?;
    }
    println!("{last:.12}");
    Ok(())
}

fn cloud(count: usize, repeats: usize) -> Result<(), Box<dyn Error>> {
    let arm = ArmMinimumTorque::default();
    let start = solve(&ArmTravel::default())?.extremal.nodes[0].clone();
    let mut random = Random::new(35);
    let mut near = || &start + DVector::from_vec(random.numbers(8, 1e-4));
    let points: Vec<DVector<f64>> = (0..count).map(|_| near()).collect();
    let flow = VariationalFlow::try_new(&arm, FlowTolerances { relative: 1e-9, absolute: 1e-9 })?;
    let mut matrices = Vec::new();
    for _ in 0..repeats {
        matrices = points.iter().map(|p| flow.transition(black_box(p), 3.5)).collect::<Result<_, _>>()?;
    }
    let rows = |values: &[f64]| values.to_vec();
    println!(
        "{}",
        json!({
            "points": points.iter().map(|p| rows(p.as_slice())).collect::<Vec<_>>(),
            "matrices": matrices.iter().map(|t| rows(t.matrix.as_slice())).collect::<Vec<_>>(),
        })
    );
    Ok(())
}

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let number =
        |k: usize| arguments.get(k).ok_or("a number is missing")?.parse().map_err(Box::<dyn Error>::from);
    match arguments.first().map(String::as_str) {
        None => list(),
        Some("cold") => cold(number(1)?),
        Some("cloud") => cloud(number(1)?, number(2)?),
        Some(other) => Err(format!("`{other}` is neither cold nor cloud").into()),
    }
}
