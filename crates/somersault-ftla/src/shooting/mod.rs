//! Extremals by multiple shooting: polishing to rounding, whatever the rates.
//!
//! A motion is a list of nodes p₀ … p_K at times t₀ … t_K. It is an extremal if every segment carries a node to the next,
//! φ(t_{k+1} − t_k, p_k) = p_{k+1}, and the end conditions hold. Newton's method with the transition matrices of the
//! segments solves for all nodes at once; steps are shortened by the natural monotonicity test (P. Deuflhard, *Newton
//! methods for nonlinear problems*, Springer 2004, 3.3): the correction that the old matrices find at the trial point must
//! be shorter than the one before, which asks nothing of the scaling of costates.
//!
//! Segments are propagated in parallel, and no more accurately than the residual calls for.
//!
//! Every entry of p is measured in its own size over the motion, in the residual, in the linear equations and in the
//! absolute tolerance of the segments: a problem in other units has the same iterates. A solution must keep its Hamiltonian
//! as well as its conditions ([`ShootingStatus::HamiltonianDrifts`]), which a costate equation with a wrong derivative does not.

mod elimination;

use crate::budget::{Budget, Limits};
use crate::flow::{FlowError, FlowTolerances, Transition, VariationalFlow, Work};
use crate::system::{OptimalControlSystem, VectorField};
use elimination::Elimination;
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use somersault_core::argument::{ArgumentError, expect_positive};
use std::fmt;

/// Why a boundary value problem cannot be posed or begun.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ShootingError {
    /// An argument that is not allowed.
    #[error(transparent)]
    Argument(#[from] ArgumentError),
    /// A continuation begins at no rest.
    #[error(
        "`stages` must begin with a rest, the same state at both ends at which nothing moves without control, found a \
         field of {rate:e} there"
    )]
    NoRest {
        /// The largest entry of the field at the first state with λ = 0; infinite where the two ends differ.
        rate: f64,
    },
    /// Collocation ends without a motion to start from.
    #[error(
        "collocation found no motion to start from: a function has no value along the straight line between the ends"
    )]
    NoMotion,
    /// A segment of the guess cannot be propagated.
    #[error("segment {segment} of the guess: {source}")]
    Guess {
        /// Number of the segment.
        segment: usize,
        /// What happened.
        source: FlowError,
    },
}

/// The n conditions at one end: each state is given, or free with its costate zero.
#[derive(Debug, Clone, PartialEq)]
pub struct End {
    /// Of each condition, the entry of p.
    columns: Vec<usize>,
    values: Vec<f64>,
}

impl End {
    /// All n states given.
    pub fn try_state(x: &[f64]) -> Result<Self, ShootingError> {
        match x.iter().find(|x| !x.is_finite()) {
            Some(&found) => Err(ArgumentError::OutOfRange { argument: "x", allowed: "finite", found }.into()),
            None => Ok(Self::from_values(x.iter().copied())),
        }
    }

    pub(crate) fn from_values(x: impl Iterator<Item = f64>) -> Self {
        let values: Vec<f64> = x.collect();
        Self { columns: (0..values.len()).collect(), values }
    }

    /// State `i` < n is free, its costate zero.
    pub fn with_free(mut self, i: usize) -> Result<Self, ShootingError> {
        let n = self.values.len();
        if i >= n {
            let allowed = "the number of a state";
            return Err(ArgumentError::OutOfRange { argument: "i", allowed, found: i as f64 }.into());
        }
        (self.columns[i], self.values[i]) = (n + i, 0.0);
        Ok(self)
    }

    /// The given states, zero where free.
    pub fn state(&self) -> &[f64] {
        &self.values
    }

    /// Raises `largest` to what is missing in each entry that a condition is on.
    fn residual_into(&self, p: &DVector<f64>, largest: &mut DVector<f64>) {
        for (&column, &value) in self.columns.iter().zip(&self.values) {
            largest[column] = largest[column].max((p[column] - value).abs());
        }
    }
}

/// How a solve ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum ShootingStatus {
    /// Every defect and end condition is within the tolerance, and so is the range of the Hamiltonian where it is known.
    Converged,
    /// The residual is above the tolerance and at its floor: rounding and the segments' own tolerance allow no smaller one.
    Floor,
    /// Every defect and end condition is within the tolerance, but the Hamiltonian is not constant: the field is not that of
    /// the problem, as where a derivative is wrong.
    HamiltonianDrifts,
    /// No shortened step passes the monotonicity test; the nodes are the last that did.
    Stalled,
    /// The iterations are used up.
    MaxIterations,
    /// The end conditions do not determine a correction.
    Singular,
    /// A limit of time or evaluations is reached; the nodes are the last accepted.
    LimitReached,
    /// A continuation stopped early: the nodes solve a member on the way to the one requested.
    OnTheWay,
}

