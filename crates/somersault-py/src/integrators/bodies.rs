//! Rigid bodies and their states.

use crate::core::convert::{
    MomentsOrTensor, components, matrix_array, moments_or_tensor, orientation, rotation, vector_array,
    vector_or,
};
use crate::core::error::Error;
use crate::core::value::{Pickled, by_class, value};
use pyo3::prelude::*;
use pyo3::types::{PyTuple, PyType};
use somersault::core::Inertia;
use somersault::integrators::body;
use somersault::integrators::nalgebra::{UnitQuaternion, Vector3};
use somersault::integrators::state::RigidBodyState;

/// Rigid body: mass, and inertia about the centre of mass in the body frame.
///
/// Parameters
/// ----------
/// mass : float
///     Mass, kg; positive.
/// inertia : array_like, shape (3,) or (3, 3)
///     Principal moments along the body axes, or the full tensor, kg m². The tensor is symmetric and
///     positive definite, and no principal moment exceeds the sum of the other two.
///
/// Raises
/// ------
/// InputError
///     If the mass is not positive and finite, or the inertia is not one that a distribution of mass can have.
///
/// Examples
/// --------
/// >>> import somersault
/// >>> body = somersault.RigidBody.box(6.0, (1.0, 2.0, 3.0))
/// >>> body.principal_moments
/// array([6.5, 5. , 2.5])
#[pyclass(frozen, eq, from_py_object, module = "somersault")]
#[derive(Clone, Copy, PartialEq)]
pub(crate) struct RigidBody(pub(crate) body::RigidBody);

impl RigidBody {
    fn of(mass: f64, inertia: Inertia) -> Result<Self, Error> {
        Ok(Self(body::RigidBody::try_new(mass, inertia)?))
    }
}

value! {
    impl RigidBody(mass, inertia) {
        /// float: Mass, kg.
        mass: f64 = |own| own.0.mass();
        /// ndarray, shape (3, 3): Inertia tensor about the centre of mass, body frame, kg m².
        inertia: PyResult<Bound<'py, PyAny>> = |own, py| matrix_array(py, own.0.inertia().tensor());
        /// ndarray, shape (3,): Principal moments, along the axes of `principal_axes`, kg m².
        principal_moments: Bound<'py, PyAny> =
            |own, py| vector_array(py, own.0.inertia().principal_moments());
    }
}

#[pymethods]
impl RigidBody {
    #[new]
    fn new(mass: f64, inertia: &Bound<'_, PyAny>) -> Result<Self, Error> {
        let inertia = match moments_or_tensor("inertia", inertia)? {
            MomentsOrTensor::Moments(moments) => Inertia::try_principal(moments)?,
            MomentsOrTensor::Tensor(tensor) => Inertia::try_tensor(tensor)?,
        };
        Self::of(mass, inertia)
    }

    /// Solid box with full side lengths along the body axes.
    ///
    /// Parameters
    /// ----------
    /// mass : float
    ///     Mass, kg.
    /// lengths : array_like, shape (3,)
    ///     Side lengths, m.
    ///
    /// Examples
    /// --------
    /// >>> import somersault
    /// >>> somersault.RigidBody.box(6.0, (1.0, 2.0, 3.0))
    /// RigidBody(mass=6.0, inertia=[6.5, 5.0, 2.5])
    #[classmethod]
    #[pyo3(name = "box")]
    fn solid_box(_: &Bound<'_, PyType>, mass: f64, lengths: &Bound<'_, PyAny>) -> Result<Self, Error> {
        Self::of(mass, Inertia::try_box(mass, crate::core::convert::any_vector("lengths", lengths)?)?)
    }

    /// Solid ball.
    ///
    /// Parameters
    /// ----------
    /// mass : float
    ///     Mass, kg.
    /// radius : float
    ///     Radius, m.
    ///
    /// Examples
    /// --------
    /// >>> import somersault
    /// >>> somersault.RigidBody.sphere(5.0, 0.5)
    /// RigidBody(mass=5.0, inertia=[0.5, 0.5, 0.5])
    #[classmethod]
    fn sphere(_: &Bound<'_, PyType>, mass: f64, radius: f64) -> Result<Self, Error> {
        Self::of(mass, Inertia::try_sphere(mass, radius)?)
    }

