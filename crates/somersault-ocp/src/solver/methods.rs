//! Methods to solve a problem, and how one starts the next.

use super::spline_program::{STEPS, tree_of};
use super::splines::{SplineMotionReport, Splines};
use crate::arcs::{Polish, Polished, Verdict, is_hopeless};
use crate::collocation::{
    Accuracy, Collocation, CollocationError, CollocationReport, CollocationStatus, Confirmation, Guess,
    Interval, Mesh, MeshRecord, NO_MOTION, Origin, Phase, Problem, SearchError, USABLE, confirm_cancellable,
    is_ended,
};
use somersault_core::cancel::CancellationToken;
use somersault_nlp::{Flow, Iteration, Status};

/// Driven joints of a tree from which on splines come first.
const SEVERAL: usize = 3;
/// Points of collocation in each interval of the splines that it starts from: their motion is exact there.
const POINTS: usize = 5;
/// Halvings of the first splines before collocation starts from any, where all joints are driven and where some are integrated.
const COARSE_HALVINGS: [usize; 2] = [2, 1];
/// Steps on each mesh that collocation may take from splines; where it needs more, finer splines are a better start.
const BRIEF: usize = 150;
/// Tolerances of the collocation solutions that arcs are sought in, one after the other.
const COARSE: [f64; 2] = [1e-4, 1e-7];
/// A first mesh where none is given: intervals, and points of each.
const FIRST_MESH: (usize, usize) = (20, 3);

/// How a problem is solved.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
#[non_exhaustive]
pub enum SolutionMethod {
    /// By collocation, which starts from splines where these are likely to help.
    #[default]
    Auto,
    /// By splines, of joints or of controls.
    Shooting,
    /// By collocation, from the guess.
    Collocation,
    /// By collocation, and from its arcs by multiple shooting of states and costates.
    Indirect,
}

/// Solves a problem by one method, or by one after the other.
#[derive(Debug, Clone)]
pub struct Solver {
    /// Which.
    pub method: SolutionMethod,
    /// Splines; the tolerance is that of the collocation.
    pub splines: Splines,
    /// Collocation. Its evaluations are those of all programs together; equations of arcs may be evaluated as often again.
    pub collocation: Collocation,
}

impl Default for Solver {
    fn default() -> Self {
        Self {
            method: SolutionMethod::Auto,
            splines: Splines::default(),
            collocation: Collocation::default(),
        }
    }
}

/// What was found.
#[derive(Debug)]
pub struct SolverResult {
    /// The motion, with the verdict of the method that ended the search.
    pub report: CollocationReport,
    /// The extremal, where it was sought.
    pub polished: Option<Polished>,
}

/// Where a search starts, beside the guesses of the phases.
#[derive(Debug, Clone, Copy)]
pub enum StartFrom<'a> {
    /// There, on a mesh that the search chooses.
    Guess,
    /// There, on meshes that are given, one for each phase.
    Meshes(&'a [Mesh]),
    /// At the solution of a like problem.
    Solution(&'a CollocationReport),
}

/// What a search looks at, and what it may still evaluate.
struct Run<'a> {
    from: StartFrom<'a>,
    on_iteration: &'a mut dyn FnMut(&Iteration<'_>) -> Flow,
    token: &'a CancellationToken,
    left: Option<usize>,
}

