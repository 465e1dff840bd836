//! An optimal control problem as it is posed.
//!
//! ```text
//! minimise   Σ over phases  Φ(x(t₀), x(t_f), p, t₀, t_f) + ∫ L(x, u, p, t) dt
//! subject to ẋ = f(x, u, p, t),  path constraints g, end constraints b, bounds, linkages between phases
//! ```

use super::bounds::PhaseBounds;
use super::error::{CollocationError, Entry, Untraced, expect_length};
use super::function::{
    ByDuals, Dynamics, DynamicsFormula, EndFormula, PathFormula, Sizes, Terms, VectorFunction,
};
use super::guess::Guess;
use super::interval::{Interval, NO_BOUND};
use super::linkage::{End, Linkage, Place, Quantity};
use super::objective::Objective;
use super::quaternions::{self, AtUnitQuaternions, EndRow, EndRows};
use super::shared::Shared;
use super::stacked::Stacked;
use super::traced::TracedFunction;
use super::tree::TreeDynamics;
use somersault_core::argument::expect_positive;
use somersault_expr::{ExprError, ExprFunction};
use std::sync::Arc;

/// Size below which the entries of a vector are zero but for rounding, in m, rad, N, or by seconds.
const ROUNDING: f64 = 1e-9;

/// A stretch of time with its equations, costs, constraints and bounds.
///
/// All is free until it is bounded; the horizon is [0, 1] until it is set.
pub struct Phase {
    pub(super) sizes: Sizes,
    pub(super) dynamics: Shared,
    /// L, then g.
    pub(super) path: Objective,
    /// Φ, then b.
    pub(super) ends: Objective,
    pub(crate) bounds: PhaseBounds,
    pub(super) scales: Scales,
    /// Where x has quaternions.
    pub(super) quaternions: Vec<usize>,
    /// States, then controls, that are of one size.
    vectors: [Vec<Vec<usize>>; 2],
    pub(super) guess: Option<Guess>,
    /// The tree that moves, if the first states are its own.
    tree: Option<TreeDynamics>,
    names: Names,
    /// Whether the guess, and scales of states and controls, were given.
    given: [bool; 3],
}

/// What entries of states and controls are, where that is known.
#[derive(Debug, Clone, PartialEq, Default)]
struct Names {
    states: Vec<String>,
    controls: Vec<String>,
}

impl Names {
    fn of(&self, argument: &str, index: usize) -> Entry {
        let names = match argument {
            "state_bounds" | "initial_state" | "final_state" => &self.states,
            "control_bounds" => &self.controls,
            _ => return Entry { index, name: None },
        };
        Entry { index, name: names.get(index).cloned() }
    }
}

/// Where a phase started from, and its scales.
pub(crate) struct PhaseStart {
    guess: Option<Guess>,
    scales: Scales,
}

/// Sizes by which variables and rows are divided; zero where the size is to be found.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Scales {
    pub(super) state: Vec<f64>,
    pub(super) control: Vec<f64>,
}

impl Phase {
    /// Equations and terms written over a generic scalar.
    pub fn new(dynamics: impl Dynamics + 'static, terms: impl Terms + 'static) -> Self {
        let sizes = Sizes {
            states: dynamics.n_states(),
            controls: dynamics.n_controls(),
            parameters: dynamics.n_parameters(),
        };
        let dynamics = ByDuals::new(DynamicsFormula(dynamics, sizes), sizes.point());
        Self::assemble(sizes, Box::new(dynamics), terms)
    }

    /// A tree of bodies, x = (q, v), with terms over a generic scalar, which see quaternions of unit norm.
    pub fn of_tree(dynamics: TreeDynamics, terms: impl Terms + 'static) -> Self {
        let sizes = Sizes { states: dynamics.n_states(), controls: dynamics.n_controls(), parameters: 0 };
        let names = Names { states: dynamics.state_names(), controls: dynamics.control_names() };
        let (quaternions, vectors) = (dynamics.quaternions(), dynamics.vectors());
        let tree = Some(dynamics.clone());
        Self { names, tree, quaternions, vectors, ..Self::assemble(sizes, Box::new(dynamics), terms) }
    }

