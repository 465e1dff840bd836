//! Models fitted to markers.

use super::matrix::{count, numbers_array};
use crate::core::convert::{a_type, array, entries_or_none, key_of, real_numbers, vector};
use crate::core::error::Error;
use crate::core::value::{Pickled, by_class, by_restore};
use crate::multibody::model::{Model, Which};
use crate::multibody::models::Diver;
use crate::ocp::joint_motion::EigenpostureBase;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple, PyType};
use somersault::motion::fit::{self, FitError, FitOptions, Loss, Marker, Scale, Shape};

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
/// InputError
///     If there is no marker, a number is not allowed, or the model has no such body.
///
/// Examples
/// --------
/// >>> from somersault import motion, multibody
/// >>> model = multibody.diver_planar().model
/// >>> markers = motion.MarkerSet(model, {"ankle": ("foot", (0, 0, 0)), "wrist": ("hand", (0, 0, 0))})
/// >>> markers.names
/// ('ankle', 'wrist')
#[pyclass(frozen, module = "somersault.motion")]
pub(crate) struct MarkerSet {
    pub(super) model: Py<Model>,
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
            let name = key_of("markers", &name)?;
            let (body, point): (Which, Bound<'_, PyAny>) = place.extract().map_err(|_| {
                let found = a_type(&place);
                Error::input(format!("`markers['{name}']` must be a body and a point, found {found}"))
            })?;
            let argument = format!("markers['{name}']");
            let body = model.get().which(body).map_err(|error| error.within(&argument))?;
            let point = vector(&argument, &point)?;
            found.push(Marker { name, body, point, weight: 1.0 });
        }
        for (name, weight) in weights.into_iter().flatten() {
            let name = key_of("weights", &name)?;
            let known = found.iter_mut().find(|marker| marker.name == name);
            let marker = known.ok_or_else(|| Error::input(format!("`weights` names no marker '{name}'")))?;
            marker.weight = weight.extract().map_err(|_| {
                Error::input(format!("`weights['{name}']` must be a number, found {}", a_type(&weight)))
            })?;
        }
        let markers = fit::MarkerSet::try_new(&model.get().model, found).map_err(in_dicts)?;
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
    ///
    /// Examples
    /// --------
    /// >>> from somersault import motion, multibody
    /// >>> motion.MarkerSet.joint_centres(multibody.two_link_arm()).names
    /// ('upper', 'lower')
    #[classmethod]
    fn joint_centres(_: &Bound<'_, PyType>, model: &Bound<'_, Model>) -> Result<Self, Error> {
        let markers = fit::MarkerSet::joint_centres(&model.get().model)?;
        Ok(Self { model: model.clone().unbind(), markers })
    }

    /// The markers of a protocol on a diver, by the names that programs write.
    ///
    /// Joint centres are those of the diver; markers on the skin, the head and the feet are at places of an average body, which may be
    /// elsewhere on a person by some 20 mm: `ReconstructedFlight.marker_offsets` says by how much, and `moved` puts them there.
    ///
    /// | Protocol | Names | Written by |
    /// |---|---|---|
    /// | ``"coco"`` | ``nose``, ``left_shoulder``, … (17) | AlphaPose, MMPose and others |
    /// | ``"body_25"`` | the same with ``neck``, ``mid_hip``, toes and heels | OpenPose |
    /// | ``"halpe_26"`` | the same with ``head`` | AlphaPose, RTMPose |
    /// | ``"mediapipe"`` | ``nose``, ``left_foot_index``, … (33) | MediaPipe |
    /// | ``"smpl"`` | ``pelvis``, ``left_hip``, …; none of the spine and collar bones | SMPL, AMASS |
    /// | ``"opencap"`` | ``Neck``, ``RShoulder``, …, ``r_knee_study``, … | OpenCap, Pose2Sim |
    /// | ``"plug_in_gait"`` | ``LFHD``, ``C7``, ``RASI``, …; none of ``THI``, ``TIB``, ``UPA``, ``FRM``, whose places are free | Vicon Nexus |
    ///
    /// Parameters
    /// ----------
    /// diver : Diver
    ///     The planar one has all in its plane, right and left at the same place.
    /// protocol : str
    ///
    /// Returns
    /// -------
    /// MarkerSet
    ///
    /// Raises
    /// ------
    /// InputError
    ///     If there is no such protocol.
    ///
    /// Notes
    /// -----
    /// Joint centres after P. de Leva, J. Biomech. 29 (1996) 1223; the spines of the pelvis by M. E. Harrington et al., J. Biomech. 40 (2007)
    /// 595; the face after C. C. Gordon et al., *1988 Anthropometric Survey of U.S. Army Personnel*.
    ///
    /// Examples
    /// --------
    /// >>> from somersault import motion, multibody
    /// >>> markers = motion.MarkerSet.on_diver(multibody.diver_spatial(height=1.65), "coco")
    /// >>> len(markers), markers.names[:3], markers.bodies[:3]
    /// (17, ('nose', 'right_shoulder', 'left_shoulder'), ('head', 'right_upper_arm', 'left_upper_arm'))
    #[classmethod]
    fn on_diver(_: &Bound<'_, PyType>, diver: &Bound<'_, Diver>, protocol: &str) -> Result<Self, Error> {
        let protocol = protocol.parse()?;
        let markers = match diver.get().ball_jointed() {
            Some(diver) => fit::MarkerSet::on_ball_jointed(&diver, protocol)?,
            None => fit::MarkerSet::on_diver(&diver.get().size(), protocol)?,
        };
        Ok(Self { model: diver.get().model.clone_ref(diver.py()), markers })
    }

    /// The same markers at other places on their bodies.
    ///
    /// Parameters
    /// ----------
    /// offsets : dict of str to array_like, shape (3,)
    ///     For some of the markers what is added to the place, m, in axes of the body: `ReconstructedFlight.marker_offsets`, for example.
    ///
    /// Returns
    /// -------
    /// MarkerSet
    ///
    /// Raises
    /// ------
    /// InputError
    ///     If there is no such marker, or a number is not finite.
    ///
    /// Examples
    /// --------
    /// >>> from somersault import motion, multibody
    /// >>> markers = motion.MarkerSet.joint_centres(multibody.two_link_arm())
    /// >>> markers.moved({"lower": (0.01, 0.0, 0.0)}).points[1]
    /// array([0.01, 0.  , 0.  ])
    fn moved(&self, py: Python<'_>, offsets: &Bound<'_, PyDict>) -> Result<Self, Error> {
        let mut found = Vec::with_capacity(offsets.len());
        for (name, offset) in offsets.iter() {
            let name = key_of("offsets", &name)?;
            let offset = vector(&format!("offsets['{name}']"), &offset)?;
            found.push((name, offset));
        }
        let markers = self.markers.moved(found.iter().map(|(name, offset)| (name.as_str(), *offset)))?;
        Ok(Self { model: self.model.clone_ref(py), markers })
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

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> Pickled<'py> {
        let (py, own) = (slf.py(), slf.get());
        let (places, weights) = (PyDict::new(py), PyDict::new(py));
        for marker in own.markers.markers() {
            places.set_item(&marker.name, (marker.body, <[f64; 3]>::from(marker.point)))?;
            weights.set_item(&marker.name, marker.weight)?;
        }
        by_class(slf, (own.model(py), places, weights))
    }

    fn __repr__(&self) -> String {
        format!("<MarkerSet: {} markers>", self.markers.markers().len())
    }
}

