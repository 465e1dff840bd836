//! What can be wrong with an expression or a function.

use somersault_core::argument::ArgumentError;

/// Why a function cannot be made or evaluated.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ExprError {
    /// An argument is not allowed.
    #[error(transparent)]
    Argument(#[from] ArgumentError),
    /// An expression of another graph was used.
    #[error("expression {found} belongs to another graph, this one has {allowed}")]
    Foreign {
        /// Number of the expression.
        found: usize,
        /// Expressions of the graph.
        allowed: usize,
    },
    /// The graph, or what it is compiled to, is too large.
    #[error("{found} {what} are needed, at most {allowed} are allowed")]
    TooLarge {
        /// What there are too many of.
        what: &'static str,
        /// How many are needed.
        found: usize,
        /// How many are allowed.
        allowed: usize,
    },
    /// A derivative by something that is not an input.
    #[error("derivatives are taken with respect to inputs, expression {found} is not an input")]
    NotAnInput {
        /// Number of the expression.
        found: usize,
    },
    /// There is no block of this name.
    #[error("there is no input `{found}`; the inputs are {allowed}")]
    UnknownInput {
        /// The name.
        found: String,
        /// The names that there are.
        allowed: String,
    },
    /// Two blocks have the same name.
    #[error("two inputs have the name `{found}`")]
    RepeatedInput {
        /// The name.
        found: String,
    },
    /// The evaluation was cancelled.
    #[error("the evaluation was cancelled")]
    Cancelled,
}
