//! A function that several programs call in turn.

use super::error::Untraced;
use super::function::{RelativeErrors, VectorFunction};
use super::wrong_derivative::Labels;
use crate::WrongDerivative;
use nalgebra::DMatrix;
use somersault_expr::ExprFunction;
use somersault_nlp::EvaluationError;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// One [`VectorFunction`] with its workspace, held by a phase and by the transcriptions that are made of it. Calls wait for each
/// other.
#[derive(Clone)]
pub(crate) struct Shared(Arc<Mutex<Box<dyn VectorFunction>>>);

impl Shared {
    pub(crate) fn new(function: Box<dyn VectorFunction>) -> Self {
        Self(Arc::new(Mutex::new(function)))
    }

    fn function(&self) -> MutexGuard<'_, Box<dyn VectorFunction>> {
        // workspaces are overwritten by each call
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[deny(clippy::missing_trait_methods)]
impl VectorFunction for Shared {
    fn n_outputs(&self) -> usize {
        self.function().n_outputs()
    }

    fn evaluate(&mut self, arguments: &[f64], values: &mut [f64]) -> Result<(), EvaluationError> {
        self.function().evaluate(arguments, values)
    }

    fn jacobian(&mut self, arguments: &[f64], jacobian: &mut DMatrix<f64>) -> Result<(), EvaluationError> {
        self.function().jacobian(arguments, jacobian)
    }

    fn add_hessian(
        &mut self,
        arguments: &[f64],
        weights: &[f64],
        hessian: &mut DMatrix<f64>,
    ) -> Result<(), EvaluationError> {
        self.function().add_hessian(arguments, weights, hessian)
    }

    fn expressions(&self, at: &[f64]) -> Result<ExprFunction, Untraced> {
        self.function().expressions(at)
    }

    fn set_sizes(&mut self, arguments: &[f64], sizes: &[f64]) -> Result<(), EvaluationError> {
        self.function().set_sizes(arguments, sizes)
    }

    fn relative_errors(&self) -> RelativeErrors {
        self.function().relative_errors()
    }

    fn brings_derivatives(&self) -> bool {
        self.function().brings_derivatives()
    }

    fn wrong_derivative(
        &mut self,
        arguments: &[f64],
        sizes: &[f64],
        labels: &Labels,
    ) -> Result<Option<WrongDerivative>, EvaluationError> {
        self.function().wrong_derivative(arguments, sizes, labels)
    }
}
