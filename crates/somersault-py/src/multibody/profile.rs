//! Joint forces given at knots of time.

use crate::core::convert::{array, contiguous, finite_all, real_numbers, row, shape_text, times};
use crate::core::error::Error;
use crate::core::memory::copied;
use crate::core::value::{counted, value};
use numpy::PyArrayDyn;
use numpy::prelude::*;
use pyo3::prelude::*;
use somersault::integrators::nalgebra::DMatrix;
use somersault::multibody::motion::{self, Between, Knots};

/// Joint forces of a tree that are given at knots of time, as a discretised control is.
///
/// Before the first knot and after the last the forces are constant. `multibody.integrate_tree`,
/// `contact.differentiate_tree` and `contact.gradient_tree` accept a profile as `torque`: they end a step at each knot, so that
/// methods keep their order, and evaluate it without Python.
///
/// Parameters
/// ----------
/// times : array_like, shape (knots,)
///     Times of the knots, s, increasing.
/// values : array_like, shape (knots, n_velocities)
///     Joint forces at the knots, N or N m.
/// between : {'line', 'hold'}, optional
///     Interpolation between knots: linear, the default, or constant at the value of the knot before.
///
/// Examples
/// --------
/// >>> from somersault import multibody
/// >>> push = multibody.TorqueProfile([0.0, 0.1, 0.3], [[0.0, 0.0], [5.0, 0.0], [0.0, 1.0]])
/// >>> push(0.05)
/// array([2.5, 0. ])
/// >>> cart = multibody.cart_pendulum()
/// >>> motion = multibody.integrate_tree(cart, [0.0, 0.1], [0.0, 0.0], (0.0, 0.5), torque=push)
/// >>> 0.1 in motion.t and 0.3 in motion.t
/// True
#[pyclass(frozen, module = "somersault.multibody")]
pub(crate) struct TorqueProfile {
    pub(crate) profile: motion::TorqueProfile,
}

value! {
    impl TorqueProfile(times, values, between) {
        /// ndarray, shape (knots,): Times of the knots, s.
        times: PyResult<Py<PyArrayDyn<f64>>> = |own, py| {
            Ok(row(py, own.profile.knots().times().to_vec())?.unbind())
        };
        /// ndarray, shape (knots, n_velocities): Joint forces at the knots, N or N m.
        values: PyResult<Py<PyArrayDyn<f64>>> = |own, py| {
            let values = own.profile.values();
            Ok(array(py, values.as_slice().to_vec(), &[values.ncols(), values.nrows()])?.unbind())
        };
        /// str: Interpolation between knots, 'line' or 'hold'.
        between: &str = |own| match own.profile.knots().between() {
            Between::Line => "line",
            Between::Hold => "hold",
        };
    }
}

#[pymethods]
impl TorqueProfile {
    #[new]
    #[pyo3(signature = (times, values, between="line"))]
    fn new(times: &Bound<'_, PyAny>, values: &Bound<'_, PyAny>, between: &str) -> Result<Self, Error> {
        let between = match between {
            "line" => Between::Line,
            "hold" => Between::Hold,
            _ => return Err(Error::input(format!("`between` must be 'line' or 'hold', found '{between}'"))),
        };
        let knots = Knots::try_new(&real_numbers("times", times)?, between)?;
        let expected = format!("real numbers of shape ({}, n_velocities)", knots.times().len());
        let found = contiguous("values", &expected, values)?;
        let &[rows, columns] = found.shape() else {
            let shape = shape_text(found.shape());
            return Err(Error::input(format!("`values` must be {expected}, found shape {shape}")));
        };
        let numbers = copied("`values`", found.as_slice().map_err(PyErr::from)?)?;
        let values = DMatrix::from_vec(columns, rows, finite_all("values", numbers)?);
        Ok(Self { profile: motion::TorqueProfile::try_new(knots, values)? })
    }

    /// Joint forces at a time, shape (n_velocities,), or at n of them, shape (n, n_velocities).
    #[pyo3(signature = (t, /))]
    fn __call__(&self, py: Python<'_>, t: &Bound<'_, PyAny>) -> Result<Py<PyArrayDyn<f64>>, Error> {
        let (scalar, times) = times("t", t)?;
        let n = self.profile.values().nrows();
        let all = times.iter().flat_map(|t| self.profile.forces(*t)).collect();
        let shape = [times.len(), n];
        Ok(array(py, all, if scalar { &shape[1..] } else { &shape })?.unbind())
    }

    fn __repr__(&self) -> String {
        let (times, n) = (self.profile.knots().times(), self.profile.values().nrows());
        let (first, last) =
            (times.first().copied().unwrap_or_default(), times.last().copied().unwrap_or_default());
        format!(
            "TorqueProfile({} from t = {first} to {last}, {}, '{}')",
            counted(times.len(), "knot", "knots"),
            counted(n, "joint force", "joint forces"),
            self.between()
        )
    }
}
