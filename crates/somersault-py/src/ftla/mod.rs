//! Finite-time Lyapunov analysis of flows and of hyper-sensitive optimal control: `somersault.ftla`.
//!
//! Classes here hold the crate's own values, and [`Watched`](watched::Watched) is the system of every calculation.

mod argument;
mod chain;
mod continuation;
mod control_problem;
mod differences;
mod differentiated;
mod dimension;
mod error;
mod flow;
mod flow_analysis;
mod following;
mod matching;
mod named_systems;
mod pickled_system;
mod placement;
mod run;
mod shooting;
mod spectrum;
mod subspace;
mod system;
mod watched;

/// Finite-time Lyapunov analysis of flows and of hyper-sensitive optimal control.
#[pyo3::pymodule(name = "ftla", module = "somersault._somersault", submodule)]
pub(crate) mod module {
    #[pymodule_export]
    use crate::ftla::chain::{Chain, Transition};
    #[pymodule_export]
    use crate::ftla::continuation::{
        ContinuationResult, cold_start, continue_through, py_follow, travel_arm,
    };
    #[pymodule_export]
    use crate::ftla::control_problem::state_costate;
    #[pymodule_export]
    use crate::ftla::flow::VariationalFlow;
    #[pymodule_export]
    use crate::ftla::flow_analysis::{
        field_exponents, grid_ridges, grid_smoothed, long_run, spectra_convergence,
    };
    #[pymodule_export]
    use crate::ftla::following::Following;
    #[pymodule_export]
    use crate::ftla::matching::{Matching, MatchingResult};
    #[pymodule_export]
    use crate::ftla::named_systems::{arm, cubic_regulator, linear_regulator, tree};
    #[pymodule_export]
    use crate::ftla::placement::{Placement, PlacementResult};
    #[pymodule_export]
    use crate::ftla::shooting::{Extremal, py_graded_times, shoot};
    #[pymodule_export]
    use crate::ftla::spectrum::{Diagnosis, Spectrum, diagnose};
    #[pymodule_export]
    use crate::ftla::subspace::{Splitting, Subspace, rank_held_costates, slow_subspace};
    #[pymodule_export]
    use crate::ftla::system::System;
}
