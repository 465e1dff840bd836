#![doc = include_str!("../README.md")]
//!
//! # How it works
//!
//! **Graph.** A [`Graph`] holds expressions by their numbers, arguments before results. An operation on arguments that it has had before
//! is the same node. [`Symbol`] gives expressions the operators of Rust; [`ExprFunction::trace`] calls a formula with them. A formula over any
//! [`Scalar`](somersault_core::Scalar) is called with [`Traced`] numbers by [`ExprFunction::record`].
//!
//! **Simplifications** keep values, as those of CasADi do, but for two things: the sign of a zero, as in x + 0, and a factor that is
//! the constant 0, which makes the product 0 although x may be infinite or NaN. Without the latter no matrix with zeros would
//! have a sparse derivative. Sums are not reordered. What depends on the size of x stays as it is: x − x, x / x, 0 / x.
//!
//! **Derivatives** are expressions of the same graph: [`Graph::adjoint`] by one sweep back, [`Graph::tangent`] by one sweep forward,
//! [`Graph::jacobian`] by as many of either as there are rows or columns, each through the nodes that are between an input and an
//! output only. Both ways are tried, and the one that takes fewer instructions is kept. A branch that is not taken has no part in a
//! derivative, even where that of the branch is infinite: where(x > 0, √x, 0) has the derivative 0 at 0. At kinks the derivative is one of
//! both sides: that of |x| is 0 at 0, that of min and max that of the first argument where both are equal.
//!
//! **Evaluation.** [`Evaluator::evaluate`] takes one point; [`Evaluator::evaluate_many`] takes eight at a time, in vectors of the
//! widest kind that the processor has. Sine, cosine, exponential and logarithm have versions for vectors, with errors below one unit in
//! the last place, where the processor multiplies and adds in one; all else gives the same bits one at a time and eight at a time.
//!
//! | Operation | Points | Derivative |
//! |---|---|---|
//! | + − × ÷, negative, √, abs, sign, floor, ceil, min, max, comparisons, where | vectors | exact; zero of sign, floor, ceil, comparisons |
//! | sin, cos, exp, log | vectors | exact |
//! | tan, inverse and hyperbolic functions, expm1, log1p, ∛, power, atan2, hypot | one by one | exact |
//!
//! References: A. Griewank & A. Walther, Evaluating Derivatives (2008). J. Andersson et al., Math. Program. Comput. 11 (2019) 1–36.
#![deny(unsafe_code)]
#![cfg_attr(
    not(test),
    deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::unreachable, clippy::todo)
)]

mod dependence;
mod derivative;
mod error;
mod evaluator;
mod function;
mod graph;
mod insertion;
mod lanes;
mod operation;
mod sparsity;
mod symbol;
mod tape;
mod traced;

pub use error::ExprError;
pub use evaluator::Evaluator;
pub use function::{Block, Derivative, ExprFunction};
pub use graph::{Expression, Graph};
pub use lanes::LANES;
pub use operation::Operation;
pub use somersault_core::argument::ArgumentError;
pub use somersault_core::cancel::CancellationToken;
pub use sparsity::Sparsity;
pub use symbol::Symbol;
pub use traced::Traced;
