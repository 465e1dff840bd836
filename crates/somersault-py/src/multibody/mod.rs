//! Articulated bodies.

pub(crate) mod dynamics;
pub(crate) mod flight;
pub(crate) mod given;
pub(crate) mod kinematics;
pub(crate) mod link;
pub(crate) mod model;
pub(crate) mod models;
pub(crate) mod motion;
pub(crate) mod partials;
pub(crate) mod profile;
pub(crate) mod robot;
pub(crate) mod rollout;
pub(crate) mod source;

/// Articulated bodies and their dynamics.
#[pyo3::pymodule(name = "multibody", module = "somersault._somersault", submodule)]
pub(crate) mod module {
    use pyo3::prelude::*;
    use pyo3::types::PyTuple;

    #[pymodule_export]
    use crate::multibody::flight::fly;
    #[pymodule_export]
    use crate::multibody::link::Link;
    #[pymodule_export]
    use crate::multibody::model::Model;
    #[pymodule_export]
    use crate::multibody::models::Diver;
    #[pymodule_export]
    use crate::multibody::motion::{TreeDenseOutput, TreeSolution, integrate_tree};
    #[pymodule_export]
    use crate::multibody::profile::TorqueProfile;
    #[pymodule_export]
    use crate::multibody::robot::{Geometry, Robot};
    #[pymodule_export]
    use crate::multibody::rollout::rollout;

    #[pymodule_init]
    fn add_models(module: &Bound<'_, PyModule>) -> PyResult<()> {
        use crate::multibody::models::{NAMES, add_functions};
        module.setattr("_NAMED_MODELS", PyTuple::new(module.py(), NAMES)?)?;
        add_functions(module)
    }
}
