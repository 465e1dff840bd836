//! Extremals by multiple shooting: polishing to rounding, whatever the rates.
//!
//! A motion is a list of nodes p₀ … p_K at times t₀ … t_K. It is an extremal if every segment carries a node to the next,
//! φ(t_{k+1} − t_k, p_k) = p_{k+1}, and the end conditions hold. Newton's method with the transition matrices of the
//! segments solves for all nodes at once; steps are shortened by the natural monotonicity test (P. Deuflhard, *Newton
//! methods for nonlinear problems*, Springer 2004, 3.3): the correction that the old matrices find at the trial point must
//! be shorter than the one before, which asks nothing of the scaling of costates.
//!
//! Segments are propagated in parallel, and no more accurately than the residual calls for.

mod elimination;

use crate::flow::{FlowError, Tolerances, Transition, VariationalFlow, Work};
use crate::system::{OptimalControlSystem, VectorField};
use elimination::Elimination;
use nalgebra::SVector;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Why a boundary value problem cannot be posed or begun.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ShootingError {
    /// An argument has the wrong number of entries.
    #[error("`{argument}` must have {expected} entries, found {found}")]
    Length {
        /// Name of the argument.
        argument: &'static str,
        /// Entries expected.
        expected: usize,
        /// Entries found.
        found: usize,
    },
    /// An argument is out of range.
    #[error("`{argument}` must be {allowed}, found {found}")]
    Argument {
        /// Name of the argument.
        argument: &'static str,
        /// What it may be.
        allowed: &'static str,
        /// Its value.
        found: f64,
    },
    /// A continuation begins at no rest.
    #[error(
        "`stages` must begin with a rest, the same state at both ends at which nothing moves without control, found a \
         field of {rate:e} there"
    )]
    NoRest {
        /// The largest entry of the field at the first state with λ = 0; infinite where the two ends differ.
        rate: f64,
    },
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
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct End<const N: usize> {
    /// Of each condition, the entry of p.
    columns: [usize; N],
    values: [f64; N],
}

impl<const N: usize> End<N> {
    /// All n = N/2 states given.
    pub fn try_state(x: &[f64]) -> Result<Self, ShootingError> {
        if x.len() != N / 2 {
            return Err(ShootingError::Length { argument: "x", expected: N / 2, found: x.len() });
        }
        let mut end = Self { columns: std::array::from_fn(|i| i), values: [0.0; N] };
        for (i, &found) in x.iter().enumerate() {
            if !found.is_finite() {
                return Err(ShootingError::Argument { argument: "x", allowed: "finite", found });
            }
            end.values[i] = found;
        }
        Ok(end)
    }

    pub(crate) fn from_values(x: impl Iterator<Item = f64>) -> Self {
        let mut end = Self { columns: std::array::from_fn(|i| i), values: [0.0; N] };
        x.take(N / 2).enumerate().for_each(|(i, value)| end.values[i] = value);
        end
    }

    /// State `i` < n is free, its costate zero.
    pub fn with_free(mut self, i: usize) -> Result<Self, ShootingError> {
        if i >= N / 2 {
            let allowed = "the number of a state";
            return Err(ShootingError::Argument { argument: "i", allowed, found: i as f64 });
        }
        (self.columns[i], self.values[i]) = (N / 2 + i, 0.0);
        Ok(self)
    }

    /// The given states, zero where free.
    pub fn state(&self) -> &[f64] {
        &self.values[..N / 2]
    }

    fn residual(&self, p: &SVector<f64, N>) -> f64 {
        (0..N / 2).fold(0.0, |m: f64, i| m.max((p[self.columns[i]] - self.values[i]).abs()))
    }
}

/// How a solve ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Status {
    /// Every defect and end condition is within the tolerance.
    Converged,
    /// No shortened step passes the monotonicity test; the nodes are the last that did.
    Stalled,
    /// The iterations are used up.
    MaxIterations,
    /// The end conditions do not determine a correction.
    Singular,
    /// A continuation broke off: the nodes solve a member on the way to the one asked for.
    OnTheWay,
}