impl Solver {
    /// Solves. `on_iteration` sees each step of each program, and ends the search by [`Flow::Stop`]; the token is looked at
    /// between programs and in what follows them.
    pub fn solve(
        &self,
        problem: &mut Problem,
        from: StartFrom<'_>,
        on_iteration: &mut dyn FnMut(&Iteration<'_>) -> Flow,
        token: &CancellationToken,
    ) -> Result<SolverResult, SearchError> {
        let mut run = Run { from, on_iteration, token, left: self.collocation.max_evaluations };
        match self.method {
            SolutionMethod::Collocation => {
                self.collocate(problem, &self.collocation, &mut run).map(SolverResult::of)
            }
            SolutionMethod::Auto => self.choose(problem, &self.collocation, &mut run).map(SolverResult::of),
            SolutionMethod::Shooting => self.shoot(problem, &mut run).map(SolverResult::of),
            SolutionMethod::Indirect => self.polish(problem, &mut run),
        }
    }

    fn collocate(
        &self,
        problem: &mut Problem,
        collocation: &Collocation,
        run: &mut Run<'_>,
    ) -> Result<CollocationReport, SearchError> {
        let (meshes, origin) = match run.from {
            StartFrom::Solution(solution) => (solution.meshes(), Origin::Solution(solution)),
            StartFrom::Meshes(meshes) => (meshes.to_vec(), Origin::Phases),
            StartFrom::Guess => {
                let mesh = Mesh::try_uniform(FIRST_MESH.0, FIRST_MESH.1)?;
                (vec![mesh; problem.n_phases()], Origin::Phases)
            }
        };
        collocation.solve_within(problem, &meshes, origin, run.on_iteration, run.token, &mut run.left)
    }

    /// Splines first where the phase is one of several driven joints and nothing says where to start.
    fn choose(
        &self,
        problem: &mut Problem,
        collocation: &Collocation,
        run: &mut Run<'_>,
    ) -> Result<CollocationReport, SearchError> {
        let has_start =
            matches!(run.from, StartFrom::Solution(_)) || problem.phases.iter().any(Phase::is_guessed);
        match &problem.phases[..] {
            [phase] if !has_start && is_chain(phase) => {}
            _ => return self.collocate(problem, collocation, run),
        }
        problem.expect_derivatives()?;
        let n_joints = problem.phases[0].n_controls();
        let began = format!(
            "With {n_joints} driven joints the search began with splines, whose motions have no defects"
        );
        let has_passive = 2 * n_joints < problem.phases[0].n_states();
        let coarse = COARSE_HALVINGS[usize::from(has_passive)];
        let splines = self.splines.for_a_start();
        let mut history = Vec::new();
        let mut guess: Option<Guess> = None;
        for halvings in 0..=splines.max_halvings {
            let n_intervals = splines.n_intervals << halvings;
            let found = splines.solve(
                problem,
                n_intervals,
                guess.as_ref(),
                POINTS,
                run.on_iteration,
                run.token,
                &mut run.left,
            );
            let found = match found {
                Ok(found) => found,
                // what has no value along splines may have one along straight lines
                Err(
                    CollocationError::NoSplines(_)
                    | CollocationError::Solver(_)
                    | CollocationError::Evaluation(_),
                ) => break,
                Err(error) => return Err(error.into()),
            };
            history.push(record_of(&found, Accuracy::UNKNOWN));
            if found.failure.is_some() || is_ended(found.program.status) || run.token.is_cancelled() {
                let report = ended(problem, found, run.token)?;
                return Ok(CollocationReport { history, ..report });
            }
            let cost = found.program.cost;
            guess = Some(found.solution.to_guess());
            // the first are too coarse for collocation
            if halvings < coarse || found.program.residuals.feasibility > USABLE {
                continue;
            }
            let report = self.resolved(problem, collocation, found, run)?;
            let is_over = match report.status {
                CollocationStatus::Converged => true,
                CollocationStatus::NotSolved(status) => is_ended(status),
                _ => run.token.is_cancelled(),
            };
            history.extend(report.history);
            if is_over {
                let origin = format!("{began}: collocation started from those of cost {cost:.6}.");
                return Ok(CollocationReport { history, origin, ..report });
            }
        }
        let report = self.collocate(problem, collocation, run)?;
        history.extend(report.history);
        let origin = format!("{began}. Collocation did not converge from these, and started from the guess.");
        Ok(CollocationReport { history, origin, ..report })
    }

    /// Collocation from splines, in a few steps on each mesh or not at all.
    fn resolved(
        &self,
        problem: &mut Problem,
        collocation: &Collocation,
        found: SplineMotionReport,
        run: &mut Run<'_>,
    ) -> Result<CollocationReport, SearchError> {
        let mesh = [found.solution.mesh().clone()];
        let meshes = if let StartFrom::Meshes(meshes) = run.from { meshes } else { &mesh };
        let mut brief = collocation.clone();
        brief.solver.max_iterations = brief.solver.max_iterations.min(BRIEF);
        let before = problem.phases[0].exchange_start(found.solution.to_guess())?;
        let report = brief.solve_once(problem, meshes, run.on_iteration, run.token, &mut run.left);
        problem.phases[0].restore_start(before);
        report
    }

    /// Splines alone, of intervals that are halved until the cost settles.
    fn shoot(&self, problem: &mut Problem, run: &mut Run<'_>) -> Result<CollocationReport, SearchError> {
        problem.expect_derivatives()?;
        let tolerance = self.collocation.tolerance;
        let mut guess = match run.from {
            StartFrom::Solution(solution) => solution.phases.first().map(|phase| phase.to_guess()),
            StartFrom::Guess | StartFrom::Meshes(_) => None,
        };
        let (mut history, mut previous) = (Vec::new(), None);
        let mut n_intervals = self.splines.n_intervals;
        loop {
            let found = self.splines.solve(
                problem,
                n_intervals,
                guess.as_ref(),
                STEPS + 1,
                run.on_iteration,
                run.token,
                &mut run.left,
            )?;
            let status = found.program.status;
            let is_over = found.failure.is_some() || is_ended(status) || run.token.is_cancelled();
            let is_last = history.len() >= self.splines.max_halvings;
            if is_over || !status.is_converged() && is_last {
                let mut report = ended(problem, found, run.token)?;
                history.append(&mut report.history);
                return Ok(CollocationReport { history, ..report });
            }
            if !status.is_converged() {
                // finer splines may help its program out
                history.push(record_of(&found, Accuracy::UNKNOWN));
                guess = Some(found.solution.to_guess());
                n_intervals *= 2;
                continue;
            }
            let confirmation =
                confirm_cancellable(problem, std::slice::from_ref(&found.solution), run.token)?;
            // that of the motion: a program has the errors of its quadrature
            let cost = confirmation.cost;
            let size = cost.abs().max(1.0);
            let change = previous.map_or(f64::INFINITY, |before: f64| (cost - before).abs());
            let accuracy = Accuracy {
                equations: confirmation.max_defect(),
                cost: (change + (cost - found.program.cost).abs()) / size,
                violation: confirmation.max_violation(),
                ..Accuracy::default()
            };
            history.push(record_of(&found, accuracy));
            let is_met = accuracy.meets(tolerance);
            if is_met || run.token.is_cancelled() || is_last {
                let status = if run.token.is_cancelled() {
                    CollocationStatus::NotSolved(cut(run.token))
                } else if accuracy.equations > NO_MOTION {
                    CollocationStatus::FalseConvergence
                } else if is_met {
                    CollocationStatus::Converged
                } else {
                    CollocationStatus::MeshLimit
                };
                let mut report = report_of(problem, found, status, confirmation);
                (report.history, report.cost) = (history, cost);
                return Ok(report);
            }
            previous = Some(cost);
            guess = Some(found.solution.to_guess());
            n_intervals *= 2;
        }
    }

    /// Collocation that is coarse, then finer where no arcs were found, and polish. Where no arcs can be found of any solution, there is
    /// one of collocation, to its own tolerance.
    fn polish(&self, problem: &mut Problem, run: &mut Run<'_>) -> Result<SolverResult, SearchError> {
        let mut found: Option<SolverResult> = None;
        let polish = Polish { max_evaluations: self.collocation.max_evaluations };
        let once = [self.collocation.tolerance];
        let tolerances = if is_hopeless(problem)? { &once[..] } else { &COARSE };
        for &tolerance in tolerances {
            let collocation = Collocation { tolerance, ..self.collocation.clone() };
            let report = match &found {
                None => self.choose(problem, &collocation, run)?,
                Some(SolverResult { report, .. }) => {
                    let (meshes, origin) = (report.meshes(), Origin::Solution(report));
                    collocation.solve_within(
                        problem,
                        &meshes,
                        origin,
                        run.on_iteration,
                        run.token,
                        &mut run.left,
                    )?
                }
            };
            let polished = polish.polish_cancellable(problem, &report, run.token)?;
            let is_refused = matches!(polished.verdict, Verdict::Refused { .. });
            let is_final = match report.status {
                CollocationStatus::NotSolved(status) => is_ended(status),
                _ => false,
            };
            let is_done = !is_refused || polished.is_lasting || is_final || run.token.is_cancelled();
            found = Some(SolverResult { report, polished: Some(polished) });
            if is_done {
                break;
            }
        }
        found.ok_or_else(|| CollocationError::NoPhase.into())
    }
}

impl AsRef<CollocationReport> for SolverResult {
    fn as_ref(&self) -> &CollocationReport {
        &self.report
    }
}

impl SolverResult {
    /// Whether the method that was chosen ended with a solution: an extremal that nothing speaks against, or a converged report.
    pub fn is_solution(&self) -> bool {
        match &self.polished {
            Some(polished) => polished.verdict.is_certified(),
            None => self.report.status == CollocationStatus::Converged,
        }
    }

