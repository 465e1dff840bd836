//! Extremals of a problem by way of collocation, whose states and costates are the nodes to start from.

use super::linearised::{cold_start_within, expect_horizon, fastest_rate};
use super::{DIRECT, Spent};
use crate::budget::Budget;
use crate::continuation::{Continuation, ContinuationResult, Stage};
use crate::shooting::{End, MultipleShooting, ShootingError, ShootingStatus};
use crate::system::{DifferentiatedProblem, PosedProblem, StateCostate, VectorField};
use nalgebra::DVector;
use somersault_core::argument::{ArgumentError, expect_length};
use somersault_core::cancel::{CancellationToken, Flow};
use somersault_nlp::Iteration;
use somersault_ocp::collocation::{Collocation, PhaseSolution, SearchError};
use somersault_ocp::solver::{SolutionMethod, Solver, StartFrom};

/// From state to state in a given time, where a state may also be free.
#[derive(Debug, Clone, Copy)]
pub struct ProblemTravel<'a> {
    /// The system of the problem.
    pub system: &'a StateCostate<PosedProblem>,
    /// States at the start, none where free.
    pub initial: &'a [Option<f64>],
    /// Those at the end.
    pub last: &'a [Option<f64>],
    /// Time to travel.
    pub horizon: f64,
}

/// Segments as parts of the time in which the fastest rate grows e-fold, tried in turn.
const SEGMENTS: [f64; 2] = [4.0, 1.0];

/// Fewest segments, and most.
const FEWEST: f64 = 10.0;
const MOST: f64 = 2e4;

impl ProblemTravel<'_> {
    /// Solves with the settings of `continuation`. What comes back has arrived if its `s` is one and its extremal has converged; its
    /// counts are of all attempts.
    ///
    /// Collocation comes first, from a straight line. Where shooting fails from what it found, and all states at the ends are given,
    /// [`cold_start`](super::cold_start()) follows. Each step of collocation counts as an evaluation of the field at each of its points.
    pub fn solve(&self, continuation: &Continuation) -> Result<ContinuationResult, ShootingError> {
        self.solve_as(continuation, self.system, &continuation.polish.limits.token())
    }

    /// The same with the system as `watched`, whose field is NaN from when it is to stop, and with a token for what does not evaluate it,
    /// as [`Limits::token`](crate::budget::Limits::token) makes one.
    pub fn solve_as<W: VectorField + Sync>(
        &self,
        continuation: &Continuation,
        watched: &W,
        token: &CancellationToken,
    ) -> Result<ContinuationResult, ShootingError> {
        continuation.polish.check_tolerance()?;
        expect_horizon(self.horizon)?;
        let [n, _] = self.system.problem().sizes();
        let ends = [end_of("initial", n, self.initial)?, end_of("last", n, self.last)?];
        let budget = continuation.polish.limits.start();
        let mut spent = Spent::default();
        let mut failed = None;
        let mut best: Option<ContinuationResult> = None;
        let max_iterations = continuation.polish.max_iterations.min(DIRECT);
        let shooting = MultipleShooting { max_iterations, ..continuation.polish };
        if let Some(solution) = self.collocated(&budget, token) {
            for part in SEGMENTS {
                let times = times_of(&solution, watched, part);
                let nodes: Vec<_> = times.iter().map(|&t| point(&solution, t)).collect();
                match shooting.solve_within(&budget, watched, &ends, &times, &nodes) {
                    Ok(extremal) => {
                        spent.iterations += extremal.iterations;
                        spent.work += extremal.work;
                        best = Some(ContinuationResult::of_one(extremal, Stage::Collocation, &budget));
                    }
                    Err(error) => failed = Some(error),
                }
                if best.as_ref().is_some_and(is_final) || is_over(&budget, token) {
                    break;
                }
                spent.failures += 1;
            }
        }
        let all = |end: &[Option<f64>]| end.iter().copied().collect::<Option<Vec<f64>>>();
        if !best.as_ref().is_some_and(is_final)
            && !is_over(&budget, token)
            && let (Some(initial), Some(last)) = (all(self.initial), all(self.last))
        {
            match cold_start_within(&budget, watched, &initial, &last, self.horizon, continuation) {
                Ok(found) if found.arrived() || best.is_none() => best = Some(found),
                Ok(found) => {
                    spent.failures += found.steps[1];
                    spent.iterations += found.iterations;
                    spent.work += found.work;
                }
                Err(error) => failed = failed.or(Some(error)),
            }
        }
        let Some(mut found) = best else {
            return Err(failed.unwrap_or(ShootingError::NoMotion));
        };
        found.steps[1] += spent.failures;
        found.iterations += spent.iterations;
        found.work += spent.work;
        Ok(found)
    }

    /// The motion that collocation ended with, be it no solution; none without costates.
    fn collocated(&self, budget: &Budget, token: &CancellationToken) -> Option<PhaseSolution> {
        let problem = self.system.problem();
        let mut posed = problem.between([self.initial, self.last], self.horizon).ok()?;
        let mut collocation = Collocation::default();
        collocation.solver.max_time = budget.time_left();
        let solver = Solver { method: SolutionMethod::Collocation, collocation, ..Solver::default() };
        let width: usize = problem.sizes().iter().sum();
        let mut flow = |iteration: &Iteration<'_>| {
            budget.spend(iteration.z.len() / width);
            if is_over(budget, token) { Flow::Stop } else { Flow::Continue }
        };
        let report = match solver.solve(&mut posed, StartFrom::Guess, &mut flow, token) {
            Ok(found) => found.report,
            Err(SearchError::Failed { report, .. }) => *report,
            Err(SearchError::Collocation(_)) => return None,
        };
        let solution = report.phases.into_iter().next()?;
        let is_known = |rows: &[Vec<f64>]| rows.iter().flatten().all(|x| x.is_finite());
        (is_known(&solution.states) && is_known(&solution.costates)).then_some(solution)
    }
}

