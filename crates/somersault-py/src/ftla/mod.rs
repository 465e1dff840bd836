//! Finite-time Lyapunov analysis of hyper-sensitive optimal control: `somersault.ftla`.
//!
//! Classes here hold the crate's own values, and [`Watched`](watched::Watched) is the system of every calculation.

mod argument;
mod chain;
mod continuation;
mod control_problem;
mod differences;
mod dimension;
mod error;
mod flow;
mod following;
mod matching;
mod named_systems;
mod placement;
mod run;
mod settings;
mod shooting;
mod spectrum;
mod subspace;
mod system;
mod watched;

pub(crate) use chain::{Chain, Transition};
pub(crate) use continuation::{ContinuationResult, cold_start, continue_through, py_follow, travel_arm};
pub(crate) use control_problem::state_costate;
pub(crate) use flow::VariationalFlow;
pub(crate) use following::Following;
pub(crate) use matching::{Matching, MatchingResult};
pub(crate) use named_systems::{arm, cubic_regulator, linear_regulator, tree};
pub(crate) use placement::{Placement, PlacementResult};
pub(crate) use shooting::{Extremal, py_graded_times, shoot};
pub(crate) use spectrum::{Diagnosis, Spectrum, diagnose};
pub(crate) use subspace::{Splitting, Subspace, rank_held_costates, slow_subspace};
pub(crate) use system::System;
