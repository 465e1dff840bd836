//! Accuracy with located events and without: thesis 7.3.2, Figure 7.5.
//!
//! A method of order p loses it where a step straddles an event: the force of the mode before acts for a
//! part of h too long, which is an error of h times the jump, whatever p is. How large the part is depends
//! on where the steps fall, so the error of one run says little, and errors are averaged over step sizes
//! before a slope is taken. With located events the order is p again, and every run shows it.
//!
//! Use a time at which there is something left to measure: the height of the top of 7.3.2 has damped out by
//! 1 s; at 0.1 s its seventh switch is still to come.

use crate::contacts::BodyInContact;
use crate::driver::integrate_located;
use crate::event::{Interruption, Location};
use crate::hybrid::HybridBodies;
use crate::models::SpinningTop;
use somersault_integrators::driver::{Flow, IntegrateError, TimeGrid, check_positive};
use somersault_integrators::force::Gravity;
use somersault_integrators::methods::{Method, Options};
use somersault_integrators::studies::order::{Convergence, Measured, ObservedOrders, forgive};
use somersault_integrators::studies::problem::{Errors, Problem};
use somersault_integrators::studies::{Progress, StudyError};
use somersault_integrators::system::StateOf;

/// What steps do about events.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Stepping {
    /// They end at events, [`integrate_located`].
    Located,
    /// They go across, the force switching with the state as in the thesis.
    Straddling,
}

/// A motion whose end is computed by `method` with located events in steps of `dt`: as good as that run is.
///
/// Errors: those of the run, and of [`Problem::try_new`].
pub fn with_located_run<H: HybridBodies>(
    system: H,
    initial: StateOf<H>,
    t_end: f64,
    method: Method,
    dt: f64,
) -> Result<Problem<H>, StudyError> {
    let (grid, location) = (TimeGrid::try_new(0.0, t_end, dt)?, Location::default());
    let run = integrate_located(method, Options::default(), &system, &initial, &grid, &location, &mut ());
    let reference = match run {
        Ok(run) => run.state,
        Err(broken) => return Err(interrupted(broken.reason).into()),
    };
    Problem::try_new(system, initial, t_end, reference)
}

/// The motion of the spinning top of thesis 7.3.2 to `t_end`, s.
///
/// The end is computed by `rkmk8_b` in steps of 0.1 ms with located events. It agrees with reduced
/// coordinates, integrated by extrapolation with bisected switches, to 1e-12 (m, rad, m/s, rad/s) at 0.1 s,
/// and at 1 s relative to the 100 rad turned by then and to 100 rad/s.
pub fn spinning_top(top: &SpinningTop, t_end: f64) -> Result<Problem<BodyInContact<Gravity>>, StudyError> {
    with_located_run(top.system.clone(), top.start, t_end, Method::Rkmk8B, 1e-4)
}

/// Errors at the end of one run; infinite where the step was too large for it.
///
/// Errors: a grid that does not fit, a method that does not apply.
pub fn errors<H: HybridBodies>(
    problem: &Problem<H>,
    method: Method,
    options: Options,
    stepping: Stepping,
    steps: u64,
) -> Result<Errors, StudyError> {
    let grid = TimeGrid::try_with_steps(0.0, problem.t_end(), steps)?;
    let (system, initial) = (problem.system(), problem.initial());
    let state = match stepping {
        Stepping::Located => {
            let location = Location { keep_events: false, ..Location::default() };
            integrate_located(method, options, system, initial, &grid, &location, &mut ())
                .map(|run| run.state)
                .map_err(|broken| interrupted(broken.reason))
        }
        Stepping::Straddling => {
            method.integrate(options, system, initial, &grid, &mut ()).map(|run| run.state)
        }
    };
    Ok(forgive(state)?.map_or(Errors::INFINITE, |state| problem.errors(&state)))
}

/// Runs a problem with each of the steps `dts`, each as the root mean square over `sizes` step sizes in
/// even ratios from dt down to half of it, and takes the orders.
///
/// Errors: an empty list, a step that is not positive or too small to advance the time, a method that does
/// not apply, and a stop by `progress`, which is called after each entry of `dts`.
pub fn convergence<H: HybridBodies>(
    problem: &Problem<H>,
    method: Method,
    options: Options,
    stepping: Stepping,
    dts: &[f64],
    sizes: u32,
    progress: &mut Progress<'_>,
) -> Result<Convergence, StudyError> {
    if dts.is_empty() {
        return Err(StudyError::Empty { argument: "dts" });
    }
    check_positive("sizes", f64::from(sizes))?;
    let mut measured = Vec::with_capacity(dts.len());
    for &dt in dts {
        check_positive("dts", dt)?;
        let mut sum = Errors { position: 0.0, orientation: 0.0, velocity: 0.0, angular_velocity: 0.0 };
        for i in 0..sizes {
            let dt = dt * 0.5f64.powf(f64::from(i) / f64::from(sizes));
            let steps = (problem.t_end() / dt).round().max(1.0) as u64;
            let found = errors(problem, method, options, stepping, steps)?;
            let add = |sum: &mut f64, error: f64| *sum += error * error / f64::from(sizes);
            add(&mut sum.position, found.position);
            add(&mut sum.orientation, found.orientation);
            add(&mut sum.velocity, found.velocity);
            add(&mut sum.angular_velocity, found.angular_velocity);
        }
        let errors = Errors {
            position: sum.position.sqrt(),
            orientation: sum.orientation.sqrt(),
            velocity: sum.velocity.sqrt(),
            angular_velocity: sum.angular_velocity.sqrt(),
        };
        measured.push(Measured { dt, errors });
        if progress(measured.len(), dts.len()) == Flow::Stop && measured.len() < dts.len() {
            return Err(StudyError::Stopped { done: measured.len(), total: dts.len() });
        }
    }
    let orders = ObservedOrders::of(&measured);
    Ok(Convergence { measured, orders })
}

/// A guard that is not finite, or chatter, is what a step too large leads to, as a state that is not finite.
fn interrupted(reason: Interruption) -> IntegrateError {
    match reason {
        Interruption::Integrate(error) => error,
        Interruption::NonFiniteGuard { t, .. } | Interruption::Chattering { t, .. } => {
            IntegrateError::NonFinite { t }
        }
    }
}
