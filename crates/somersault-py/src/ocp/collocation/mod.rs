//! Motions of trees by direct collocation, in one phase or several.

mod arguments;
mod guess;
mod multiphase;
mod multiphase_result;
mod outcome;
mod problem;
mod result;
mod search;
mod terms;
mod traced;

pub(crate) use multiphase::MultiphaseProblem;
pub(crate) use multiphase_result::MultiphaseResult;
pub(crate) use outcome::CollocationOutcome;
pub(crate) use problem::CollocationProblem;
pub(crate) use result::CollocationResult;
pub(crate) use traced::TracedProblem;

/// Names that the library has for arguments of these classes.
const NAMES: [(&str, &str); 4] = [
    ("control_bounds", "control_lower` and `control_upper"),
    ("state_bounds", "state_lower` and `state_upper"),
    ("path_bounds", "path_lower` and `path_upper"),
    ("tolerance", "tol"),
];
