//! A traced function, its derivatives, and their evaluation without the interpreter.

use super::graph::ExpressionGraph;
use crate::core::convert::{array, contiguous, entries, shape_text};
use crate::core::error::Error;
use crate::core::memory::zeros;
use crate::core::waiting::cancel_on_signal;
use numpy::prelude::*;
use numpy::{PyArray1, PyArrayDyn};
use pyo3::prelude::*;
use somersault::expr::{Block, Evaluator, ExprError, ExprFunction, Sparsity};
use std::sync::{Mutex, PoisonError};

/// Instructions times points from which work is shared among threads.
const WORTH_THREADS: usize = 200_000;

/// A function of blocks of numbers, and its derivatives.
///
/// Parameters
/// ----------
/// graph : ExpressionGraph
///     The graph that it was recorded in.
/// blocks : sequence of (str, sequence of int)
///     Names and shapes of its inputs, which are those of the graph in their order.
/// outputs : sequence of int
///     Expressions of the graph.
///
/// Examples
/// --------
/// >>> import numpy as np
/// >>> from somersault._somersault.expr import CompiledFunction, ExpressionGraph
/// >>> graph = ExpressionGraph()
/// >>> x = graph.input()
/// >>> f = CompiledFunction(graph, [("x", [])], [graph.apply("exp", [x])])
/// >>> f.values(np.array([[0.0], [1.0]]))
/// array([[1.        ],
///        [2.71828183]])
#[pyclass(frozen, module = "somersault.expr")]
pub(crate) struct CompiledFunction {
    pub(crate) function: ExprFunction,
    /// What evaluated last, for the next call.
    idle: [Mutex<Option<Evaluator>>; 3],
}

/// What is evaluated of a function.
#[derive(Clone, Copy)]
enum Wanted {
    Values,
    Jacobian,
    Hessian,
}

impl CompiledFunction {
    fn of(function: ExprFunction) -> Self {
        Self { function, idle: Default::default() }
    }

    fn made(&self, wanted: Wanted) -> Result<Evaluator, ExprError> {
        match wanted {
            Wanted::Values => Ok(self.function.evaluator()),
            Wanted::Jacobian => Ok(self.function.jacobian()?.evaluator()),
            Wanted::Hessian => Ok(self.function.hessian()?.evaluator()),
        }
    }

    /// One point, or points one below the other.
    fn evaluate<'py>(
        &self,
        py: Python<'py>,
        wanted: Wanted,
        inputs: &Bound<'py, PyAny>,
    ) -> Result<Bound<'py, PyArrayDyn<f64>>, Error> {
        let idle = &self.idle[wanted as usize];
        let waiting = idle.lock().unwrap_or_else(PoisonError::into_inner).take();
        let mut evaluator = match waiting {
            Some(evaluator) => evaluator,
            None => py.detach(|| self.made(wanted))?,
        };
        let (n, m) = (evaluator.n_inputs(), evaluator.n_outputs());
        let given = contiguous("inputs", &format!("real numbers of shape (…, {n})"), inputs)?;
        let numbers = given.as_slice().map_err(PyErr::from)?;
        let shape = match given.shape() {
            [found] if *found == n => vec![m],
            [points, found] if *found == n => vec![*points, m],
            found => {
                let found = shape_text(found);
                return Err(Error::input(format!("`inputs` must have shape (…, {n}), found {found}")));
            }
        };
        let points = shape[..shape.len() - 1].iter().product::<usize>();
        let mut outputs = zeros("the values", &[points, m])?;
        if shape.len() == 1 {
            evaluator.evaluate(numbers, &mut outputs).map_err(ExprError::from)?;
        } else if evaluator.n_instructions().saturating_mul(points) < WORTH_THREADS {
            py.detach(|| evaluator.evaluate_many(numbers, &mut outputs)).map_err(ExprError::from)?;
        } else {
            cancel_on_signal(py, |cancel| evaluator.evaluate_on_threads(numbers, &mut outputs, cancel))?;
        }
        *idle.lock().unwrap_or_else(PoisonError::into_inner) = Some(evaluator);
        Ok(array(py, outputs, &shape)?)
    }
}

/// Starts of columns, and rows.
type Pattern<'py> = (Bound<'py, PyArray1<i64>>, Bound<'py, PyArray1<i64>>);

fn pattern<'py>(py: Python<'py>, sparsity: &Sparsity) -> Pattern<'py> {
    let signed = |numbers: &[usize]| numbers.iter().map(|&k| k as i64).collect();
    let array = |numbers: &[usize]| PyArray1::from_vec(py, signed(numbers));
    (array(&sparsity.columns), array(&sparsity.rows))
}

