//! Problems of optimal control by direct collocation, in one phase or several.

mod arguments;
mod external;
mod many;
mod multiphase_result;
mod outcome;
mod phase;
mod polish;
mod result;
mod search;
mod sensitivity;
mod traced;

pub(crate) use multiphase_result::MultiphaseResult;
pub(crate) use outcome::CollocationOutcome;
pub(crate) use phase::TracedPhase;
pub(crate) use polish::PolishResult;
pub(crate) use result::CollocationResult;
pub(crate) use sensitivity::SolutionSensitivity;
pub(crate) use traced::TracedProblem;

/// Names that the library has for arguments of Python.
const NAMES: [(&str, &str); 9] = [
    ("state_bounds` or `control_bounds", "bounds"),
    ("state_bounds", "bounds"),
    ("control_bounds", "bounds"),
    ("parameter_bounds", "bounds"),
    ("path_bounds", "path"),
    ("end_bounds", "ends"),
    ("initial_state", "initial"),
    ("final_state", "final"),
    ("tolerance", "tol"),
];
