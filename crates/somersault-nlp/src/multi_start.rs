//! Many starts, in parallel, and the distinct minima they lead to.

use crate::best::{merit, penalty};
use crate::error::SolverError;
use crate::nlp::{Bounds, Nlp};
use crate::program::{check_bounds, check_positive, check_vector};
use crate::report::{Report, Start, Status};
use crate::solver::NlpSolver;
use rayon::prelude::*;
use somersault_core::cancel::Flow;
use somersault_core::random::SplitMix64;

/// Violation up to which unfinished solves are compared by their costs alone.
const FEASIBLE: f64 = 1e-6;

/// Solves from many starts.
///
/// Each start gets a program of its own, so that nothing carries over and the answer is the same for any number of
/// threads. They are those of the current rayon pool.
#[derive(Debug, Clone, PartialEq)]
pub struct MultiStart<S> {
    /// What solves from one start.
    pub solver: S,
    /// Two minima are the same if max |zᵢ − z′ᵢ| / max(1, |zᵢ|, |z′ᵢ|) is at most this.
    pub distance_tol: f64,
}

/// A minimum, with all starts that led to it.
#[derive(Debug, Clone, PartialEq)]
pub struct Minimum {
    /// The solve of lowest cost.
    pub report: Report,
    /// Indices of the starts, ascending.
    pub starts: Vec<usize>,
}

/// A start that led to no minimum.
#[derive(Debug)]
pub struct Failure {
    /// Index of the start.
    pub start: usize,
    /// Its result.
    pub cause: FailureCause,
}

/// Why a start led to no minimum.
#[derive(Debug)]
pub enum FailureCause {
    /// The status is another than converged; [`Status::Interrupted`] where all were asked to stop.
    Ended(Report),
    /// A function of the user failed, or the start is no start of this program.
    Error(SolverError),
    /// The solve had not begun when all were asked to stop.
    Skipped,
}

/// The results of all starts.
#[derive(Debug)]
pub struct MultiStartReport {
    /// Distinct minima, lowest cost first.
    pub minima: Vec<Minimum>,
    /// All other starts, by index.
    pub failures: Vec<Failure>,
}

impl MultiStartReport {
    /// Whether all starts were asked to stop before each had ended.
    pub fn is_interrupted(&self) -> bool {
        self.failures.iter().any(|failure| match &failure.cause {
            FailureCause::Ended(report) => report.status == Status::Interrupted,
            FailureCause::Error(_) => false,
            FailureCause::Skipped => true,
        })
    }

    /// Solves that ended without a minimum, best first by [`ranked`].
    pub fn unfinished(&self) -> Vec<&Report> {
        let ended = self.failures.iter().filter_map(|failure| match &failure.cause {
            FailureCause::Ended(report) => Some(report),
            FailureCause::Error(_) | FailureCause::Skipped => None,
        });
        let ended: Vec<&Report> = ended.collect();
        ranked(&ended).into_iter().map(|k| ended[k]).collect()
    }
}

/// The order of solves of one program by merit, best first: f + ρ · violation, where ρ is the middle one of their Σ |y|. One that is
/// feasible is not better for that alone, since a start that no step has left may be. NaN comes last.
pub fn ranked(reports: &[&Report]) -> Vec<usize> {
    let mut penalties: Vec<f64> =
        reports.iter().map(|report| penalty(&report.constraint_multipliers)).collect();
    penalties.sort_by(f64::total_cmp);
    let middle = penalties.get(penalties.len() / 2).copied().unwrap_or(1.0);
    let of = |report: &&Report| merit(report.cost, &report.residuals, middle, FEASIBLE);
    // a NaN may be negative, and would come first
    let merits: Vec<f64> =
        reports.iter().map(of).map(|merit| if merit.is_nan() { f64::INFINITY } else { merit }).collect();
    let mut order: Vec<usize> = (0..reports.len()).collect();
    order.sort_by(|&a, &b| merits[a].total_cmp(&merits[b]));
    order
}

impl<S> MultiStart<S> {
    /// With minima apart by 10⁻⁴.
    pub fn new(solver: S) -> Self {
        Self { solver, distance_tol: 1e-4 }
    }
}

