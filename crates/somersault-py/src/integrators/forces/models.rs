//! Forces and torques: the models of the library, and Python callables in their place.

use crate::core::callable::{Failure, call, callable_name, noted};
use crate::core::convert::{
    a_type, any_vector, any_vectors, finite, sequence, vector, vector_array, vector_or,
};
use crate::core::error::Error;
use crate::core::value::{Pickled, by_class, by_restore, value};
use crate::integrators::bodies::{RigidBody, State};
use pyo3::prelude::*;
use pyo3::types::{PyList, PyType};
use somersault::integrators::body;
use somersault::integrators::force::{self, BoxedForce, StatesInLanes, Wrench, WrenchesInLanes};
use somersault::integrators::nalgebra::Vector3;
use somersault::integrators::series::WrenchTerm;
use somersault::integrators::state::{Pose, RigidBodiesState, RigidBodyState, State as StateOf, Twist};
use somersault::integrators::system::{self, BoxedInteraction, Interaction};
use somersault::integrators::variation::Tangent;
use std::sync::Arc;

/// Base of the built-in force models.
#[pyclass(frozen, subclass, module = "somersault.forces")]
pub(crate) struct ForceModel {
    model: Shared,
    /// The one body that it acts on, where it is part of one.
    carrier: Option<body::RigidBody>,
}

/// Moments of inertia within this much of the largest are the same.
const SAME_INERTIA: f64 = 1e-9;

impl ForceModel {
    /// The model, as what acts on a body; fails where it is part of a body with another inertia.
    fn acting_on(model: &Bound<'_, Self>, argument: &str, body: &body::RigidBody) -> Result<Shared, Error> {
        let Self { model: shared, carrier } = model.get();
        if let Some(carrier) = carrier {
            let of_carrier = carrier.inertia();
            let off = (of_carrier.tensor() - body.inertia().tensor()).amax();
            if off > SAME_INERTIA * of_carrier.principal_moments().max() {
                let shown = |body: &body::RigidBody| Bound::new(model.py(), RigidBody(*body))?.repr();
                return Err(Error::input(format!(
                    "`{argument}` must act on the `carrier` of its {}, {}, found {}",
                    model.get_type().name()?,
                    shown(carrier)?,
                    shown(body)?
                )));
            }
        }
        Ok(shared.clone())
    }
}

#[pymethods]
impl ForceModel {
    /// Force and torque on a body.
    ///
    /// Parameters
    /// ----------
    /// t : float
    ///     Time, s.
    /// body : RigidBody
    ///     The body.
    /// state : State
    ///     Its state.
    ///
    /// Returns
    /// -------
    /// force, torque : ndarray, shape (3,)
    ///     Force, N, and torque about the centre of mass, N m, world frame.
    ///
    /// Examples
    /// --------
    /// >>> import somersault
    /// >>> body = somersault.RigidBody.sphere(2.0, 0.1)
    /// >>> drag = somersault.forces.Drag(quadratic=0.5)
    /// >>> force, torque = drag.wrench(0.0, body, somersault.State(velocity=(4.0, 0.0, 0.0)))
    /// >>> round(float(force[0]), 6)
    /// -8.0
    fn wrench<'py>(
        slf: &Bound<'py, Self>,
        t: f64,
        body: RigidBody,
        state: State,
    ) -> Result<(Bound<'py, PyAny>, Bound<'py, PyAny>), Error> {
        let wrench = force::ForceModel::wrench(&Self::acting_on(slf, "body", &body.0)?, t, &body.0, &state.0);
        Ok((vector_array(slf.py(), &wrench.force), vector_array(slf.py(), &wrench.torque)))
    }
}

/// A model that a Python object and an integration own together.
#[derive(Clone)]
pub(crate) struct Shared(Arc<dyn force::ForceModel + Send + Sync>);

impl Shared {
    /// The model.
    pub(crate) fn model(&self) -> &Arc<dyn force::ForceModel + Send + Sync> {
        &self.0
    }
}

