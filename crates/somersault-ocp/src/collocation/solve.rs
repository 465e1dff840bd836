//! The loop: solve on a mesh, estimate the error, refine, start again from there.

use super::confirmation::{Confirmation, confirm_while};
use super::error::CollocationError;
use super::mesh::Mesh;
use super::problem::Problem;
use super::radau::MAX_POINTS;
use super::refinement::{self, IntervalError};
use super::solution::{PhaseSolution, RestMultipliers};
use super::transcription::Transcription;
use crate::attention::GoOn;
use crate::solver::{Flow, Globalisation, Iteration, NlpSolver, Report, Sqp, Start, Status};
use serde::{Deserialize, Serialize};
use std::time::{Duration, Instant};

/// How far an infeasible point of a mesh may be from feasible for the next mesh to start from it.
const USABLE: f64 = 1e-4;
/// Relative defect from which on a motion is not coarse but none.
const NO_MOTION: f64 = 1e-2;

/// Collocation with mesh refinement.
#[derive(Debug, Clone)]
pub struct Collocation<S = Sqp> {
    /// Relative error of the states that each interval may have: by the estimate of the refinement, and then as a
    /// defect when it is integrated anew.
    pub tolerance: f64,
    /// Meshes to try at most, the first among them.
    pub max_meshes: usize,
    /// Points of an interval made by division.
    pub min_points: usize,
    /// Points at which an interval is divided rather than given more.
    pub max_points: usize,
    /// What solves the nonlinear programs.
    pub solver: S,
}

impl Default for Collocation {
    fn default() -> Self {
        Self {
            tolerance: 1e-6,
            max_meshes: 20,
            min_points: 3,
            max_points: 12,
            solver: Sqp { globalisation: Globalisation::Filter, ..Sqp::default() },
        }
    }
}

/// How a search ended. Whatever it is, the report has the best motion found.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[non_exhaustive]
pub enum CollocationStatus {
    /// The program converged on a mesh that meets the tolerance, and the motion was confirmed.
    Converged,
    /// The program converged, and its motion is none: integrated anew it leaves its own nodes by more than the tolerance
    /// though its mesh should meet it, or by more than 10⁻² of the states whatever the mesh.
    FalseConvergence,
    /// The last mesh allowed does not meet the tolerance.
    MeshLimit,
    /// The program of the last mesh did not converge.
    NotSolved(Status),
}

/// One mesh of a search.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct MeshRecord {
    /// One for each phase.
    pub meshes: Vec<Mesh>,
    /// Cost as the program sees it.
    pub cost: f64,
    /// Largest estimated relative error of an interval.
    pub error: f64,
    /// How the program ended.
    pub status: Status,
    /// Steps of the solver.
    pub iterations: usize,
    /// Of this mesh.
    pub time: Duration,
}

/// What a search found.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct CollocationReport {
    /// How it ended.
    pub status: CollocationStatus,
    /// One for each phase.
    pub phases: Vec<PhaseSolution>,
    /// Cost as the last program sees it; beside it there is that of the [`Confirmation`].
    pub cost: f64,
    /// What an accurate integration makes of it.
    pub confirmation: Confirmation,
    /// All meshes, the last one that of the solution.
    pub history: Vec<MeshRecord>,
    /// Of the last program.
    pub program: Report,
}