impl fmt::Display for ShootingStatus {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Converged => "every defect and end condition is within the tolerance",
            Self::Floor => {
                "the residual is at its floor: rounding and the segments' tolerance allow no smaller one"
            }
            Self::HamiltonianDrifts => {
                "the Hamiltonian is not constant along the motion: the field is not that of the problem"
            }
            Self::Stalled => "no shortened step passes the monotonicity test",
            Self::MaxIterations => "the iterations are used up",
            Self::Singular => "the end conditions do not determine a correction",
            Self::LimitReached => "a limit of time or evaluations is reached",
            Self::OnTheWay => {
                "a continuation stopped early: this solves a member on its way, to the tolerance of those"
            }
        })
    }
}

/// A motion by its nodes, with how well it satisfies the conditions.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(try_from = "Parts"))]
pub struct Extremal {
    /// Times of the nodes.
    pub times: Vec<f64>,
    /// p at those times.
    pub nodes: Vec<DVector<f64>>,
    /// Transition of each segment at the last accepted nodes.
    pub links: Vec<Transition>,
    /// How the solve ended.
    pub status: ShootingStatus,
    /// The largest entry of a defect or end condition, relative to the size of that entry over the motion.
    pub residual: f64,
    /// The residual below which rounding and the tolerance of the segments hide what a step does.
    pub floor: f64,
    /// The range of the Hamiltonian over nodes and ends of segments where it is known, relative to the terms that it is a
    /// sum of.
    pub hamiltonian_drift: Option<f64>,
    /// Newton steps taken.
    pub iterations: usize,
    /// Segments propagated.
    pub flow_evaluations: usize,
    /// What they cost.
    pub work: Work,
}

/// An extremal as files hold it.
#[cfg(feature = "serde")]
#[derive(serde::Deserialize)]
struct Parts {
    times: Vec<f64>,
    nodes: Vec<DVector<f64>>,
    links: Vec<Transition>,
    status: ShootingStatus,
    residual: f64,
    floor: f64,
    hamiltonian_drift: Option<f64>,
    iterations: usize,
    flow_evaluations: usize,
    work: Work,
}

#[cfg(feature = "serde")]
impl TryFrom<Parts> for Extremal {
    type Error = &'static str;

    fn try_from(parts: Parts) -> Result<Self, Self::Error> {
        let Parts {
            times,
            nodes,
            links,
            status,
            residual,
            floor,
            hamiltonian_drift,
            iterations,
            flow_evaluations,
            work,
        } = parts;
        if nodes.len() < 2 || times.len() != nodes.len() || links.len() + 1 != nodes.len() {
            return Err("`nodes` must be two at least, `times` as many, and `links` one less");
        }
        let n = nodes[0].len();
        let fits = |link: &Transition| link.end.len() == n && link.matrix.shape() == (n, n);
        if !nodes.iter().all(|node| node.len() == n) || !links.iter().all(fits) {
            return Err("`nodes` and `links` must be of one dimension");
        }
        Ok(Self {
            times,
            nodes,
            links,
            status,
            residual,
            floor,
            hamiltonian_drift,
            iterations,
            flow_evaluations,
            work,
        })
    }
}

impl Extremal {
    /// The size of each entry of p over the motion, in which residuals are measured; see [`MultipleShooting`].
    pub fn scale(&self) -> DVector<f64> {
        scale_of(&self.nodes, &self.links)
    }

    /// A guess for which nothing was left to spend: its links are unknown, and so is its residual.
    fn not_propagated(times: &[f64], nodes: Vec<DVector<f64>>) -> Self {
        let n = nodes[0].len();
        let unknown = |pair: &[f64]| Transition {
            duration: pair[1] - pair[0],
            end: DVector::repeat(n, f64::NAN),
            matrix: DMatrix::repeat(n, n, f64::NAN),
        };
        Self {
            times: times.to_vec(),
            nodes,
            links: times.windows(2).map(unknown).collect(),
            status: ShootingStatus::LimitReached,
            residual: f64::INFINITY,
            floor: f64::NAN,
            hamiltonian_drift: None,
            iterations: 0,
            flow_evaluations: 0,
            work: Work::default(),
        }
    }

