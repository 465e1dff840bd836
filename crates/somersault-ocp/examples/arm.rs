//! The two-link arm of thesis 8.4 by collocation, from a straight and from folded guesses, with the times taken.
//!
//! `cargo run --release -p somersault-ocp --example arm`

use somersault_multibody::{Scalar, models::TwoLinkArm};
use somersault_ocp::collocation::{
    Collocation, CollocationReport, Guess, Mesh, Phase, Point, Problem, Terms, TreeDynamics,
};
use somersault_ocp::solver::Flow;
use std::error::Error;
use std::f64::consts::{FRAC_PI_2, PI, TAU};
use std::time::Instant;

/// ½ (u₁² + ½ u₂²), (8.7) with γ = (1, 0.5).
struct Effort;

impl Terms for Effort {
    fn running_cost<T: Scalar>(&self, at: &Point<'_, T>) -> T {
        let [u1, u2] = [at.control[0], at.control[1]];
        (u1 * u1 + u2 * u2 * nalgebra::convert::<f64, T>(0.5)) * nalgebra::convert::<f64, T>(0.5)
    }
}

/// Straight if `fold` is zero, else with θ₂ = `fold` in the middle; the last θ₂ is 0.05 + `turn`.
fn solve(fold: f64, turn: f64, tolerance: f64) -> Result<CollocationReport, Box<dyn Error>> {
    let dynamics = TreeDynamics::try_fully_actuated(&TwoLinkArm::default().model()?)?;
    let (first, last) = ([-FRAC_PI_2, 0.05, 0.0, 0.0], [FRAC_PI_2, 0.05 + turn, 0.0, 0.0]);
    let mut phase =
        Phase::of_tree(dynamics, Effort).initial_state(first).final_state(last).horizon(0.0, 10.0);
    if fold != 0.0 {
        let row = |q: [f64; 2]| vec![q[0], q[1], PI / 10.0, 0.0];
        phase = phase.guess(Guess {
            times: vec![0.0, 1.0, 9.0, 10.0],
            states: vec![first.to_vec(), row([-0.4 * PI, fold]), row([0.4 * PI, fold]), last.to_vec()],
            controls: vec![vec![0.0; 2]; 4],
            parameters: Vec::new(),
        });
    }
    let collocation = Collocation { tolerance, ..Collocation::default() };
    let mut problem = Problem::try_new(phase)?;
    Ok(collocation.solve(&mut problem, &[Mesh::try_uniform(10, 4)?], &mut |_| Flow::Continue)?)
}

fn main() -> Result<(), Box<dyn Error>> {
    for tolerance in [1e-3, 1e-6, 1e-8] {
        for (name, fold, turn) in [
            ("straight", 0.0, 0.0),
            ("folded +", PI, 0.0),
            ("folded -", -PI, 0.0),
            ("less by a turn", -PI, -TAU),
            ("straight, less by a turn", 0.0, -TAU),
        ] {
            let began = Instant::now();
            let found = solve(fold, turn, tolerance)?;
            let time = began.elapsed();
            let phase = &found.phases[0];
            println!("{name}, tolerance {tolerance:e}: {:?} in {time:?}", found.status);
            for mesh in &found.history {
                println!(
                    "    {} intervals, {} points: {} in {} steps, {:?}, cost {:.9}, error {:.1e}",
                    mesh.meshes[0].n_intervals(),
                    mesh.meshes[0].n_points(),
                    mesh.status,
                    mesh.iterations,
                    mesh.time,
                    mesh.cost,
                    mesh.error
                );
            }
            println!(
                "    cost {:.9}, integrated {:.9}, defect {:.1e}, end to end {:.1e}, spread of H {:.1e}",
                found.cost,
                found.confirmation.cost,
                found.confirmation.max_defect(),
                found.confirmation.end_to_end_error(),
                phase.hamiltonian_spread()
            );
            println!(
                "    x(5) {:?}\n    λ(5) {:?}\n    λ(0) {:?}",
                phase.state(5.0),
                phase.costate(5.0),
                phase.costates[0]
            );
        }
    }
    Ok(())
}
