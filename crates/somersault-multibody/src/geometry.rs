//! Shapes that are fixed in bodies: what they look like and collide with.

use nalgebra::{UnitQuaternion, Vector3};

/// What a shape is for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum GeometryPurpose {
    /// To be seen.
    Visual,
    /// To be touched.
    Collision,
}

/// A shape that is fixed in a body.
#[derive(Debug, Clone, PartialEq)]
pub struct Geometry {
    /// Number of the body in the model; none if it is fixed in the world.
    pub body: Option<usize>,
    /// What it is for.
    pub purpose: GeometryPurpose,
    /// Its name, if it has one.
    pub name: Option<String>,
    /// Where it is in the body, m.
    pub position: Vector3<f64>,
    /// How it is turned: its axes → those of the body.
    pub orientation: UnitQuaternion<f64>,
    /// The shape.
    pub shape: GeometryShape,
}

/// Shapes about their centres; axes of symmetry are along z.
#[derive(Debug, Clone, PartialEq)]
pub enum GeometryShape {
    /// A box.
    Box {
        /// Lengths of its edges, m.
        size: Vector3<f64>,
    },
    /// A cylinder.
    Cylinder {
        /// Its radius, m.
        radius: f64,
        /// Its length, m.
        length: f64,
    },
    /// A cylinder with half a sphere at each end.
    Capsule {
        /// Its radius, m.
        radius: f64,
        /// Length of the cylinder, m.
        length: f64,
    },
    /// A sphere.
    Sphere {
        /// Its radius, m.
        radius: f64,
    },
    /// An ellipsoid.
    Ellipsoid {
        /// Its semi-axes, m.
        radii: Vector3<f64>,
    },
    /// A surface in a file of its own, which is not opened.
    Mesh {
        /// Where it is, as the document says it.
        file: String,
        /// Factors along its axes.
        scale: Vector3<f64>,
    },
}
