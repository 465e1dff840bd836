//! Models scaled to persons.

use super::fit::MarkerSet;
use super::markers::MarkerRecording;
use super::matrix::{count, matrix, matrix_array, numbers_array, same_length};
use super::motion_fit::{name_of, status_of};
use super::reconstruction::{limits_dict, limits_pickled, limits_restored};
use crate::core::convert::{a_type, entries, key_of, vector_array};
use crate::core::error::Error;
use crate::core::value::{Pickled, by_restore, value};
use crate::core::waiting::leave_on_signal;
use crate::multibody::model::{Model, Which};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple, PyType};
use somersault::integrators::nalgebra::{DMatrix, Vector3};
use somersault::motion::scaling::{
    GroupScale, MarkerOffset, ModelScaler, ScaleGroup, ScaledModel as Scaled, ScalingOptions, ScalingStatus,
};

/// Scales a model to a person, by segments, and finds where markers are on them.
///
/// Sizes of segments and offsets of markers are fitted together with the postures of up to 50 frames: of a person who stands still, or better moves all
/// joints. Sizes and offsets are normal before the markers are looked at, so that what these do not tell stays as usual. The scaled
/// model and its markers are then used like any others, by `smooth_motion`, `reconstruct_flight`, `MarkerFit`.
///
/// Other Python threads run meanwhile. Ctrl-C raises at once and stops the search.
///
/// Parameters
/// ----------
/// markers : MarkerSet
///     The markers, and the model they are on.
/// recording : MarkerRecording
///     The person. Markers that the set does not name are ignored.
/// groups : dict, optional
///     What has one size over that of the model, by names for it: a body, bodies, or bodies with their axes, as in
///     ``{"legs": ["thigh", "shank"], "shoulders": {"torso": "y"}}``. An axis of a body may be
///     in one group only; what is in none goes with the whole. Unless given: each body that carries joints or markers, right and left as one; and
///     where a body carries a right and a left joint, the axis between these, its width.
/// size_deviation : float, optional
///     Standard deviation of the size of the whole body over that of the model, before the markers are looked at, as a fraction: 0.1 unless given.
/// group_deviation : float, optional
///     That of the size of each group over that of the whole, 0.05 unless given.
/// offset_deviation : float, optional
///     That of the place of each marker along each axis of its body, m, 0.01 unless given; 0 for markers, such as joint centres of a skeleton, that are
///     where they are said to be.
/// noise : float, optional
///     Standard deviation of the noise in each coordinate of a marker of weight 1, m, if it is known; estimated unless given.
/// threshold : float or None, optional
///     Distance in standard deviations of the noise from which on a point counts less (Huber's loss); None counts squares.
/// max_frames : int, optional
///     Frames that are taken, at most, equally many apart; 50 unless given.
/// max_iterations : int, optional
///     Iterations, at most, between estimates of the noise; 100 unless given.
///
/// Returns
/// -------
/// ScaledModel
///     The best that was found, whatever its status.
///
/// Raises
/// ------
/// InputError
///     If an argument is not allowed, the recording has none of the markers, or fewer than two frames show any, of which one is enough where the noise is
///     given.
///
/// Notes
/// -----
/// A point p of a body, or a joint that it carries, goes to S p with the diagonal matrix S of its sizes; masses stay. Sizes, offsets and postures
/// minimise Σ c ρ(‖x − y‖²)/σ² and the squares of logarithms of sizes and of offsets over their deviations, by Gauss-Newton with damping for sizes
/// and offsets, between whose steps each frame is brought to its own minimum. Deviations are those of the inverse of the Hessian of data and prior without the
/// postures, by linearisation; residuals that are alike from frame to frame, as under noise that is correlated and on skin that moves, count as if there
/// were fewer frames. Where joints of the model cannot follow the person, sizes take their place: compare `rms` with that of a model with more joints.
///
/// References
/// ----------
/// B.-W. Lu and J. J. O'Connor, J. Biomech. 32 (1999) 129. M. Andersen et al., Comput. Methods Biomech. Biomed. Eng. 13 (2010) 171. K.
/// Werling et al., PLoS ONE 18 (2023) e0295152.
///
/// Examples
/// --------
/// A diver with long thighs goes from the layout into a pike, seen with noise of 5 mm:
///
/// >>> import numpy as np
/// >>> from somersault import motion, multibody
/// >>> diver = multibody.diver_planar()
/// >>> person = diver.scaled({"thigh": 1.08})
/// >>> straight, pike = diver.configuration("A"), diver.configuration("H")
/// >>> t = np.linspace(0.0, 1.0, 51)
/// >>> q = straight + t[:, None] * (pike - straight)
/// >>> seen = motion.place_markers(motion.MarkerSet.on_diver(person, "halpe_26"), t, q)
/// >>> points = seen.points + np.random.default_rng(1).normal(0.0, 0.005, seen.points.shape)
/// >>> recording = motion.MarkerRecording(seen.names, t, points)
/// >>> found = motion.scale_model(motion.MarkerSet.on_diver(diver, "halpe_26"), recording)
/// >>> found.success, found.rms < found.rms_before
/// (True, True)
/// >>> bool(abs(found.scales["thigh"] - 1.08) < 3 * found.scale_deviations["thigh"] < 0.12)
/// True
#[pyfunction]
#[pyo3(signature = (markers, recording, *, groups=None, size_deviation=0.1, group_deviation=0.05, offset_deviation=0.01, noise=None, threshold=4.0, max_frames=None, max_iterations=None))]
pub(crate) fn scale_model(
    py: Python<'_>,
    markers: &Bound<'_, MarkerSet>,
    recording: &Bound<'_, MarkerRecording>,
    groups: Option<&Bound<'_, PyDict>>,
    size_deviation: f64,
    group_deviation: f64,
    offset_deviation: f64,
    noise: Option<f64>,
    threshold: Option<f64>,
    max_frames: Option<i128>,
    max_iterations: Option<i128>,
) -> Result<ScaledModel, Error> {
    let set = markers.get();
    let tree = set.model.get();
    let default = ScalingOptions::default();
    let options = ScalingOptions {
        groups: groups.map(|groups| groups_of(tree, groups)).transpose()?,
        size_deviation,
        group_deviation,
        offset_deviation,
        noise,
        threshold,
        max_frames: max_frames.map_or(Ok(default.max_frames), |n| count("max_frames", n))?,
        max_iterations: max_iterations.map_or(Ok(default.max_iterations), |n| count("max_iterations", n))?,
    };
    let scaler = ModelScaler::try_new(&tree.model, set.markers.clone(), options)?;
    let recording = recording.get().recording.clone();
    let scaled = leave_on_signal(py, move |token| scaler.scale_cancellable(&recording, token))?;
    ScaledModel::of(py, scaled)
}

