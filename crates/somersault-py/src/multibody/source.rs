//! Documents of trees, URDF and MJCF: where they come from, and what they do not say.

use crate::core::convert::{vector, vector_array, vector_or};
use crate::core::error::{Class, Error};
use crate::core::value::brief;
use crate::multibody::model::Model;
use pyo3::prelude::*;
use somersault::multibody::mjcf::{MjcfFiles, MjcfOptions};
use somersault::multibody::robot::Robot;
use somersault::multibody::urdf::{self, Base, UrdfOptions};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// A document, and how it is to be read.
pub(crate) enum Source {
    Urdf { text: String, options: UrdfOptions },
    Mjcf { files: MjcfFiles, options: MjcfOptions },
}

/// The format, text, included files, base and gravity of a pickled source.
pub(crate) type PickledSource<'py> =
    (String, String, BTreeMap<String, String>, Option<String>, Option<Bound<'py, PyAny>>);

/// The text of a file, which Python opens: its exceptions name the file.
fn text_of(path: &Path) -> Result<String, Error> {
    let bytes: Vec<u8> = Python::attach(|py| {
        py.import("pathlib")?.call_method1("Path", (path,))?.call_method0("read_bytes")?.extract()
    })?;
    String::from_utf8(bytes).map_err(|_| Error::read(format!("{}: not UTF-8", path.display())))
}

/// The text of an argument, which may have been meant as a path.
pub(crate) fn text_given(text: String, read: &str) -> Result<String, Error> {
    if text.contains('<') || text.contains('\n') {
        return Ok(text);
    }
    Err(Error::read(format!(
        "`text` must be a document of XML, found '{}'; a file is read by `{read}`",
        brief(&text, 40)
    )))
}

/// The same error, which names the file.
pub(crate) fn in_file<T>(path: &Path, found: Result<T, Error>) -> Result<T, Error> {
    found.map_err(|error| match error {
        Error::Own { class: Class::Read, message } => Error::read(format!("{}: {message}", path.display())),
        other => other,
    })
}

impl Source {
    pub(crate) fn urdf(text: String, base: &str, gravity: Option<&Bound<'_, PyAny>>) -> Result<Self, Error> {
        let base = match base {
            "fixed" => Base::Fixed,
            "planar" => Base::Planar,
            "free" => Base::Free,
            _ => {
                return Err(Error::input(format!(
                    "`base` must be 'fixed', 'planar' or 'free', found '{base}'"
                )));
            }
        };
        let gravity = vector_or("gravity", gravity, UrdfOptions::default().gravity)?;
        Ok(Self::Urdf { text, options: UrdfOptions { base, gravity, strict: false } })
    }

    pub(crate) fn urdf_file(
        path: &Path,
        base: &str,
        gravity: Option<&Bound<'_, PyAny>>,
    ) -> Result<Self, Error> {
        Self::urdf(text_of(path)?, base, gravity)
    }

    fn mjcf_files(files: MjcfFiles, gravity: Option<&Bound<'_, PyAny>>) -> Result<Self, Error> {
        let gravity = gravity.map(|value| vector("gravity", value)).transpose()?;
        Ok(Self::Mjcf { files, options: MjcfOptions { gravity, strict: false } })
    }

    pub(crate) fn mjcf(text: String, gravity: Option<&Bound<'_, PyAny>>) -> Result<Self, Error> {
        Self::mjcf_files(MjcfFiles { text, included: BTreeMap::new() }, gravity)
    }

    pub(crate) fn mjcf_file(path: &Path, gravity: Option<&Bound<'_, PyAny>>) -> Result<Self, Error> {
        let folder = path.parent().unwrap_or(Path::new(""));
        Self::mjcf_files(MjcfFiles::beside(text_of(path)?, folder)?, gravity)
    }

    /// The robot, repaired unless `strict`.
    pub(crate) fn read(&self, strict: bool) -> Result<Robot, Error> {
        Ok(match self {
            Self::Urdf { text, options } => urdf::read(text, &UrdfOptions { strict, ..*options })?,
            Self::Mjcf { files, options } => files.read(&MjcfOptions { strict, ..*options })?,
        })
    }

    pub(crate) fn pickled<'py>(&self, py: Python<'py>) -> PickledSource<'py> {
        match self {
            Self::Urdf { text, options } => {
                let base = match options.base {
                    Base::Fixed => "fixed",
                    Base::Planar => "planar",
                    Base::Free => "free",
                };
                let gravity = Some(vector_array(py, &options.gravity));
                ("urdf".to_owned(), text.clone(), BTreeMap::new(), Some(base.to_owned()), gravity)
            }
            Self::Mjcf { files: MjcfFiles { text, included }, options } => {
                let gravity = options.gravity.map(|gravity| vector_array(py, &gravity));
                ("mjcf".to_owned(), text.clone(), included.clone(), None, gravity)
            }
        }
    }

    pub(crate) fn restored(pickled: PickledSource<'_>) -> Result<Self, Error> {
        let (format, text, included, base, gravity) = pickled;
        let gravity = gravity.as_ref();
        match (format.as_str(), base) {
            ("urdf", Some(base)) => Self::urdf(text, &base, gravity),
            ("mjcf", None) => Self::mjcf_files(MjcfFiles { text, included }, gravity),
            _ => Err(Error::input(format!(
                "the format must be 'urdf' with a base or 'mjcf', found '{format}'"
            ))),
        }
    }
}

