//! How far a solution is from optimal, and in which intervals.
//!
//! The equations of a coarse mesh may hold exactly and its motion still cost too much, or too little: a control switches
//! inside an interval, or a bound is kept at the points and exceeded between them. So the Lagrangian is integrated with the
//! polynomials of states, controls and costates at more points than were collocated. With ũ the control within its bounds,
//! W = ∂²H/∂u² and y the multipliers of the bounds of states and of the path constraints g,
//!
//! ```text
//! e_J = |∫ L(x, ũ) + λᵀ(f(x, ũ) − ẋ) dt − its quadrature|        equations and integral (dual-weighted residual)
//!     + ∫ H(x, ũ, λ) − min over controls of H dt                   controls; by components, H as a parabola
//!     + Σ |y| · excess + ∫ |y| · distance dt                       bounds between points
//!     + Σ |jump of H| · length                                     intervals where a bound begins or ceases to act
//! ```
//! (the last where nothing names the time: what a shift of that place within its interval may change)
//! estimates the error of the cost by intervals (Becker & Rannacher 2001): to first order in the errors of controls at
//! bounds and of bounds, to second in those of all else. Errors of costates and of the Hamiltonian are of first order, and
//! that of the cost is their square; they are held to √ε.

use super::error::CollocationError;
use super::function::VectorFunction;
use super::interval::Interval;
use super::mesh::GridInterval;
use super::problem::Phase;
use super::radau::Radau;
use super::solution::{PhaseSolution, combine};
use nalgebra::DMatrix;
use std::collections::BTreeMap;

/// Points of the quadrature beside those of the collocation.
const MORE_POINTS: usize = 2;
/// Places within each interval, beside those, where bounds are looked at.
const SAMPLES: usize = 8;
/// Distance to a bound, relative to the size of a quantity, at which it acts.
const AT_BOUND: f64 = 1e-6;

/// Multipliers of bounds of states, relative to the costates, that do not make these jump.
const NO_PUSH: f64 = 1e-8;

/// Errors of a solution, estimated: relative to one and the largest value of what they are errors of.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Accuracy {
    /// Of the states, the largest of an interval.
    pub equations: f64,
    /// Of the cost.
    pub cost: f64,
    /// Of the costates: the largest defect of λ̇ = −∂H/∂x over an interval, times its part of the duration. Where bounds of
    /// states or path constraints act, costates may jump, and cost and Hamiltonian alone are judged.
    pub costates: f64,
    /// Largest difference of the Hamiltonian from its mean, relative to the terms it is made of; zero where equations, costs
    /// or constraints name the time.
    pub hamiltonian: f64,
    /// Largest excess of a bound of a state, or of a path constraint that does not depend on the controls, anywhere.
    pub violation: f64,
}

impl Accuracy {
    /// Of what was not estimated: infinite errors.
    pub const UNKNOWN: Self = Self {
        equations: f64::INFINITY,
        cost: f64::INFINITY,
        costates: f64::INFINITY,
        hamiltonian: f64::INFINITY,
        violation: f64::INFINITY,
    };