/// The groups of a dictionary.
fn groups_of(tree: &Model, groups: &Bound<'_, PyDict>) -> Result<Vec<ScaleGroup>, Error> {
    let group = |(name, parts): (Bound<'_, PyAny>, Bound<'_, PyAny>)| {
        let name = key_of("groups", &name)?;
        let argument = format!("groups['{name}']");
        let wrong = || {
            let found = a_type(&parts);
            Error::input(format!(
                "`{argument}` must be a body, bodies, or a dict of bodies to axes, found {found}"
            ))
        };
        let mut found: Vec<(String, [bool; 3])> = Vec::new();
        if let Ok(parts) = parts.cast::<PyDict>() {
            for (body, axes) in parts.iter() {
                let axes: String = axes.extract().map_err(|_| wrong())?;
                if axes.is_empty() || axes.contains(|axis: char| !"xyz".contains(axis)) {
                    let message = format!("axes in `{argument}` must be some of 'xyz', found '{axes}'");
                    return Err(Error::input(message));
                }
                found.push((key_of(&argument, &body)?, ['x', 'y', 'z'].map(|axis| axes.contains(axis))));
            }
        } else if let Ok(body) = parts.extract::<String>() {
            found.push((body, [true; 3]));
        } else {
            let bodies: Vec<String> = entries(&parts).map_err(|_| wrong())?;
            found.extend(bodies.into_iter().map(|body| (body, [true; 3])));
        }
        for (body, _) in &found {
            tree.which(Which::Name(body.clone())).map_err(|error| error.within(&argument))?;
        }
        Ok(ScaleGroup::try_new(&tree.model, name, found)?)
    };
    groups.iter().map(group).collect()
}

/// A model of the size of a person, with markers where they are on it.
///
/// Deviations are standard deviations by linearisation. Pictures and the viewer take it like a MotionFit.
#[pyclass(frozen, module = "somersault.motion")]
pub(crate) struct ScaledModel {
    markers: Py<MarkerSet>,
    scaled: Scaled,
}

impl ScaledModel {
    fn of(py: Python<'_>, scaled: Scaled) -> Result<Self, Error> {
        let model = Py::new(py, Model::of(scaled.model.clone()))?;
        let markers = Py::new(py, MarkerSet { model, markers: scaled.markers.clone() })?;
        Ok(Self { markers, scaled })
    }

