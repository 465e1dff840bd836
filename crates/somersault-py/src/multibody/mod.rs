//! Articulated bodies.

pub(crate) mod dynamics;
pub(crate) mod flight;
pub(crate) mod kinematics;
pub(crate) mod link;
pub(crate) mod model;
pub(crate) mod models;
pub(crate) mod motion;
pub(crate) mod partials;
pub(crate) mod urdf;

/// Articulated bodies and their dynamics.
#[pyo3::pymodule(name = "multibody", module = "somersault._somersault", submodule)]
pub(crate) mod module {
    #[pymodule_export]
    use crate::multibody::flight::fly;
    #[pymodule_export]
    use crate::multibody::link::Link;
    #[pymodule_export]
    use crate::multibody::model::Model;
    #[pymodule_export]
    use crate::multibody::models::{Diver, cart_pendulum, diver_planar, diver_spatial, two_link_arm};
    #[pymodule_export]
    use crate::multibody::motion::{TreeDenseOutput, TreeSolution, integrate_tree};
}
