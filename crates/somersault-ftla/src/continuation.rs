//! Families of extremals: from a problem whose solution is known to the one that is wanted.
//!
//! A family gives for each s in [0, 1] a system, end conditions and a horizon; node times are kept as fractions of the
//! horizon. Solutions are followed from s = 0, where a rest at an equilibrium will often do, by secants and Newton's method,
//! in steps that grow where Newton is quick and are halved where it fails.
//!
//! A member that cannot be solved, be it that its motions overflow, is a step rejected. A continuation ends with the last
//! member that was solved, the stage that it was in and, unless it arrived, the reason ([`ContinuationResult`]).

use crate::budget::{Budget, Limit};
use crate::flow::{FlowError, Work};
use crate::shooting::{End, Extremal, MultipleShooting, ShootingError, ShootingStatus};
use crate::system::VectorField;
use nalgebra::DVector;
use somersault_core::argument::ArgumentError;
use std::fmt;

/// One member of a family.
#[derive(Debug, Clone, PartialEq)]
pub struct Member<S> {
    /// The system.
    pub system: S,
    /// Conditions at both ends.
    pub ends: [End; 2],
    /// Time between them.
    pub horizon: f64,
}

/// Result of a continuation.
#[derive(Debug, Clone, PartialEq)]
pub struct ContinuationResult {
    /// The last solution; its status tells whether it was polished where `s` = 1.
    pub extremal: Extremal,
    /// How far that solution is on the way, over all stages: one if the continuation arrived.
    pub s: f64,
    /// What it was doing last.
    pub stage: Stage,
    /// Why it went no further; none if it arrived.
    pub reason: Option<Reason>,
    /// Members solved, and tried without success.
    pub steps: [usize; 2],
    /// Newton steps of all of them.
    pub iterations: usize,
    /// What all of them cost.
    pub work: Work,
}

/// The parts of the searches that lead from one problem to another.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Stage {
    /// Along a family that the caller gave.
    Family,
    /// Between two of the caller's stages: to number `to`, counted from one, of `of`.
    Leg {
        /// The stage that is led to.
        to: usize,
        /// How many stages there are.
        of: usize,
    },
    /// From what collocation found.
    Collocation,
    /// From the motion of minimum effort.
    LeastEffort,
    /// Releasing passive joints.
    Release,
    /// Lowering torque limits.
    Limits,
    /// From the linearised problem between its ends.
    Linearised,
    /// From the problem linearised at its start, the ends together.
    LinearisedAtStart,
    /// Moving the ends apart.
    Apart,
    /// From the thesis' arm.
    FromThesis,
}

impl fmt::Display for Stage {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Family => f.write_str("along the family"),
            Self::Leg { to, of } => write!(f, "to stage {to} of {of}"),
            Self::Collocation => f.write_str("from the collocation solution"),
            Self::LeastEffort => f.write_str("from the motion of minimum effort"),
            Self::Release => f.write_str("releasing passive joints"),
            Self::Limits => f.write_str("lowering torque limits"),
            Self::Linearised => f.write_str("from the linearised problem"),
            Self::LinearisedAtStart => f.write_str("from the problem linearised at its start"),
            Self::Apart => f.write_str("moving the ends apart"),
            Self::FromThesis => f.write_str("from the arm of the thesis"),
        }
    }
}

/// Why a search went no further.
#[derive(Debug, Clone, PartialEq)]
pub enum Reason {
    /// The member tried last was not solved.
    Unsolved(ShootingStatus),
    /// The member tried last could not be propagated.
    Failed(ShootingError),
    /// A limit was reached.
    Limit(Limit),
}

impl fmt::Display for Reason {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Unsolved(status) => status.fmt(f),
            Self::Failed(error) => error.fmt(f),
            Self::Limit(limit) => limit.fmt(f),
        }
    }
}

impl ContinuationResult {
    /// Whether the last member was reached and polished.
    pub fn arrived(&self) -> bool {
        self.s == 1.0 && self.extremal.status == ShootingStatus::Converged
    }

    /// One solve, without a continuation.
    pub(crate) fn of_one(extremal: Extremal, stage: Stage, budget: &Budget) -> Self {
        let reason = reason_of(&extremal, budget);
        let s = if reason.is_none() { 1.0 } else { 0.0 };
        Self { extremal, s, stage, reason, steps: [1, 0], iterations: 0, work: Work::default() }
    }

    /// Stopped early in a later stage, whose first member could not be begun with.
    pub(crate) fn stopped(mut self, stage: Stage, error: ShootingError, budget: &Budget) -> Self {
        self.extremal.mark_on_the_way();
        (self.stage, self.reason) = (stage, Some(reason_of_error(error, budget)));
        self
    }

