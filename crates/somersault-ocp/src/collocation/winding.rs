//! Angles among the controls, whole turns of which change nothing.
//!
//! A program with cos u and sin u at each collocation point is solved by any of u + 2πk there, and Newton's steps from afar leave a
//! different k at each point. That is the same solution at the points, and none between them. Where neither rates nor costs nor
//! constraints see a turn, each control is moved by whole turns to where it is nearest to the one before it, within its bounds.

use super::error::CollocationError;
use super::function::VectorFunction;
use super::problem::Phase;
use super::solution::PhaseSolution;
use std::f64::consts::TAU;

/// Relative difference that rounding makes of a turn of some tens of radians.
const ROUNDING: f64 = 1e-9;

/// Moves the angles among the controls of a solution by whole turns.
pub(super) fn unwind(phase: &mut Phase, solution: &mut PhaseSolution) -> Result<(), CollocationError> {
    for control in 0..phase.sizes.controls {
        let winds =
            solution.controls.windows(2).any(|pair| (pair[1][control] - pair[0][control]).abs() > 0.5 * TAU);
        if winds && is_angle(phase, solution, control)? {
            let bound = phase.bounds.control[control];
            let mut moved: Vec<f64> = solution.controls.iter().map(|u| u[control]).collect();
            for i in 1..moved.len() {
                moved[i] += TAU * ((moved[i - 1] - moved[i]) / TAU).round();
            }
            // the whole of it is as near to zero as it may be
            let mean = moved.iter().sum::<f64>() / moved.len() as f64;
            let turns = TAU * (mean / TAU).round();
            let is_allowed = |u: f64| bound.lower <= u && u <= bound.upper;
            for shift in [turns, 0.0] {
                if moved.iter().all(|u| is_allowed(u - shift)) {
                    solution.set_control(control, moved.iter().map(|u| u - shift));
                    break;
                }
            }
        }
    }
    Ok(())
}

/// Whether a turn of a control changes nothing that the phase evaluates at the points of a solution, and half a turn does.
fn is_angle(phase: &mut Phase, solution: &PhaseSolution, control: usize) -> Result<bool, CollocationError> {
    let n_path = phase.path.n_outputs();
    let mut arguments = vec![0.0; phase.sizes.point()];
    let mut values = [0, 1, 2].map(|_| vec![0.0; phase.sizes.states + n_path]);
    let mut is_seen = false;
    for (i, (x, u)) in solution.states.iter().zip(&solution.controls).enumerate() {
        let states = phase.sizes.states;
        arguments[..states].copy_from_slice(x);
        let rest = &mut arguments[states + u.len()..];
        rest[..solution.parameters.len()].copy_from_slice(&solution.parameters);
        rest[solution.parameters.len()] = solution.times[i];
        for (values, turned) in values.iter_mut().zip([0.0, TAU, 0.5 * TAU]) {
            arguments[states..states + u.len()].copy_from_slice(u);
            arguments[states + control] += turned;
            let (rates, path) = values.split_at_mut(states);
            phase.dynamics.evaluate(&arguments, rates)?;
            phase.path.evaluate(&arguments, path)?;
        }
        let [here, turned, half] = &values;
        let size = here.iter().fold(1.0, |m: f64, v| m.max(v.abs()));
        let differs = |other: &[f64]| here.iter().zip(other).any(|(a, b)| (a - b).abs() > ROUNDING * size);
        if differs(turned) {
            return Ok(false);
        }
        is_seen |= differs(half);
    }
    Ok(is_seen)
}
