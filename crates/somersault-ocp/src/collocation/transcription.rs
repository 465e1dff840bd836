//! From an optimal control problem on a mesh to a nonlinear program.
//!
//! In interval k, of length h_k, with points i = 1 … N, the state nodes X_1 … X_{N+1} and D, w of [`Radau`](super::Radau):
//!
//! ```text
//! Σ_l D_il X_l − (h_k/2) f(X_i, U_i, p, t_i) = 0        g(X_i, U_i, p, t_i) within its bounds
//! cost  Σ_k (h_k/2) Σ_i w_i L(X_i, U_i, p, t_i) + Φ
//! ```
//! The last node of an interval is the first of the next, so the state is continuous. Variables that have one
//! value only are no variables of the program. Variables are divided by their scales, defects by those of the state.
//! Jacobian and Hessian are exact; the Hessian of the Lagrangian has a block for each point, in x, u and what all
//! points share (p, t₀, t_f).

use super::entries::{Recorder, Sink, Slots};
use super::error::CollocationError;
use super::function::VectorFunction;
use super::guess::Guess;
use super::layout::Variables;
use super::mesh::{Grid, Mesh};
use super::problem::Problem;
use super::view::{PhaseWork, View};
use somersault_nlp::{Bounds, Curvature, EvaluationError, Nlp, Pattern, Structure};

/// A problem on meshes, as a nonlinear program.
pub struct Transcription<'p> {
    pub(super) problem: &'p mut Problem,
    pub(super) grids: Vec<Grid>,
    pub(super) variables: Variables,
    structure: Structure,
    /// Of each row of c.
    pub(super) row_scales: Vec<f64>,
    work: Vec<PhaseWork>,
    /// By all variables, fixed ones included.
    all_gradient: Vec<f64>,
    jacobian: Slots,
    hessian: Slots,
}

/// The view of phase `$k`, borrowing only what it needs.
macro_rules! view {
    ($self:ident, $k:expr, $row:expr) => {
        View {
            sizes: $self.problem.phases[$k].sizes,
            grid: &$self.grids[$k],
            layout: &$self.variables.phases[$k],
            work: &$self.work[$k],
            duration: duration(&$self.variables, $k),
            row: $row,
        }
    };
}

fn duration(variables: &Variables, phase: usize) -> f64 {
    let times = variables.phases[phase].times();
    variables.values[times + 1] - variables.values[times]
}

impl<'p> Transcription<'p> {
    /// The problem on one mesh for each phase.
    pub fn try_new(problem: &'p mut Problem, meshes: &[Mesh]) -> Result<Self, CollocationError> {
        Self::made(problem, meshes, false)
    }

    /// The same with what is fixed among the variables, where it has multipliers and can be moved.
    pub(super) fn with_fixed(problem: &'p mut Problem, meshes: &[Mesh]) -> Result<Self, CollocationError> {
        Self::made(problem, meshes, true)
    }

    fn made(problem: &'p mut Problem, meshes: &[Mesh], keeps_fixed: bool) -> Result<Self, CollocationError> {
        if meshes.len() != problem.phases.len() {
            let (expected, found) = (problem.phases.len(), meshes.len());
            return Err(CollocationError::Length { phase: None, argument: "meshes", expected, found });
        }
        let grids = meshes.iter().cloned().map(Grid::try_new).collect::<Result<Vec<_>, _>>()?;
        let variables = Variables::new(problem, &grids, keeps_fixed);
        if variables.free.is_empty() {
            return Err(CollocationError::NothingFree);
        }
        let phases = problem.phases.iter().zip(&grids);
        let work: Vec<_> = phases.map(|(phase, grid)| PhaseWork::new(phase, grid.n_points())).collect();
        let (constraints, row_scales) = rows(problem, &grids);
        let mut made = Self {
            structure: Structure {
                variables: variables.bounds.clone(),
                jacobian: Pattern::from_entries(0, 0, []),
                hessian: Pattern::from_entries(0, 0, []),
                constraints,
            },
            all_gradient: vec![0.0; variables.values.len()],
            problem,
            grids,
            variables,
            row_scales,
            work,
            jacobian: Slots::default(),
            hessian: Slots::default(),
        };
        made.find_patterns();
        Ok(made)
    }

