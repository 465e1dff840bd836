//! What a run is asked to do.

use crate::core::convert::{positive, real_numbers};
use crate::core::error::Error;
use crate::core::waiting::deliver;
use pyo3::prelude::*;
use somersault::integrators::driver::{Adaptive, Steps, TimeGrid};
use somersault::integrators::events::StiffSteps;
use somersault::integrators::methods::{Method, Options, StartUp};
use somersault::integrators::run::{ByMethod, Run};
use somersault::integrators::state::Tolerances;
use somersault::integrators::system::System;

/// A run as requested, and what is to be kept of it.
pub(crate) struct Plan {
    pub(crate) method: Method,
    pub(crate) options: Options,
    /// Backwards they are those of the run of reversed time.
    pub(crate) steps: Steps,
    pub(crate) backwards: bool,
    pub(crate) every: u64,
    /// The times of the states to be kept, in the place of `every`.
    pub(crate) t_eval: Option<Vec<f64>>,
    pub(crate) dense: bool,
    pub(crate) calls_python: bool,
    pub(crate) return_interrupted: bool,
}

impl Plan {
    /// The run of a system.
    pub(crate) fn run<'a, S: System>(&self, system: &'a S) -> Run<'a, S, ByMethod> {
        Run::new(system, self.method, self.steps).with_options(self.options)
    }

    /// Evaluations of the equations of motion in each step tried.
    pub(crate) fn evaluations_per_step(&self) -> u64 {
        match self.steps {
            Steps::Fixed(_) => u64::from(self.method.info().evaluations),
            Steps::Adapted { .. } => self.method.info().adapted_evaluations(),
        }
    }

    /// Start and end.
    pub(crate) fn interval(&self) -> (f64, f64) {
        let (start, end) = self.steps.interval();
        if self.backwards { (-start, -end) } else { (start, end) }
    }

    /// The solution, or the exception with the solution as its attribute.
    pub(crate) fn deliver<S: pyo3::PyClass>(
        &self,
        py: Python<'_>,
        failed: Option<PyErr>,
        solution: Py<S>,
    ) -> Result<Py<S>, Error> {
        deliver(py, failed, self.return_interrupted, solution)
    }
}

/// The times to keep the states at, and the number of steps between those kept otherwise.
pub(crate) fn kept(t_eval: Option<&Bound<'_, PyAny>>, every: i64) -> Result<(Option<Vec<f64>>, u64), Error> {
    let every = every_of(every)?;
    let t_eval = t_eval.map(|times| real_numbers("t_eval", times)).transpose()?;
    if t_eval.is_some() && every != 1 {
        return Err(Error::input(
            "`every` counts steps, and `t_eval` gives the times to keep: give one of them",
        ));
    }
    Ok((t_eval, every))
}

/// The arguments that choose the steps.
#[derive(Clone, Copy)]
pub(crate) struct StepArguments {
    pub(crate) dt: Option<f64>,
    pub(crate) rtol: Option<f64>,
    pub(crate) atol: Option<f64>,
    pub(crate) max_step: Option<f64>,
    pub(crate) first_step: Option<f64>,
    pub(crate) max_steps: Option<i64>,
}

impl StepArguments {
    /// Steps forwards or backwards, which those of the run of reversed time are, and which of the two.
    pub(crate) fn either_way(self, method: Method, (start, end): (f64, f64)) -> Result<(Steps, bool), Error> {
        if start == end || !start.is_finite() || !end.is_finite() {
            return Err(Error::input(format!(
                "`interval` must lead from one finite time to another, found ({start}, {end})"
            )));
        }
        let backwards = end < start;
        let steps = self.steps(method, if backwards { (-start, -end) } else { (start, end) })?;
        Ok((steps, backwards))
    }

    /// Fixed steps where `dt` is given, adapted ones where it is not.
    pub(crate) fn steps(self, method: Method, interval: (f64, f64)) -> Result<Steps, Error> {
        match self.dt {
            Some(dt) => {
                let adaptive = [
                    ("rtol", self.rtol.is_some()),
                    ("atol", self.atol.is_some()),
                    ("max_step", self.max_step.is_some()),
                    ("first_step", self.first_step.is_some()),
                    ("max_steps", self.max_steps.is_some()),
                ];
                if let Some((name, _)) = adaptive.iter().find(|(_, given)| *given) {
                    return Err(Error::input(format!(
                        "`{name}` is for adaptive steps; leave out `dt` to have them"
                    )));
                }
                Ok(TimeGrid::try_new(interval.0, interval.1, dt)?.into())
            }
            None => {
                if !method.info().is_adaptive() {
                    return Err(Error::input(format!(
                        "method `{}` has no error estimate and remembers previous steps, so that its steps are not adapted: give it a fixed step `dt`, or take a one-step method, such as `rkmk8`",
                        method.info().name
                    )));
                }
                let default = Adaptive::default();
                let settings = Adaptive {
                    tolerances: Tolerances {
                        relative: positive("rtol", self.rtol.unwrap_or(default.tolerances.relative))?,
                        absolute: positive("atol", self.atol.unwrap_or(default.tolerances.absolute))?,
                    },
                    first_step: self.first_step,
                    max_step: self.max_step.unwrap_or(default.max_step),
                    max_steps: self.max_steps.map_or(Ok(default.max_steps), max_steps_of)?,
                };
                Ok(Steps::adapted(interval, settings))
            }
        }
    }
}

fn max_steps_of(max_steps: i64) -> Result<usize, Error> {
    let positive = usize::try_from(max_steps).ok().filter(|n| *n > 0);
    positive.ok_or_else(|| {
        Error::input(format!("`max_steps` must be a positive number of steps, found {max_steps}"))
    })
}

/// A number of steps.
pub(crate) fn every_of(every: i64) -> Result<u64, Error> {
    let positive = u64::try_from(every).ok().filter(|n| *n > 0);
    positive.ok_or_else(|| Error::input(format!("`every` must be a positive number of steps, found {every}")))
}

/// What is done about fixed steps that are too long, by their most parts; None makes them as they are given.
pub(crate) fn stiff_of(max_substeps: Option<i64>) -> Result<StiffSteps, Error> {
    match max_substeps.map(u64::try_from) {
        None => Ok(StiffSteps::AsGiven),
        Some(Ok(most @ 1..)) => Ok(StiffSteps::Divide { most }),
        Some(_) => {
            let found = max_substeps.unwrap_or_default();
            Err(Error::input(format!("`max_substeps` must be positive or None, found {found}")))
        }
    }
}

/// How the Adams methods start, by its name.
pub(crate) fn start_up_of(name: &str) -> Result<StartUp, Error> {
    match name {
        "one_step" => Ok(StartUp::OneStep),
        "ladder" => Ok(StartUp::Ladder),
        _ => Err(Error::input(format!("`start_up` must be 'one_step' or 'ladder', found '{name}'"))),
    }
}
