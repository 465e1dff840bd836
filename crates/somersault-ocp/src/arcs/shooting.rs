//! Multi-arc multiple shooting.
//!
//! Unknown are t₀ where it is free, the durations of the arcs, (x̃, λ) at both ends of each arc and between its segments, the jumps π of
//! costates where bounds of the state begin to act, and the multipliers ν of end constraints. The equations say that segments join, that
//! λ⁺ = λ⁻ − Σ π_k c^(k)_x where arcs do, that each junction has its conditions ([`Condition`]) and that the ends have theirs
//! ([`super::ends`]). Durations, not times, are unknown, so that a shift in time changes nothing where nothing names the time.
//!
//! Newton's method has the exact Jacobian matrix; steps are shortened until the simplified Newton step of the point reached is
//! shorter than the step itself (Deuflhard, *Newton Methods for Nonlinear Problems*, 2004, section 3.3), a test that does not
//! depend on how rows are scaled.

use super::ends::{EndTerms, EndValues, Ends};
use super::flow::{ArcFlow, Arrival, follow};
use super::hamiltonian::{Hamiltonian, Observables};
use super::kind::ArcKind;
use nalgebra::{DMatrix, DVector, Dyn, LU};
use somersault_core::cancel::CancellationToken;
use somersault_expr::{Derivative, Evaluator, ExprError};

/// Segments of the whole motion, about.
const SEGMENTS: f64 = 20.0;
/// Newton's steps at most.
const MOST_STEPS: usize = 60;
/// Shortest part of a step that is tried.
const SHORTEST: f64 = 1e-3;
/// Length of a step, relative to the sizes of the unknowns, at which it counts as converged.
const CONVERGED: f64 = 1e-10;
/// Part of its duration that an arc keeps in a step.
const KEPT: f64 = 0.1;
/// Part of the whole duration below which an arc counts as vanished.
const VANISHED: f64 = 1e-5;

/// On which side of a junction.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Side {
    Before,
    After,
}

/// What holds at a junction.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Condition {
    /// H_u = 0.
    Slope(Side, usize),
    /// d(H_u)/dt = 0.
    SlopeRate(Side, usize),
    /// c^(k) = 0 of a bound of the state.
    Bound(usize, usize),
    /// The control does not jump.
    Continuous(usize),
}

/// Where two arcs join.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub(super) struct Junction {
    pub(super) conditions: Vec<Condition>,
    /// The bound of the state by whose c, ċ, … costates jump, and by how many of them.
    pub(super) jump: Option<(usize, usize)>,
}

/// Arcs and how they join.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Plan {
    /// Each with the parts of the duration that have passed at its start and end.
    pub(super) arcs: Vec<(ArcKind, f64, f64)>,
    /// One less than arcs.
    pub(super) junctions: Vec<Junction>,
}

/// The unknowns.
#[derive(Debug, Clone)]
pub(super) struct Iterate {
    pub(super) start: f64,
    pub(super) durations: Vec<f64>,
    /// (x̃, λ) of each arc, at its start, between its segments and at its end.
    pub(super) nodes: Vec<Vec<Vec<f64>>>,
    /// u and η there, for the search of the controls.
    pub(super) guesses: Vec<Vec<Vec<f64>>>,
    /// π of each junction.
    pub(super) jumps: Vec<Vec<f64>>,
    /// ν of all end constraints; zero where they do not act.
    pub(super) multipliers: Vec<f64>,
}

impl Iterate {
    pub(super) fn duration(&self) -> f64 {
        self.durations.iter().sum()
    }

    pub(super) fn first(&self) -> &[f64] {
        &self.nodes[0][0]
    }

    pub(super) fn last(&self) -> &[f64] {
        let arc = &self.nodes[self.nodes.len() - 1];
        &arc[arc.len() - 1]
    }
}

/// Number of segments of an arc with this part of the duration.
pub(super) fn n_segments(part: f64) -> usize {
    ((SEGMENTS * part).ceil() as usize).max(1)
}