#[deny(clippy::missing_trait_methods)]
impl force::ForceModel for Shared {
    fn wrench(&self, t: f64, body: &body::RigidBody, x: &RigidBodyState) -> Wrench {
        self.0.wrench(t, body, x)
    }
    fn is_free(&self) -> bool {
        self.0.is_free()
    }
    fn is_torque_free(&self) -> bool {
        self.0.is_torque_free()
    }
    fn depends_on_velocity(&self) -> bool {
        self.0.depends_on_velocity()
    }
    fn bound(&self, body: &body::RigidBody, reach: &force::Reach) -> Option<force::WrenchBound> {
        self.0.bound(body, reach)
    }
    fn potential(&self, body: &body::RigidBody, x: &RigidBodyState) -> Option<f64> {
        self.0.potential(body, x)
    }
    fn add_terms(&self, body: &body::RigidBody, terms: &mut Vec<WrenchTerm>) -> bool {
        self.0.add_terms(body, terms)
    }
    fn add_in_lanes(&self, on: &StatesInLanes<'_>, sums: &mut WrenchesInLanes) {
        self.0.add_in_lanes(on, sums);
    }
    fn next_stop(&self, t: f64, end: f64) -> Option<f64> {
        self.0.next_stop(t, end)
    }
    fn wrench_variation(
        &self,
        t: f64,
        body: &body::RigidBody,
        x: &RigidBodyState,
        along: &Tangent<Twist>,
    ) -> Wrench {
        self.0.wrench_variation(t, body, x, along)
    }
    fn mass_derivative(&self, t: f64, body: &body::RigidBody, x: &RigidBodyState) -> Wrench {
        self.0.mass_derivative(t, body, x)
    }
}

/// A model as an object of its class, which holds a copy of it.
pub(crate) fn build<M, C>(model: M, wrap: impl FnOnce(M) -> C) -> PyClassInitializer<C>
where
    M: force::ForceModel + Clone + Send + Sync + 'static,
    C: pyo3::PyClass<BaseType = ForceModel>,
{
    build_for(None, model, wrap)
}

/// The same of a model that acts on one body only, where that is known.
pub(crate) fn build_for<M, C>(
    carrier: Option<body::RigidBody>,
    model: M,
    wrap: impl FnOnce(M) -> C,
) -> PyClassInitializer<C>
where
    M: force::ForceModel + Clone + Send + Sync + 'static,
    C: pyo3::PyClass<BaseType = ForceModel>,
{
    let base = ForceModel { model: Shared(Arc::new(model.clone())), carrier };
    PyClassInitializer::from(base).add_subclass(wrap(model))
}

/// Uniform gravity: F = m g.
///
/// Parameters
/// ----------
/// acceleration : array_like, shape (3,), optional
///     g, m/s²; 9.81 along −z unless given.
///
/// Examples
/// --------
/// On the moon:
///
/// >>> import somersault
/// >>> body, start = somersault.RigidBody.sphere(1.0, 0.1), somersault.State((0, 0, 10.0))
/// >>> moon = somersault.forces.Gravity((0, 0, -1.62))
/// >>> motion = somersault.integrate(body, start, (0.0, 1.0), dt=0.1, forces=moon)
/// >>> round(float(motion.position[-1, 2]), 6)
/// 9.19
#[pyclass(frozen, extends = ForceModel, module = "somersault.forces")]
pub(crate) struct Gravity(force::Gravity);

impl Gravity {
    /// One of the library's.
    pub(crate) fn of(py: Python<'_>, gravity: force::Gravity) -> PyResult<Py<Self>> {
        Py::new(py, build(gravity, Self))
    }
}

value! {
    impl Gravity(acceleration) {
        /// ndarray, shape (3,): g, m/s².
        acceleration: Bound<'py, PyAny> = |own, py| vector_array(py, &own.0.acceleration);
    }
}