    /// The smallest and the largest value of `f` over the nodes and the ends of the segments.
    pub fn range_of(&self, f: impl Fn(&[f64]) -> f64) -> [f64; 2] {
        let points = self.nodes.iter().chain(self.links.iter().map(|link| &link.end));
        points
            .map(|p| f(p.as_slice()))
            .fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], h| [low.min(h), high.max(h)])
    }

    /// Says of what solves a member on the way that it is no solution of the problem requested.
    pub(crate) fn mark_on_the_way(&mut self) {
        if self.status == ShootingStatus::Converged {
            self.status = ShootingStatus::OnTheWay;
        }
    }

    /// ∫ ℓ dt over the segments, by `flow` with its absolute tolerance in the scale of the motion and of its cost.
    pub fn cost<S: OptimalControlSystem>(&self, flow: &VariationalFlow<'_, S>) -> Result<f64, FlowError> {
        let (expected, found) = (flow.system().dimension(), self.nodes[0].len());
        if found != expected {
            return Err(ArgumentError::Length { argument: "nodes", expected, found }.into());
        }
        let horizon = self.times[self.times.len() - 1] - self.times[0];
        let largest =
            self.nodes.iter().fold(0.0, |m: f64, p| m.max(flow.system().running_cost(p.as_slice()).abs()));
        let cost = if largest > 0.0 && largest.is_finite() { largest * horizon } else { 1.0 };
        let flow = flow.clone().with_scale(self.scale(), cost);
        let segments = self.nodes.iter().zip(self.times.windows(2));
        segments.map(|(p, t)| flow.cost(p, t[1] - t[0]).map(|(_, cost)| cost)).sum()
    }

    /// p(t), from the last node before, by `flow` with its absolute tolerance in the scale of the motion; `t` is cut off at
    /// the ends.
    pub fn at<S: VectorField>(
        &self,
        flow: &VariationalFlow<'_, S>,
        t: f64,
    ) -> Result<DVector<f64>, FlowError> {
        let last = self.nodes.len() - 1;
        let t = t.clamp(self.times[0], self.times[last]);
        let k = self.times.partition_point(|s| *s <= t).clamp(1, last) - 1;
        flow.clone().with_scale(self.scale(), 1.0).state(&self.nodes[k], t - self.times[k])
    }
}

/// Multiple shooting with its tolerances.
///
/// The size of an entry of p is its largest value over nodes and ends of segments. An entry that stays near zero counts as
/// large as what, kept up over the motion, would move some other entry by a thousandth of that one's size.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MultipleShooting {
    /// Largest defect and end residual of a solution, relative to the size of the entry; from 1e-15, which is rounding, to
    /// 0.1.
    pub tolerance: f64,
    /// Newton steps allowed.
    pub max_iterations: usize,
    /// FlowTolerances of the segments in the last steps; the absolute one is relative to the size of the entry.
    pub flow: FlowTolerances,
    /// What a solve may spend.
    pub limits: Limits,
}

impl Default for MultipleShooting {
    /// 1e-11, 100 steps, segments to 1e-13, without limits.
    fn default() -> Self {
        let flow = FlowTolerances { relative: 1e-13, absolute: 1e-15 };
        Self { tolerance: 1e-11, max_iterations: 100, flow, limits: Limits::default() }
    }
}

/// Times from 0 to `horizon`, `shortest` apart at both ends and half as much more at each step inwards, to `longest`.
///
/// Where a problem has rates μ, segments of 20/μ still carry Newton's method: Φ grows by e²⁰.
pub fn graded_times(horizon: f64, shortest: f64, longest: f64) -> Result<Vec<f64>, ShootingError> {
    for (argument, found) in [("horizon", horizon), ("shortest", shortest), ("longest", longest)] {
        expect_positive(argument, found)?;
    }
    if horizon / longest > 1e6 {
        let allowed = "at least a millionth of the horizon";
        return Err(ArgumentError::OutOfRange { argument: "longest", allowed, found: longest }.into());
    }
    let mut half = vec![0.0];
    let (mut t, mut h) = (0.0, shortest.min(longest));
    while t < 0.5 * horizon {
        t += h;
        half.push(t);
        h = (1.5 * h).min(longest);
    }
    // scaled to meet in the middle
    let scale = 0.5 * horizon / t;
    let mut times: Vec<f64> = half.iter().map(|t| t * scale).collect();
    times.extend(half.iter().rev().skip(1).map(|t| horizon - t * scale));
    if times.len() < 2 || times.windows(2).any(|pair| pair[0] >= pair[1]) {
        let allowed = "long enough for times that differ";
        return Err(ArgumentError::OutOfRange { argument: "horizon", allowed, found: horizon }.into());
    }
    Ok(times)
}