/// How Newton's method ended.
#[derive(Debug, Clone)]
pub(super) enum End {
    Converged,
    /// An arc lost its duration.
    Vanished(usize),
    /// Why there is no solution.
    Failed(String),
    Cancelled,
    /// No evaluation is left.
    Spent,
}

/// How long Newton's method may take.
pub(super) struct Budget<'a> {
    pub(super) token: &'a CancellationToken,
    /// Evaluations of the equations of all arcs; none where they are not limited.
    pub(super) evaluations: Option<usize>,
}

impl Budget<'_> {
    /// How it ends where nothing is left; counts an evaluation otherwise.
    fn spend(&mut self) -> Option<End> {
        if self.token.is_cancelled() {
            return Some(End::Cancelled);
        }
        match &mut self.evaluations {
            Some(0) => return Some(End::Spent),
            Some(left) => *left -= 1,
            None => {}
        }
        None
    }
}

/// What Newton's method left.
#[derive(Debug, Clone)]
pub(super) struct Solved {
    pub(super) end: End,
    pub(super) iterate: Iterate,
    pub(super) steps: usize,
    /// Largest residual, each relative to the largest of what its row changes by with the sizes of the unknowns.
    pub(super) residual: f64,
}

/// The equations with all that evaluates them.
pub(super) struct Shooting<'a> {
    pub(super) hamiltonian: &'a Hamiltonian,
    pub(super) plan: &'a Plan,
    pub(super) flows: Vec<ArcFlow>,
    pub(super) ends: &'a Ends,
    pub(super) terms: &'a mut EndTerms,
    /// Of x̃ and λ.
    pub(super) sizes: &'a [f64],
    /// Ends what follows arcs.
    pub(super) token: &'a CancellationToken,
    observables: Observables,
    /// Gradients of the bounds that costates jump by, at each junction.
    gradients: Vec<Option<Gradients>>,
}

struct Gradients {
    values: Evaluator,
    derivative: Derivative,
    entries: Evaluator,
}

/// Residuals and, where requested, their derivatives.
struct System {
    residual: DVector<f64>,
    jacobian: DMatrix<f64>,
    row: usize,
}

impl System {
    fn put(&mut self, value: f64) -> usize {
        self.residual[self.row] = value;
        self.row += 1;
        self.row - 1
    }
}

/// Where unknowns stand.
struct Columns {
    start: Option<usize>,
    durations: usize,
    nodes: Vec<usize>,
    jumps: Vec<usize>,
    multipliers: usize,
    n: usize,
}

impl<'a> Shooting<'a> {
    /// The equations of a plan; nothing where it is cancelled before all of them are made.
    pub(super) fn try_new(
        hamiltonian: &'a mut Hamiltonian,
        plan: &'a Plan,
        ends: &'a Ends,
        terms: &'a mut EndTerms,
        sizes: &'a [f64],
        token: &'a CancellationToken,
    ) -> Result<Option<Self>, ExprError> {
        let mut flows = Vec::new();
        for (kind, ..) in &plan.arcs {
            if token.is_cancelled() {
                return Ok(None);
            }
            flows.push(ArcFlow::try_new(hamiltonian, kind)?);
        }
        let mut gradients = Vec::new();
        for junction in &plan.junctions {
            gradients.push(match junction.jump {
                Some((bound, _)) => {
                    let function = hamiltonian.bound_gradients(bound)?;
                    let derivative = function.jacobian()?.clone();
                    let entries = derivative.evaluator();
                    Some(Gradients { values: function.evaluator(), derivative, entries })
                }
                None => None,
            });
        }
        let observables = hamiltonian.observables();
        Ok(Some(Self { hamiltonian, plan, flows, ends, terms, sizes, token, observables, gradients }))
    }

    fn columns(&self, at: &Iterate) -> Columns {
        let mut n = 0;
        let mut take = |count: usize| {
            n += count;
            n - count
        };
        let start = self.ends.start.is_none().then(|| take(1));
        let durations = take(at.durations.len());
        let nodes = at.nodes.iter().map(|arc| take(arc.len() * self.sizes.len())).collect();
        let jumps = at.jumps.iter().map(|jumps| take(jumps.len())).collect();
        let multipliers = take(self.ends.constraints.len());
        Columns { start, durations, nodes, jumps, multipliers, n }
    }

