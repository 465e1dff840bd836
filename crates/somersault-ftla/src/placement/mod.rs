//! Placing a point on the centre-stable or centre-unstable manifold by its costates (thesis 10.1).
//!
//! Forward in time a point p = (x, λ) should satisfy h(p) ∈ E^cs(T, p), backward h(p) ∈ E^cu(T, p), (9.10) and (9.11).
//! With W an orthonormal basis of the complement, that is of the directions that expand fast in that direction of time,
//!
//! ```text
//! Wᵀ(p) h(p) = 0,   tested as asin(‖Wᵀh‖/‖h‖) ≤ θ̄,
//! ```
//! is as many equations as there are such directions; as many costates are solved for, the others and x are held.
//!
//! * [`Method::FixedPoint`]: algorithms 1 and 2. W is held while Wᵀh = 0 is solved, and recomputed. Converges linearly.
//! * [`Method::Newton`]: the residual is ŴᵀP(p)h(p), P = WWᵀ the projector and Ŵ the basis at the last point, which is
//!   smooth where W alone may turn. Its Jacobian has the change of the basis, by differences of P and Broyden's corrections of
//!   them; steps are shortened until the angle falls. Converges superlinearly, but only from near: further off than 0.01 rad, and after a stall until the
//!   angle is a tenth of what it was, steps are taken with the basis held.
//!
//! Long averaging times give better subspaces, but from a point off the manifold the motion leaves before they are over:
//! algorithms 3 and 4 place for a [`Schedule`] of growing times. Here a time at which placing fails is approached in
//! smaller steps before giving up, and where the first one fails the schedule begins with a half of it, a quarter and so on.
//!
//! # Deviations
//! Algorithms 1 and 2 are one, with a [`TimeDirection`]. The complements printed in their lines 3 and 8 contradict each
//! other, and the angle they test is 90° at success; the last averaging time is T_max; every loop has an exit.

mod following;
mod search;

pub use following::Following;

use crate::flow::{FlowError, VariationalFlow};
use crate::spectrum::{Diagnosis, Spectrum, SplittingDims, Subspace, TimeDirection};
use crate::system::VectorField;
use nalgebra::{DMatrix, DVector};
use search::Search;
use somersault_core::argument::ArgumentError;

/// Why a placement cannot begin.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum PlacementError {
    /// An argument that is not allowed.
    #[error(transparent)]
    Argument(#[from] ArgumentError),
    /// The numbers of held costates and of fast directions do not add up to n.
    #[error("{held} costates held and {fast} fast directions must add up to {expected}")]
    Held {
        /// Costates held.
        held: usize,
        /// Directions that expand fast.
        fast: usize,
        /// n.
        expected: usize,
    },
    /// There are too many choices of costates to rank.
    #[error("{solved} of {costates} costates to be solved for can be chosen in more than {allowed} ways")]
    Choices {
        /// n.
        costates: usize,
        /// Costates solved for.
        solved: usize,
        /// The most that are ranked.
        allowed: usize,
    },
    /// Dimensions do not add up.
    #[error(transparent)]
    Dimensions(#[from] crate::spectrum::SpectrumError),
}

/// How Wᵀh = 0 is solved.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Method {
    /// With the basis held, then recomputed (algorithms 1 and 2).
    FixedPoint,
    /// With the change of the basis in the Jacobian, damped.
    Newton,
}

/// Averaging times, ascending.
#[derive(Debug, Clone, PartialEq)]
pub struct Schedule(Vec<f64>);

impl Schedule {
    /// Explicit times, positive and ascending.
    pub fn try_times(times: Vec<f64>) -> Result<Self, PlacementError> {
        let allowed = "positive, finite and ascending";
        let mut before = 0.0;
        for &found in &times {
            if !found.is_finite() || found <= before {
                return Err(ArgumentError::OutOfRange { argument: "times", allowed, found }.into());
            }
            before = found;
        }
        if times.is_empty() {
            return Err(ArgumentError::OutOfRange { argument: "times", allowed, found: 0.0 }.into());
        }
        Ok(Self(times))
    }

    /// `first`, `first` + `step`, … and `last` itself.
    pub fn try_steps(first: f64, step: f64, last: f64) -> Result<Self, PlacementError> {
        if step.is_nan() || step <= 0.0 {
            return Err(
                ArgumentError::OutOfRange { argument: "step", allowed: "positive", found: step }.into()
            );
        }
        if last.is_nan() || last < first {
            return Err(ArgumentError::OutOfRange {
                argument: "last",
                allowed: "not before the first",
                found: last,
            }
            .into());
        }
        // a last step of less than a hundredth is one with the step before
        let count = ((last - first) / step - 0.01).ceil().max(0.0) as usize;
        if count > 100_000 {
            return Err(ArgumentError::OutOfRange {
                argument: "step",
                allowed: "at least 1e-5 of the range",
                found: step,
            }
            .into());
        }
        Self::try_times((0..count).map(|k| first + step * k as f64).chain([last]).collect())
    }

