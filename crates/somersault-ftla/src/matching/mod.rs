//! Matching a motion from the start with one from the end on the centre manifold (thesis 10.2).
//!
//! The held costates at both ends are the unknowns. Each choice is placed on the centre-stable manifold at t₀ and on the
//! centre-unstable one at t_f, and followed to t_m with midcourse corrections, that is placed again at given times. The
//! mismatch is ‖p⁺(t_m) − p⁻(t_m)‖ (9.12).
//!
//! * [`GridSearch`]: appendix G, a grid of three values of each unknown at each end, all pairs compared.
//! * [`LeastSquares`]: Gauss–Newton on p⁺ − p⁻ and H⁺ − H⁻, in which costates that are conserved are one unknown for
//!   both ends.
//!
//! Both are parallel over points. What they find carries the error of the finite averaging time, e^(−gap·T); the nodes of
//! [`MatchingResult::nodes`] are a guess from which [`MultipleShooting`](crate::shooting::MultipleShooting) goes to rounding.

mod grid;
mod least_squares;

pub use grid::GridSearch;
pub use least_squares::LeastSquares;

use crate::budget::Budget;
use crate::flow::{FlowError, VariationalFlow};
use crate::placement::{Placement, PlacementStatus};
use crate::spectrum::TimeDirection;
use crate::system::HamiltonianSystem;
use nalgebra::DVector;
use somersault_core::argument::ArgumentError;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Why a search cannot begin.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum MatchingError {
    /// An argument that is not allowed.
    #[error(transparent)]
    Argument(#[from] ArgumentError),
    /// A placement is of the wrong direction in time.
    #[error("the first placement must be forward and the second backward")]
    Directions,
}

/// How a search ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum MatchStatus {
    /// The mismatch is below the tolerance.
    Matched,
    /// Grid spacing or steps have become too small to continue.
    Exhausted,
    /// The rounds are used up.
    MaxRounds,
    /// No point of the first grid, or not the first guess, could be placed and followed.
    NoStart,
    /// A limit of time or evaluations is reached.
    LimitReached,
}

/// What is to be matched: end states, horizon, and how ends are placed and followed.
#[derive(Debug, Clone)]
pub struct Matching<'a, S> {
    flow: VariationalFlow<'a, S>,
    ends: [DVector<f64>; 2],
    horizon: f64,
    match_time: f64,
    placements: [Placement; 2],
    corrections: [Vec<f64>; 2],
}

/// One end followed to t_m.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Branch {
    /// The placed end.
    pub(crate) end: DVector<f64>,
    /// Times and points of the end and after each correction, from the end to t_m.
    pub(crate) course: Vec<(f64, DVector<f64>)>,
    /// p(t_m).
    pub(crate) meeting: DVector<f64>,
}

/// A pair of ends whose motions nearly meet.
#[derive(Debug, Clone, PartialEq)]
pub struct MatchingResult {
    /// How the search ended.
    pub status: MatchStatus,
    /// Placed ends, at t₀ and t_f; the best pair found.
    pub ends: [DVector<f64>; 2],
    /// p⁺(t_m) and p⁻(t_m).
    pub meeting: [DVector<f64>; 2],
    /// ‖p⁺(t_m) − p⁻(t_m)‖.
    pub mismatch: f64,
    /// Rounds of the search.
    pub rounds: usize,
    /// Ends placed and followed.
    pub branches: usize,
    /// Spectra and segments computed for them.
    pub flow_evaluations: usize,
    /// Times and points of each end and after each of its corrections, from the end to t_m; empty without a start.
    pub courses: [Vec<(f64, DVector<f64>)>; 2],
}

impl<'a, S: HamiltonianSystem> Matching<'a, S> {
    /// From state `initial` at 0 to `last` at `horizon`, met in the middle; `placements` are for the two ends and must hold
    /// the same costates. The costates of `guess` at both ends start the placements.
    pub fn try_new(
        flow: VariationalFlow<'a, S>,
        states: [&[f64]; 2],
        guess: [&[f64]; 2],
        horizon: f64,
        placements: [Placement; 2],
    ) -> Result<Self, MatchingError> {
        let n = flow.system().dimension() / 2;
        for (argument, given) in [("states", states), ("guess", guess)] {
            for part in given {
                if part.len() != n {
                    return Err(ArgumentError::Length { argument, expected: n, found: part.len() }.into());
                }
                if let Some(&found) = part.iter().find(|x| !x.is_finite()) {
                    return Err(ArgumentError::OutOfRange { argument, allowed: "finite", found }.into());
                }
            }
        }
        if !horizon.is_finite() || horizon <= 0.0 {
            let allowed = "positive and finite";
            return Err(ArgumentError::OutOfRange { argument: "horizon", allowed, found: horizon }.into());
        }
        let directions = placements.each_ref().map(Placement::direction);
        if directions != [TimeDirection::Forward, TimeDirection::Backward] {
            return Err(MatchingError::Directions);
        }
        if placements[0].held() != placements[1].held() {
            let (expected, found) = (placements[0].held().len(), placements[1].held().len());
            return Err(ArgumentError::Length { argument: "held", expected, found }.into());
        }
        let end = |k: usize| DVector::from_iterator(2 * n, states[k].iter().chain(guess[k]).copied());
        Ok(Self {
            flow,
            ends: [end(0), end(1)],
            horizon,
            match_time: 0.5 * horizon,
            placements,
            corrections: [Vec::new(), Vec::new()],
        })
    }

