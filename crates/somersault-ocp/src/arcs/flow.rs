//! The motion along an arc: (x̃, λ) with the controls that its conditions determine, and its transition matrix.

use super::hamiltonian::{ArcFunctions, Hamiltonian};
use super::kind::{ArcKind, ControlKind};
use crate::collocation::Vector;
use nalgebra::DMatrix;
use somersault_core::cancel::CancellationToken;
use somersault_expr::{Derivative, Evaluator, ExprError, ExprFunction};
use somersault_integrators::driver::{Adaptive, Steps};
use somersault_integrators::methods::{Dop853, RungeKuttaMuntheKaas};
use somersault_integrators::run::Run;
use somersault_integrators::state::State;
use somersault_integrators::system::{OneForm, System};
use std::cell::RefCell;

/// Relative and absolute tolerance of each step, states and costates divided by their sizes.
const TOLERANCE: f64 = 1e-14;
/// Steps of a segment at most.
const MOST_STEPS: usize = 5_000;
/// Newton's steps for the controls of a point.
const MOST_NEWTON: usize = 30;
/// Relative change of the controls after which they are not improved any more.
const SETTLED: f64 = 1e-14;

/// A function with its Jacobian matrix, evaluated.
#[derive(Debug, Clone)]
struct Evaluated {
    values: Evaluator,
    derivative: Derivative,
    entries: Evaluator,
    pub(super) out: Vec<f64>,
    by: Vec<f64>,
}

impl Evaluated {
    fn try_new(function: &ExprFunction) -> Result<Self, ExprError> {
        let derivative = function.jacobian()?.clone();
        let (values, entries) = (function.evaluator(), derivative.evaluator());
        let (out, by) = (vec![0.0; values.n_outputs()], vec![0.0; entries.n_outputs()]);
        Ok(Self { values, derivative, entries, out, by })
    }

    /// Lengths are those that the evaluators were made with; what has no value is NaN.
    fn evaluate(&mut self, inputs: &[f64]) {
        if self.values.evaluate(inputs, &mut self.out).is_err() {
            self.out.fill(f64::NAN);
        }
    }

    fn differentiate(&mut self, inputs: &[f64]) {
        if self.entries.evaluate(inputs, &mut self.by).is_err() {
            self.by.fill(f64::NAN);
        }
    }

    fn entries(&self) -> impl Iterator<Item = (usize, usize, f64)> + '_ {
        self.derivative.sparsity().entries().zip(&self.by).map(|((row, column), &value)| (row, column, value))
    }
}

/// An arc's equations, closed by its conditions.
#[derive(Debug, Clone)]
pub(super) struct ArcFlow {
    n: usize,
    /// Inputs that the conditions determine.
    unknowns: Vec<usize>,
    rates: Evaluated,
    conditions: Evaluated,
    observables: Evaluated,
    inputs: Vec<f64>,
    /// Conditions by unknowns.
    matrix: DMatrix<f64>,
}

impl ArcFlow {
    pub(super) fn try_new(hamiltonian: &mut Hamiltonian, kind: &ArcKind) -> Result<Self, ExprError> {
        let ArcFunctions { rates, conditions, observables } = hamiltonian.arc(kind)?;
        let unknowns = hamiltonian.unknowns(kind);
        let n = hamiltonian.n;
        let mut inputs = vec![0.0; 2 * n + hamiltonian.m + 1];
        for (i, (control, bounds)) in kind.controls.iter().zip(&hamiltonian.control_bounds).enumerate() {
            match control {
                ControlKind::Lower => inputs[2 * n + i] = bounds.lower,
                ControlKind::Upper => inputs[2 * n + i] = bounds.upper,
                ControlKind::Interior | ControlKind::Singular => {}
            }
        }
        let k = unknowns.len();
        Ok(Self {
            n,
            unknowns,
            rates: Evaluated::try_new(&rates)?,
            conditions: Evaluated::try_new(&conditions)?,
            observables: Evaluated::try_new(&observables)?,
            inputs,
            matrix: DMatrix::zeros(k, k),
        })
    }

    /// Where the search for the controls starts: u and η, of which those at bounds are not taken.
    pub(super) fn set_guess(&mut self, guess: &[f64]) {
        for &unknown in &self.unknowns {
            self.inputs[unknown] = guess[unknown - 2 * self.n];
        }
    }

