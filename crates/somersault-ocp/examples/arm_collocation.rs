//! The two-link arm of thesis 8.4 by collocation. `benches/peers/arm.py` times it.
//!
//! `cargo run --release -p somersault-ocp --example arm_collocation` lists extremals, from a straight and from folded guesses,
//! to the same final arm with θ₂ as it is and less by a turn. `-- 1e-6 20 folded` solves 20 times to that tolerance, set-up
//! included, from a folded guess, or from a straight one, and prints the cost.

use somersault_core::Scalar;
use somersault_multibody::models::TwoLinkArm;
use somersault_nlp::Flow;
use somersault_ocp::collocation::{
    Collocation, CollocationReport, Guess, Mesh, Phase, Point, Problem, Terms, TreeDynamics,
};
use std::error::Error;
use std::f64::consts::{FRAC_PI_2, PI, TAU};
use std::hint::black_box;
use std::time::Instant;

/// ½ (u₁² + ½ u₂²), (8.7) with γ = (1, 0.5).
struct Effort;

impl Terms for Effort {
    fn running_cost<T: Scalar>(&self, at: &Point<'_, T>) -> T {
        let [u1, u2] = [at.control[0], at.control[1]];
        (u1 * u1 + u2 * u2 * nalgebra::convert::<f64, T>(0.5)) * nalgebra::convert::<f64, T>(0.5)
    }
}

/// From a straight guess, or one with θ₂ = `fold` in the middle, to θ₂ = 0.05 + `turn`.
fn solve(fold: Option<f64>, turn: f64, tolerance: f64) -> Result<CollocationReport, Box<dyn Error>> {
    let dynamics = TreeDynamics::try_fully_actuated(&TwoLinkArm::default().model()?)?;
    let (first, last) = ([-FRAC_PI_2, 0.05, 0.0, 0.0], [FRAC_PI_2, 0.05 + turn, 0.0, 0.0]);
    let mut phase =
        Phase::of_tree(dynamics, Effort).initial_state(first).final_state(last).horizon(0.0, 10.0);
    if let Some(fold) = fold {
        let folded = |angle: f64| vec![angle, fold, PI / 10.0, 0.0];
        phase = phase.guess(Guess {
            times: vec![0.0, 1.0, 9.0, 10.0],
            states: vec![first.to_vec(), folded(-0.4 * PI), folded(0.4 * PI), last.to_vec()],
            controls: vec![vec![0.0; 2]; 4],
            parameters: Vec::new(),
        });
    }
    let collocation = Collocation { tolerance, ..Collocation::default() };
    let mesh = Mesh::try_uniform(40, 4)?;
    Ok(collocation.solve(&mut Problem::try_new(phase)?, &[mesh], &mut |_| Flow::Continue)?)
}

fn list() -> Result<(), Box<dyn Error>> {
    for (name, fold, turn) in [
        ("straight", None, 0.0),
        ("folded, θ₂ > 0", Some(PI), 0.0),
        ("folded, θ₂ < 0", Some(-PI), 0.0),
        ("straight, to a turn less", None, -TAU),
        ("folded, to a turn less", Some(-PI), -TAU),
    ] {
        for tolerance in [1e-3, 1e-6, 1e-9] {
            let began = Instant::now();
            let found = solve(fold, turn, tolerance)?;
            println!("{name}, tolerance {tolerance:e}: {:?}, {:.0?}", found.status, began.elapsed());
            for record in &found.history {
                println!(
                    "    {} points: {}, {} steps, cost {:.9}, error {:.1e}",
                    record.meshes[0].n_points(),
                    record.status,
                    record.iterations,
                    record.cost,
                    record.accuracy.equations
                );
            }
            let (phase, confirmation) = (&found.phases[0], &found.confirmation);
            println!(
                "    re-integrated: cost {:.9}, largest defect {:.1e}, end to end {:.1e}; spread of H {:.1e}",
                confirmation.cost,
                confirmation.max_defect(),
                confirmation.end_to_end_error(),
                phase.hamiltonian_spread()
            );
            println!("    x(5) {:.6?}  λ(5) {:.6?}", phase.state(5.0), phase.costate(5.0));
            println!("    λ(0) {:.6?}", phase.costate(0.0));
        }
    }
    Ok(())
}

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    match &arguments[..] {
        [] => list(),
        [tolerance, runs, guess] => {
            let (tolerance, runs): (f64, usize) = (tolerance.parse()?, runs.parse()?);
            let fold = match guess.as_str() {
                "folded" => Some(PI),
                "straight" => None,
                _ => return Err("the guess is folded or straight".into()),
            };
            let mut cost = f64::NAN;
            for _ in 0..runs {
                cost = solve(black_box(fold), 0.0, tolerance)?.cost;
            }
            println!("{cost:e}");
            Ok(())
        }
        _ => Err("give nothing, or a tolerance, a number of runs and a guess".into()),
    }
}
