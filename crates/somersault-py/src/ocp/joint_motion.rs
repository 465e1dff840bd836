//! Eigenpostures, and joint motions made of splines.

use super::arguments::{count, index};
use crate::core::convert::{a_type, array, entries, finite_all, integer, real_numbers, times, with_shape};
use crate::core::error::Error;
use crate::core::memory::{bytes_of_numbers, expect_room};
use crate::core::value::{Pickled, by_restore, value};
use pyo3::prelude::*;
use pyo3::types::PyType;
use somersault::core::spline::UniformBasis;
use somersault::multibody::joint_motion::{self, Condition, End};

/// A fundamental posture and the directions from it to others (thesis 2.11).
///
/// Joint positions are φ₀ + Σ wᵢ (φᵢ − φ₀) with a weight for each posture but the first. Weights that are not
/// negative and add up to at most one give postures between the given ones.
///
/// Parameters
/// ----------
/// postures : array_like, shape (n + 1, n_joints)
///     Joint positions, the fundamental posture first.
///
/// Raises
/// ------
/// InputError
///     If the differences to the first posture are linearly dependent, or a number is not finite.
///
/// Examples
/// --------
/// >>> from somersault import ocp
/// >>> base = ocp.EigenpostureBase([[0.0, 0.0], [1.0, 2.0]])
/// >>> base.positions([0.5])
/// array([0.5, 1. ])
#[pyclass(frozen, module = "somersault.ocp")]
pub(crate) struct EigenpostureBase {
    pub(crate) base: joint_motion::EigenpostureBase,
}

value! {
    impl EigenpostureBase {
        /// int: Number of joints.
        n_joints: usize = |own| own.base.n_joints();
        /// int: Number of weights.
        n_weights: usize = |own| own.base.n_weights();
    }
}

#[pymethods]
impl EigenpostureBase {
    #[new]
    fn new(#[pyo3(from_py_with = entries)] postures: Vec<Vec<f64>>) -> Result<Self, Error> {
        Ok(Self { base: joint_motion::EigenpostureBase::try_new(&postures)? })
    }

    /// Joint positions for weights.
    ///
    /// Parameters
    /// ----------
    /// weights : array_like, shape (n_weights,)
    ///
    /// Returns
    /// -------
    /// ndarray, shape (n_joints,)
    ///
    /// Examples
    /// --------
    /// >>> from somersault import ocp
    /// >>> base = ocp.EigenpostureBase([[0.0, 0.0], [1.0, 2.0], [0.0, 1.0]])
    /// >>> base.positions([0.5, 0.5])
    /// array([0.5, 1.5])
    fn positions<'py>(
        &self,
        py: Python<'py>,
        weights: &Bound<'py, PyAny>,
    ) -> Result<Bound<'py, PyAny>, Error> {
        let weights = finite_all("weights", with_shape("weights", &[self.base.n_weights()], weights)?)?;
        let mut positions = vec![0.0; self.base.n_joints()];
        self.base.positions_into(&weights, &mut positions);
        Ok(numpy::PyArray1::from_vec(py, positions).into_any())
    }

    /// The weights whose posture is nearest to joint positions, by least squares.
    ///
    /// Parameters
    /// ----------
    /// positions : array_like, shape (n_joints,)
    ///
    /// Returns
    /// -------
    /// weights : ndarray, shape (n_weights,)
    /// distance : float
    ///     What remains, rad.
    ///
    /// Examples
    /// --------
    /// >>> from somersault import ocp
    /// >>> base = ocp.EigenpostureBase([[0.0, 0.0], [3.0, 4.0]])
    /// >>> weights, distance = base.project([3.0, 4.0])
    /// >>> weights.round(6), round(distance, 6)
    /// (array([1.]), 0.0)
    fn project<'py>(
        &self,
        py: Python<'py>,
        positions: &Bound<'py, PyAny>,
    ) -> Result<(Bound<'py, PyAny>, f64), Error> {
        let positions =
            finite_all("positions", with_shape("positions", &[self.base.n_joints()], positions)?)?;
        let (weights, distance) = self.base.project(&positions)?;
        Ok((numpy::PyArray1::from_slice(py, weights.as_slice()).into_any(), distance))
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> Pickled<'py> {
        let base = &slf.get().base;
        let directions: Vec<Vec<f64>> =
            base.directions().column_iter().map(|d| d.iter().copied().collect()).collect();
        by_restore(slf, (base.fundamental().to_vec(), directions))
    }

    /// A pickled base: directions are kept, not postures, of which rounding would take a part.
    #[classmethod]
    fn _restore(
        _: &Bound<'_, PyType>,
        fundamental: Vec<f64>,
        directions: Vec<Vec<f64>>,
    ) -> Result<Self, Error> {
        Ok(Self { base: joint_motion::EigenpostureBase::of_directions(fundamental, &directions)? })
    }

    fn __repr__(&self) -> String {
        format!("<EigenpostureBase: {} joints, {} weights>", self.base.n_joints(), self.base.n_weights())
    }
}

