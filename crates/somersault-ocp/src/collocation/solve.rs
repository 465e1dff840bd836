//! The loop: solve on a mesh, estimate the error, refine, start again from there.

use super::confirmation::{Confirmation, confirm_cancellable};
use super::error::CollocationError;
use super::function::RelativeErrors;
use super::limited::Limited;
use super::mesh::Mesh;
use super::optimality::{Accuracy, IntervalOptimality, optimality};
use super::problem::{Phase, Problem};
use super::radau::MAX_POINTS;
use super::refinement;
use super::solution::{PhaseSolution, RestMultipliers};
use super::transcription::Transcription;
use super::winding::unwind;
use crate::WrongDerivative;
use somersault_core::argument::{expect_positive, expect_range};
use somersault_core::cancel::CancellationToken;
use somersault_nlp::{
    Counts, EvaluationError, Exhausted, Flow, Globalisation, Iteration, KktResiduals, NlpSolver, Report,
    SolverError, Sqp, Start, Status, negative_curvature,
};
use std::error::Error;
use std::time::{Duration, Instant};

/// How far an infeasible point of a mesh may be from feasible for the next mesh to start from it.
pub(crate) const USABLE: f64 = 1e-4;
/// Meshes in a row that leave more than this fraction of the least error before them, after which there is no other.
const PATIENCE: usize = 5;
const WORTHWHILE: f64 = 0.5;
/// Meshes in a row whose programs end at their limit of iterations, after which there is no other.
const CREEPING: usize = 2;
/// Tolerance of the programs in units of the error of derivatives, where that is more.
const NOISE: f64 = 10.0;
/// Saddles that the program of a first mesh may be led away from, one after the other, and how far: the largest change of a variable, in
/// its scale.
const MOST_SADDLES: usize = 3;
const AWAY: f64 = 0.3;
/// What a cost must fall by, relative to one and itself, for the program to have been at a saddle.
const LOWER: f64 = 1e-6;
/// Relative defect from which on a motion is not coarse but none.
pub(crate) const NO_MOTION: f64 = 1e-2;

/// Collocation with mesh refinement.
#[derive(Debug, Clone)]
pub struct Collocation<S = Sqp> {
    /// Relative error of the states that each interval may have, by the estimate of the refinement and then as a defect when
    /// it is integrated again; relative error of the cost; and what else [`Accuracy::meets`] names.
    pub tolerance: f64,
    /// Meshes to try at most, the first among them.
    pub max_meshes: usize,
    /// Evaluations of cost and constraints at most, of all programs together.
    pub max_evaluations: Option<usize>,
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
            max_evaluations: None,
            min_points: 3,
            max_points: 12,
            solver: Sqp { globalisation: Globalisation::Filter, crossover: true, ..Sqp::default() },
        }
    }
}

/// How a search ended. In every case the report has the best motion found.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub enum CollocationStatus {
    /// The program converged on a mesh where all estimated errors meet the tolerance ([`Accuracy::meets`]), and the motion
    /// was confirmed by integration.
    Converged,
    /// The program converged, but its solution is not a motion: on re-integration it leaves its own nodes by more than the tolerance
    /// though its mesh should meet it, or by more than 10⁻² of the states whatever the mesh.
    FalseConvergence,
    /// The last mesh does not meet the tolerance, and no other is allowed or finer ones do not help: [`Accuracy::shortfall`]
    /// says in what.
    MeshLimit,
    /// The cost still falls along a free time where the program ended: its slope is small beside one and not beside the terms
    /// it is made of. A cost of effort alone has no minimum over a time without an upper bound.
    NoMinimum,
    /// The program of the last mesh did not converge.
    NotSolved(Status),
}

