//! What a solved program says about the motion: states, controls, costates, Hamiltonian.
//!
//! The multipliers y of the defects give the costates (covector mapping, Garg et al. 2011): λ_i = −y_i/w_i at the
//! points and λ = −Σ_l D_{l,N+1} y_l at the last node of an interval. With H = L + λᵀf the costates obey
//! λ̇ = −∂H/∂x, and the cost is least along the motion where H is, over the controls.

use super::bounds::PhaseBounds;
use super::error::{CollocationError, expect_length};
use super::function::VectorFunction;
use super::guess::Guess;
use super::horizon::Horizon;
use super::layout::PhaseLayout;
use super::mesh::{Grid, GridInterval, Mesh};
use super::transcription::Transcription;
use somersault_nlp::{Nlp, Report, Start, Structure};
use std::ops::Deref;

/// Distance of a time to its bound, relative to its size, at which that holds it.
const AT_BOUND: f64 = 1e-6;
/// Slope of the cost along a time, relative to its terms, at which it falls.
const FALLING: f64 = 1e-3;
/// Power of the time with which a cost may fall: more is what solvers leave of a cost that is zero.
const POWER: f64 = 1e3;

/// One phase of a solution. Rows belong to the collocation points in the order of time; states, costates and
/// times have the end of the phase as a last row.
#[derive(Debug, Clone)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(try_from = "Parts", into = "Parts")
)]
pub struct PhaseSolution {
    pub(super) grid: Grid,
    pub(super) horizon: Horizon,
    /// t.
    pub times: Vec<f64>,
    rows: PhaseRows,
}

impl Deref for PhaseSolution {
    type Target = PhaseRows;

    fn deref(&self) -> &PhaseRows {
        &self.rows
    }
}

/// Rows of a [`PhaseSolution`], or those to be put on a mesh.
#[derive(Debug, Clone, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct PhaseRows {
    /// x; quaternions have norm 1 to the tolerance.
    pub states: Vec<Vec<f64>>,
    /// u; nothing is collocated at the end.
    pub controls: Vec<Vec<f64>>,
    /// λ; [`Model::derivatives_along`](somersault_multibody::Model::derivatives_along) makes covectors of displacements of those of q.
    pub costates: Vec<Vec<f64>>,
    /// Multipliers of the path constraints as functions of time: positive at upper bounds.
    pub path_multipliers: Vec<Vec<f64>>,
    /// L + λᵀf at the collocation points.
    pub hamiltonian: Vec<f64>,
    /// p.
    pub parameters: Vec<f64>,
}

/// A solution as files hold it.
#[cfg(feature = "serde")]
#[derive(serde::Serialize, serde::Deserialize)]
struct Parts {
    mesh: Mesh,
    horizon: (f64, f64),
    rows: PhaseRows,
}

#[cfg(feature = "serde")]
impl From<PhaseSolution> for Parts {
    fn from(PhaseSolution { grid, horizon, rows, .. }: PhaseSolution) -> Self {
        Self { mesh: grid.mesh, horizon: horizon.ends(), rows }
    }
}

#[cfg(feature = "serde")]
impl TryFrom<Parts> for PhaseSolution {
    type Error = CollocationError;

    fn try_from(Parts { mesh, horizon, rows }: Parts) -> Result<Self, CollocationError> {
        Self::try_new(mesh, horizon, rows)
    }
}

impl PhaseSolution {
    /// Other values of a control at the collocation points.
    pub(super) fn set_control(&mut self, control: usize, values: impl Iterator<Item = f64>) {
        self.rows.controls.iter_mut().zip(values).for_each(|(row, value)| row[control] = value);
    }

    /// A solution from its rows, one that was stored, say.
    pub fn try_new(mesh: Mesh, horizon: (f64, f64), rows: PhaseRows) -> Result<Self, CollocationError> {
        let (start, end) = horizon;
        // a NaN is not below
        if !(start < end && start.is_finite() && end.is_finite()) {
            return Err(CollocationError::Horizon { phase: None, start, end });
        }
        let grid = Grid::try_new(mesh)?;
        let n = grid.n_points();
        let PhaseRows { states, controls, costates, path_multipliers, hamiltonian, .. } = &rows;
        for (argument, table, expected) in [
            ("states", states, n + 1),
            ("controls", controls, n),
            ("costates", costates, n + 1),
            ("path_multipliers", path_multipliers, n),
        ] {
            expect_length(None, argument, table.len(), expected)?;
            let width = table.first().map_or(0, Vec::len);
            for row in table {
                expect_length(None, argument, row.len(), width)?;
            }
        }
        expect_length(None, "costates", costates[0].len(), states[0].len())?;
        expect_length(None, "hamiltonian", hamiltonian.len(), n)?;
        let horizon = Horizon::since(0.0, start, end);
        let mut solution = Self { grid, horizon, times: Vec::new(), rows };
        solution.times = solution.times_of_nodes();
        Ok(solution)
    }

