//! Accuracy with located events and without: thesis 7.3.2, Figure 7.5.
//!
//! A method of order p loses it where a step straddles an event: the force of the mode before acts for a
//! part of h too long, which is an error of h times the jump, whatever p is. How large the part is depends
//! on where the steps fall, so the error of one run says little, and errors are averaged over step sizes
//! before a slope is taken. With located events the order is p again, and every run shows it.
//!
//! Use a time at which there is something left to measure: the height of the top of 7.3.2 has damped out by
//! 1 s; at 0.1 s its seventh switch is still to come.
//!
//! The top switches seven times in 1 s, at 0.017445853280 (down), 0.027213663447 (up), 0.032316032230,
//! 0.043684337214, 0.064507673346, 0.091446342689 and 0.103428677790 s (down for good). The table has the
//! orders at 0.1 s in all four quantities (across the contacts those of the geometric mean over 24 or 48 step
//! sizes an octave), the error of the orientation at 1 s, rad, for steps of 10⁻² to 10⁻⁶ s, – where the step was
//! too large to reach the end, and the largest step with which the top still stands after 1 s. Below about
//! 6e-12 rad an error is rounding. It is what `cargo run --release -p somersault-contact --example figure_7_5`
//! prints, in about a minute:
//!
#![doc = include_str!("figure_7_5.md")]
//!
//! The reference of the thesis, `rkmk` at 1e-6 s across the contacts, is off by 1.0e-9 m, 2.5e-7 rad,
//! 4.5e-9 m/s and 1.7e-5 rad/s at 1 s. At 1e-2 s without location `sie`, `mp`, `heun`, `ab2`, `siabm2`, `ab4`
//! and `siabm4` overflow, while `sv`, `aso` and all methods in angular momentum give a solution, far off, as
//! 7.3.2 has it; with location `rk4`, `rkmk`, `rkmk3`, `rkmk8`, `cf4` and `split4` still keep the height of the
//! top within a millimetre.

use crate::contacts::BodyInContact;
use crate::models::SpinningTop;
use somersault_core::argument::expect_positive;
use somersault_integrators::driver::{Flow, IntegrateError, TimeGrid};
use somersault_integrators::events::{HybridBodies, Interruption, Location};
use somersault_integrators::force::Gravity;
use somersault_integrators::methods::{Method, Options};
use somersault_integrators::run::Run;
use somersault_integrators::studies::order::{
    Convergence, Measured, ObservedOrders, forgive, mean_order, observed_order,
};
use somersault_integrators::studies::problem::{Errors, Problem};
use somersault_integrators::studies::{Progress, StudyError};
use somersault_integrators::system::StateOf;

/// What steps do about events.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Stepping {
    /// They end at events, [`Run::locating`].
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
    let reference = match Run::new(&system, method, grid).locating(location).from(&initial) {
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
    let initial = problem.initial();
    let run = Run::new(problem.system(), method, grid).with_options(options);
    let state = match stepping {
        Stepping::Located => {
            let location = Location { keep_events: false, ..Location::as_given() };
            let located = run.locating(location).from(initial);
            located.map(|run| run.state).map_err(|broken| interrupted(broken.reason))
        }
        Stepping::Straddling => run.from(initial).map(|run| run.state),
    };
    Ok(forgive(state)?.map_or(Errors::INFINITE, |state| problem.errors(&state)))
}

/// Runs a problem with each of the steps `dts`, each as the geometric mean over `sizes` step sizes in even
/// ratios from dt down to half of it, and takes the orders.
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
    expect_positive("sizes", f64::from(sizes)).map_err(IntegrateError::from)?;
    let mut measured = Vec::with_capacity(dts.len());
    for &dt in dts {
        expect_positive("dts", dt).map_err(IntegrateError::from)?;
        let mut logarithms = [0.0; 4];
        for i in 0..sizes {
            let dt = dt * 0.5f64.powf(f64::from(i) / f64::from(sizes));
            let steps = (problem.t_end() / dt).round().max(1.0) as u64;
            let found = errors(problem, method, options, stepping, steps)?;
            let parts = [found.position, found.orientation, found.velocity, found.angular_velocity];
            logarithms.iter_mut().zip(parts).for_each(|(sum, error)| *sum += error.ln() / f64::from(sizes));
        }
        let [position, orientation, velocity, angular_velocity] = logarithms.map(f64::exp);
        let errors = Errors { position, orientation, velocity, angular_velocity };
        measured.push(Measured { dt, errors });
        if progress(measured.len(), dts.len()) == Flow::Stop && measured.len() < dts.len() {
            return Err(StudyError::Stopped { done: measured.len(), total: dts.len() });
        }
    }
    // Straddling errors are far above rounding, but scatter: all of them count.
    let orders = match stepping {
        Stepping::Located => ObservedOrders::of(&measured, observed_order),
        Stepping::Straddling => ObservedOrders::of(&measured, mean_order),
    };
    Ok(Convergence { measured, orders })
}

/// A guard that is not finite, or chatter, is what a step too large leads to, as a state that is not finite.
fn interrupted<F>(reason: Interruption<F>) -> IntegrateError {
    match reason {
        Interruption::Integrate(error) => error,
        Interruption::NonFiniteGuard { t, .. }
        | Interruption::Chattering { t, .. }
        | Interruption::Refused { t, .. }
        | Interruption::Unproved { t, .. }
        | Interruption::StepTooLong { t, .. }
        | Interruption::EnergyGain { t, .. } => IntegrateError::NonFinite { t },
    }
}
