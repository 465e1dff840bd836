//! Trees from and to URDF documents.

use crate::core::convert::vector_or;
use crate::core::error::Error;
use crate::multibody::model::Model;
use pyo3::prelude::*;
use somersault::multibody::urdf::{self, Base, UrdfOptions};
use std::path::PathBuf;

fn read(text: &str, base: &str, gravity: Option<&Bound<'_, PyAny>>) -> Result<Model, Error> {
    let base = match base {
        "fixed" => Base::Fixed,
        "planar" => Base::Planar,
        "free" => Base::Free,
        _ => {
            return Err(Error::input(format!("`base` must be 'fixed', 'planar' or 'free', found '{base}'")));
        }
    };
    let gravity = vector_or("gravity", gravity, UrdfOptions::default().gravity)?;
    Ok(Model::of(urdf::read(text, &UrdfOptions { base, gravity })?))
}

#[pymethods]
impl Model {
    /// The tree of a URDF document.
    ///
    /// Links, their inertials, and joints of all types with origin, axis, limits and damping are read. Bodies
    /// have the names of links; q and v follow the joints depth first in the order of the document.
    /// Documents may come from anywhere: entities are refused and nesting costs no stack.
    ///
    /// Parameters
    /// ----------
    /// text : str
    ///     The document.
    /// base : {'fixed', 'planar', 'free'}, optional
    ///     How the root link is connected to the world.
    /// gravity : array_like, shape (3,), optional
    ///     Acceleration, m/s²; 9.81 along −z unless given.
    ///
    /// Returns
    /// -------
    /// Model
    ///
    /// Raises
    /// ------
    /// ReadError
    ///     If the document is not a tree of bodies; the message names the element and its line.
    #[staticmethod]
    #[pyo3(signature = (text, *, base="fixed", gravity=None))]
    fn from_urdf(text: &str, base: &str, gravity: Option<&Bound<'_, PyAny>>) -> Result<Self, Error> {
        read(text, base, gravity)
    }

    /// The tree of a URDF file, as `from_urdf` reads it.
    ///
    /// Parameters
    /// ----------
    /// path : path-like
    ///     The file.
    /// base : {'fixed', 'planar', 'free'}, optional
    ///     How the root link is connected to the world.
    /// gravity : array_like, shape (3,), optional
    ///     Acceleration, m/s²; 9.81 along −z unless given.
    ///
    /// Returns
    /// -------
    /// Model
    ///
    /// Raises
    /// ------
    /// ReadError
    ///     If the document is not a tree of bodies.
    /// OSError
    ///     If the file cannot be read.
    #[staticmethod]
    #[pyo3(signature = (path, *, base="fixed", gravity=None))]
    fn read_urdf(path: PathBuf, base: &str, gravity: Option<&Bound<'_, PyAny>>) -> Result<Self, Error> {
        read(&std::fs::read_to_string(path).map_err(PyErr::from)?, base, gravity)
    }

    /// The tree as a URDF document.
    ///
    /// Parameters
    /// ----------
    /// name : str, optional
    ///     Name of the robot.
    ///
    /// Returns
    /// -------
    /// str
    ///     Gravity is not part of it; nor is the joint of a root that is fixed at or floats from the origin.
    ///
    /// Raises
    /// ------
    /// WriteError
    ///     If the tree has spherical joints, which URDF lacks.
    #[pyo3(signature = (name="robot"))]
    fn to_urdf(&self, name: &str) -> Result<String, Error> {
        Ok(urdf::write(&self.model, name)?)
    }
}
