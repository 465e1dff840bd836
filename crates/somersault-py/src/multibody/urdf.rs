//! Trees from and to URDF documents.

use crate::core::convert::vector_or;
use crate::core::error::Error;
use crate::multibody::model::Model;
use pyo3::prelude::*;
use somersault::multibody::urdf::{self, Base, UrdfOptions};
use std::path::PathBuf;

/// What a document does not say.
pub(crate) fn options(
    base: &str,
    gravity: Option<&Bound<'_, PyAny>>,
    strict: bool,
) -> Result<UrdfOptions, Error> {
    let base = match base {
        "fixed" => Base::Fixed,
        "planar" => Base::Planar,
        "free" => Base::Free,
        _ => {
            return Err(Error::input(format!("`base` must be 'fixed', 'planar' or 'free', found '{base}'")));
        }
    };
    let gravity = vector_or("gravity", gravity, UrdfOptions::default().gravity)?;
    Ok(UrdfOptions { base, gravity, strict })
}

fn read(text: &str, base: &str, gravity: Option<&Bound<'_, PyAny>>) -> Result<Model, Error> {
    Ok(Model::of(urdf::read(text, &options(base, gravity, true)?)?.model))
}

#[pymethods]
impl Model {
    /// The tree of a URDF document.
    ///
    /// It is read as `Robot.from_urdf` reads it, and refused where that repairs.
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
    ///     If the document is not a tree of bodies that can be; the message names the element and its line.
    ///
    /// Examples
    /// --------
    /// >>> from somersault import multibody
    /// >>> text = multibody.two_link_arm().to_urdf("arm")
    /// >>> multibody.Model.from_urdf(text, base="free")
    /// <Model: 3 bodies from 'world', 8 degrees of freedom, 1 kg>
    #[staticmethod]
    #[pyo3(signature = (text, *, base="fixed", gravity=None))]
    fn from_urdf(text: &str, base: &str, gravity: Option<&Bound<'_, PyAny>>) -> Result<Self, Error> {
        read(text, base, gravity)
    }

    /// The tree of a URDF file, as `from_urdf` reads it: `Robot.read_urdf` repairs what this refuses.
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
    ///
    /// Examples
    /// --------
    /// >>> import pathlib, tempfile
    /// >>> from somersault import multibody
    /// >>> path = pathlib.Path(tempfile.mkdtemp()) / "cart.urdf"
    /// >>> _ = path.write_text(multibody.cart_pendulum().to_urdf())
    /// >>> multibody.Model.read_urdf(path).names
    /// ['world', 'cart', 'pendulum']
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
    ///
    /// Examples
    /// --------
    /// >>> from somersault import multibody
    /// >>> text = multibody.two_link_arm().to_urdf("arm")
    /// >>> [line.strip() for line in text.splitlines() if "<joint" in line]
    /// ['<joint name="upper" type="continuous">', '<joint name="lower" type="continuous">']
    #[pyo3(signature = (name="robot"))]
    fn to_urdf(&self, name: &str) -> Result<String, Error> {
        Ok(urdf::write(&self.model, name)?)
    }
}
