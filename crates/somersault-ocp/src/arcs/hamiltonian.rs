//! The Hamiltonian as an expression, and what follows from it on each kind of arc.
//!
//! With x̃ = (x, p) and, where something names the time, t as a further state of rate one,
//!
//! ```text
//! H = L + λᵀf      ẋ = f      λ̇ = −H_x − η c^(q)_x      σ = H_u      σ̇, σ̈ along (ẋ, λ̇)      c, ċ, … c^(q) along ẋ
//! ```
//! All of them are expressions of x̃, λ, u and η; η is there where a bound of the state c ≤ 0 of order q holds.

use super::kind::{ArcKind, ControlKind};
use crate::collocation::{CollocationError, Interval, Phase};
use somersault_core::random::SplitMix64;
use somersault_expr::{Block, ExprError, ExprFunction, Expression, Graph};

/// Largest order of a bound of the state that arcs are made of.
pub(super) const MOST_ORDER: usize = 2;
/// What counts as zero, relative to the size of a slope of the Hamiltonian.
const ZERO: f64 = 1e-10;

/// A bound of the state, c ≤ 0.
pub(super) struct StateBound {
    /// What is bounded.
    pub(super) name: String,
    /// Which row of the problem, a state or a path constraint, and whether from above.
    pub(super) row: BoundedRow,
    pub(super) is_upper: bool,
    /// c, ċ, …: the last one is the first that names a control.
    derivatives: Vec<Expression>,
    /// The controls in the last one.
    pub(super) controls: Vec<usize>,
}

/// What has a bound at all times.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum BoundedRow {
    State(usize),
    Path(usize),
}

impl StateBound {
    /// How often c is differentiated until a control appears.
    pub(super) fn order(&self) -> usize {
        self.derivatives.len() - 1
    }
}

/// H and its derivatives.
pub(super) struct Hamiltonian {
    graph: Graph,
    /// Of x, and of x̃ with parameters and time.
    pub(super) n_original: usize,
    pub(super) n: usize,
    pub(super) m: usize,
    /// Which state the time is, if something names it.
    pub(super) time: Option<usize>,
    /// x̃, λ, u, η.
    inputs: Vec<Expression>,
    rates: Vec<Expression>,
    falls: Vec<Expression>,
    running_cost: Expression,
    value: Expression,
    slopes: Vec<Expression>,
    slope_rates: Vec<Expression>,
    second_rates: Vec<Expression>,
    /// The states that quaternions begin at.
    pub(super) quaternions: Vec<usize>,
    /// Which controls H is affine in.
    pub(super) is_affine: Vec<bool>,
    pub(super) control_bounds: Vec<Interval>,
    pub(super) bounds: Vec<StateBound>,
}

/// What an arc evaluates: functions of x̃, λ, u and η.
pub(super) struct ArcFunctions {
    /// ẋ, λ̇, L.
    pub(super) rates: ExprFunction,
    /// What is zero where u and η are right.
    pub(super) conditions: ExprFunction,
    /// [`Observables`].
    pub(super) observables: ExprFunction,
}

/// Where quantities stand among the observables of an arc.
#[derive(Debug, Clone)]
pub(super) struct Observables {
    m: usize,
    /// First of each bound.
    bounds: Vec<usize>,
}

impl Observables {
    pub(super) const HAMILTONIAN: usize = 0;

    pub(super) fn slope(&self, control: usize) -> usize {
        1 + control
    }
    pub(super) fn slope_rate(&self, control: usize) -> usize {
        1 + self.m + control
    }
    /// ∂σ̈/∂u.
    pub(super) fn kelley(&self, control: usize) -> usize {
        1 + 2 * self.m + control
    }
    pub(super) fn control(&self, control: usize) -> usize {
        1 + 3 * self.m + control
    }
    /// H_uu, by rows.
    pub(super) fn curvature(&self, row: usize, column: usize) -> usize {
        1 + 4 * self.m + row * self.m + column
    }
    /// η.
    pub(super) fn multiplier(&self) -> usize {
        1 + 4 * self.m + self.m * self.m
    }
    /// A derivative of c, below the order.
    pub(super) fn bound(&self, bound: usize, derivative: usize) -> usize {
        self.bounds[bound] + derivative
    }
}

/// A path constraint with a bound that names a control, in a sentence: no arcs are made of it.
pub(super) fn mixed_constraint(phase: &Phase, path: &ExprFunction) -> Result<Option<String>, ExprError> {
    let (n, m) = (phase.n_states(), phase.n_controls());
    let is_bounded = |row: usize| {
        let bound = row.checked_sub(1).map(|k| &phase.bounds.path[k]);
        bound.is_some_and(|bound| bound.lower.is_finite() || bound.upper.is_finite())
    };
    let found = path
        .jacobian()?
        .sparsity()
        .entries()
        .find(|(row, column)| is_bounded(*row) && (n..n + m).contains(column));
    Ok(found.map(|(row, _)| {
        let name = phase.name_of_row(n + m + row - 1);
        format!("{name} names a control; bounds that do are not made arcs of yet")
    }))
}

