//! Robots from files: the tree, what was repaired, and what is seen and touched.

use crate::core::convert::{components, rotation, vector_array};
use crate::core::error::Error;
use crate::core::value::{Pickled, brief, by_restore, value};
use crate::multibody::model::Model;
use crate::multibody::urdf::options;
use pyo3::prelude::*;
use pyo3::types::{PyTuple, PyType};
use somersault::multibody::robot::{self, GeometryPurpose, GeometryShape};
use somersault::multibody::urdf::{self, Base, UrdfOptions};
use std::path::PathBuf;

/// A robot read from a file.
///
/// Files that exist have bodies that cannot be. An inertia that no distribution of mass has becomes the nearest one, a joint
/// that moves no mass is fixed, and `repairs` says so of each. `Model.read_urdf` refuses such files instead.
///
/// Made by `from_urdf` and `read_urdf`.
///
/// Examples
/// --------
/// >>> from somersault.multibody import Robot
/// >>> finger = Robot.from_urdf('''<robot name="finger">
/// ...   <link name="palm"/>
/// ...   <joint name="first" type="continuous"><parent link="palm"/><child link="bone"/></joint>
/// ...   <joint name="second" type="continuous"><parent link="bone"/><child link="tip"/>
/// ...     <mimic joint="first" multiplier="0.5"/></joint>
/// ...   <link name="bone"><inertial><mass value="1"/>
/// ...     <inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="3"/></inertial></link>
/// ...   <link name="tip"/>
/// ... </robot>''')
/// >>> finger.model.n_velocities
/// 1
/// >>> len(finger.repairs)
/// 1
#[pyclass(frozen, module = "somersault.multibody")]
pub(crate) struct Robot {
    model: Py<Model>,
    name: String,
    repairs: Vec<String>,
    geometry: Vec<robot::Geometry>,
    text: String,
    options: UrdfOptions,
}

/// The name of a base.
fn base_of(base: Base) -> &'static str {
    match base {
        Base::Fixed => "fixed",
        Base::Planar => "planar",
        Base::Free => "free",
    }
}

impl Robot {
    fn read(py: Python<'_>, text: String, options: UrdfOptions) -> Result<Self, Error> {
        let robot::Robot { name, model, repairs, geometry } = urdf::read(&text, &options)?;
        let repairs = repairs.iter().map(ToString::to_string).collect();
        Ok(Self { model: Py::new(py, Model::of(model))?, name, repairs, geometry, text, options })
    }
}

value! {
    impl Robot {
        /// Model: The tree.
        model: Py<Model> = |own, py| own.model.clone_ref(py);
        /// str: Name of the robot; empty if it has none.
        name: &str = |own| &own.name;
        /// tuple of str: What the file says otherwise, each with its element and line; empty if the tree is that of the file.
        repairs: PyResult<Bound<'py, PyTuple>> = |own, py| PyTuple::new(py, &own.repairs);
        /// list of Geometry: What its bodies look like and collide with, in the order of the bodies.
        geometry: Vec<Geometry> = |own| own.geometry.iter().cloned().map(Geometry).collect();
    }
}

#[pymethods]
impl Robot {
    /// The robot of a URDF document.
    ///
    /// Links, their inertials, joints of all types with origin, axis, limits, damping and the joints they mimic, visual
    /// and collision elements are read. Bodies have the names of links; q and v follow the joints depth first in the order of the
    /// document, without those that mimic others. Documents may come from anywhere: entities are refused and nesting costs no stack.
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
    /// Robot
    ///
    /// Raises
    /// ------
    /// ReadError
    ///     If the document is not a tree of bodies; the message names the element and its line.
    ///
    /// Examples
    /// --------
    /// >>> from somersault.multibody import Robot
    /// >>> robot = Robot.from_urdf('''<robot name="door">
    /// ...   <link name="frame"/>
    /// ...   <joint name="hinge" type="revolute"><parent link="frame"/><child link="leaf"/>
    /// ...     <axis xyz="0 0 1"/><limit lower="0" upper="1.6" effort="10" velocity="1"/></joint>
    /// ...   <link name="leaf"><inertial><mass value="20"/>
    /// ...     <inertia ixx="6" ixy="0" ixz="0" iyy="7" iyz="0" izz="1"/></inertial></link>
    /// ... </robot>''')
    /// >>> robot.name, robot.model.names, robot.repairs
    /// ('door', ['frame', 'leaf'], ())
    #[staticmethod]
    #[pyo3(signature = (text, *, base="fixed", gravity=None))]
    fn from_urdf(
        py: Python<'_>,
        text: String,
        base: &str,
        gravity: Option<&Bound<'_, PyAny>>,
    ) -> Result<Self, Error> {
        Self::read(py, text, options(base, gravity, false)?)
    }