#[pymethods]
impl Gravity {
    #[new]
    #[pyo3(signature = (acceleration=None))]
    fn new(acceleration: Option<&Bound<'_, PyAny>>) -> Result<PyClassInitializer<Self>, Error> {
        let acceleration = vector_or("acceleration", acceleration, force::Gravity::earth().acceleration)?;
        Ok(build(force::Gravity { acceleration }, Self))
    }

    fn __repr__(&self) -> String {
        format!("Gravity({:?})", self.0.acceleration.as_slice())
    }
}

/// Linear spring and damper between a point of the body and an anchor in the world.
///
/// With s the vector from the anchor to the attachment, F = −k (1 − l₀/‖s‖) s − c (ṡ·s) s/‖s‖².
///
/// Parameters
/// ----------
/// stiffness : float
///     k, N/m.
/// anchor : array_like, shape (3,), optional
///     Fixed end, world frame, m.
/// attachment : array_like, shape (3,), optional
///     End on the body, body frame, m; the centre of mass unless given.
/// damping : float, optional
///     c, N s/m.
/// rest_length : float, optional
///     l₀, m.
///
/// Examples
/// --------
/// A mass on a spring, after half a period:
///
/// >>> import numpy as np
/// >>> import somersault
/// >>> spring = somersault.forces.Spring(4.0)
/// >>> body, start = somersault.RigidBody.sphere(1.0, 0.1), somersault.State((1.0, 0, 0))
/// >>> motion = somersault.integrate(body, start, (0.0, np.pi / 2), dt=0.01, forces=spring)
/// >>> round(float(motion.position[-1, 0]), 6)
/// -1.0
#[pyclass(frozen, extends = ForceModel, module = "somersault.forces")]
pub(crate) struct Spring(force::Spring);

impl Spring {
    /// One of the library's.
    pub(crate) fn of(py: Python<'_>, spring: force::Spring) -> PyResult<Py<Self>> {
        Py::new(py, build(spring, Self))
    }
}

value! {
    impl Spring {
        /// float: k, N/m.
        stiffness: f64 = |own| own.0.stiffness;
        /// ndarray, shape (3,): Fixed end, world frame, m.
        anchor: Bound<'py, PyAny> = |own, py| vector_array(py, &own.0.anchor);
        /// ndarray, shape (3,): End on the body, body frame, m.
        attachment: Bound<'py, PyAny> = |own, py| vector_array(py, &own.0.attachment);
        /// float: c, N s/m.
        damping: f64 = |own| own.0.damping;
        /// float: l₀, m.
        rest_length: f64 = |own| own.0.rest_length;
    }
}

#[pymethods]
impl Spring {
    #[new]
    #[pyo3(signature = (stiffness, anchor=None, attachment=None, *, damping=0.0, rest_length=0.0))]
    fn new(
        stiffness: f64,
        anchor: Option<&Bound<'_, PyAny>>,
        attachment: Option<&Bound<'_, PyAny>>,
        damping: f64,
        rest_length: f64,
    ) -> Result<PyClassInitializer<Self>, Error> {
        let spring = force::Spring {
            anchor: vector_or("anchor", anchor, Vector3::zeros())?,
            attachment: vector_or("attachment", attachment, Vector3::zeros())?,
            stiffness: finite("stiffness", stiffness)?,
            damping: finite("damping", damping)?,
            rest_length: finite("rest_length", rest_length)?,
        };
        Ok(build(spring, Self))
    }

    fn __repr__(&self) -> String {
        let s = &self.0;
        format!(
            "Spring({:?}, anchor={:?}, attachment={:?}, damping={:?}, rest_length={:?})",
            s.stiffness,
            s.anchor.as_slice(),
            s.attachment.as_slice(),
            s.damping,
            s.rest_length
        )
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> Pickled<'py> {
        let (py, own) = (slf.py(), slf.get());
        let ends = (own.anchor(py), own.attachment(py));
        by_restore(slf, (own.stiffness(), ends.0, ends.1, own.damping(), own.rest_length()))
    }