    /// From the spectrum: steps of 0.7 time constants of the slowest fast rate, to eight constants of the gap.
    ///
    /// For the thesis' arm these are steps of a quarter of a second up to 3.5 s.
    pub fn of_diagnosis(diagnosis: &Diagnosis) -> Result<Self, PlacementError> {
        let rate = diagnosis.fast_rates[0].min(diagnosis.fast_rates[1]);
        if rate.is_nan() || rate <= 0.0 {
            let allowed = "positive: there must be fast directions";
            return Err(ArgumentError::OutOfRange { argument: "fast_rates", allowed, found: rate }.into());
        }
        let last = 8.0 / diagnosis.gaps[0].min(diagnosis.gaps[1]);
        Self::try_steps(0.7 / rate, 0.7 / rate, last.max(0.7 / rate))
    }

    /// The times.
    pub fn times(&self) -> &[f64] {
        &self.0
    }
}

/// What to place on and how.
#[derive(Debug, Clone, PartialEq)]
pub struct Placement {
    direction: TimeDirection,
    dims: SplittingDims,
    held: Vec<usize>,
    schedule: Schedule,
    /// How the condition is solved.
    pub method: Method,
    /// θ̄, rad.
    pub tolerance: f64,
    /// Iterations for one averaging time.
    pub max_iterations: usize,
    /// Whether times at which placing fails are approached in smaller steps.
    adapts: bool,
}

/// How a placement ended.
#[derive(Debug, Clone, PartialEq)]
pub enum PlacementStatus {
    /// The angle is within the tolerance at the last averaging time.
    Placed,
    /// No step lowers the angle: the point is out of reach of this averaging time.
    Stalled,
    /// The iterations for one averaging time are used up.
    MaxIterations,
    /// The costates solved for do not move the field along the fast directions: hold others.
    SingularCostates,
    /// The motion from the point cannot be followed for the averaging time.
    Flow(FlowError),
}

impl PlacementStatus {
    /// Whether a limit of the search that it is part of was reached: nothing more can be tried.
    fn reached_limit(&self) -> bool {
        matches!(self, Self::Flow(FlowError::LimitReached { .. }))
    }
}

/// A placed point, or the best one found.
#[derive(Debug, Clone, PartialEq)]
pub struct PlacementResult {
    /// The point at the last averaging time that was placed, or where that failed first.
    pub p: DVector<f64>,
    /// How it ended; on failure at the first averaging time not reached.
    pub status: PlacementStatus,
    /// Angle between h and the slow subspace, rad.
    pub angle: f64,
    /// Averaging time of point and angle.
    pub time: f64,
    /// The spectrum there, if the motion could be followed.
    pub spectrum: Option<Spectrum>,
    /// Iterations over all averaging times.
    pub iterations: usize,
    /// Spectra computed.
    pub flow_evaluations: usize,
}

/// Halvings of the way to the next averaging time, counted from the last one that was placed, or from zero.
const HALVINGS: usize = 6;

impl Placement {
    /// For points of `dimension` = 2n numbers, the sum of `dims`. `held` are the numbers, from 0, of the costates that are
    /// held; with the fast directions they must add up to n.
    ///
    /// By default Newton's method to 1e-8 rad in at most 30 iterations for each averaging time.
    pub fn try_new(
        dimension: usize,
        direction: TimeDirection,
        dims: SplittingDims,
        held: &[usize],
        schedule: Schedule,
    ) -> Result<Self, PlacementError> {
        dims.check(dimension)?;
        if !dimension.is_multiple_of(2) {
            let (allowed, found) = ("even in all: as many costates as states", dimension as f64);
            return Err(ArgumentError::OutOfRange { argument: "dims", allowed, found }.into());
        }
        let n = dimension / 2;
        for (i, &h) in held.iter().enumerate() {
            if h >= n || held[..i].contains(&h) {
                let allowed = "different numbers of costates";
                return Err(ArgumentError::OutOfRange { argument: "held", allowed, found: h as f64 }.into());
            }
        }
        let fast = dims.expanding(direction);
        if held.len() + fast != n {
            return Err(PlacementError::Held { held: held.len(), fast, expected: n });
        }
        let held = held.to_vec();
        Ok(Self {
            direction,
            dims,
            held,
            schedule,
            method: Method::Newton,
            tolerance: 1e-8,
            max_iterations: 30,
            adapts: true,
        })
    }