    /// A tree of bodies and states beside it: x = (q, v, y), with ẏ = `further` over (x, u, p, t).
    pub fn of_tree_with(
        dynamics: TreeDynamics,
        further: Box<dyn VectorFunction>,
        n_parameters: usize,
        terms: impl Terms + 'static,
    ) -> Self {
        let (n, controls) = (dynamics.n_states(), dynamics.n_controls());
        let states = n + further.n_outputs();
        let sizes = Sizes { states, controls, parameters: n_parameters };
        let places = (0..n).chain(states..states + controls).collect();
        let (quaternions, vectors) = (dynamics.quaternions(), dynamics.vectors());
        let further: Box<dyn VectorFunction> = if quaternions.is_empty() {
            further
        } else {
            Box::new(AtUnitQuaternions::new(further, sizes.point(), quaternions.clone()))
        };
        let tree = Some(dynamics.clone());
        let parts: Vec<(Box<dyn VectorFunction>, Vec<usize>)> =
            vec![(Box::new(dynamics), places), (further, (0..sizes.point()).collect())];
        Self { tree, quaternions, vectors, ..Self::assemble(sizes, Box::new(Stacked::new(parts)), terms) }
    }

    /// Equations of motion f(x, u, p, t) that bring their derivatives; as many states as outputs.
    pub fn with_derivatives(
        dynamics: Box<dyn VectorFunction>,
        n_controls: usize,
        n_parameters: usize,
        terms: impl Terms + 'static,
    ) -> Self {
        let sizes = Sizes { states: dynamics.n_outputs(), controls: n_controls, parameters: n_parameters };
        Self::assemble(sizes, dynamics, terms)
    }

    /// Functions traced into graphs: f over (x, u, p, t), as many states as outputs; L, then path constraints, over the same; Φ,
    /// then end constraints, over (x(t₀), x(t_f), p, t₀, t_f).
    pub fn try_traced(
        [dynamics, path, ends]: [&ExprFunction; 3],
        n_controls: usize,
        n_parameters: usize,
    ) -> Result<Self, CollocationError> {
        let sizes = Sizes { states: dynamics.n_outputs(), controls: n_controls, parameters: n_parameters };
        for (argument, function, expected) in [
            ("inputs of the dynamics", dynamics, sizes.point()),
            ("inputs of the path", path, sizes.point()),
            ("inputs of the ends", ends, sizes.ends()),
        ] {
            expect_length(None, argument, function.n_inputs(), expected)?;
        }
        for (argument, function) in [("outputs of the path", path), ("outputs of the ends", ends)] {
            if function.n_outputs() == 0 {
                return Err(CollocationError::Length { phase: None, argument, expected: 1, found: 0 });
            }
        }
        let boxed = |function| Ok::<_, ExprError>(Box::new(TracedFunction::try_new(function)?));
        Ok(Self::with_derivatives(boxed(dynamics)?, n_controls, n_parameters, ())
            .terms_with_derivatives(boxed(path)?, boxed(ends)?))
    }

    /// The functions as expressions that hold near a point (x, u, p, t) and near ends: f, then L and g, then Φ and b.
    pub fn expressions(&self, point: &[f64], ends: &[f64]) -> Result<[ExprFunction; 3], Untraced> {
        let [dynamics, path, of_ends] = self.functions();
        Ok([dynamics.expressions(point)?, path.expressions(point)?, of_ends.expressions(ends)?])
    }

    /// The same near the middle and the ends of the guess that a [`Problem`] gives every phase; none before.
    pub fn expressions_of_guess(&self) -> Option<Result<[ExprFunction; 3], Untraced>> {
        let Guess { times, states, controls, parameters } = self.guess.as_ref()?;
        let (middle, last) = (times.len() / 2, times.len() - 1);
        let point = [&states[middle][..], &controls[middle], parameters, &times[middle..=middle]].concat();
        let ends = [&states[0][..], &states[last], parameters, &[times[0], times[last]]].concat();
        Some(self.expressions(&point, &ends))
    }

    /// The numbers of the states that quaternions begin at.
    pub fn quaternion_places(&self) -> &[usize] {
        &self.quaternions
    }