#[pymethods]
impl CompiledFunction {
    #[new]
    fn new(
        py: Python<'_>,
        graph: &ExpressionGraph,
        #[pyo3(from_py_with = entries)] blocks: Vec<(String, Vec<usize>)>,
        #[pyo3(from_py_with = entries)] outputs: Vec<usize>,
    ) -> Result<Self, Error> {
        let (graph, outputs) = graph.copied(&outputs)?;
        let blocks = blocks.into_iter().map(|(name, shape)| Block::new(name, shape)).collect();
        Ok(Self::of(py.detach(|| ExprFunction::new(graph, blocks, outputs))?))
    }

    /// int: Instructions for the outputs at one point.
    #[getter]
    fn n_instructions(&self) -> usize {
        self.function.n_instructions()
    }

    /// The outputs.
    ///
    /// Parameters
    /// ----------
    /// inputs : array_like, shape (n,) or (points, n)
    ///     The numbers of all blocks, one after the other.
    ///
    /// Returns
    /// -------
    /// ndarray, shape (outputs,) or (points, outputs)
    fn values<'py>(
        &self,
        py: Python<'py>,
        inputs: &Bound<'py, PyAny>,
    ) -> Result<Bound<'py, PyArrayDyn<f64>>, Error> {
        self.evaluate(py, Wanted::Values, inputs)
    }

    /// The entries of the Jacobian matrix that are not zero everywhere.
    ///
    /// Parameters
    /// ----------
    /// inputs : array_like, shape (n,) or (points, n)
    ///     The numbers of all blocks, one after the other.
    ///
    /// Returns
    /// -------
    /// ndarray, shape (entries,) or (points, entries)
    fn jacobian<'py>(
        &self,
        py: Python<'py>,
        inputs: &Bound<'py, PyAny>,
    ) -> Result<Bound<'py, PyArrayDyn<f64>>, Error> {
        self.evaluate(py, Wanted::Jacobian, inputs)
    }

    /// The entries of the lower triangle of the Hessian matrix of Σ λₖ fₖ that are not zero everywhere.
    ///
    /// Parameters
    /// ----------
    /// inputs : array_like, shape (n + outputs,) or (points, n + outputs)
    ///     The numbers of all blocks, one after the other, then λ.
    ///
    /// Returns
    /// -------
    /// ndarray, shape (entries,) or (points, entries)
    fn hessian<'py>(
        &self,
        py: Python<'py>,
        inputs: &Bound<'py, PyAny>,
    ) -> Result<Bound<'py, PyArrayDyn<f64>>, Error> {
        self.evaluate(py, Wanted::Hessian, inputs)
    }

    /// Where the Jacobian matrix may be other than zero, in compressed columns.
    ///
    /// Returns
    /// -------
    /// starts : ndarray of int, shape (n + 1,)
    ///     Where the columns start among the entries, and the end.
    /// rows : ndarray of int, shape (entries,)
    ///     The row of each entry.
    fn jacobian_pattern<'py>(&self, py: Python<'py>) -> Result<Pattern<'py>, Error> {
        Ok(pattern(py, py.detach(|| self.function.jacobian())?.sparsity()))
    }

    /// Where the lower triangle of the Hessian matrix may be other than zero, in compressed columns.
    ///
    /// Returns
    /// -------
    /// starts : ndarray of int, shape (n + 1,)
    ///     Where the columns start among the entries, and the end.
    /// rows : ndarray of int, shape (entries,)
    ///     The row of each entry.
    fn hessian_pattern<'py>(&self, py: Python<'py>) -> Result<Pattern<'py>, Error> {
        Ok(pattern(py, py.detach(|| self.function.hessian())?.sparsity()))
    }

    /// The derivatives of all outputs by a block, those of the first output first.
    ///
    /// Parameters
    /// ----------
    /// by : str
    ///     Name of the block.
    ///
    /// Returns
    /// -------
    /// CompiledFunction
    fn derivative(&self, py: Python<'_>, by: &str) -> Result<Self, Error> {
        Ok(Self::of(py.detach(|| self.function.derivative(by))?))
    }

    /// The outputs as expressions of another graph.
    ///
    /// Parameters
    /// ----------
    /// graph : ExpressionGraph
    ///     The other graph.
    /// inputs : sequence of int
    ///     Its expressions that stand for the inputs.
    ///
    /// Returns
    /// -------
    /// list of int
    fn insert_into(
        &self,
        graph: &ExpressionGraph,
        #[pyo3(from_py_with = entries)] inputs: Vec<usize>,
    ) -> Result<Vec<usize>, Error> {
        self.function.expect_inputs(inputs.len()).map_err(ExprError::from)?;
        graph.insert(&self.function, &inputs)
    }

    fn __repr__(&self) -> String {
        let (n, m) = (self.function.n_inputs(), self.function.n_outputs());
        format!("<CompiledFunction: {n} inputs, {m} outputs>")
    }
}