    fn n_rows(&self, at: &Iterate) -> usize {
        let width = self.sizes.len();
        let nodes: usize = at.nodes.iter().map(Vec::len).sum();
        let conditions: usize = self.plan.junctions.iter().map(|junction| junction.conditions.len()).sum();
        // of the nodes one has no segment or junction before it, and the two ends have half as many rows each
        nodes * width + conditions + usize::from(self.ends.start.is_none()) + 1 + self.ends.constraints.len()
    }

    /// The size of each unknown.
    fn scales(&self, at: &Iterate, columns: &Columns) -> DVector<f64> {
        let mut scales = DVector::from_element(columns.n, 1.0);
        let duration = at.duration();
        let costate = self.sizes[self.sizes.len() / 2..].iter().fold(0.0, |a: f64, b| a.max(*b));
        if let Some(start) = columns.start {
            scales[start] = duration;
        }
        (0..at.durations.len()).for_each(|k| scales[columns.durations + k] = duration);
        for (arc, &first) in at.nodes.iter().zip(&columns.nodes) {
            for k in 0..arc.len() * self.sizes.len() {
                scales[first + k] = self.sizes[k % self.sizes.len()];
            }
        }
        for (jumps, &first) in at.jumps.iter().zip(&columns.jumps) {
            jumps.iter().enumerate().for_each(|(k, jump)| scales[first + k] = jump.abs().max(costate));
        }
        for k in 0..self.ends.constraints.len() {
            scales[columns.multipliers + k] = costate;
        }
        scales
    }

    /// Follows each segment; nothing where one cannot be.
    pub(super) fn arrivals(&mut self, at: &Iterate, has_matrix: bool) -> Option<Vec<Vec<Arrival>>> {
        let mut all = Vec::new();
        for (a, flow) in self.flows.iter_mut().enumerate() {
            let segments = at.nodes[a].len() - 1;
            let duration = at.durations[a] / segments as f64;
            let mut arrivals = Vec::new();
            for s in 0..segments {
                flow.set_guess(&at.guesses[a][s]);
                arrivals.push(follow(flow, self.sizes, &at.nodes[a][s], duration, has_matrix, self.token)?);
            }
            all.push(arrivals);
        }
        Some(all)
    }

    /// Arguments of the end terms.
    pub(super) fn end_arguments(&self, at: &Iterate) -> Vec<f64> {
        let n = self.hamiltonian.n_original;
        let parameters = self.ends.parameters.len();
        let mut arguments = at.first()[..n].to_vec();
        arguments.extend(&at.last()[..n]);
        arguments.extend(&at.first()[n..n + parameters]);
        arguments.extend([at.start, at.start + at.duration()]);
        arguments
    }

    /// The cost of an iterate.
    pub(super) fn cost(&mut self, at: &Iterate) -> Option<f64> {
        let arrivals = self.arrivals(at, false)?;
        let arguments = self.end_arguments(at);
        let ends = self.terms.evaluate(&arguments, &at.multipliers)?;
        // the smaller ones are added first where they are small
        Some(ends.values[0] + arrivals.iter().flatten().map(|arrival| arrival.cost).sum::<f64>())
    }

    /// Adds the derivatives of an argument of the end terms to a row.
    fn end_column(&self, columns: &Columns, argument: usize, mut add: impl FnMut(usize)) {
        let (n, parameters) = (self.hamiltonian.n_original, self.ends.parameters.len());
        let width = self.sizes.len();
        let last_node = columns.jumps.first().copied().unwrap_or(columns.multipliers) - width;
        if argument < n {
            add(columns.nodes[0] + argument);
        } else if argument < 2 * n {
            add(last_node + argument - n);
        } else if argument < 2 * n + parameters {
            add(columns.nodes[0] + n + argument - 2 * n);
        } else {
            columns.start.into_iter().for_each(&mut add);
            if argument == 2 * n + parameters + 1 {
                (columns.durations..columns.nodes[0]).for_each(&mut add);
            }
        }
    }