    /// Times of the points and of the end.
    fn times_of_nodes(&self) -> Vec<f64> {
        self.grid.fractions.iter().chain([&1.0]).map(|&fraction| self.horizon.time(fraction)).collect()
    }

    /// t₀ and t_f.
    pub fn horizon(&self) -> (f64, f64) {
        self.horizon.ends()
    }

    /// The part of the duration that has passed at each node, and the number of its interval.
    pub(crate) fn places(&self) -> Vec<(f64, usize)> {
        let intervals = self.grid.intervals.iter().enumerate();
        intervals
            .flat_map(|(k, interval)| interval.points().map(move |i| (self.grid.fractions[i], k)))
            .collect()
    }

    /// The part of ∫ dt that each point stands for.
    pub(crate) fn measures(&self) -> Vec<f64> {
        let duration = self.horizon.duration();
        let intervals = self.grid.intervals.iter();
        let of = |interval: &GridInterval, i| 0.5 * duration * interval.length * interval.weight(i);
        intervals.flat_map(|interval| interval.points().map(move |i| of(interval, i))).collect()
    }

    /// x, u and λ where a fraction of the duration has passed.
    pub(crate) fn at_fraction(&self, fraction: f64) -> [Vec<f64>; 3] {
        let (k, tau) = self.grid.locate(fraction);
        let GridInterval { radau, first, .. } = &self.grid.intervals[k];
        let (mut with_end, mut without) = (vec![0.0; radau.len() + 1], vec![0.0; radau.len()]);
        radau.state_basis(tau, &mut with_end);
        radau.control_basis(tau, &mut without);
        let tables = [(&self.states, &with_end), (&self.controls, &without), (&self.costates, &with_end)];
        tables.map(|(table, basis)| {
            let mut row = vec![0.0; table[0].len()];
            combine(&table[*first..], basis, &mut row);
            row
        })
    }

    /// The mesh.
    pub fn mesh(&self) -> &Mesh {
        &self.grid.mesh
    }

    /// Largest minus smallest Hamiltonian: zero for equations and costs that do not name the time.
    pub fn hamiltonian_spread(&self) -> f64 {
        let (least, most) = self
            .hamiltonian
            .iter()
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), &h| (a.min(h), b.max(h)));
        most - least
    }

    /// The mean over time.
    pub(super) fn mean_hamiltonian(&self) -> f64 {
        let intervals = self.grid.intervals.iter();
        let parts = intervals.flat_map(|interval| {
            let points = interval.points().zip(interval.radau.weights());
            points.map(|(i, w)| 0.5 * interval.length * w * self.hamiltonian[i])
        });
        parts.sum()
    }

    /// x at t, by the polynomials of collocation. Times outside of the horizon count as its ends.
    pub fn state(&self, t: f64) -> Vec<f64> {
        let mut state = vec![0.0; self.states[0].len()];
        self.with_basis(t, true, |first, basis| combine(&self.states[first..], basis, &mut state));
        state
    }

    /// u at t.
    pub fn control(&self, t: f64) -> Vec<f64> {
        let mut control = vec![0.0; self.controls[0].len()];
        self.with_basis(t, false, |first, basis| combine(&self.controls[first..], basis, &mut control));
        control
    }

    /// λ at t.
    pub fn costate(&self, t: f64) -> Vec<f64> {
        let mut costate = vec![0.0; self.costates[0].len()];
        self.with_basis(t, true, |first, basis| combine(&self.costates[first..], basis, &mut costate));
        costate
    }

    fn with_basis(&self, t: f64, with_end: bool, use_basis: impl FnOnce(usize, &[f64])) {
        let (k, tau) = self.grid.locate(self.horizon.fraction(t).clamp(0.0, 1.0));
        let GridInterval { radau, first, .. } = &self.grid.intervals[k];
        let mut basis = vec![0.0; radau.len() + usize::from(with_end)];
        if with_end {
            radau.state_basis(tau, &mut basis);
        } else {
            radau.control_basis(tau, &mut basis);
        }
        use_basis(*first, &basis);
    }

    /// The solution as a guess, to start another problem from.
    pub fn to_guess(&self) -> Guess {
        let end = self.control(self.horizon.ends().1);
        Guess {
            times: self.times.clone(),
            states: self.states.clone(),
            controls: self.controls.iter().cloned().chain([end]).collect(),
            parameters: self.parameters.clone(),
        }
    }
}

