//! The dives of thesis chapter 3: found, then verified by integrations that are independent of the search.
//!
//! ```text
//! cargo run --release -p somersault-dives --example dives [starts]
//! ```

use somersault_dives::{Channels, Dive, DiveProgram, DiveSearch, KeyFrame, LiteralDive, Nearest, Range};
use somersault_multibody::models::Posture;
use somersault_nlp::{Flow, Report};
use std::error::Error;
use std::f64::consts::TAU;
use std::time::Instant;

fn main() -> Result<(), Box<dyn Error>> {
    let n_starts = std::env::args().nth(1).map_or(Ok(1), |n| n.parse())?;
    println!("107B, forward three and a half somersaults, pike, in the plane");
    let planar = Dive::forward_pike()?.program()?;
    let best = show(&planar, &DiveSearch::direct(), &Dive::pike_template(), &["H"])?;
    show_literal(&planar, &best)?;
    show_others()?;

    println!("\n5174D, forward three and a half somersaults with two twists, free, in space");
    let spatial = Dive::forward_twisting().program()?;
    let names = ["A", "D", "E", "I", "H"];
    show(&spatial, &DiveSearch::staged(), &Dive::twisting_template(2.0), &names)?;

    println!("\n5174D in other times");
    for (name, duration) in [("1.8 s", Range::fixed(1.8)), ("1.7 s to 2.1 s", Range::new(1.7, 2.1))] {
        let program = Dive { duration, ..Dive::forward_twisting() }.program()?;
        let cpu = cpu_seconds();
        let z = program.start(&Dive::twisting_template(2.0))?;
        let found = DiveSearch::staged().solve(&program, z, &mut |_| Flow::Continue)?;
        let cpu = cpu_seconds() - cpu;
        let report = program.report(&found.z)?;
        println!(
            "  {name:14}  {:.3} s, L = {:.2} kg m²/s, {:.4} somersaults, {:.4} twists, entry {:.3}° off, {cpu:.1} s of CPU",
            report.duration,
            report.momentum,
            report.somersaults,
            report.twists,
            report.entry_angle.to_degrees()
        );
    }

    if n_starts > 1 {
        let templates = KeyFrame::variations(&Dive::twisting_template(2.0), n_starts, 1);
        let (began, cpu) = (Instant::now(), cpu_seconds());
        let found = DiveSearch::staged().solve_all(&spatial, &templates);
        let (wall, cpu) = (began.elapsed().as_secs_f64(), cpu_seconds() - cpu);
        println!("\n{n_starts} starts: {wall:.1} s, {cpu:.1} s of CPU");
        for (k, report) in found.iter().enumerate() {
            match report {
                Ok(report) => println!(
                    "  {k:2}  L = {:6.2}  cost {:.5}  stationarity {:.0e}  feasibility {:.0e}  {}",
                    spatial.momentum(&report.z),
                    report.cost,
                    report.residuals.stationarity,
                    report.residuals.feasibility,
                    report.status
                ),
                Err(error) => println!("  {k:2}  {error}"),
            }
        }
    }
    Ok(())
}

fn show(
    program: &DiveProgram,
    search: &DiveSearch,
    template: &[KeyFrame],
    names: &[&str],
) -> Result<Vec<f64>, Box<dyn Error>> {
    let (began, cpu) = (Instant::now(), cpu_seconds());
    let mut iterations = 0;
    let z = program.start(template)?;
    let found = search.solve(program, z, &mut |_| {
        iterations += 1;
        Flow::Continue
    })?;
    let (wall, cpu) = (began.elapsed().as_secs_f64(), cpu_seconds() - cpu);
    let Report { status, cost, residuals, .. } = &found;
    println!("  solver         {status}; {iterations} iterations, {wall:.3} s, {cpu:.3} s of CPU");
    println!(
        "  residuals      stationarity {:.1e}, feasibility {:.1e}, complementarity {:.1e}; cost {cost:.6}",
        residuals.stationarity, residuals.feasibility, residuals.complementarity
    );
    let report = program.report(&found.z)?;
    println!("  unknowns       {}", found.z.len());
    println!("  momentum       {:.3} kg m²/s in {:.3} s", report.momentum, report.duration);
    println!("  somersaults    {:.6}, twists {:.6}", report.somersaults, report.twists);
    println!(
        "  entry          {:.4}° off the vertical, tilt {:.4}°",
        report.entry_angle.to_degrees(),
        report.tilt.to_degrees()
    );
    println!("  defect         {:.1e} rad at the nodes", report.defect);
    println!(
        "  full dynamics  momentum drift {:.1e}, orientation off by {:.1e} rad",
        report.momentum_drift, report.full_dynamics_defect
    );
    println!(
        "  channels       from {:.1e}, sum at most 1 + {:.1e}",
        report.least_channel,
        report.greatest_sum - 1.0
    );
    if let Some(Nearest { distance, limbs: [a, b], .. }) = report.nearest {
        println!("  minimum distance {:.1} mm, {a} to {b}", 1e3 * distance);
    }
    if let Some(peak) = report.peak_torques.iter().max_by(|a, b| a.torque.abs().total_cmp(&b.torque.abs())) {
        println!("  largest torque {:.0} N m, {} at {:.2} s", peak.torque, peak.joint, peak.time);
    }
    println!(
        "  take-off       centre of mass at {:.3?} m, velocity {:.3?} m/s",
        report.take_off.as_slice(),
        report.take_off_velocity.as_slice()
    );
    let coefficients = program.coefficients(&found.z);
    let motion = program.path().motion();
    let mut weights = vec![0.0; motion.n_channels()];
    let angles = program.angles(&found.z)?;
    println!("  t/T   somersaults  tilt  twists  {}", names.join("     "));
    for k in 0..=25 {
        let fraction = f64::from(k) / 25.0;
        motion.channels_into(&coefficients, fraction, 0, &mut weights);
        let at = angles[(fraction * (angles.len() - 1) as f64).round() as usize];
        let weights: Vec<String> = weights.iter().map(|w| format!("{w:5.2}")).collect();
        println!(
            "  {fraction:.2}  {:6.3}    {:7.2}°  {:6.3}  {}",
            at.somersault / TAU,
            at.tilt.to_degrees(),
            at.twist / TAU,
            weights.join(" ")
        );
    }
    Ok(found.z)
}