    /// The robot of a URDF file, as `from_urdf` reads it.
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
    /// Robot
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
    /// >>> path = pathlib.Path(tempfile.mkdtemp()) / "arm.urdf"
    /// >>> _ = path.write_text(multibody.two_link_arm().to_urdf("arm"))
    /// >>> multibody.Robot.read_urdf(path)
    /// <Robot 'arm': 3 bodies, 0 repairs>
    #[staticmethod]
    #[pyo3(signature = (path, *, base="fixed", gravity=None))]
    fn read_urdf(
        py: Python<'_>,
        path: PathBuf,
        base: &str,
        gravity: Option<&Bound<'_, PyAny>>,
    ) -> Result<Self, Error> {
        let text = std::fs::read_to_string(path).map_err(PyErr::from)?;
        Self::read(py, text, options(base, gravity, false)?)
    }

    fn __repr__(&self) -> String {
        let (n_bodies, n_repairs) = (self.model.get().model.n_bodies(), self.repairs.len());
        format!("<Robot '{}': {n_bodies} bodies, {n_repairs} repairs>", brief(&self.name, 40))
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> Pickled<'py> {
        let own = slf.get();
        let gravity = vector_array(slf.py(), &own.options.gravity);
        by_restore(slf, (&own.text, base_of(own.options.base), gravity))
    }

    /// A pickled robot.
    #[classmethod]
    fn _restore(
        kind: &Bound<'_, PyType>,
        text: String,
        base: &str,
        gravity: &Bound<'_, PyAny>,
    ) -> Result<Self, Error> {
        Self::read(kind.py(), text, options(base, Some(gravity), false)?)
    }
}

/// A shape that is fixed in a body of a robot. Axes of symmetry are along z, and the origin is the centre.
///
/// Found in `Robot.geometry`.
#[pyclass(frozen, eq, module = "somersault.multibody")]
#[derive(Clone, PartialEq)]
pub(crate) struct Geometry(robot::Geometry);

value! {
    impl Geometry {
        /// int: Number of the body.
        body: usize = |own| own.0.body;
        /// str: ``'visual'`` or ``'collision'``.
        purpose: &'static str = |own| match own.0.purpose {
            GeometryPurpose::Visual => "visual",
            GeometryPurpose::Collision => "collision",
        };
        /// str or None: Its name, if it has one.
        name: Option<&str> = |own| own.0.name.as_deref();
        /// ndarray, shape (3,): Where it is in the body, m.
        position: Bound<'py, PyAny> = |own, py| vector_array(py, &own.0.position);
        /// scipy.spatial.transform.Rotation: Rotation from its axes to those of the body.
        orientation: PyResult<Bound<'py, PyAny>> = |own, py| {
            rotation(numpy::PyArray1::from_slice(py, &components(&own.0.orientation)).as_any())
        };
        /// str: ``'box'``, ``'cylinder'``, ``'capsule'``, ``'sphere'`` or ``'mesh'``.
        shape: &'static str = |own| own.parts().0;
        /// tuple of float: Edges of a box; radius and length of a cylinder or a capsule, whose length is without its ends; radius of
        /// a sphere, m. Factors along the axes of a mesh.
        size: PyResult<Bound<'py, PyTuple>> = |own, py| PyTuple::new(py, own.parts().1);
        /// str or None: The file of a mesh, as the document says it; it is not opened.
        file: Option<&str> = |own| match &own.0.shape {
            GeometryShape::Mesh { file, .. } => Some(file),
            GeometryShape::Box { .. } | GeometryShape::Cylinder { .. } | GeometryShape::Capsule { .. } | GeometryShape::Sphere { .. } => None,
        };
    }
}

impl Geometry {
    fn parts(&self) -> (&'static str, Vec<f64>) {
        match &self.0.shape {
            GeometryShape::Box { size } => ("box", size.as_slice().to_vec()),
            GeometryShape::Cylinder { radius, length } => ("cylinder", vec![*radius, *length]),
            GeometryShape::Capsule { radius, length } => ("capsule", vec![*radius, *length]),
            GeometryShape::Sphere { radius } => ("sphere", vec![*radius]),
            GeometryShape::Mesh { scale, .. } => ("mesh", scale.as_slice().to_vec()),
        }
    }
}

#[pymethods]
impl Geometry {
    fn __repr__(&self) -> String {
        let (shape, size) = self.parts();
        format!("<Geometry: {} {shape} {size:?} of body {}>", self.purpose(), self.0.body)
    }
}