    /// The tree that moves, if the states are its own and others after them.
    pub fn tree(&self) -> Option<&TreeDynamics> {
        self.tree.as_ref()
    }

    /// The functions as they were posed: f, then L and g, then Φ and b.
    pub(crate) fn functions(&self) -> [Shared; 3] {
        [self.dynamics.clone(), self.path.posed(), self.ends.posed()]
    }

    /// Whether it came with a guess.
    pub(crate) fn is_guessed(&self) -> bool {
        self.given[0]
    }

    /// Starts from another guess, of which scales follow that were not given; returns what takes it back.
    pub(crate) fn exchange_start(&mut self, guess: Guess) -> Result<PhaseStart, CollocationError> {
        guess.validate(None, &self.sizes)?;
        let before = PhaseStart { guess: self.guess.replace(guess), scales: self.scales.clone() };
        let [_, state, control] = self.given;
        if !state {
            self.scales.state.clear();
        }
        if !control {
            self.scales.control.clear();
        }
        if let Some(guess) = &mut self.guess {
            if !self.quaternions.is_empty() {
                quaternions::complete(&self.quaternions, guess, &self.bounds);
            }
            self.scales.complete(None, guess, &self.bounds, &self.quaternions, &self.vectors)?;
        }
        Ok(before)
    }

    /// Starts where it did before.
    pub(crate) fn restore_start(&mut self, before: PhaseStart) {
        (self.guess, self.scales) = (before.guess, before.scales);
    }

    /// Where a search starts.
    pub(crate) fn start(&self) -> Option<&Guess> {
        self.guess.as_ref()
    }

    /// Names of states and controls, for errors and messages.
    pub fn names(mut self, states: impl Into<Vec<String>>, controls: impl Into<Vec<String>>) -> Self {
        self.names = Names { states: states.into(), controls: controls.into() };
        self
    }

    fn assemble(sizes: Sizes, dynamics: Box<dyn VectorFunction>, terms: impl Terms + 'static) -> Self {
        let terms = Arc::new(terms);
        let free = |n: usize| vec![Interval::FREE; n];
        let bounds = PhaseBounds {
            state: free(sizes.states),
            control: free(sizes.controls),
            parameters: free(sizes.parameters),
            initial_state: free(sizes.states),
            final_state: free(sizes.states),
            initial_time: Interval::fixed(0.0),
            final_time: Interval::fixed(1.0),
            path: free(terms.n_path_constraints()),
            end: free(terms.n_end_constraints()),
        };
        Self {
            sizes,
            dynamics: Shared::new(dynamics),
            path: Objective::new(Box::new(ByDuals::new(PathFormula(terms.clone(), sizes), sizes.point()))),
            ends: Objective::new(Box::new(ByDuals::new(EndFormula(terms, sizes), sizes.ends()))),
            bounds,
            scales: Scales { state: Vec::new(), control: Vec::new() },
            quaternions: Vec::new(),
            vectors: [Vec::new(), Vec::new()],
            guess: None,
            tree: None,
            names: Names::default(),
            given: [false; 3],
        }
    }

    /// Costs and constraints that bring their derivatives: L, then path constraints, over (x, u, p, t); Φ, then end constraints,
    /// over (x(t₀), x(t_f), p, t₀, t_f). They replace those that the phase was made with, and their bounds are free.
    pub fn terms_with_derivatives(
        mut self,
        path: Box<dyn VectorFunction>,
        ends: Box<dyn VectorFunction>,
    ) -> Self {
        let free = |n: usize| vec![Interval::FREE; n.saturating_sub(1)];
        (self.bounds.path, self.bounds.end) = (free(path.n_outputs()), free(ends.n_outputs()));
        (self.path, self.ends) = (Objective::new(path), Objective::new(ends));
        self
    }

    /// Where four states each are a quaternion (x, y, z, w), by the number of the first of them. Its direction is what counts: costs
    /// and constraints are evaluated at unit norm, ends that are given mean q and −q alike, and guesses turn the shorter way. The equations of
    /// motion must keep the norm, and not depend on it, as [those of a tree](TreeDynamics) do.
    pub fn quaternions(mut self, first: impl Into<Vec<usize>>) -> Self {
        self.quaternions = first.into();
        self
    }

