//! Optimal motions.

mod arguments;
pub(crate) mod collocation;
mod dive;
pub(crate) mod joint_motion;
mod problem;
mod search;
pub(crate) mod solver;
mod swing_up;
mod term;
mod verification;

/// Optimal motions: splines, eigenpostures, shooting, collocation and dives.
#[pyo3::pymodule(name = "ocp", module = "somersault._somersault", submodule)]
pub(crate) mod module {
    use pyo3::prelude::*;

    #[pymodule_export]
    use crate::ocp::collocation::{
        CollocationOutcome, CollocationResult, MultiphaseResult, PolishResult, SolutionSensitivity,
        TracedPhase, TracedProblem,
    };
    #[pymodule_export]
    use crate::ocp::dive::{Dive, DiveSolution, DiveVerification, LiteralDive, dive_107b, dive_5174d};
    #[pymodule_export]
    use crate::ocp::joint_motion::{EigenpostureBase, SplineMotion};
    #[pymodule_export]
    use crate::ocp::problem::{Constraint, Cost, Motion, MotionProblem, Phase};
    #[pymodule_export]
    use crate::ocp::search::SearchResult;
    #[pymodule_export]
    use crate::ocp::solver::Report;
    #[pymodule_export]
    use crate::ocp::swing_up::CartPendulumProblem;
    #[pymodule_export]
    use crate::ocp::term::Term;
    #[pymodule_export]
    use crate::ocp::verification::{SwingUpVerification, Verification};

    #[pymodule_init]
    fn add_terms(module: &Bound<'_, PyModule>) -> PyResult<()> {
        crate::ocp::term::add_functions(module)
    }
}