    fn by_group<'py>(
        &self,
        py: Python<'py>,
        of: impl Fn(&GroupScale) -> f64,
    ) -> PyResult<Bound<'py, PyDict>> {
        let found = PyDict::new(py);
        self.scaled.groups.iter().try_for_each(|group| found.set_item(&group.name, of(group)))?;
        Ok(found)
    }

    fn by_marker<'py, T: IntoPyObject<'py>>(
        &self,
        py: Python<'py>,
        of: impl Fn(&MarkerOffset) -> T,
    ) -> PyResult<Bound<'py, PyDict>> {
        let found = PyDict::new(py);
        self.scaled.offsets.iter().try_for_each(|marker| found.set_item(&marker.name, of(marker)))?;
        Ok(found)
    }
}

value! {
    impl ScaledModel {
        /// MarkerSet: The markers on the scaled model.
        markers: Py<MarkerSet> = |own, py| own.markers.clone_ref(py);
        /// Model: The scaled model.
        model: Py<Model> = |own, py| own.markers.get().model.clone_ref(py);
        /// float: Size of the whole over that of the model that was scaled: that of what is in no group.
        size: f64 = |own| own.scaled.size[0];
        /// float: Its deviation.
        size_deviation: f64 = |own| own.scaled.size[1];
        /// float: Standard deviation of the noise in each coordinate of a marker of weight 1, given or estimated, m.
        noise: f64 = |own| own.scaled.noise;
        /// float: How many frames count as one, since their residuals are alike.
        repeats: f64 = |own| own.scaled.repeats;
        /// float: Root mean square of the distances of markers from those of a model of one size, m.
        rms_before: f64 = |own| own.scaled.rms[0];
        /// float: The same of the scaled model.
        rms: f64 = |own| own.scaled.rms[1];
        /// ndarray, shape (n_frames,): Times of the frames that were taken, s.
        times: Bound<'py, PyAny> = |own, py| numbers_array(py, &own.scaled.times);
        /// ndarray, shape (n_frames, n_positions): Configurations of the scaled model in them.
        q: PyResult<Bound<'py, PyAny>> = |own, py| matrix_array(py, &rows_of(&own.scaled.q, own.scaled.model.n_positions()));
        /// int: Points that the robust loss counts less than half.
        n_outliers: usize = |own| own.scaled.n_outliers;
        /// int: Iterations made.
        iterations: usize = |own| own.scaled.iterations;
        /// str: How the search ended and what the checks found: ``'converged'``, ``'iteration_limit'``, ``'no_progress'``,
        /// ``'undetermined'`` where nothing tells the noise, ``'misfit'`` where the body or the names of the markers are others.
        status: &'static str = |own| name_of(&ScalingStatus::ALL, &own.scaled.status);
        /// bool: Whether the search converged, the noise is known, and nothing contradicts that the scaled body is the recorded one.
        success: bool = |own| own.scaled.success();
        /// str: Whether it is a success, or why not, and of what the markers say next to nothing.
        message: String = |own| own.scaled.message();
    }
}

