//! A function of named blocks of inputs, with its derivatives.

use crate::error::ExprError;
use crate::evaluator::Evaluator;
use crate::graph::{Expression, Graph};
use crate::sparsity::Sparsity;
use crate::symbol::Symbol;
use crate::tape::Tape;
use crate::traced::{Traced, record};
use somersault_core::argument::{ArgumentError, expect_length};
use std::cell::RefCell;
use std::ops::Range;
use std::sync::{Arc, OnceLock};

/// A named array of inputs.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Block {
    /// Its name.
    pub name: String,
    /// Its lengths along its axes: none for a single number.
    pub shape: Vec<usize>,
}

impl Block {
    /// A block of this name and shape.
    pub fn new(name: impl Into<String>, shape: impl Into<Vec<usize>>) -> Self {
        Self { name: name.into(), shape: shape.into() }
    }

    /// How many numbers it has.
    pub fn len(&self) -> usize {
        self.shape.iter().fold(1, |product, &length| product.saturating_mul(length))
    }

    /// Whether it has no numbers.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

/// Most inputs of a function.
const MOST_INPUTS: usize = 1 << 22;

/// Expressions of named inputs, compiled. A clone is the same function.
#[derive(Debug, Clone)]
pub struct ExprFunction(Arc<Inner>);

#[derive(Debug)]
struct Inner {
    graph: Graph,
    blocks: Vec<Block>,
    outputs: Vec<Expression>,
    values: Arc<Tape>,
    jacobian: OnceLock<Result<Derivative, ExprError>>,
    hessian: OnceLock<Result<Derivative, ExprError>>,
}

/// A matrix of derivatives: where its entries are, and what evaluates them.
#[derive(Debug, Clone)]
pub struct Derivative {
    sparsity: Arc<Sparsity>,
    tape: Arc<Tape>,
}

impl Derivative {
    /// Where the matrix may be other than zero, in the order of the values.
    pub fn sparsity(&self) -> &Sparsity {
        &self.sparsity
    }

    /// What evaluates the entries.
    pub fn evaluator(&self) -> Evaluator {
        Evaluator::new(self.tape.clone())
    }
}

/// Number of inputs of blocks that have names of their own.
fn count(blocks: &[Block]) -> Result<usize, ExprError> {
    let mut total = 0_usize;
    for (k, block) in blocks.iter().enumerate() {
        if blocks[..k].iter().any(|other| other.name == block.name) {
            return Err(ExprError::RepeatedInput { found: block.name.clone() });
        }
        total = total.saturating_add(block.len());
    }
    if total > MOST_INPUTS {
        return Err(ExprError::TooLarge { what: "inputs", found: total, allowed: MOST_INPUTS });
    }
    Ok(total)
}

impl ExprFunction {
    /// The function with these outputs of a graph, whose inputs are those of the blocks in their order.
    pub fn new(graph: Graph, blocks: Vec<Block>, outputs: Vec<Expression>) -> Result<Self, ExprError> {
        expect_length("inputs of the graph", graph.inputs().len(), count(&blocks)?)?;
        let values = Arc::new(Tape::compile(&graph, &outputs, graph.inputs().len())?);
        let (jacobian, hessian) = (OnceLock::new(), OnceLock::new());
        Ok(Self(Arc::new(Inner { graph, blocks, outputs, values, jacobian, hessian })))
    }

