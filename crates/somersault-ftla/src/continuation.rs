//! Families of extremals: from a problem whose solution is known to the one that is wanted.
//!
//! A family gives for each s in [0, 1] a system, end conditions and a horizon; node times are kept as fractions of the
//! horizon. Solutions are followed from s = 0, where a rest at an equilibrium will often do, by secants and Newton's method,
//! in steps that grow where Newton is quick and are halved where it fails.

use crate::flow::Work;
use crate::shooting::{End, Extremal, Shooting, ShootingError, Status};
use crate::system::VectorField;
use nalgebra::SVector;

/// One member of a family.
#[derive(Debug, Clone, PartialEq)]
pub struct Member<S, const N: usize> {
    /// The system.
    pub system: S,
    /// Conditions at both ends.
    pub ends: [End<N>; 2],
    /// Time between them.
    pub horizon: f64,
}

/// Where a continuation ended.
#[derive(Debug, Clone, PartialEq)]
pub struct Continued<const N: usize> {
    /// The last solution; its status tells whether it was polished where `s` = 1.
    pub extremal: Extremal<N>,
    /// How far that solution is on the way, over all stages: one if the continuation arrived.
    pub s: f64,
    /// Members solved, and tried in vain.
    pub steps: [usize; 2],
    /// Newton steps of all of them.
    pub iterations: usize,
    /// What all of them cost.
    pub work: Work,
}

impl<const N: usize> Continued<N> {
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
    /// For the last member.
    pub polish: Shooting,
    /// For the members on the way.
    pub on_the_way: Shooting,
    /// First step in s.
    pub first_step: f64,
    /// Steps in s shorter than this end the continuation.
    pub min_step: f64,
}

impl Default for Continuation {
    /// Members on the way to 1e-4 in at most 6 Newton steps, first step 0.1, shortest 1e-4.
    fn default() -> Self {
        let polish = Shooting::default();
        let on_the_way = Shooting {
            tolerance: 1e-4,
            max_iterations: 6,
            flow: crate::flow::Tolerances { relative: 1e-7, absolute: 1e-9 },
        };
        Self { polish, on_the_way, first_step: 0.1, min_step: 1e-4 }
    }
}

impl Continuation {
    /// Leads a system from rest to given end states through pairs of end states on the way, straight from one to the next.
    ///
    /// The first pair must be a rest: the same state at both ends, at which staying without control costs nothing, so that
    /// λ = 0 solves it. For an arm that folds the stages are to rest folded, to travel folded, and to unfold at the ends.
    pub fn through<S: VectorField<N> + Sync + Clone, const N: usize>(
        &self,
        system: &S,
        stages: &[[Vec<f64>; 2]],
        horizon: f64,
        fractions: &[f64],
    ) -> Result<Continued<N>, ShootingError> {
        if stages.len() < 2 {
            return Err(ShootingError::Length { argument: "stages", expected: 2, found: stages.len() });
        }
        for end in stages.iter().flatten() {
            if end.len() != N / 2 {
                let (expected, found) = (N / 2, end.len());
                return Err(ShootingError::Length { argument: "stages", expected, found });
            }
            if let Some(&found) = end.iter().find(|x| !x.is_finite()) {
                return Err(ShootingError::Argument { argument: "stages", allowed: "finite", found });
            }
        }
        let at_rest = rest_of(system, &stages[0])?;
        let mut nodes = vec![at_rest; fractions.len()];
        let mut total: Option<Continued<N>> = None;
        for (k, pair) in stages.windows(2).enumerate() {
            let ends = |s: f64| {
                let mix = |end: usize| {
                    let between = pair[0][end].iter().zip(&pair[1][end]).map(|(a, b)| a + s * (b - a));
                    End::from_values(between)
                };
                [mix(0), mix(1)]
            };
            let last = k + 2 == stages.len();
            let stage = Self { polish: if last { self.polish } else { self.on_the_way }, ..*self };
            let family = |s: f64| Member { system: system.clone(), ends: ends(s), horizon };
            let mut found = stage.follow(family, fractions, &nodes)?;
            let arrived = found.s == 1.0 && found.extremal.status == Status::Converged;
            if !last {
                found.extremal.mark_on_the_way();
            }
            if !(last && arrived) {
                found.s = (k as f64 + found.s) / (stages.len() - 1) as f64;
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
        total.ok_or(ShootingError::Length { argument: "stages", expected: 2, found: stages.len() })
    }

    /// Follows `family` from nodes that solve the member s = 0; `fractions` ascend from 0 to 1.
    pub fn follow<S: VectorField<N> + Sync, const N: usize>(
        &self,
        family: impl Fn(f64) -> Member<S, N>,
        fractions: &[f64],
        start: &[SVector<f64, N>],
    ) -> Result<Continued<N>, ShootingError> {
        let solve = |shooting: &Shooting, s: f64, guess: &[SVector<f64, N>]| {
            let member = family(s);
            let times: Vec<f64> = fractions.iter().map(|f| f * member.horizon).collect();
            shooting.solve(&member.system, &member.ends, &times, guess)
        };
        let mut best = solve(&self.on_the_way, 0.0, start)?;
        let (mut s, mut step, mut steps) = (0.0, self.first_step, [0, 0]);
        let (mut iterations, mut work) = (best.iterations, best.work);
        let mut before: Option<(f64, Vec<SVector<f64, N>>)> = None;
        while s < 1.0 && best.status == Status::Converged {
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
            match found {
                Ok(found) if found.status == Status::Converged => {
                    steps[0] += 1;
                    step *= match found.iterations {
                        0..=2 => 1.6,
                        3 => 1.2,
                        _ => 0.9,
                    };
                    before = Some((s, std::mem::replace(&mut best, found).nodes));
                    s = target;
                }
                _ => {
                    steps[1] += 1;
                    step = 0.5 * (target - s);
                    if step < self.min_step {
                        break;
                    }
                }
            }
        }
        if s == 1.0 {
            best = solve(&self.polish, 1.0, &best.nodes)?;
            iterations += best.iterations;
            work += best.work;
        } else {
            best.mark_on_the_way();
        }
        Ok(Continued { extremal: best, s, steps, iterations, work })
    }
}

/// How fast a rest may move, in units of the state per second: what a rounded angle leaves.
const STILL: f64 = 1e-6;

/// The node of a rest, with λ = 0.
fn rest_of<S: VectorField<N>, const N: usize>(
    system: &S,
    [initial, last]: &[Vec<f64>; 2],
) -> Result<SVector<f64, N>, ShootingError> {
    let at_rest = SVector::from_fn(|i, _| if i < N / 2 { initial[i] } else { 0.0 });
    let rate = if initial == last { system.field(&at_rest).amax() } else { f64::INFINITY };
    // a field without a value is told by the first motion
    if rate > STILL { Err(ShootingError::NoRest { rate }) } else { Ok(at_rest) }
}
