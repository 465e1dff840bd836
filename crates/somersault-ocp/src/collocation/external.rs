//! Functions that cannot be traced: code of the user's that is called for values at many points at once, with derivatives that it
//! brings or by differences.

use super::function::{RelativeErrors, VectorFunction};
use super::wrong_derivative::{Compared, Labels, contradicted};
use crate::WrongDerivative;
use nalgebra::DMatrix;
use somersault_core::differences::Differences;
use somersault_nlp::EvaluationError;
use std::collections::HashMap;

/// Values at points one after the other, or Jacobians row by row.
type AtPoints = Box<dyn FnMut(&[f64], &mut [f64]) -> Result<(), EvaluationError> + Send>;
/// The Hessian of Σ wᵢ fᵢ at a point.
type Weighted = Box<dyn FnMut(&[f64], &[f64], &mut [f64]) -> Result<(), EvaluationError> + Send>;

/// Points whose values and Jacobians are kept: those of a program, which asks for values, Jacobians and Hessians in turn.
const MOST_KNOWN: usize = 16_384;

/// A function that is called for values. Without derivatives of its own, these are central differences; with a Jacobian alone, the
/// Hessian is one of differences of it.
pub struct ExternalFunction {
    labels: Labels,
    values: AtPoints,
    jacobian: Option<AtPoints>,
    hessian: Option<Weighted>,
    differences: Differences,
    sizes: Vec<f64>,
    /// By the bits of the arguments.
    known: HashMap<Vec<u64>, Known>,
}

#[derive(Default)]
struct Known {
    values: Option<Vec<f64>>,
    jacobian: Option<Vec<f64>>,
}

impl ExternalFunction {
    /// `values` writes those of points that come one after the other; the labels say how many outputs and arguments there are.
    pub fn new(
        labels: Labels,
        values: impl FnMut(&[f64], &mut [f64]) -> Result<(), EvaluationError> + Send + 'static,
    ) -> Self {
        Self {
            values: Box::new(values),
            jacobian: None,
            hessian: None,
            differences: Differences::OF_ROUNDED,
            sizes: vec![1.0; labels.arguments.len()],
            known: HashMap::new(),
            labels,
        }
    }

    /// `jacobian` writes the Jacobians of points, each row by row.
    pub fn with_jacobian(
        mut self,
        jacobian: impl FnMut(&[f64], &mut [f64]) -> Result<(), EvaluationError> + Send + 'static,
    ) -> Self {
        self.jacobian = Some(Box::new(jacobian));
        self
    }

    /// `hessian` writes the whole Hessian of Σ wᵢ fᵢ, from a point and w. Without a Jacobian it has no use.
    pub fn with_hessian(
        mut self,
        hessian: impl FnMut(&[f64], &[f64], &mut [f64]) -> Result<(), EvaluationError> + Send + 'static,
    ) -> Self {
        self.hessian = Some(Box::new(hessian));
        self
    }

    /// How differences are taken; of values that are right to rounding unless it is said.
    pub fn with_differences(mut self, differences: Differences) -> Self {
        self.differences = differences;
        self
    }

    /// Number of arguments.
    pub fn n_arguments(&self) -> usize {
        self.labels.arguments.len()
    }

    /// Typical sizes of the arguments.
    pub(super) fn sizes(&self) -> &[f64] {
        &self.sizes
    }

    pub(super) fn labels(&self) -> &Labels {
        &self.labels
    }

    /// What is kept of a point.
    fn known(&mut self, at: &[f64]) -> &mut Known {
        let key: Vec<u64> = at.iter().map(|x| x.to_bits()).collect();
        if self.known.len() >= MOST_KNOWN && !self.known.contains_key(&key) {
            self.known.clear();
        }
        self.known.entry(key).or_default()
    }