    /// Each error with its name and what it may be.
    fn parts(&self, tolerance: f64) -> [(&'static str, f64, f64); 5] {
        let root = tolerance.sqrt();
        [
            ("error of the states", self.equations, tolerance),
            ("error of the cost", self.cost, tolerance),
            ("error of the costates", self.costates, root),
            ("variation of the Hamiltonian", self.hamiltonian, root),
            ("excess of bounds of states between the points", self.violation, tolerance),
        ]
    }

    /// Whether errors of states, cost and bounds are within `tolerance`, and those of costates and Hamiltonian within its
    /// root.
    pub fn meets(&self, tolerance: f64) -> bool {
        self.parts(tolerance).iter().all(|(_, found, allowed)| found <= allowed)
    }

    /// The largest error in parts of what it may be.
    pub(super) fn excess(&self, tolerance: f64) -> f64 {
        self.parts(tolerance).iter().fold(0.0, |m: f64, (_, found, allowed)| m.max(found / allowed))
    }

    /// What exceeds that most, if anything does.
    pub fn shortfall(&self, tolerance: f64) -> Option<String> {
        let parts = self.parts(tolerance);
        let excess = |(_, found, allowed): &(_, f64, f64)| found / allowed;
        let (what, found, allowed) =
            parts.iter().max_by(|a, b| excess(a).total_cmp(&excess(b))).filter(|part| excess(part) > 1.0)?;
        Some(format!("estimated {what} {found:.1e}, allowed {allowed:.1e}"))
    }

    pub(super) fn include(&mut self, other: &Self) {
        self.equations = self.equations.max(other.equations);
        self.cost += other.cost;
        self.costates = self.costates.max(other.costates);
        self.hamiltonian = self.hamiltonian.max(other.hamiltonian);
        self.violation = self.violation.max(other.violation);
    }
}

/// What there is to know of an interval; errors as in [`Accuracy`], that of the cost absolute.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct IntervalOptimality {
    pub(super) accuracy: Accuracy,
    /// Whether a bound begins or ceases to act.
    pub(super) switches: bool,
}

/// Points within an interval of N points, and the polynomials there.
struct Rule {
    /// Weight of quadrature (zero at places where bounds alone are looked at), state basis, control basis.
    points: Vec<(f64, f64, Vec<f64>, Vec<f64>)>,
}

impl Rule {
    fn try_new(radau: &Radau) -> Result<Self, CollocationError> {
        let finer = Radau::try_new((radau.len() + MORE_POINTS).min(super::radau::MAX_POINTS))?;
        let weighed = finer.points().iter().copied().zip(finer.weights().iter().copied());
        let between = (1..=SAMPLES + 1).map(|i| (2.0 * i as f64 / (SAMPLES + 1) as f64 - 1.0, 0.0));
        let points = weighed.chain(between).map(|(tau, weight)| {
            let (mut state, mut control) = (vec![0.0; radau.len() + 1], vec![0.0; radau.len()]);
            radau.state_basis(tau, &mut state);
            radau.control_basis(tau, &mut control);
            (tau, weight, state, control)
        });
        Ok(Self { points: points.collect() })
    }
}

/// Room for what functions give at a point.
struct Scratch {
    arguments: Vec<f64>,
    rates: Vec<f64>,
    path: Vec<f64>,
    rates_by: DMatrix<f64>,
    path_by: DMatrix<f64>,
    curvature: DMatrix<f64>,
    control: Vec<f64>,
    costate: Vec<f64>,
    slope: Vec<f64>,
    costate_slope: Vec<f64>,
    path_multiplier: Vec<f64>,
    /// Multipliers of the upper and of the lower bounds of states and path constraints.
    above: Vec<f64>,
    below: Vec<f64>,
    weights: Vec<f64>,
    bend: Vec<f64>,
}

/// Excess and multipliers of one bounded row in one interval.
#[derive(Clone, Copy, Default)]
struct Held {
    excess: f64,
    multipliers: f64,
}