    fn evaluate(&mut self, at: &Iterate, columns: &Columns) -> Option<System> {
        let rows = self.n_rows(at);
        let mut system =
            System { residual: DVector::zeros(rows), jacobian: DMatrix::zeros(rows, columns.n), row: 0 };
        let arrivals = self.arrivals(at, true)?;
        self.segments(at, columns, &arrivals, &mut system);
        for k in 0..self.plan.junctions.len() {
            self.junction(at, columns, k, &mut system)?;
        }
        self.both_ends(at, columns, &mut system)?;
        let is_finite = system.residual.iter().chain(system.jacobian.iter()).all(|x| x.is_finite());
        is_finite.then_some(system)
    }

    fn segments(&mut self, at: &Iterate, columns: &Columns, arrivals: &[Vec<Arrival>], system: &mut System) {
        let width = self.sizes.len();
        for (a, arc) in arrivals.iter().enumerate() {
            for (s, arrival) in arc.iter().enumerate() {
                let first = columns.nodes[a] + s * width;
                let rates = self.flows[a].rates_at(&arrival.point);
                for i in 0..width {
                    let row = system.put(arrival.point[i] - at.nodes[a][s + 1][i]);
                    if let Some(transition) = &arrival.transition {
                        (0..width).for_each(|j| system.jacobian[(row, first + j)] = transition[(i, j)]);
                    }
                    system.jacobian[(row, first + width + i)] = -1.0;
                    system.jacobian[(row, columns.durations + a)] = rates[i] / arc.len() as f64;
                }
            }
        }
    }

    fn junction(&mut self, at: &Iterate, columns: &Columns, k: usize, system: &mut System) -> Option<()> {
        let width = self.sizes.len();
        let n = self.hamiltonian.n;
        let (arc, next) = (&at.nodes[k], &at.nodes[k + 1]);
        let (before, after) = (&arc[arc.len() - 1], &next[0]);
        let (first_before, first_after) = (columns.nodes[k + 1] - width, columns.nodes[k + 1]);
        let row = system.row;
        for i in 0..width {
            let row = system.put(after[i] - before[i]);
            system.jacobian[(row, first_after + i)] = 1.0;
            system.jacobian[(row, first_before + i)] = -1.0;
        }
        if let (Some((_, count)), Some(gradients)) = (self.plan.junctions[k].jump, &mut self.gradients[k]) {
            let mut inputs = before.clone();
            inputs.resize(gradients.values.n_inputs(), 0.0);
            let mut values = vec![0.0; gradients.values.n_outputs()];
            gradients.values.evaluate(&inputs, &mut values).ok()?;
            let mut entries = vec![0.0; gradients.entries.n_outputs()];
            gradients.entries.evaluate(&inputs, &mut entries).ok()?;
            for d in 0..count {
                for i in 0..n {
                    system.residual[row + n + i] += at.jumps[k][d] * values[d * n + i];
                    system.jacobian[(row + n + i, columns.jumps[k] + d)] = values[d * n + i];
                }
            }
            for ((output, input), value) in gradients.derivative.sparsity().entries().zip(&entries) {
                if output / n < count && input < width {
                    let jump = at.jumps[k][output / n];
                    system.jacobian[(row + n + output % n, first_before + input)] += jump * value;
                }
            }
        }
        self.flows[k].set_guess(&at.guesses[k][arc.len() - 1]);
        self.flows[k + 1].set_guess(&at.guesses[k + 1][0]);
        let earlier = self.flows[k].observe(before)?;
        let later = self.flows[k + 1].observe(after)?;
        for condition in &self.plan.junctions[k].conditions {
            let on = |side: Side| match side {
                Side::Before => (&earlier, first_before),
                Side::After => (&later, first_after),
            };
            let terms = match *condition {
                Condition::Slope(side, i) => vec![(on(side), self.observables.slope(i), 1.0)],
                Condition::SlopeRate(side, i) => vec![(on(side), self.observables.slope_rate(i), 1.0)],
                Condition::Bound(bound, d) => vec![(on(Side::Before), self.observables.bound(bound, d), 1.0)],
                Condition::Continuous(i) => {
                    let place = self.observables.control(i);
                    vec![(on(Side::Before), place, 1.0), (on(Side::After), place, -1.0)]
                }
            };
            let row = system.put(0.0);
            for (((values, by), first), place, sign) in terms {
                system.residual[row] += sign * values[place];
                for j in 0..width {
                    system.jacobian[(row, first + j)] += sign * by[(place, j)];
                }
            }
        }
        Some(())
    }