    fn find_patterns(&mut self) {
        let (mut jacobian, mut hessian) = (Recorder::default(), Recorder::default());
        self.jacobian_entries(&mut jacobian);
        for k in 0..self.grids.len() {
            let view = view!(self, k, 0);
            for interval in &view.grid.intervals {
                interval.points().for_each(|i| view.point_hessian(i, interval.length, &mut hessian));
            }
            view.end_hessian(&mut hessian);
        }
        let Variables { place, scales, free, .. } = &self.variables;
        let (n, m) = (free.len(), self.row_scales.len());
        let (pattern, slots) = Slots::new(m, n, &jacobian.0, |i, j| {
            place[j].map(|column| (i, column, scales[j] / self.row_scales[i]))
        });
        (self.structure.jacobian, self.jacobian) = (pattern, slots);
        let (pattern, slots) = Slots::new(n, n, &hessian.0, |i, j| {
            let (a, b) = (place[i]?, place[j]?);
            Some((a.min(b), a.max(b), scales[i] * scales[j]))
        });
        (self.structure.hessian, self.hessian) = (pattern, slots);
    }

    fn jacobian_entries(&self, sink: &mut impl Sink) {
        let mut row = 0;
        for k in 0..self.grids.len() {
            let view = view!(self, k, row);
            view.jacobian(sink);
            row += view.n_rows();
        }
        for linkage in &self.problem.linkages {
            let [left, right] =
                [&linkage.left, &linkage.right].map(|p| self.variables.phases[p.phase].place(p));
            sink.add(row, left, -1.0);
            sink.add(row, right, 1.0);
            row += 1;
        }
    }

    fn write_hessian(
        &mut self,
        cost_factor: f64,
        multipliers: &[f64],
        sink: &mut impl Sink,
    ) -> Result<(), EvaluationError> {
        let mut row = 0;
        for k in 0..self.grids.len() {
            for number in 0..self.grids[k].intervals.len() {
                let length = self.grids[k].intervals[number].length;
                for i in self.grids[k].intervals[number].points() {
                    self.gather(k, i);
                    let weight = self.grids[k].intervals[number].weight(i);
                    self.bend(k, i, row, cost_factor * weight, multipliers)?;
                    view!(self, k, row).point_hessian(i, length, sink);
                }
            }
            self.gather_ends(k);
            let (first, n_rows) = (view!(self, k, row).end_row(), view!(self, k, row).n_rows());
            let (phase, work) = (&mut self.problem.phases[k], &mut self.work[k]);
            let mut weights = std::mem::take(&mut work.end_weights);
            weights[0] = cost_factor;
            weights[1..].copy_from_slice(&multipliers[first..row + n_rows]);
            work.end_curvature.fill(0.0);
            let done = phase.ends.add_hessian(&work.end_arguments, &weights, &mut work.end_curvature);
            work.end_weights = weights;
            done?;
            finite(work.end_curvature.as_slice(), "a second derivative of an end cost or end constraint", k)?;
            view!(self, k, row).end_hessian(sink);
            row += n_rows;
        }
        Ok(())
    }

    /// Curvature and slope of what the Lagrangian has at point `i`; `weight` is that of the running cost.
    fn bend(
        &mut self,
        k: usize,
        i: usize,
        row: usize,
        weight: f64,
        multipliers: &[f64],
    ) -> Result<(), EvaluationError> {
        let path_row = view!(self, k, row).path_row();
        let (phase, work) = (&mut self.problem.phases[k], &mut self.work[k]);
        let (states, n_path) = (phase.sizes.states, work.path_weights.len() - 1);
        for (s, w) in work.weights.iter_mut().enumerate() {
            let row = row + i * states + s;
            *w = -multipliers[row] / self.row_scales[row];
        }
        work.curvature.fill(0.0);
        phase.dynamics.add_hessian(&work.arguments, &work.weights, &mut work.curvature)?;
        work.path_weights.fill(0.0);
        work.path_weights[0] = weight;
        phase.path.add_hessian(&work.arguments, &work.path_weights, &mut work.curvature)?;
        let (rates_by, path_by) = (&work.rates_by[i], &work.path_by[i]);
        for (a, slope) in work.slope.iter_mut().enumerate() {
            let along: f64 = work.weights.iter().zip(rates_by.column(a).iter()).map(|(w, f)| w * f).sum();
            *slope = weight * path_by[(0, a)] + along;
        }
        if n_path > 0 {
            let first = path_row + i * n_path;
            work.path_weights[0] = 0.0;
            work.path_weights[1..].copy_from_slice(&multipliers[first..first + n_path]);
            work.path_curvature.fill(0.0);
            phase.path.add_hessian(&work.arguments, &work.path_weights, &mut work.path_curvature)?;
        }
        finite(work.curvature.as_slice(), "a second derivative of a rate or running cost", k)?;
        finite(work.path_curvature.as_slice(), "a second derivative of a path constraint", k)
    }