/// Shortest fraction of a Newton step tried.
const SHORTEST: f64 = 1e-5;

/// Multiples of the estimated floor within which a residual counts as being there.
const NEAR_FLOOR: f64 = 8.0;

/// A propagated list of nodes.
struct Shot {
    links: Vec<Transition>,
    defects: Vec<DVector<f64>>,
    /// Of each entry, the largest defect or end residual.
    largest: DVector<f64>,
}

impl Shot {
    fn residual(&self, scale: &DVector<f64>) -> f64 {
        self.largest.component_div(scale).amax()
    }
}

/// What the propagation of a list of nodes needs besides them.
struct Segments<'a, S> {
    system: &'a S,
    ends: &'a [End; 2],
    times: &'a [f64],
    flow: FlowTolerances,
    budget: &'a Budget,
    evaluations: usize,
    work: Work,
}

impl MultipleShooting {
    /// From the guess `nodes` at `times`, with conditions at both ends.
    pub fn solve<S>(
        &self,
        system: &S,
        ends: &[End; 2],
        times: &[f64],
        nodes: &[DVector<f64>],
    ) -> Result<Extremal, ShootingError>
    where
        S: VectorField + Sync,
    {
        self.solve_within(&self.limits.start(), system, ends, times, nodes)
    }

    /// The same as a part of a search that has begun.
    pub(crate) fn solve_within<S>(
        &self,
        budget: &Budget,
        system: &S,
        ends: &[End; 2],
        times: &[f64],
        nodes: &[DVector<f64>],
    ) -> Result<Extremal, ShootingError>
    where
        S: VectorField + Sync,
    {
        self.check(system.dimension(), ends, times, nodes)?;
        let (evaluations, work) = (0, Work::default());
        let mut segments = Segments { system, ends, times, flow: self.flow, budget, evaluations, work };
        let mut relative = 1e-5f64.max(self.flow.relative);
        let mut nodes = nodes.to_vec();
        // of nodes that have no links yet
        let mut scale = scale_of(&nodes, &[]);
        let mut shot = match segments.shoot(&nodes, &scale, relative) {
            Ok(shot) => shot,
            Err((_, FlowError::LimitReached { .. })) => return Ok(Extremal::not_propagated(times, nodes)),
            Err((segment, source)) => return Err(ShootingError::Guess { segment, source }),
        };
        let mut elimination = Elimination::new(system.dimension());
        let (mut step, mut simplified) = (Vec::new(), Vec::new());
        let mut trial = nodes.clone();
        let mut fraction = 1.0f64;
        let mut iterations = 0;
        let status = 'newton: loop {
            scale = scale_of(&nodes, &shot.links);
            // the accuracy of the segments follows the residual down
            let residual = shot.residual(&scale);
            let wanted = (1e-3 * residual).clamp(self.flow.relative, 1e-5f64.max(self.flow.relative));
            if wanted < 0.1 * relative || (residual <= self.tolerance && relative > self.flow.relative) {
                relative = if residual <= 1e2 * self.tolerance { self.flow.relative } else { wanted };
                match segments.shoot(&nodes, &scale, relative) {
                    Ok(better) => shot = better,
                    Err(_) if budget.reached().is_some() => break ShootingStatus::LimitReached,
                    Err(_) => break ShootingStatus::Stalled,
                }
                scale = scale_of(&nodes, &shot.links);
            }
            let residual = shot.residual(&scale);
            if residual <= self.tolerance && relative <= self.flow.relative {
                break ShootingStatus::Converged;
            }
            if iterations == self.max_iterations {
                break ShootingStatus::MaxIterations;
            }
            if elimination.factor(&shot.links, ends, &scale).is_err() {
                break ShootingStatus::Singular;
            }
            elimination.solve(&shot.defects, &nodes, &mut step);
            let length = norm(&step, &scale);
            if !length.is_finite() {
                break ShootingStatus::Singular;
            }
            iterations += 1;
            fraction = (4.0 * fraction).min(1.0);
            loop {
                for (t, (p, d)) in trial.iter_mut().zip(nodes.iter().zip(&step)) {
                    t.copy_from(p);
                    t.axpy(fraction, d, 1.0);
                }
                if let Ok(next) = segments.shoot(&trial, &scale, relative) {
                    elimination.solve(&next.defects, &trial, &mut simplified);
                    let shorter = norm(&simplified, &scale) <= (1.0 - 0.25 * fraction) * length;
                    if shorter || next.residual(&scale) <= self.tolerance {
                        std::mem::swap(&mut nodes, &mut trial);
                        shot = next;
                        continue 'newton;
                    }
                }
                if budget.reached().is_some() {
                    break 'newton ShootingStatus::LimitReached;
                }
                fraction *= 0.4;
                if fraction < SHORTEST {
                    break 'newton ShootingStatus::Stalled;
                }
            }
        };
        let Segments { evaluations: flow_evaluations, work, .. } = segments;
        let (residual, floor) = (shot.residual(&scale), floor_of(&nodes, &shot.links, &scale, relative));
        let hamiltonian_drift = drift_of(system, &nodes, &shot.links, &scale);
        let drifts =
            hamiltonian_drift.is_some_and(|drift| drift.is_nan() || drift > self.most_drift(nodes.len()));
        let status = match status {
            ShootingStatus::Converged if drifts => ShootingStatus::HamiltonianDrifts,
            ShootingStatus::Stalled | ShootingStatus::MaxIterations
                if relative <= self.flow.relative && residual <= NEAR_FLOOR * floor =>
            {
                ShootingStatus::Floor
            }
            status => status,
        };
        let (times, links) = (times.to_vec(), shot.links);
        Ok(Extremal {
            times,
            nodes,
            links,
            status,
            residual,
            floor,
            hamiltonian_drift,
            iterations,
            flow_evaluations,
            work,
        })
    }

    /// What defects within the tolerance may add up to in the Hamiltonian: ∇H·δ at each node, in units of the terms of H, and
    /// as much again twice for what lies within the segments.
    fn most_drift(&self, nodes: usize) -> f64 {
        4.0 * nodes as f64 * self.tolerance
    }

    /// FlowTolerances below rounding are refused.
    pub(crate) fn check_tolerance(&self) -> Result<(), ShootingError> {
        if (1e-15..=0.1).contains(&self.tolerance) {
            return Ok(());
        }
        let (argument, allowed) = ("tolerance", "in [1e-15, 0.1]");
        Err(ShootingError::Argument(ArgumentError::OutOfRange { argument, allowed, found: self.tolerance }))
    }

    fn check(
        &self,
        dimension: usize,
        ends: &[End; 2],
        times: &[f64],
        nodes: &[DVector<f64>],
    ) -> Result<(), ShootingError> {
        let argument = |argument, allowed, found| {
            Err(ShootingError::Argument(ArgumentError::OutOfRange { argument, allowed, found }))
        };
        self.check_tolerance()?;
        if !dimension.is_multiple_of(2) {
            return argument("system", "of as many costates as states", dimension as f64);
        }
        if let Some(end) = ends.iter().find(|end| 2 * end.values.len() != dimension) {
            let (expected, found) = (dimension / 2, end.values.len());
            return Err(ArgumentError::Length { argument: "x", expected, found }.into());
        }
        if let Some(node) = nodes.iter().find(|node| node.len() != dimension) {
            let found = node.len();
            return Err(ArgumentError::Length { argument: "nodes", expected: dimension, found }.into());
        }
        if times.len() < 2 {
            return Err(ArgumentError::Length { argument: "times", expected: 2, found: times.len() }.into());
        }
        if let Some(&found) = times.iter().find(|t| !t.is_finite()) {
            return argument("times", "finite", found);
        }
        if let Some(pair) = times.windows(2).find(|t| t[1] <= t[0]) {
            return argument("times", "ascending", pair[1]);
        }
        if nodes.len() != times.len() {
            return Err(ArgumentError::Length {
                argument: "nodes",
                expected: times.len(),
                found: nodes.len(),
            }
            .into());
        }
        match nodes.iter().flat_map(|p| p.iter()).find(|x| !x.is_finite()) {
            Some(&found) => argument("nodes", "finite", found),
            None => Ok(()),
        }
    }
}

