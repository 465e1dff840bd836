//! The exact motion of a free body.

use crate::core::convert::{finite, times};
use crate::core::error::Error;
use crate::core::value::{Pickled, by_class};
use crate::integrators::bodies::{RigidBody, State};
use crate::integrators::trajectory::{Cast, Trajectory};
use pyo3::prelude::*;
use somersault::integrators::exact;

/// Exact motion of a free rigid body, by elliptic and theta functions.
///
/// Called with a number it gives the `State` at that time, called with an array of times a `Trajectory`.
/// The error of the orientation is a few roundings, however far the time.
///
/// Parameters
/// ----------
/// body : RigidBody
///     The body.
/// state : State
///     Its state at `t0`.
/// t0 : float, optional
///     Time of `state`, s.
///
/// Raises
/// ------
/// InputError
///     From a call, where a time or the state there is not finite.
///
/// Examples
/// --------
/// >>> import somersault
/// >>> body = somersault.RigidBody(1.0, (1.0, 2.0, 2.5))
/// >>> start = somersault.State(angular_velocity=(0.01, 2.0, 0.0))
/// >>> motion = somersault.exact.FreeBody(body, start)
/// >>> motion([0.0, 1e3, 1e6]).quaternion.shape
/// (3, 4)
#[pyclass(frozen, module = "somersault.exact")]
pub(crate) struct FreeBody {
    body: RigidBody,
    start: State,
    t0: f64,
    motion: exact::FreeBody,
}

#[pymethods]
impl FreeBody {
    #[new]
    #[pyo3(signature = (body, state, t0=0.0))]
    fn new(body: RigidBody, state: State, t0: f64) -> Result<Self, Error> {
        let motion = exact::FreeBody::try_new(&body.0, &state.0)?;
        Ok(Self { body, start: state, t0: finite("t0", t0)?, motion })
    }

    #[pyo3(signature = (t, /))]
    fn __call__<'py>(&self, py: Python<'py>, t: &Bound<'py, PyAny>) -> Result<Bound<'py, PyAny>, Error> {
        let (scalar, times) = times("t", t)?;
        let states =
            py.detach(|| times.iter().map(|t| self.motion.at(t - self.t0)).collect::<Result<Vec<_>, _>>())?;
        if scalar {
            return Ok(Bound::new(py, State(states[0]))?.into_any());
        }
        let cast = Cast { bodies: vec![self.body.0], single: true };
        Ok(Bound::new(py, Trajectory::new(cast, times, states))?.into_any())
    }

    /// RigidBody: The body.
    #[getter]
    fn body(&self) -> RigidBody {
        self.body
    }

    fn __repr__(&self) -> String {
        format!("<FreeBody from t = {}>", self.t0)
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> Pickled<'py> {
        let own = slf.get();
        by_class(slf, (own.body, own.start, own.t0))
    }
}

/// Motions in closed form.
#[pyo3::pymodule(name = "exact", module = "somersault._somersault", submodule)]
pub(crate) mod module {
    #[pymodule_export]
    use crate::integrators::exact::FreeBody;
}