/// All intervals of a phase. `state_multipliers` are those of the bounds of the state at each node.
pub(super) fn optimality(
    phase: &mut Phase,
    solution: &PhaseSolution,
    state_multipliers: &[Vec<f64>],
) -> Result<Vec<IntervalOptimality>, CollocationError> {
    let sizes = phase.sizes;
    let n_path = phase.path.n_outputs() - 1;
    let n_rows = sizes.states + n_path;
    let duration = solution.horizon.duration();
    let largest = |rows: &[Vec<f64>], s: usize| rows.iter().fold(0.0, |m: f64, row| m.max(row[s].abs()));
    let costate_sizes: Vec<f64> = (0..sizes.states).map(|s| 1.0 + largest(&solution.costates, s)).collect();
    let row_sizes: Vec<f64> = (0..sizes.states)
        .map(|s| 1.0 + largest(&solution.states, s))
        .chain(phase.bounds.path.iter().map(|bound| 1.0 + bound.size()))
        .collect();
    let mut rules = BTreeMap::new();
    let mut scratch = Scratch {
        arguments: vec![0.0; sizes.point()],
        rates: vec![0.0; sizes.states],
        path: vec![0.0; 1 + n_path],
        rates_by: DMatrix::zeros(sizes.states, sizes.point()),
        path_by: DMatrix::zeros(1 + n_path, sizes.point()),
        curvature: DMatrix::zeros(sizes.point(), sizes.point()),
        control: vec![0.0; sizes.controls],
        costate: vec![0.0; sizes.states],
        slope: vec![0.0; sizes.states],
        costate_slope: vec![0.0; sizes.states],
        path_multiplier: vec![0.0; n_path],
        above: vec![0.0; n_rows],
        below: vec![0.0; n_rows],
        weights: vec![0.0; 1 + n_path],
        bend: vec![0.0; sizes.controls],
    };
    let (mut intervals, mut held) = (Vec::new(), Vec::new());
    let (mut is_autonomous, mut depends) = (true, vec![false; n_rows]);
    let mut terms: f64 = 0.0;
    for (k, interval) in solution.grid.intervals.iter().enumerate() {
        let radau = &interval.radau;
        let n = radau.len();
        let rule = match rules.entry(n) {
            std::collections::btree_map::Entry::Occupied(entry) => entry.into_mut(),
            std::collections::btree_map::Entry::Vacant(entry) => entry.insert(Rule::try_new(radau)?),
        };
        let half = 0.5 * duration * interval.length;
        let nodes = interval.first..interval.first + n + 1;
        let of_nodes = |rows: &[Vec<f64>]| radau.differentiation() * matrix(&rows[nodes.clone()]);
        let (slopes, costate_slopes) = (of_nodes(&solution.states), of_nodes(&solution.costates));
        let densities: Vec<Vec<f64>> = interval
            .points()
            .zip(radau.weights())
            .map(|(i, w)| state_multipliers[i].iter().map(|y| y / (half * w)).collect())
            .collect();
        let mut found = IntervalOptimality::default();
        let mut rows = vec![Held::default(); n_rows];
        for i in interval.points() {
            for (row, y) in rows.iter_mut().zip(&state_multipliers[i]) {
                row.multipliers += y.abs();
            }
            let measure = half * interval.weight(i);
            for (row, y) in rows[sizes.states..].iter_mut().zip(&solution.path_multipliers[i]) {
                row.multipliers += (y * measure).abs();
            }
        }
        let (mut difference, mut gap) = (0.0, 0.0);
        let mut costate_errors = vec![0.0; sizes.states];
        for (i, w) in interval.points().zip(radau.weights()) {
            scratch.arguments[..sizes.states].copy_from_slice(&solution.states[i]);
            scratch.control.copy_from_slice(&solution.controls[i]);
            let tau = radau.points()[i - interval.first];
            scratch.place(phase, solution, interval, tau);
            phase.path.evaluate(&scratch.arguments, &mut scratch.path)?;
            phase.dynamics.evaluate(&scratch.arguments, &mut scratch.rates)?;
            difference -= half * w * scratch.path[0];
            let along = scratch.rates.iter().zip(&solution.costates[i]).map(|(f, l)| (f * l).abs());
            terms = terms.max(scratch.path[0].abs() + along.sum::<f64>());
        }
        let bend_at = rule.points.len() / 2;
        scratch.bend_at(phase, solution, interval, &rule.points[bend_at])?;
        for (tau, weight, state_basis, control_basis) in &rule.points {
            scratch.interpolate(solution, interval, state_basis, control_basis);
            scratch.place(phase, solution, interval, *tau);
            let states = scratch.arguments[..sizes.states].iter().zip(&phase.bounds.state);
            for (row, (x, bound)) in rows.iter_mut().zip(states) {
                row.excess = row.excess.max(bound.distance(*x));
            }
            if n_path > 0 || *weight > 0.0 {
                phase.path.evaluate(&scratch.arguments, &mut scratch.path)?;
            }
            for ((row, g), bound) in
                rows[sizes.states..].iter_mut().zip(&scratch.path[1..]).zip(&phase.bounds.path)
            {
                row.excess = row.excess.max(bound.distance(*g));
            }
            if *weight == 0.0 {
                continue;
            }
            phase.dynamics.evaluate(&scratch.arguments, &mut scratch.rates)?;
            phase.dynamics.jacobian(&scratch.arguments, &mut scratch.rates_by)?;
            phase.path.jacobian(&scratch.arguments, &mut scratch.path_by)?;
            let basis = control_basis;
            combine_columns(&slopes, basis, &mut scratch.slope);
            combine_columns(&costate_slopes, basis, &mut scratch.costate_slope);
            let path_multipliers = &solution.path_multipliers[interval.first..];
            combine(path_multipliers, basis, &mut scratch.path_multiplier);
            for (out, sign) in [(&mut scratch.above, 1.0), (&mut scratch.below, -1.0)] {
                let (of_states, of_path) = out.split_at_mut(sizes.states);
                combine_part(&densities, basis, sign, of_states);
                combine_part(path_multipliers, basis, sign, of_path);
            }
            let time = sizes.point() - 1;
            is_autonomous &=
                scratch.rates_by.column(time).amax() == 0.0 && scratch.path_by.column(time).amax() == 0.0;
            for (j, depends) in depends[sizes.states..].iter_mut().enumerate() {
                let by = scratch.path_by.row(1 + j);
                *depends |= by.columns(sizes.states, sizes.controls).amax() > 0.0;
            }
            let Scratch { costate, rates, slope, path, .. } = &scratch;
            let along: f64 = (0..sizes.states).map(|s| costate[s] * (half * rates[s] - slope[s])).sum();
            difference += weight * (half * path[0] + along);
            for (s, error) in costate_errors.iter_mut().enumerate() {
                let residual = scratch.costate_slope[s] + half * scratch.hamiltonian_by(s);
                *error += weight * residual.abs();
            }
            gap += weight * half * (scratch.gap(phase) + scratch.slackness(phase));
        }
        found.accuracy.cost = difference.abs() + gap;
        for (error, size) in costate_errors.iter().zip(&costate_sizes) {
            found.accuracy.costates = found.accuracy.costates.max(error * interval.length / size);
        }
        found.switches = switches(phase, solution, k, &row_sizes, &mut scratch)?;
        intervals.push(found);
        held.push(rows);
    }
    let mean = solution.mean_hamiltonian();
    let is_switching: Vec<bool> = intervals.iter().map(|found: &IntervalOptimality| found.switches).collect();
    for k in 0..intervals.len() {
        let accuracy = &mut intervals[k].accuracy;
        let around = k.saturating_sub(1)..(k + 2).min(held.len());
        let push = held[around.clone()].iter().flatten().fold(0.0, |m: f64, row| m.max(row.multipliers));
        if push > NO_PUSH * costate_sizes.iter().fold(0.0, |m: f64, size| m.max(*size)) {
            accuracy.costates = 0.0;
        }
        for (row, size) in row_sizes.iter().enumerate() {
            let Held { excess, .. } = held[k][row];
            let multipliers =
                held[around.clone()].iter().fold(0.0, |m: f64, rows| m.max(rows[row].multipliers));
            accuracy.cost += multipliers * excess;
            if !depends[row] {
                accuracy.violation = accuracy.violation.max(excess / size);
            }
        }
        if !is_autonomous {
            continue;
        }
        let interval = &solution.grid.intervals[k];
        let points = interval.points();
        let apart = |h: &[f64], from: f64| h.iter().fold(0.0, |m: f64, h| m.max((h - from).abs()));
        accuracy.hamiltonian = apart(&solution.hamiltonian[points.clone()], mean) / (1.0 + terms);
        if is_switching[k] {
            let end = (points.end + 1).min(solution.hamiltonian.len());
            let around = &solution.hamiltonian[points.start.saturating_sub(1)..end];
            let jump = around.iter().fold(0.0, |m: f64, h| m.max(apart(around, *h)));
            accuracy.cost += jump * duration * interval.length;
        }
    }
    Ok(intervals)
}