    /// u and η, as they are.
    pub(super) fn guess(&self) -> Vec<f64> {
        self.inputs[2 * self.n..].to_vec()
    }

    /// Finds the controls at a point; false where there are none.
    fn close(&mut self, point: &[f64]) -> bool {
        self.inputs[..2 * self.n].copy_from_slice(point);
        let k = self.unknowns.len();
        if k == 0 {
            return true;
        }
        for _ in 0..MOST_NEWTON {
            self.conditions.evaluate(&self.inputs);
            self.conditions.differentiate(&self.inputs);
            self.matrix.fill(0.0);
            for (row, column, value) in self.conditions.entries() {
                if let Some(column) = self.unknowns.iter().position(|&u| u == column) {
                    self.matrix[(row, column)] = value;
                }
            }
            let right = nalgebra::DVector::from_column_slice(&self.conditions.out);
            let Some(step) = self.matrix.clone().lu().solve(&right) else { return false };
            let (mut change, mut size) = (0.0f64, 0.0f64);
            for (&unknown, step) in self.unknowns.iter().zip(step.iter()) {
                self.inputs[unknown] -= step;
                change = change.max(step.abs());
                size = size.max(self.inputs[unknown].abs());
            }
            // a NaN is not small
            if !(change.is_finite() && size.is_finite()) {
                return false;
            }
            if change <= SETTLED * (1.0 + size) {
                return true;
            }
        }
        // rounding may keep a step from vanishing where conditions are steep
        self.conditions.evaluate(&self.inputs);
        self.conditions.out.iter().all(|x| x.abs() <= 1e-10)
    }

    /// What controls and η change by with the point: unknowns by 2n.
    fn sensitivity(&mut self) -> Option<DMatrix<f64>> {
        let (n, k) = (self.n, self.unknowns.len());
        let mut by_point = DMatrix::zeros(k, 2 * n);
        if k == 0 {
            return Some(by_point);
        }
        self.conditions.differentiate(&self.inputs);
        self.matrix.fill(0.0);
        for (row, column, value) in self.conditions.entries() {
            if column < 2 * n {
                by_point[(row, column)] = -value;
            } else if let Some(column) = self.unknowns.iter().position(|&u| u == column) {
                self.matrix[(row, column)] = value;
            }
        }
        self.matrix.clone().lu().solve(&by_point)
    }

    /// ẋ, λ̇ and L.
    fn rates(&mut self, point: &[f64], out: &mut [f64]) {
        if self.close(point) {
            self.rates.evaluate(&self.inputs);
            out.copy_from_slice(&self.rates.out);
        } else {
            out.fill(f64::NAN);
        }
    }

    /// The rates at a point: ẋ, λ̇, L.
    pub(super) fn rates_at(&mut self, point: &[f64]) -> Vec<f64> {
        let mut out = vec![0.0; 2 * self.n + 1];
        self.rates(point, &mut out);
        out
    }

    /// ∂(ẋ, λ̇)/∂(x̃, λ), controls included, after [`ArcFlow::rates`] at the same point.
    fn jacobian(&mut self) -> Option<DMatrix<f64>> {
        let chain = self.sensitivity()?;
        self.rates.differentiate(&self.inputs);
        Some(closed(&self.rates, 2 * self.n, &self.unknowns, &chain))
    }

    /// The observables at a point, and their derivatives by it.
    pub(super) fn observe(&mut self, point: &[f64]) -> Option<(Vec<f64>, DMatrix<f64>)> {
        if !self.close(point) {
            return None;
        }
        let chain = self.sensitivity()?;
        self.observables.evaluate(&self.inputs);
        self.observables.differentiate(&self.inputs);
        let rows = self.observables.out.len();
        Some((self.observables.out.clone(), closed(&self.observables, rows, &self.unknowns, &chain)))
    }

    /// The observables alone.
    pub(super) fn observed(&mut self, point: &[f64]) -> Option<Vec<f64>> {
        self.close(point).then(|| {
            self.observables.evaluate(&self.inputs);
            self.observables.out.clone()
        })
    }
}

