//! Optimal motions.

mod arguments;
mod collocation;
mod dive;
mod joint_motion;
mod problem;
mod search;
mod solver;
mod swing_up;
mod term;
mod verification;

pub(crate) use collocation::{
    CollocationOutcome, CollocationProblem, CollocationResult, MultiphaseProblem, MultiphaseResult,
};
pub(crate) use dive::{Dive, DiveSolution, DiveVerification, LiteralDive, dive_107b, dive_5174d};
pub(crate) use joint_motion::{EigenpostureBase, SplineMotion};
pub(crate) use problem::{Constraint, Cost, Motion, MotionProblem, Phase};
pub(crate) use search::SearchResult;
pub(crate) use solver::Report;
pub(crate) use swing_up::CartPendulumProblem;
pub(crate) use term::{Term, add_functions as add_terms};
pub(crate) use verification::{SwingUpVerification, Verification};
