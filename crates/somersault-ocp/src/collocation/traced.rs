//! Functions traced into expression graphs, with the derivatives of these.

use super::error::Untraced;
use super::function::VectorFunction;
use super::wrong_derivative::Labels;
use crate::WrongDerivative;
use nalgebra::DMatrix;
use somersault_expr::{ArgumentError, Derivative, Evaluator, ExprError, ExprFunction};
use somersault_nlp::EvaluationError;

/// A [`ExprFunction`] as collocation evaluates it: values, Jacobian and Hessian are tapes.
pub struct TracedFunction {
    function: ExprFunction,
    values: Evaluator,
    jacobian: Entries,
    /// Of Σ wᵢ fᵢ: the inputs are the arguments, then w.
    hessian: Entries,
    weighted: Vec<f64>,
}

/// A sparse matrix and its last values.
struct Entries {
    derivative: Derivative,
    evaluator: Evaluator,
    values: Vec<f64>,
}

impl Entries {
    fn new(derivative: &Derivative) -> Self {
        let evaluator = derivative.evaluator();
        let values = vec![0.0; evaluator.n_outputs()];
        Self { derivative: derivative.clone(), evaluator, values }
    }

    /// Evaluates, and gives row, column and value of each entry.
    fn at(
        &mut self,
        inputs: &[f64],
    ) -> Result<impl Iterator<Item = (usize, usize, f64)> + '_, EvaluationError> {
        self.evaluator.evaluate(inputs, &mut self.values).map_err(failed)?;
        let places = self.derivative.sparsity().entries();
        Ok(places.zip(&self.values).map(|((row, column), value)| (row, column, *value)))
    }
}

fn failed(error: ArgumentError) -> EvaluationError {
    EvaluationError::Failed(Box::new(error))
}

impl TracedFunction {
    /// Makes the derivatives of the graph, if it has none yet.
    pub fn try_new(function: &ExprFunction) -> Result<Self, ExprError> {
        Ok(Self {
            function: function.clone(),
            values: function.evaluator(),
            jacobian: Entries::new(function.jacobian()?),
            hessian: Entries::new(function.hessian()?),
            weighted: vec![0.0; function.n_inputs() + function.n_outputs()],
        })
    }
}

impl VectorFunction for TracedFunction {
    fn n_outputs(&self) -> usize {
        self.values.n_outputs()
    }

    fn evaluate(&mut self, arguments: &[f64], values: &mut [f64]) -> Result<(), EvaluationError> {
        self.values.evaluate(arguments, values).map_err(failed)
    }

    fn jacobian(&mut self, arguments: &[f64], jacobian: &mut DMatrix<f64>) -> Result<(), EvaluationError> {
        jacobian.fill(0.0);
        for (row, column, value) in self.jacobian.at(arguments)? {
            jacobian[(row, column)] = value;
        }
        Ok(())
    }

    fn add_hessian(
        &mut self,
        arguments: &[f64],
        weights: &[f64],
        hessian: &mut DMatrix<f64>,
    ) -> Result<(), EvaluationError> {
        let (first, second) = self.weighted.split_at_mut(arguments.len());
        first.copy_from_slice(arguments);
        second.copy_from_slice(weights);
        // the lower triangle of the graph is the upper one here
        for (row, column, value) in self.hessian.at(&self.weighted)? {
            hessian[(column, row)] += value;
        }
        Ok(())
    }

    fn expressions(&self, _: &[f64]) -> Result<ExprFunction, Untraced> {
        Ok(self.function.clone())
    }

    /// None: they are those of the graph.
    fn wrong_derivative(
        &mut self,
        _: &[f64],
        _: &[f64],
        _: &Labels,
    ) -> Result<Option<WrongDerivative>, EvaluationError> {
        Ok(None)
    }
}
