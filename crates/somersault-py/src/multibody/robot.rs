//! Robots from files: the tree, what was repaired and ignored, and what is seen and touched.

use crate::core::convert::{components, rotation, vector_array};
use crate::core::error::Error;
use crate::core::value::{Pickled, brief, by_restore, counted, value};
use crate::multibody::model::Model;
use crate::multibody::source::{PickledSource, Source, in_file, text_given};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple, PyType};
use somersault::multibody::robot::{self, GeometryPurpose, GeometryShape};
use std::path::PathBuf;

/// A robot read from a file.
///
/// Files that exist have bodies that cannot be. An inertia that no distribution of mass has becomes the nearest one, a joint
/// that moves no mass is fixed, and `repairs` says so of each. `ignored` lists what the file says of the motion and the tree has not.
/// `Model.read_urdf` and `Model.read_mjcf` refuse such files instead.
///
/// Made by `from_urdf`, `read_urdf`, `from_mjcf` and `read_mjcf`.
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
    reference: Vec<f64>,
    joints: Vec<(String, usize)>,
    repairs: Vec<String>,
    ignored: Vec<String>,
    geometry: Vec<robot::Geometry>,
    source: Source,
}

impl Robot {
    fn read(py: Python<'_>, source: Source) -> Result<Self, Error> {
        let robot::Robot { name, model, reference, joints, repairs, ignored, geometry } =
            source.read(false)?;
        let repairs = repairs.iter().map(ToString::to_string).collect();
        let ignored = ignored.iter().map(ToString::to_string).collect();
        let model = Py::new(py, Model::of(model))?;
        Ok(Self { model, name, reference, joints, repairs, ignored, geometry, source })
    }

    /// The tree, and the shapes of its bodies.
    pub(crate) fn touched(&self) -> (&Py<Model>, &[robot::Geometry]) {
        (&self.model, &self.geometry)
    }
}