    /// States and controls that begin with those of a tree, which has quaternions and vectors among them.
    pub fn beginning_with(self, tree: &TreeDynamics) -> Self {
        Self { vectors: tree.vectors(), ..self.quaternions(tree.quaternions()) }
    }

    /// Bounds of x at all times, one for each state.
    pub fn state_bounds(mut self, bounds: impl Into<Vec<Interval>>) -> Self {
        self.bounds.state = bounds.into();
        self
    }

    /// Bounds of u, one for each control.
    pub fn control_bounds(mut self, bounds: impl Into<Vec<Interval>>) -> Self {
        self.bounds.control = bounds.into();
        self
    }

    /// Bounds of p.
    pub fn parameter_bounds(mut self, bounds: impl Into<Vec<Interval>>) -> Self {
        self.bounds.parameters = bounds.into();
        self
    }

    /// What x(t₀) may be: fixed, bounded or free in each state.
    pub fn initial_state<I: Into<Interval>>(mut self, bounds: impl IntoIterator<Item = I>) -> Self {
        self.bounds.initial_state = bounds.into_iter().map(Into::into).collect();
        self
    }

    /// What x(t_f) may be.
    pub fn final_state<I: Into<Interval>>(mut self, bounds: impl IntoIterator<Item = I>) -> Self {
        self.bounds.final_state = bounds.into_iter().map(Into::into).collect();
        self
    }

    /// What t₀ and t_f may be.
    pub fn horizon(mut self, start: impl Into<Interval>, end: impl Into<Interval>) -> Self {
        self.bounds.initial_time = start.into();
        self.bounds.final_time = end.into();
        self
    }

    /// Bounds of the path constraints g.
    pub fn path_bounds(mut self, bounds: impl Into<Vec<Interval>>) -> Self {
        self.bounds.path = bounds.into();
        self
    }

    /// Bounds of the end constraints b.
    pub fn end_bounds(mut self, bounds: impl Into<Vec<Interval>>) -> Self {
        self.bounds.end = bounds.into();
        self
    }

    /// Sizes of states and controls, by which the program is scaled. Without them, sizes are those of the guess.
    pub fn scales(mut self, state: impl Into<Vec<f64>>, control: impl Into<Vec<f64>>) -> Self {
        self.scales = Scales { state: state.into(), control: control.into() };
        self
    }

    /// Where the search starts. Without one it is a straight line between the ends, controls at zero.
    pub fn guess(mut self, guess: Guess) -> Self {
        self.guess = Some(guess);
        self
    }

    /// Length of x.
    pub fn n_states(&self) -> usize {
        self.sizes.states
    }

    /// Length of u.
    pub fn n_controls(&self) -> usize {
        self.sizes.controls
    }

    /// Length of p.
    pub fn n_parameters(&self) -> usize {
        self.sizes.parameters
    }

    /// What is bounded.
    pub fn bounds(&self) -> &PhaseBounds {
        &self.bounds
    }

    /// What a row is that has bounds at all times, by its number: states, controls, then path constraints.
    pub fn name_of_row(&self, row: usize) -> String {
        let Sizes { states, controls, .. } = self.sizes;
        let (kind, k, names) = if row < states {
            ("state", row, &self.names.states)
        } else if row < states + controls {
            ("control", row - states, &self.names.controls)
        } else {
            return format!("path constraint {}", row - states - controls);
        };
        names.get(k).cloned().unwrap_or_else(|| format!("{kind} {k}"))
    }

    /// Whether bounds leave one value to everything, on any mesh.
    fn is_fixed(&self) -> bool {
        let PhaseBounds { state, control, parameters, initial_time, final_time, .. } = &self.bounds;
        let all = [state, control, parameters].into_iter().flatten().chain([initial_time, final_time]);
        all.into_iter().all(Interval::is_fixed)
    }

    /// Whether the bounds of the horizon allow it.
    fn may_run_backwards(&self) -> bool {
        self.bounds.initial_time.upper > self.bounds.final_time.lower
    }