    /// Meets at `match_time`, and corrects at the given times, ascending, before and after it.
    pub fn try_with_course(self, match_time: f64, corrections: &[f64]) -> Result<Self, MatchingError> {
        if match_time.is_nan() || match_time <= 0.0 || match_time >= self.horizon {
            let allowed = "inside the horizon";
            return Err(
                ArgumentError::OutOfRange { argument: "match_time", allowed, found: match_time }.into()
            );
        }
        let mut before = 0.0;
        for &found in corrections {
            if found.is_nan() || found <= before || found >= self.horizon {
                let allowed = "ascending, inside the horizon";
                return Err(ArgumentError::OutOfRange { argument: "corrections", allowed, found }.into());
            }
            before = found;
        }
        let (early, late): (Vec<f64>, Vec<f64>) = corrections.iter().partition(|t| **t < match_time);
        Ok(Self { match_time, corrections: [early, late.into_iter().rev().collect()], ..self })
    }

    /// The same within the limits of a search.
    fn within<'b>(&self, budget: &'b Budget) -> Matching<'b, S>
    where
        'a: 'b,
    {
        Matching {
            flow: self.flow.clone().within(budget),
            ends: self.ends.clone(),
            horizon: self.horizon,
            match_time: self.match_time,
            placements: self.placements.clone(),
            corrections: self.corrections.clone(),
        }
    }

    /// A search must have a round at least, and a tolerance.
    fn check_search(tolerance: f64, max_rounds: usize) -> Result<(), MatchingError> {
        if !tolerance.is_finite() || tolerance <= 0.0 {
            let allowed = "positive and finite";
            return Err(ArgumentError::OutOfRange { argument: "tolerance", allowed, found: tolerance }.into());
        }
        if max_rounds == 0 {
            return Err(ArgumentError::OutOfRange {
                argument: "max_rounds",
                allowed: "positive",
                found: 0.0,
            }
            .into());
        }
        Ok(())
    }

    fn held(&self) -> &[usize] {
        self.placements[0].held()
    }

    /// Places one end (0 or 1) with the costates `held`, starting from the costates of `near`, and follows it to t_m.
    fn branch(
        &self,
        which: usize,
        held: &[f64],
        near: &DVector<f64>,
        evaluations: &AtomicUsize,
    ) -> Result<Branch, PlacementStatus> {
        let mut p = near.clone();
        let n = p.len() / 2;
        self.held().iter().zip(held).for_each(|(&i, &value)| p[n + i] = value);
        let placement = &self.placements[which];
        let place = |p: &DVector<f64>| {
            // near a placed point the last averaging time alone will do
            for attempt in [&placement.without_schedule(), placement] {
                let placed = attempt.place(&self.flow, p);
                evaluations.fetch_add(placed.flow_evaluations, Ordering::Relaxed);
                if placed.status == PlacementStatus::Placed {
                    return Ok(placed.p);
                }
                if attempt == placement {
                    return Err(placed.status);
                }
            }
            Err(PlacementStatus::Stalled)
        };
        let follow = |p: &DVector<f64>, duration: f64| {
            evaluations.fetch_add(1, Ordering::Relaxed);
            self.flow.state(p, duration).map_err(PlacementStatus::Flow)
        };
        let mut t = if which == 0 { 0.0 } else { self.horizon };
        p = place(&p)?;
        let end = p.clone();
        let mut course = vec![(t, p.clone())];
        for &time in &self.corrections[which] {
            p = place(&follow(&p, time - t)?)?;
            t = time;
            course.push((t, p.clone()));
        }
        let meeting = follow(&p, self.match_time - t)?;
        Ok(Branch { end, course, meeting })
    }

    /// The motion of two courses at `times`, as [`MatchingResult::nodes`] has it.
    pub fn nodes(
        &self,
        courses: &[Vec<(f64, DVector<f64>)>; 2],
        times: &[f64],
    ) -> Result<Vec<DVector<f64>>, FlowError> {
        let at = |&t: &f64| {
            let late = t > self.match_time;
            let course = courses[usize::from(late)].iter().rev();
            let reached = course.into_iter().find(|(from, _)| if late { *from >= t } else { *from <= t });
            let (argument, allowed) = ("times", "within the horizon of a match that has a motion");
            let (from, p) = reached.ok_or(FlowError::Argument(ArgumentError::OutOfRange {
                argument,
                allowed,
                found: t,
            }))?;
            self.flow.state(p, t - from)
        };
        times.iter().map(at).collect()
    }

    fn report(&self, branches: [&Branch; 2], status: MatchStatus, counts: Counts) -> MatchingResult {
        let meeting = branches.map(|branch| branch.meeting.clone());
        MatchingResult {
            status,
            ends: branches.map(|branch| branch.end.clone()),
            mismatch: (&meeting[0] - &meeting[1]).norm(),
            meeting,
            rounds: counts.rounds,
            branches: counts.branches,
            flow_evaluations: counts.evaluations.load(Ordering::Relaxed),
            courses: branches.map(|branch| branch.course.clone()),
        }
    }

    fn unmatched(&self, status: MatchStatus, counts: Counts) -> MatchingResult {
        MatchingResult {
            status,
            ends: self.ends.clone(),
            meeting: self.ends.each_ref().map(|p| DVector::repeat(p.len(), f64::NAN)),
            mismatch: f64::INFINITY,
            rounds: counts.rounds,
            branches: counts.branches,
            flow_evaluations: counts.evaluations.load(Ordering::Relaxed),
            courses: [Vec::new(), Vec::new()],
        }
    }
}

#[derive(Debug, Default)]
struct Counts {
    rounds: usize,
    branches: usize,
    evaluations: AtomicUsize,
}

impl MatchingResult {
    /// The matched motion at `times`, a guess for shooting: forward from the start up to the corrections, backward from the
    /// end.
    pub fn nodes<S: HamiltonianSystem>(
        &self,
        matching: &Matching<'_, S>,
        times: &[f64],
    ) -> Result<Vec<DVector<f64>>, FlowError> {
        matching.nodes(&self.courses, times)
    }
}