    /// Rows of c that belong to phase `k`.
    pub(super) fn n_rows(&self, k: usize) -> usize {
        view!(self, k, 0).n_rows()
    }

    /// f, and L with g, as last evaluated at the points of phase `k`.
    pub(super) fn rates_and_costs(&self, k: usize) -> (&[f64], &[f64]) {
        (&self.work[k].rates, &self.work[k].path)
    }

    /// The decision vector of the guesses that the phases came with.
    pub fn decision_of_guess(&mut self) -> Vec<f64> {
        let guesses: Vec<Guess> =
            self.problem.phases.iter().filter_map(|phase| phase.guess.clone()).collect();
        self.start(&guesses)
    }

    /// The decision vector nearest to guesses, one for each phase.
    pub(super) fn start(&mut self, guesses: &[Guess]) -> Vec<f64> {
        for (k, guess) in guesses.iter().enumerate() {
            let (phase, layout) = (&self.problem.phases[k], self.variables.phases[k]);
            let (start, end) = guess.interval();
            let sizes = phase.sizes;
            let (mut state, mut control) = (vec![0.0; sizes.states], vec![0.0; sizes.controls]);
            let n = self.grids[k].n_points();
            for i in 0..=n {
                let fraction = if i < n { self.grids[k].fractions[i] } else { 1.0 };
                guess.at_fraction(fraction, &mut state, &mut control);
                self.set(layout.state(i), &state);
                if i < n {
                    self.set(layout.control(i), &control);
                }
            }
            let origin = self.variables.origin;
            self.set(layout.times(), &[start - origin, end - origin]);
            self.set(layout.parameters(), &guess.parameters);
        }
        self.variables.decision()
    }

    /// Values of free variables from `first` on.
    pub(super) fn set(&mut self, first: usize, values: &[f64]) {
        for (i, &value) in (first..).zip(values) {
            if self.variables.place[i].is_some() {
                self.variables.values[i] = value;
            }
        }
    }

    /// (x, u, p, t) at point `i` of phase `k` into `work`.
    fn gather(&mut self, k: usize, i: usize) {
        let Variables { phases, values, origin, .. } = &self.variables;
        let (layout, sizes, s) = (&phases[k], self.problem.phases[k].sizes, self.grids[k].fractions[i]);
        let arguments = &mut self.work[k].arguments;
        let n = sizes.states + sizes.controls;
        arguments[..n].copy_from_slice(&values[layout.state(i)..layout.state(i) + n]);
        arguments[n..n + sizes.parameters]
            .copy_from_slice(&values[layout.parameters()..][..sizes.parameters]);
        let (start, end) = (values[layout.times()], values[layout.times() + 1]);
        arguments[n + sizes.parameters] = origin + ((1.0 - s) * start + s * end);
    }

    fn gather_ends(&mut self, k: usize) {
        let Variables { phases, values, origin, .. } = &self.variables;
        let (layout, arguments) = (&phases[k], &mut self.work[k].end_arguments);
        for (a, argument) in arguments.iter_mut().enumerate() {
            *argument = values[layout.end_argument(a)];
        }
        // t₀ and t_f are the last
        arguments.iter_mut().rev().take(2).for_each(|time| *time += origin);
    }
}

/// Bounds and scales of the rows of c: of each phase defects, path and end constraints, then linkages.
fn rows(problem: &Problem, grids: &[Grid]) -> (Bounds, Vec<f64>) {
    let (mut bounds, mut scales) = (Bounds::default(), Vec::new());
    for (phase, grid) in problem.phases.iter().zip(grids) {
        for _ in 0..grid.n_points() {
            for scale in &phase.scales.state {
                bounds.push(0.0, 0.0);
                scales.push(*scale);
            }
        }
        let at_points = (0..grid.n_points()).flat_map(|_| &phase.bounds.path);
        for interval in at_points.chain(&phase.bounds.end) {
            bounds.push(interval.lower, interval.upper);
            scales.push(1.0);
        }
    }
    for linkage in &problem.linkages {
        bounds.push(linkage.difference.lower, linkage.difference.upper);
        scales.push(1.0);
    }
    (bounds, scales)
}

fn finite(values: &[f64], what: &str, phase: usize) -> Result<(), EvaluationError> {
    if values.iter().all(|x| x.is_finite()) {
        Ok(())
    } else {
        Err(EvaluationError::Undefined { what: format!("{what} of phase {phase}") })
    }
}

