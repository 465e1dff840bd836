//! Shapes by name and size.

use crate::core::convert::{finite_all, with_shape};
use crate::core::error::Error;
use crate::core::value::brief;
use pyo3::prelude::*;
use somersault::integrators::nalgebra::Vector3;
use somersault::multibody::geometry::GeometryShape;

/// A shape as `Geometry.shape` and `Geometry.size` have it.
pub(crate) fn shape_of(shape: &str, size: &Bound<'_, PyAny>) -> Result<GeometryShape, Error> {
    let numbers = |count| finite_all("size", with_shape("size", &[count], size)?);
    match shape {
        "box" => Ok(GeometryShape::Box { size: Vector3::from_column_slice(&numbers(3)?) }),
        "capsule" => numbers(2).map(|size| GeometryShape::Capsule { radius: size[0], length: size[1] }),
        "cylinder" => numbers(2).map(|size| GeometryShape::Cylinder { radius: size[0], length: size[1] }),
        "sphere" => numbers(1).map(|size| GeometryShape::Sphere { radius: size[0] }),
        _ => Err(Error::input(format!(
            "`shape` must be 'box', 'capsule', 'cylinder' or 'sphere', found '{}'",
            brief(shape, 40)
        ))),
    }
}
