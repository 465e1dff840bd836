//! Rotational energy of free bodies at large steps, thesis 6.2: Tables 6.2 and 6.3 and the bound (6.4).
//!
//! Each body starts at the same angular velocity ω₀ with its axes along those of the world, and makes
//! steps of size h. Over all bodies the study takes the largest and the smallest ratio Tₙ/T₀ with
//!
//! ```text
//! T = ½ ωᵀ I ω,
//! ```
//!
//! and the largest T in units of the bound that the angular momentum sets,
//!
//! ```text
//! max T = ‖L‖² / (2 I_min)                                                (6.4)
//! ```
//!
//! The exact motion has Tₙ = T₀. A method that conserves L (the momentum forms, `sv`, `aso`) is held by the
//! bound at any step size; one that starts up by another method keeps the L that its start-up leaves.
//!
//! # Reading of the thesis
//! (6.2) prints the inverse inertia of the prism 1 × l_y × l_z (of mass 6); [`prisms`] makes the bodies.
//! I_B33 in (6.4) is the smallest principal moment, in this grid the first. The multistep methods start
//! up by the ladder [`StartUp::Ladder`]. So read, Table 6.2 reproduces but for the row of Störmer–Verlet
//! and two cells, see the test `thesis_tables`.
//!
//! # Overflow
//! A state or an energy that stops being finite counts as an infinite ratio from then on, "Inf" in the
//! table. The drivers refuse such a state, so the study steps by itself, with the drivers'
//! renormalisation.
//!
//! # Cost
//! bodies × steps evaluations times those of the method, on all cores; independent of their number.

use super::{Progress, StudyError, check_not_empty, report};
use crate::body::{BodyError, RigidBody};
use crate::driver::IntegrateError;
use crate::engine::{Engine, FormEngine, Track};
use crate::methods::{Method, Options, StartUp};
use crate::state::{Pose, RigidBodyState};
use crate::stepper::{StepError, Stepper};
use crate::system::RigidBodySystem;
use nalgebra::Vector3;
use rayon::prelude::*;
use somersault_core::argument::expect_positive;

/// The prisms 1 × l_y × l_z of mass 6 with l_y, l_z ∈ {1/n, 2/n, …, 1}, l_z running fastest: n² bodies with
/// I = diag(l_y² + l_z², 1 + l_z², 1 + l_y²)/2, the inverse of thesis (6.2). The thesis has n = 100.
pub fn prisms(n: usize) -> Result<Vec<RigidBody>, BodyError> {
    let side = |k: usize| (k + 1) as f64 / n as f64;
    (0..n * n).map(|i| RigidBody::try_box(6.0, Vector3::new(1.0, side(i / n), side(i % n)))).collect()
}

/// ω₀ = (1, 1, 1)/√3 rad/s, thesis (6.3).
pub fn initial_angular_velocity() -> Vector3<f64> {
    Vector3::repeat(1.0 / 3f64.sqrt())
}

/// What to run: initial angular velocity, step and the numbers of steps after which to look.
#[derive(Debug, Clone, PartialEq)]
pub struct EnergySetup {
    /// Angular velocity at the start, rad/s.
    pub angular_velocity: Vector3<f64>,
    /// Step h, s.
    pub dt: f64,
    /// Numbers of steps to look at, increasing.
    pub steps: Vec<u64>,
    /// Options of the method.
    pub options: Options,
}

impl EnergySetup {
    /// The setting of Table 6.2: (6.3), h = 1 s, after 1, 2, 5, 10, 20, 50 and 100 steps, start-up by the
    /// ladder.
    pub fn thesis() -> Self {
        Self {
            angular_velocity: initial_angular_velocity(),
            dt: 1.0,
            steps: vec![1, 2, 5, 10, 20, 50, 100],
            options: Options { start_up: StartUp::Ladder },
        }
    }

    fn check(&self, bodies: &[RigidBody]) -> Result<(), StudyError> {
        check_not_empty("bodies", bodies)?;
        expect_positive("dt", self.dt)?;
        check_not_empty("steps", &self.steps)?;
        expect_positive("angular_velocity", self.angular_velocity.norm())?;
        if self.steps[0] > 0 && self.steps.windows(2).all(|pair| pair[0] < pair[1]) {
            Ok(())
        } else {
            Err(StudyError::NotIncreasing { argument: "steps" })
        }
    }
}