/// What is wrong with a marker, by where Python has it.
fn in_dicts(error: FitError) -> Error {
    match error {
        FitError::Marker { name, source } => {
            let [point, weight] = ["markers", "weights"].map(|dict| format!("{dict}['{name}']"));
            Error::from(*source).with_names(&[("point", &point), ("weight", &weight)])
        }
        error => error.into(),
    }
}

/// A number, or bounds.
enum NumberOrBounds {
    Number(f64),
    Bounds(f64, f64),
}

fn number_or_bounds(argument: &str, value: &Bound<'_, PyAny>) -> Result<NumberOrBounds, Error> {
    match (value.extract::<f64>(), value.extract::<(f64, f64)>()) {
        (Ok(number), _) => Ok(NumberOrBounds::Number(number)),
        (_, Ok((lower, upper))) => Ok(NumberOrBounds::Bounds(lower, upper)),
        _ => {
            let found = a_type(value);
            Err(Error::input(format!("`{argument}` must be a number or two bounds, found {found}")))
        }
    }
}

/// A model with markers, to be fitted to recordings.
///
/// In each frame scale s, pose of the root and shape of the model are sought that bring its markers nearest to the
/// recorded ones: ½ Σ c ρ(‖x − y‖²) is minimised, x = r + s d(q). The shape is that of all joints within their limits,
/// or the weights w of eigenpostures with w ≥ 0 and Σ w ≤ 1. A frame starts where the one before ended; the first from
/// the best of several postures, each laid over the markers. Every eighth frame is begun from these postures too, and so is one unlike the
/// frame before; in each frame every joint is turned through its range, and what is lower leads the frames beside it. Lower minima of joints that few
/// markers see are rarely left after that, but nothing proves that a minimum is the lowest.
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
///     Postures to begin the first frame and every eighth with: joint coordinates beside the root's, or weights. The
///     neutral posture and each of the base, or points throughout the joints' ranges, unless given.
/// max_iterations : int, optional
///     In a frame; 1000 unless given.
/// step_tol : float, optional
///     A frame has converged when no unknown (m, rad) moves by more.
/// noise : float, optional
///     Standard deviation of the noise in each coordinate of a marker of weight 1, m, for the covariance; that of the
///     residuals unless given.
///
/// Raises
/// ------
/// InputError
///     If an argument is not allowed, or does not suit the model.
///
/// Examples
/// --------
/// >>> from somersault import motion, multibody
/// >>> diver = multibody.diver_planar()
/// >>> markers = motion.MarkerSet.joint_centres(diver.model)
/// >>> q = diver.configuration("H")
/// >>> recording = motion.place_markers(markers, [0.0], [q], scale=1.1)
/// >>> fit = motion.MarkerFit(markers).fit(recording)
/// >>> fit.rms < 1e-9, round(float(fit.scale[0]), 6)
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
        scale: Option<&Bound<'_, PyAny>>,
        common_scale: bool,
        loss: &str,
        threshold: Option<f64>,
        #[pyo3(from_py_with = entries_or_none)] starts: Option<Vec<Bound<'_, PyAny>>>,
        max_iterations: Option<i128>,
        step_tol: Option<f64>,
        noise: Option<f64>,
    ) -> Result<Self, Error> {
        let default = FitOptions::default();
        let start = |(k, start): (usize, &Bound<'_, PyAny>)| real_numbers(&format!("starts[{k}]"), start);
        let options = FitOptions {
            shape: base.map_or(Shape::Joints, |base| Shape::Eigenpostures(base.get().base.clone())),
            scale: match scale
                .map_or(Ok(NumberOrBounds::Bounds(0.5, 2.0)), |scale| number_or_bounds("scale", scale))?
            {
                NumberOrBounds::Number(_) if common_scale => {
                    return Err(Error::input("`common_scale` needs bounds of the `scale`, found a number"));
                }
                NumberOrBounds::Number(scale) => Scale::Fixed(scale),
                NumberOrBounds::Bounds(lower, upper) if common_scale => Scale::Common { lower, upper },
                NumberOrBounds::Bounds(lower, upper) => Scale::PerFrame { lower, upper },
            },
            loss: loss_of(loss, threshold)?,
            starts: starts.iter().flatten().enumerate().map(start).collect::<Result<_, _>>()?,
            max_iterations: match max_iterations {
                Some(n) => count("max_iterations", n)?,
                None => default.max_iterations,
            },
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

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> Pickled<'py> {
        let (py, own) = (slf.py(), slf.get());
        let options = own.fit.options();
        let base = match &options.shape {
            Shape::Joints => None,
            Shape::Eigenpostures(base) => Some(EigenpostureBase { base: base.clone() }),
        };
        let (scale, common) = match options.scale {
            Scale::Fixed(scale) => ((scale, scale), None),
            Scale::PerFrame { lower, upper } => ((lower, upper), Some(false)),
            Scale::Common { lower, upper } => ((lower, upper), Some(true)),
        };
        let loss = match options.loss {
            Loss::Squares => ("squares", None),
            Loss::Huber(threshold) => ("huber", Some(threshold)),
            Loss::Cauchy(threshold) => ("cauchy", Some(threshold)),
        };
        let numbers = (options.max_iterations, options.step_tol, options.noise);
        let starts = options.starts.clone();
        by_restore(slf, (own.markers(py), base, scale, common, loss, starts, numbers))
    }

    /// A pickled fit; `common` says whether the scale is, and is missing where it is fixed.
    #[classmethod]
    fn _restore(
        _: &Bound<'_, PyType>,
        markers: &Bound<'_, MarkerSet>,
        base: Option<Bound<'_, EigenpostureBase>>,
        bounds: (f64, f64),
        common: Option<bool>,
        loss: (String, Option<f64>),
        starts: Vec<Vec<f64>>,
        numbers: (usize, f64, Option<f64>),
    ) -> Result<Self, Error> {
        let ((lower, upper), (max_iterations, step_tol, noise)) = (bounds, numbers);
        let options = FitOptions {
            shape: base.map_or(Shape::Joints, |base| Shape::Eigenpostures(base.get().base.clone())),
            scale: match common {
                None => Scale::Fixed(lower),
                Some(false) => Scale::PerFrame { lower, upper },
                Some(true) => Scale::Common { lower, upper },
            },
            loss: loss_of(&loss.0, loss.1)?,
            starts,
            max_iterations,
            step_tol,
            noise,
        };
        let set = markers.get();
        let fit = fit::MarkerFit::try_new(&set.model.get().model, set.markers.clone(), options)?;
        Ok(Self { markers: markers.clone().unbind(), fit })
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
