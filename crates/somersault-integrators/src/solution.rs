//! What a recording observer leaves.

use crate::dense::Interpolant;
use crate::driver::{Flow, Observer, Step};
use crate::state::{Configuration, State};
use somersault_core::argument::{ArgumentError, expect_finite, expect_least};

/// Times, states and, if requested, the curves between them. The curves are not written to files.
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(
        try_from = "Parts<Q>",
        bound(
            serialize = "Q: serde::Serialize, Q::Rate: serde::Serialize",
            deserialize = "Q: serde::Deserialize<'de>, Q::Rate: serde::Deserialize<'de>"
        )
    )
)]
pub struct Solution<Q: Configuration> {
    /// Times recorded, the initial one first unless they were given.
    pub times: Vec<f64>,
    /// States at those times.
    pub states: Vec<State<Q>>,
    /// The end of each step and its curve, where dense output was requested.
    #[cfg_attr(feature = "serde", serde(skip))]
    pub segments: Vec<(f64, Box<dyn Interpolant<Q>>)>,
}

/// A solution as files hold it.
#[cfg(feature = "serde")]
#[derive(serde::Deserialize)]
#[serde(bound = "Q: serde::Deserialize<'de>, Q::Rate: serde::Deserialize<'de>")]
struct Parts<Q: Configuration> {
    times: Vec<f64>,
    states: Vec<State<Q>>,
}

#[cfg(feature = "serde")]
impl<Q: Configuration> TryFrom<Parts<Q>> for Solution<Q> {
    type Error = &'static str;

    fn try_from(Parts { times, states }: Parts<Q>) -> Result<Self, Self::Error> {
        if times.is_empty() || times.len() != states.len() {
            return Err("`times` and `states` must be as many as each other, and one at least");
        }
        Ok(Self { times, states, segments: Vec::new() })
    }
}

impl<Q: Configuration> Solution<Q> {
    /// The first and the last time that the curves reach; where there are none, the first time twice.
    pub fn span(&self) -> Option<(f64, f64)> {
        let first = *self.times.first()?;
        Some((first, self.segments.last().map_or(first, |(end, _)| *end)))
    }

    /// The state at time `t` from the dense output.
    ///
    /// `None` where there is no dense output or `t` lies outside the recorded interval.
    pub fn at(&self, t: f64) -> Option<State<Q>> {
        self.segments.last()?;
        let (first, last) = self.span()?;
        if !(first.min(last)..=first.max(last)).contains(&t) {
            return None;
        }
        let is_forward = first <= last;
        let i = self.segments.partition_point(|(end, _)| if is_forward { *end < t } else { *end > t });
        let mut out = self.states.first()?.clone();
        self.segments[i].1.evaluate(t, &mut out);
        Some(out)
    }
}

/// Errors unless times to record, at least one, are finite, within an interval from start to end, and each after the one before in its
/// direction.
pub fn check_times((start, end): (f64, f64), t_eval: &[f64]) -> Result<(), ArgumentError> {
    let argument = "t_eval";
    expect_least(argument, t_eval.len(), 1)?;
    for &found in t_eval {
        expect_finite(argument, [&found])?;
        if !(start.min(end)..=start.max(end)).contains(&found) {
            return Err(ArgumentError::OutOfRange { argument, allowed: "within `interval`", found });
        }
    }
    let is_late = |pair: &&[f64]| (pair[1] - pair[0]) * (end - start) <= 0.0;
    match t_eval.windows(2).find(is_late) {
        Some(pair) => {
            let allowed = "times that follow each other in the direction of the run";
            Err(ArgumentError::OutOfRange { argument, allowed, found: pair[1] })
        }
        None => Ok(()),
    }
}

/// Which states a recorder keeps.
enum Kept<Q: Configuration> {
    /// Those after each so many steps, and the last.
    Every { every: u64, pending: Option<(f64, State<Q>)> },
    /// Those at times, of which so many are passed.
    At { times: Vec<f64>, passed: usize },
}

/// Records every n-th step or the states at given times, and the curves of all steps if dense output is wanted.
pub struct Recorder<Q: Configuration> {
    kept: Kept<Q>,
    dense: bool,
    solution: Solution<Q>,
}

impl<Q: Configuration> Recorder<Q> {
    /// A recorder that starts from `state` at `t` and keeps each `every`-th step (0 is taken as 1).
    pub fn new(t: f64, state: &State<Q>, every: u64) -> Self {
        let solution = Solution { times: vec![t], states: vec![state.clone()], segments: Vec::new() };
        Self { kept: Kept::Every { every: every.max(1), pending: None }, dense: false, solution }
    }

    /// A recorder of the states at times within an interval that starts from `state`: see [`Step::states_at`].
    ///
    /// A run that ends early leaves those up to its end. Errors with [`check_times`].
    pub fn at_times(interval: (f64, f64), state: &State<Q>, t_eval: Vec<f64>) -> Result<Self, ArgumentError> {
        check_times(interval, &t_eval)?;
        let (start, _) = interval;
        let passed = usize::from(t_eval[0] == start);
        let (times, states) =
            if passed == 1 { (vec![start], vec![state.clone()]) } else { Default::default() };
        let solution = Solution { times, states, segments: Vec::new() };
        Ok(Self { kept: Kept::At { times: t_eval, passed }, dense: false, solution })
    }

    /// Keeps the curves as well.
    pub fn with_dense_output(mut self) -> Self {
        self.dense = true;
        self
    }

    /// What was recorded; the last step is always part of it, unless it is of given times.
    pub fn into_solution(mut self) -> Solution<Q> {
        if let Kept::Every { pending: Some((t, state)), .. } = self.kept {
            self.solution.times.push(t);
            self.solution.states.push(state);
        }
        self.solution
    }
}

impl<Q: Configuration> Observer<Q> for Recorder<Q> {
    fn observe(&mut self, step: &mut Step<'_, Q>) -> Flow {
        match &mut self.kept {
            Kept::Every { every, pending } if step.index.is_multiple_of(*every) => {
                self.solution.times.push(step.t_after);
                self.solution.states.push(step.after.clone());
                *pending = None;
            }
            Kept::Every { pending: Some((t, state)), .. } => {
                *t = step.t_after;
                state.assign(step.after);
            }
            Kept::Every { pending, .. } => *pending = Some((step.t_after, step.after.clone())),
            Kept::At { times, passed } => {
                let (t, is_forward) = (step.t_after, step.t_after > step.t_before);
                let ahead = &times[*passed..];
                let within =
                    ahead.iter().take_while(|time| if is_forward { **time <= t } else { **time >= t });
                let within = &ahead[..within.count()];
                if !within.is_empty() {
                    self.solution.states.extend(step.states_at(within));
                    self.solution.times.extend(within);
                    *passed += within.len();
                }
            }
        }
        if self.dense {
            self.solution.segments.push((step.t_after, step.interpolant()));
        }
        Flow::Continue
    }
}

/// Both observers see every step, the second what the first keeps of it; either may stop the run.
#[deny(clippy::missing_trait_methods)]
impl<Q: Configuration, A: Observer<Q>, B: Observer<Q>> Observer<Q> for (A, B) {
    fn is_active(&self) -> bool {
        self.0.is_active() || self.1.is_active()
    }
    fn observe(&mut self, step: &mut Step<'_, Q>) -> Flow {
        let (a, b) = (self.0.observe(step), step.show(&mut self.1));
        if a == Flow::Stop || b == Flow::Stop { Flow::Stop } else { Flow::Continue }
    }
}
