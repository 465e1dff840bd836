//! Exact motions: of a free body, and of one that carries rotors.

use crate::core::convert::{finite, times, vector, vector_array};
use crate::core::error::Error;
use crate::core::memory::expect_room;
use crate::core::value::{Pickled, by_class};
use crate::core::waiting::in_turn;
use crate::integrators::bodies::{RigidBody, State};
use crate::integrators::trajectory::{Bodies, Cast, Trajectory};
use pyo3::prelude::*;
use somersault::integrators::exact;
use somersault::integrators::gyrostat;
use somersault::integrators::nalgebra::Vector3;
use somersault::integrators::state::RigidBodyState;

/// The state at a time, or the trajectory through those at several, of a motion that is known at any.
fn states_at<'py>(
    py: Python<'py>,
    t: &Bound<'py, PyAny>,
    body: RigidBody,
    motion: impl Fn(f64) -> Result<RigidBodyState, Error> + Sync,
) -> Result<Bound<'py, PyAny>, Error> {
    let (scalar, times) = times("t", t)?;
    expect_room("the states at `t`", size_of::<RigidBodyState>().saturating_mul(times.len()))?;
    let mut states = Vec::with_capacity(times.len());
    in_turn(py, &times, |t| motion(*t).map(|x| states.push(x)))?;
    if scalar {
        return Ok(Bound::new(py, State(states[0]))?.into_any());
    }
    let cast = Cast { bodies: Bodies::Each(vec![body.0]), single: true };
    Ok(Bound::new(py, Trajectory::new(cast, times, states))?.into_any())
}

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
    pub(crate) fn new(body: RigidBody, state: State, t0: f64) -> Result<Self, Error> {
        let motion = exact::FreeBody::try_new(&body.0, &state.0)?;
        Ok(Self { body, start: state, t0: finite("t0", t0)?, motion })
    }

    #[pyo3(signature = (t, /))]
    fn __call__<'py>(&self, py: Python<'py>, t: &Bound<'py, PyAny>) -> Result<Bound<'py, PyAny>, Error> {
        states_at(py, t, self.body, |t| Ok(self.motion.at(t - self.t0)?))
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

/// Exact motion of a free gyrostat: a rigid body with rotors of constant angular momentum relative to it.
///
/// With the angular momentum h of the rotors, in the body frame, L = I ω + h, L′ = L × ω and Ṙ = R ω̂; R L is constant in the world.
/// The unit vector L/|L| runs along the curve in which a quadric meets the sphere, by elliptic functions of time, those of a free
/// body or of a pendulum in libration; the orientation follows from a Fourier series. Called with a number it gives the `State` at
/// that time, called with an array of times a `Trajectory`, whose energy and angular momentum are those of the body without h.
///
/// Parameters
/// ----------
/// body : RigidBody
///     The body with its rotors in it. For rotors without friction about their axes a, with moments J about these, its inertia is
///     without J a aᵀ, and h is constant where nothing drives them.
/// rotors : array_like, shape (3,)
///     h, the sum of the angular momenta of the rotors relative to the body, body frame, N m s.
/// state : State
///     Its state at `t0`.
/// t0 : float, optional
///     Time of `state`, s.
///
/// Raises
/// ------
/// InputError
///     If the motion is so close to a separatrix that the closed form does not fulfil its equations to 1e-9, or from a
///     call, where a time or the state there is not finite.
///
/// Notes
/// -----
/// The error is within 1e-13 of the condition of the motion, the change of its end by relative changes of the data, which grows with time
/// and near separatrices. `residual` says how well the equations hold; within some 1e-11 of a separatrix the motion is refused. The motion
/// once costs about 0.5 ms, a time 3 µs.
///
/// Sources: V. Volterra, Acta Math. 22 (1899) 201; J. Wittenburg, Dynamics of Systems of Rigid Bodies, Teubner 1977, §4.6.
///
/// Examples
/// --------
/// A wheel along the middle axis makes the rotation about it stable:
///
/// >>> import somersault
/// >>> body = somersault.RigidBody(1.0, (1.0, 2.0, 2.5))
/// >>> start = somersault.State(angular_velocity=(0.01, 1.0, 0.0))
/// >>> wheel = somersault.exact.Gyrostat(body, (0.0, 2.0, 0.0), start)
/// >>> round(float(wheel(range(100)).angular_velocity_body[:, 1].min()), 2)
/// 1.0
/// >>> free = somersault.exact.FreeBody(body, start)
/// >>> round(float(free(range(100)).angular_velocity_body[:, 1].min()), 2)
/// -1.0
#[pyclass(frozen, module = "somersault.exact")]
pub(crate) struct Gyrostat {
    body: RigidBody,
    rotors: Vector3<f64>,
    start: State,
    t0: f64,
    motion: gyrostat::Gyrostat,
}

#[pymethods]
impl Gyrostat {
    #[new]
    #[pyo3(signature = (body, rotors, state, t0=0.0))]
    fn new(body: RigidBody, rotors: &Bound<'_, PyAny>, state: State, t0: f64) -> Result<Self, Error> {
        let rotors = vector("rotors", rotors)?;
        let motion = gyrostat::Gyrostat::try_new(&body.0, &rotors, &state.0)?;
        Ok(Self { body, rotors, start: state, t0: finite("t0", t0)?, motion })
    }

    #[pyo3(signature = (t, /))]
    fn __call__<'py>(&self, py: Python<'py>, t: &Bound<'py, PyAny>) -> Result<Bound<'py, PyAny>, Error> {
        states_at(py, t, self.body, |t| Ok(self.motion.at(t - self.t0)?))
    }

    /// RigidBody: The body.
    #[getter]
    fn body(&self) -> RigidBody {
        self.body
    }

    /// ndarray, shape (3,): h, body frame, N m s.
    #[getter]
    fn rotors<'py>(&self, py: Python<'py>) -> Bound<'py, PyAny> {
        vector_array(py, &self.rotors)
    }

    /// ndarray, shape (3,): Angular momentum of body and rotors, R (I ω + h), world frame, N m s: constant.
    #[getter]
    fn angular_momentum<'py>(&self, py: Python<'py>) -> Bound<'py, PyAny> {
        vector_array(py, self.motion.angular_momentum())
    }

    /// float: By how much the solution violates its equations, relative: a few roundings but near separatrices, and at most 1e-9.
    #[getter]
    fn residual(&self) -> f64 {
        self.motion.residual()
    }

    fn __repr__(&self) -> String {
        format!("<Gyrostat from t = {}, rotors {:?}>", self.t0, self.rotors.as_slice())
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> Pickled<'py> {
        let own = slf.get();
        by_class(slf, (own.body, own.rotors(slf.py()), own.start, own.t0))
    }
}

/// Motions in closed form.
#[pyo3::pymodule(name = "exact", module = "somersault._somersault", submodule)]
pub(crate) mod module {
    #[pymodule_export]
    use crate::integrators::exact::{FreeBody, Gyrostat};
}