impl<S: NlpSolver + Sync> MultiStart<S> {
    /// Solves from all starts. `make` makes the program; `stop` is asked before each start and after each step of
    /// every solve, from any thread.
    pub fn solve<N: Nlp>(
        &self,
        make: impl Fn() -> N + Sync,
        starts: &[Start],
        stop: impl Fn() -> bool + Sync,
    ) -> Result<MultiStartReport, SolverError> {
        self.try_solve(|| Ok(make()), starts, stop)
    }

    /// The same with programs that need not come into being: an error of `make` ends the search.
    pub fn try_solve<N: Nlp, E: From<SolverError> + Send>(
        &self,
        make: impl Fn() -> Result<N, E> + Sync,
        starts: &[Start],
        stop: impl Fn() -> bool + Sync,
    ) -> Result<MultiStartReport, E> {
        check_positive("distance_tol", self.distance_tol)?;
        let solve = |start: &Start| {
            if stop() {
                return Ok(None);
            }
            let outcome = self.solver.solve(&mut make()?, start, &mut |_| {
                if stop() { Flow::Stop } else { Flow::Continue }
            });
            Ok::<_, E>(Some(outcome.map(Report::interrupted)))
        };
        // One start to a job: some take a hundred times as long as others.
        let outcomes = starts.par_iter().with_max_len(1).map(solve).collect::<Result<Vec<_>, E>>()?;

        let mut converged = Vec::new();
        let mut failures = Vec::new();
        for (start, outcome) in outcomes.into_iter().enumerate() {
            let cause = match outcome {
                Some(Ok(report)) if report.status.is_converged() => {
                    converged.push((start, report));
                    continue;
                }
                Some(Ok(report)) => FailureCause::Ended(report),
                Some(Err(error)) => FailureCause::Error(error),
                None => FailureCause::Skipped,
            };
            failures.push(Failure { start, cause });
        }
        converged.sort_by(|(_, a), (_, b)| a.cost.total_cmp(&b.cost));
        let mut minima: Vec<Minimum> = Vec::new();
        for (start, report) in converged {
            match minima.iter_mut().find(|m| distance(&m.report.z, &report.z) <= self.distance_tol) {
                Some(minimum) => minimum.starts.push(start),
                None => minima.push(Minimum { report, starts: vec![start] }),
            }
        }
        for minimum in &mut minima {
            minimum.starts.sort_unstable();
        }
        Ok(MultiStartReport { minima, failures })
    }
}

fn distance(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).fold(0.0, |d: f64, (a, b)| d.max((a - b).abs() / a.abs().max(b.abs()).max(1.0)))
}

/// A Latin hypercube: `count` starts of which each coordinate visits each of `count` equal parts of its range once,
/// the same for the same seed.
pub fn samples(range: &Bounds, count: usize, seed: u64) -> Result<Vec<Start>, SolverError> {
    check_bounds("range", range)?;
    check_vector("range.lower", &range.lower, range.len())?;
    check_vector("range.upper", &range.upper, range.len())?;
    let ends: Vec<_> = range.lower.iter().copied().zip(range.upper.iter().copied()).collect();
    Ok(latin_hypercube(&ends, count, seed).into_iter().map(Start::from).collect())
}

/// The points of [`samples`] in the box of the given ends, which are finite.
pub fn latin_hypercube(ends: &[(f64, f64)], count: usize, seed: u64) -> Vec<Vec<f64>> {
    let mut random = SplitMix64::new(seed);
    let mut points = vec![vec![0.0; ends.len()]; count];
    let mut parts: Vec<usize> = (0..count).collect();
    for (i, (lower, upper)) in ends.iter().enumerate() {
        for last in (1..count).rev() {
            parts.swap(last, (random.unit() * (last + 1) as f64) as usize);
        }
        let width = (upper - lower) / count as f64;
        for (point, &part) in points.iter_mut().zip(&parts) {
            point[i] = (lower + (part as f64 + random.unit()) * width).min(*upper);
        }
    }
    points
}