    /// Solid ellipsoid with its semi-axes along the body axes.
    ///
    /// Parameters
    /// ----------
    /// mass : float
    ///     Mass, kg.
    /// radii : array_like, shape (3,)
    ///     Semi-axes, m.
    ///
    /// Examples
    /// --------
    /// >>> import somersault
    /// >>> somersault.RigidBody.ellipsoid(5.0, (1.0, 2.0, 3.0))
    /// RigidBody(mass=5.0, inertia=[13.0, 10.0, 5.0])
    #[classmethod]
    fn ellipsoid(_: &Bound<'_, PyType>, mass: f64, radii: &Bound<'_, PyAny>) -> Result<Self, Error> {
        Self::of(mass, Inertia::try_ellipsoid(mass, crate::core::convert::any_vector("radii", radii)?)?)
    }

    /// Solid cylinder with its axis along body z; a small height makes a disc.
    ///
    /// Parameters
    /// ----------
    /// mass : float
    ///     Mass, kg.
    /// radius, height : float
    ///     Radius and height, m.
    ///
    /// Examples
    /// --------
    /// >>> import somersault
    /// >>> somersault.RigidBody.cylinder(12.0, 1.0, 2.0)
    /// RigidBody(mass=12.0, inertia=[7.0, 7.0, 6.0])
    #[classmethod]
    fn cylinder(_: &Bound<'_, PyType>, mass: f64, radius: f64, height: f64) -> Result<Self, Error> {
        Self::of(mass, Inertia::try_cylinder(mass, radius, height)?)
    }

    /// Solid capsule with its axis along body z: a cylinder between two half balls.
    ///
    /// Parameters
    /// ----------
    /// mass : float
    ///     Mass, kg.
    /// radius, height : float
    ///     Radius, and height of the cylinder alone, m.
    ///
    /// Examples
    /// --------
    /// >>> import somersault
    /// >>> thigh = somersault.RigidBody.capsule(9.0, 0.08, 0.3)
    /// >>> thigh.principal_moments.round(4)
    /// array([0.1408, 0.1408, 0.0273])
    #[classmethod]
    fn capsule(_: &Bound<'_, PyType>, mass: f64, radius: f64, height: f64) -> Result<Self, Error> {
        Self::of(mass, Inertia::try_capsule(mass, radius, height)?)
    }

    /// Thin-walled hollow sphere.
    ///
    /// Parameters
    /// ----------
    /// mass : float
    ///     Mass, kg.
    /// radius : float
    ///     Radius, m.
    ///
    /// Examples
    /// --------
    /// >>> import somersault
    /// >>> somersault.RigidBody.shell(3.0, 0.5)
    /// RigidBody(mass=3.0, inertia=[0.5, 0.5, 0.5])
    #[classmethod]
    fn shell(_: &Bound<'_, PyType>, mass: f64, radius: f64) -> Result<Self, Error> {
        Self::of(mass, Inertia::try_shell(mass, radius)?)
    }

    /// scipy.spatial.transform.Rotation: Rotation P from principal axes to the body frame.
    ///
    /// The inertia is P diag(principal_moments) Pᵀ.
    #[getter]
    fn principal_axes<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let axes = components(self.0.inertia().principal_axes());
        rotation(numpy::PyArray1::from_slice(py, &axes).as_any())
    }

    fn __repr__(&self) -> String {
        let inertia = self.0.inertia();
        let rows = if inertia.is_diagonal() {
            format!("{:?}", inertia.principal_moments().as_slice())
        } else {
            let rows: Vec<_> =
                inertia.tensor().row_iter().map(|r| format!("{:?}", [r[0], r[1], r[2]])).collect();
            format!("[{}]", rows.join(", "))
        };
        format!("RigidBody(mass={:?}, inertia={rows})", self.0.mass())
    }
}