/// Whether a function names an input.
fn names(function: &ExprFunction, input: usize) -> Result<bool, ExprError> {
    let columns = &function.jacobian()?.sparsity().columns;
    Ok(columns[input] < columns[input + 1])
}

impl Hamiltonian {
    /// That of a phase; `samples` are places (x, u, λ), near which it is looked at where structure does not tell what is zero.
    pub(super) fn try_new(
        phase: &Phase,
        [dynamics, path, _]: &[ExprFunction; 3],
        samples: &[[Vec<f64>; 3]],
        parameters: &[f64],
        start: f64,
    ) -> Result<Self, CollocationError> {
        let (n_original, m, n_parameters) = (phase.n_states(), phase.n_controls(), phase.n_parameters());
        let at_time = n_original + m + n_parameters;
        let has_time = names(dynamics, at_time)? || names(path, at_time)?;
        let n = n_original + n_parameters + usize::from(has_time);
        let mut graph = Graph::new();
        let inputs: Vec<Expression> = (0..2 * n + m + 1).map(|_| graph.input()).collect();
        let (states, costates, controls) = (&inputs[..n], &inputs[n..2 * n], &inputs[2 * n..2 * n + m]);
        let (zero, one) = (graph.constant(0.0), graph.constant(1.0));
        let mut arguments = states[..n_original].to_vec();
        arguments.extend(controls);
        arguments.extend(&states[n_original..n_original + n_parameters]);
        arguments.push(if has_time { states[n - 1] } else { zero });
        let mut rates = graph.insert(dynamics.graph(), dynamics.outputs(), &arguments)?;
        let path = graph.insert(path.graph(), path.outputs(), &arguments)?;
        let running_cost = path[0];
        let mut value = running_cost;
        for (&costate, &rate) in costates.iter().zip(&rates) {
            let product = graph.multiply(costate, rate);
            value = graph.add(value, product);
        }
        rates.resize(n_original + n_parameters, zero);
        if has_time {
            rates.push(one);
        }
        let slopes = graph.gradient(value, controls)?;
        let falls: Vec<Expression> =
            graph.gradient(value, states)?.into_iter().map(|x| graph.negative(x)).collect();
        let (slope_rates, second_rates) = (vec![zero; m], vec![zero; m]);
        let (inputs, time) = (inputs.clone(), has_time.then_some(n - 1));
        let mut hamiltonian = Self {
            graph,
            n_original,
            n,
            m,
            time,
            inputs,
            rates,
            falls,
            running_cost,
            value,
            slopes,
            slope_rates,
            second_rates,
            quaternions: phase.quaternion_places().to_vec(),
            is_affine: Vec::new(),
            control_bounds: phase.bounds.control.clone(),
            bounds: Vec::new(),
        };
        let places = hamiltonian.places(samples, parameters, start);
        hamiltonian.find_affine(&places)?;
        hamiltonian.differentiate_slopes()?;
        let states = phase.bounds.state.iter().enumerate().map(|(i, b)| (BoundedRow::State(i), *b));
        let rows = phase.bounds.path.iter().enumerate().map(|(i, b)| (BoundedRow::Path(i), *b));
        for (row, Interval { lower, upper }) in states.chain(rows).collect::<Vec<_>>() {
            let (number, expression) = match row {
                BoundedRow::State(i) => (i, hamiltonian.inputs[i]),
                BoundedRow::Path(i) => (n_original + m + i, path[1 + i]),
            };
            for (is_upper, bound) in [(false, lower), (true, upper)] {
                if !bound.is_finite() {
                    continue;
                }
                let graph = &mut hamiltonian.graph;
                let limit = graph.constant(bound);
                let excess = if is_upper {
                    graph.subtract(expression, limit)
                } else {
                    graph.subtract(limit, expression)
                };
                let name = phase.name_of_row(number);
                let bound = hamiltonian.bound(excess, row, is_upper, name, &places)?;
                hamiltonian.bounds.push(bound);
            }
        }
        Ok(hamiltonian)
    }