    /// A pickled spring.
    #[classmethod]
    fn _restore(
        cls: &Bound<'_, PyType>,
        stiffness: f64,
        anchor: &Bound<'_, PyAny>,
        attachment: &Bound<'_, PyAny>,
        damping: f64,
        rest_length: f64,
    ) -> Result<Py<Self>, Error> {
        let spring = Self::new(stiffness, Some(anchor), Some(attachment), damping, rest_length)?;
        Ok(Py::new(cls.py(), spring)?)
    }
}

/// Drag: F = −(c₁ + c₂‖v‖) v, M = −c₃ ω.
///
/// Parameters
/// ----------
/// linear : float, optional
///     c₁, N s/m.
/// quadratic : float, optional
///     c₂, N s²/m².
/// angular : float, optional
///     c₃, N m s.
///
/// Examples
/// --------
/// Falling at the limit speed √(m g/c₂):
///
/// >>> import somersault
/// >>> fall = [somersault.forces.Gravity(), somersault.forces.Drag(quadratic=0.25)]
/// >>> body = somersault.RigidBody.sphere(1.0, 0.1)
/// >>> motion = somersault.integrate(body, somersault.State(), (0.0, 10.0), dt=0.1, forces=fall)
/// >>> round(float(motion.velocity[-1, 2]), 4), round((9.81 / 0.25) ** 0.5, 4)
/// (-6.2642, 6.2642)
#[pyclass(frozen, extends = ForceModel, module = "somersault.forces")]
pub(crate) struct Drag(force::Drag);

impl Drag {
    /// One of the library's.
    pub(crate) fn of(py: Python<'_>, drag: force::Drag) -> PyResult<Py<Self>> {
        Py::new(py, build(drag, Self))
    }
}

value! {
    impl Drag(linear, quadratic, angular) {
        /// float: c₁, N s/m.
        linear: f64 = |own| own.0.linear;
        /// float: c₂, N s²/m².
        quadratic: f64 = |own| own.0.quadratic;
        /// float: c₃, N m s.
        angular: f64 = |own| own.0.angular;
    }
}

#[pymethods]
impl Drag {
    #[new]
    #[pyo3(signature = (linear=0.0, quadratic=0.0, angular=0.0))]
    fn new(linear: f64, quadratic: f64, angular: f64) -> Result<PyClassInitializer<Self>, Error> {
        let drag = force::Drag {
            linear: finite("linear", linear)?,
            quadratic: finite("quadratic", quadratic)?,
            angular: finite("angular", angular)?,
        };
        Ok(build(drag, Self))
    }

    fn __repr__(&self) -> String {
        format!(
            "Drag(linear={:?}, quadratic={:?}, angular={:?})",
            self.0.linear, self.0.quadratic, self.0.angular
        )
    }
}

/// Constant torque about the centre of mass, fixed in the world or in the body.
///
/// Parameters
/// ----------
/// torque : array_like, shape (3,)
///     Torque, N m.
/// frame : {'world', 'body'}, optional
///     Where it is fixed.
///
/// Examples
/// --------
/// >>> import somersault
/// >>> body = somersault.RigidBody(1.0, (1.0, 1.0, 2.0))
/// >>> motor = somersault.forces.Torque((0.0, 0.0, 0.5), frame="body")
/// >>> motion = somersault.integrate(body, somersault.State(), (0.0, 4.0), dt=0.1, forces=motor)
/// >>> motion.angular_velocity[-1].round(6)
/// array([0., 0., 1.])
#[pyclass(frozen, extends = ForceModel, module = "somersault.forces")]
pub(crate) struct Torque(force::ConstantTorque);

#[pymethods]
impl Torque {
    #[new]
    #[pyo3(signature = (torque, frame="world"))]
    fn new(torque: &Bound<'_, PyAny>, frame: &str) -> Result<PyClassInitializer<Self>, Error> {
        let torque = vector("torque", torque)?;
        let torque = match is_body(frame)? {
            false => force::ConstantTorque::World(torque),
            true => force::ConstantTorque::Body(torque),
        };
        Ok(build(torque, Self))
    }

