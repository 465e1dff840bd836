//! The record of a run for the backward pass of the adjoint: its events, the stages of a step that is made again, and the states
//! before its steps.

use super::differentiable::Differentiable;
use crate::laws::ContactMode;
use crate::linearized::{At, Linearized};
use somersault_integrators::augmented::{Augmented, AugmentedRate};
use somersault_integrators::state::{Configuration as _, Rate as _, State};
use somersault_multibody::motion::{Coordinates, Rates};
use std::collections::TryReserveError;

/// A state with stretches.
type StateOf<S> = State<Augmented<<S as Linearized>::Moved>>;

/// A passage from one mode to another.
#[derive(Debug)]
pub(super) struct Passage<S: Differentiable> {
    pub(super) t: f64,
    /// Before and after.
    pub(super) modes: (Vec<ContactMode>, Vec<ContactMode>),
    /// The state before the jump.
    pub(super) state: StateOf<S>,
}

/// The stages of a step, in their order.
#[derive(Debug)]
pub(super) struct Stages<S: Differentiable> {
    /// Room for them, of which so many are in use.
    points: Vec<(f64, StateOf<S>)>,
    count: usize,
    is_noting: bool,
}

impl<S: Differentiable> Stages<S> {
    /// Begins to note stages.
    pub(super) fn begin(&mut self) {
        (self.count, self.is_noting) = (0, true);
    }

    /// Ends it.
    pub(super) fn end(&mut self) {
        self.is_noting = false;
    }

    /// Those noted, with their times.
    pub(super) fn points(&self) -> &[(f64, StateOf<S>)] {
        &self.points[..self.count]
    }

    /// Notes a stage, where there is room.
    pub(super) fn note(&mut self, t: f64, (q, p): At<'_, S>) {
        if !self.is_noting {
            return;
        }
        if let Some((time, state)) = self.points.get_mut(self.count) {
            *time = t;
            state.configuration.assign(q);
            state.rate.assign(p);
            self.count += 1;
        }
    }
}

/// The events of a run, and room for stages.
#[derive(Debug)]
pub(super) struct Record<S: Differentiable> {
    pub(super) passages: Vec<Passage<S>>,
    pub(super) stages: Stages<S>,
}

impl<S: Differentiable> Record<S> {
    /// For a method of so many stages, and states of the size of `x`.
    pub(super) fn new(stages: usize, x: &StateOf<S>) -> Self {
        let points = vec![(0.0, x.clone()); stages];
        Self { passages: Vec::new(), stages: Stages { points, count: 0, is_noting: false } }
    }
}

/// Configuration and rate of a tree with stretches.
type OfTree<'a> = (&'a Augmented<Coordinates>, &'a AugmentedRate<Rates>);

/// The steps of a run of a tree: when each began and ended, and the state before it, all states in one vector.
#[derive(Debug, Default)]
pub(super) struct Steps {
    times: Vec<[f64; 2]>,
    numbers: Vec<f64>,
}

impl Steps {
    /// Reserves memory for so many more, of states of the size of `x`.
    pub(super) fn reserve(&mut self, steps: usize, x: OfTree<'_>) -> Result<(), TryReserveError> {
        self.times.try_reserve(steps)?;
        self.numbers.try_reserve(steps.saturating_mul(size(x)))
    }

    /// Appends a step; fails where there is no memory.
    pub(super) fn push(&mut self, times: [f64; 2], before: OfTree<'_>) -> Result<(), TryReserveError> {
        self.reserve(1, before)?;
        let (q, p) = before;
        self.times.push(times);
        self.numbers.extend_from_slice(q.0.as_slice());
        self.numbers.extend_from_slice(p.base.as_slice());
        self.numbers.extend(p.variables.iter().flatten());
        Ok(())
    }

    /// How many there are.
    pub(super) fn len(&self) -> usize {
        self.times.len()
    }

    /// When step `k` began and ended; out ← the state before it.
    pub(super) fn read(
        &self,
        k: usize,
        (q, p): (&mut Augmented<Coordinates>, &mut AugmentedRate<Rates>),
    ) -> [f64; 2] {
        let size = size((q, p));
        let (of_q, of_p) = self.numbers[k * size..][..size].split_at(q.0.as_slice().len());
        q.0.read(of_q);
        p.read(of_p);
        self.times[k]
    }
}

/// The number of numbers of a state.
fn size((q, p): OfTree<'_>) -> usize {
    q.0.as_slice().len() + p.dimension()
}