/// out = Σ basisᵢ rowᵢ.
pub(super) fn combine(rows: &[Vec<f64>], basis: &[f64], out: &mut [f64]) {
    out.fill(0.0);
    for (row, b) in rows.iter().zip(basis) {
        out.iter_mut().zip(row).for_each(|(o, x)| *o += b * x);
    }
}

impl Transcription<'_> {
    /// What a decision vector and the multipliers of the constraints stand for.
    pub fn solution(
        &mut self,
        z: &[f64],
        multipliers: &[f64],
    ) -> Result<Vec<PhaseSolution>, CollocationError> {
        let mut constraints = vec![0.0; self.row_scales.len()];
        self.evaluate(z, &mut constraints)?;
        Ok(self.phase_solutions(multipliers))
    }

    /// The same where functions are not to be called any more: the Hamiltonian is NaN.
    pub(super) fn unevaluated(&mut self, z: &[f64], multipliers: &[f64]) -> Vec<PhaseSolution> {
        self.variables.assign(z);
        let mut phases = self.phase_solutions(multipliers);
        phases.iter_mut().for_each(|phase| phase.rows.hamiltonian.fill(f64::NAN));
        phases
    }

    fn phase_solutions(&self, multipliers: &[f64]) -> Vec<PhaseSolution> {
        let mut row = 0;
        let mut phases = Vec::new();
        for k in 0..self.grids.len() {
            phases.push(self.phase_solution(k, row, multipliers));
            row += self.n_rows(k);
        }
        phases
    }

    /// Multipliers of the bounds of all variables at a solution, in units of this transcription: what stationarity lacks at those that a
    /// bound holds.
    pub(crate) fn bound_multipliers(
        &mut self,
        solution: &[PhaseSolution],
        program: &Report,
    ) -> Result<Vec<f64>, CollocationError> {
        let Start { z, constraint_multipliers, .. } = self.repeated(solution, program)?;
        let rows = self.row_scales.len();
        expect_length(None, "multipliers of the solution", constraint_multipliers.len(), rows)?;
        let (mut constraints, mut slope) = (vec![0.0; rows], vec![0.0; z.len()]);
        let mut jacobian = vec![0.0; self.structure().jacobian.n_entries()];
        self.evaluate(&z, &mut constraints)?;
        self.differentiate(&z, &mut slope, &mut jacobian)?;
        let Structure { jacobian: pattern, variables, .. } = self.structure();
        pattern.add_transposed_product(&jacobian, &constraint_multipliers, &mut slope);
        for (i, slope) in slope.iter_mut().enumerate() {
            let bound = if *slope > 0.0 { variables.lower[i] } else { variables.upper[i] };
            *slope = if (z[i] - bound).abs() < slope.abs() { -*slope } else { 0.0 };
        }
        Ok(slope)
    }

    /// Multipliers of the bounds of the states of phase `k`, at each node, from those of all variables; in units of the cost
    /// by those of the state.
    pub(crate) fn state_multipliers(&self, k: usize, bound_multipliers: &[f64]) -> Vec<Vec<f64>> {
        let (layout, sizes) = (&self.variables.phases[k], self.problem.phases[k].sizes);
        let multiplier = |variable: usize| {
            let place = self.variables.place[variable];
            place.map_or(0.0, |column| bound_multipliers[column] / self.variables.scales[variable])
        };
        let PhaseBounds { state, initial_state, .. } = &self.problem.phases[k].bounds;
        // what holds the start alone is no bound of the motion
        let is_held = |i: usize, s: usize| i > 0 || initial_state[s] == state[s];
        let at = |i: usize, s: usize| if is_held(i, s) { multiplier(layout.state(i) + s) } else { 0.0 };
        let at_node = |i: usize| (0..sizes.states).map(|s| at(i, s)).collect();
        (0..=self.grids[k].n_points()).map(at_node).collect()
    }

    /// Whether the cost still falls along a time that its bounds leave free: whether the slope of the Lagrangian is not small
    /// beside the terms that it is the sum of.
    pub(super) fn time_runs_away(
        &mut self,
        z: &[f64],
        multipliers: &[f64],
    ) -> Result<bool, CollocationError> {
        let mut constraints = vec![0.0; self.row_scales.len()];
        let mut gradient = vec![0.0; z.len()];
        let mut jacobian = vec![0.0; self.structure().jacobian.n_entries()];
        let cost = self.evaluate(z, &mut constraints)?;
        self.differentiate(z, &mut gradient, &mut jacobian)?;
        let pattern = &self.structure().jacobian;
        let runs = |layout: &PhaseLayout, variable: usize| {
            let Some(column) = self.variables.place[variable] else { return false };
            let values = &self.variables.values;
            let (time, bounds) = (values[variable], &self.structure().variables);
            let margin = AT_BOUND * (1.0 + time.abs());
            if time - bounds.lower[column] < margin || bounds.upper[column] - time < margin {
                return false;
            }
            let entries = pattern.columns[column]..pattern.columns[column + 1];
            let parts = entries.map(|at| jacobian[at] * multipliers[pattern.rows[at]]);
            let (sum, size) = parts
                .fold((gradient[column], gradient[column].abs()), |(sum, size), x| (sum + x, size + x.abs()));
            let duration = values[layout.times() + 1] - values[layout.times()];
            sum.abs() > FALLING * size && duration * sum.abs() < POWER * cost.abs()
        };
        let mut phases = self.variables.phases.iter();
        Ok(phases.any(|layout| (0..2).any(|end| runs(layout, layout.times() + end))))
    }

    /// λ at the points and the end of phase `k`, whose rows begin at `row`.
    pub(super) fn costates(&self, k: usize, row: usize, multipliers: &[f64]) -> Vec<Vec<f64>> {
        let (grid, states) = (&self.grids[k], self.problem.phases[k].sizes.states);
        let covector = |i: usize, s: usize| {
            let row = row + i * states + s;
            multipliers[row] / self.row_scales[row]
        };
        let mut costates: Vec<Vec<f64>> = Vec::with_capacity(grid.n_points() + 1);
        for interval in &grid.intervals {
            for i in interval.points() {
                let weight = interval.weight(i);
                costates.push((0..states).map(|s| -covector(i, s) / weight).collect());
            }
        }
        let last = &grid.intervals[grid.intervals.len() - 1];
        let end_column = last.radau.differentiation().column(last.radau.len());
        let at_end = |s: usize| -> f64 {
            last.points().zip(end_column.iter()).map(|(i, d)| -d * covector(i, s)).sum()
        };
        costates.push((0..states).map(at_end).collect());
        costates
    }

    fn phase_solution(&self, k: usize, row: usize, multipliers: &[f64]) -> PhaseSolution {
        let (grid, layout, values) = (&self.grids[k], &self.variables.phases[k], &self.variables.values);
        let sizes = self.problem.phases[k].sizes;
        let n = grid.n_points();
        let slice = |first: usize, length: usize| values[first..first + length].to_vec();
        let origin = self.variables.origin;
        let horizon = Horizon::since(origin, values[layout.times()], values[layout.times() + 1]);
        let duration = horizon.duration();
        let costates = self.costates(k, row, multipliers);
        let mut path_multipliers = Vec::with_capacity(n);
        let n_path = self.problem.phases[k].path.n_outputs() - 1;
        let path_row = row + n * sizes.states;
        for interval in &grid.intervals {
            for i in interval.points() {
                let measure = 0.5 * duration * interval.length * interval.weight(i);
                let at_point = &multipliers[path_row + i * n_path..path_row + (i + 1) * n_path];
                path_multipliers.push(at_point.iter().map(|y| y / measure).collect());
            }
        }
        let (rates, costs) = self.rates_and_costs(k);
        let hamiltonian = (0..n)
            .map(|i| {
                let along = costates[i].iter().zip(&rates[i * sizes.states..]).map(|(l, f)| l * f);
                costs[i * (n_path + 1)] + along.sum::<f64>()
            })
            .collect();
        let rows = PhaseRows {
            states: (0..=n).map(|i| slice(layout.state(i), sizes.states)).collect(),
            controls: (0..n).map(|i| slice(layout.control(i), sizes.controls)).collect(),
            costates,
            path_multipliers,
            hamiltonian,
            parameters: slice(layout.parameters(), sizes.parameters),
        };
        let mut solution = PhaseSolution { grid: grid.clone(), horizon, times: Vec::new(), rows };
        solution.times = solution.times_of_nodes();
        solution
    }

    /// A start at the solution of a like problem on the same meshes, with its multipliers where constraints are as many.
    pub(super) fn repeated(
        &mut self,
        from: &[PhaseSolution],
        program: &Report,
    ) -> Result<Start, CollocationError> {
        let guesses: Vec<Guess> = from.iter().map(PhaseSolution::to_guess).collect();
        for (k, guess) in guesses.iter().enumerate() {
            guess.validate((guesses.len() > 1).then_some(k), &self.problem.phases[k].sizes)?;
        }
        if program.constraint_multipliers.len() != self.row_scales.len() {
            return Ok(self.start(&guesses).into());
        }
        Ok(self.continued(from, &self.rest(&program.constraint_multipliers)))
    }

    /// Decision vector and multipliers that continue from solutions, on another mesh or the same; `rest` are the multipliers of
    /// what does not depend on the mesh, the end constraints of each phase and the linkages.
    pub(super) fn continued(&mut self, from: &[PhaseSolution], rest: &RestMultipliers) -> Start {
        let mut multipliers = Vec::with_capacity(self.row_scales.len());
        for (k, solution) in from.iter().enumerate() {
            let (layout, n) = (self.variables.phases[k], self.grids[k].n_points());
            let mut path = Vec::new();
            let is_same = solution.grid.mesh == self.grids[k].mesh;
            for number in 0..self.grids[k].intervals.len() {
                let interval = self.grids[k].intervals[number].clone();
                for i in interval.points() {
                    let row = if is_same {
                        let PhaseRows { states, controls, costates, path_multipliers, .. } = &solution.rows;
                        [&states[i], &controls[i], &costates[i], &path_multipliers[i]].map(Clone::clone)
                    } else {
                        let fraction = self.grids[k].fractions[i];
                        let [state, control, costate] = solution.at_fraction(fraction);
                        [state, control, costate, solution.path_multiplier(fraction)]
                    };
                    let [state, control, costate, path_multiplier] = row;
                    self.set(layout.state(i), &state);
                    self.set(layout.control(i), &control);
                    let weight = interval.weight(i);
                    let scales = &self.problem.phases[k].scales.state;
                    multipliers.extend(costate.iter().zip(scales).map(|(l, s)| -weight * l * s));
                    let measure = 0.5 * solution.horizon.duration() * interval.length * weight;
                    path.extend(path_multiplier.iter().map(|m| m * measure));
                }
            }
            self.set(layout.state(n), &solution.states[solution.states.len() - 1]);
            self.set(layout.times(), &solution.horizon.ends_since(self.variables.origin));
            self.set(layout.parameters(), &solution.parameters);
            multipliers.append(&mut path);
            multipliers.extend(rest.ends.get(k).into_iter().flatten());
        }
        multipliers.extend(&rest.linkages);
        Start { z: self.variables.decision(), constraint_multipliers: multipliers, ..Start::default() }
    }

    /// The decision vector of solutions of a like problem.
    pub(super) fn at(&mut self, solutions: &[PhaseSolution]) -> Vec<f64> {
        self.continued(solutions, &RestMultipliers::default()).z
    }

    /// The multipliers that do not depend on the mesh.
    pub(crate) fn rest(&self, multipliers: &[f64]) -> RestMultipliers {
        let (mut row, mut ends) = (0, Vec::new());
        for k in 0..self.grids.len() {
            row += self.n_rows(k);
            ends.push(multipliers[row - self.problem.phases[k].bounds.end.len()..row].to_vec());
        }
        RestMultipliers { ends, linkages: multipliers[row..].to_vec() }
    }
}

/// Multipliers of end constraints, by phase, and of linkages.
#[derive(Default)]
pub(crate) struct RestMultipliers {
    pub(crate) ends: Vec<Vec<f64>>,
    linkages: Vec<f64>,
}

impl PhaseSolution {
    /// Of the path constraints where a fraction of the duration has passed, straight lines between points: they jump where constraints
    /// begin to act.
    fn path_multiplier(&self, fraction: f64) -> Vec<f64> {
        let (n, points) = (self.path_multipliers.len(), &self.grid.fractions);
        let i = points[..n].partition_point(|&point| point <= fraction).clamp(1, n.max(2) - 1).min(n - 1);
        let (left, right) = (i.saturating_sub(1), i);
        let gap = points[right] - points[left];
        let fraction = if gap > 0.0 { ((fraction - points[left]) / gap).clamp(0.0, 1.0) } else { 0.0 };
        let pairs = self.path_multipliers[left].iter().zip(&self.path_multipliers[right]);
        pairs.map(|(a, b)| a + fraction * (b - a)).collect()
    }
}