/// One mesh of a search.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct MeshRecord {
    /// One for each phase.
    pub meshes: Vec<Mesh>,
    /// Whether the program was for a start, and its errors are [unknown](Accuracy::UNKNOWN): one of splines, one of minimum effort on
    /// a fixed horizon, whose cost is the effort, or one that ended at a saddle.
    pub is_start: bool,
    /// Cost as the program sees it.
    pub cost: f64,
    /// Estimated errors.
    pub accuracy: Accuracy,
    /// How the program ended.
    pub status: Status,
    /// Steps of the solver.
    pub iterations: usize,
    /// Of this mesh.
    pub time: Duration,
}

/// What a search found.
#[derive(Debug, Clone)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
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
    /// A derivative that differences contradict along the motion, where the search did not converge: a likely reason.
    #[cfg_attr(feature = "serde", serde(default))]
    pub wrong_derivative: Option<WrongDerivative>,
    /// How accurate the functions were.
    #[cfg_attr(feature = "serde", serde(default))]
    pub relative_errors: RelativeErrors,
    /// Where the search started and why, if that was chosen for it.
    #[cfg_attr(feature = "serde", serde(default))]
    pub origin: String,
}

impl CollocationReport {
    /// The last mesh of each phase.
    pub(crate) fn meshes(&self) -> Vec<Mesh> {
        self.phases.iter().map(|phase| phase.mesh().clone()).collect()
    }

    /// Whether the search ended where a wrong derivative would have it end.
    fn is_suspect(&self) -> bool {
        match self.status {
            CollocationStatus::NotSolved(status) => status.is_suspect(),
            CollocationStatus::MeshLimit => true,
            CollocationStatus::Converged
            | CollocationStatus::FalseConvergence
            | CollocationStatus::NoMinimum => false,
        }
    }

    /// Whether the first program had no motion, and a better start may have one.
    fn is_lost(&self) -> bool {
        let is_lost =
            |status| matches!(status, Status::Infeasible | Status::IterationLimit | Status::Stalled);
        self.history.len() == 1 && self.history.iter().all(|mesh| is_lost(mesh.status))
    }

    /// Estimated errors of the solution.
    pub fn accuracy(&self) -> Accuracy {
        self.history.last().map_or_else(Accuracy::default, |mesh| mesh.accuracy)
    }
}

impl AsRef<Self> for CollocationReport {
    fn as_ref(&self) -> &Self {
        self
    }
}

/// Why a search has no solution.
#[derive(Debug, thiserror::Error)]
pub enum SearchError {
    /// Something is wrong with the problem or a mesh, or a function has no value at the start.
    #[error(transparent)]
    Collocation(CollocationError),
    /// A function of the user failed; the search ended there.
    #[error("a function of the user failed: {source}")]
    Failed {
        /// What it said.
        source: Box<dyn Error + Send + Sync>,
        /// The best iterate until then, neither judged nor confirmed.
        report: Box<CollocationReport>,
    },
}

impl<E: Into<CollocationError>> From<E> for SearchError {
    fn from(error: E) -> Self {
        Self::Collocation(error.into())
    }
}

/// What a function of the user failed with.
type Failure = Box<dyn Error + Send + Sync>;