impl Nlp for Transcription<'_> {
    fn structure(&self) -> &Structure {
        &self.structure
    }

    fn evaluate(&mut self, z: &[f64], constraints: &mut [f64]) -> Result<f64, EvaluationError> {
        self.variables.assign(z);
        let (mut cost, mut row) = (0.0, 0);
        for k in 0..self.grids.len() {
            let states = self.problem.phases[k].sizes.states;
            let n_path = self.problem.phases[k].path.n_outputs();
            for i in 0..self.grids[k].n_points() {
                self.gather(k, i);
                let (phase, work) = (&mut self.problem.phases[k], &mut self.work[k]);
                phase.dynamics.evaluate(&work.arguments, &mut work.rates[i * states..(i + 1) * states])?;
                phase.path.evaluate(&work.arguments, &mut work.path[i * n_path..(i + 1) * n_path])?;
            }
            self.gather_ends(k);
            let (phase, work) = (&mut self.problem.phases[k], &mut self.work[k]);
            phase.ends.evaluate(&work.end_arguments, &mut work.ends)?;
            finite(&work.rates, "a rate of the state", k)?;
            finite(&work.path, "a running cost or path constraint", k)?;
            finite(&work.ends, "an end cost or end constraint", k)?;

            let view = view!(self, k, row);
            let (layout, values) = (view.layout, &self.variables.values);
            cost += view.work.ends[0];
            for interval in &view.grid.intervals {
                let half = 0.5 * view.duration * interval.length;
                let radau = &interval.radau;
                let d = radau.differentiation();
                for (local, i) in interval.points().enumerate() {
                    cost += half * radau.weights()[local] * view.work.path[i * n_path];
                    for s in 0..states {
                        let slope: f64 = (0..d.ncols())
                            .map(|l| d[(local, l)] * values[layout.state(interval.first + l) + s])
                            .sum();
                        let row = row + i * states + s;
                        constraints[row] =
                            (slope - half * view.work.rates[i * states + s]) / self.row_scales[row];
                    }
                    let first = view.path_row() + i * view.n_path();
                    constraints[first..first + view.n_path()]
                        .copy_from_slice(&view.work.path[i * n_path + 1..(i + 1) * n_path]);
                }
            }
            let n_ends = view.work.ends.len() - 1;
            constraints[view.end_row()..view.end_row() + n_ends].copy_from_slice(&view.work.ends[1..]);
            row += view.n_rows();
        }
        for linkage in &self.problem.linkages {
            let [left, right] = [&linkage.left, &linkage.right]
                .map(|p| self.variables.values[self.variables.phases[p.phase].place(p)]);
            constraints[row] = right - left;
            row += 1;
        }
        Ok(cost)
    }

    fn differentiate(
        &mut self,
        _z: &[f64],
        gradient: &mut [f64],
        jacobian: &mut [f64],
    ) -> Result<(), EvaluationError> {
        for k in 0..self.grids.len() {
            for i in 0..self.grids[k].n_points() {
                self.gather(k, i);
                let (phase, work) = (&mut self.problem.phases[k], &mut self.work[k]);
                phase.dynamics.jacobian(&work.arguments, &mut work.rates_by[i])?;
                phase.path.jacobian(&work.arguments, &mut work.path_by[i])?;
                finite(work.rates_by[i].as_slice(), "a derivative of a rate", k)?;
                finite(work.path_by[i].as_slice(), "a derivative of a running cost or path constraint", k)?;
            }
            self.gather_ends(k);
            let (phase, work) = (&mut self.problem.phases[k], &mut self.work[k]);
            phase.ends.jacobian(&work.end_arguments, &mut work.ends_by)?;
            finite(work.ends_by.as_slice(), "a derivative of an end cost or end constraint", k)?;
        }
        jacobian.fill(0.0);
        self.jacobian_entries(&mut self.jacobian.writer(jacobian));
        self.all_gradient.fill(0.0);
        for k in 0..self.grids.len() {
            view!(self, k, 0).gradient(&mut self.all_gradient);
        }
        for (g, &i) in gradient.iter_mut().zip(&self.variables.free) {
            *g = self.all_gradient[i] * self.variables.scales[i];
        }
        Ok(())
    }

    fn curvature(&self) -> Curvature {
        Curvature::Exact
    }

    fn hessian(
        &mut self,
        _z: &[f64],
        cost_factor: f64,
        multipliers: &[f64],
        hessian: &mut [f64],
    ) -> Result<(), EvaluationError> {
        hessian.fill(0.0);
        // lent to the loop, which changes the rest of self
        let slots = std::mem::take(&mut self.hessian);
        let done = self.write_hessian(cost_factor, multipliers, &mut slots.writer(hessian));
        self.hessian = slots;
        done
    }
}