/// A joint motion whose channels are uniform B-splines; conditions at its ends hold for all parameters.
///
/// Channels are the weights of a base of eigenpostures, or the joints themselves. Time is the fraction of the duration, in
/// [0, 1]; rates are by the fraction.
///
/// Parameters
/// ----------
/// base : EigenpostureBase or int
///     What the channels mean: weights of the base, or so many joints.
/// n_coefficients : int
///     Coefficients of each spline, of which more than the degree.
/// conditions : sequence of tuple, optional
///     ``(end, derivative, value)`` with end ``'start'`` or ``'finish'``, for each channel alike.
/// degree : int, optional
///     Degree of the splines.
///
/// Examples
/// --------
/// >>> from somersault import ocp
/// >>> motion = ocp.SplineMotion(1, 10, [("start", 0, -1.0), ("start", 1, 0.0)])
/// >>> motion.n_parameters
/// 8
/// >>> motion([0.5] * 8, 0.0).round(6)
/// array([-1.])
#[pyclass(frozen, module = "somersault.ocp")]
pub(crate) struct SplineMotion {
    pub(crate) motion: joint_motion::SplineMotion,
    conditions: Vec<Condition>,
    /// None for joints.
    base: Option<Py<EigenpostureBase>>,
}

/// A base, or a number of joints, which with so many coefficients each are not too many.
fn base_of(
    value: &Bound<'_, PyAny>,
    n_coefficients: usize,
) -> Result<(joint_motion::EigenpostureBase, Option<Py<EigenpostureBase>>), Error> {
    if let Ok(base) = value.cast::<EigenpostureBase>() {
        return Ok((base.get().base.clone(), Some(base.clone().unbind())));
    }
    let refused = |_| {
        let found = a_type(value);
        Error::input(format!("`base` must be an EigenpostureBase or a number of joints, found {found}"))
    };
    let n_joints = count("base", integer(value).map_err(refused)?, 1)?;
    joint_motion::SplineMotion::expect_coefficients(n_joints, n_coefficients)?;
    expect_room(&format!("the directions of {n_joints} joints"), bytes_of_numbers(&[n_joints, n_joints]))?;
    Ok((joint_motion::EigenpostureBase::joints(n_joints), None))
}

/// `(end, derivative, value)` of each.
fn conditions_of(value: Option<&Bound<'_, PyAny>>) -> Result<Vec<Condition>, Error> {
    let refused = |found: &Bound<'_, PyAny>| {
        let found = a_type(found);
        Error::input(format!("`conditions` must be tuples (end, derivative, value), found {found}"))
    };
    let Some(value) = value else { return Ok(Vec::new()) };
    let mut conditions = Vec::new();
    for item in value.try_iter().map_err(|_| refused(value))? {
        let item = item?;
        let (end, derivative, value): (String, Bound<'_, PyAny>, f64) =
            item.extract().map_err(|_| refused(&item))?;
        let end = match end.as_str() {
            "start" => End::Start,
            "finish" => End::Finish,
            _ => {
                return Err(Error::input(format!(
                    "the end in `conditions` must be 'start' or 'finish', found '{end}'"
                )));
            }
        };
        let derivative = integer(&derivative).map_err(|_| refused(&item))?;
        conditions.push(Condition { end, derivative: count("conditions", derivative, 0)?, value });
    }
    Ok(conditions)
}

value! {
    impl SplineMotion {
        /// int: Number of free parameters.
        n_parameters: usize = |own| own.motion.n_parameters();
        /// int: Number of channels.
        n_channels: usize = |own| own.motion.n_channels();
    }
}

#[pymethods]
impl SplineMotion {
    #[new]
    #[pyo3(signature = (base, n_coefficients, conditions=None, *, degree=5))]
    fn new(
        base: &Bound<'_, PyAny>,
        #[pyo3(from_py_with = integer)] n_coefficients: i64,
        conditions: Option<&Bound<'_, PyAny>>,
        #[pyo3(from_py_with = integer)] degree: i64,
    ) -> Result<Self, Error> {
        let (degree, n) = (count("degree", degree, 0)?, count("n_coefficients", n_coefficients, 1)?);
        let (library, base) = base_of(base, n)?;
        let basis = UniformBasis::try_new(degree, n).map_err(joint_motion::JointMotionError::from)?;
        let conditions = conditions_of(conditions)?;
        Ok(Self {
            motion: joint_motion::SplineMotion::try_new(basis, library, &conditions)?,
            conditions,
            base,
        })
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> Pickled<'py> {
        let (py, own) = (slf.py(), slf.get());
        let named = |condition: &Condition| {
            let end = if condition.end == End::Start { "start" } else { "finish" };
            (end, condition.derivative, condition.value)
        };
        let base = match &own.base {
            Some(base) => base.clone_ref(py).into_any(),
            None => own.motion.base().n_joints().into_pyobject(py)?.into_any().unbind(),
        };
        let conditions: Vec<_> = own.conditions.iter().map(named).collect();
        let basis = own.motion.basis();
        by_restore(slf, (base, basis.n_coefficients(), conditions, basis.degree()))
    }