/// The same dive by explicit Euler with 200 steps, as the thesis has it: rolled out, and optimised.
fn show_literal(program: &DiveProgram, z: &[f64]) -> Result<(), Box<dyn Error>> {
    println!("\n107B as in the thesis, explicit Euler with 200 steps on the full dynamics");
    let tell = |name: &str, literal: &LiteralDive| {
        let (along, last) = (&literal.angular_momentum, literal.times.len() - 1);
        println!(
            "  {name}  momentum {:.2} at take-off, {:.2} at the entry: {:+.1} %; {:.3} somersaults in the air",
            along[0],
            along[last],
            100.0 * (along[last] / along[0] - 1.0),
            literal.somersault[last] / TAU
        );
    };
    tell("that motion rolled out", &program.literal_motion(z, 200)?);
    for n_steps in [200, 400, 800] {
        let along = program.momentum_in_coordinates(z, n_steps)?;
        let change = 100.0 * (along[along.len() - 1] / along[0] - 1.0);
        println!("  in coordinates, {n_steps} steps: momentum {change:+.1} % at the entry");
    }
    let began = Instant::now();
    let solved = program.solve_literal(z, 200, &mut |_| Flow::Continue)?;
    tell("optimised             ", &solved);
    if let Some(report) = &solved.report {
        println!(
            "  {}, {} iterations, {:.2} s",
            report.status,
            report.iterations,
            began.elapsed().as_secs_f64()
        );
    }
    Ok(())
}

/// The planar dive with a third posture, and without eigenpostures.
fn show_others() -> Result<(), Box<dyn Error>> {
    println!("\n107B with other joint motions");
    let dive = Dive::forward_pike()?;
    let mut third = dive.clone();
    third.postures.push(Posture::G.planar()?.to_vec());
    let joints = Dive { channels: Channels::Joints, ..dive.clone() };
    let long = Dive { duration: Range::fixed(2.0), ..dive.clone() };
    let dives =
        [("A, H", dive), ("A, H, G", third), ("a spline for each joint", joints), ("A, H, in 2 s", long)];
    for (name, dive) in dives {
        let program = dive.program()?;
        let began = Instant::now();
        let z = program.start(&Dive::pike_template())?;
        let found = DiveSearch::direct().solve(&program, z, &mut |_| Flow::Continue)?;
        println!(
            "  {name:24} {:3} unknowns  L = {:.3} kg m²/s  cost {:.6}  {:.3} s  {} iterations  {}",
            found.z.len(),
            program.momentum(&found.z),
            found.cost,
            began.elapsed().as_secs_f64(),
            found.iterations,
            found.status
        );
    }
    Ok(())
}

/// Of the whole process, where the system tells.
fn cpu_seconds() -> f64 {
    let stat = std::fs::read_to_string("/proc/self/stat").unwrap_or_default();
    let fields: Vec<&str> = stat.rsplit(')').next().unwrap_or_default().split_whitespace().collect();
    let ticks = |k: usize| fields.get(k).and_then(|f| f.parse::<f64>().ok()).unwrap_or(f64::NAN);
    (ticks(11) + ticks(12)) / 100.0
}
