//! Motion problems by shooting.

mod constraint;
mod cost;
mod evaluation;
mod motion;
mod motion_problem;
mod phase;
mod place;
mod range;
mod recipe;
mod shared;

pub(crate) use constraint::Constraint;
pub(crate) use cost::Cost;
pub(crate) use motion::Motion;
pub(crate) use motion_problem::MotionProblem;
pub(crate) use phase::Phase;
