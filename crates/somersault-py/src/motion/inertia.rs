//! The inertia of a free body from attitudes.

use super::motion_fit::name_of;
use crate::core::convert::{
    array, contiguous, matrix_array, orientations, shape_text, vector_array, with_shape,
};
use crate::core::error::Error;
use crate::core::memory::copied;
use crate::core::value::{Pickled, by_restore, digits, few, value};
use crate::core::waiting::cancel_on_signal;
use crate::integrators::bodies::{RigidBody, State};
use crate::integrators::exact::FreeBody;
use numpy::PyUntypedArrayMethods;
use pyo3::prelude::*;
use pyo3::types::PyType;
use somersault::motion::inertia::{
    self, InertiaOptions, InertiaStatus, LEAST_ATTITUDES, estimate_inertia_cancellable,
};
use somersault::motion::nalgebra::{Matrix3, Vector3};

/// The moments of inertia of a free rigid body up to a factor, its axes and its momentum, from attitudes.
///
/// Without torque R I ω is constant. That equation, linear in I, gives a start; then the exact motion
/// (`exact.FreeBody`) is fitted to the attitudes themselves by least squares, min Σ |log(R(t_k)ᵀ R_k)|²/σ²,
/// over horizons that grow from the middle of the record. The inertia is found up to a factor, five numbers,
/// as are three of the orientation and three of the angular velocity; their covariance is (JᵀJ)⁻¹σ², J the
/// derivative of the residuals.
///
/// Parameters
/// ----------
/// t : array_like, shape (n,)
///     Times, increasing, s; n is at least 6. They may be irregular and have gaps.
/// orientation : Rotation or array_like, shape (n, 4) or (n, 3, 3)
///     Rotations from the body frame to the world frame: `Rotation`s, quaternions (x, y, z, w) or matrices.
///     Between most of them the body turns by less than 2 rad.
/// noise : float, optional
///     Standard deviation of an attitude about each axis, rad, independent and normal. Where it is given,
///     residuals that it does not explain are a misfit; it is estimated from them unless given.
/// level : float, optional
///     Level of the intervals, between 0 and 1.
///
/// Returns
/// -------
/// InertiaEstimate
///     Its `status` says what is determined. What is not is NaN.
///
/// Raises
/// ------
/// InputError
///     If an argument is not allowed.
///
/// Notes
/// -----
/// Near the separatrix the angular velocity stays in a plane of the body, |d|² = b² + k² for its part d in
/// sech and its part b in tanh, and bodies with other moments have the same attitudes: other inertias are
/// looked for around the one found, and one that fits as well is reported. A body that turns steadily about a
/// principal axis says nothing of its moments (a test of likelihood against steady rotation at the level 10⁻³
/// decides), and a symmetric one nothing of the axes in its plane of symmetry. Residuals whose neighbours are
/// correlated are a misfit: another torque, another minimum, world and body exchanged, or noise that was
/// filtered. Intervals of the ratios are those of the profile of the likelihood where that is wider than the linearised problem says, all
/// others those of the linearised problem; where `noise` is not given, by Student's distribution. The cost is some hundred evaluations of the
/// exact motion for each of 8 to 19 starts:
/// 0.2 s for 200 attitudes that identify the body, and up to 2 s where nothing fits.
///
/// Sources: L. D. Landau and E. M. Lifshitz, Mechanics, §37; G. A. F. Seber and C. J. Wild, Nonlinear
/// Regression, Wiley 1989, §5.
///
/// Examples
/// --------
/// >>> import numpy as np
/// >>> import somersault
/// >>> from somersault import exact, motion
/// >>> from scipy.spatial.transform import Rotation
/// >>> body = somersault.RigidBody(1.0, (1.0, 2.0, 2.5))
/// >>> tumble = exact.FreeBody(body, somersault.State(angular_velocity=(0.3, 1.0, 0.4)))
/// >>> t = np.linspace(0.0, 20.0, 200)
/// >>> shaken = Rotation.from_rotvec(np.random.default_rng(1).normal(0.0, 0.01, (200, 3)))
/// >>> found = motion.estimate_inertia(t, tumble(t).orientation * shaken)
/// >>> found.status, found.ratios.round(2), bool(abs(found.noise - 0.01) < 1e-3)
/// ('identified', array([0.4, 0.8, 1. ]), True)
///
/// A body that turns about a principal axis:
///
/// >>> spin = exact.FreeBody(body, somersault.State(angular_velocity=(0.0, 0.0, 1.0)))
/// >>> motion.estimate_inertia(t, spin(t).orientation * shaken).status
/// 'steady'
#[pyfunction]
#[pyo3(signature = (t, orientation, *, noise=None, level=0.95))]
pub(crate) fn estimate_inertia(
    py: Python<'_>,
    t: &Bound<'_, PyAny>,
    orientation: &Bound<'_, PyAny>,
    noise: Option<f64>,
    level: f64,
) -> Result<InertiaEstimate, Error> {
    let found = contiguous("t", "numbers of shape (n,)", t)?;
    let times = match found.shape() {
        [n] if *n >= LEAST_ATTITUDES => copied("the numbers of `t`", found.as_slice().map_err(PyErr::from)?)?,
        shape => {
            let shape = shape_text(shape);
            return Err(Error::input(format!(
                "`t` must have shape (n,) with n at least {LEAST_ATTITUDES}, found shape {shape}"
            )));
        }
    };
    let seen = orientations("orientation", times.len(), orientation)?;
    if let Some(noise) = noise.filter(|noise| !(noise.is_finite() && *noise > 0.0)) {
        return Err(Error::input(format!("`noise` must be positive and finite, found {noise:?}")));
    }
    if !(level > 0.0 && level < 1.0) {
        return Err(Error::input(format!("`level` must be between 0 and 1, found {level:?}")));
    }
    let options = InertiaOptions { noise, level };
    let estimate = cancel_on_signal(py, |token| estimate_inertia_cancellable(&times, &seen, &options, token))
        .map_err(|error| error.with_names(&[("times", "t"), ("orientations", "orientation")]))?;
    let motion = estimate.motion.map(|motion| {
        let free = FreeBody::new(RigidBody(motion.body), State(motion.start), motion.start_time)?;
        Ok::<_, Error>(Py::new(py, free)?)
    });
    Ok(InertiaEstimate { motion: motion.transpose()?, estimate })
}

