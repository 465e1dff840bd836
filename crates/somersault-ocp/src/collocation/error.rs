//! What can be wrong with a problem or a mesh.

use super::interval::Interval;
use crate::{NoSplines, WrongDerivative};
use somersault_core::argument::ArgumentError;
use somersault_expr::ExprError;
use somersault_multibody::DynamicsError;
use somersault_nlp::{EvaluationError, NoDerivative, SolverError};
use std::fmt;

/// An entry of a state or of the controls, and what that is where it has a name.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Entry {
    /// Its number.
    pub index: usize,
    /// Such as "q_cart".
    pub name: Option<String>,
}

impl fmt::Display for Entry {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "entry {}", self.index)?;
        self.name.as_ref().map_or(Ok(()), |name| write!(f, " ({name})"))
    }
}

fn of(phase: Option<usize>) -> String {
    phase.map_or_else(String::new, |phase| format!(" of phase {phase}"))
}

/// Why a problem cannot be transcribed.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CollocationError {
    /// The derivatives of a traced function cannot be made.
    #[error(transparent)]
    Traced(#[from] ExprError),
    /// The problem has no motion of splines.
    #[error(transparent)]
    NoSplines(#[from] NoSplines),
    /// An argument has the wrong number of entries.
    #[error("`{argument}`{} must have {expected} entries, found {found}", of(*phase))]
    Length {
        /// Number of the phase where there are several.
        phase: Option<usize>,
        /// Name of the argument.
        argument: &'static str,
        /// Entries requested.
        expected: usize,
        /// Entries given.
        found: usize,
    },
    /// A bound is NaN, or the lower exceeds the upper one.
    #[error("bounds of `{argument}`{}, {entry}, cross or are NaN: ({lower}, {upper})", of(*phase))]
    Bounds {
        /// Number of the phase where there are several.
        phase: Option<usize>,
        /// Name of the quantity.
        argument: &'static str,
        /// Its entry.
        entry: Entry,
        /// Lower bound given.
        lower: f64,
        /// Upper bound given.
        upper: f64,
    },
    /// A boundary condition lies outside of the bounds of the state.
    #[error(
        "`{argument}`{}, {entry}, must be within the bounds of the state, [{lower}, {upper}], found {found}", of(*phase)
    )]
    BoundaryOutside {
        /// Number of the phase where there are several.
        phase: Option<usize>,
        /// Name of the condition.
        argument: &'static str,
        /// State concerned.
        entry: Entry,
        /// What it was to be.
        found: Interval,
        /// Lower bound of the state.
        lower: f64,
        /// Upper bound of the state.
        upper: f64,
    },
    /// A number is NaN or infinite.
    #[error("`{argument}`{} must be finite, found {found}", of(*phase))]
    NonFinite {
        /// Number of the phase where there are several.
        phase: Option<usize>,
        /// Name of the argument.
        argument: &'static str,
        /// What was found.
        found: f64,
    },
    /// The horizon is empty or runs backwards for all times allowed.
    #[error("the horizon{} must run forward, found a start of {start} and an end of {end}", of(*phase))]
    Horizon {
        /// Number of the phase where there are several.
        phase: Option<usize>,
        /// Start, of the bounds or of the guess.
        start: f64,
        /// End.
        end: f64,
    },
    /// An argument that is not allowed.
    #[error(transparent)]
    Argument(#[from] ArgumentError),
    /// A mesh has no interval, an interval no point or too many, or its bounds do not increase from 0 to 1.
    #[error("invalid mesh{}: {reason}", of(*phase))]
    Mesh {
        /// Number of the phase where there are several.
        phase: Option<usize>,
        /// What is wrong with it.
        reason: &'static str,
    },
    /// The times of a guess do not increase.
    #[error("the times of the `guess`{} must increase, entry {entry} does not", of(*phase))]
    GuessTimes {
        /// Number of the phase where there are several.
        phase: Option<usize>,
        /// First entry that does not.
        entry: usize,
    },
    /// A linkage names a phase or a quantity that does not exist.
    #[error("linkage {linkage} names {what}, which does not exist")]
    Linkage {
        /// Number of the linkage.
        linkage: usize,
        /// What it names.
        what: String,
    },
    /// There is no phase.
    #[error("the problem has no phase")]
    NoPhase,
    /// Nothing is left to be decided.
    #[error(
        "`state_bounds`, `control_bounds` or the horizon must leave something free, found every variable fixed"
    )]
    NothingFree,
    /// A quaternion that is far from unit norm.
    #[error("`{argument}`{} must have a quaternion of norm 1, to a thousandth, at {entry}, found norm {norm}", of(*phase))]
    NotUnit {
        /// Number of the phase where there are several.
        phase: Option<usize>,
        /// What it is of.
        argument: &'static str,
        /// The first of its four entries.
        entry: Entry,
        /// Its norm.
        norm: f64,
    },
    /// Quaternions that overlap, or reach beyond the states.
    #[error("`quaternions`{} must be four states each and have none in common, found one that begins at {found}", of(*phase))]
    Quaternions {
        /// Number of the phase where there are several.
        phase: Option<usize>,
        /// The entry that does not.
        found: usize,
    },
    /// A degree of freedom that is actuated twice, or does not exist.
    #[error("`actuated` must name each degree of freedom at most once and below {n}, found {found}")]
    Actuated {
        /// Degrees of freedom of the tree.
        n: usize,
        /// What was found.
        found: usize,
    },
    /// The fewest points of an interval exceed the most, or the most allowed at all.
    #[error("`min_points` = {least} and `max_points` = {most} must be in this order and at most 500")]
    PointRange {
        /// Fewest points.
        least: usize,
        /// Most points.
        most: usize,
    },
    /// A solution cannot be differentiated.
    #[error(transparent)]
    NoDerivative(#[from] NoDerivative),
    /// The solver was misused, or a function of the user failed in it.
    #[error(transparent)]
    Solver(#[from] SolverError),
    /// A function of the user failed, or has no value at the guess.
    #[error(transparent)]
    Evaluation(#[from] EvaluationError),
    /// A derivative that a user wrote is not that of its function.
    #[error("{0}")]
    WrongDerivative(WrongDerivative),
}

/// Why a function has no expressions.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Untraced {
    /// It brings its values and derivatives itself.
    #[error("a function that brings its derivatives has none")]
    Given,
    /// It calls a function that brings its values itself.
    #[error("the function `{function}` is not traced")]
    Call {
        /// Its name.
        function: String,
    },
    /// A tree that cannot accelerate where it was looked at.
    #[error(transparent)]
    Dynamics(#[from] DynamicsError),
    /// The expressions cannot be made.
    #[error(transparent)]
    Graph(#[from] ExprError),
}

pub(super) fn expect_length(
    phase: Option<usize>,
    argument: &'static str,
    found: usize,
    expected: usize,
) -> Result<(), CollocationError> {
    if found == expected {
        Ok(())
    } else {
        Err(CollocationError::Length { phase, argument, expected, found })
    }
}