impl<S: VectorField + Sync> Segments<'_, S> {
    fn shoot(
        &mut self,
        nodes: &[DVector<f64>],
        scale: &DVector<f64>,
        relative: f64,
    ) -> Result<Shot, (usize, FlowError)> {
        let Self { system, ends, times, budget, .. } = *self;
        self.evaluations += nodes.len() - 1;
        let absolute = self.flow.absolute * (relative / self.flow.relative);
        let flow =
            VariationalFlow::try_new(system, FlowTolerances { relative, absolute }).map_err(|e| (0, e))?;
        // a guess may ask for a motion that runs off; it is not worth many steps
        let flow = flow.with_max_steps(2000).with_scale(scale.clone(), 1.0).within(budget);
        let segments = (0..times.len() - 1).into_par_iter().with_min_len(4);
        let propagated: Result<Vec<_>, _> = segments
            .map(|k| flow.transition_counted(&nodes[k], times[k + 1] - times[k]).map_err(|e| (k, e)))
            .collect();
        let propagated = propagated?;
        let mut links = Vec::with_capacity(propagated.len());
        for (link, cost) in propagated {
            links.push(link);
            self.work += cost;
        }
        let defects: Vec<DVector<f64>> = links.iter().zip(&nodes[1..]).map(|(l, p)| &l.end - p).collect();
        let mut largest = DVector::zeros(scale.len());
        for defect in &defects {
            largest.zip_apply(defect, |most: &mut f64, d: f64| *most = most.max(d.abs()));
        }
        ends[0].residual_into(&nodes[0], &mut largest);
        ends[1].residual_into(&nodes[nodes.len() - 1], &mut largest);
        Ok(Shot { links, defects, largest })
    }
}

