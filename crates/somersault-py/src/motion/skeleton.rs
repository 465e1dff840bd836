//! Recordings of skeletons.

use super::markers::{MarkerRecording, duration, new_times};
use super::matrix::{count, numbers_array};
use super::repair::Repair;
use crate::core::convert::{
    array, components, quaternions, real_numbers, vector_array, vector_or, with_shape,
};
use crate::core::error::Error;
use crate::core::value::{Pickled, brief, by_class, by_restore, value};
use crate::multibody::model::Model;
use pyo3::prelude::*;
use pyo3::types::{PyList, PyTuple, PyType};
use somersault::motion::nalgebra::Vector3;
use somersault::motion::recording;

/// A joint of a skeleton.
///
/// Parameters
/// ----------
/// name : str
/// parent : int, optional
///     Number of the parent, which comes before it; the first joint has none.
/// offset : array_like, shape (3,), optional
///     Place in the axes of the parent, m; that of the root in the world.
/// turns : bool, optional
///     Whether it turns; ends of segments do not.
/// moves : bool, optional
///     Whether it moves in its parent: each frame then has a place that stands for the offset.
///
/// Examples
/// --------
/// >>> from somersault import motion
/// >>> knee = motion.SkeletonJoint("knee", parent=0, offset=(0.0, 0.0, -0.4))
/// >>> knee.offset.tolist(), knee.turns, knee.moves
/// ([0.0, 0.0, -0.4], True, False)
#[pyclass(frozen, module = "somersault.motion")]
pub(crate) struct SkeletonJoint {
    joint: recording::SkeletonJoint,
}

value! {
    impl SkeletonJoint {
        /// str: Its name.
        name: &str = |own| &own.joint.name;
        /// int or None: Number of the parent.
        parent: Option<usize> = |own| own.joint.parent;
        /// ndarray, shape (3,): Place in the axes of the parent, m.
        offset: Bound<'py, PyAny> = |own, py| vector_array(py, &own.joint.offset);
        /// bool: Whether it turns.
        turns: bool = |own| own.joint.turns;
        /// bool: Whether it moves in its parent.
        moves: bool = |own| own.joint.moves;
    }
}

#[pymethods]
impl SkeletonJoint {
    #[new]
    #[pyo3(signature = (name, parent=None, offset=None, *, turns=true, moves=false))]
    fn new(
        name: String,
        parent: Option<i128>,
        offset: Option<&Bound<'_, PyAny>>,
        turns: bool,
        moves: bool,
    ) -> Result<Self, Error> {
        let parent = parent.map(|parent| count("parent", parent)).transpose()?;
        let offset = vector_or("offset", offset, Vector3::zeros())?;
        Ok(Self { joint: recording::SkeletonJoint { name, parent, offset, turns, moves } })
    }

    fn __repr__(&self) -> String {
        format!("<SkeletonJoint: {}>", brief(&self.joint.name, 40))
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> Pickled<'py> {
        let joint = slf.get();
        by_restore(slf, (joint.name(), joint.parent(), joint.offset(slf.py()), joint.turns(), joint.moves()))
    }

    /// A pickled joint.
    #[classmethod]
    fn _restore(
        _: &Bound<'_, PyType>,
        name: String,
        parent: Option<i128>,
        offset: &Bound<'_, PyAny>,
        turns: bool,
        moves: bool,
    ) -> Result<Self, Error> {
        Self::new(name, parent, Some(offset), turns, moves)
    }
}

/// A tree of joints.
///
/// Parameters
/// ----------
/// joints : sequence of SkeletonJoint
///     The root first, every other after its parent.
///
/// Raises
/// ------
/// InputError
///     If the joints make no tree, or names repeat.
///
/// Examples
/// --------
/// >>> from somersault import motion
/// >>> hip = motion.SkeletonJoint("hip", moves=True)
/// >>> knee = motion.SkeletonJoint("knee", 0, (0.0, 0.0, -0.4))
/// >>> motion.Skeleton([hip, knee])
/// <Skeleton: 2 joints from 'hip', 2 turn, 1 move>
#[pyclass(frozen, module = "somersault.motion")]
#[derive(Clone)]
pub(crate) struct Skeleton {
    pub(super) skeleton: recording::Skeleton,
}

value! {
    impl Skeleton {
        /// tuple of str: Names of the joints.
        names: PyResult<Bound<'py, PyTuple>> = |own, py| own.named(py, |_| true);
        /// tuple of str: Names of the joints that turn, each with a rotation in every frame.
        turning: PyResult<Bound<'py, PyTuple>> = |own, py| own.named(py, |joint| joint.turns);
        /// tuple of str: Names of the joints that move in their parent, each with a place in every frame.
        moving: PyResult<Bound<'py, PyTuple>> = |own, py| own.named(py, |joint| joint.moves);
    }
}

