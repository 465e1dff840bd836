//! Dives of all groups, somersaults and twists: searched for, and flown again independently of their verification.
//!
//! ```text
//! cargo run --release -p somersault-dives --example dive_grid [count] [seed]
//! ```
//! Groups 1 (forward), 2 (back), 3 (reverse) and 4 (inward) are told apart by the signs of travel and momentum; 2 to 7 half
//! somersaults, 0 to 5 half twists, and mirror images. A dive is a success where its search says so. The check here integrates
//! the full dynamics of the driven tree by a method of order 5, integrates the rates of somersault and twist along that flight
//! in place of counting turns, compares it with the nodes of the program, and samples the distances of limbs at 20 000 times.

use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use somersault_core::lie::so3::angle_between;
use somersault_dives::{ALLOWED, Body, Dive, DiveProgram, DiveSearch, Range};
use somersault_integrators::driver::{Adaptive, Steps};
use somersault_integrators::methods::Method;
use somersault_integrators::run::Run;
use somersault_integrators::solution::Recorder;
use somersault_multibody::motion::{TreeState, TreeSystem};
use somersault_multibody::{Data, Split};
use somersault_nlp::{Flow, Sqp};
use std::error::Error;
use std::f64::consts::TAU;

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let count: usize = arguments.next().map_or(Ok(200), |n| n.parse())?;
    let mut seed: u64 = arguments.next().map_or(Ok(1), |n| n.parse())?;
    let mut grid = Vec::new();
    for group in 1..=4 {
        for half_somersaults in 2..=7 {
            grid.push((group, half_somersaults, 0));
            grid.extend((1..=5).flat_map(|n| [(group, half_somersaults, n), (group, half_somersaults, -n)]));
        }
    }
    // Fisher and Yates, by a linear congruential generator of Knuth's
    for k in (1..grid.len()).rev() {
        seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        grid.swap(k, (seed >> 33) as usize % (k + 1));
    }
    let (mut successes, mut false_successes, mut false_refusals) = (0, 0, 0);
    println!("group somersaults twists  status             L    flight   entry    clearance  success  holds");
    for (group, half_somersaults, half_twists) in grid.into_iter().take(count) {
        let program = dive(group, half_somersaults, half_twists)?.program()?;
        let template = Dive::twisting_template(program.dive().twists);
        let staged = DiveSearch::staged();
        let search = DiveSearch {
            coarse_steps: Some(140),
            hard: Sqp { max_iterations: 60, ..staged.hard.clone() },
            ..staged
        };
        let found = search.solve_verified(&program, program.start(&template)?, &mut |_| Flow::Continue)?;
        let (success, judged) = (found.is_success(), found.verification?);
        let Check { flight, entry, clearance } = check(&program, &found.report.z)?;
        let holds = flight <= ALLOWED && entry <= ALLOWED && clearance >= 0.005;
        let solved = found.report.status.is_converged();
        successes += usize::from(success);
        false_successes += usize::from(success && !holds);
        false_refusals += usize::from(solved && !success && holds);
        println!(
            "{group:5} {:11.1} {:6.1}  {:16} {:6.2}  {flight:.1e}  {entry:.1e}  {:6.3} mm  {success:7}  {holds}{}",
            program.dive().somersaults,
            program.dive().twists,
            format!("{:?}", found.report.status),
            judged.momentum,
            1e3 * clearance,
            if solved && !success { format!("  {}", judged.sentence(ALLOWED)) } else { String::new() }
        );
    }
    println!(
        "{successes} successes, of these {false_successes} false; {false_refusals} solved and refused that hold"
    );
    Ok(())
}

/// Groups by the signs of travel and momentum; the lean is to the side of the travel.
fn dive(group: i32, half_somersaults: i32, half_twists: i32) -> Result<Dive, Box<dyn Error>> {
    let (travel, sense) = match group {
        1 => (1.0, 1.0),
        2 => (-1.0, -1.0),
        3 => (1.0, -1.0),
        _ => (-1.0, 1.0),
    };
    let dive = Dive::twisting(sense * 0.5 * f64::from(half_somersaults), 0.5 * f64::from(half_twists))?;
    Ok(Dive {
        lean: Range::fixed(travel * dive.lean.lower),
        entry_distance: travel * dive.entry_distance,
        duration: Range::fixed(1.3 + 0.1 * f64::from(half_somersaults)),
        ..dive
    })
}