    /// ndarray, shape (3,): Torque, N m.
    #[getter]
    fn torque<'py>(&self, py: Python<'py>) -> Bound<'py, PyAny> {
        let (force::ConstantTorque::World(torque) | force::ConstantTorque::Body(torque)) = &self.0;
        vector_array(py, torque)
    }

    /// str: Where it is fixed, ``"world"`` or ``"body"``.
    #[getter]
    fn frame(&self) -> &'static str {
        match self.0 {
            force::ConstantTorque::World(_) => "world",
            force::ConstantTorque::Body(_) => "body",
        }
    }

    fn __repr__(&self) -> String {
        let (force::ConstantTorque::World(torque) | force::ConstantTorque::Body(torque)) = &self.0;
        format!("Torque({:?}, frame='{}')", torque.as_slice(), self.frame())
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> Pickled<'py> {
        let (py, own) = (slf.py(), slf.get());
        by_class(slf, (own.torque(py), own.frame()))
    }
}

/// The name of the frame of a torque as whether it is the body's.
pub(super) fn is_body(frame: &str) -> Result<bool, Error> {
    match frame {
        "world" => Ok(false),
        "body" => Ok(true),
        _ => Err(Error::input(format!("`frame` must be 'world' or 'body', found '{frame}'"))),
    }
}

/// Newton's attraction of the centre of mass by a fixed point: F = −μ m s/|s|³ with the way s from the point.
///
/// It exerts no torque; that of its gradient is `GravityGradient`.
///
/// Parameters
/// ----------
/// gravitational_parameter : float
///     μ, m³/s².
/// center : array_like, shape (3,), optional
///     The point, world frame, m; the origin unless given.
///
/// Examples
/// --------
/// A circle of radius 1 m is passed in 2π s:
///
/// >>> import math
/// >>> import somersault
/// >>> body, start = somersault.RigidBody.sphere(1.0, 0.1), somersault.State((1, 0, 0), velocity=(0, 1, 0))
/// >>> sun = somersault.forces.CentralGravity(1.0)
/// >>> orbit = somersault.integrate(body, start, (0.0, 2 * math.pi), forces=sun, rtol=1e-10)
/// >>> orbit.position[-1].round(6) + 0.0
/// array([1., 0., 0.])
#[pyclass(frozen, extends = ForceModel, module = "somersault.forces")]
pub(crate) struct CentralGravity(force::CentralGravity);

value! {
    impl CentralGravity(gravitational_parameter, center) {
        /// float: μ, m³/s².
        gravitational_parameter: f64 = |own| own.0.gravitational_parameter;
        /// ndarray, shape (3,): The point, world frame, m.
        center: Bound<'py, PyAny> = |own, py| vector_array(py, &own.0.centre);
    }
}

#[pymethods]
impl CentralGravity {
    #[new]
    #[pyo3(signature = (gravitational_parameter, center=None))]
    fn new(
        gravitational_parameter: f64,
        center: Option<&Bound<'_, PyAny>>,
    ) -> Result<PyClassInitializer<Self>, Error> {
        let gravity = force::CentralGravity {
            gravitational_parameter: finite("gravitational_parameter", gravitational_parameter)?,
            centre: vector_or("center", center, Vector3::zeros())?,
        };
        Ok(build(gravity, Self))
    }

    fn __repr__(&self) -> String {
        let force::CentralGravity { gravitational_parameter, centre } = &self.0;
        format!("CentralGravity({gravitational_parameter:?}, {:?})", centre.as_slice())
    }
}

