//! Models fitted to markers.

use super::markers::MarkerRecording;
use super::matrix::numbers_array;
use super::motion_fit::MotionFit;
use super::worker::attended;
use crate::convert::{array, real_numbers, vector};
use crate::error::Error;
use crate::model::{Model, Which};
use crate::ocp::EigenpostureBase;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple, PyType};
use somersault::motion::fit::{self, FitOptions, Loss, Marker, Scale, Shape};

/// Where markers are on a model.
///
/// Parameters
/// ----------
/// model : Model
/// markers : dict of str to (str or int, array_like)
///     For each marker, by its name in recordings: the body, and the point in the axes of the body, m, at scale 1.
/// weights : dict of str to float, optional
///     What squared distances count; 1 for the markers that are not named.
///
/// Raises
/// ------
/// FitError
///     If there is no marker, or a number is not allowed.
/// DynamicsInputError
///     If the model has no such body.
///
/// Examples
/// --------
/// >>> from somersault import motion, multibody
/// >>> model = multibody.diver_planar().model
/// >>> markers = motion.MarkerSet(model, {"ankle": ("feet", (0, 0, 0)), "wrist": ("hands", (0, 0, 0))})
/// >>> markers.names
/// ('ankle', 'wrist')
#[pyclass(frozen, module = "somersault.motion")]
pub(crate) struct MarkerSet {
    model: Py<Model>,
    pub(super) markers: fit::MarkerSet,
}

#[pymethods]
impl MarkerSet {
    #[new]
    #[pyo3(signature = (model, markers, weights=None))]
    fn new(
        model: &Bound<'_, Model>,
        markers: &Bound<'_, PyDict>,
        weights: Option<&Bound<'_, PyDict>>,
    ) -> Result<Self, Error> {
        let mut found = Vec::with_capacity(markers.len());
        for (name, place) in markers.iter() {
            let name: String = name.extract()?;
            let (body, point): (Which, Bound<'_, PyAny>) = place.extract()?;
            let body = model.get().which(body)?;
            let point = vector(&format!("markers['{name}']"), &point)?;
            found.push(Marker { name, body, point, weight: 1.0 });
        }
        for (name, weight) in weights.into_iter().flatten() {
            let name: String = name.extract()?;
            let known = found.iter_mut().find(|marker| marker.name == name);
            let marker = known.ok_or_else(|| Error::input(format!("`weights` names no marker '{name}'")))?;
            marker.weight = weight.extract()?;
        }
        let markers = fit::MarkerSet::try_new(&model.get().model, found)?;
        Ok(Self { model: model.clone().unbind(), markers })
    }

    /// A marker at the centre of the joint of each body, by the name of the body.
    ///
    /// Parameters
    /// ----------
    /// model : Model
    ///
    /// Returns
    /// -------
    /// MarkerSet
    #[classmethod]
    fn joint_centres(_: &Bound<'_, PyType>, model: &Bound<'_, Model>) -> Result<Self, Error> {
        let markers = fit::MarkerSet::joint_centres(&model.get().model)?;
        Ok(Self { model: model.clone().unbind(), markers })
    }

    /// Model: The model they are on.
    #[getter]
    fn model(&self, py: Python<'_>) -> Py<Model> {
        self.model.clone_ref(py)
    }

    /// tuple of str: Names of the markers.
    #[getter]
    pub(super) fn names<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyTuple>> {
        PyTuple::new(py, self.markers.markers().iter().map(|marker| marker.name.as_str()))
    }

    /// tuple of str: Names of the bodies they are on.
    #[getter]
    fn bodies<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyTuple>> {
        let links = self.model.get().model.links();
        PyTuple::new(py, self.markers.markers().iter().map(|marker| links[marker.body].name()))
    }

    /// ndarray, shape (n_markers, 3): Places in the axes of the bodies, m.
    #[getter]
    fn points<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let markers = self.markers.markers();
        let values = markers.iter().flat_map(|marker| <[f64; 3]>::from(marker.point)).collect();
        Ok(array(py, values, &[markers.len(), 3])?.into_any())
    }

    /// ndarray, shape (n_markers,): What squared distances count.
    #[getter]
    fn weights<'py>(&self, py: Python<'py>) -> Bound<'py, PyAny> {
        let weights: Vec<f64> = self.markers.markers().iter().map(|marker| marker.weight).collect();
        numbers_array(py, &weights)
    }

    fn __len__(&self) -> usize {
        self.markers.markers().len()
    }

    fn __repr__(&self) -> String {
        format!("<MarkerSet: {} markers>", self.markers.markers().len())
    }
}

/// A number, or bounds.
#[derive(FromPyObject)]
enum NumberOrBounds {
    Number(f64),
    Bounds(f64, f64),
}

