//! Accuracy against work, thesis 7.2.1: Figures 7.1 and 7.2.
//!
//! Each run of a [`Problem`] gives the errors at the end, the steps, the evaluations of the equations of
//! motion and the time it took. The thesis plots the orientation error (Figure 7.1) and the angular
//! velocity error (7.2, whose caption says orientation) over the time.
//!
//! # What is counted
//! An evaluation is one call for the accelerations or the wrenches of all bodies, start-up included. A free
//! body is counted as if it were under forces; a method that then still asks for none counts the evaluations
//! of its INFO per step. Counts are of a run of their own, by a [`Counted`] system with the equations of the problem, so
//! that the time is that of the bare run.
//!
//! # What is timed
//! The wall time of the integration alone, the least of `repeats` runs one after the other on the calling
//! thread. It measures this machine; errors, steps and evaluations do not depend on it.

use super::order::{Integrated, forgive};
use super::problem::{Errors, Problem};
use super::{Progress, StudyError, check_not_empty, report};
use crate::counted::Counted;
use crate::driver::{Adaptive, IntegrateError, Steps, TimeGrid};
use crate::methods::{Method, Options};
use crate::run::Run;
use crate::stepper::Stepper;
use crate::system::RigidSystem;
use somersault_core::argument::expect_positive;
use std::time::Instant;

/// How the steps of a run are chosen.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum StepChoice {
    /// All of this size, s.
    Fixed(f64),
    /// Adapted to this relative tolerance, and to a hundredth of it as the absolute one.
    Tolerance(f64),
}

impl StepChoice {
    /// The steps of a run from 0 to `t_end`.
    fn steps(self, t_end: f64) -> Result<Steps, IntegrateError> {
        Ok(match self {
            Self::Fixed(dt) => TimeGrid::try_new(0.0, t_end, dt)?.into(),
            Self::Tolerance(tolerance) => {
                Steps::adapted((0.0, t_end), Adaptive::with_tolerances(tolerance, 0.01 * tolerance))
            }
        })
    }
}

/// One run.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WorkPoint {
    /// How its steps were chosen.
    pub choice: StepChoice,
    /// Errors at the end; infinite where the state overflowed, a step failed or the tolerance could not be
    /// met, and then all else is 0.
    pub errors: Errors,
    /// Steps made.
    pub steps: u64,
    /// Steps tried and rejected.
    pub rejected: u64,
    /// Evaluations of the equations of motion.
    pub evaluations: u64,
    /// Least wall time of the repeats, s.
    pub seconds: f64,
}

/// Runs a problem by a method of the table with each of the choices; `counted` is the system of the problem once more,
/// `Counted::new(problem.system())` or another type with the same equations, whose evaluations are counted.
///
/// Errors: an empty list, a step or tolerance that is not positive, a tolerance for a method without error
/// estimate, a method that does not apply, and a stop by `progress`, which is called after each choice.
/// `repeats` of 0 is taken as 1.
pub fn work_precision<S, C>(
    problem: &Problem<S>,
    counted: &Counted<C>,
    method: Method,
    options: Options,
    choices: &[StepChoice],
    repeats: usize,
    progress: &mut Progress<'_>,
) -> Result<Vec<WorkPoint>, StudyError>
where
    S: RigidSystem,
    C: RigidSystem<Configuration = S::Configuration>,
{
    let bench = Bench { problem, counted, nominal: method.info().evaluations, repeats };
    bench.run(choices, progress, &|steps, counting| {
        if counting {
            Run::new(counted, method, steps).with_options(options).from(problem.initial())
        } else {
            Run::new(problem.system(), method, steps).with_options(options).from(problem.initial())
        }
    })
}

/// As [`work_precision`], by a stepper with steps of fixed sizes `dts`.
pub fn work_precision_of<S, C, M>(
    problem: &Problem<S>,
    counted: &Counted<C>,
    stepper: &M,
    dts: &[f64],
    repeats: usize,
    progress: &mut Progress<'_>,
) -> Result<Vec<WorkPoint>, StudyError>
where
    S: RigidSystem,
    C: RigidSystem<Configuration = S::Configuration>,
    M: Stepper<S> + Stepper<Counted<C>>,
{
    let choices: Vec<_> = dts.iter().map(|dt| StepChoice::Fixed(*dt)).collect();
    let bench = Bench { problem, counted, nominal: M::INFO.evaluations, repeats };
    bench.run(&choices, progress, &|steps, counting| {
        if counting {
            Run::by_stepper(counted, stepper, steps).from(problem.initial())
        } else {
            Run::by_stepper(problem.system(), stepper, steps).from(problem.initial())
        }
    })
}

struct Bench<'a, S: RigidSystem, C> {
    problem: &'a Problem<S>,
    counted: &'a Counted<C>,
    nominal: u8,
    repeats: usize,
}

impl<S: RigidSystem, C> Bench<'_, S, C> {
    /// `go` integrates with steps, the counted system or the bare one.
    fn run(
        &self,
        choices: &[StepChoice],
        progress: &mut Progress<'_>,
        go: &dyn Fn(Steps, bool) -> Integrated<S>,
    ) -> Result<Vec<WorkPoint>, StudyError> {
        check_not_empty("choices", choices)?;
        for choice in choices {
            match choice {
                StepChoice::Fixed(dt) => expect_positive("dt", *dt)?,
                StepChoice::Tolerance(tolerance) => expect_positive("tolerance", *tolerance)?,
            };
        }
        let mut points = Vec::with_capacity(choices.len());
        for &choice in choices {
            points.push(self.point(choice, go)?);
            report(progress, points.len(), choices.len())?;
        }
        Ok(points)
    }

    fn point(
        &self,
        choice: StepChoice,
        go: &dyn Fn(Steps, bool) -> Integrated<S>,
    ) -> Result<WorkPoint, StudyError> {
        let steps = choice.steps(self.problem.t_end())?;
        let failed = WorkPoint {
            choice,
            errors: Errors::INFINITE,
            steps: 0,
            rejected: 0,
            evaluations: 0,
            seconds: 0.0,
        };
        let mut seconds = f64::INFINITY;
        let mut end = None;
        for _ in 0..self.repeats.max(1) {
            let start = Instant::now();
            let run = go(steps, false);
            seconds = seconds.min(start.elapsed().as_secs_f64());
            end = forgive(run)?;
            if end.is_none() {
                return Ok(failed);
            }
        }
        let Some(outcome) = end else { return Ok(failed) };
        self.counted.reset();
        forgive(go(steps, true))?;
        let tried = outcome.steps + outcome.rejected;
        let evaluations = match self.counted.calls() {
            0 => tried * u64::from(self.nominal),
            counted => counted,
        };
        Ok(WorkPoint {
            choice,
            errors: self.problem.errors(&outcome.state),
            steps: outcome.steps,
            rejected: outcome.rejected,
            evaluations,
            seconds,
        })
    }
}
