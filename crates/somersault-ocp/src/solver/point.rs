//! Functions of a phase as terms of nodes.

use crate::collocation::{Shared, VectorFunction};
use crate::term::{Node, NodeGradient, NodeNumber, Term, TermSecondDerivatives};
use nalgebra::DMatrix;
use somersault_nlp::EvaluationError;
use std::ops::Range;

/// Where an argument of a function comes from: a number of the node, if there is one, and a constant that is added.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Source {
    pub(super) number: Option<NodeNumber>,
    pub(super) offset: f64,
}

impl Source {
    pub(super) fn constant(offset: f64) -> Self {
        Self { number: None, offset }
    }

    pub(super) fn of(number: NodeNumber) -> Self {
        Self { number: Some(number), offset: 0.0 }
    }

    pub(super) fn value(&self, node: &Node<'_>) -> f64 {
        self.offset + self.number.map_or(0.0, |number| number.value(node))
    }
}

/// Some rows of a function whose arguments are numbers of a node and constants.
pub(super) struct PointTerm {
    name: &'static str,
    function: Shared,
    sources: Vec<Source>,
    rows: Range<usize>,
    numbers: Vec<NodeNumber>,
    /// Which arguments the numbers are.
    places: Vec<usize>,
    arguments: Vec<f64>,
    values: Vec<f64>,
    weights: Vec<f64>,
    jacobian: DMatrix<f64>,
    hessian: DMatrix<f64>,
    own: DMatrix<f64>,
}

impl PointTerm {
    pub(super) fn new(
        name: &'static str,
        function: Shared,
        sources: Vec<Source>,
        rows: Range<usize>,
    ) -> Self {
        let (n, m) = (sources.len(), function.n_outputs());
        let places: Vec<usize> = (0..n).filter(|k| sources[*k].number.is_some()).collect();
        let numbers: Vec<NodeNumber> = sources.iter().filter_map(|source| source.number).collect();
        Self {
            name,
            arguments: vec![0.0; n],
            values: vec![0.0; m],
            weights: vec![0.0; m],
            jacobian: DMatrix::zeros(m, n),
            hessian: DMatrix::zeros(n, n),
            own: DMatrix::zeros(numbers.len(), numbers.len()),
            function,
            sources,
            rows,
            numbers,
            places,
        }
    }

    fn gather(&mut self, node: &Node<'_>) {
        self.arguments.iter_mut().zip(&self.sources).for_each(|(to, source)| *to = source.value(node));
    }
}

impl Term for PointTerm {
    fn name(&self) -> &str {
        self.name
    }

    fn n_rows(&self) -> usize {
        self.rows.len()
    }

    fn is_linear(&self) -> bool {
        false
    }

    fn evaluate(&mut self, node: &Node<'_>, rows: &mut [f64]) -> Result<(), EvaluationError> {
        self.gather(node);
        self.function.evaluate(&self.arguments, &mut self.values)?;
        rows.copy_from_slice(&self.values[self.rows.clone()]);
        Ok(())
    }

    fn pull_back(
        &mut self,
        node: &Node<'_>,
        y: &[f64],
        gradient: &mut NodeGradient,
    ) -> Result<(), EvaluationError> {
        self.gather(node);
        self.function.jacobian(&self.arguments, &mut self.jacobian)?;
        let first = self.rows.start;
        for (number, place) in self.numbers.iter().zip(&self.places) {
            let column = self.jacobian.column(*place);
            *number.gradient(gradient) +=
                y.iter().enumerate().map(|(i, y)| y * column[first + i]).sum::<f64>();
        }
        Ok(())
    }

    fn second_derivatives(&mut self) -> Option<&mut dyn TermSecondDerivatives> {
        Some(self)
    }
}

impl TermSecondDerivatives for PointTerm {
    fn numbers(&self) -> &[NodeNumber] {
        &self.numbers
    }

    fn weighted(&mut self, node: &Node<'_>, y: &[f64]) -> Result<&DMatrix<f64>, EvaluationError> {
        self.gather(node);
        self.weights[self.rows.clone()].copy_from_slice(y);
        self.hessian.fill(0.0);
        self.function.add_hessian(&self.arguments, &self.weights, &mut self.hessian)?;
        for (j, column) in self.places.iter().enumerate() {
            for (i, row) in self.places[..=j].iter().enumerate() {
                let value = self.hessian[(*row, *column)];
                (self.own[(i, j)], self.own[(j, i)]) = (value, value);
            }
        }
        Ok(&self.own)
    }
}

/// Numbers of a node as they are.
pub(super) struct NodeNumbers(pub(super) Vec<NodeNumber>);

impl Term for NodeNumbers {
    fn name(&self) -> &str {
        "bounds"
    }

    fn n_rows(&self) -> usize {
        self.0.len()
    }

    fn is_linear(&self) -> bool {
        true
    }

    fn evaluate(&mut self, node: &Node<'_>, rows: &mut [f64]) -> Result<(), EvaluationError> {
        rows.iter_mut().zip(&self.0).for_each(|(row, number)| *row = number.value(node));
        Ok(())
    }

    fn pull_back(
        &mut self,
        _node: &Node<'_>,
        y: &[f64],
        gradient: &mut NodeGradient,
    ) -> Result<(), EvaluationError> {
        y.iter().zip(&self.0).for_each(|(y, number)| *number.gradient(gradient) += y);
        Ok(())
    }
}
