//! The swing-up of thesis A.2, from the cart and the pendulum on straight lines. `benches/peers/swing_up.py` times it.
//!
//! `cargo run --release -p somersault-ocp --example swing_up` solves the cases of Table A.1. `-- 50 evaluate 20000`
//! computes cost and gradient 20000 times with 50 parameters at the start, `-- 50 solve 20` solves 20 times, set-up
//! included; both print the cost, and the least wall time in seconds of one run.

use somersault_nlp::{Flow, Nlp, NlpSolver, Report, Sqp};
use somersault_ocp::swing_up::CartPendulumProblem;
use std::error::Error;
use std::hint::black_box;
use std::time::Instant;

fn solve(problem: &CartPendulumProblem) -> Result<Report, Box<dyn Error>> {
    let mut nlp = problem.swing_up()?;
    let start = nlp.start(&nlp.straight_line())?;
    Ok(Sqp::default().solve(&mut nlp, &start, &mut |_| Flow::Continue)?)
}

fn list() -> Result<(), Box<dyn Error>> {
    for (case, p) in [('A', 5), ('B', 10), ('C', 15), ('D', 20), ('E', 30), ('F', 40), ('G', 50)] {
        let problem = CartPendulumProblem::with_parameters(p);
        let began = Instant::now();
        let report = solve(&problem)?;
        println!(
            "{case} {p:3} parameters: cost {:.5} in {:.2} ms, {} steps, residual {:.1e}: {}",
            report.cost,
            began.elapsed().as_secs_f64() * 1e3,
            report.iterations,
            report.residuals.max(),
            report.status
        );
    }
    Ok(())
}

/// Least time of one run, in groups that are long enough for the clock.
fn time(
    runs: usize,
    mut run: impl FnMut() -> Result<f64, Box<dyn Error>>,
) -> Result<(f64, f64), Box<dyn Error>> {
    let per_group = (runs / 100).max(1);
    let (mut cost, mut least) = (f64::NAN, f64::INFINITY);
    for _ in 0..runs.div_ceil(per_group) {
        let began = Instant::now();
        for _ in 0..per_group {
            cost = run()?;
        }
        least = least.min(began.elapsed().as_secs_f64() / per_group as f64);
    }
    Ok((cost, least))
}

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [p, what, runs] = &arguments[..] else {
        return if arguments.is_empty() { list() } else { Err("give nothing, or p, what and runs".into()) };
    };
    let problem = CartPendulumProblem::with_parameters(p.parse()?);
    let runs = runs.parse()?;
    let (cost, seconds) = match what.as_str() {
        "evaluate" => {
            let z = problem.swing_up()?.straight_line();
            let (mut nlp, mut gradient) = (problem.single_shooting()?, vec![0.0; z.len()]);
            time(runs, || {
                let cost = nlp.evaluate(black_box(&z), &mut [])?;
                nlp.differentiate(black_box(&z), &mut gradient, &mut [])?;
                black_box(&gradient);
                Ok(cost)
            })?
        }
        "solve" => time(runs, || Ok(solve(black_box(&problem))?.cost))?,
        _ => return Err("`what` is evaluate or solve".into()),
    };
    println!("{cost:e} {seconds:e}");
    Ok(())
}