/// Extremes of Tₙ/T₀ over the bodies after a number of steps.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EnergyExtremes {
    /// Steps made, n.
    pub steps: u64,
    /// Largest ratio; infinite where a state overflowed.
    pub max: f64,
    /// Index of the first body that has it.
    pub max_body: usize,
    /// Smallest ratio.
    pub min: f64,
    /// Index of the first body that has it.
    pub min_body: usize,
    /// Bodies that have gained energy: ratio above 1 + 1e-9.
    pub gained: usize,
    /// Bodies that have lost energy: ratio below 1 − 1e-9.
    pub lost: usize,
}

/// What a method does to the energy, as Table 6.3 puts it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Behaviour {
    /// No body has gained energy after any of the numbers of steps.
    UnconditionallyStable,
    /// Some bodies have gained energy, and after the last step some have lost more than 5 %.
    ConditionallyStable,
    /// Some bodies have gained energy, and after the last step none has lost more than 5 %.
    UnconditionallyUnstable,
}

/// Result of the study for one method.
#[derive(Debug, Clone, PartialEq)]
pub struct EnergyStudy {
    /// The extremes after each number of steps requested.
    ///
    /// Where every body's step failed both are NaN.
    pub extremes: Vec<EnergyExtremes>,
    /// The largest T at the end of the start-up or after any later step, in units of the bound (6.4) with
    /// the L at the end of the start-up: at most 1 but for rounding where the method conserves L, infinite on
    /// overflow.
    ///
    /// The start-up takes as many steps as the method remembers, by its INFO.
    pub fraction_of_bound: f64,
    /// The largest factor by which T grew in any one step of any body; at most 1 but for rounding where
    /// energy never rises.
    pub largest_rise: f64,
    /// Bodies whose step failed (an implicit equation without solution at this step size); from the step
    /// that failed they are left out.
    pub failed: usize,
}

impl EnergyStudy {
    /// The verdict in the terms of Table 6.3.
    ///
    /// The thesis gives no rule for its verdicts. This one gives all of them but those of the midpoint
    /// method, whose energy grows in the thesis' own Table 6.2, and of Störmer–Verlet, whose row of that
    /// table does not reproduce.
    pub fn behaviour(&self) -> Behaviour {
        let Some(last) = self.extremes.last() else { return Behaviour::UnconditionallyStable };
        if self.extremes.iter().all(|e| e.gained == 0) {
            Behaviour::UnconditionallyStable
        } else if last.min < 0.95 {
            Behaviour::ConditionallyStable
        } else {
            Behaviour::UnconditionallyUnstable
        }
    }
}

/// Runs `bodies` by a method of the table.
///
/// Errors: an empty list, a step or rates that are not positive and finite, numbers of steps that do not
/// increase, a method that does not apply to free bodies, and a stop by `progress`, which is called after
/// every sixteenth of the bodies.
pub fn energy(
    method: Method,
    setup: &EnergySetup,
    bodies: &[RigidBody],
    progress: &mut Progress<'_>,
) -> Result<EnergyStudy, StudyError> {
    study(setup, bodies, progress, &|body| {
        let system = RigidBodySystem::free(*body);
        let initial = RigidBodyState::spinning(setup.angular_velocity);
        let engaged =
            method.engage(setup.options, &system, &initial, &mut |engine| run(engine, &initial, body, setup));
        Ok(engaged??)
    })
}

/// As [`energy`], by a stepper.
pub fn energy_of<M: Stepper<RigidBodySystem> + Sync>(
    stepper: &M,
    setup: &EnergySetup,
    bodies: &[RigidBody],
    progress: &mut Progress<'_>,
) -> Result<EnergyStudy, StudyError> {
    study(setup, bodies, progress, &|body| {
        let system = RigidBodySystem::free(*body);
        let initial = RigidBodyState::spinning(setup.angular_velocity);
        let mut engine = FormEngine::unchanged(&system, stepper, initial)?;
        Ok(run(&mut engine, &initial, body, setup)?)
    })
}

/// Energy ratios of one body at the steps requested, and what [`EnergyStudy`] says of all bodies.
struct Run {
    ratios: Vec<f64>,
    fraction_of_bound: f64,
    largest_rise: f64,
}