/// What `estimate_inertia` found. What the record does not determine is NaN, and `reason` names it.
#[pyclass(frozen, module = "somersault.motion")]
pub(crate) struct InertiaEstimate {
    estimate: inertia::InertiaEstimate,
    motion: Option<Py<FreeBody>>,
}

/// Numbers of `InertiaEstimate` that are pickled, in the order of its attributes.
type Numbers<'py> = (
    Bound<'py, PyAny>,
    Bound<'py, PyAny>,
    Bound<'py, PyAny>,
    Bound<'py, PyAny>,
    Bound<'py, PyAny>,
    Bound<'py, PyAny>,
    Bound<'py, PyAny>,
    Bound<'py, PyAny>,
    Bound<'py, PyAny>,
);

value! {
    impl InertiaEstimate {
        /// str: ``'identified'``, inertia and axes are determined; ``'symmetric'``, two moments are equal within their errors and differ by at most 5 %, so that the principal
        /// axes in their plane are any; ``'steady'``, the body turns steadily about one axis, which says nothing of its moments; ``'weak'``, an
        /// interval is so wide that it says little, or inertias that differ much fit as well; ``'undersampled'``, the attitudes are too far apart;
        /// ``'misfit'``, the record is not that of a free rigid body with independent noise.
        status: &'static str = |own| name_of(&InertiaStatus::ALL, &own.estimate.status);
        /// str: The same in a sentence.
        reason: String = |own| own.estimate.reason.clone();
        /// bool: Whether the moments are determined up to a factor: ``'identified'`` or ``'symmetric'``.
        success: bool = |own| own.estimate.success();
        /// ndarray, shape (3,): Principal moments of inertia, ascending, as fractions of the greatest.
        ratios: Bound<'py, PyAny> = |own, py| vector_array(py, &own.estimate.ratios);
        /// ndarray, shape (3, 2): Their intervals of confidence.
        ratio_intervals: PyResult<Bound<'py, PyAny>> =
            |own, py| Ok(array(py, own.estimate.ratio_intervals.as_flattened().to_vec(), &[3, 2])?.into_any());
        /// ndarray, shape (3, 3): Principal axes in the body frame, unit vectors as columns, right-handed.
        axes: PyResult<Bound<'py, PyAny>> = |own, py| matrix_array(py, &own.estimate.axes);
        /// ndarray, shape (3,): Standard deviations of the rotation of the axes about each of them, rad; infinite where it is any.
        axis_errors: Bound<'py, PyAny> = |own, py| vector_array(py, &own.estimate.axis_errors);
        /// ndarray, shape (3, 3): The tensor in the body frame, as a fraction of its greatest principal moment.
        inertia: PyResult<Bound<'py, PyAny>> = |own, py| matrix_array(py, &own.estimate.inertia);
        /// ndarray, shape (3,): Angular velocity at the first time, body frame, rad/s.
        angular_velocity: Bound<'py, PyAny> = |own, py| vector_array(py, &own.estimate.angular_velocity);
        /// ndarray, shape (3,): Standard deviations of its components, rad/s.
        angular_velocity_errors: Bound<'py, PyAny> = |own, py| vector_array(py, &own.estimate.angular_velocity_errors);
        /// ndarray, shape (3,): Unit vector along the angular momentum, world frame.
        momentum_direction: Bound<'py, PyAny> = |own, py| vector_array(py, &own.estimate.momentum_direction);
        /// float: Standard deviation of its angle in each of the two directions across it, rad, the greater one.
        momentum_error: f64 = |own| own.estimate.momentum_error;
        /// float: Standard deviation of an attitude about each axis, estimated from the residuals, rad.
        noise: f64 = |own| own.estimate.noise;
        /// ndarray, shape (n, 3): Rotation vectors from the fitted attitudes to those given, body frame, rad; no row where nothing was fitted.
        residuals: PyResult<Bound<'py, PyAny>> = |own, py| {
            let residuals = &own.estimate.residuals;
            let values = residuals.iter().flat_map(|residual| <[f64; 3]>::from(*residual)).collect();
            Ok(array(py, values, &[residuals.len(), 3])?.into_any())
        };
        /// float: Level of the intervals.
        level: f64 = |own| own.estimate.level;
        /// FreeBody or None: The fitted motion, of a body whose greatest moment is 1 kg m²; None where there is no inertia.
        motion: Option<Py<FreeBody>> = |own, py| own.motion.as_ref().map(|motion| motion.clone_ref(py));
    }
}

