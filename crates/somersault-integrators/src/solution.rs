//! What a recording observer leaves.

use crate::dense::Interpolant;
use crate::driver::{Flow, Observer, Step};
use crate::state::{Configuration, State};

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
    /// Times recorded, the initial one first.
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
    /// The state at time `t` from the dense output.
    ///
    /// `None` where there is no dense output or `t` lies outside the recorded interval.
    pub fn at(&self, t: f64) -> Option<State<Q>> {
        let (first, last) = (*self.times.first()?, self.segments.last()?.0);
        if !(first..=last).contains(&t) {
            return None;
        }
        let i = self.segments.partition_point(|(end, _)| *end < t);
        let mut out = self.states.first()?.clone();
        self.segments[i].1.evaluate(t, &mut out);
        Some(out)
    }
}

/// Records every n-th step, and the curves of all steps if dense output is wanted.
pub struct Recorder<Q: Configuration> {
    every: u64,
    dense: bool,
    pending: Option<(f64, State<Q>)>,
    solution: Solution<Q>,
}

impl<Q: Configuration> Recorder<Q> {
    /// A recorder that starts from `state` at `t` and keeps each `every`-th step (0 is taken as 1).
    pub fn new(t: f64, state: &State<Q>, every: u64) -> Self {
        let solution = Solution { times: vec![t], states: vec![state.clone()], segments: Vec::new() };
        Self { every: every.max(1), dense: false, pending: None, solution }
    }

    /// Keeps the curves as well.
    pub fn with_dense_output(mut self) -> Self {
        self.dense = true;
        self
    }

    /// What was recorded; the last step is always part of it.
    pub fn into_solution(mut self) -> Solution<Q> {
        if let Some((t, state)) = self.pending.take() {
            self.solution.times.push(t);
            self.solution.states.push(state);
        }
        self.solution
    }
}

impl<Q: Configuration> Observer<Q> for Recorder<Q> {
    fn observe(&mut self, step: &mut Step<'_, Q>) -> Flow {
        if step.index.is_multiple_of(self.every) {
            self.solution.times.push(step.t_after);
            self.solution.states.push(step.after.clone());
            self.pending = None;
        } else if let Some((t, state)) = &mut self.pending {
            *t = step.t_after;
            state.assign(step.after);
        } else {
            self.pending = Some((step.t_after, step.after.clone()));
        }
        if self.dense {
            self.solution.segments.push((step.t_after, step.interpolant()));
        }
        Flow::Continue
    }
}

/// Both observers see every step; either may stop the run.
#[deny(clippy::missing_trait_methods)]
impl<Q: Configuration, A: Observer<Q>, B: Observer<Q>> Observer<Q> for (A, B) {
    fn is_active(&self) -> bool {
        self.0.is_active() || self.1.is_active()
    }
    fn observe(&mut self, step: &mut Step<'_, Q>) -> Flow {
        let (a, b) = (self.0.observe(step), self.1.observe(step));
        if a == Flow::Stop || b == Flow::Stop { Flow::Stop } else { Flow::Continue }
    }
}
