//! Functions one below the other, each of some of the arguments.

use super::error::Untraced;
use super::function::{RelativeErrors, VectorFunction, arguments};
use super::wrong_derivative::Labels;
use crate::WrongDerivative;
use nalgebra::DMatrix;
use somersault_expr::{ExprFunction, Expression, Graph};
use somersault_nlp::EvaluationError;

/// The outputs of several functions in a row, each called with arguments of its own choice: a tree with integrals beside it.
pub struct Stacked {
    parts: Vec<Part>,
    n_outputs: usize,
}

/// One of the functions.
struct Part {
    function: Box<dyn VectorFunction>,
    /// Which of all arguments its own are.
    places: Vec<usize>,
    arguments: Vec<f64>,
    jacobian: DMatrix<f64>,
    hessian: DMatrix<f64>,
}

impl Part {
    fn gather(&mut self, arguments: &[f64]) {
        self.arguments.iter_mut().zip(&self.places).for_each(|(to, &place)| *to = arguments[place]);
    }
}

impl Stacked {
    /// Functions with the places of their arguments, in increasing order, among all of them.
    pub fn new(parts: Vec<(Box<dyn VectorFunction>, Vec<usize>)>) -> Self {
        let n_outputs = parts.iter().map(|(function, _)| function.n_outputs()).sum();
        let part = |(function, places): (Box<dyn VectorFunction>, Vec<usize>)| {
            let (m, n) = (function.n_outputs(), places.len());
            let (jacobian, hessian) = (DMatrix::zeros(m, n), DMatrix::zeros(n, n));
            Part { function, places, arguments: vec![0.0; n], jacobian, hessian }
        };
        Self { parts: parts.into_iter().map(part).collect(), n_outputs }
    }
}

#[deny(clippy::missing_trait_methods)]
impl VectorFunction for Stacked {
    fn n_outputs(&self) -> usize {
        self.n_outputs
    }

    fn evaluate(&mut self, arguments: &[f64], mut values: &mut [f64]) -> Result<(), EvaluationError> {
        for part in &mut self.parts {
            part.gather(arguments);
            let (own, rest) = values.split_at_mut(part.function.n_outputs());
            part.function.evaluate(&part.arguments, own)?;
            values = rest;
        }
        Ok(())
    }

    fn jacobian(&mut self, arguments: &[f64], jacobian: &mut DMatrix<f64>) -> Result<(), EvaluationError> {
        jacobian.fill(0.0);
        let mut first = 0;
        for part in &mut self.parts {
            part.gather(arguments);
            part.function.jacobian(&part.arguments, &mut part.jacobian)?;
            for (column, &place) in part.jacobian.column_iter().zip(&part.places) {
                jacobian.view_mut((first, place), (column.len(), 1)).copy_from(&column);
            }
            first += part.function.n_outputs();
        }
        Ok(())
    }

    fn add_hessian(
        &mut self,
        arguments: &[f64],
        mut weights: &[f64],
        hessian: &mut DMatrix<f64>,
    ) -> Result<(), EvaluationError> {
        for part in &mut self.parts {
            part.gather(arguments);
            let (own, rest) = weights.split_at(part.function.n_outputs());
            part.hessian.fill(0.0);
            part.function.add_hessian(&part.arguments, own, &mut part.hessian)?;
            // places increase, so the upper triangle stays above
            for (j, &column) in part.places.iter().enumerate() {
                for (i, &row) in part.places[..=j].iter().enumerate() {
                    hessian[(row, column)] += part.hessian[(i, j)];
                }
            }
            weights = rest;
        }
        Ok(())
    }

    fn expressions(&self, at: &[f64]) -> Result<ExprFunction, Untraced> {
        let (mut graph, mut outputs) = (Graph::new(), Vec::new());
        let inputs: Vec<Expression> = at.iter().map(|_| graph.input()).collect();
        for part in &self.parts {
            let of_part: Vec<f64> = part.places.iter().map(|&place| at[place]).collect();
            let own: Vec<Expression> = part.places.iter().map(|&place| inputs[place]).collect();
            let function = part.function.expressions(&of_part)?;
            outputs.extend(graph.insert(function.graph(), function.outputs(), &own)?);
        }
        Ok(ExprFunction::new(graph, arguments(at.len()), outputs)?)
    }

    fn set_sizes(&mut self, arguments: &[f64], sizes: &[f64]) -> Result<(), EvaluationError> {
        for part in &mut self.parts {
            part.gather(arguments);
            let own: Vec<f64> = part.places.iter().map(|&place| sizes[place]).collect();
            part.function.set_sizes(&part.arguments, &own)?;
        }
        Ok(())
    }

    fn relative_errors(&self) -> RelativeErrors {
        self.parts
            .iter()
            .map(|part| part.function.relative_errors())
            .fold(RelativeErrors::default(), RelativeErrors::max)
    }

    fn brings_derivatives(&self) -> bool {
        self.parts.iter().any(|part| part.function.brings_derivatives())
    }

    fn wrong_derivative(
        &mut self,
        arguments: &[f64],
        sizes: &[f64],
        labels: &Labels,
    ) -> Result<Option<WrongDerivative>, EvaluationError> {
        let mut first = 0;
        for part in &mut self.parts {
            part.gather(arguments);
            let end = first + part.function.n_outputs();
            let of = |all: &[String]| part.places.iter().map(|&place| all[place].clone()).collect();
            let own = Labels {
                function: labels.function.clone(),
                outputs: labels.outputs[first..end].to_vec(),
                arguments: of(&labels.arguments),
            };
            let of_part: Vec<f64> = part.places.iter().map(|&place| sizes[place]).collect();
            let found = part.function.wrong_derivative(&part.arguments, &of_part, &own)?;
            if found.is_some() {
                return Ok(found);
            }
            first = end;
        }
        Ok(None)
    }
}