/// State of one rigid body.
///
/// Everything is in the world frame but for names that end in ``_body``. Arguments left out are zero,
/// and the orientation is then the identity.
///
/// Parameters
/// ----------
/// position : array_like, shape (3,), optional
///     Position of the centre of mass, m.
/// orientation : Rotation or array_like, shape (4,) or (3, 3), optional
///     Rotation from the body frame to the world frame: a `scipy.spatial.transform.Rotation`, a
///     quaternion in SciPy's order (x, y, z, w), which is normalised, or a rotation matrix.
/// velocity : array_like, shape (3,), optional
///     Velocity of the centre of mass, m/s.
/// angular_velocity : array_like, shape (3,), optional
///     Angular velocity in the world frame, rad/s.
/// angular_velocity_body : array_like, shape (3,), optional
///     Angular velocity in the body frame, in the place of `angular_velocity`.
///
/// Raises
/// ------
/// InputError
///     If an argument has another shape or is not finite, or both angular velocities are given.
///
/// Examples
/// --------
/// >>> import somersault
/// >>> state = somersault.State(angular_velocity=(0.0, 0.0, 2.0))
/// >>> state.angular_velocity
/// array([0., 0., 2.])
#[pyclass(frozen, eq, from_py_object, module = "somersault")]
#[derive(Clone, Copy, PartialEq)]
pub(crate) struct State(pub(crate) RigidBodyState);

value! {
    impl State {
        /// ndarray, shape (3,): Position of the centre of mass, m.
        position: Bound<'py, PyAny> = |own, py| vector_array(py, own.0.position());
        /// ndarray, shape (4,): The orientation as a unit quaternion (x, y, z, w).
        quaternion: Bound<'py, PyAny> =
            |own, py| numpy::PyArray1::from_slice(py, &components(own.0.orientation())).into_any();
        /// ndarray, shape (3,): Velocity of the centre of mass, m/s.
        velocity: Bound<'py, PyAny> = |own, py| vector_array(py, own.0.velocity());
        /// ndarray, shape (3,): Angular velocity in the world frame, rad/s.
        angular_velocity: Bound<'py, PyAny> = |own, py| vector_array(py, own.0.angular_velocity());
    }
}

#[pymethods]
impl State {
    #[new]
    #[pyo3(signature = (position=None, orientation=None, velocity=None, angular_velocity=None, *, angular_velocity_body=None))]
    fn new(
        position: Option<&Bound<'_, PyAny>>,
        orientation: Option<&Bound<'_, PyAny>>,
        velocity: Option<&Bound<'_, PyAny>>,
        angular_velocity: Option<&Bound<'_, PyAny>>,
        angular_velocity_body: Option<&Bound<'_, PyAny>>,
    ) -> Result<Self, Error> {
        let zero = Vector3::zeros();
        let position = vector_or("position", position, zero)?;
        let orientation = orientation
            .map_or(Ok(UnitQuaternion::identity()), |value| self::orientation("orientation", value))?;
        let velocity = vector_or("velocity", velocity, zero)?;
        let angular_velocity = match (angular_velocity, angular_velocity_body) {
            (Some(_), Some(_)) => {
                return Err(Error::input(
                    "only one of `angular_velocity` and `angular_velocity_body` can be given",
                ));
            }
            (world, None) => vector_or("angular_velocity", world, zero)?,
            (None, body) => orientation * vector_or("angular_velocity_body", body, zero)?,
        };
        Ok(Self(RigidBodyState::new(position, orientation, velocity, angular_velocity)))
    }

    /// scipy.spatial.transform.Rotation: Rotation from the body frame to the world frame.
    #[getter(orientation)]
    fn rotation<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        rotation(&self.quaternion(py))
    }

    /// ndarray, shape (3,): Angular velocity in the body frame, rad/s.
    #[getter]
    fn angular_velocity_body<'py>(&self, py: Python<'py>) -> Bound<'py, PyAny> {
        vector_array(py, &self.0.orientation().inverse_transform_vector(self.0.angular_velocity()))
    }

    fn __repr__(&self) -> String {
        format!(
            "State(position={:?}, orientation={:?}, velocity={:?}, angular_velocity={:?})",
            self.0.position().as_slice(),
            components(self.0.orientation()),
            self.0.velocity().as_slice(),
            self.0.angular_velocity().as_slice(),
        )
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> Pickled<'py> {
        let (py, state) = (slf.py(), slf.get());
        let parts =
            [state.position(py), state.quaternion(py), state.velocity(py), state.angular_velocity(py)];
        by_class(slf, PyTuple::new(py, parts)?)
    }
}