    fn both_ends(&mut self, at: &Iterate, columns: &Columns, system: &mut System) -> Option<()> {
        let (n, width) = (self.hamiltonian.n, self.sizes.len());
        let (n_original, n_parameters) = (self.hamiltonian.n_original, self.ends.parameters.len());
        let arguments = self.end_arguments(at);
        let EndValues { values, by, gradient, hessian } = self.terms.evaluate(&arguments, &at.multipliers)?;
        let last_arc = at.nodes.len() - 1;
        self.flows[0].set_guess(&at.guesses[0][0]);
        let at_start = self.flows[0].observe(at.first())?;
        let guesses = &at.guesses[last_arc];
        self.flows[last_arc].set_guess(&guesses[guesses.len() - 1]);
        let at_end = self.flows[last_arc].observe(at.last())?;
        let first_node = columns.nodes[0];
        let last_node = columns.jumps.first().copied().unwrap_or(columns.multipliers) - width;
        // a row that has `sign` ∂ℓ/∂argument in it
        let transversality = |system: &mut System, row: usize, argument: usize, sign: f64| {
            system.residual[row] += sign * gradient[argument];
            for a in 0..arguments.len() {
                self.end_column(columns, a, |column| {
                    system.jacobian[(row, column)] += sign * hessian[(argument, a)];
                });
            }
            for (k, &(constraint, _)) in self.ends.constraints.iter().enumerate() {
                system.jacobian[(row, columns.multipliers + k)] += sign * by[(1 + constraint, argument)];
            }
        };
        let hamiltonian =
            |system: &mut System, row: usize, (values, by): &(Vec<f64>, DMatrix<f64>), node: usize| {
                system.residual[row] += values[Observables::HAMILTONIAN];
                (0..width)
                    .for_each(|j| system.jacobian[(row, node + j)] += by[(Observables::HAMILTONIAN, j)]);
            };
        let fixed = |system: &mut System, column: usize, excess: f64| {
            let row = system.put(excess);
            system.jacobian[(row, column)] = 1.0;
        };
        for i in 0..n_original + n_parameters {
            let (held, argument) = if i < n_original {
                (self.ends.initial[i], i)
            } else {
                (self.ends.parameters[i - n_original], n_original + i)
            };
            if let Some(value) = held {
                fixed(system, first_node + i, at.first()[i] - value);
            } else {
                let row = system.put(at.first()[n + i]);
                system.jacobian[(row, first_node + n + i)] = 1.0;
                transversality(system, row, argument, 1.0);
            }
        }
        for i in 0..n_original + n_parameters {
            match self.ends.last.get(i) {
                Some(Some(value)) => fixed(system, last_node + i, at.last()[i] - value),
                Some(None) => {
                    let row = system.put(at.last()[n + i]);
                    system.jacobian[(row, last_node + n + i)] = 1.0;
                    transversality(system, row, n_original + i, -1.0);
                }
                // costates of parameters end at zero
                None => fixed(system, last_node + n + i, at.last()[n + i]),
            }
        }
        if let Some(time) = self.hamiltonian.time {
            let row = system.put(at.first()[time] - at.start);
            system.jacobian[(row, first_node + time)] = 1.0;
            columns.start.into_iter().for_each(|start| system.jacobian[(row, start)] = -1.0);
            let row = system.put(at.last()[n + time]);
            system.jacobian[(row, last_node + n + time)] = 1.0;
            hamiltonian(system, row, &at_end, last_node);
        }
        if self.ends.start.is_none() {
            let row = system.put(0.0);
            hamiltonian(system, row, &at_start, first_node);
            transversality(system, row, 2 * n_original + n_parameters, -1.0);
        }
        if let Some(finish) = self.ends.finish {
            let row = match self.ends.start {
                Some(start) => system.put(at.duration() - (finish - start)),
                None => system.put(at.start + at.duration() - finish),
            };
            columns.start.into_iter().for_each(|start| system.jacobian[(row, start)] = 1.0);
            (columns.durations..first_node).for_each(|column| system.jacobian[(row, column)] = 1.0);
        } else {
            let row = system.put(0.0);
            hamiltonian(system, row, &at_end, last_node);
            transversality(system, row, 2 * n_original + n_parameters + 1, 1.0);
        }
        for &(constraint, value) in &self.ends.constraints {
            let row = system.put(values[1 + constraint] - value);
            for a in 0..arguments.len() {
                self.end_column(columns, a, |column| {
                    system.jacobian[(row, column)] += by[(1 + constraint, a)];
                });
            }
        }
        Some(())
    }