    /// With what came before added to the counts.
    pub(crate) fn after(mut self, before: &Self) -> Self {
        self.steps = [self.steps[0] + before.steps[0], self.steps[1] + before.steps[1]];
        self.iterations += before.iterations;
        self.work += before.work;
        self
    }
}

/// Follows families.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Continuation {
    /// For the last member. Its limits are those of the whole continuation, or of the cold start that it is part of.
    pub polish: MultipleShooting,
    /// For the members on the way; its limits count for nothing.
    pub on_the_way: MultipleShooting,
    /// First step in s.
    pub first_step: f64,
    /// Steps in s shorter than this end the continuation.
    pub min_step: f64,
}

impl Default for Continuation {
    /// Members on the way to 1e-4 in at most 6 Newton steps, first step 0.1, shortest 1e-4.
    fn default() -> Self {
        let polish = MultipleShooting::default();
        let on_the_way = MultipleShooting {
            tolerance: 1e-4,
            max_iterations: 6,
            flow: crate::flow::FlowTolerances { relative: 1e-7, absolute: 1e-9 },
            limits: polish.limits,
        };
        Self { polish, on_the_way, first_step: 0.1, min_step: 1e-4 }
    }
}

impl Continuation {
    /// Leads a system from rest to given end states through pairs of end states on the way, straight from one to the next.
    ///
    /// The first pair must be a rest: the same state at both ends, at which staying without control costs nothing, so that
    /// λ = 0 solves it. For an arm that folds the stages are to rest folded, to travel folded, and to unfold at the ends.
    pub fn through<S: VectorField + Sync + Clone>(
        &self,
        system: &S,
        stages: &[[Vec<f64>; 2]],
        horizon: f64,
        fractions: &[f64],
    ) -> Result<ContinuationResult, ShootingError> {
        self.through_within(&self.polish.limits.start(), system, stages, horizon, fractions)
    }

    /// The same as a part of a search that has begun.
    pub(crate) fn through_within<S: VectorField + Sync + Clone>(
        &self,
        budget: &Budget,
        system: &S,
        stages: &[[Vec<f64>; 2]],
        horizon: f64,
        fractions: &[f64],
    ) -> Result<ContinuationResult, ShootingError> {
        if stages.len() < 2 {
            return Err(ArgumentError::Length { argument: "stages", expected: 2, found: stages.len() }.into());
        }
        for end in stages.iter().flatten() {
            let expected = system.dimension() / 2;
            if end.len() != expected {
                let found = end.len();
                return Err(ArgumentError::Length { argument: "stages", expected, found }.into());
            }
            if let Some(&found) = end.iter().find(|x| !x.is_finite()) {
                return Err(ArgumentError::OutOfRange { argument: "stages", allowed: "finite", found }.into());
            }
        }
        let at_rest = rest_of(system, stages)?;
        let mut nodes = vec![at_rest; fractions.len()];
        let mut total: Option<ContinuationResult> = None;
        let legs = stages.len() - 1;
        for (k, pair) in stages.windows(2).enumerate() {
            let ends = |s: f64| {
                let mix = |end: usize| {
                    let between = pair[0][end].iter().zip(&pair[1][end]).map(|(a, b)| a + s * (b - a));
                    End::from_values(between)
                };
                [mix(0), mix(1)]
            };
            let last = k + 1 == legs;
            let stage = Stage::Leg { to: k + 2, of: stages.len() };
            let leg = Self { polish: if last { self.polish } else { self.on_the_way }, ..*self };
            let family = |s: f64| Member { system: system.clone(), ends: ends(s), horizon };
            let mut found = match leg.follow_within(budget, stage, family, fractions, &nodes) {
                Ok(found) => found,
                Err(error) => {
                    let before = total.ok_or(error.clone())?;
                    return Ok(before.stopped(stage, error, budget));
                }
            };
            let arrived = found.arrived();
            if !last {
                found.extremal.mark_on_the_way();
            }
            if !(last && arrived) {
                found.s = (k as f64 + found.s) / legs as f64;
            }
            if let Some(before) = &total {
                found = found.after(before);
            }
            nodes.clone_from(&found.extremal.nodes);
            total = Some(found);
            if !arrived {
                break;
            }
        }
        total.ok_or(ShootingError::Argument(ArgumentError::Length {
            argument: "stages",
            expected: 2,
            found: stages.len(),
        }))
    }

    /// Follows `family` from nodes that solve the member s = 0; `fractions` ascend from 0 to 1.
    pub fn follow<S: VectorField + Sync>(
        &self,
        family: impl Fn(f64) -> Member<S>,
        fractions: &[f64],
        start: &[DVector<f64>],
    ) -> Result<ContinuationResult, ShootingError> {
        self.follow_within(&self.polish.limits.start(), Stage::Family, family, fractions, start)
    }