fn matrix(rows: &[Vec<f64>]) -> DMatrix<f64> {
    DMatrix::from_fn(rows.len(), rows[0].len(), |i, j| rows[i][j])
}

/// The positive part of Σ basisᵢ (the positive part of sign · rowᵢ): each bound has multipliers of one sign, and a polynomial through them
/// that changes its sign, as it does where a bound begins to act between points, says nothing of the bound on the other side.
fn combine_part(rows: &[Vec<f64>], basis: &[f64], sign: f64, out: &mut [f64]) {
    out.iter_mut().enumerate().for_each(|(j, out)| {
        let sum: f64 = rows.iter().zip(basis).map(|(row, b)| b * (sign * row[j]).max(0.0)).sum();
        *out = sum.max(0.0);
    });
}

/// out = Σ basisᵢ rowᵢ.
fn combine_columns(rows: &DMatrix<f64>, basis: &[f64], out: &mut [f64]) {
    for (column, out) in rows.column_iter().zip(out) {
        *out = column.iter().zip(basis).map(|(x, b)| x * b).sum();
    }
}

impl Scratch {
    /// States, controls and costates somewhere in an interval.
    fn interpolate(
        &mut self,
        solution: &PhaseSolution,
        interval: &GridInterval,
        state_basis: &[f64],
        control_basis: &[f64],
    ) {
        let n = self.costate.len();
        combine(&solution.states[interval.first..], state_basis, &mut self.arguments[..n]);
        combine(&solution.costates[interval.first..], state_basis, &mut self.costate);
        combine(&solution.controls[interval.first..], control_basis, &mut self.control);
    }