/// A model with markers, to be fitted to recordings.
///
/// In each frame scale s, pose of the root and shape of the model are sought that bring its markers nearest to the
/// recorded ones: ½ Σ c ρ(‖x − y‖²) is to be least, x = r + s d(q). The shape is that of all joints within their limits,
/// or the weights w of eigenpostures with w ≥ 0 and Σ w ≤ 1. A frame starts where the one before ended; the first from
/// the best of several postures, each laid over the markers.
///
/// Parameters
/// ----------
/// markers : MarkerSet
///     The markers, and the model they are on.
/// base : EigenpostureBase, optional
///     Fits its weights; joints unless given. Its postures have an entry for each joint coordinate beside the root's.
/// scale : float or tuple of float, optional
///     Size over that of the model if it is known, or its bounds; 0.5 to 2 unless given.
/// common_scale : bool, optional
///     Whether one scale is fitted for the whole motion, rather than one for each frame.
/// loss : {'squares', 'huber', 'cauchy'}, optional
///     How distances count.
/// threshold : float, optional
///     Distance from which on the loss is not that of squares, m; for 'huber' and 'cauchy'.
/// starts : sequence of array_like, optional
///     Postures to begin the first frame with: joint coordinates beside the root's, or weights.
/// max_iterations : int, optional
///     In a frame.
/// step_tol : float, optional
///     A frame has converged when no unknown (m, rad) moves by more.
/// noise : float, optional
///     Standard deviation of the noise in each coordinate of a marker of weight 1, m, for the covariance; that of the
///     residuals unless given.
///
/// Raises
/// ------
/// FitError
///     If an argument is not allowed, or does not suit the model.
///
/// Examples
/// --------
/// >>> import numpy as np
/// >>> from somersault import motion, multibody
/// >>> diver = multibody.diver_planar()
/// >>> markers = motion.MarkerSet.joint_centres(diver.model)
/// >>> q = diver.configuration("H")
/// >>> recording = motion.place_markers(markers, [0.0], [q], scale=1.1)
/// >>> fit = motion.MarkerFit(markers).fit(recording)
/// >>> bool(np.abs(fit.q - q).max() < 1e-6), round(float(fit.scale[0]), 6)
/// (True, 1.1)
#[pyclass(frozen, module = "somersault.motion")]
pub(crate) struct MarkerFit {
    pub(super) markers: Py<MarkerSet>,
    pub(super) fit: fit::MarkerFit,
}

#[pymethods]
impl MarkerFit {
    #[new]
    #[pyo3(signature = (
        markers, *, base=None, scale=None, common_scale=false, loss="squares", threshold=None, starts=None,
        max_iterations=None, step_tol=None, noise=None
    ))]
    fn new(
        markers: &Bound<'_, MarkerSet>,
        base: Option<&Bound<'_, EigenpostureBase>>,
        scale: Option<NumberOrBounds>,
        common_scale: bool,
        loss: &str,
        threshold: Option<f64>,
        starts: Option<Vec<Bound<'_, PyAny>>>,
        max_iterations: Option<usize>,
        step_tol: Option<f64>,
        noise: Option<f64>,
    ) -> Result<Self, Error> {
        let default = FitOptions::default();
        let start = |(k, start): (usize, &Bound<'_, PyAny>)| real_numbers(&format!("starts[{k}]"), start);
        let options = FitOptions {
            shape: base.map_or(Shape::Joints, |base| Shape::Eigenpostures(base.get().base.clone())),
            scale: match scale.unwrap_or(NumberOrBounds::Bounds(0.5, 2.0)) {
                NumberOrBounds::Number(_) if common_scale => {
                    return Err(Error::input("`common_scale` needs bounds of the `scale`, found a number"));
                }
                NumberOrBounds::Number(scale) => Scale::Fixed(scale),
                NumberOrBounds::Bounds(lower, upper) if common_scale => Scale::Common { lower, upper },
                NumberOrBounds::Bounds(lower, upper) => Scale::PerFrame { lower, upper },
            },
            loss: loss_of(loss, threshold)?,
            starts: starts.iter().flatten().enumerate().map(start).collect::<Result<_, _>>()?,
            max_iterations: max_iterations.unwrap_or(default.max_iterations),
            step_tol: step_tol.unwrap_or(default.step_tol),
            noise,
        };
        let set = markers.get();
        let fit = fit::MarkerFit::try_new(&set.model.get().model, set.markers.clone(), options)?;
        Ok(Self { markers: markers.clone().unbind(), fit })
    }

    /// MarkerSet: The markers.
    #[getter]
    fn markers(&self, py: Python<'_>) -> Py<MarkerSet> {
        self.markers.clone_ref(py)
    }

    /// Model: The model.
    #[getter]
    pub(super) fn model(&self, py: Python<'_>) -> Py<Model> {
        self.markers.get().model(py)
    }

    /// Fits all frames of a recording.
    ///
    /// Markers of the recording that the model has not are left aside, those that the recording has not are missing.
    /// Other Python threads run meanwhile. Ctrl-C raises at once; what was begun goes on in the background to its end.
    ///
    /// Parameters
    /// ----------
    /// recording : MarkerRecording
    ///
    /// Returns
    /// -------
    /// MotionFit
    ///     The best estimate of each frame, whatever its status.
    ///
    /// Raises
    /// ------
    /// FitError
    ///     If the recording has none of the markers.
    fn fit(
        slf: &Bound<'_, Self>,
        py: Python<'_>,
        recording: &Bound<'_, MarkerRecording>,
    ) -> Result<MotionFit, Error> {
        let (fit, recording) = (slf.get().fit.clone(), recording.get().recording.clone());
        let motion = attended(py, move || fit.fit(&recording))?;
        Ok(MotionFit { fit: slf.clone().unbind(), motion })
    }

    fn __repr__(&self) -> String {
        let (n, dofs) = (self.fit.markers().markers().len(), self.fit.model().n_velocities());
        format!("<MarkerFit: {n} markers on {dofs} degrees of freedom>")
    }
}

fn loss_of(name: &str, threshold: Option<f64>) -> Result<Loss, Error> {
    match (name, threshold) {
        ("squares", None) => Ok(Loss::Squares),
        ("squares", Some(_)) => Err(Error::input("`threshold` is for the losses 'huber' and 'cauchy'")),
        ("huber", Some(threshold)) => Ok(Loss::Huber(threshold)),
        ("cauchy", Some(threshold)) => Ok(Loss::Cauchy(threshold)),
        ("huber" | "cauchy", None) => Err(Error::input(format!("the loss '{name}' needs a `threshold`"))),
        _ => Err(Error::input(format!("`loss` must be 'squares', 'huber' or 'cauchy', found '{name}'"))),
    }
}
