//! Functions with their first and second derivatives.
//!
//! What a user writes once over a generic scalar ([`Dynamics`], [`Terms`]) is differentiated by dual and hyper-dual
//! numbers: exactly, in n evaluations for a Jacobian and n (n + 1)/2 for a Hessian. Derivatives that are at
//! hand otherwise come in as a [`VectorFunction`].

use super::error::Untraced;
use super::wrong_derivative::{Compared, Labels, contradicted};
use crate::WrongDerivative;
use nalgebra::DMatrix;
use num_dual::{Dual64, HyperDual64};
use somersault_core::Scalar;
use somersault_core::differences::Differences;
use somersault_expr::{Block, ExprFunction};
use somersault_nlp::EvaluationError;
use std::sync::Arc;

/// Where the equations of motion, the running cost and the path constraints are requested.
#[derive(Debug, Clone, Copy)]
pub struct Point<'a, T> {
    /// x.
    pub state: &'a [T],
    /// u.
    pub control: &'a [T],
    /// p, constant in time.
    pub parameters: &'a [T],
    /// t.
    pub time: T,
}

/// Both ends of a phase.
#[derive(Debug, Clone, Copy)]
pub struct Ends<'a, T> {
    /// x(t₀).
    pub initial_state: &'a [T],
    /// x(t_f).
    pub final_state: &'a [T],
    /// p.
    pub parameters: &'a [T],
    /// t₀.
    pub initial_time: T,
    /// t_f.
    pub final_time: T,
}

/// Equations of motion ẋ = f(x, u, p, t), written once for all scalars.
pub trait Dynamics: Send + Sync {
    /// Length of x.
    fn n_states(&self) -> usize;
    /// Length of u.
    fn n_controls(&self) -> usize;
    /// Length of p.
    fn n_parameters(&self) -> usize {
        0
    }
    /// ẋ.
    fn rates<T: Scalar>(&self, at: &Point<'_, T>, rates: &mut [T]);
}

/// What is made small and what is kept to, written once for all scalars. The cost of a phase is the end cost and
/// the integral of the running cost.
pub trait Terms: Send + Sync {
    /// Path constraints, at each collocation point.
    fn n_path_constraints(&self) -> usize {
        0
    }
    /// Constraints on both ends together.
    fn n_end_constraints(&self) -> usize {
        0
    }
    /// L(x, u, p, t) of Lagrange's form.
    fn running_cost<T: Scalar>(&self, _at: &Point<'_, T>) -> T {
        T::zero()
    }
    /// g(x, u, p, t).
    fn path_constraints<T: Scalar>(&self, _at: &Point<'_, T>, _values: &mut [T]) {}
    /// Φ of Mayer's form.
    fn end_cost<T: Scalar>(&self, _ends: &Ends<'_, T>) -> T {
        T::zero()
    }
    /// b(x(t₀), x(t_f), p, t₀, t_f).
    fn end_constraints<T: Scalar>(&self, _ends: &Ends<'_, T>, _values: &mut [T]) {}
}

/// No costs and no constraints.
impl Terms for () {}

/// A function ℝⁿ → ℝᵐ with derivatives. Of a point the arguments are x, u, p, t; of ends x(t₀), x(t_f), p,
/// t₀, t_f. Values need not be finite: where one is not, a solver steps back.
pub trait VectorFunction: Send {
    /// m.
    fn n_outputs(&self) -> usize;
    /// The values.
    fn evaluate(&mut self, arguments: &[f64], values: &mut [f64]) -> Result<(), EvaluationError>;
    /// All of the m × n Jacobian.
    fn jacobian(&mut self, arguments: &[f64], jacobian: &mut DMatrix<f64>) -> Result<(), EvaluationError>;
    /// Adds Σ wᵢ ∇²fᵢ to the n × n `hessian`, at least in its upper triangle.
    fn add_hessian(
        &mut self,
        arguments: &[f64],
        weights: &[f64],
        hessian: &mut DMatrix<f64>,
    ) -> Result<(), EvaluationError>;

    /// The same function as expressions of its arguments, which have derivatives of any order: those that hold at the point `at`, where
    /// it is one of several. What brings its derivatives has none unless it says so.
    fn expressions(&self, _at: &[f64]) -> Result<ExprFunction, Untraced> {
        Err(Untraced::Given)
    }

    /// Receives, before a solve, how large arguments typically are about a point: steps of differences follow from that.
    fn set_sizes(&mut self, _arguments: &[f64], _sizes: &[f64]) -> Result<(), EvaluationError> {
        Ok(())
    }

    /// How accurate it is, if it is less so than rounding.
    fn relative_errors(&self) -> RelativeErrors {
        RelativeErrors::default()
    }

    /// Whether derivatives are compared with differences before a solve, as those should be that were written for one problem.
    /// All others are where a solve does not converge.
    fn brings_derivatives(&self) -> bool {
        false
    }

    /// A derivative that differences contradict at a point, if there is one. `sizes` are those of arguments, typically; the labels
    /// are for messages.
    fn wrong_derivative(
        &mut self,
        arguments: &[f64],
        sizes: &[f64],
        labels: &Labels,
    ) -> Result<Option<WrongDerivative>, EvaluationError> {
        let mut whole = Whole { function: self, n: arguments.len() };
        contradicted(&mut whole, labels, arguments, sizes, Differences::OF_ROUNDED)
    }
}

/// A [`VectorFunction`] with `n` arguments, all of whose derivatives are compared.
struct Whole<'a, F: ?Sized> {
    function: &'a mut F,
    n: usize,
}

impl<F: VectorFunction + ?Sized> Compared for Whole<'_, F> {
    fn values(&mut self, points: &[f64], values: &mut [f64]) -> Result<(), EvaluationError> {
        let m = self.function.n_outputs();
        let mut pairs = points.chunks_exact(self.n).zip(values.chunks_exact_mut(m.max(1)));
        pairs.try_for_each(|(point, values)| self.function.evaluate(point, values))
    }