    /// Controls within their bounds, parameters and time into the arguments.
    fn place(&mut self, phase: &Phase, solution: &PhaseSolution, interval: &GridInterval, tau: f64) {
        let sizes = phase.sizes;
        let (control, rest) = self.arguments[sizes.states..].split_at_mut(sizes.controls);
        for ((to, u), bound) in control.iter_mut().zip(&self.control).zip(&phase.bounds.control) {
            *to = bound.clamp(*u);
        }
        rest[..sizes.parameters].copy_from_slice(&solution.parameters);
        rest[sizes.parameters] = solution.horizon.time(interval.start + 0.5 * (tau + 1.0) * interval.length);
    }

    /// W for the interval, from one of its points.
    fn bend_at(
        &mut self,
        phase: &mut Phase,
        solution: &PhaseSolution,
        interval: &GridInterval,
        (tau, _, state_basis, control_basis): &(f64, f64, Vec<f64>, Vec<f64>),
    ) -> Result<(), CollocationError> {
        self.interpolate(solution, interval, state_basis, control_basis);
        self.place(phase, solution, interval, *tau);
        combine(&solution.path_multipliers[interval.first..], control_basis, &mut self.path_multiplier);
        self.weights[0] = 1.0;
        self.weights[1..].copy_from_slice(&self.path_multiplier);
        self.curvature.fill(0.0);
        phase.dynamics.add_hessian(&self.arguments, &self.costate, &mut self.curvature)?;
        phase.path.add_hessian(&self.arguments, &self.weights, &mut self.curvature)?;
        let first = phase.sizes.states;
        for (j, bend) in self.bend.iter_mut().enumerate() {
            *bend = self.curvature[(first + j, first + j)];
        }
        Ok(())
    }