/// The first rows of a Jacobian matrix by the point, with the unknowns' part by the chain rule.
fn closed(function: &Evaluated, rows: usize, unknowns: &[usize], chain: &DMatrix<f64>) -> DMatrix<f64> {
    let columns = chain.ncols();
    let mut by = DMatrix::zeros(rows, columns);
    for (row, column, value) in function.entries().filter(|(row, ..)| *row < rows) {
        if column < columns {
            by[(row, column)] += value;
        } else if let Some(unknown) = unknowns.iter().position(|&u| u == column) {
            for to in 0..columns {
                by[(row, to)] += value * chain[(unknown, to)];
            }
        }
    }
    by
}

/// Where a segment arrives.
#[derive(Debug, Clone)]
pub(super) struct Arrival {
    /// (x̃, λ).
    pub(super) point: Vec<f64>,
    /// ∫ L dt.
    pub(super) cost: f64,
    /// ∂(x̃, λ)/∂(x̃, λ) at its start, where that was requested.
    pub(super) transition: Option<DMatrix<f64>>,
}

/// The arc as a system for the integrators: numbers divided by their sizes, then ∫ L, then Φ by columns.
struct Segment<'a> {
    flow: RefCell<&'a mut ArcFlow>,
    sizes: &'a [f64],
    has_matrix: bool,
    token: &'a CancellationToken,
}

impl System for Segment<'_> {
    type Configuration = Vector;
    type Forms = OneForm;
    type Workspace = ();
    fn workspace(&self) {}

    fn velocity(&self, (): &mut (), _: f64, x: &State<Vector>, out: &mut Vector) {
        if self.token.is_cancelled() {
            out.0.fill(f64::NAN);
            return;
        }
        let flow = &mut **self.flow.borrow_mut();
        let n = self.sizes.len();
        let scaled = &x.configuration.0;
        let point: Vec<f64> = scaled[..n].iter().zip(self.sizes).map(|(x, size)| x * size).collect();
        flow.rates(&point, &mut out.0[..n + 1]);
        out.0[..n].iter_mut().zip(self.sizes).for_each(|(x, size)| *x /= size);
        if !self.has_matrix {
            return;
        }
        let Some(mut jacobian) = flow.jacobian() else {
            out.0.fill(f64::NAN);
            return;
        };
        for (i, row) in self.sizes.iter().enumerate() {
            for (j, column) in self.sizes.iter().enumerate() {
                jacobian[(i, j)] *= column / row;
            }
        }
        for column in 0..n {
            let first = n + 1 + column * n;
            let (from, to) = (&scaled[first..first + n], &mut out.0[first..first + n]);
            to.fill(0.0);
            for (j, x) in from.iter().enumerate().filter(|(_, x)| **x != 0.0) {
                to.iter_mut().zip(jacobian.column(j).iter()).for_each(|(to, d)| *to += d * x);
            }
        }
    }

    fn acceleration(&self, (): &mut (), _: f64, _: &State<Vector>, out: &mut Vector) {
        out.0.fill(0.0);
    }
}

/// Follows an arc for a duration; nothing where that is not possible, or it is cancelled.
pub(super) fn follow(
    flow: &mut ArcFlow,
    sizes: &[f64],
    point: &[f64],
    duration: f64,
    has_matrix: bool,
    token: &CancellationToken,
) -> Option<Arrival> {
    let n = sizes.len();
    let mut start: Vec<f64> = point.iter().zip(sizes).map(|(x, size)| x / size).collect();
    start.push(0.0);
    if has_matrix {
        start.extend(DMatrix::<f64>::identity(n, n).iter());
    }
    let reached = if duration > 0.0 {
        let initial = State { rate: Vector(vec![0.0; start.len()]), configuration: Vector(start) };
        let control = Adaptive {
            first_step: Some(0.1 * duration),
            max_steps: MOST_STEPS,
            ..Adaptive::with_tolerances(TOLERANCE, TOLERANCE)
        };
        let segment = Segment { flow: RefCell::new(flow), sizes, has_matrix, token };
        let stepper = RungeKuttaMuntheKaas::<Dop853>::default();
        let steps = Steps::adapted((0.0, duration), control);
        Run::by_embedded_stepper(&segment, &stepper, steps).from(&initial).ok()?.state.configuration.0
    } else {
        start
    };
    let transition =
        has_matrix.then(|| DMatrix::from_fn(n, n, |i, j| reached[n + 1 + j * n + i] * sizes[i] / sizes[j]));
    let point = reached[..n].iter().zip(sizes).map(|(x, size)| x * size).collect();
    Some(Arrival { point, cost: reached[n], transition })
}