    /// All inputs at and near places of a motion.
    fn places(&self, samples: &[[Vec<f64>; 3]], parameters: &[f64], start: f64) -> Vec<Vec<f64>> {
        let mut random = SplitMix64::new(1);
        let mut places = Vec::new();
        for [state, control, costate] in samples {
            let mut place = vec![0.0; self.inputs.len()];
            place[..self.n_original].copy_from_slice(state);
            place[self.n_original..self.n_original + parameters.len()].copy_from_slice(parameters);
            if let Some(time) = self.time {
                place[time] = start;
            }
            place[self.n..self.n + self.n_original].copy_from_slice(costate);
            place[2 * self.n..2 * self.n + self.m].copy_from_slice(control);
            // away from where something is zero by chance
            place.iter_mut().for_each(|x| *x += 1e-2 * (1.0 + x.abs()) * (random.unit() - 0.5));
            places.push(place);
        }
        places
    }

    fn function(&self, outputs: Vec<Expression>) -> Result<ExprFunction, ExprError> {
        ExprFunction::new(self.graph.clone(), vec![Block::new("arguments", [self.inputs.len()])], outputs)
    }

    fn controls(&self) -> &[Expression] {
        &self.inputs[2 * self.n..2 * self.n + self.m]
    }

    /// The largest size of each entry of expressions at places.
    fn sizes(&self, outputs: Vec<Expression>, places: &[Vec<f64>]) -> Result<Vec<f64>, CollocationError> {
        let mut sizes = vec![0.0; outputs.len()];
        let mut evaluator = self.function(outputs)?.evaluator();
        let mut values = sizes.clone();
        for place in places {
            evaluator.evaluate(place, &mut values)?;
            sizes.iter_mut().zip(&values).for_each(|(size, x)| *size = x.abs().max(*size));
        }
        Ok(sizes)
    }

    /// H_uu, by rows.
    fn curvature(&mut self) -> Result<Vec<Expression>, ExprError> {
        let controls = self.controls().to_vec();
        let mut all = Vec::new();
        for slope in self.slopes.clone() {
            all.extend(self.graph.gradient(slope, &controls)?);
        }
        Ok(all)
    }

    fn find_affine(&mut self, places: &[Vec<f64>]) -> Result<(), CollocationError> {
        let curvature = self.curvature()?;
        let sizes = self.sizes(curvature, places)?;
        let slopes = self.sizes(self.slopes.clone(), places)?;
        let size = slopes.iter().fold(f64::MIN_POSITIVE, |a, b| a.max(*b));
        let controls = &places.iter().flat_map(|place| &place[2 * self.n..2 * self.n + self.m]);
        let largest = controls.clone().fold(1.0, |a: f64, b| a.max(b.abs()));
        // what a change of the control changes of the slope
        let is_zero = |row: &[f64]| row.iter().all(|x| x * largest <= ZERO * size);
        self.is_affine = (0..self.m).map(|i| is_zero(&sizes[i * self.m..(i + 1) * self.m])).collect();
        Ok(())
    }

    /// σ̇ and σ̈ of controls that H is affine in.
    fn differentiate_slopes(&mut self) -> Result<(), ExprError> {
        let field: Vec<Expression> = self.rates.iter().chain(&self.falls).copied().collect();
        let inputs = self.inputs[..2 * self.n].to_vec();
        for i in (0..self.m).filter(|&i| self.is_affine[i]) {
            self.slope_rates[i] = self.graph.tangent(&[self.slopes[i]], &inputs, &field)?[0];
            self.second_rates[i] = self.graph.tangent(&[self.slope_rates[i]], &inputs, &field)?[0];
        }
        Ok(())
    }

    /// Differentiates c, which names no control, until one appears.
    fn bound(
        &mut self,
        excess: Expression,
        row: BoundedRow,
        is_upper: bool,
        name: String,
        places: &[Vec<f64>],
    ) -> Result<StateBound, CollocationError> {
        let (states, controls, rates) =
            (self.inputs[..self.n].to_vec(), self.controls().to_vec(), self.rates.clone());
        let mut derivatives = vec![excess];
        loop {
            let last = derivatives[derivatives.len() - 1];
            let by = self.graph.gradient(last, &controls)?;
            let sizes = self.sizes(by, places)?;
            let size = self.sizes(vec![last], places)?[0].max(f64::MIN_POSITIVE);
            let named: Vec<usize> = (0..self.m).filter(|&i| sizes[i] > ZERO * size).collect();
            // one of too high an order counts where it acts only
            if !named.is_empty() || derivatives.len() > MOST_ORDER {
                return Ok(StateBound { name, row, is_upper, derivatives, controls: named });
            }
            let next = self.graph.tangent(&[last], &states, &rates)?[0];
            derivatives.push(next);
        }
    }

    /// Places of quantities among observables.
    pub(super) fn observables(&self) -> Observables {
        let mut next = 2 + 4 * self.m + self.m * self.m;
        let mut bounds = Vec::new();
        for bound in &self.bounds {
            bounds.push(next);
            next += bound.order();
        }
        Observables { m: self.m, bounds }
    }