/// Constant force, fixed in the world, at a point of the body.
///
/// Parameters
/// ----------
/// force : array_like, shape (3,)
///     Force, world frame, N.
/// point : array_like, shape (3,), optional
///     Point of action, body frame, m; the centre of mass unless given.
///
/// Examples
/// --------
/// A push beside the centre of mass turns the body:
///
/// >>> import somersault
/// >>> push = somersault.forces.Force((0.0, 2.0, 0.0), point=(0.5, 0.0, 0.0))
/// >>> force, torque = push.wrench(0.0, somersault.RigidBody.sphere(1.0, 0.5), somersault.State())
/// >>> torque
/// array([0., 0., 1.])
#[pyclass(frozen, extends = ForceModel, module = "somersault.forces")]
pub(crate) struct Force(force::ConstantForce);

value! {
    impl Force(force, point) {
        /// ndarray, shape (3,): Force, world frame, N.
        force: Bound<'py, PyAny> = |own, py| vector_array(py, &own.0.force);
        /// ndarray, shape (3,): Point of action, body frame, m.
        point: Bound<'py, PyAny> = |own, py| vector_array(py, &own.0.point);
    }
}

#[pymethods]
impl Force {
    #[new]
    #[pyo3(signature = (force, point=None))]
    fn new(
        force: &Bound<'_, PyAny>,
        point: Option<&Bound<'_, PyAny>>,
    ) -> Result<PyClassInitializer<Self>, Error> {
        let force = force::ConstantForce {
            force: vector("force", force)?,
            point: vector_or("point", point, Vector3::zeros())?,
        };
        Ok(build(force, Self))
    }

    fn __repr__(&self) -> String {
        format!("Force({:?}, point={:?})", self.0.force.as_slice(), self.0.point.as_slice())
    }
}

/// Newtonian attraction between the centres of mass: F = G m₁ m₂/d².
///
/// Parameters
/// ----------
/// constant : float, optional
///     G in the units of the problem; the CODATA value of 2018 in m³/(kg s²) unless given.
///
/// Examples
/// --------
/// Two equal stars on a circle, after one turn:
///
/// >>> import numpy as np
/// >>> import somersault
/// >>> star = somersault.RigidBody.sphere(1.0, 0.01)
/// >>> states = [somersault.State((x, 0, 0), velocity=(0, x / 2**0.5, 0)) for x in (0.5, -0.5)]
/// >>> pull = somersault.forces.Gravitation(0.25)
/// >>> turn = 2 * np.pi * 2**0.5
/// >>> motion = somersault.integrate([star, star], states, (0.0, turn), dt=0.01, interaction=pull)
/// >>> [round(float(x), 5) for x in motion.position[-1, :, 0]]
/// [0.5, -0.5]
#[pyclass(frozen, from_py_object, module = "somersault.forces")]
#[derive(Clone, Copy)]
pub(crate) struct Gravitation(system::Gravitation);

value! {
    impl Gravitation(constant) {
        /// float: G.
        constant: f64 = |own| own.0.constant;
    }
}

#[pymethods]
impl Gravitation {
    #[new]
    #[pyo3(signature = (constant=6.6743e-11))]
    fn new(constant: f64) -> Result<Self, Error> {
        Ok(Self(system::Gravitation { constant: finite("constant", constant)? }))
    }

    fn __repr__(&self) -> String {
        format!("Gravitation({:?})", self.0.constant)
    }
}

fn check_returned(name: &str, t: f64, finite: bool) -> Result<(), Error> {
    if finite {
        Ok(())
    } else {
        Err(Error::input(format!("`{name}` returned a force or torque that is NaN or infinite at t = {t}")))
    }
}

/// A callable ``f(t, state) -> (force, torque)``.
pub(crate) struct CallableForce {
    callable: Py<PyAny>,
    name: String,
    failure: Failure,
}

const NAN: Vector3<f64> = Vector3::new(f64::NAN, f64::NAN, f64::NAN);

