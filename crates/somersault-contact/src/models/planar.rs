//! Links that move in the vertical plane of x and z: their axes are x forward, y up and z to the right.

use nalgebra::{Matrix3, UnitQuaternion, Vector3};
use somersault_multibody::{Joint, Link, MassProperties};
use std::f64::consts::FRAC_PI_2;

/// Of mass, kg, centre of mass, m, and moment of inertia about it, kg m².
pub(super) fn mass(mass: f64, center: Vector3<f64>, moment: f64) -> MassProperties {
    MassProperties { mass, center, inertia: Matrix3::from_diagonal_element(moment) }
}

/// A link that hangs down from a hinge: mass, kg, depth of the centre of mass, m, and moment of inertia about it, kg m².
pub(super) fn hanging(name: &str, parent: &str, [own, center, moment]: [f64; 3]) -> Link {
    Link::child(name, parent, Joint::Revolute { axis: Vector3::z() }, mass(own, down(center), moment))
}

/// A place below the origin of a link, m.
pub(super) fn down(depth: f64) -> Vector3<f64> {
    Vector3::y() * -depth
}

/// The axes of the plane in the world.
pub(super) fn axes() -> UnitQuaternion<f64> {
    UnitQuaternion::from_axis_angle(&Vector3::x_axis(), FRAC_PI_2)
}