    /// The inputs that an arc finds by its conditions: controls that are not at bounds, and η.
    pub(super) fn unknowns(&self, kind: &ArcKind) -> Vec<usize> {
        let free = (0..self.m).filter(|&i| !kind.controls[i].is_at_bound()).map(|i| 2 * self.n + i);
        free.chain(kind.contact.map(|_| 2 * self.n + self.m)).collect()
    }

    /// What an arc of a kind evaluates.
    pub(super) fn arc(&mut self, kind: &ArcKind) -> Result<ArcFunctions, ExprError> {
        let (n, m) = (self.n, self.m);
        let multiplier = self.inputs[2 * n + m];
        let (states, controls) = (self.inputs[..n].to_vec(), self.controls().to_vec());
        let last = kind.contact.map(|bound| self.bounds[bound].derivatives[self.bounds[bound].order()]);
        let mut rates = self.rates.clone();
        // H + η c^(q)
        let mut augmented = self.value;
        if let Some(last) = last {
            let product = self.graph.multiply(multiplier, last);
            augmented = self.graph.add(augmented, product);
            for by_state in self.graph.gradient(augmented, &states)? {
                rates.push(self.graph.negative(by_state));
            }
        } else {
            rates.extend(&self.falls);
        }
        rates.push(self.running_cost);
        let slopes = self.graph.gradient(augmented, &controls)?;
        let mut conditions = Vec::new();
        for (i, control) in kind.controls.iter().enumerate() {
            match control {
                ControlKind::Lower | ControlKind::Upper => {}
                ControlKind::Interior => conditions.push(slopes[i]),
                ControlKind::Singular => conditions.push(self.second_rates[i]),
            }
        }
        conditions.extend(last);
        let mut observables = vec![self.value];
        observables.extend(&self.slopes);
        observables.extend(&self.slope_rates);
        for (i, &control) in controls.iter().enumerate() {
            let by = self.graph.gradient(self.second_rates[i], &[control])?;
            observables.extend(by);
        }
        observables.extend(&controls);
        observables.extend(self.curvature()?);
        observables.push(multiplier);
        for bound in &self.bounds {
            observables.extend(&bound.derivatives[..bound.order()]);
        }
        Ok(ArcFunctions {
            rates: self.function(rates)?,
            conditions: self.function(conditions)?,
            observables: self.function(observables)?,
        })
    }

    /// The gradients of c, … c^(q−1) by x̃, by which costates jump, with what they change by: functions of all inputs.
    pub(super) fn bound_gradients(&self, bound: usize) -> Result<ExprFunction, ExprError> {
        let (mut graph, derivatives) = (self.graph.clone(), &self.bounds[bound].derivatives);
        let mut outputs = Vec::new();
        for &derivative in &derivatives[..derivatives.len() - 1] {
            outputs.extend(graph.gradient(derivative, &self.inputs[..self.n])?);
        }
        ExprFunction::new(graph, vec![Block::new("arguments", [self.inputs.len()])], outputs)
    }

    /// The same gradients at a place.
    pub(super) fn bound_gradients_at(&self, bound: usize, inputs: &[f64]) -> Option<Vec<Vec<f64>>> {
        let mut evaluator = self.bound_gradients(bound).ok()?.evaluator();
        let mut values = vec![0.0; evaluator.n_outputs()];
        evaluator.evaluate(inputs, &mut values).ok()?;
        Some(values.chunks_exact(self.n).map(<[f64]>::to_vec).collect())
    }

    /// The size of ∂c^(q)/∂u at a place, for each control.
    pub(super) fn grip(&mut self, bound: usize, inputs: &[f64]) -> Result<Vec<f64>, CollocationError> {
        let controls = self.controls().to_vec();
        let last = self.bounds[bound].derivatives[self.bounds[bound].order()];
        let by = self.graph.gradient(last, &controls)?;
        self.sizes(by, &[inputs.to_vec()])
    }

    /// The largest ∂σ̈/∂u of a control at and near places, relative to σ̈.
    pub(super) fn second_order(
        &mut self,
        control: usize,
        places: &[Vec<f64>],
    ) -> Result<f64, CollocationError> {
        let input = self.controls()[control];
        let by = self.graph.gradient(self.second_rates[control], &[input])?;
        let size = self.sizes(
            vec![self.slopes[control], self.slope_rates[control], self.second_rates[control]],
            places,
        )?;
        let size = size.iter().fold(f64::MIN_POSITIVE, |a, b| a.max(*b));
        Ok(self.sizes(by, places)?[0] / size)
    }

    /// All inputs near places of a motion, to look at what is zero.
    pub(super) fn places_near(
        &self,
        samples: &[[Vec<f64>; 3]],
        parameters: &[f64],
        start: f64,
    ) -> Vec<Vec<f64>> {
        self.places(samples, parameters, start)
    }
}