#[pymethods]
impl Skeleton {
    #[new]
    fn new(joints: Vec<Bound<'_, SkeletonJoint>>) -> Result<Self, Error> {
        let joints = joints.iter().map(|joint| joint.get().joint.clone()).collect();
        Ok(Self { skeleton: recording::Skeleton::try_new(joints)? })
    }

    /// list of SkeletonJoint: The joints.
    #[getter]
    fn joints<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyList>> {
        PyList::new(py, self.skeleton.joints().iter().cloned().map(|joint| SkeletonJoint { joint }))
    }

    /// The same tree for dynamics and for pictures: the root floats, joints that turn are spherical.
    ///
    /// Parameters
    /// ----------
    /// mass : float
    ///     A recording has none, kg; it is spread evenly over the joints that are not fixed, as points.
    ///
    /// Returns
    /// -------
    /// Model
    ///     Bodies are named after the joints; configurations are those of `SkeletonRecording.configurations`.
    ///
    /// Examples
    /// --------
    /// >>> from somersault import motion
    /// >>> hip = motion.SkeletonJoint("hip", moves=True)
    /// >>> knee = motion.SkeletonJoint("knee", 0, (0.0, 0.0, -0.4))
    /// >>> model = motion.Skeleton([hip, knee]).model(60.0)
    /// >>> model.names, model.n_velocities
    /// (['hip', 'knee'], 9)
    fn model(&self, mass: f64) -> Result<Model, Error> {
        Ok(Model::of(self.skeleton.model(mass)?))
    }

    fn __repr__(&self) -> String {
        let s = &self.skeleton;
        format!(
            "<Skeleton: {} joints from '{}', {} turn, {} move>",
            s.joints().len(),
            brief(&s.joints()[0].name, 40),
            s.n_turning(),
            s.n_moving()
        )
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> Pickled<'py> {
        by_class(slf, (slf.get().joints(slf.py())?,))
    }
}

impl Skeleton {
    fn named<'py>(
        &self,
        py: Python<'py>,
        chosen: impl Fn(&recording::SkeletonJoint) -> bool,
    ) -> PyResult<Bound<'py, PyTuple>> {
        let names: Vec<&str> =
            self.skeleton.joints().iter().filter(|j| chosen(j)).map(|j| j.name.as_str()).collect();
        PyTuple::new(py, names)
    }
}

/// A skeleton and its poses, frame by frame, in m, with x forward, y left and z up.
///
/// Parameters
/// ----------
/// skeleton : Skeleton
/// times : array_like, shape (n_frames,)
///     Times of the frames, s, rising.
/// rotations : array_like, shape (n_frames, n_turning, 4)
///     Of the joints that turn against their parents, as quaternions (x, y, z, w).
/// places : array_like, shape (n_frames, n_moving, 3)
///     Of the joints that move, in the axes of their parents, m.
///
/// Raises
/// ------
/// InputError
///     If a number is not finite, or times do not rise.
///
/// Examples
/// --------
/// >>> import numpy as np
/// >>> from somersault import motion
/// >>> hip, knee = motion.SkeletonJoint("hip", moves=True), motion.SkeletonJoint("knee", 0, (0.0, 0.0, -0.4))
/// >>> still = np.tile([0.0, 0.0, 0.0, 1.0], (3, 2, 1))
/// >>> places = np.array([[[0.0, 0.0, 0.9]], [[0.1, 0.0, 0.9]], [[0.2, 0.0, 0.9]]])
/// >>> walk = motion.SkeletonRecording(motion.Skeleton([hip, knee]), [0.0, 0.1, 0.2], still, places)
/// >>> walk.joint_centres().track("knee")[-1].round(6)
/// array([0.2, 0. , 0.5])
#[pyclass(frozen, module = "somersault.motion")]
pub(crate) struct SkeletonRecording {
    pub(crate) recording: recording::SkeletonRecording,
    pub(crate) repairs: Vec<Repair>,
}

impl From<recording::SkeletonRecording> for SkeletonRecording {
    fn from(recording: recording::SkeletonRecording) -> Self {
        Self { recording, repairs: Vec::new() }
    }
}

value! {
    impl SkeletonRecording(skeleton, times, rotations, places) {
        /// Skeleton: The skeleton.
        skeleton: Skeleton = |own| Skeleton { skeleton: own.recording.skeleton().clone() };
        /// ndarray, shape (n_frames,): Times of the frames, s.
        times: Bound<'py, PyAny> = |own, py| numbers_array(py, own.recording.times());
        /// int: Number of frames.
        n_frames: usize = |own| own.recording.n_frames();
        /// float: From the first to the last frame, s.
        duration: f64 = |own| duration(own.recording.times());
        /// list of Repair: What was repaired or decided when its file was read. Of what is made of a recording there are none.
        repairs: Vec<Repair> = |own| own.repairs.clone();
    }
}