/// Where a search begins.
#[derive(Clone, Copy)]
pub(crate) enum Origin<'a> {
    /// At the guesses of the phases.
    Phases,
    /// At a motion of the phases.
    Motion(&'a [PhaseSolution]),
    /// At the solution of a like problem.
    Solution(&'a CollocationReport),
}

impl Collocation {
    /// The same for functions that are less accurate than rounding: its program is solved as far as derivatives allow it. A
    /// tolerance below the error of the values is refused.
    pub fn try_with_errors(mut self, errors: RelativeErrors) -> Result<Self, CollocationError> {
        let allowed = "at least the relative error of the functions";
        expect_range("tolerance", self.tolerance, allowed, |tolerance| tolerance >= errors.values)?;
        let least = NOISE * errors.derivatives;
        let solver = &mut self.solver;
        for tolerance in
            [&mut solver.stationarity_tol, &mut solver.feasibility_tol, &mut solver.complementarity_tol]
        {
            *tolerance = tolerance.max(least);
        }
        Ok(self)
    }
}

impl<S: NlpSolver> Collocation<S> {
    /// Solves, from the guesses of the phases and from `meshes`, one for each phase. Where the first program has no motion, the
    /// search starts again from one of minimum effort, on horizons of an eighth of the guess's and longer until there is one. Where it
    /// ends at a saddle ([`negative_curvature`]) and no guess was given, the search continues to a lower cost.
    /// `on_iteration` sees each step of each program, and ends the search by [`Flow::Stop`].
    pub fn solve(
        &self,
        problem: &mut Problem,
        meshes: &[Mesh],
        on_iteration: &mut dyn FnMut(&Iteration<'_>) -> Flow,
    ) -> Result<CollocationReport, SearchError> {
        self.solve_cancellable(problem, meshes, on_iteration, &CancellationToken::new())
    }

    /// The same until it is cancelled, which is looked for where a mesh is solved and at each step of the integration that
    /// confirms the motion. Then the status is [`Status::Interrupted`], what was solved is kept, and the errors that were
    /// not estimated any more are [unknown](Accuracy::UNKNOWN).
    pub fn solve_cancellable(
        &self,
        problem: &mut Problem,
        meshes: &[Mesh],
        on_iteration: &mut dyn FnMut(&Iteration<'_>) -> Flow,
        token: &CancellationToken,
    ) -> Result<CollocationReport, SearchError> {
        let mut left = self.max_evaluations;
        self.solve_within(problem, meshes, Origin::Phases, on_iteration, token, &mut left)
    }

    /// The same from where a like problem was solved, another initial state or another parameter apart: on the meshes of that
    /// solution and with its multipliers, so that few steps are left.
    pub fn solve_again(
        &self,
        problem: &mut Problem,
        solution: &CollocationReport,
        on_iteration: &mut dyn FnMut(&Iteration<'_>) -> Flow,
        token: &CancellationToken,
    ) -> Result<CollocationReport, SearchError> {
        let mut left = self.max_evaluations;
        self.solve_within(
            problem,
            &solution.meshes(),
            Origin::Solution(solution),
            on_iteration,
            token,
            &mut left,
        )
    }

    /// One search from the guesses of the phases, with what is left of the evaluations: where it finds no motion, no other start is
    /// sought.
    pub(crate) fn solve_once(
        &self,
        problem: &mut Problem,
        meshes: &[Mesh],
        on_iteration: &mut dyn FnMut(&Iteration<'_>) -> Flow,
        token: &CancellationToken,
        left: &mut Option<usize>,
    ) -> Result<CollocationReport, SearchError> {
        self.check()?;
        let mut found =
            self.search(problem, meshes, Origin::Phases, Vec::new(), on_iteration, token, left)?;
        found.relative_errors = problem.relative_errors();
        Ok(found)
    }

    /// The same with what is left of the evaluations of a longer search.
    pub(crate) fn solve_within(
        &self,
        problem: &mut Problem,
        meshes: &[Mesh],
        origin: Origin<'_>,
        on_iteration: &mut dyn FnMut(&Iteration<'_>) -> Flow,
        token: &CancellationToken,
        left: &mut Option<usize>,
    ) -> Result<CollocationReport, SearchError> {
        self.check()?;
        match problem.expect_derivatives() {
            Err(CollocationError::Evaluation(EvaluationError::Failed(source))) => {
                return self.not_begun(problem, meshes, source);
            }
            expected => expected?,
        }
        let mut found = self.search(problem, meshes, origin, Vec::new(), on_iteration, token, left)?;
        if found.is_lost() {
            let mut starts = Vec::new();
            let start = match self.feasible_start(problem, meshes, on_iteration, &mut starts, token, left) {
                Err(
                    CollocationError::Solver(SolverError::Failed { source, .. })
                    | CollocationError::Evaluation(EvaluationError::Failed(source)),
                ) => {
                    starts.extend(found.history);
                    return ended(found.phases, starts, found.program, source);
                }
                start => start?,
            };
            let ended = starts.last().map(|mesh| mesh.status).filter(|status| is_ended(*status));
            if let Some(start) = start {
                let history = found.history.into_iter().chain(starts).collect();
                let origin = Origin::Motion(&start);
                found = self.search(problem, meshes, origin, history, on_iteration, token, left)?;
            } else {
                starts.extend(found.history);
                let status = ended.map_or(found.status, CollocationStatus::NotSolved);
                found = CollocationReport { history: starts, status, ..found };
            }
        }
        found.relative_errors = problem.relative_errors();
        if found.is_suspect() {
            // what cannot be evaluated there has been said already
            found.wrong_derivative = problem.wrong_derivative(&found.phases).unwrap_or(None);
        }
        Ok(found)
    }

    /// What there is before the first program: the guess.
    fn not_begun(
        &self,
        problem: &mut Problem,
        meshes: &[Mesh],
        source: Failure,
    ) -> Result<CollocationReport, SearchError> {
        let mut transcription = Transcription::try_new(problem, meshes)?;
        let z = transcription.decision_of_guess();
        let multipliers = vec![0.0; transcription.row_scales.len()];
        let phases = transcription.unevaluated(&z, &multipliers);
        let nan = f64::NAN;
        let program = Report {
            status: Status::Failed,
            bound_multipliers: vec![0.0; z.len()],
            z,
            constraint_multipliers: multipliers,
            cost: nan,
            residuals: KktResiduals { stationarity: nan, feasibility: nan, complementarity: nan },
            iterations: 0,
            counts: Counts::default(),
            hessian: None,
        };
        let history = vec![MeshRecord {
            meshes: meshes.to_vec(),
            is_start: false,
            cost: nan,
            accuracy: Accuracy::UNKNOWN,
            status: Status::Failed,
            iterations: 0,
            time: Duration::ZERO,
        }];
        ended(phases, history, program, source)
    }

    /// One search; `history` has what was tried before it.
    fn search(
        &self,
        problem: &mut Problem,
        meshes: &[Mesh],
        origin: Origin<'_>,
        mut history: Vec<MeshRecord>,
        on_iteration: &mut dyn FnMut(&Iteration<'_>) -> Flow,
        token: &CancellationToken,
        left: &mut Option<usize>,
    ) -> Result<CollocationReport, SearchError> {
        // a guess may ask for what is no minimum, such as a turn by more than a whole one
        let is_guessed = problem.phases.iter().any(Phase::is_guessed);
        let mut tried_before = history.len();
        let mut said = String::new();
        let mut meshes = meshes.to_vec();
        let mut previous: Option<(Vec<PhaseSolution>, RestMultipliers)> = None;
        loop {
            let began = Instant::now();
            let mut transcription = Transcription::try_new(problem, &meshes)?;
            let start = match (&previous, origin) {
                (Some((phases, rest)), _) => transcription.continued(phases, rest),
                (None, Origin::Phases) => transcription.decision_of_guess().into(),
                (None, Origin::Motion(phases)) => transcription.at(phases).into(),
                (None, Origin::Solution(solution)) => {
                    transcription.repeated(&solution.phases, &solution.program)?
                }
            };
            let (mut program, mut failure) =
                self.solved(&mut transcription, &start, on_iteration, token, left)?;
            let is_first = previous.is_none() && !matches!(origin, Origin::Solution(_));
            if failure.is_none() && is_first && !is_guessed {
                let saddles;
                (saddles, failure) =
                    self.leave_saddles(&mut transcription, &mut program, on_iteration, token, left)?;
                if let Some(saddle) = saddles.first() {
                    said = format!(
                        "The first program ended at a saddle of cost {:.6}, from which the search continued to a lower cost.",
                        saddle.cost
                    );
                }
                history.extend(saddles.iter().map(|saddle| MeshRecord {
                    meshes: meshes.clone(),
                    is_start: true,
                    cost: saddle.cost,
                    accuracy: Accuracy::UNKNOWN,
                    status: saddle.status,
                    iterations: saddle.iterations,
                    time: began.elapsed(),
                }));
                tried_before = history.len();
            }
            let mut record = MeshRecord {
                meshes: meshes.clone(),
                is_start: false,
                cost: program.cost,
                accuracy: Accuracy::UNKNOWN,
                status: program.status,
                iterations: program.iterations,
                time: began.elapsed(),
            };
            let mut phases =
                match (&failure, transcription.solution(&program.z, &program.constraint_multipliers)) {
                    (None, Ok(phases)) => phases,
                    (Some(_), _) => transcription.unevaluated(&program.z, &program.constraint_multipliers),
                    (None, Err(CollocationError::Evaluation(EvaluationError::Failed(source)))) => {
                        failure = Some(source);
                        transcription.unevaluated(&program.z, &program.constraint_multipliers)
                    }
                    (None, Err(error)) => return Err(error.into()),
                };
            if let Some(source) = failure {
                history.push(record);
                return ended(phases, history, program, source);
            }
            let rest = transcription.rest(&program.constraint_multipliers);
            let judged = judge(transcription, &program, &mut phases, token);
            let Judged { errors, optimal, accuracy, runs_away } = match judged {
                Ok(judged) => judged,
                Err(error) => {
                    history.push(record);
                    return ended_by(error, phases, history, program);
                }
            };
            record.accuracy = accuracy;
            record.time = began.elapsed();
            history.push(record);
            let size = program.cost.abs().max(1.0);
            let is_met = program.status.is_converged() && accuracy.meets(self.tolerance);
            let here = &history[tried_before..];
            let is_last = here.len() >= self.max_meshes || self.has_settled(here);
            // a finer mesh may help a program out, and has not
            let creeps = here.len() >= CREEPING
                && here.iter().rev().take(CREEPING).all(|mesh| mesh.status == Status::IterationLimit);
            let is_spent = *left == Some(0);
            let is_cut = token.is_cancelled();
            if is_cut || is_met || runs_away || is_last || creeps || is_spent || !is_usable(&program) {
                let ended = (is_spent && !is_met).then_some(Status::EvaluationLimit);
                let report = self.report(problem, phases, history, program, (runs_away, ended), token)?;
                return Ok(CollocationReport { origin: said, ..report });
            }
            let wishes = refinement::wishes(&errors, &optimal, size, self.tolerance);
            let finer = meshes.iter().zip(&wishes).map(|(mesh, wishes)| self.refined(mesh, wishes));
            // no finer mesh is left, or it would be too large
            let finer: Vec<Mesh> = match finer.collect::<Result<_, _>>() {
                Ok(finer) if finer != meshes => finer,
                _ => {
                    let report = self.report(problem, phases, history, program, (runs_away, None), token)?;
                    return Ok(CollocationReport { origin: said, ..report });
                }
            };
            meshes = finer;
            previous = Some((phases, rest));
        }
    }

    /// Leads the program of a first mesh away from saddles, in which one may end that is as symmetric as its start. Returned are the
    /// reports of those that were left, and what a function of the user failed with.
    fn leave_saddles(
        &self,
        transcription: &mut Transcription<'_>,
        program: &mut Report,
        on_iteration: &mut dyn FnMut(&Iteration<'_>) -> Flow,
        token: &CancellationToken,
        left: &mut Option<usize>,
    ) -> Result<(Vec<Report>, Option<Failure>), CollocationError> {
        let mut saddles = Vec::new();
        'saddles: while program.status.is_converged() && saddles.len() < MOST_SADDLES {
            let mut limited = Limited { nlp: &mut *transcription, left: &mut *left, token };
            // what cannot be evaluated there is said by what follows
            let Ok(Some(direction)) =
                negative_curvature(&mut limited, &program.z, &program.constraint_multipliers)
            else {
                break;
            };
            for distance in [AWAY, -AWAY] {
                let away = program.z.iter().zip(&direction).map(|(z, d)| z + distance * d);
                let start = away.collect::<Vec<_>>().into();
                let (found, failure) = self.solved(transcription, &start, on_iteration, token, left)?;
                if failure.is_some() || is_ended(found.status) {
                    program.status = found.status;
                    return Ok((saddles, failure));
                }
                let margin = LOWER * program.cost.abs().max(1.0);
                if found.status.is_converged() && found.cost < program.cost - margin {
                    saddles.push(std::mem::replace(program, found));
                    continue 'saddles;
                }
            }
            break;
        }
        Ok((saddles, None))
    }

    /// Whether finer meshes have ceased to help: what they leave are errors of the program.
    fn has_settled(&self, history: &[MeshRecord]) -> bool {
        let least = |records: &[MeshRecord]| {
            let excess = |record: &MeshRecord| record.accuracy.excess(self.tolerance);
            records.iter().map(excess).fold(f64::INFINITY, f64::min)
        };
        let Some(before) = history.len().checked_sub(PATIENCE) else { return false };
        least(&history[before..]) > WORTHWHILE * least(&history[..before])
    }

    fn refined(&self, mesh: &Mesh, wishes: &[refinement::Wish]) -> Result<Mesh, CollocationError> {
        refinement::refined(mesh, wishes, self.min_points, self.max_points)
    }

    fn report(
        &self,
        problem: &mut Problem,
        phases: Vec<PhaseSolution>,
        history: Vec<MeshRecord>,
        program: Report,
        (runs_away, ended): (bool, Option<Status>),
        token: &CancellationToken,
    ) -> Result<CollocationReport, SearchError> {
        let confirmation = match confirm_cancellable(problem, &phases, token) {
            Ok(confirmation) => confirmation,
            Err(error) => return ended_by(error, phases, history, program),
        };
        let is_met = history.last().is_some_and(|mesh| mesh.accuracy.meets(self.tolerance));
        let defect = confirmation.max_defect();
        let status = if !program.status.is_converged() {
            CollocationStatus::NotSolved(program.status)
        } else if token.is_cancelled() {
            let is_late = token.has_expired();
            CollocationStatus::NotSolved(if is_late { Status::TimeLimit } else { Status::Interrupted })
        } else if let Some(status) = ended {
            CollocationStatus::NotSolved(status)
        } else if runs_away {
            CollocationStatus::NoMinimum
        } else if defect > if is_met { self.tolerance } else { self.tolerance.max(NO_MOTION) } {
            CollocationStatus::FalseConvergence
        } else if !is_met {
            CollocationStatus::MeshLimit
        } else {
            CollocationStatus::Converged
        };
        let cost = program.cost;
        Ok(CollocationReport {
            status,
            phases,
            cost,
            confirmation,
            history,
            program,
            wrong_derivative: None,
            relative_errors: RelativeErrors::default(),
            origin: String::new(),
        })
    }

    /// Solves a program with what is left of the evaluations and of the time. Beside the report there is what a function of the user failed with.
    pub(super) fn solved(
        &self,
        transcription: &mut Transcription<'_>,
        start: &Start,
        on_iteration: &mut dyn FnMut(&Iteration<'_>) -> Flow,
        token: &CancellationToken,
        left: &mut Option<usize>,
    ) -> Result<(Report, Option<Failure>), CollocationError> {
        match self.solver.solve(&mut Limited { nlp: transcription, left, token }, start, on_iteration) {
            Ok(report) => Ok((report, None)),
            Err(SolverError::Failed { source, report }) => Ok((*report, Some(source))),
            Err(error) => Err(error.into()),
        }
    }

    fn check(&self) -> Result<(), CollocationError> {
        for (argument, found) in [
            ("tolerance", self.tolerance),
            ("max_meshes", self.max_meshes as f64),
            ("min_points", self.min_points as f64),
        ] {
            expect_positive(argument, found)?;
        }
        if self.min_points <= self.max_points && self.max_points <= MAX_POINTS {
            Ok(())
        } else {
            let (least, most) = (self.min_points, self.max_points);
            Err(CollocationError::PointRange { least, most })
        }
    }
}

/// What was found until a function failed, or what it may take was spent.
fn ended(
    phases: Vec<PhaseSolution>,
    history: Vec<MeshRecord>,
    program: Report,
    source: Failure,
) -> Result<CollocationReport, SearchError> {
    let spent = source.downcast_ref::<Exhausted>().map(|exhausted| exhausted.status());
    let report = CollocationReport {
        status: CollocationStatus::NotSolved(spent.unwrap_or(Status::Failed)),
        confirmation: Confirmation::unknown(&phases),
        phases,
        cost: program.cost,
        history,
        program,
        wrong_derivative: None,
        relative_errors: RelativeErrors::default(),
        origin: String::new(),
    };
    if spent.is_some() { Ok(report) } else { Err(SearchError::Failed { source, report: Box::new(report) }) }
}

/// The same of an error that may be that of a function.
fn ended_by(
    error: CollocationError,
    phases: Vec<PhaseSolution>,
    history: Vec<MeshRecord>,
    program: Report,
) -> Result<CollocationReport, SearchError> {
    match error {
        CollocationError::Evaluation(EvaluationError::Failed(source)) => {
            ended(phases, history, program, source)
        }
        error => Err(error.into()),
    }
}

/// Estimated errors of the solution of a program.
struct Judged {
    errors: Vec<Vec<refinement::IntervalError>>,
    optimal: Vec<Vec<IntervalOptimality>>,
    accuracy: Accuracy,
    runs_away: bool,
}

/// Unwinds and estimates; nothing is estimated once it is cancelled.
fn judge(
    mut transcription: Transcription<'_>,
    program: &Report,
    phases: &mut [PhaseSolution],
    token: &CancellationToken,
) -> Result<Judged, CollocationError> {
    let held: Vec<_> =
        (0..phases.len()).map(|k| transcription.state_multipliers(k, &program.bound_multipliers)).collect();
    let runs_away = program.status.is_converged()
        && transcription.time_runs_away(&program.z, &program.constraint_multipliers)?;
    let problem = transcription.problem;
    for (phase, solution) in problem.phases.iter_mut().zip(&mut *phases) {
        unwind(phase, solution)?;
    }
    let (mut errors, mut optimal) = (Vec::new(), Vec::new());
    let mut accuracy = Accuracy::UNKNOWN;
    if !token.is_cancelled() {
        for ((phase, solution), held) in problem.phases.iter_mut().zip(&*phases).zip(&held) {
            errors.push(refinement::errors(phase, solution)?);
            optimal.push(optimality(phase, solution, held)?);
        }
        accuracy = Accuracy::default();
        optimal.iter().flatten().for_each(|found| accuracy.include(&found.accuracy));
        accuracy.cost /= program.cost.abs().max(1.0);
        accuracy.equations = errors.iter().flatten().fold(0.0, |m: f64, e| m.max(e.relative));
    }
    Ok(Judged { errors, optimal, accuracy, runs_away })
}

/// Whether the search was stopped from outside, or must be.
pub(crate) fn is_ended(status: Status) -> bool {
    use Status::{EvaluationLimit, Failed, Interrupted, Stopped, TimeLimit};
    matches!(status, Stopped | Interrupted | Failed | TimeLimit | EvaluationLimit)
}

/// Whether another mesh may start from where this program ended.
fn is_usable(program: &Report) -> bool {
    match program.status {
        Status::Converged => true,
        Status::Stalled | Status::IterationLimit => program.residuals.feasibility <= USABLE,
        _ => false,
    }
}