impl force::ForceModel for CallableForce {
    fn wrench(&self, t: f64, _: &body::RigidBody, x: &RigidBodyState) -> Wrench {
        call(&self.failure, Wrench { force: NAN, torque: NAN }, |py| {
            let returned = self.callable.call1(py, (t, State(*x)));
            let returned = noted(py, returned, || format!("the force {} at t = {t}", self.name))?;
            let (force, torque) = pair(&self.name, "(3,)", returned.bind(py))?;
            let vector = |part: usize, value| {
                any_vector("returned", value).map_err(|error| {
                    error.with_names(&[("returned", &format!("{}(t, state)[{part}]", self.name))])
                })
            };
            let wrench = Wrench { force: vector(0, &force)?, torque: vector(1, &torque)? };
            check_returned(&self.name, t, (wrench.force + wrench.torque).iter().all(|x| x.is_finite()))?;
            Ok(wrench)
        })
    }
}

fn pair<'py>(
    name: &str,
    shape: &str,
    returned: &Bound<'py, PyAny>,
) -> Result<(Bound<'py, PyAny>, Bound<'py, PyAny>), Error> {
    returned.extract().map_err(|_| {
        Error::input(format!(
            "`{name}` must return a pair (force, torque), each of shape {shape}, found {}",
            a_type(returned)
        ))
    })
}

/// A force on a body: a model, or a callable, which holds the interpreter.
pub(crate) enum Acting {
    Model(Shared),
    Callable(Box<CallableForce>),
}

impl From<Acting> for BoxedForce {
    fn from(acting: Acting) -> Self {
        match acting {
            Acting::Model(model) => Box::new(model),
            Acting::Callable(callable) => callable,
        }
    }
}

/// Reads force models, and notes whether a Python callable is among them.
pub(crate) struct Reader {
    pub(crate) failure: Failure,
    pub(crate) calls_python: bool,
}

impl Reader {
    fn model(
        &mut self,
        argument: &str,
        body: &body::RigidBody,
        value: &Bound<'_, PyAny>,
    ) -> Result<Acting, Error> {
        if let Ok(model) = value.cast::<ForceModel>() {
            return Ok(Acting::Model(ForceModel::acting_on(model, argument, body)?));
        }
        if value.is_callable() && !value.is_instance_of::<pyo3::types::PyType>() {
            self.calls_python = true;
            return Ok(Acting::Callable(Box::new(CallableForce {
                callable: value.clone().unbind(),
                name: callable_name(value),
                failure: self.failure.clone(),
            })));
        }
        Err(Error::input(format!(
            "`{argument}` must hold force models or callables f(t, state) -> (force, torque), found {}",
            a_type(value)
        )))
    }

    /// One or several forces that act on a body; None is no force.
    pub(crate) fn sum<F: From<Acting>>(
        &mut self,
        argument: &str,
        body: &body::RigidBody,
        value: &Bound<'_, PyAny>,
    ) -> Result<Vec<F>, Error> {
        if value.is_none() {
            return Ok(Vec::new());
        }
        match sequence(value) {
            Some(list) => list.try_iter()?.map(|f| Ok(self.model(argument, body, &f?)?.into())).collect(),
            None => Ok(vec![self.model(argument, body, value)?.into()]),
        }
    }

    /// What acts on each of several bodies: one entry for each, or one model for all.
    pub(crate) fn for_each<F: From<Acting>>(
        &mut self,
        argument: &str,
        bodies: &[body::RigidBody],
        value: &Bound<'_, PyAny>,
    ) -> Result<Vec<Vec<F>>, Error> {
        match sequence(value) {
            Some(list) if list.len()? > 0 => {
                // entries beyond the bodies are counted by the system
                let each = bodies.iter().map(Some).chain(std::iter::repeat(None));
                let each = list.try_iter()?.zip(each);
                each.map(|(entry, body)| {
                    body.map_or(Ok(Vec::new()), |body| self.sum(argument, body, &entry?))
                })
                .collect()
            }
            Some(_) => Ok(bodies.iter().map(|_| Vec::new()).collect()),
            None => bodies.iter().map(|body| self.sum(argument, body, value)).collect(),
        }
    }