fn run(
    engine: &mut dyn Engine<Pose>,
    initial: &RigidBodyState,
    body: &RigidBody,
    setup: &EnergySetup,
) -> Result<Run, StepError> {
    // ω and L in the body frame, and T.
    let look = |x: &RigidBodyState| {
        let omega = x.orientation().inverse_transform_vector(x.angular_velocity());
        let momentum = body.inertia().momentum(&omega);
        (momentum.norm_squared(), 0.5 * omega.dot(&momentum))
    };
    let least_moment = body.inertia().principal_moments().min();
    let mut seen = *initial;
    let (mut squared_momentum, at_start) = look(&seen);
    let mut energy = at_start;
    let mut largest_energy = energy;
    let mut largest_rise: f64 = 0.0;
    let mut ratios = Vec::with_capacity(setup.steps.len());
    let (mut before, mut after) = (engine.keep(initial), engine.keep(initial));
    let history = u64::from(engine.info().history);
    let mut done = 0;
    'marks: for &mark in &setup.steps {
        while done < mark {
            let t = done as f64 * setup.dt;
            match engine.advance(Track::RUN, t, setup.dt, before, after, Some(&mut seen)) {
                Ok(()) => {}
                Err(IntegrateError::Step(error)) if error.is_refusal() => return Err(error),
                Err(IntegrateError::NonFinite { .. }) => seen.rate.angular.fill(f64::INFINITY),
                // The ratios that are missing say that the step failed.
                Err(_) => break 'marks,
            }
            std::mem::swap(&mut before, &mut after);
            done += 1;
            let energy_before = energy;
            let squared_momentum_now;
            (squared_momentum_now, energy) = look(&seen);
            if !energy.is_finite() {
                ratios.resize(setup.steps.len(), f64::INFINITY);
                (largest_energy, largest_rise) = (f64::INFINITY, f64::INFINITY);
                break 'marks;
            }
            if done <= history {
                (squared_momentum, largest_energy) = (squared_momentum_now, energy);
            }
            largest_energy = largest_energy.max(energy);
            largest_rise = largest_rise.max(energy / energy_before);
        }
        ratios.push(energy / at_start);
    }
    let bound = squared_momentum / (2.0 * least_moment);
    Ok(Run { ratios, fraction_of_bound: largest_energy / bound, largest_rise })
}

fn study(
    setup: &EnergySetup,
    bodies: &[RigidBody],
    progress: &mut Progress<'_>,
    run: &(dyn Fn(&RigidBody) -> Result<Run, StudyError> + Sync),
) -> Result<EnergyStudy, StudyError> {
    setup.check(bodies)?;
    let mut result = EnergyStudy {
        extremes: setup
            .steps
            .iter()
            .map(|&steps| EnergyExtremes {
                steps,
                max: f64::NAN,
                max_body: 0,
                min: f64::NAN,
                min_body: 0,
                gained: 0,
                lost: 0,
            })
            .collect(),
        fraction_of_bound: 0.0,
        largest_rise: 0.0,
        failed: 0,
    };
    let mut done = 0;
    for part in bodies.chunks(bodies.len().div_ceil(16)) {
        let runs: Vec<_> = part.par_iter().map(run).collect();
        for (body, run) in (done..).zip(runs) {
            result.add(body, &run?);
        }
        done += part.len();
        report(progress, done, bodies.len())?;
    }
    Ok(result)
}

impl EnergyStudy {
    fn add(&mut self, body: usize, run: &Run) {
        const ROUNDING: f64 = 1e-9;
        self.failed += usize::from(run.ratios.len() < self.extremes.len());
        self.fraction_of_bound = self.fraction_of_bound.max(run.fraction_of_bound);
        self.largest_rise = self.largest_rise.max(run.largest_rise);
        for (extremes, &ratio) in self.extremes.iter_mut().zip(&run.ratios) {
            if extremes.max.is_nan() || ratio > extremes.max {
                (extremes.max, extremes.max_body) = (ratio, body);
            }
            if extremes.min.is_nan() || ratio < extremes.min {
                (extremes.min, extremes.min_body) = (ratio, body);
            }
            extremes.gained += usize::from(ratio > 1.0 + ROUNDING);
            extremes.lost += usize::from(ratio < 1.0 - ROUNDING);
        }
    }
}