    /// A pickled motion.
    #[classmethod]
    fn _restore(
        _: &Bound<'_, PyType>,
        base: &Bound<'_, PyAny>,
        n_coefficients: i64,
        conditions: &Bound<'_, PyAny>,
        degree: i64,
    ) -> Result<Self, Error> {
        Self::new(base, n_coefficients, Some(conditions), degree)
    }

    /// Coefficients of the splines.
    ///
    /// Parameters
    /// ----------
    /// parameters : array_like, shape (n_parameters,)
    ///
    /// Returns
    /// -------
    /// ndarray, shape (n_channels, n_coefficients)
    ///
    /// Examples
    /// --------
    /// >>> from somersault import ocp
    /// >>> motion = ocp.SplineMotion(1, 6, [("start", 0, 0.0), ("finish", 0, 1.0)])
    /// >>> motion.coefficients([0.0] * motion.n_parameters).shape
    /// (1, 6)
    fn coefficients<'py>(
        &self,
        py: Python<'py>,
        parameters: &Bound<'py, PyAny>,
    ) -> Result<Bound<'py, PyAny>, Error> {
        let coefficients = self.coefficients_of(parameters)?;
        let shape = [self.motion.n_channels(), self.motion.basis().n_coefficients()];
        Ok(array(py, coefficients, &shape)?.into_any())
    }

    /// The channels, or one of their rates.
    ///
    /// Parameters
    /// ----------
    /// parameters : array_like, shape (n_parameters,)
    /// fraction : float or array_like, shape (n,)
    ///     Fraction of the duration.
    /// derivative : int, optional
    ///     0 for the channels, r for their r-th derivative by the fraction.
    ///
    /// Returns
    /// -------
    /// ndarray, shape (n_channels,) or (n, n_channels)
    #[pyo3(signature = (parameters, fraction, derivative=0))]
    fn __call__<'py>(
        &self,
        py: Python<'py>,
        parameters: &Bound<'py, PyAny>,
        fraction: &Bound<'py, PyAny>,
        #[pyo3(from_py_with = integer)] derivative: i64,
    ) -> Result<Bound<'py, PyAny>, Error> {
        let derivative = index("derivative", derivative)?;
        let coefficients = self.coefficients_of(parameters)?;
        let (single, fractions) = times("fraction", fraction)?;
        let fractions = finite_all("fraction", fractions)?;
        let n = self.motion.n_channels();
        let mut channels = vec![0.0; n * fractions.len()];
        for (fraction, out) in fractions.iter().zip(channels.chunks_exact_mut(n)) {
            self.motion.channels_into(&coefficients, *fraction, derivative, out);
        }
        let shape: &[usize] = if single { &[n] } else { &[fractions.len(), n] };
        Ok(array(py, channels, shape)?.into_any())
    }

    /// The parameters whose channels come nearest to samples, by least squares: a start for a solver.
    ///
    /// Parameters
    /// ----------
    /// fraction : array_like, shape (n,)
    /// samples : array_like, shape (n, n_channels)
    ///
    /// Returns
    /// -------
    /// ndarray, shape (n_parameters,)
    ///
    /// Examples
    /// --------
    /// >>> import numpy as np
    /// >>> from somersault import ocp
    /// >>> motion, t = ocp.SplineMotion(1, 12), np.linspace(0.0, 1.0, 50)
    /// >>> parameters = motion.fit(t, np.sin(3.0 * t)[:, None])
    /// >>> bool(abs(motion(parameters, 0.5)[0] - np.sin(1.5)) < 1e-4)
    /// True
    fn fit<'py>(
        &self,
        py: Python<'py>,
        fraction: &Bound<'py, PyAny>,
        samples: &Bound<'py, PyAny>,
    ) -> Result<Bound<'py, PyAny>, Error> {
        let fractions = finite_all("fraction", real_numbers("fraction", fraction)?)?;
        let n = self.motion.n_channels();
        // the shape follows from the fractions, which may be what is wrong
        let samples = with_shape("samples", &[fractions.len(), n], samples)
            .map_err(|error| error.with_names(&[("samples", "samples` of each `fraction")]))?;
        let samples = finite_all("samples", samples)?;
        let samples: Vec<&[f64]> = samples.chunks_exact(n).collect();
        Ok(numpy::PyArray1::from_vec(py, self.motion.fit(&fractions, &samples)?).into_any())
    }

    fn __repr__(&self) -> String {
        let Self { motion, .. } = self;
        let (degree, n) = (motion.basis().degree(), motion.basis().n_coefficients());
        format!(
            "<SplineMotion: {} channels of degree {degree} with {n} coefficients, {} parameters>",
            motion.n_channels(),
            motion.n_parameters()
        )
    }
}

impl SplineMotion {
    fn coefficients_of(&self, parameters: &Bound<'_, PyAny>) -> Result<Vec<f64>, Error> {
        let p =
            finite_all("parameters", with_shape("parameters", &[self.motion.n_parameters()], parameters)?)?;
        let mut coefficients = vec![0.0; self.motion.n_coefficients()];
        self.motion.coefficients_into(&p, &mut coefficients);
        Ok(coefficients)
    }
}