    /// Checks bounds and lengths, narrows the ends to the bounds of the state and completes guess and scales. Gives rows that ends of
    /// quaternions need; `is_linked` says of a state whether an earlier phase leads to it.
    fn validate(
        &mut self,
        phase: Option<usize>,
        is_linked: impl Fn(usize) -> bool,
    ) -> Result<Vec<EndRow>, CollocationError> {
        let Sizes { states, controls, parameters } = self.sizes;
        let (n_path, n_end) = (self.path.n_outputs() - 1, self.ends.n_outputs() - 1);
        let (bounds, names) = (&mut self.bounds, &self.names);
        for (argument, given, expected) in [
            ("state_bounds", &bounds.state, states),
            ("control_bounds", &bounds.control, controls),
            ("parameter_bounds", &bounds.parameters, parameters),
            ("initial_state", &bounds.initial_state, states),
            ("final_state", &bounds.final_state, states),
            ("path_bounds", &bounds.path, n_path),
            ("end_bounds", &bounds.end, n_end),
        ] {
            expect_length(phase, argument, given.len(), expected)?;
            for (entry, interval) in given.iter().enumerate() {
                let Interval { lower, upper } = *interval;
                if !interval.is_possible() {
                    let entry = names.of(argument, entry);
                    return Err(CollocationError::Bounds { phase, argument, entry, lower, upper });
                }
            }
        }
        let (start, end) = (bounds.initial_time, bounds.final_time);
        for (entry, interval) in [start, end].into_iter().enumerate() {
            let Interval { lower, upper } = interval;
            if !interval.is_possible() {
                let entry = Entry { index: entry, name: Some(["start", "end"][entry].to_owned()) };
                return Err(CollocationError::Bounds { phase, argument: "horizon", entry, lower, upper });
            }
        }
        if start.lower >= end.upper {
            return Err(CollocationError::Horizon { phase, start: start.lower, end: end.upper });
        }
        let (mut rows, mut taken) = (Vec::new(), vec![false; states]);
        for &first in &self.quaternions {
            let Some(own) =
                taken.get_mut(first..first + quaternions::WIDTH).filter(|own| !own.contains(&true))
            else {
                return Err(CollocationError::Quaternions { phase, found: first });
            };
            own.fill(true);
        }
        if let Some(guess) = &self.guess {
            guess.validate(phase, &self.sizes)?;
        }
        for &first in &self.quaternions {
            let not_unit = |argument, norm| {
                let entry = names.of(argument, first);
                CollocationError::NotUnit { phase, argument, entry, norm }
            };
            rows.extend(quaternions::pose(bounds, first, self.guess.as_ref(), is_linked(first), not_unit)?);
        }
        for entry in 0..states {
            for (argument, ends) in
                [("initial_state", &mut bounds.initial_state), ("final_state", &mut bounds.final_state)]
            {
                let (found, Interval { lower, upper }) = (ends[entry], bounds.state[entry]);
                ends[entry] = found.intersection(&bounds.state[entry]);
                if ends[entry].lower > ends[entry].upper {
                    let entry = names.of(argument, entry);
                    return Err(CollocationError::BoundaryOutside {
                        phase,
                        argument,
                        entry,
                        found,
                        lower,
                        upper,
                    });
                }
            }
        }
        let all = &self.quaternions;
        self.given = [self.guess.is_some(), !self.scales.state.is_empty(), !self.scales.control.is_empty()];
        let guess = self.guess.get_or_insert_with(|| Guess::straight(bounds, all));
        guess.validate(phase, &self.sizes)?;
        if !all.is_empty() {
            quaternions::complete(all, guess, bounds);
        }
        self.scales.complete(phase, guess, bounds, all, &self.vectors)?;
        all.iter().for_each(|&first| quaternions::free_length(bounds, first));
        Ok(rows)
    }