    fn of(report: CollocationReport) -> Self {
        Self { report, polished: None }
    }
}

/// Whether a phase moves several driven joints over a duration that is given.
fn is_chain(phase: &Phase) -> bool {
    let has_duration =
        [&phase.bounds.initial_time, &phase.bounds.final_time].into_iter().all(Interval::is_fixed);
    has_duration && phase.n_controls() >= SEVERAL && tree_of(phase).is_some()
}

/// Why a token has cut a search.
fn cut(token: &CancellationToken) -> Status {
    if token.has_expired() { Status::TimeLimit } else { Status::Interrupted }
}

fn record_of(found: &SplineMotionReport, accuracy: Accuracy) -> MeshRecord {
    MeshRecord {
        meshes: vec![found.solution.mesh().clone()],
        is_start: accuracy == Accuracy::UNKNOWN,
        cost: found.program.cost,
        accuracy,
        status: found.program.status,
        iterations: found.program.iterations,
        time: found.time,
    }
}

fn report_of(
    problem: &Problem,
    found: SplineMotionReport,
    status: CollocationStatus,
    confirmation: Confirmation,
) -> CollocationReport {
    let what = if found.of_joints { "the joints" } else { "the controls" };
    CollocationReport {
        status,
        cost: found.program.cost,
        confirmation,
        history: vec![record_of(&found, Accuracy::UNKNOWN)],
        phases: vec![found.solution],
        program: found.program,
        wrong_derivative: None,
        relative_errors: problem.relative_errors(),
        origin: format!("The motion is one of splines of {what}, which has no costates."),
    }
}

/// The motion of splines whose program was not solved.
fn ended(
    problem: &mut Problem,
    mut found: SplineMotionReport,
    token: &CancellationToken,
) -> Result<CollocationReport, SearchError> {
    let failure = found.failure.take();
    let status = match found.program.status {
        _ if failure.is_some() => Status::Failed,
        status if status.is_converged() => cut(token),
        status => status,
    };
    let confirmation = Confirmation::unknown(std::slice::from_ref(&found.solution));
    let report = report_of(problem, found, CollocationStatus::NotSolved(status), confirmation);
    match failure {
        Some(source) => Err(SearchError::Failed { source, report: Box::new(report) }),
        None => Ok(report),
    }
}