    /// The iterate after a step; the controls found on the way are where the next search of them starts.
    fn moved(&self, at: &Iterate, columns: &Columns, step: &DVector<f64>, part: f64) -> Iterate {
        let mut next = at.clone();
        let width = self.sizes.len();
        columns.start.into_iter().for_each(|column| next.start += part * step[column]);
        for (k, duration) in next.durations.iter_mut().enumerate() {
            *duration += part * step[columns.durations + k];
        }
        for (arc, &first) in next.nodes.iter_mut().zip(&columns.nodes) {
            for (k, node) in arc.iter_mut().enumerate() {
                node.iter_mut().enumerate().for_each(|(i, x)| *x += part * step[first + k * width + i]);
            }
        }
        for (jumps, &first) in next.jumps.iter_mut().zip(&columns.jumps) {
            jumps.iter_mut().enumerate().for_each(|(k, jump)| *jump += part * step[first + k]);
        }
        for (k, &(constraint, _)) in self.ends.constraints.iter().enumerate() {
            next.multipliers[constraint] += part * step[columns.multipliers + k];
        }
        next
    }

    /// Controls at the nodes, for the next search of them.
    pub(super) fn remember(&mut self, at: &mut Iterate) {
        for (a, flow) in self.flows.iter_mut().enumerate() {
            for (node, guess) in at.nodes[a].iter().zip(&mut at.guesses[a]) {
                flow.set_guess(guess);
                if flow.observed(node).is_some() {
                    *guess = flow.guess();
                }
            }
        }
    }

