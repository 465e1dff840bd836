//! Rigid bodies: what moves, under what, by which method, and the result.

pub(crate) mod batch;
pub(crate) mod bodies;
pub(crate) mod event;
pub(crate) mod exact;
pub(crate) mod forces;
pub(crate) mod integrate;
pub(crate) mod located;
pub(crate) mod methods;
pub(crate) mod monitor;
pub(crate) mod plan;
pub(crate) mod problem;
pub(crate) mod seen;
pub(crate) mod solve;
pub(crate) mod stepper;
pub(crate) mod studies;
pub(crate) mod trajectory;
pub(crate) mod watching;

/// Rigid bodies, the methods that move them, and solutions.
#[pyo3::pymodule(name = "integrators", module = "somersault._somersault", submodule)]
pub(crate) mod module {
    #[pymodule_export]
    use crate::integrators::bodies::{RigidBody, State};
    #[pymodule_export]
    use crate::integrators::integrate::integrate;
    #[pymodule_export]
    use crate::integrators::methods::{MethodInfo, MethodTable, method, methods};
    #[pymodule_export]
    use crate::integrators::stepper::Stepper;
    #[pymodule_export]
    use crate::integrators::trajectory::{DenseOutput, Solution, Trajectory};
}