#[pymethods]
impl SkeletonRecording {
    #[new]
    fn new(
        skeleton: &Bound<'_, Skeleton>,
        times: &Bound<'_, PyAny>,
        rotations: &Bound<'_, PyAny>,
        places: &Bound<'_, PyAny>,
    ) -> Result<Self, Error> {
        let skeleton = skeleton.get().skeleton.clone();
        let times = real_numbers("times", times)?;
        let rotations = quaternions("rotations", &[times.len(), skeleton.n_turning()], rotations)?;
        let places = with_shape("places", &[times.len(), skeleton.n_moving(), 3], places)?;
        let places = places.chunks_exact(3).map(Vector3::from_column_slice).collect();
        Ok(recording::SkeletonRecording::try_new(skeleton, times, rotations, places)?.into())
    }

    /// ndarray, shape (n_frames, n_turning, 4): Rotations of the joints that turn against their parents, as quaternions
    /// (x, y, z, w).
    #[getter]
    fn rotations<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let joints = self.recording.skeleton().joints();
        let mut values = Vec::new();
        for frame in self.recording.frames() {
            let turning = frame.zip(joints).filter(|(_, joint)| joint.turns);
            values.extend(turning.flat_map(|((_, rotation), _)| components(&rotation)));
        }
        let shape = [self.recording.n_frames(), self.recording.skeleton().n_turning(), 4];
        Ok(array(py, values, &shape)?.into_any())
    }

    /// ndarray, shape (n_frames, n_moving, 3): Places of the joints that move, in the axes of their parents, m.
    #[getter]
    fn places<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let joints = self.recording.skeleton().joints();
        let mut values = Vec::new();
        for frame in self.recording.frames() {
            let moving = frame.zip(joints).filter(|(_, joint)| joint.moves);
            values.extend(moving.flat_map(|((place, _), _)| <[f64; 3]>::from(place)));
        }
        let shape = [self.recording.n_frames(), self.recording.skeleton().n_moving(), 3];
        Ok(array(py, values, &shape)?.into_any())
    }

    /// ndarray, shape (n_frames, n_positions): The frames as configurations of `Skeleton.model`.
    #[getter]
    fn configurations<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let n = self.recording.n_frames();
        let values: Vec<f64> = self.recording.configurations().flatten().collect();
        let width = values.len() / n;
        Ok(array(py, values, &[n, width])?.into_any())
    }

    /// Where all joints were, by forward kinematics.
    ///
    /// Returns
    /// -------
    /// MarkerRecording
    ///     With a marker for each joint, of its name.
    ///
    /// Examples
    /// --------
    /// A knee that is bent by 90°:
    ///
    /// >>> import numpy as np
    /// >>> from somersault import motion
    /// >>> joints = [
    /// ...     motion.SkeletonJoint("hip", moves=True), motion.SkeletonJoint("knee", 0, (0.0, 0.0, -0.4)),
    /// ...     motion.SkeletonJoint("ankle", 1, (0.0, 0.0, -0.4), turns=False)]
    /// >>> turns = [[[0.0, 0.0, 0.0, 1.0], [0.0, np.sqrt(0.5), 0.0, np.sqrt(0.5)]]]
    /// >>> bent = motion.SkeletonRecording(motion.Skeleton(joints), [0.0], turns, [[[0.0, 0.0, 0.9]]])
    /// >>> bent.joint_centres().track("ankle").round(6)
    /// array([[-0.4,  0. ,  0.5]])
    fn joint_centres(&self) -> Result<MarkerRecording, Error> {
        Ok(self.recording.joint_centres()?.into())
    }

    /// The same motion at other times: places by cubic splines, rotations on their group.
    ///
    /// Parameters
    /// ----------
    /// times : array_like, shape (n,), optional
    ///     Within the recording, s, rising.
    /// n_frames : int, optional
    ///     In the place of `times`: so many at equal distances.
    ///
    /// Returns
    /// -------
    /// SkeletonRecording
    ///
    /// Examples
    /// --------
    /// >>> import numpy as np
    /// >>> from somersault import motion
    /// >>> skeleton = motion.Skeleton([motion.SkeletonJoint("hip", moves=True)])
    /// >>> still, t = np.tile([0.0, 0.0, 0.0, 1.0], (5, 1, 1)), np.linspace(0.0, 1.0, 5)
    /// >>> walk = motion.SkeletonRecording(skeleton, t, still, np.outer(t, [1.0, 0.0, 0.0])[:, None])
    /// >>> walk.resample(n_frames=3).places[:, 0, 0].round(6)
    /// array([0. , 0.5, 1. ])
    #[pyo3(signature = (times=None, *, n_frames=None))]
    fn resample(&self, times: Option<&Bound<'_, PyAny>>, n_frames: Option<i128>) -> Result<Self, Error> {
        let times = new_times(self.recording.times(), times, n_frames)?;
        Ok(self.recording.resample(&times)?.into())
    }

    fn __len__(&self) -> usize {
        self.recording.n_frames()
    }

    fn __repr__(&self) -> String {
        format!(
            "<SkeletonRecording: {} joints, {} frames, {:.3} s>",
            self.recording.skeleton().joints().len(),
            self.recording.n_frames(),
            self.duration()
        )
    }
}