value! {
    impl Robot {
        /// Model: The tree.
        model: Py<Model> = |own, py| own.model.clone_ref(py);
        /// str: Name of the robot; empty if it has none.
        name: &str = |own| &own.name;
        /// ndarray, shape (n_positions,): Configuration in which the file shows the robot; ``qpos0`` of MuJoCo.
        reference: Bound<'py, PyAny> = |own, py| numpy::PyArray1::from_slice(py, &own.reference).into_any();
        /// dict of str to str: For each joint that has a name in the file the name of the body that it carries.
        joints: PyResult<Bound<'py, PyDict>> = |own, py| {
            let joints = PyDict::new(py);
            for (name, body) in &own.joints {
                joints.set_item(name, own.model.get().model.name(*body))?;
            }
            Ok(joints)
        };
        /// tuple of str: What the file says otherwise, each with its element and line; empty if the tree is that of the file.
        repairs: PyResult<Bound<'py, PyTuple>> = |own, py| PyTuple::new(py, &own.repairs);
        /// tuple of str: What the file says of the motion and the tree has not, each with its element and line.
        ignored: PyResult<Bound<'py, PyTuple>> = |own, py| PyTuple::new(py, &own.ignored);
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
        Self::read(py, Source::urdf(text_given(text, "read_urdf")?, base, gravity)?)
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
        in_file(&path, Self::read(py, Source::urdf_file(&path, base, gravity)?))
    }

    /// The robot of an MJCF document.
    ///
    /// Bodies with their inertial or the inertia of their geoms, joints, frames, defaults, constraints between two joints and geoms are
    /// read. Bodies have their names; q follows the joints as ``qpos`` does, with quaternions (x, y, z, w). Springs, dry
    /// friction, tendons, actuators, contacts and what else is not read stand in `ignored`. Documents may come from anywhere:
    /// entities are refused and nesting costs no stack.
    ///
    /// Parameters
    /// ----------
    /// text : str
    ///     The document. It may not include files.
    /// gravity : array_like, shape (3,), optional
    ///     Acceleration, m/s²; that of the document unless given.
    ///
    /// Returns
    /// -------
    /// Robot
    ///
    /// Raises
    /// ------
    /// ReadError
    ///     If the document is not a tree of rigid bodies; the message names the element and its line.
    ///
    /// Examples
    /// --------
    /// >>> from somersault.multibody import Robot
    /// >>> pendulum = Robot.from_mjcf('''<mujoco><worldbody><body name="rod">
    /// ...   <joint name="pivot" axis="0 1 0" damping="0.1" stiffness="3"/>
    /// ...   <geom type="sphere" size="0.1" pos="0 0 -1" mass="2"/>
    /// ... </body></worldbody></mujoco>''')
    /// >>> pendulum.joints
    /// {'pivot': 'rod'}
    /// >>> pendulum.ignored
    /// ('joint `pivot` (line 2): springs of joints are not read',)
    #[staticmethod]
    #[pyo3(signature = (text, *, gravity=None))]
    fn from_mjcf(py: Python<'_>, text: String, gravity: Option<&Bound<'_, PyAny>>) -> Result<Self, Error> {
        Self::read(py, Source::mjcf(text_given(text, "read_mjcf")?, gravity)?)
    }

    /// The robot of an MJCF file with those that it includes, as `from_mjcf` reads it.
    ///
    /// Parameters
    /// ----------
    /// path : path-like
    ///     The file. Files in its folder, and in folders in there, may be included.
    /// gravity : array_like, shape (3,), optional
    ///     Acceleration, m/s²; that of the document unless given.
    ///
    /// Returns
    /// -------
    /// Robot
    ///
    /// Raises
    /// ------
    /// ReadError
    ///     If the document is not a tree of rigid bodies, or a file that it includes cannot be read.
    /// OSError
    ///     If the file cannot be read.
    ///
    /// Examples
    /// --------
    /// >>> import pathlib, tempfile
    /// >>> from somersault import multibody
    /// >>> folder = pathlib.Path(tempfile.mkdtemp())
    /// >>> _ = (folder / "leg.xml").write_text('''<mujoco><body name="leg">
    /// ...   <joint name="hip" axis="0 1 0"/><geom size="0.1" mass="2"/></body></mujoco>''')
    /// >>> _ = (folder / "robot.xml").write_text('''<mujoco model="robot"><worldbody>
    /// ...   <include file="leg.xml"/></worldbody></mujoco>''')
    /// >>> multibody.Robot.read_mjcf(folder / "robot.xml")
    /// <Robot 'robot': 1 body, 0 repairs>
    #[staticmethod]
    #[pyo3(signature = (path, *, gravity=None))]
    fn read_mjcf(py: Python<'_>, path: PathBuf, gravity: Option<&Bound<'_, PyAny>>) -> Result<Self, Error> {
        in_file(&path, Self::read(py, Source::mjcf_file(&path, gravity)?))
    }

    fn __repr__(&self) -> String {
        let bodies = counted(self.model.get().model.n_bodies(), "body", "bodies");
        let repairs = counted(self.repairs.len(), "repair", "repairs");
        format!("<Robot '{}': {bodies}, {repairs}>", brief(&self.name, 40))
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> Pickled<'py> {
        by_restore(slf, (slf.get().source.pickled(slf.py()),))
    }

    /// A pickled robot.
    #[classmethod]
    fn _restore(kind: &Bound<'_, PyType>, source: PickledSource<'_>) -> Result<Self, Error> {
        Self::read(kind.py(), Source::restored(source)?)
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
        /// int or None: Number of the body; None if it is fixed in the world.
        body: Option<usize> = |own| own.0.body;
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
        /// str: ``'box'``, ``'cylinder'``, ``'capsule'``, ``'sphere'``, ``'ellipsoid'`` or ``'mesh'``.
        shape: &'static str = |own| own.parts().0;
        /// tuple of float: Edges of a box; radius and length of a cylinder or a capsule, whose length is without its ends; radius of
        /// a sphere, semi-axes of an ellipsoid, m. Factors along the axes of a mesh.
        size: PyResult<Bound<'py, PyTuple>> = |own, py| PyTuple::new(py, own.parts().1);
        /// str or None: The file of a mesh, as the document says it; it is not opened.
        file: Option<&str> = |own| match &own.0.shape {
            GeometryShape::Mesh { file, .. } => Some(file),
            GeometryShape::Box { .. } | GeometryShape::Cylinder { .. } | GeometryShape::Capsule { .. } | GeometryShape::Sphere { .. } | GeometryShape::Ellipsoid { .. } => None,
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
            GeometryShape::Ellipsoid { radii } => ("ellipsoid", radii.as_slice().to_vec()),
            GeometryShape::Mesh { scale, .. } => ("mesh", scale.as_slice().to_vec()),
        }
    }
}

#[pymethods]
impl Geometry {
    fn __repr__(&self) -> String {
        let (shape, size) = self.parts();
        let of = self.0.body.map_or("the world".to_owned(), |body| format!("body {body}"));
        format!("<Geometry: {} {shape} {size:?} of {of}>", self.purpose())
    }
}