    /// ∂(H + μᵀg)/∂ argument `a`.
    fn hamiltonian_by(&self, a: usize) -> f64 {
        let along: f64 = self.costate.iter().zip(self.rates_by.column(a).iter()).map(|(l, f)| l * f).sum();
        let path = self.path_by.column(a);
        let held: f64 = self.path_multiplier.iter().zip(path.iter().skip(1)).map(|(m, g)| m * g).sum();
        path[0] + along + held
    }

    /// What the multipliers of bounds of states and of path constraints do where these are not at their bounds.
    fn slackness(&self, phase: &Phase) -> f64 {
        let states = self.arguments.iter().zip(&phase.bounds.state);
        let rows = states.chain(self.path[1..].iter().zip(&phase.bounds.path));
        let multipliers = self.above.iter().zip(&self.below);
        rows.zip(multipliers)
            .map(|((x, bound), (above, below))| {
                product(*above, bound.upper - x) + product(*below, x - bound.lower)
            })
            .sum()
    }

    /// What other controls within their bounds would take off H, each for itself, with H a parabola.
    fn gap(&self, phase: &Phase) -> f64 {
        let first = phase.sizes.states;
        let parabola = |j: usize| {
            let (slope, bend) = (self.hamiltonian_by(first + j), self.bend[j]);
            let (bound, u) = (phase.bounds.control[j], self.arguments[first + j]);
            // without a bound, and without a curvature that makes one unnecessary, as far as the control is large
            let size = phase.scales.control[j];
            let (lower, upper) = (bound.lower.max(u - size), bound.upper.min(u + size));
            let decrease = |step: f64| -(slope + 0.5 * bend * step) * step;
            if bend > 0.0 {
                decrease(bound.clamp(u - slope / bend) - u)
            } else {
                decrease(lower - u).max(decrease(upper - u))
            }
        };
        (0..phase.sizes.controls).map(|j| parabola(j).max(0.0)).sum()
    }
}

/// A multiplier times the distance from its bound.
fn product(multiplier: f64, distance: f64) -> f64 {
    if distance.is_finite() { multiplier * distance.max(0.0) } else { 0.0 }
}

/// Whether a bound begins or ceases to act between the last point before an interval and the first after it.
fn switches(
    phase: &mut Phase,
    solution: &PhaseSolution,
    k: usize,
    row_sizes: &[f64],
    scratch: &mut Scratch,
) -> Result<bool, CollocationError> {
    let intervals = &solution.grid.intervals;
    let n = solution.grid.n_points();
    let points = intervals[k].points();
    let (first, end) = (points.start.saturating_sub(1), (points.end + 1).min(n));
    let sizes = phase.sizes;
    let mut before: Option<Vec<i8>> = None;
    for i in first..end {
        let side = |bound: &Interval, x: f64, size: f64| {
            if x <= bound.lower + AT_BOUND * size { -1 } else { i8::from(x >= bound.upper - AT_BOUND * size) }
        };
        let (x, u) = (&solution.states[i], &solution.controls[i]);
        let controls = u.iter().zip(&phase.bounds.control).zip(&phase.scales.control);
        let states = x.iter().zip(&phase.bounds.state).zip(row_sizes);
        let mut sides: Vec<i8> =
            controls.chain(states).map(|((x, bound), size)| side(bound, *x, *size)).collect();
        if !phase.bounds.path.is_empty() {
            scratch.arguments[..sizes.states].copy_from_slice(x);
            scratch.control.copy_from_slice(u);
            let number = solution.grid.intervals.partition_point(|interval| interval.first <= i) - 1;
            let interval = &intervals[number];
            scratch.place(phase, solution, interval, interval.radau.points()[i - interval.first]);
            phase.path.evaluate(&scratch.arguments, &mut scratch.path)?;
            let path = scratch.path[1..].iter().zip(&phase.bounds.path).zip(&row_sizes[sizes.states..]);
            sides.extend(path.map(|((g, bound), size)| side(bound, *g, *size)));
        }
        if before.is_some_and(|before| before != sides) {
            return Ok(true);
        }
        before = Some(sides);
    }
    Ok(false)
}