fn is_final(found: &ContinuationResult) -> bool {
    // at a floor no other way leads lower
    matches!(found.extremal.status, ShootingStatus::Converged | ShootingStatus::Floor)
}

fn is_over(budget: &Budget, token: &CancellationToken) -> bool {
    token.is_cancelled() || budget.reached().is_some()
}

/// The conditions at one end.
fn end_of(argument: &'static str, n: usize, states: &[Option<f64>]) -> Result<End, ShootingError> {
    expect_length(argument, states.len(), n)?;
    if let Some(&found) = states.iter().flatten().find(|x| !x.is_finite()) {
        return Err(ArgumentError::OutOfRange { argument, allowed: "finite", found }.into());
    }
    let end = End::from_values(states.iter().map(|x| x.unwrap_or(0.0)));
    states.iter().enumerate().filter(|(_, x)| x.is_none()).try_fold(end, |end, (i, _)| end.with_free(i))
}

/// (x, λ) of a motion.
fn point(solution: &PhaseSolution, t: f64) -> DVector<f64> {
    DVector::from_vec([solution.state(t), solution.costate(t)].concat())
}

/// Times between which the fastest rates of a motion grow by the same: e-fold `part` times.
fn times_of<S: VectorField>(solution: &PhaseSolution, system: &S, part: f64) -> Vec<f64> {
    let (start, end) = solution.horizon();
    let least = FEWEST * part / (end - start);
    let mut growth = vec![0.0];
    for pair in solution.times.windows(2) {
        let rate = fastest_rate(system, &point(solution, pair[0]));
        let rate = if rate.is_finite() { rate.max(least) } else { least };
        growth.push(growth[growth.len() - 1] + rate * (pair[1] - pair[0]));
    }
    let last = growth.len() - 1;
    let segments = (growth[last] / part).ceil().min(MOST);
    let mut times: Vec<f64> = (0..segments as usize)
        .map(|k| {
            let wanted = growth[last] * k as f64 / segments;
            let i = growth.partition_point(|g| *g <= wanted).clamp(1, last) - 1;
            let fraction = (wanted - growth[i]) / (growth[i + 1] - growth[i]);
            solution.times[i] + fraction * (solution.times[i + 1] - solution.times[i])
        })
        .collect();
    times.push(end);
    times
}