/// A motion by its nodes, with how well it satisfies the conditions.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Parts<N>")]
pub struct Extremal<const N: usize> {
    /// Times of the nodes.
    pub times: Vec<f64>,
    /// p at those times.
    pub nodes: Vec<SVector<f64, N>>,
    /// Transition of each segment at the last accepted nodes.
    pub links: Vec<Transition<N>>,
    /// How the solve ended.
    pub status: Status,
    /// The largest entry of a defect or end condition.
    pub residual: f64,
    /// Newton steps taken.
    pub iterations: usize,
    /// Segments propagated.
    pub flow_evaluations: usize,
    /// What they cost.
    pub work: Work,
}

/// An extremal as files hold it.
#[derive(Deserialize)]
struct Parts<const N: usize> {
    times: Vec<f64>,
    nodes: Vec<SVector<f64, N>>,
    links: Vec<Transition<N>>,
    status: Status,
    residual: f64,
    iterations: usize,
    flow_evaluations: usize,
    work: Work,
}

impl<const N: usize> TryFrom<Parts<N>> for Extremal<N> {
    type Error = &'static str;

    fn try_from(parts: Parts<N>) -> Result<Self, Self::Error> {
        let Parts { times, nodes, links, status, residual, iterations, flow_evaluations, work } = parts;
        if nodes.len() < 2 || times.len() != nodes.len() || links.len() + 1 != nodes.len() {
            return Err("`nodes` must be two at least, `times` as many, and `links` one less");
        }
        Ok(Self { times, nodes, links, status, residual, iterations, flow_evaluations, work })
    }
}

impl<const N: usize> Extremal<N> {
    /// The smallest and the largest value of `f` over the nodes and the ends of the segments.
    pub fn range_of(&self, f: impl Fn(&SVector<f64, N>) -> f64) -> [f64; 2] {
        let points = self.nodes.iter().chain(self.links.iter().map(|link| &link.end));
        points.map(f).fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], h| [low.min(h), high.max(h)])
    }

    /// Says of what solves a member on the way that it is no solution of the problem asked for.
    pub(crate) fn mark_on_the_way(&mut self) {
        if self.status == Status::Converged {
            self.status = Status::OnTheWay;
        }
    }

    /// ∫ ℓ dt over the segments.
    pub fn cost<S: OptimalControlSystem<N>>(
        &self,
        flow: &VariationalFlow<'_, S, N>,
    ) -> Result<f64, FlowError> {
        let segments = self.nodes.iter().zip(self.times.windows(2));
        segments.map(|(p, t)| flow.cost(p, t[1] - t[0]).map(|(_, cost)| cost)).sum()
    }

    /// p(t), from the last node before; `t` is cut off at the ends.
    pub fn at<S: VectorField<N>>(
        &self,
        flow: &VariationalFlow<'_, S, N>,
        t: f64,
    ) -> Result<SVector<f64, N>, FlowError> {
        let last = self.nodes.len() - 1;
        let t = t.clamp(self.times[0], self.times[last]);
        let k = self.times.partition_point(|s| *s <= t).clamp(1, last) - 1;
        flow.state(&self.nodes[k], t - self.times[k])
    }
}

/// Multiple shooting with its tolerances.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Shooting {
    /// Largest defect and end residual of a solution.
    pub tolerance: f64,
    /// Newton steps allowed.
    pub max_iterations: usize,
    /// Tolerances of the segments in the last steps.
    pub flow: Tolerances,
}

impl Default for Shooting {
    /// 1e-11, 100 steps, segments to 1e-13.
    fn default() -> Self {
        let flow = Tolerances { relative: 1e-13, absolute: 1e-15 };
        Self { tolerance: 1e-11, max_iterations: 100, flow }
    }
}