    /// With another method.
    pub fn with_method(self, method: Method) -> Self {
        Self { method, ..self }
    }

    /// Direction in time.
    pub fn direction(&self) -> TimeDirection {
        self.direction
    }

    /// The costates held, by number from 0.
    pub fn held(&self) -> &[usize] {
        &self.held
    }

    /// The same with only the last averaging time, at once or not at all, and at most ten iterations, for points that are near the manifold
    /// already.
    pub fn without_schedule(&self) -> Self {
        let last = self.schedule.0[self.schedule.0.len() - 1];
        let max_iterations = self.max_iterations.min(10);
        Self { schedule: Schedule(vec![last]), max_iterations, adapts: false, ..self.clone() }
    }

    /// Places `p`.
    pub fn place<S: VectorField>(&self, flow: &VariationalFlow<'_, S>, p: &DVector<f64>) -> PlacementResult {
        let n = p.len() / 2;
        let solved = (0..n).filter(|i| !self.held.contains(i)).map(|i| n + i).collect();
        let mut search = Search { placement: self, flow, solved, iterations: 0, flow_evaluations: 0 };
        let expected = self.dims.stable + self.dims.center + self.dims.unstable;
        let mut placed = PlacementResult {
            p: p.clone(),
            status: PlacementStatus::Placed,
            angle: f64::NAN,
            time: 0.0,
            spectrum: None,
            iterations: 0,
            flow_evaluations: 0,
        };
        if p.len() != expected {
            let error = ArgumentError::Length { argument: "p", expected, found: p.len() };
            return PlacementResult { status: PlacementStatus::Flow(error.into()), ..placed };
        }
        'times: for &time in &self.schedule.0 {
            let mut target = time;
            let mut halvings = 0;
            // what the first time left, where nothing has been placed yet
            let mut first = None;
            loop {
                let attempt = search.at(&placed.p, target);
                if attempt.status == PlacementStatus::Placed {
                    placed = attempt;
                    if target == time {
                        break;
                    }
                    target = time;
                } else if self.adapts && halvings < HALVINGS && !attempt.status.reached_limit() {
                    halvings += 1;
                    target = 0.5 * (placed.time + target);
                    first.get_or_insert(attempt);
                } else {
                    // the last point placed, or the best of the first attempt
                    let status = attempt.status.clone();
                    placed = if placed.time > 0.0 {
                        PlacementResult { status, ..placed }
                    } else {
                        first.unwrap_or(attempt)
                    };
                    break 'times;
                }
            }
        }
        PlacementResult { iterations: search.iterations, flow_evaluations: search.flow_evaluations, ..placed }
    }
}

/// Most choices of costates that are ranked.
const MOST_CHOICES: usize = 1_000_000;

/// Every choice of costates to hold, best first, with the smallest singular value of the fast directions' components along
/// the costates solved for: near zero where these cannot move the field out of the fast directions (10.1). Without fast
/// directions all are held, and nothing limits them. More than a million choices are refused.
pub fn rank_held_costates(slow: &Subspace) -> Result<Vec<(Vec<usize>, f64)>, PlacementError> {
    let (n, fast) = (slow.dimension() / 2, slow.complement());
    let basis: Vec<_> = fast.basis().collect();
    let k = basis.len();
    if k > n {
        return Ok(Vec::new());
    }
    if k == 0 {
        return Ok(vec![((0..n).collect(), f64::INFINITY)]);
    }
    // each factor leaves a whole number, the number of choices of i + 1 out of n − k + i + 1
    let choices = (0..k).try_fold(1usize, |count, i| Some(count.checked_mul(n - k + i + 1)? / (i + 1)));
    if choices.is_none_or(|choices| choices > MOST_CHOICES) {
        return Err(PlacementError::Choices { costates: n, solved: k, allowed: MOST_CHOICES });
    }
    let mut ranked = Vec::new();
    let mut solved: Vec<usize> = (0..k).collect();
    loop {
        let part = DMatrix::from_fn(k, k, |i, j| basis[i][n + solved[j]]);
        let smallest = part.singular_values().iter().copied().fold(f64::INFINITY, f64::min);
        ranked.push(((0..n).filter(|i| !solved.contains(i)).collect(), smallest));
        // the next choice: the first number that has room above it moves up, and those below it start again
        let room = |i: usize| solved[i] + 1 < if i + 1 < k { solved[i + 1] } else { n };
        let Some(moving) = (0..k).find(|&i| room(i)) else { break };
        solved[moving] += 1;
        (0..moving).for_each(|i| solved[i] = i);
    }
    ranked.sort_by(|a: &(Vec<usize>, f64), b| b.1.total_cmp(&a.1));
    Ok(ranked)
}