    fn jacobians(&mut self, points: &[f64], jacobians: &mut [f64]) -> Result<(), EvaluationError> {
        let (n, m) = (self.n, self.function.n_outputs());
        let mut matrix = DMatrix::zeros(m, n);
        for (point, out) in points.chunks_exact(n).zip(jacobians.chunks_exact_mut((m * n).max(1))) {
            self.function.jacobian(point, &mut matrix)?;
            out.iter_mut().enumerate().for_each(|(k, out)| *out = matrix[(k / n, k % n)]);
        }
        Ok(())
    }

    fn hessian(&mut self, at: &[f64], weights: &[f64]) -> Result<Option<Vec<f64>>, EvaluationError> {
        let mut matrix = DMatrix::zeros(self.n, self.n);
        self.function.add_hessian(at, weights, &mut matrix)?;
        matrix.fill_lower_triangle_with_upper_triangle();
        Ok(Some(matrix.as_slice().to_vec()))
    }
}

/// Relative errors of a function, zero where they are rounding.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct RelativeErrors {
    /// Of the values.
    pub values: f64,
    /// Of the Jacobian.
    pub derivatives: f64,
}

impl RelativeErrors {
    /// Those of two functions together.
    pub(super) fn max(self, other: Self) -> Self {
        Self { values: self.values.max(other.values), derivatives: self.derivatives.max(other.derivatives) }
    }
}

/// Sizes of a phase's arguments.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Sizes {
    pub(super) states: usize,
    pub(super) controls: usize,
    pub(super) parameters: usize,
}

impl Sizes {
    /// Length of (x, u, p, t).
    pub(super) fn point(&self) -> usize {
        self.states + self.controls + self.parameters + 1
    }

    /// Length of (x(t₀), x(t_f), p, t₀, t_f).
    pub(super) fn ends(&self) -> usize {
        2 * self.states + self.parameters + 2
    }

    fn view<'a, T: Scalar>(&self, arguments: &'a [T]) -> Point<'a, T> {
        let (state, rest) = arguments.split_at(self.states);
        let (control, rest) = rest.split_at(self.controls);
        let (parameters, time) = rest.split_at(self.parameters);
        Point { state, control, parameters, time: time[0] }
    }

    fn view_ends<'a, T: Scalar>(&self, arguments: &'a [T]) -> Ends<'a, T> {
        let (initial_state, rest) = arguments.split_at(self.states);
        let (final_state, rest) = rest.split_at(self.states);
        let (parameters, times) = rest.split_at(self.parameters);
        Ends { initial_state, final_state, parameters, initial_time: times[0], final_time: times[1] }
    }
}

/// What duals go through.
pub(super) trait Formula: Send {
    fn n_outputs(&self) -> usize;
    fn evaluate<T: Scalar>(&self, arguments: &[T], values: &mut [T]);
}

/// What a user announces and does not write has no value, rather than zero or the last one.
fn unwritten<T: Scalar>(values: &mut [T]) {
    values.fill(nalgebra::convert(f64::NAN));
}

pub(super) struct DynamicsFormula<D>(pub(super) D, pub(super) Sizes);