    fn jacobian_at(&mut self, at: &[f64]) -> Result<Vec<f64>, EvaluationError> {
        if let Some(known) = &self.known(at).jacobian {
            return Ok(known.clone());
        }
        let m = self.labels.outputs.len();
        let mut found = vec![0.0; m * at.len()];
        match &mut self.jacobian {
            Some(jacobian) => jacobian(at, &mut found)?,
            None => self.differences.jacobian(at, &self.sizes, m, &mut self.values, &mut found)?,
        }
        self.known(at).jacobian = Some(found.clone());
        Ok(found)
    }
}

impl VectorFunction for ExternalFunction {
    fn n_outputs(&self) -> usize {
        self.labels.outputs.len()
    }

    fn evaluate(&mut self, arguments: &[f64], values: &mut [f64]) -> Result<(), EvaluationError> {
        if let Some(known) = &self.known(arguments).values {
            values.copy_from_slice(known);
            return Ok(());
        }
        (self.values)(arguments, values)?;
        self.known(arguments).values = Some(values.to_vec());
        Ok(())
    }

    fn jacobian(&mut self, arguments: &[f64], jacobian: &mut DMatrix<f64>) -> Result<(), EvaluationError> {
        let found = self.jacobian_at(arguments)?;
        let n = arguments.len();
        found.iter().enumerate().for_each(|(k, x)| jacobian[(k / n, k % n)] = *x);
        Ok(())
    }

    fn add_hessian(
        &mut self,
        arguments: &[f64],
        weights: &[f64],
        hessian: &mut DMatrix<f64>,
    ) -> Result<(), EvaluationError> {
        let n = arguments.len();
        let Self { values, jacobian, hessian: given, differences, sizes, .. } = self;
        let mut found = vec![0.0; n * n];
        match (given, jacobian) {
            (Some(given), Some(_)) => given(arguments, weights, &mut found)?,
            (_, Some(jacobian)) => {
                differences.add_hessian_of_jacobians(arguments, sizes, weights, jacobian, &mut found)?;
            }
            (_, None) => differences.add_hessian(arguments, sizes, weights, values, &mut found)?,
        }
        for (k, x) in found.iter().enumerate() {
            hessian[(k / n, k % n)] += x;
        }
        Ok(())
    }

    fn set_sizes(&mut self, _arguments: &[f64], sizes: &[f64]) -> Result<(), EvaluationError> {
        if self.sizes != sizes {
            self.sizes.copy_from_slice(sizes);
            self.known.clear();
        }
        Ok(())
    }

    fn relative_errors(&self) -> RelativeErrors {
        let values = if self.differences == Differences::OF_ROUNDED { 0.0 } else { self.differences.error() };
        let derivatives = if self.jacobian.is_some() { values } else { self.differences.accuracy() };
        RelativeErrors { values, derivatives }
    }

    fn brings_derivatives(&self) -> bool {
        self.jacobian.is_some()
    }

    fn wrong_derivative(
        &mut self,
        arguments: &[f64],
        sizes: &[f64],
        _: &Labels,
    ) -> Result<Option<WrongDerivative>, EvaluationError> {
        let Self { labels, values, jacobian, hessian, differences, .. } = self;
        let Some(jacobian) = jacobian else { return Ok(None) };
        contradicted(&mut Given { values, jacobian, hessian }, labels, arguments, sizes, *differences)
    }
}

/// What was given.
struct Given<'a> {
    values: &'a mut AtPoints,
    jacobian: &'a mut AtPoints,
    hessian: &'a mut Option<Weighted>,
}

impl Compared for Given<'_> {
    fn values(&mut self, points: &[f64], values: &mut [f64]) -> Result<(), EvaluationError> {
        (self.values)(points, values)
    }

    fn jacobians(&mut self, points: &[f64], jacobians: &mut [f64]) -> Result<(), EvaluationError> {
        (self.jacobian)(points, jacobians)
    }

    fn hessian(&mut self, at: &[f64], weights: &[f64]) -> Result<Option<Vec<f64>>, EvaluationError> {
        let Some(hessian) = self.hessian else { return Ok(None) };
        let mut found = vec![0.0; at.len() * at.len()];
        hessian(at, weights, &mut found)?;
        Ok(Some(found))
    }
}