/// Part of another entry's size that an entry must be able to move to count as large.
const FELT: f64 = 1e-3;

/// The size of each entry of p over the motion, as [`MultipleShooting`] says.
fn scale_of(nodes: &[DVector<f64>], links: &[Transition]) -> DVector<f64> {
    let points = nodes.iter().chain(links.iter().map(|link| &link.end));
    let n = nodes[0].len();
    let mut size = DVector::<f64>::zeros(n);
    for p in points {
        size.zip_apply(p, |most: &mut f64, x: f64| *most = most.max(x.abs()));
    }
    let horizon: f64 = links.iter().map(|link| link.duration.abs()).sum();
    // the largest rate at which an entry moves another one, in the sizes of those
    let mut felt = DVector::<f64>::zeros(n);
    for link in links {
        let over = horizon / link.duration.abs();
        for j in 0..n {
            for i in (0..n).filter(|&i| i != j && size[i] > 0.0) {
                felt[j] = felt[j].max(link.matrix[(i, j)].abs() / size[i] * over);
            }
        }
    }
    DVector::from_fn(n, |j, _| {
        let floor = if felt[j] > 0.0 { FELT / felt[j] } else { 0.0 };
        let scale = size[j].max(floor);
        // of a motion that rests at zero nothing is known
        if scale > 0.0 && scale.is_finite() { scale } else { 1.0 }
    })
}

/// The residual that rounding and the error of the segments leave: a relative error of each entry at a node, carried on by Φ.
fn floor_of(nodes: &[DVector<f64>], links: &[Transition], scale: &DVector<f64>, relative: f64) -> f64 {
    let error = relative + f64::EPSILON;
    nodes.iter().zip(links).fold(0.0, |m: f64, (p, link)| {
        let carried = link.matrix.abs() * p.abs() * error;
        m.max(carried.component_div(scale).amax())
    })
}

/// The range of H over nodes and ends of segments, relative to the largest Σ |∂H/∂pᵢ| sᵢ there, s the scale.
fn drift_of<S: VectorField>(
    system: &S,
    nodes: &[DVector<f64>],
    links: &[Transition],
    scale: &DVector<f64>,
) -> Option<f64> {
    let (mut low, mut high, mut terms) = (f64::INFINITY, f64::NEG_INFINITY, 0.0f64);
    for p in nodes.iter().chain(links.iter().map(|link| &link.end)) {
        let value = system.conserved(p.as_slice())?;
        if !value.is_finite() {
            return Some(f64::NAN);
        }
        let (field, n) = (system.field(p.as_slice()), p.len());
        (low, high) = (low.min(value), high.max(value));
        terms = terms.max((0..n).map(|i| field[i].abs() * scale[(i + n / 2) % n]).sum());
    }
    let range = high - low;
    // where nothing moves H has no terms, and does not change
    Some(if range > 0.0 { range / terms } else { 0.0 })
}

fn norm(step: &[DVector<f64>], scale: &DVector<f64>) -> f64 {
    (step.iter().map(|d| d.component_div(scale).norm_squared()).sum::<f64>() / step.len() as f64).sqrt()
}
