//! What can be wrong with a program, a start or an option.

use crate::report::Report;
use std::error::Error;

/// Why there is no ordinary report.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SolverError {
    /// An argument has the wrong number of entries.
    #[error("`{argument}` has {found} entries, the program asks for {allowed}")]
    Length {
        /// Name of the argument.
        argument: &'static str,
        /// Entries given.
        found: usize,
        /// Entries the program asks for.
        allowed: usize,
    },
    /// An entry is NaN or infinite.
    #[error("`{argument}[{index}]` is {found}, allowed are finite numbers")]
    NotFinite {
        /// Name of the argument.
        argument: &'static str,
        /// Index of the entry.
        index: usize,
        /// The entry.
        found: f64,
    },
    /// Bounds contradict each other.
    #[error(
        "`{argument}[{index}]` is from {lower} to {upper}, allowed are lower ≤ upper, lower < ∞, upper > −∞"
    )]
    Bounds {
        /// Name of the argument.
        argument: &'static str,
        /// Index of the entry.
        index: usize,
        /// Lower bound.
        lower: f64,
        /// Upper bound.
        upper: f64,
    },
    /// A sparsity pattern is no pattern of the size it should have.
    #[error("`{argument}` {found}; allowed are compressed columns of {n_rows} × {n_columns} with ascending rows{}",
        if *.upper {" in the upper triangle"} else {""})]
    Pattern {
        /// Name of the argument.
        argument: &'static str,
        /// What is wrong.
        found: String,
        /// Rows it should have.
        n_rows: usize,
        /// Columns it should have.
        n_columns: usize,
        /// Whether it should be an upper triangle.
        upper: bool,
    },
    /// An option has a value that means nothing.
    #[error("`{argument}` is {found}, allowed is {allowed}")]
    Setting {
        /// Name of the option.
        argument: &'static str,
        /// Its value.
        found: f64,
        /// What it may be.
        allowed: &'static str,
    },
    /// The solver takes bounds on variables only.
    #[error("the program has {found} constraints, {solver} allows none but bounds on variables")]
    Constrained {
        /// Name of the solver.
        solver: &'static str,
        /// Constraints of the program.
        found: usize,
    },
    /// The equations of a step have no factors, whatever their numbers.
    #[error(
        "the equations of {n_variables} variables and {n_constraints} constraints have no factors: {reason}"
    )]
    Factorisation {
        /// Variables of the program.
        n_variables: usize,
        /// Its constraints.
        n_constraints: usize,
        /// What the factorisation says.
        reason: String,
    },
    /// A function of the user failed; the solve stopped there.
    #[error("a function of the user failed: {source}")]
    Failed {
        /// What it said.
        source: Box<dyn Error + Send + Sync>,
        /// The best iterate until then.
        report: Box<Report>,
    },
}