    /// The same as a part, `stage`, of a search that has begun.
    pub(crate) fn follow_within<S: VectorField + Sync>(
        &self,
        budget: &Budget,
        stage: Stage,
        family: impl Fn(f64) -> Member<S>,
        fractions: &[f64],
        start: &[DVector<f64>],
    ) -> Result<ContinuationResult, ShootingError> {
        self.polish.check_tolerance()?;
        let solve = |shooting: &MultipleShooting, s: f64, guess: &[DVector<f64>]| {
            let member = family(s);
            let times: Vec<f64> = fractions.iter().map(|f| f * member.horizon).collect();
            shooting.solve_within(budget, &member.system, &member.ends, &times, guess)
        };
        let mut best = solve(&self.on_the_way, 0.0, start)?;
        let (mut s, mut step, mut steps) = (0.0, self.first_step, [0, 0]);
        let (mut iterations, mut work) = (best.iterations, best.work);
        let mut before: Option<(f64, Vec<DVector<f64>>)> = None;
        let mut reason = reason_of(&best, budget);
        while s < 1.0 && reason.is_none() {
            let target = if s + 1.01 * step >= 1.0 { 1.0 } else { s + step };
            let guess: Vec<_> = match &before {
                Some((at, nodes)) => {
                    let ratio = (target - s) / (s - at);
                    best.nodes.iter().zip(nodes).map(|(p, q)| p + (p - q) * ratio).collect()
                }
                None => best.nodes.clone(),
            };
            let found = solve(&self.on_the_way, target, &guess);
            if let Ok(found) = &found {
                iterations += found.iterations;
                work += found.work;
            }
            match found.map(|found| (reason_of(&found, budget), found)) {
                Ok((None, found)) => {
                    steps[0] += 1;
                    step *= match found.iterations {
                        0..=2 => 1.6,
                        3 => 1.2,
                        4.. => 0.9,
                    };
                    before = Some((s, std::mem::replace(&mut best, found).nodes));
                    s = target;
                }
                refused => {
                    steps[1] += 1;
                    step = 0.5 * (target - s);
                    if step < self.min_step || budget.reached().is_some() {
                        reason = Some(match refused {
                            Ok((why, found)) => why.unwrap_or(Reason::Unsolved(found.status)),
                            Err(error) => reason_of_error(error, budget),
                        });
                    }
                }
            }
        }
        if reason.is_none() {
            match solve(&self.polish, 1.0, &best.nodes) {
                Ok(polished) => {
                    iterations += polished.iterations;
                    work += polished.work;
                    reason = reason_of(&polished, budget);
                    best = polished;
                }
                Err(error) => reason = Some(reason_of_error(error, budget)),
            }
        }
        if s < 1.0 || reason.is_some() {
            best.mark_on_the_way();
        }
        Ok(ContinuationResult { extremal: best, s, stage, reason, steps, iterations, work })
    }
}

/// Why a member does not count as solved; none if it does.
fn reason_of(found: &Extremal, budget: &Budget) -> Option<Reason> {
    match (found.status, budget.reached()) {
        (ShootingStatus::Converged, _) => None,
        (ShootingStatus::LimitReached, Some(limit)) => Some(Reason::Limit(limit)),
        (status, _) => Some(Reason::Unsolved(status)),
    }
}

fn reason_of_error(error: ShootingError, budget: &Budget) -> Reason {
    match (error, budget.reached()) {
        (ShootingError::Guess { source: FlowError::LimitReached { limit, .. }, .. }, _)
        | (_, Some(limit)) => Reason::Limit(limit),
        (error, None) => Reason::Failed(error),
    }
}

/// Part of its terms that the field of a rest may have: what a rounded angle leaves.
const STILL: f64 = 1e-6;

/// The node of a rest, with λ = 0.
///
/// The field there is checked against what it would be if terms of it did not cancel, Σ |Dᵢⱼ| sⱼ with s the largest values of
/// the states in all stages, so that units do not matter.
fn rest_of<S: VectorField>(system: &S, stages: &[[Vec<f64>; 2]]) -> Result<DVector<f64>, ShootingError> {
    let [initial, last] = &stages[0];
    let n = system.dimension() / 2;
    let states = |of: &dyn Fn(usize) -> f64| DVector::from_fn(2 * n, |i, _| if i < n { of(i) } else { 0.0 });
    let at_rest = states(&|i| initial[i]);
    if initial != last {
        return Err(ShootingError::NoRest { rate: f64::INFINITY });
    }
    let (field, jacobian) = system.linearize(at_rest.as_slice());
    let reach = states(&|i| stages.iter().flatten().fold(0.0, |m: f64, x| m.max(x[i].abs())));
    let terms = jacobian.abs() * reach;
    // a field without a value is told by the first motion
    match field.iter().map(|h| h.abs()).zip(&terms).find(|(rate, terms)| *rate > STILL * **terms) {
        Some((rate, _)) => Err(ShootingError::NoRest { rate }),
        None => Ok(at_rest),
    }
}