#[pymethods]
impl ScaledModel {
    /// dict of str to float: Sizes of the groups over those of the model that was scaled.
    #[getter]
    fn scales<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        self.by_group(py, |group| group.scale)
    }

    /// dict of str to float: Their deviations.
    #[getter]
    fn scale_deviations<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        self.by_group(py, |group| group.deviation)
    }

    /// dict of str to ndarray, shape (3,): Sizes of the bodies along their axes over those of the model that was scaled, as `Model.scaled` and `Diver.scaled` take
    /// them.
    #[getter]
    fn body_scales<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let found = PyDict::new(py);
        for (link, size) in self.scaled.model.links().iter().zip(&self.scaled.scales) {
            found.set_item(link.name(), vector_array(py, size))?;
        }
        Ok(found)
    }

    /// tuple of str: Groups of whose proportions to the whole the markers say next to nothing: they make the deviation less than 10 % smaller.
    #[getter]
    fn unseen<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyTuple>> {
        let unseen = self.scaled.groups.iter().filter(|group| !group.is_seen).map(|group| &group.name);
        PyTuple::new(py, unseen.collect::<Vec<_>>())
    }

    /// dict of str to ndarray, shape (3,): How far each marker is from where the scaled body has it, in the axes of its body, m.
    #[getter]
    fn offsets<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        self.by_marker(py, |marker| vector_array(py, &marker.offset))
    }

    /// dict of str to ndarray, shape (3,): Their deviations.
    #[getter]
    fn offset_deviations<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        self.by_marker(py, |marker| vector_array(py, &marker.deviation))
    }

    /// dict of str to float: Root mean square of the distances of each marker from that of a model of one size, m; NaN for one never seen.
    #[getter]
    fn marker_rms_before<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        self.by_marker(py, |marker| marker.rms.map_or(f64::NAN, |[before, _]| before))
    }

    /// dict of str to float: The same of the scaled model.
    #[getter]
    fn marker_rms<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        self.by_marker(py, |marker| marker.rms.map_or(f64::NAN, |[_, after]| after))
    }

    /// dict of str to tuple of float: For each joint that is beyond a limit that the model states by more than 0.02 rad or m, by the body that it
    /// carries: how far at most, its deviation, and when, s. Limits bound the search softly, by 0.1 rad or m; 0.3 beyond them, and four
    /// deviations, is a misfit.
    #[getter]
    fn beyond_limits<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        limits_dict(py, &self.scaled.beyond_limits)
    }

    /// tuple of str: What contradicts that the scaled body is the recorded one.
    #[getter]
    fn contradictions<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyTuple>> {
        PyTuple::new(py, &self.scaled.contradictions)
    }

    fn __len__(&self) -> usize {
        self.scaled.times.len()
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> Pickled<'py> {
        let (py, own) = (slf.py(), slf.get());
        let scaled = &own.scaled;
        let group = |g: &GroupScale| (g.name.clone(), g.scale, g.deviation, g.is_seen);
        let marker = |m: &MarkerOffset| (<[f64; 3]>::from(m.offset), <[f64; 3]>::from(m.deviation), m.rms);
        let groups: Vec<_> = scaled.groups.iter().map(group).collect();
        let offsets: Vec<_> = scaled.offsets.iter().map(marker).collect();
        let scales: Vec<[f64; 3]> = scaled.scales.iter().map(|size| (*size).into()).collect();
        let numbers =
            ((scaled.size, scaled.noise, scaled.repeats, scaled.rms), scaled.n_outliers, scaled.iterations);
        let checks = (limits_pickled(&scaled.beyond_limits), scaled.contradictions.clone());
        let frames = (own.times(py), own.q(py)?);
        by_restore(slf, (own.markers(py), own.status(), scales, groups, offsets, numbers, frames, checks))
    }

    /// A pickled model.
    #[classmethod]
    fn _restore(
        _: &Bound<'_, PyType>,
        markers: Py<MarkerSet>,
        status: &str,
        scales: Vec<[f64; 3]>,
        groups: Vec<(String, f64, f64, bool)>,
        offsets: Vec<Offset>,
        numbers: Numbers,
        frames: (Vec<f64>, Bound<'_, PyAny>),
        checks: Checks,
    ) -> Result<Self, Error> {
        let set = markers.get();
        let model = set.model.get().model.clone();
        same_length("offsets", offsets.len(), set.markers.markers().len())?;
        same_length("scales", scales.len(), model.n_bodies())?;
        let q = matrix("q", &frames.1)?;
        same_length("q", q.nrows(), frames.0.len())?;
        let ((size, noise, repeats, rms), n_outliers, iterations) = numbers;
        let named = set.markers.markers().iter().zip(offsets);
        let scaled = Scaled {
            status: status_of(&ScalingStatus::ALL, status)?,
            markers: set.markers.clone(),
            scales: scales.into_iter().map(Vector3::from).collect(),
            size,
            groups: groups
                .into_iter()
                .map(|(name, scale, deviation, is_seen)| GroupScale { name, scale, deviation, is_seen })
                .collect(),
            offsets: named
                .map(|(marker, (offset, deviation, rms))| MarkerOffset {
                    name: marker.name.clone(),
                    offset: offset.into(),
                    deviation: deviation.into(),
                    rms,
                })
                .collect(),
            noise,
            repeats,
            rms,
            times: frames.0,
            q: q.row_iter().map(|row| row.iter().copied().collect()).collect(),
            n_outliers,
            beyond_limits: limits_restored(checks.0),
            contradictions: checks.1,
            iterations,
            model,
        };
        Ok(Self { markers, scaled })
    }

    fn __repr__(&self) -> String {
        let scaled = &self.scaled;
        format!(
            "<ScaledModel: size {:.3}, {} groups, {}, rms {:.1} mm>",
            scaled.size[0],
            scaled.groups.len(),
            name_of(&ScalingStatus::ALL, &scaled.status),
            1e3 * scaled.rms[1]
        )
    }
}

/// Offset, deviation, root mean squares of a marker.
type Offset = ([f64; 3], [f64; 3], Option<[f64; 2]>);

/// Size, noise, repeats and root mean squares; outliers; iterations.
type Numbers = (([f64; 2], f64, f64, [f64; 2]), usize, usize);

/// Joints beyond their limits, and contradictions.
type Checks = (Vec<(String, [f64; 3])>, Vec<String>);

fn rows_of(rows: &[Vec<f64>], width: usize) -> DMatrix<f64> {
    DMatrix::from_fn(rows.len(), width, |i, j| rows[i][j])
}