    /// Newton's method.
    pub(super) fn solve(&mut self, start: Iterate, budget: &mut Budget<'_>) -> Solved {
        let columns = self.columns(&start);
        let mut solved = Solved { end: End::Cancelled, iterate: start, steps: 0, residual: f64::INFINITY };
        let rows = self.n_rows(&solved.iterate);
        if rows != columns.n {
            let reason = format!(
                "its junctions have {rows} conditions for {} unknowns: two things change at once, or an arc that needs both of its \
                 ends has one",
                columns.n
            );
            solved.end = End::Failed(reason);
            return solved;
        }
        let fail = |solved: &mut Solved, reason: &str| solved.end = End::Failed(reason.to_owned());
        if let Some(end) = budget.spend() {
            solved.end = end;
            return solved;
        }
        self.remember(&mut solved.iterate);
        let Some(mut system) = self.evaluate(&solved.iterate, &columns) else {
            if !self.token.is_cancelled() {
                fail(&mut solved, "an arc of the collocation solution cannot be followed");
            }
            return solved;
        };
        let mut last_length = f64::INFINITY;
        for _ in 0..MOST_STEPS {
            let scales = self.scales(&solved.iterate, &columns);
            let Some(factors) = Factors::new(&system.jacobian, &scales) else {
                fail(&mut solved, "its equations do not determine it: their matrix is singular");
                return solved;
            };
            solved.residual = factors.largest(&system.residual);
            let Some(step) = factors.step(&system.residual, &scales) else {
                fail(&mut solved, "its equations do not determine it: their matrix is singular");
                return solved;
            };
            let length = norm(&step, &scales);
            // to rounding: steps do not become shorter any more
            if length <= CONVERGED && length >= 0.5 * last_length || length <= 1e-15 {
                solved.end = End::Converged;
                return solved;
            }
            last_length = length;
            let durations = &solved.iterate.durations;
            let (mut longest, mut shrinking) = (1.0f64, None);
            for (k, duration) in durations.iter().enumerate() {
                let change = step[columns.durations + k];
                let part = -(1.0 - KEPT) * duration / change;
                if change < 0.0 && part < longest {
                    (longest, shrinking) = (part, Some(k));
                }
            }
            if let Some(k) = shrinking
                && durations[k] < VANISHED * solved.iterate.duration()
            {
                solved.end = End::Vanished(k);
                return solved;
            }
            let mut part = longest;
            let accepted = loop {
                if let Some(end) = budget.spend() {
                    solved.end = end;
                    return solved;
                }
                let mut trial = self.moved(&solved.iterate, &columns, &step, part);
                self.remember(&mut trial);
                if let Some(next) = self.evaluate(&trial, &columns)
                    && let Some(simplified) = factors.step(&next.residual, &scales)
                    && (norm(&simplified, &scales) <= (1.0 - 0.25 * part) * length || length <= CONVERGED)
                {
                    break Some((trial, next));
                }
                part *= 0.5;
                if part < SHORTEST * longest.min(1.0) {
                    break None;
                }
            };
            solved.steps += 1;
            let Some((iterate, next)) = accepted else {
                if self.token.is_cancelled() {
                    return solved;
                }
                if let Some(k) = shrinking {
                    solved.end = End::Vanished(k);
                } else {
                    fail(&mut solved, "Newton's method does not come nearer to a solution");
                }
                return solved;
            };
            (solved.iterate, system) = (iterate, next);
        }
        fail(&mut solved, "Newton's method has not converged");
        solved
    }
}

/// Root mean square, relative to the sizes of the unknowns.
fn norm(step: &DVector<f64>, scales: &DVector<f64>) -> f64 {
    let sum: f64 = step.iter().zip(scales.iter()).map(|(x, s)| (x / s).powi(2)).sum();
    (sum / step.len() as f64).sqrt()
}

/// A factorised Jacobian matrix with rows and columns scaled.
struct Factors {
    rows: DVector<f64>,
    lu: LU<f64, Dyn, Dyn>,
}

impl Factors {
    fn new(jacobian: &DMatrix<f64>, scales: &DVector<f64>) -> Option<Self> {
        let mut matrix = jacobian.clone();
        for (j, mut column) in matrix.column_iter_mut().enumerate() {
            column *= scales[j];
        }
        let rows = DVector::from_iterator(matrix.nrows(), matrix.row_iter().map(|row| row.amax()));
        if rows.iter().any(|size| *size == 0.0 || !size.is_finite()) {
            return None;
        }
        for (i, mut row) in matrix.row_iter_mut().enumerate() {
            row /= rows[i];
        }
        Some(Self { rows, lu: matrix.lu() })
    }

    /// The largest residual, relative to the sizes of the rows.
    fn largest(&self, residual: &DVector<f64>) -> f64 {
        residual.iter().zip(self.rows.iter()).fold(0.0, |m: f64, (r, size)| m.max((r / size).abs()))
    }

    /// Newton's step.
    fn step(&self, residual: &DVector<f64>, scales: &DVector<f64>) -> Option<DVector<f64>> {
        let right = -residual.component_div(&self.rows);
        let step = self.lu.solve(&right)?.component_mul(scales);
        step.iter().all(|x| x.is_finite()).then_some(step)
    }
}