impl<D: Dynamics> Formula for DynamicsFormula<D> {
    fn n_outputs(&self) -> usize {
        self.1.states
    }
    fn evaluate<T: Scalar>(&self, arguments: &[T], values: &mut [T]) {
        unwritten(values);
        self.0.rates(&self.1.view(arguments), values);
    }
}

/// The running cost, then the path constraints.
pub(super) struct PathFormula<C>(pub(super) Arc<C>, pub(super) Sizes);

impl<C: Terms> Formula for PathFormula<C> {
    fn n_outputs(&self) -> usize {
        1 + self.0.n_path_constraints()
    }
    fn evaluate<T: Scalar>(&self, arguments: &[T], values: &mut [T]) {
        let at = self.1.view(arguments);
        unwritten(values);
        values[0] = self.0.running_cost(&at);
        self.0.path_constraints(&at, &mut values[1..]);
    }
}

/// The end cost, then the end constraints.
pub(super) struct EndFormula<C>(pub(super) Arc<C>, pub(super) Sizes);

impl<C: Terms> Formula for EndFormula<C> {
    fn n_outputs(&self) -> usize {
        1 + self.0.n_end_constraints()
    }
    fn evaluate<T: Scalar>(&self, arguments: &[T], values: &mut [T]) {
        let ends = self.1.view_ends(arguments);
        unwritten(values);
        values[0] = self.0.end_cost(&ends);
        self.0.end_constraints(&ends, &mut values[1..]);
    }
}

/// The arguments of a function as the inputs of its expressions.
pub(super) fn arguments(n: usize) -> Vec<Block> {
    vec![Block::new("arguments", [n])]
}

/// A formula with derivatives by dual and hyper-dual numbers.
pub(super) struct ByDuals<F> {
    formula: F,
    first: (Vec<Dual64>, Vec<Dual64>),
    second: (Vec<HyperDual64>, Vec<HyperDual64>),
}

impl<F: Formula> ByDuals<F> {
    pub(super) fn new(formula: F, n_arguments: usize) -> Self {
        let m = formula.n_outputs();
        Self {
            formula,
            first: (vec![Dual64::from_re(0.0); n_arguments], vec![Dual64::from_re(0.0); m]),
            second: (vec![HyperDual64::from_re(0.0); n_arguments], vec![HyperDual64::from_re(0.0); m]),
        }
    }
}

impl<F: Formula> VectorFunction for ByDuals<F> {
    fn n_outputs(&self) -> usize {
        self.formula.n_outputs()
    }

    fn evaluate(&mut self, arguments: &[f64], values: &mut [f64]) -> Result<(), EvaluationError> {
        self.formula.evaluate(arguments, values);
        Ok(())
    }

    fn jacobian(&mut self, arguments: &[f64], jacobian: &mut DMatrix<f64>) -> Result<(), EvaluationError> {
        let (inputs, outputs) = &mut self.first;
        inputs.iter_mut().zip(arguments).for_each(|(x, &re)| *x = Dual64::from_re(re));
        for j in 0..inputs.len() {
            inputs[j].eps = 1.0;
            self.formula.evaluate(inputs, outputs);
            inputs[j].eps = 0.0;
            jacobian.column_mut(j).iter_mut().zip(&*outputs).for_each(|(to, y)| *to = y.eps);
        }
        Ok(())
    }

    fn add_hessian(
        &mut self,
        arguments: &[f64],
        weights: &[f64],
        hessian: &mut DMatrix<f64>,
    ) -> Result<(), EvaluationError> {
        let (inputs, outputs) = &mut self.second;
        inputs.iter_mut().zip(arguments).for_each(|(x, &re)| *x = HyperDual64::from_re(re));
        for j in 0..inputs.len() {
            inputs[j].eps1 = 1.0;
            for i in 0..=j {
                inputs[i].eps2 = 1.0;
                self.formula.evaluate(inputs, outputs);
                inputs[i].eps2 = 0.0;
                hessian[(i, j)] += outputs.iter().zip(weights).map(|(y, w)| w * y.eps1eps2).sum::<f64>();
            }
            inputs[j].eps1 = 0.0;
        }
        Ok(())
    }

    fn expressions(&self, at: &[f64]) -> Result<ExprFunction, Untraced> {
        ExprFunction::record(arguments(at.len()), at, |inputs| {
            let mut outputs = vec![nalgebra::convert(0.0); self.formula.n_outputs()];
            self.formula.evaluate(inputs, &mut outputs);
            Ok(outputs)
        })
    }
}
