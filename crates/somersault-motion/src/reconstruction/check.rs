//! The flight flown again by the full equations of motion, which do not know that the momentum is constant.

use super::ReconstructionError;
use super::joints::JointSplines;
use somersault_core::cancel::CancellationToken;
use somersault_core::lie::so3::{angle_between, normalized_xyzw};
use somersault_integrators::driver::{Adaptive, Steps};
use somersault_integrators::methods::{Dop853, RungeKuttaMuntheKaas};
use somersault_integrators::run::Run;
use somersault_integrators::solution::Recorder;
use somersault_multibody::motion::TreeSystem;
use somersault_multibody::{Model, Split};

/// Tolerance of the integration; the splines' third derivatives jump at the knots.
const TOLERANCE: f64 = 1e-9;
/// Steps of it, at most: those of the search are as many in the longest flight. What turns too fast for them is not confirmed.
const MAX_STEPS: usize = 20_000;

/// The largest angle, rad, between the orientations of `configurations` at `times` and those of the full equations of motion from
/// the first of them, with velocity `v`, joints driven along the splines; infinite where these cannot be integrated.
pub(super) fn full_dynamics_defect(
    model: &Model,
    splines: &JointSplines,
    coefficients: &[f64],
    times: &[f64],
    configurations: &[f64],
    v: &[f64],
    token: &CancellationToken,
) -> Result<f64, ReconstructionError> {
    let n_q = model.n_positions();
    let n_root = model.velocities_of(0).len();
    let channels = std::sync::Mutex::new(splines.channels());
    let drive = |t: f64, _: &[f64], _: &[f64], a: &mut [f64]| {
        let mut room = channels.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        splines.accelerations(coefficients, t, &mut room, &mut a[n_root..]);
    };
    let system = TreeSystem::new(model, ()).driven(Split::all_but_root(model), drive)?;
    let start = model.state(&configurations[..n_q], v)?;
    let interval = (times[0], times[times.len() - 1]);
    let control = Adaptive {
        max_step: splines.spacing(),
        max_steps: MAX_STEPS,
        ..Adaptive::with_tolerances(TOLERANCE, TOLERANCE)
    };
    let mut recorder = Recorder::new(interval.0, &start, 1).with_dense_output();
    let steps = Steps::adapted(interval, control);
    let run = Run::by_embedded_stepper(&system, &RungeKuttaMuntheKaas(Dop853), steps)
        .observed_by(&mut (&mut recorder, token))
        .from(&start);
    let Ok(end) = run else { return Ok(f64::INFINITY) };
    let solution = recorder.into_solution();
    let at = model.joint(0).map_or(0..0, |joint| joint.kind().orientation());
    let mut largest = 0.0_f64;
    for (t, q) in times.iter().zip(configurations.chunks_exact(n_q)) {
        let state = if *t < interval.1 { solution.at(*t) } else { Some(end.state.clone()) };
        let Some(state) = state else { return Ok(f64::INFINITY) };
        let (found, wanted) = (&state.configuration.as_slice()[at.clone()], &q[at.clone()]);
        let apart = if wanted.len() == 1 {
            (found[0] - wanted[0]).abs()
        } else {
            angle_between(&normalized_xyzw(found), &normalized_xyzw(wanted))
        };
        largest = largest.max(apart);
    }
    Ok(largest)
}