    /// The function that ordinary Rust computes of symbols: `formula` is called once, with the symbols of each block.
    pub fn trace<F>(blocks: Vec<Block>, formula: F) -> Result<Self, ExprError>
    where
        F: for<'g> FnOnce(&[Vec<Symbol<'g>>]) -> Vec<Symbol<'g>>,
    {
        count(&blocks)?;
        let graph = RefCell::new(Graph::new());
        let outputs: Vec<Expression> = {
            let symbols: Vec<Vec<Symbol<'_>>> = blocks
                .iter()
                .map(|block| (0..block.len()).map(|_| Symbol::input(&graph)).collect())
                .collect();
            formula(&symbols).iter().map(Symbol::expression).collect()
        };
        Self::new(graph.into_inner(), blocks, outputs)
    }

    /// The function that a formula over any [`Scalar`](somersault_core::Scalar) computes: `formula` is called once, with a [`Traced`] number
    /// for each input. What it compares is decided at the point `at`; where it would be decided otherwise all outputs are NaN.
    ///
    /// ```
    /// use somersault_core::Scalar;
    /// use somersault_expr::{Block, ExprError, ExprFunction};
    ///
    /// fn length<T: Scalar>(x: &[T]) -> T {
    ///     x.iter().fold(T::zero(), |sum, x| sum + *x * *x).sqrt()
    /// }
    ///
    /// let f = ExprFunction::record(vec![Block::new("x", [2])], &[1.0, 1.0], |x| Ok::<_, ExprError>(vec![length(x)]))?;
    /// let mut found = [0.0];
    /// f.evaluator().evaluate(&[3.0, 4.0], &mut found)?;
    /// assert_eq!(found, [5.0]);
    /// // ∂/∂x of it, and so on
    /// let by_x = f.derivative("x")?;
    /// # let mut slopes = [0.0; 2];
    /// # by_x.evaluator().evaluate(&[3.0, 4.0], &mut slopes)?;
    /// # assert!((slopes[0] - 0.6).abs() < 1e-15 && (slopes[1] - 0.8).abs() < 1e-15);
    /// # Ok::<(), ExprError>(())
    /// ```
    pub fn record<E: From<ExprError>>(
        blocks: Vec<Block>,
        at: &[f64],
        formula: impl FnOnce(&[Traced]) -> Result<Vec<Traced>, E>,
    ) -> Result<Self, E> {
        let n = count(&blocks)?;
        expect_length("at", at.len(), n).map_err(ExprError::from)?;
        let (graph, outputs) = record(at, formula)?;
        Ok(Self::new(graph, blocks, outputs)?)
    }

    /// The blocks of inputs.
    pub fn blocks(&self) -> &[Block] {
        &self.0.blocks
    }

    /// The place of a block among the inputs.
    pub fn range(&self, name: &str) -> Result<Range<usize>, ExprError> {
        let mut start = 0;
        for block in &self.0.blocks {
            let end = start + block.len();
            if block.name == name {
                return Ok(start..end);
            }
            start = end;
        }
        let names: Vec<_> = self.0.blocks.iter().map(|block| format!("`{}`", block.name)).collect();
        Err(ExprError::UnknownInput { found: name.into(), allowed: names.join(", ") })
    }

    /// The graph.
    pub fn graph(&self) -> &Graph {
        &self.0.graph
    }

    /// The outputs, expressions of the graph.
    pub fn outputs(&self) -> &[Expression] {
        &self.0.outputs
    }

    /// Number of inputs, all blocks together.
    pub fn n_inputs(&self) -> usize {
        self.0.values.n_inputs
    }

    /// Fails unless there are as many inputs as the function takes.
    pub fn expect_inputs(&self, found: usize) -> Result<(), ArgumentError> {
        expect_length("inputs", found, self.n_inputs())
    }

    /// Number of outputs.
    pub fn n_outputs(&self) -> usize {
        self.0.outputs.len()
    }

    /// Instructions for the outputs at one point.
    pub fn n_instructions(&self) -> usize {
        self.0.values.instructions.len()
    }

    /// What evaluates the outputs.
    pub fn evaluator(&self) -> Evaluator {
        Evaluator::new(self.0.values.clone())
    }

    /// The Jacobian matrix of all outputs by all inputs. It is made at the first call.
    pub fn jacobian(&self) -> Result<&Derivative, ExprError> {
        let make = || {
            let mut graph = self.0.graph.clone();
            let inputs = graph.inputs().to_vec();
            let (sparsity, values) = graph.jacobian(&self.0.outputs, &inputs)?;
            let tape = Arc::new(Tape::compile(&graph, &values, inputs.len())?);
            Ok(Derivative { sparsity: Arc::new(sparsity), tape })
        };
        self.0.jacobian.get_or_init(make).as_ref().map_err(Clone::clone)
    }

    /// The lower triangle of the Hessian matrix of Σ λₖ fₖ by all inputs. Its evaluator takes the inputs, then λ. It is made at the
    /// first call.
    pub fn hessian(&self) -> Result<&Derivative, ExprError> {
        let make = || {
            let mut graph = self.0.graph.clone();
            let inputs = graph.inputs().to_vec();
            let mut sum = graph.constant(0.0);
            for &output in &self.0.outputs {
                let multiplier = graph.input();
                let product = graph.multiply(multiplier, output);
                sum = graph.add(sum, product);
            }
            let (sparsity, values) = graph.hessian(sum, &inputs)?;
            let tape = Arc::new(Tape::compile(&graph, &values, graph.inputs().len())?);
            Ok(Derivative { sparsity: Arc::new(sparsity), tape })
        };
        self.0.hessian.get_or_init(make).as_ref().map_err(Clone::clone)
    }

    /// The derivatives of all outputs by the inputs of a block, as a function of the same inputs: those of the first output first.
    pub fn derivative(&self, by: &str) -> Result<Self, ExprError> {
        let range = self.range(by)?;
        let mut graph = self.0.graph.clone();
        let inputs = graph.inputs()[range.clone()].to_vec();
        let (sparsity, values) = graph.jacobian(&self.0.outputs, &inputs)?;
        let size = self.n_outputs().saturating_mul(range.len());
        if size > MOST_INPUTS {
            return Err(ExprError::TooLarge { what: "derivatives", found: size, allowed: MOST_INPUTS });
        }
        let mut outputs = vec![graph.constant(0.0); size];
        for ((row, column), value) in sparsity.entries().zip(values) {
            outputs[row * range.len() + column] = value;
        }
        Self::new(graph, self.0.blocks.clone(), outputs)
    }
}
