//! Costs and constraints of a phase, whose cost can be exchanged for effort while a start is sought.

use super::error::Untraced;
use super::function::{RelativeErrors, VectorFunction};
use super::shared::Shared;
use super::wrong_derivative::Labels;
use crate::WrongDerivative;
use nalgebra::DMatrix;
use somersault_expr::ExprFunction;
use somersault_nlp::EvaluationError;

/// One argument of an effort ½ Σ w (a − c)².
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Square {
    pub(super) argument: usize,
    pub(super) weight: f64,
    pub(super) centre: f64,
}

/// A cost, then constraints.
pub(super) struct Objective {
    function: Shared,
    /// In the place of the cost.
    effort: Option<Vec<Square>>,
    weights: Vec<f64>,
}

impl Objective {
    pub(super) fn new(function: Box<dyn VectorFunction>) -> Self {
        let weights = vec![0.0; function.n_outputs()];
        Self { function: Shared::new(function), effort: None, weights }
    }

    /// Costs and constraints as they were posed.
    pub(super) fn posed(&self) -> Shared {
        self.function.clone()
    }

    /// The same with a function made of its own.
    pub(super) fn map(self, made: impl FnOnce(Box<dyn VectorFunction>) -> Box<dyn VectorFunction>) -> Self {
        Self::new(made(Box::new(self.function)))
    }

    /// The cost is ½ Σ w (a − c)² from now on, and nothing without squares.
    pub(super) fn exchange(&mut self, effort: Vec<Square>) {
        self.effort = Some(effort);
    }

    /// The cost is the one that was posed.
    pub(super) fn restore(&mut self) {
        self.effort = None;
    }
}

#[deny(clippy::missing_trait_methods)]
impl VectorFunction for Objective {
    fn n_outputs(&self) -> usize {
        self.function.n_outputs()
    }

    fn evaluate(&mut self, arguments: &[f64], values: &mut [f64]) -> Result<(), EvaluationError> {
        self.function.evaluate(arguments, values)?;
        if let Some(effort) = &self.effort {
            values[0] = effort
                .iter()
                .map(|square| 0.5 * square.weight * (arguments[square.argument] - square.centre).powi(2))
                .sum();
        }
        Ok(())
    }

    fn jacobian(&mut self, arguments: &[f64], jacobian: &mut DMatrix<f64>) -> Result<(), EvaluationError> {
        self.function.jacobian(arguments, jacobian)?;
        if let Some(effort) = &self.effort {
            jacobian.row_mut(0).fill(0.0);
            for square in effort {
                jacobian[(0, square.argument)] = square.weight * (arguments[square.argument] - square.centre);
            }
        }
        Ok(())
    }

    fn add_hessian(
        &mut self,
        arguments: &[f64],
        weights: &[f64],
        hessian: &mut DMatrix<f64>,
    ) -> Result<(), EvaluationError> {
        let Some(effort) = &self.effort else {
            return self.function.add_hessian(arguments, weights, hessian);
        };
        for square in effort {
            hessian[(square.argument, square.argument)] += weights[0] * square.weight;
        }
        self.weights.copy_from_slice(weights);
        self.weights[0] = 0.0;
        self.function.add_hessian(arguments, &self.weights, hessian)
    }

    fn expressions(&self, at: &[f64]) -> Result<ExprFunction, Untraced> {
        match self.effort {
            None => self.function.expressions(at),
            Some(_) => Err(Untraced::Given),
        }
    }

    fn set_sizes(&mut self, arguments: &[f64], sizes: &[f64]) -> Result<(), EvaluationError> {
        self.function.set_sizes(arguments, sizes)
    }

    fn relative_errors(&self) -> RelativeErrors {
        self.function.relative_errors()
    }

    fn brings_derivatives(&self) -> bool {
        self.function.brings_derivatives()
    }

    fn wrong_derivative(
        &mut self,
        arguments: &[f64],
        sizes: &[f64],
        labels: &Labels,
    ) -> Result<Option<WrongDerivative>, EvaluationError> {
        self.function.wrong_derivative(arguments, sizes, labels)
    }
}