/// Times from 0 to `horizon`, `shortest` apart at both ends and half as much more at each step inwards, to `longest`.
///
/// Where a problem has rates μ, segments of 20/μ still carry Newton's method: Φ grows by e²⁰.
pub fn graded_times(horizon: f64, shortest: f64, longest: f64) -> Result<Vec<f64>, ShootingError> {
    let argument =
        |argument, found| Err(ShootingError::Argument { argument, allowed: "positive and finite", found });
    for (name, value) in [("horizon", horizon), ("shortest", shortest), ("longest", longest)] {
        if !value.is_finite() || value <= 0.0 {
            return argument(name, value);
        }
    }
    if horizon / longest > 1e6 {
        let allowed = "at least a millionth of the horizon";
        return Err(ShootingError::Argument { argument: "longest", allowed, found: longest });
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
    Ok(times)
}

/// Shortest fraction of a Newton step tried.
const SHORTEST: f64 = 1e-5;

/// A propagated list of nodes.
struct Shot<const N: usize> {
    links: Vec<Transition<N>>,
    defects: Vec<SVector<f64, N>>,
    residual: f64,
}

impl Shooting {
    /// From the guess `nodes` at `times`, with conditions at both ends.
    pub fn solve<S, const N: usize>(
        &self,
        system: &S,
        ends: &[End<N>; 2],
        times: &[f64],
        nodes: &[SVector<f64, N>],
    ) -> Result<Extremal<N>, ShootingError>
    where
        S: VectorField<N> + Sync,
    {
        self.check(times, nodes)?;
        let mut work = Work::default();
        let mut flow_evaluations = 0;
        let mut shoot = |nodes: &[SVector<f64, N>], relative: f64| {
            flow_evaluations += nodes.len() - 1;
            self.shoot(system, ends, times, nodes, relative, &mut work)
        };
        let mut relative = 1e-5f64.max(self.flow.relative);
        let mut nodes = nodes.to_vec();
        let mut shot =
            shoot(&nodes, relative).map_err(|(segment, source)| ShootingError::Guess { segment, source })?;
        let mut elimination = Elimination::<N>::default();
        let (mut step, mut simplified) = (Vec::new(), Vec::new());
        let mut trial = nodes.clone();
        let mut fraction = 1.0f64;
        let mut iterations = 0;
        let status = 'newton: loop {
            // the accuracy of the segments follows the residual down
            let wanted = (1e-3 * shot.residual).clamp(self.flow.relative, 1e-5f64.max(self.flow.relative));
            if wanted < 0.1 * relative || (shot.residual <= self.tolerance && relative > self.flow.relative) {
                relative = if shot.residual <= 1e2 * self.tolerance { self.flow.relative } else { wanted };
                match shoot(&nodes, relative) {
                    Ok(better) => shot = better,
                    Err(_) => break Status::Stalled,
                }
            }
            if shot.residual <= self.tolerance && relative <= self.flow.relative {
                break Status::Converged;
            }
            if iterations == self.max_iterations {
                break Status::MaxIterations;
            }
            if elimination.factor(&shot.links, ends).is_err() {
                break Status::Singular;
            }
            let (first, last) = (nodes[0], nodes[nodes.len() - 1]);
            elimination.solve(&shot.defects, &first, &last, &mut step);
            let scale = scale_of(&nodes);
            let length = norm(&step, &scale);
            if !length.is_finite() {
                break Status::Singular;
            }
            iterations += 1;
            fraction = (4.0 * fraction).min(1.0);
            loop {
                for (t, (p, d)) in trial.iter_mut().zip(nodes.iter().zip(&step)) {
                    *t = p + d * fraction;
                }
                if let Ok(next) = shoot(&trial, relative) {
                    let (first, last) = (trial[0], trial[trial.len() - 1]);
                    elimination.solve(&next.defects, &first, &last, &mut simplified);
                    let shorter = norm(&simplified, &scale) <= (1.0 - 0.25 * fraction) * length;
                    if shorter || next.residual <= self.tolerance {
                        std::mem::swap(&mut nodes, &mut trial);
                        shot = next;
                        continue 'newton;
                    }
                }
                fraction *= 0.4;
                if fraction < SHORTEST {
                    break 'newton Status::Stalled;
                }
            }
        };
        let Shot { links, residual, .. } = shot;
        let times = times.to_vec();
        Ok(Extremal { times, nodes, links, status, residual, iterations, flow_evaluations, work })
    }

    fn check<const N: usize>(&self, times: &[f64], nodes: &[SVector<f64, N>]) -> Result<(), ShootingError> {
        let argument = |argument, allowed, found| Err(ShootingError::Argument { argument, allowed, found });
        if self.tolerance.is_nan() || self.tolerance <= 0.0 {
            return argument("tolerance", "positive", self.tolerance);
        }
        if times.len() < 2 {
            return Err(ShootingError::Length { argument: "times", expected: 2, found: times.len() });
        }
        if let Some(&found) = times.iter().find(|t| !t.is_finite()) {
            return argument("times", "finite", found);
        }
        if let Some(pair) = times.windows(2).find(|t| t[1] <= t[0]) {
            return argument("times", "ascending", pair[1]);
        }
        if nodes.len() != times.len() {
            return Err(ShootingError::Length {
                argument: "nodes",
                expected: times.len(),
                found: nodes.len(),
            });
        }
        match nodes.iter().flat_map(|p| p.iter()).find(|x| !x.is_finite()) {
            Some(&found) => argument("nodes", "finite", found),
            None => Ok(()),
        }
    }

    fn shoot<S: VectorField<N> + Sync, const N: usize>(
        &self,
        system: &S,
        ends: &[End<N>; 2],
        times: &[f64],
        nodes: &[SVector<f64, N>],
        relative: f64,
        work: &mut Work,
    ) -> Result<Shot<N>, (usize, FlowError)> {
        let absolute = self.flow.absolute * (relative / self.flow.relative);
        let flow = VariationalFlow::try_new(system, Tolerances { relative, absolute }).map_err(|e| (0, e))?;
        // a guess may ask for a motion that runs off; it is not worth many steps
        let flow = flow.with_max_steps(2000);
        let segments = (0..times.len() - 1).into_par_iter().with_min_len(4);
        let propagated: Result<Vec<_>, _> = segments
            .map(|k| flow.transition_counted(&nodes[k], times[k + 1] - times[k]).map_err(|e| (k, e)))
            .collect();
        let propagated = propagated?;
        let mut links = Vec::with_capacity(propagated.len());
        for (link, cost) in propagated {
            links.push(link);
            *work += cost;
        }
        let defects: Vec<SVector<f64, N>> = links.iter().zip(&nodes[1..]).map(|(l, p)| l.end - p).collect();
        let at_ends = ends[0].residual(&nodes[0]).max(ends[1].residual(&nodes[nodes.len() - 1]));
        let residual = defects.iter().fold(at_ends, |m, d| m.max(d.amax()));
        Ok(Shot { links, defects, residual })
    }
}

/// The size of each entry of p over the motion.
fn scale_of<const N: usize>(nodes: &[SVector<f64, N>]) -> SVector<f64, N> {
    let largest = nodes.iter().fold(SVector::<f64, N>::zeros(), |m, p| m.sup(&p.abs()));
    let floor = 1e-2 * largest.amax().max(1e-2);
    largest.map(|x| x.max(floor))
}

fn norm<const N: usize>(step: &[SVector<f64, N>], scale: &SVector<f64, N>) -> f64 {
    (step.iter().map(|d| d.component_div(scale).norm_squared()).sum::<f64>() / step.len() as f64).sqrt()
}