/// The tree of a document, which is refused where it would be repaired.
fn strict(source: Source) -> Result<Model, Error> {
    Ok(Model::of(source.read(true)?.model))
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
    fn from_urdf(text: String, base: &str, gravity: Option<&Bound<'_, PyAny>>) -> Result<Self, Error> {
        strict(Source::urdf(text_given(text, "read_urdf")?, base, gravity)?)
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
        in_file(&path, strict(Source::urdf_file(&path, base, gravity)?))
    }

    /// The tree of an MJCF document.
    ///
    /// It is read as `Robot.from_mjcf` reads it, and refused where that repairs, and where it ignores what acts on the tree by
    /// itself: springs, dry friction, constraints that are not between two joints, tendons.
    ///
    /// Parameters
    /// ----------
    /// text : str
    ///     The document.
    /// gravity : array_like, shape (3,), optional
    ///     Acceleration, m/s²; that of the document unless given.
    ///
    /// Returns
    /// -------
    /// Model
    ///
    /// Raises
    /// ------
    /// ReadError
    ///     If the document is not a tree of rigid bodies that can be; the message names the element and its line.
    ///
    /// Examples
    /// --------
    /// >>> from somersault import multibody
    /// >>> ball = multibody.Model.from_mjcf('''<mujoco><worldbody><body name="ball">
    /// ...   <freejoint/><geom size="0.1" mass="2"/></body></worldbody></mujoco>''')
    /// >>> ball
    /// <Model: 1 body from 'ball', 6 degrees of freedom, 2 kg>
    #[staticmethod]
    #[pyo3(signature = (text, *, gravity=None))]
    fn from_mjcf(text: String, gravity: Option<&Bound<'_, PyAny>>) -> Result<Self, Error> {
        strict(Source::mjcf(text_given(text, "read_mjcf")?, gravity)?)
    }

    /// The tree of an MJCF file with those that it includes, as `from_mjcf` reads it: `Robot.read_mjcf` repairs and lists what
    /// this refuses.
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
    /// Model
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
    /// >>> path = pathlib.Path(tempfile.mkdtemp()) / "rod.xml"
    /// >>> _ = path.write_text('''<mujoco><worldbody><body name="rod">
    /// ...   <joint axis="0 1 0"/><geom size="0.1" pos="0 0 -1" mass="2"/></body></worldbody></mujoco>''')
    /// >>> multibody.Model.read_mjcf(path).mass_matrix([0.0])
    /// array([[2.008]])
    #[staticmethod]
    #[pyo3(signature = (path, *, gravity=None))]
    fn read_mjcf(path: PathBuf, gravity: Option<&Bound<'_, PyAny>>) -> Result<Self, Error> {
        in_file(&path, strict(Source::mjcf_file(&path, gravity)?))
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