#[pymethods]
impl InertiaEstimate {
    fn __repr__(&self) -> String {
        let ratios: Vec<f64> = self.estimate.ratios.iter().map(|ratio| digits(*ratio)).collect();
        format!("<InertiaEstimate: {}, moments as {}>", self.status(), few(&ratios))
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> Pickled<'py> {
        let (py, own) = (slf.py(), slf.get());
        let numbers: Numbers<'py> = (
            own.ratios(py),
            own.ratio_intervals(py)?,
            own.axes(py)?,
            own.axis_errors(py),
            own.inertia(py)?,
            own.angular_velocity(py),
            own.angular_velocity_errors(py),
            own.momentum_direction(py),
            own.residuals(py)?,
        );
        let single = (own.momentum_error(), own.noise(), own.level());
        by_restore(slf, (own.status(), own.reason(), numbers, single, own.motion(py)))
    }

    /// A pickled estimate.
    #[classmethod]
    fn _restore(
        _: &Bound<'_, PyType>,
        status: &str,
        reason: String,
        numbers: Numbers<'_>,
        single: (f64, f64, f64),
        motion: Option<Py<FreeBody>>,
    ) -> Result<Self, Error> {
        let known = InertiaStatus::ALL.iter().find(|(_, name)| *name == status);
        let unknown = || Error::input(format!("`status` has no value '{status}'"));
        let status = known.map(|(status, _)| *status).ok_or_else(unknown)?;
        let vector = |argument, value: &Bound<'_, PyAny>| {
            Ok::<_, Error>(Vector3::from_column_slice(&with_shape(argument, &[3], value)?))
        };
        let matrix = |argument, value: &Bound<'_, PyAny>| {
            Ok::<_, Error>(Matrix3::from_row_slice(&with_shape(argument, &[3, 3], value)?))
        };
        let (ratios, intervals, axes, axis_errors, inertia, rate, rate_errors, direction, residuals) =
            numbers;
        let intervals = with_shape("ratio_intervals", &[3, 2], &intervals)?;
        let residuals = with_shape("residuals", &[residuals.len()?, 3], &residuals)?;
        let (momentum_error, noise, level) = single;
        let estimate = inertia::InertiaEstimate {
            status,
            reason,
            ratios: vector("ratios", &ratios)?,
            ratio_intervals: std::array::from_fn(|k| [intervals[2 * k], intervals[2 * k + 1]]),
            axes: matrix("axes", &axes)?,
            axis_errors: vector("axis_errors", &axis_errors)?,
            inertia: matrix("inertia", &inertia)?,
            angular_velocity: vector("angular_velocity", &rate)?,
            angular_velocity_errors: vector("angular_velocity_errors", &rate_errors)?,
            momentum_direction: vector("momentum_direction", &direction)?,
            momentum_error,
            noise,
            residuals: residuals.chunks_exact(3).map(Vector3::from_column_slice).collect(),
            level,
            motion: None,
        };
        Ok(Self { estimate, motion })
    }
}
