//! The graph that a traced function is recorded in.

use crate::core::convert::{entries, integer};
use crate::core::error::{Error, did_you_mean};
use pyo3::prelude::*;
use pyo3::types::PyTuple;
use somersault::expr::{ExprFunction, Expression, Graph, Operation};
use std::sync::{Mutex, MutexGuard, PoisonError};

/// A graph of expressions, which are numbered.
///
/// Examples
/// --------
/// >>> from somersault._somersault.expr import ExpressionGraph
/// >>> graph = ExpressionGraph()
/// >>> x = graph.input()
/// >>> graph.apply("sin", [x]) == graph.apply("sin", [x])
/// True
#[pyclass(frozen, module = "somersault.expr")]
pub(crate) struct ExpressionGraph(Mutex<Recorded>);

/// A graph, and its expressions by the numbers that Python has for them.
#[derive(Default)]
struct Recorded {
    graph: Graph,
    expressions: Vec<Expression>,
}

impl Recorded {
    fn push(&mut self, expression: Expression) -> usize {
        self.expressions.push(expression);
        self.expressions.len() - 1
    }

    fn find(&self, numbers: &[usize]) -> Result<Vec<Expression>, Error> {
        let of = |&number: &usize| {
            self.expressions.get(number).copied().ok_or_else(|| {
                let n = self.expressions.len();
                Error::input(format!("expressions must be numbers below {n}, found {number}"))
            })
        };
        numbers.iter().map(of).collect()
    }
}

impl ExpressionGraph {
    fn lock(&self) -> MutexGuard<'_, Recorded> {
        // a graph is whole after each operation
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The outputs of a function of these expressions.
    pub(crate) fn insert(&self, function: &ExprFunction, inputs: &[usize]) -> Result<Vec<usize>, Error> {
        let mut recorded = self.lock();
        let inputs = recorded.find(inputs)?;
        let outputs = recorded.graph.insert(function.graph(), function.outputs(), &inputs)?;
        Ok(outputs.into_iter().map(|output| recorded.push(output)).collect())
    }

    /// A copy of the graph, and these expressions of it.
    pub(crate) fn copied(&self, numbers: &[usize]) -> Result<(Graph, Vec<Expression>), Error> {
        let recorded = self.lock();
        Ok((recorded.graph.clone(), recorded.find(numbers)?))
    }
}

#[pymethods]
impl ExpressionGraph {
    #[new]
    fn new() -> Self {
        Self(Mutex::default())
    }

    /// tuple of str: The operations, by NumPy's names.
    #[classattr]
    #[allow(non_snake_case)]
    fn OPERATIONS(py: Python<'_>) -> PyResult<Bound<'_, PyTuple>> {
        PyTuple::new(py, Operation::ALL.iter().map(|operation| operation.name()))
    }

    /// A further input.
    ///
    /// Returns
    /// -------
    /// int
    ///     Its number.
    fn input(&self) -> usize {
        let mut recorded = self.lock();
        let input = recorded.graph.input();
        recorded.push(input)
    }

    /// A number.
    ///
    /// Parameters
    /// ----------
    /// value : float
    ///     The number.
    ///
    /// Returns
    /// -------
    /// int
    ///     The number of the expression.
    fn constant(&self, value: f64) -> usize {
        let mut recorded = self.lock();
        let constant = recorded.graph.constant(value);
        recorded.push(constant)
    }

    /// An operation.
    ///
    /// Parameters
    /// ----------
    /// name : str
    ///     NumPy's name of it.
    /// arguments : sequence of int
    ///     What it is applied to.
    ///
    /// Returns
    /// -------
    /// int
    ///     The number of the expression.
    fn apply(
        &self,
        name: &str,
        #[pyo3(from_py_with = entries)] arguments: Vec<usize>,
    ) -> Result<usize, Error> {
        let Some(&operation) = Operation::ALL.iter().find(|operation| operation.name() == name) else {
            let hint = did_you_mean(name, Operation::ALL.iter().map(|operation| operation.name()));
            return Err(Error::input(format!("no operation is called `{name}`{hint}")));
        };
        let mut recorded = self.lock();
        let arguments = recorded.find(&arguments)?;
        let made = recorded.graph.apply(operation, &arguments)?;
        Ok(recorded.push(made))
    }

    /// The number that an expression is, if it is one.
    ///
    /// Parameters
    /// ----------
    /// expression : int
    ///     The number of the expression.
    ///
    /// Returns
    /// -------
    /// float or None
    fn value(&self, #[pyo3(from_py_with = integer)] expression: i64) -> Result<Option<f64>, Error> {
        let recorded = self.lock();
        let found = recorded.find(&[usize::try_from(expression).unwrap_or(usize::MAX)])?;
        Ok(found.first().and_then(|&x| recorded.graph.as_constant(x)))
    }

    fn __len__(&self) -> usize {
        self.lock().graph.len()
    }

    fn __repr__(&self) -> String {
        format!("<ExpressionGraph: {} expressions>", self.lock().graph.len())
    }
}