    /// The phase with functions that see quaternions of unit norm, and rows of its ends.
    fn at_unit_quaternions(mut self, rows: Vec<EndRow>) -> Self {
        if self.quaternions.is_empty() {
            return self;
        }
        let Self { sizes, quaternions, .. } = &self;
        let (sizes, at_point) = (*sizes, quaternions.clone());
        let further = quaternions.iter().map(|first| sizes.states + first);
        let at_ends: Vec<usize> = quaternions.iter().copied().chain(further).collect();
        self.bounds.end.extend(rows.iter().map(EndRow::bound));
        self.path =
            self.path.map(|function| Box::new(AtUnitQuaternions::new(function, sizes.point(), at_point)));
        self.ends = self.ends.map(|function| {
            let own = Box::new(AtUnitQuaternions::new(function, sizes.ends(), at_ends));
            let states = (0..2 * sizes.states).collect();
            Box::new(Stacked::new(vec![
                (own, (0..sizes.ends()).collect()),
                (Box::new(EndRows(rows)), states),
            ]))
        });
        self
    }
}

impl Scales {
    /// Fills in what was not given: the largest of finite bounds and guess, of all entries of a vector together; 1 where all of them are
    /// zero.
    fn complete(
        &mut self,
        phase: Option<usize>,
        guess: &Guess,
        bounds: &PhaseBounds,
        quaternions: &[usize],
        vectors: &[Vec<Vec<usize>>; 2],
    ) -> Result<(), CollocationError> {
        let size = |rows: &[Vec<f64>], entry: usize, intervals: &[&Interval]| {
            let numbers = intervals.iter().flat_map(|i| [i.lower, i.upper]).filter(|x| x.abs() < NO_BOUND);
            rows.iter().map(|row| row[entry]).chain(numbers).fold(0.0, |m: f64, x| m.max(x.abs()))
        };
        let or_one = |mut sizes: Vec<f64>, vectors: &[Vec<usize>]| {
            for vector in vectors {
                let largest = vector.iter().fold(0.0, |m: f64, &i| m.max(sizes[i]));
                vector.iter().for_each(|&i| sizes[i] = if largest > ROUNDING { largest } else { 0.0 });
            }
            sizes.iter_mut().filter(|size| **size == 0.0).for_each(|size| *size = 1.0);
            sizes
        };
        if self.state.is_empty() {
            let ends = |j: usize| [&bounds.state[j], &bounds.initial_state[j], &bounds.final_state[j]];
            let sizes = (0..bounds.state.len()).map(|j| size(&guess.states, j, &ends(j))).collect();
            self.state = or_one(sizes, &vectors[0]);
            quaternions::set_sizes(quaternions, &mut self.state);
        }
        if self.control.is_empty() {
            let controls = bounds.control.iter().enumerate();
            let sizes = controls.map(|(j, bound)| size(&guess.controls, j, &[bound])).collect();
            self.control = or_one(sizes, &vectors[1]);
        }
        expect_length(phase, "scales of states", self.state.len(), bounds.state.len())?;
        expect_length(phase, "scales of controls", self.control.len(), bounds.control.len())?;
        for scale in self.state.iter().chain(&self.control) {
            expect_positive("scales", *scale)?;
        }
        Ok(())
    }
}

/// Gives an orientation at which a phase starts to the end of the phase that leads there: as four fixed numbers it would fix the norm
/// that the earlier phase leads to.
fn pass_on(phases: &mut [Phase], Linkage { left, right, difference }: &Linkage) {
    let (Quantity::State(from), Quantity::State(to)) = (left.quantity, right.quantity) else { return };
    let is_onward = left.end == End::Finish && right.end == End::Start && left.phase < right.phase;
    if !is_onward || *difference != Interval::fixed(0.0) {
        return;
    }
    let Some((before, after)) = phases.split_at_mut_checked(right.phase) else { return };
    let (Some(before), Some(after)) = (before.get_mut(left.phase), after.first_mut()) else { return };
    if !before.quaternions.contains(&from) || !after.quaternions.contains(&to) {
        return;
    }
    let own = to..to + quaternions::WIDTH;
    let ends = (
        before.bounds.final_state.get_mut(from..from + quaternions::WIDTH),
        after.bounds.initial_state.get_mut(own.clone()),
        after.bounds.state.get(own),
    );
    let (Some(end), Some(start), Some(allowed)) = ends else { return };
    let is_given = |intervals: &[Interval]| intervals.iter().all(Interval::is_fixed);
    if is_given(start) && (!is_given(end) || quaternions::are_alike(end, start)) {
        end.copy_from_slice(start);
        start.copy_from_slice(allowed);
    }
}