/// What another flight makes of a dive.
struct Check {
    /// Greatest angle to the nodes of the program, rad.
    flight: f64,
    /// Greatest difference of somersault, tilt and twist at the entry from those requested, rad.
    entry: f64,
    /// Minimum distance of limbs, m.
    clearance: f64,
}

fn check(program: &DiveProgram, z: &[f64]) -> Result<Check, Box<dyn Error>> {
    let (path, motion, dive) = (program.path(), program.motion(z)?, program.dive());
    let (model, duration, coefficients) = (path.model(), program.duration(z), program.coefficients(z));
    let (n_q, n_v) = (model.n_positions(), model.n_velocities());
    let n_root = model.velocities_of(0).len();
    let spline = path.motion();
    let drive = |t: f64, _: &[f64], _: &[f64], a: &mut [f64]| {
        let mut channels = vec![0.0; spline.n_channels()];
        spline.channels_into(&coefficients, t / duration, 2, &mut channels);
        channels.iter_mut().for_each(|c| *c /= duration * duration);
        spline.base().rates_into(&channels, &mut a[n_root..]);
    };
    let split = Split::all_but_root(model);
    let system = TreeSystem::new(model, ()).driven(split, drive)?;
    let start = model.state(&motion.positions[..n_q], &motion.velocities[..n_v])?;
    let mut recorder = Recorder::new(0.0, &start, 1).with_dense_output();
    let control = Adaptive { max_step: duration / 2000.0, ..Adaptive::with_tolerances(1e-11, 1e-11) };
    let steps = Steps::adapted((0.0, duration), control);
    Run::new(&system, Method::Rkmk5, steps).observed_by(&mut recorder).from(&start)?;
    let solution = recorder.into_solution();
    let orientation = |numbers: &[f64]| {
        UnitQuaternion::new_normalize(Quaternion::new(numbers[6], numbers[3], numbers[4], numbers[5]))
    };
    // the rates of the angles by Simpson's rule; the first angles are the lean
    let counting = program.counting();
    let mut velocities = vec![0.0; n_v];
    let mut rates = |state: &TreeState| -> Result<_, Box<dyn Error>> {
        model.joint_velocities(state, &mut velocities)?;
        let omega = Vector3::new(velocities[3], velocities[4], velocities[5]);
        Ok(counting.rates(&orientation(state.configuration.as_slice()), &omega))
    };
    let (mut somersault, mut twist) = (program.lean(z), 0.0);
    let states = &solution.states;
    for k in 0..states.len() - 1 {
        let h = solution.times[k + 1] - solution.times[k];
        let middle = solution.at(solution.times[k] + 0.5 * h).ok_or("no middle")?;
        let (a, b, c) = (rates(&states[k])?, rates(&middle)?, rates(&states[k + 1])?);
        somersault += h / 6.0 * (a.somersault + 4.0 * b.somersault + c.somersault);
        twist += h / 6.0 * (a.twist + 4.0 * b.twist + c.twist);
    }
    let last = states.last().ok_or("no end")?;
    let tilt = counting.angles(&orientation(last.configuration.as_slice())).tilt;
    let misses = [somersault - TAU * dive.somersaults - dive.entry_lean, tilt, twist - TAU * dive.twists];
    let mut flight: f64 = 0.0;
    for (node, t) in motion.times.iter().enumerate() {
        let flown = if *t < duration { solution.at(*t).ok_or("no node")? } else { last.clone() };
        let at_node = orientation(&motion.positions[node * n_q..]);
        flight = flight.max(angle_between(&orientation(flown.configuration.as_slice()), &at_node));
    }
    let body = Body::try_new(model)?;
    let (mut data, mut q) = (Data::new(model), model.neutral());
    let (mut channels, mut distances) = (vec![0.0; spline.n_channels()], vec![0.0; body.pairs().len()]);
    let mut clearance = f64::INFINITY;
    for k in 0..=20_000 {
        spline.channels_into(&coefficients, f64::from(k) / 20_000.0, 0, &mut channels);
        spline.base().positions_into(&channels, &mut q[7..]);
        body.distances(&model.positions(&mut data, &q)?, 0.0, &mut distances, None)?;
        clearance = distances.iter().fold(clearance, |least, d| least.min(*d));
    }
    Ok(Check { flight, entry: misses.iter().fold(0.0, |most, miss| most.max(miss.abs())), clearance })
}
