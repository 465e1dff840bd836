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