    /// What acts between bodies.
    pub(crate) fn between(&mut self, value: Option<&Bound<'_, PyAny>>) -> Result<BoxedInteraction, Error> {
        let Some(value) = value else { return Ok(Box::new(())) };
        if let Ok(Gravitation(gravitation)) = value.extract::<Gravitation>() {
            return Ok(Box::new(gravitation));
        }
        if value.is_callable() {
            self.calls_python = true;
            return Ok(Box::new(CallableInteraction {
                callable: value.clone().unbind(),
                name: callable_name(value),
                failure: self.failure.clone(),
            }));
        }
        Err(Error::input(format!(
            "`interaction` must be a Gravitation or a callable f(t, states) -> (forces, torques), found {}",
            a_type(value)
        )))
    }
}

/// Built-in models that add up, to be run without the interpreter.
#[derive(Clone, Default)]
pub(crate) struct Models(Arc<[Py<ForceModel>]>);

impl Models {
    /// One built-in model or several.
    pub(crate) fn extract(
        argument: &str,
        body: &body::RigidBody,
        value: &Bound<'_, PyAny>,
    ) -> Result<Self, Error> {
        let model = |value: &Bound<'_, PyAny>| match value.cast::<ForceModel>() {
            Ok(model) => {
                ForceModel::acting_on(model, argument, body)?;
                Ok(model.clone().unbind())
            }
            Err(_) => {
                Err(Error::input(format!("`{argument}` must hold force models, found {}", a_type(value))))
            }
        };
        let models: Arc<[_]> = match sequence(value) {
            Some(list) => list.try_iter()?.map(|f| model(&f?)).collect::<Result<_, _>>()?,
            None => Arc::new([model(value)?]),
        };
        Ok(Self(models))
    }

    /// Whether there is none.
    pub(crate) fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// The models as they were given.
    pub(crate) fn to_python<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyList>> {
        PyList::new(py, self.0.iter())
    }

    /// What they are to a system.
    pub(crate) fn boxed(&self) -> Vec<BoxedForce> {
        self.0.iter().map(|model| Box::new(model.get().model.clone()) as BoxedForce).collect()
    }
}

/// An interaction that Python gave.
struct CallableInteraction {
    callable: Py<PyAny>,
    name: String,
    failure: Failure,
}

impl Interaction for CallableInteraction {
    fn add_wrenches(&self, t: f64, _: &[body::RigidBody], x: &RigidBodiesState, out: &mut [Twist]) {
        let Self { callable, name, failure } = self;
        let nan = vec![Twist { linear: NAN, angular: NAN }; out.len()];
        let wrenches = call(failure, nan, |py| {
            let returned = callable.call1(py, (t, states_list(py, x)?));
            let returned = noted(py, returned, || format!("the interaction {name} at t = {t}"))?;
            let shape = format!("({}, 3)", out.len());
            let (forces, torques) = pair(name, &shape, returned.bind(py))?;
            let vectors = |part: usize, value| {
                any_vectors("returned", &[out.len()], value)
                    .map_err(|error| error.with_names(&[("returned", &format!("{name}(t, states)[{part}]"))]))
            };
            let (forces, torques) = (vectors(0, &forces)?, vectors(1, &torques)?);
            let finite = forces.iter().chain(&torques).all(|v| v.iter().all(|x| x.is_finite()));
            check_returned(name, t, finite)?;
            let twists = forces.into_iter().zip(torques);
            Ok(twists.map(|(linear, angular)| Twist { linear, angular }).collect())
        });
        for (sum, wrench) in out.iter_mut().zip(wrenches) {
            sum.linear += wrench.linear;
            sum.angular += wrench.angular;
        }
    }
}

/// The states of several bodies as a list of `State`.
pub(crate) fn states_list<'py>(py: Python<'py>, x: &StateOf<Vec<Pose>>) -> PyResult<Bound<'py, PyList>> {
    PyList::new(py, (0..x.configuration.len()).filter_map(|i| x.body(i)).map(State))
}
