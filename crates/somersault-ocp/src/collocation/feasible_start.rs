//! A start for a problem that its own cost leads astray: minimum effort, on a longer horizon each time until there is a motion.
//!
//! From a straight line, a program of least time is often called infeasible: the constraints hold for no horizon near the guess, or
//! the cost pulls the horizon below the shortest one before there is a motion. With the horizon fixed and ½ ∫ Σ ((uᵢ − cᵢ)/sᵢ)² dt
//! for a cost, with c the control of the guess and s its scale, what remains is to find a motion.

use super::error::CollocationError;
use super::guess::Guess;
use super::interval::Interval;
use super::mesh::Mesh;
use super::objective::Square;
use super::optimality::Accuracy;
use super::problem::{Phase, Problem};
use super::solution::PhaseSolution;
use super::solve::{Collocation, MeshRecord, USABLE, is_ended};
use super::transcription::Transcription;
use somersault_core::cancel::CancellationToken;
use somersault_nlp::{Flow, Iteration, NlpSolver, SolverError};
use std::time::Instant;

/// The first horizon is the guess's by this, or the shortest allowed.
const SHORT: f64 = 0.125;
/// Horizons to try at most, each twice the one before it.
const MOST: usize = 12;

impl Phase {
    /// Costs effort in the place of what was posed, over a horizon of its own.
    fn pose_effort(&mut self, (start, end): (f64, f64)) {
        let states = self.sizes.states;
        let controls = self.guess.as_ref().map_or(&[][..], |guess| &guess.controls[0]);
        let squares =
            self.scales.control.iter().zip(controls).enumerate().map(|(i, (scale, &centre))| Square {
                argument: states + i,
                weight: scale.powi(-2),
                centre,
            });
        self.path.exchange(squares.collect());
        self.ends.exchange(Vec::new());
        self.bounds.initial_time = Interval::fixed(start);
        self.bounds.final_time = Interval::fixed(end);
    }
}

/// The horizons of the guesses, all times after the first multiplied by `factor` as far as the bounds allow it.
pub(super) fn horizons(problem: &Problem, factor: f64) -> Vec<(f64, f64)> {
    let guesses = || problem.phases.iter().filter_map(|phase| phase.guess.as_ref().map(Guess::interval));
    let origin = guesses().next().map_or(0.0, |(start, _)| start);
    let moved = |time: f64, bounds: &Interval| bounds.clamp(origin + factor * (time - origin));
    problem
        .phases
        .iter()
        .zip(guesses())
        .map(|(phase, (start, end))| {
            (moved(start, &phase.bounds.initial_time), moved(end, &phase.bounds.final_time))
        })
        .collect()
}

impl<S: NlpSolver> Collocation<S> {
    /// A motion of minimum effort; none where no horizon has one. What was tried is added to `history`.
    pub(super) fn feasible_start(
        &self,
        problem: &mut Problem,
        meshes: &[Mesh],
        on_iteration: &mut dyn FnMut(&Iteration<'_>) -> Flow,
        history: &mut Vec<MeshRecord>,
        token: &CancellationToken,
        left: &mut Option<usize>,
    ) -> Result<Option<Vec<PhaseSolution>>, CollocationError> {
        let mut tried: Vec<Vec<(f64, f64)>> = Vec::new();
        for power in 0..MOST {
            let horizons = horizons(problem, SHORT * f64::from(1 << power));
            if horizons.iter().any(|(start, end)| start >= end) || tried.contains(&horizons) {
                continue;
            }
            let found =
                self.motion_of_least_effort(problem, meshes, &horizons, on_iteration, history, token, left)?;
            if found.is_some() || history.last().is_some_and(|record| is_ended(record.status)) {
                return Ok(found);
            }
            tried.push(horizons);
        }
        Ok(None)
    }

    fn motion_of_least_effort(
        &self,
        problem: &mut Problem,
        meshes: &[Mesh],
        horizons: &[(f64, f64)],
        on_iteration: &mut dyn FnMut(&Iteration<'_>) -> Flow,
        history: &mut Vec<MeshRecord>,
        token: &CancellationToken,
        left: &mut Option<usize>,
    ) -> Result<Option<Vec<PhaseSolution>>, CollocationError> {
        let began = Instant::now();
        let bounds = |phase: &Phase| (phase.bounds.initial_time, phase.bounds.final_time);
        let posed: Vec<_> = problem.phases.iter().map(bounds).collect();
        problem.phases.iter_mut().zip(horizons).for_each(|(phase, horizon)| phase.pose_effort(*horizon));
        let solved = Transcription::try_new(problem, meshes).and_then(|mut transcription| {
            let start = transcription.decision_of_guess().into();
            let (program, failure) = self.solved(&mut transcription, &start, on_iteration, token, left)?;
            if let Some(source) = failure {
                return Err(SolverError::Failed { source, report: Box::new(program) }.into());
            }
            let phases = transcription.solution(&program.z, &program.constraint_multipliers)?;
            Ok((program, phases))
        });
        for (phase, (start, end)) in problem.phases.iter_mut().zip(posed) {
            phase.path.restore();
            phase.ends.restore();
            (phase.bounds.initial_time, phase.bounds.final_time) = (start, end);
        }
        let (program, phases) = solved?;
        history.push(MeshRecord {
            meshes: meshes.to_vec(),
            is_start: true,
            cost: program.cost,
            accuracy: Accuracy::UNKNOWN,
            status: program.status,
            iterations: program.iterations,
            time: began.elapsed(),
        });
        let is_motion = program.residuals.feasibility <= USABLE && !is_ended(program.status);
        Ok(is_motion.then_some(phases))
    }
}