impl<S: NlpSolver> Collocation<S> {
    /// Solves, from the guesses of the phases and from `meshes`, one for each phase. `on_iteration` sees each
    /// step of each program, and ends the search by [`Flow::Stop`].
    pub fn solve(
        &self,
        problem: &mut Problem,
        meshes: &[Mesh],
        on_iteration: &mut dyn FnMut(&Iteration<'_>) -> Flow,
    ) -> Result<CollocationReport, CollocationError> {
        self.solve_while(problem, meshes, on_iteration, &mut || true)
    }

    /// The same for as long as `go_on`, which is asked at each step of the integration that confirms the motion. Without
    /// it the status is [`Status::Interrupted`], and what was solved is kept.
    pub fn solve_while(
        &self,
        problem: &mut Problem,
        meshes: &[Mesh],
        on_iteration: &mut dyn FnMut(&Iteration<'_>) -> Flow,
        go_on: GoOn<'_>,
    ) -> Result<CollocationReport, CollocationError> {
        self.check()?;
        let mut meshes = meshes.to_vec();
        let mut history: Vec<MeshRecord> = Vec::new();
        let mut previous: Option<(Vec<PhaseSolution>, RestMultipliers)> = None;
        loop {
            let began = Instant::now();
            let mut transcription = Transcription::try_new(problem, &meshes)?;
            let start = match &previous {
                None => transcription.decision_of_guess().into(),
                Some((phases, rest)) => {
                    let (z, constraint_multipliers) = transcription.continued(phases, rest);
                    Start { z, constraint_multipliers, hessian: None }
                }
            };
            let program = self.solver.solve(&mut transcription, &start, on_iteration)?;
            let phases = transcription.solution(&program.z, &program.constraint_multipliers)?;
            let rest = transcription.rest(&program.constraint_multipliers);
            drop(transcription);
            let pairs = problem.phases.iter_mut().zip(&phases);
            let errors = pairs
                .map(|(phase, solution)| refinement::errors(phase, solution))
                .collect::<Result<Vec<_>, _>>()?;
            let error = errors.iter().flatten().fold(0.0, |m: f64, e| m.max(e.relative));
            history.push(MeshRecord {
                meshes: meshes.clone(),
                cost: program.cost,
                error,
                status: program.status,
                iterations: program.iterations,
                time: began.elapsed(),
            });
            let is_met = program.status.is_converged() && error <= self.tolerance;
            if is_met || !is_usable(&program) || history.len() >= self.max_meshes {
                return self.report(problem, phases, history, program, go_on);
            }
            meshes = meshes
                .iter()
                .zip(&errors)
                .map(|(mesh, errors)| self.refined(mesh, errors))
                .collect::<Result<_, _>>()?;
            previous = Some((phases, rest));
        }
    }

    fn refined(&self, mesh: &Mesh, errors: &[IntervalError]) -> Result<Mesh, CollocationError> {
        refinement::refined(mesh, errors, self.tolerance, self.min_points, self.max_points)
    }

    fn report(
        &self,
        problem: &mut Problem,
        phases: Vec<PhaseSolution>,
        history: Vec<MeshRecord>,
        program: Report,
        go_on: GoOn<'_>,
    ) -> Result<CollocationReport, CollocationError> {
        let mut is_cut = false;
        let mut goes_on = || {
            is_cut |= !go_on();
            !is_cut
        };
        let confirmation = confirm_while(problem, &phases, &mut goes_on)?;
        let is_met = history.last().is_some_and(|mesh| mesh.error <= self.tolerance);
        let defect = confirmation.max_defect();
        let status = if !program.status.is_converged() {
            CollocationStatus::NotSolved(program.status)
        } else if is_cut {
            CollocationStatus::NotSolved(Status::Interrupted)
        } else if defect > if is_met { self.tolerance } else { self.tolerance.max(NO_MOTION) } {
            CollocationStatus::FalseConvergence
        } else if !is_met {
            CollocationStatus::MeshLimit
        } else {
            CollocationStatus::Converged
        };
        Ok(CollocationReport { status, phases, cost: program.cost, confirmation, history, program })
    }

    fn check(&self) -> Result<(), CollocationError> {
        for (argument, found) in [
            ("tolerance", self.tolerance),
            ("max_meshes", self.max_meshes as f64),
            ("min_points", self.min_points as f64),
        ] {
            if !(found > 0.0 && found.is_finite()) {
                return Err(CollocationError::NotPositive { argument, found });
            }
        }
        if self.min_points <= self.max_points && self.max_points <= MAX_POINTS {
            Ok(())
        } else {
            let (least, most) = (self.min_points, self.max_points);
            Err(CollocationError::PointRange { least, most })
        }
    }
}

/// Whether another mesh may start from where this program ended.
fn is_usable(program: &Report) -> bool {
    match program.status {
        Status::Converged => true,
        Status::Stalled | Status::IterationLimit => program.residuals.feasibility <= USABLE,
        _ => false,
    }
}