/// Gives the guess of a phase that sign of a quaternion with which the phase before it ends.
fn face(phases: &mut [Phase], Linkage { left, right, .. }: &Linkage) {
    let (Quantity::State(from), Quantity::State(to)) = (left.quantity, right.quantity) else { return };
    if left.phase >= right.phase || left.end != End::Finish || right.end != End::Start {
        return;
    }
    let [before, after] = [left, right].map(|place| phases[place.phase].guess.as_ref());
    let (Some(before), Some(after)) = (before, after) else { return };
    let (Some(before), Some(after)) = (before.states.last(), after.states.first()) else { return };
    let is_given = phases[right.phase].bounds.initial_state[to].is_fixed();
    let is_quaternion = [(left.phase, from), (right.phase, to)]
        .iter()
        .all(|(phase, first)| phases[*phase].quaternions.contains(first));
    if is_quaternion && !is_given && quaternions::are_opposite(&before[from..], &after[to..]) {
        let rows = phases[right.phase].guess.iter_mut().flat_map(|guess| &mut guess.states);
        rows.for_each(|row| row[to..to + quaternions::WIDTH].iter_mut().for_each(|x| *x = -*x));
    }
}

/// One or several phases.
pub struct Problem {
    pub(crate) phases: Vec<Phase>,
    pub(super) linkages: Vec<Linkage>,
}

impl Problem {
    /// A problem of one phase.
    pub fn try_new(phase: Phase) -> Result<Self, CollocationError> {
        Self::try_of_phases(vec![phase], Vec::new())
    }

    /// A problem of several phases, whose costs are added.
    pub fn try_of_phases(
        mut phases: Vec<Phase>,
        mut linkages: Vec<Linkage>,
    ) -> Result<Self, CollocationError> {
        if phases.is_empty() {
            return Err(CollocationError::NoPhase);
        }
        let several = phases.len() > 1;
        linkages.iter().for_each(|linkage| pass_on(&mut phases, linkage));
        let mut posed = Vec::with_capacity(phases.len());
        for (number, mut phase) in phases.into_iter().enumerate() {
            let is_linked = |state| {
                let (at_start, leads) = (Quantity::State(state), End::Finish);
                let is_start = |place: &Place| {
                    place.phase == number && place.end == End::Start && place.quantity == at_start
                };
                let is_before = |place: &Place| place.phase < number && place.end == leads;
                linkages.iter().any(|Linkage { left, right, .. }| {
                    is_start(left) && is_before(right) || is_start(right) && is_before(left)
                })
            };
            let rows = phase.validate(several.then_some(number), is_linked)?;
            posed.push(phase.at_unit_quaternions(rows));
        }
        let mut phases = posed;
        if phases.iter().all(Phase::is_fixed) {
            return Err(CollocationError::NothingFree);
        }
        for (linkage, Linkage { left, right, difference }) in linkages.iter().enumerate() {
            for place in [left, right] {
                let exists = phases.get(place.phase).is_some_and(|phase| match place.quantity {
                    Quantity::State(i) => i < phase.sizes.states,
                    Quantity::Time => true,
                    Quantity::Parameter(i) => i < phase.sizes.parameters,
                });
                if !exists {
                    return Err(CollocationError::Linkage { linkage, what: format!("{place:?}") });
                }
            }
            if !difference.is_possible() {
                return Err(CollocationError::Linkage {
                    linkage,
                    what: format!("the difference {difference:?}"),
                });
            }
        }
        linkages.iter().for_each(|linkage| face(&mut phases, linkage));
        linkages.extend((0..phases.len()).filter(|&k| phases[k].may_run_backwards()).map(Linkage::forward));
        Ok(Self { phases, linkages })
    }

    /// The phases.
    pub fn phases(&self) -> &[Phase] {
        &self.phases
    }

    /// Number of phases.
    pub fn n_phases(&self) -> usize {
        self.phases.len()
    }
}
