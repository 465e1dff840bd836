//! Where each quantity has its place: among all variables of a problem, and among those that are free.

use super::function::Sizes;
use super::interval::Interval;
use super::linkage::{End, Place, Quantity};
use super::mesh::Grid;
use super::problem::{Phase, Problem};
use somersault_nlp::Bounds;

/// Place of the quantities of one phase among all variables: x and u of each point, x at the end, t₀, t_f, p.
#[derive(Debug, Clone, Copy)]
pub(super) struct PhaseLayout {
    first: usize,
    sizes: Sizes,
    n_points: usize,
}

impl PhaseLayout {
    /// x at point `i`; `n_points` is the end.
    pub(super) fn state(&self, i: usize) -> usize {
        self.first + i * (self.sizes.states + self.sizes.controls)
    }

    /// u at point `i`.
    pub(super) fn control(&self, i: usize) -> usize {
        self.state(i) + self.sizes.states
    }

    /// t₀; t_f follows.
    pub(super) fn times(&self) -> usize {
        self.state(self.n_points) + self.sizes.states
    }

    pub(super) fn parameters(&self) -> usize {
        self.times() + 2
    }

    fn end(&self) -> usize {
        self.parameters() + self.sizes.parameters
    }

    /// Place of entry `a` of (x, u, p) at point `i`.
    pub(super) fn argument(&self, i: usize, a: usize) -> usize {
        let at_point = self.sizes.states + self.sizes.controls;
        if a < at_point { self.state(i) + a } else { self.parameters() + a - at_point }
    }

    /// Place of entry `a` of (x(t₀), x(t_f), p, t₀, t_f).
    pub(super) fn end_argument(&self, a: usize) -> usize {
        let Sizes { states, parameters, .. } = self.sizes;
        match a {
            _ if a < states => self.state(0) + a,
            _ if a < 2 * states => self.state(self.n_points) + a - states,
            _ if a < 2 * states + parameters => self.parameters() + a - 2 * states,
            _ => self.times() + a - 2 * states - parameters,
        }
    }

    pub(super) fn place(&self, place: &Place) -> usize {
        match (place.quantity, place.end) {
            (Quantity::State(i), End::Start) => self.state(0) + i,
            (Quantity::State(i), End::Finish) => self.state(self.n_points) + i,
            (Quantity::Time, End::Start) => self.times(),
            (Quantity::Time, End::Finish) => self.times() + 1,
            (Quantity::Parameter(i), _) => self.parameters() + i,
        }
    }
}

/// All variables: their values, scales and bounds, and which of them are decided.
#[derive(Debug, Clone)]
pub(super) struct Variables {
    pub(super) phases: Vec<PhaseLayout>,
    /// Of all variables, in the units of the user; times are those since `origin`.
    pub(super) values: Vec<f64>,
    /// Where times are counted from: far from zero they would lose the digits of durations.
    pub(super) origin: f64,
    pub(super) scales: Vec<f64>,
    /// Numbers of the variables that are not fixed.
    pub(super) free: Vec<usize>,
    /// Place of each variable among those, if it is one.
    pub(super) place: Vec<Option<usize>>,
    /// Of the free variables, scaled.
    pub(super) bounds: Bounds,
}

impl Variables {
    /// Those that are fixed are decided too where `keeps_fixed`, within bounds that are equal.
    pub(super) fn new(problem: &Problem, grids: &[Grid], keeps_fixed: bool) -> Self {
        let mut phases: Vec<PhaseLayout> = Vec::new();
        let origin = problem.phases.first().map_or(0.0, |phase| phase.bounds.initial_time.clamp(0.0));
        let (mut intervals, mut scales) = (Vec::new(), Vec::new());
        for (phase, grid) in problem.phases.iter().zip(grids) {
            let layout =
                PhaseLayout { first: intervals.len(), sizes: phase.sizes, n_points: grid.n_points() };
            intervals.extend(phase_intervals(phase, grid.n_points(), origin));
            scales.extend(phase_scales(phase, grid.n_points()));
            debug_assert_eq!(layout.end(), intervals.len());
            phases.push(layout);
        }
        let (mut free, mut bounds) = (Vec::new(), Bounds::default());
        let mut values = vec![0.0; intervals.len()];
        let mut place = vec![None; intervals.len()];
        for (i, interval) in intervals.iter().enumerate() {
            if interval.is_fixed() {
                values[i] = interval.lower;
            }
            if keeps_fixed || !interval.is_fixed() {
                place[i] = Some(free.len());
                free.push(i);
                bounds.push(interval.lower / scales[i], interval.upper / scales[i]);
            }
        }
        Self { phases, values, origin, scales, free, place, bounds }
    }

    /// Takes over the decision vector.
    pub(super) fn assign(&mut self, z: &[f64]) {
        for (&i, z) in self.free.iter().zip(z) {
            self.values[i] = z * self.scales[i];
        }
    }

    /// The decision vector that `values` is.
    pub(super) fn decision(&self) -> Vec<f64> {
        self.free.iter().map(|&i| self.values[i] / self.scales[i]).collect()
    }
}

fn phase_intervals(phase: &Phase, n_points: usize, origin: f64) -> Vec<Interval> {
    let bounds = &phase.bounds;
    let mut all = Vec::new();
    for i in 0..n_points {
        all.extend(if i == 0 { &bounds.initial_state } else { &bounds.state });
        all.extend(&bounds.control);
    }
    all.extend(&bounds.final_state);
    let since = |time: Interval| Interval::new(time.lower - origin, time.upper - origin);
    all.extend([since(bounds.initial_time), since(bounds.final_time)]);
    all.extend(&bounds.parameters);
    all
}

fn phase_scales(phase: &Phase, n_points: usize) -> Vec<f64> {
    let scales = &phase.scales;
    let mut all = Vec::new();
    for _ in 0..n_points {
        all.extend(&scales.state);
        all.extend(&scales.control);
    }
    all.extend(&scales.state);
    all.resize(all.len() + 2 + phase.sizes.parameters, 1.0);
    all
}
