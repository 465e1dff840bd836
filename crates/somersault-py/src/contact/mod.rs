//! Contact of bodies with surfaces and with each other.

pub(crate) mod contacts;
pub(crate) mod geometry;
pub(crate) mod laws;
pub(crate) mod platform;
pub(crate) mod sensitivity;
mod shapes;
pub(crate) mod surface;
pub(crate) mod system;
pub(crate) mod touches;
pub(crate) mod tree;
mod tree_gradient;
mod tree_models;
pub(crate) mod tree_sensitivity;

/// Compliant contact, its events and its derivatives.
#[pyo3::pymodule(name = "contact", module = "somersault._somersault", submodule)]
pub(crate) mod module {
    use pyo3::prelude::*;

    #[pymodule_export]
    use crate::contact::contacts::{Contact, SpherePair};
    #[pymodule_export]
    use crate::contact::geometry::{link_contacts, shape_contacts};
    #[pymodule_export]
    use crate::contact::laws::{Resistance, damping_ratio, restitution};
    #[pymodule_export]
    use crate::contact::platform::{Platform, TreeOnPlatforms};
    #[pymodule_export]
    use crate::contact::sensitivity::{Sensitivities, differentiate};
    #[pymodule_export]
    use crate::contact::surface::{
        CylindricalSurface, HalfSpace, SphericalSurface, Surface, SurfaceFunction,
    };
    #[pymodule_export]
    use crate::contact::system::{
        ContactSystem, bouncing_ball, falling_box, rolling_disk, sliding_block, spinning_top, tippe_top,
    };
    #[pymodule_export]
    use crate::contact::tree::{LinkContact, LinkEvent, LinkPair, TreeContacts};
    #[pymodule_export]
    use crate::contact::tree_gradient::{TreeGradient, gradient_tree};
    #[pymodule_export]
    use crate::contact::tree_models::{
        TreeContactSystem, hopping_leg, planar_biped, quadruped, ragdoll, springboard,
    };
    #[pymodule_export]
    use crate::contact::tree_sensitivity::{TreeSensitivities, differentiate_tree};
    #[pymodule_export]
    use crate::integrators::event::Event;

    #[pymodule_init]
    fn add_laws(module: &Bound<'_, PyModule>) -> PyResult<()> {
        crate::contact::laws::add_classes(module)
    }
}
