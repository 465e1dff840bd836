//! Contacts of a body: laws, surfaces, and Python callables in the place of surfaces.

use crate::bodies::{RigidBody, State};
use crate::convert::{a_type, any_vector, finite, vector, vector_array, vector_or};
use crate::error::Error;
use crate::forces::{Failure, Gravity, Reader, call, callable_name, sequence};
use pyo3::prelude::*;
use somersault::contact::contacts;
use somersault::contact::law;
use somersault::contact::models;
use somersault::contact::surface::{self, SignedDistance, Solid};
use somersault::integrators::nalgebra::Vector3;
use std::fmt;
use std::sync::Arc;

/// Spring and damper that push and never pull (thesis 7.10).
///
/// With the gap x, negative inside the surface, F = −k x − c ẋ where x < 0 and k x + c ẋ < 0, else F = 0.
///
/// Parameters
/// ----------
/// stiffness : float
///     k > 0, N/m.
/// damping : float, optional
///     c ≥ 0, N s/m.
///
/// Raises
/// ------
/// ContactError
///     If a constant is not one that the law can have.
///
/// Examples
/// --------
/// >>> from somersault.contact import CompliantLaw
/// >>> law = CompliantLaw.from_restitution(1.0, 1e4, 0.5)
/// >>> round(law.restitution(1.0), 12)
/// 0.5
#[pyclass(frozen, eq, from_py_object, module = "somersault.contact")]
#[derive(Clone, Copy, PartialEq)]
pub(crate) struct CompliantLaw(law::CompliantLaw);

#[pymethods]
impl CompliantLaw {
    #[new]
    #[pyo3(signature = (stiffness, damping=0.0))]
    fn new(stiffness: f64, damping: f64) -> Result<Self, Error> {
        Ok(Self(law::CompliantLaw::try_new(stiffness, damping)?))
    }

    /// From what a mass does on the contact: k = m ωₙ², c = 2 m ωₙ ζ.
    ///
    /// Parameters
    /// ----------
    /// mass : float
    ///     Mass, kg.
    /// frequency : float
    ///     Natural frequency ωₙ, rad/s.
    /// damping_ratio : float
    ///     ζ ≥ 0.
    #[staticmethod]
    fn from_frequency(mass: f64, frequency: f64, damping_ratio: f64) -> Result<Self, Error> {
        Ok(Self(law::CompliantLaw::from_frequency(mass, frequency, damping_ratio)?))
    }

    /// From the coefficient of restitution of a central impact under no other force.
    ///
    /// Parameters
    /// ----------
    /// effective_mass : float
    ///     Mass that the contact moves, kg.
    /// stiffness : float
    ///     k, N/m.
    /// restitution : float
    ///     0 < e ≤ 1.
    #[staticmethod]
    fn from_restitution(effective_mass: f64, stiffness: f64, restitution: f64) -> Result<Self, Error> {
        Ok(Self(law::CompliantLaw::from_restitution(effective_mass, stiffness, restitution)?))
    }

    /// float: k, N/m.
    #[getter]
    fn stiffness(&self) -> f64 {
        self.0.stiffness()
    }

    /// float: c, N s/m.
    #[getter]
    fn damping(&self) -> f64 {
        self.0.damping()
    }

    /// Coefficient of restitution of a central impact under no other force.
    ///
    /// Parameters
    /// ----------
    /// effective_mass : float
    ///     Mass that the contact moves, kg.
    ///
    /// Returns
    /// -------
    /// float
    fn restitution(&self, effective_mass: f64) -> Result<f64, Error> {
        Ok(self.0.restitution(effective_mass)?)
    }

    /// The force, N.
    ///
    /// Parameters
    /// ----------
    /// gap, rate : float
    ///     Gap, m, and its rate, m/s.
    ///
    /// Returns
    /// -------
    /// float
    fn force(&self, gap: f64, rate: f64) -> Result<f64, Error> {
        Ok(self.0.force(finite("gap", gap)?, finite("rate", rate)?))
    }

    /// Energy of the spring, J.
    ///
    /// Parameters
    /// ----------
    /// gap : float
    ///     Gap, m.
    ///
    /// Returns
    /// -------
    /// float
    fn energy(&self, gap: f64) -> Result<f64, Error> {
        Ok(self.0.energy(finite("gap", gap)?))
    }

    fn __repr__(&self) -> String {
        format!("CompliantLaw({:?}, damping={:?})", self.0.stiffness(), self.0.damping())
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> (Bound<'py, pyo3::types::PyType>, (f64, f64)) {
        (slf.get_type(), (slf.get().stiffness(), slf.get().damping()))
    }
}

/// Coefficient of restitution at a damping ratio ζ ≥ 0, where contact ends as the force returns to zero.
///
/// e = exp(−2 ζ arccos ζ/√(1 − ζ²)), continued through ζ = 1.
///
/// Parameters
/// ----------
/// damping_ratio : float
///     ζ.
///
/// Returns
/// -------
/// float
#[pyfunction]
pub(crate) fn restitution(damping_ratio: f64) -> Result<f64, Error> {
    Ok(law::restitution(damping_ratio)?)
}

/// The damping ratio that gives a coefficient of restitution 0 < e ≤ 1; the inverse of `restitution`.
///
/// Parameters
/// ----------
/// restitution : float
///     e.
///
/// Returns
/// -------
/// float
#[pyfunction]
pub(crate) fn damping_ratio(restitution: f64) -> Result<f64, Error> {
    Ok(law::damping_ratio(restitution)?)
}

/// Base of the built-in surfaces, which are fixed in the world.
#[pyclass(frozen, subclass, module = "somersault.contact")]
pub(crate) struct Surface(Arc<dyn surface::Surface>);

#[pymethods]
impl Surface {
    /// Signed distance, negative in the solid, and its gradient.
    ///
    /// Parameters
    /// ----------
    /// point : array_like, shape (3,)
    ///     Point, m.
    ///
    /// Returns
    /// -------
    /// distance : float
    ///     Distance, m.
    /// gradient : ndarray, shape (3,)
    ///     Outward normal, along which the surface pushes.
    fn signed_distance<'py>(
        &self,
        py: Python<'py>,
        point: &Bound<'py, PyAny>,
    ) -> Result<(f64, Bound<'py, PyAny>), Error> {
        let at = self.0.signed_distance(&vector("point", point)?);
        Ok((at.distance, vector_array(py, &at.gradient)))
    }

    fn __repr__(&self) -> String {
        format!("<{:?}>", self.0)
    }
}

fn build<S, C>(surface: S, class: C) -> PyClassInitializer<C>
where
    S: surface::Surface + 'static,
    C: pyo3::PyClass<BaseType = Surface>,
{
    PyClassInitializer::from(Surface(Arc::new(surface))).add_subclass(class)
}

fn solid_of(name: &str) -> Result<Solid, Error> {
    match name {
        "inside" => Ok(Solid::Inside),
        "outside" => Ok(Solid::Outside),
        _ => Err(Error::input(format!("`solid` must be 'inside' or 'outside', found '{name}'"))),
    }
}

/// The solid below a plane.
///
/// Parameters
/// ----------
/// point : array_like, shape (3,), optional
///     A point of the plane, m; the origin unless given.
/// normal : array_like, shape (3,), optional
///     Outward normal, of any length but zero; along z unless given.
#[pyclass(frozen, extends = Surface, module = "somersault.contact")]
pub(crate) struct HalfSpace;

#[pymethods]
impl HalfSpace {
    #[new]
    #[pyo3(signature = (point=None, normal=None))]
    fn new(
        point: Option<&Bound<'_, PyAny>>,
        normal: Option<&Bound<'_, PyAny>>,
    ) -> Result<PyClassInitializer<Self>, Error> {
        let point = vector_or("point", point, Vector3::zeros())?;
        let normal = vector_or("normal", normal, Vector3::z())?;
        Ok(build(surface::HalfSpace::try_new(point, normal)?, Self))
    }
}

/// A sphere.
///
/// Parameters
/// ----------
/// center : array_like, shape (3,)
///     Centre, m.
/// radius : float
///     Radius, m.
/// solid : {'inside', 'outside'}, optional
///     Which side is solid; bodies move within a sphere whose outside is.
#[pyclass(frozen, extends = Surface, module = "somersault.contact")]
pub(crate) struct Sphere;

#[pymethods]
impl Sphere {
    #[new]
    #[pyo3(signature = (center, radius, solid="inside"))]
    fn new(center: &Bound<'_, PyAny>, radius: f64, solid: &str) -> Result<PyClassInitializer<Self>, Error> {
        let sphere = surface::Sphere::try_new(vector("center", center)?, radius, solid_of(solid)?)?;
        Ok(build(sphere, Self))
    }
}

/// An infinite circular cylinder.
///
/// Parameters
/// ----------
/// center : array_like, shape (3,)
///     A point of the axis, m.
/// axis : array_like, shape (3,)
///     Direction of the axis, of any length but zero.
/// radius : float
///     Radius, m.
/// solid : {'inside', 'outside'}, optional
///     Which side is solid; bodies move within a cylinder whose outside is.
#[pyclass(frozen, extends = Surface, module = "somersault.contact")]
pub(crate) struct Cylinder;

#[pymethods]
impl Cylinder {
    #[new]
    #[pyo3(signature = (center, axis, radius, solid="inside"))]
    fn new(
        center: &Bound<'_, PyAny>,
        axis: &Bound<'_, PyAny>,
        radius: f64,
        solid: &str,
    ) -> Result<PyClassInitializer<Self>, Error> {
        let (center, axis) = (vector("center", center)?, vector("axis", axis)?);
        Ok(build(surface::Cylinder::try_new(center, axis, radius, solid_of(solid)?)?, Self))
    }
}

/// A callable ``f(point) -> (distance, gradient)``.
struct CallableSurface {
    callable: Py<PyAny>,
    name: String,
    failure: Failure,
}

impl fmt::Debug for CallableSurface {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.name)
    }
}

impl surface::Surface for CallableSurface {
    fn signed_distance(&self, point: &Vector3<f64>) -> SignedDistance {
        let nan = SignedDistance { distance: f64::NAN, gradient: Vector3::repeat(f64::NAN) };
        call(&self.failure, nan, |py| {
            let returned = self.callable.call1(py, (vector_array(py, point),))?;
            let returned = returned.bind(py);
            let (distance, gradient): (f64, Bound<'_, PyAny>) = returned.extract().map_err(|_| {
                Error::input(format!(
                    "`{}` must return a pair (distance, gradient), a number and numbers of shape (3,), found {}",
                    self.name,
                    a_type(returned)
                ))
            })?;
            let gradient = any_vector(&format!("{}(point)[1]", self.name), &gradient)?;
            if !(distance.is_finite() && gradient.iter().all(|x| x.is_finite())) {
                return Err(Error::surface(format!(
                    "`{}` returned a distance or gradient that is NaN or infinite at {:?}",
                    self.name,
                    point.as_slice()
                )));
            }
            Ok(SignedDistance { distance, gradient })
        })
    }
}

/// A point of a body that touches a surface under a law.
///
/// Parameters
/// ----------
/// point : array_like, shape (3,)
///     Point, body frame, from the centre of mass, m.
/// surface : Surface or callable
///     A surface, or ``f(point) -> (distance, gradient)`` for one of your own: the signed distance of a
///     point of the world, negative in the solid, and its gradient. With p + 1 continuous derivatives
///     it keeps an order p.
/// law : CompliantLaw
///     The law.
#[pyclass(frozen, module = "somersault.contact")]
pub(crate) struct Contact {
    point: Vector3<f64>,
    surface: Py<PyAny>,
    law: CompliantLaw,
}

impl Contact {
    fn of(
        py: Python<'_>,
        point: Vector3<f64>,
        surface: impl surface::Surface + 'static,
        law: law::CompliantLaw,
    ) -> PyResult<Self> {
        let surface = Py::new(py, Surface(Arc::new(surface)))?.into_any();
        Ok(Self { point, surface, law: CompliantLaw(law) })
    }

    /// The contact, for a run in which `failure` collects what Python code raises.
    fn contact(&self, py: Python<'_>, failure: &Failure) -> Result<contacts::Contact, Error> {
        let surface = self.surface.bind(py);
        let surface = match surface.cast::<Surface>() {
            Ok(surface) => surface.get().0.clone(),
            Err(_) => Arc::new(CallableSurface {
                callable: self.surface.clone_ref(py),
                name: callable_name(surface),
                failure: failure.clone(),
            }),
        };
        Ok(contacts::Contact::try_new(self.point, surface, self.law.0)?)
    }
}

#[pymethods]
impl Contact {
    #[new]
    fn new(
        point: &Bound<'_, PyAny>,
        surface: &Bound<'_, PyAny>,
        law: &Bound<'_, PyAny>,
    ) -> Result<Self, Error> {
        if !(surface.is_instance_of::<Surface>() || surface.is_callable()) {
            return Err(Error::input(format!(
                "`surface` must be a Surface or a callable f(point) -> (distance, gradient), found {}",
                a_type(surface)
            )));
        }
        let law = law
            .extract()
            .map_err(|_| Error::input(format!("`law` must be a CompliantLaw, found {}", a_type(law))))?;
        Ok(Self { point: vector("point", point)?, surface: surface.clone().unbind(), law })
    }

    /// ndarray, shape (3,): The point, body frame, m.
    #[getter]
    fn point<'py>(&self, py: Python<'py>) -> Bound<'py, PyAny> {
        vector_array(py, &self.point)
    }

    /// Surface or callable: The surface.
    #[getter]
    fn surface(&self, py: Python<'_>) -> Py<PyAny> {
        self.surface.clone_ref(py)
    }

    /// CompliantLaw: The law.
    #[getter]
    fn law(&self) -> CompliantLaw {
        self.law
    }

    /// Gap and its rate in a state of the body.
    ///
    /// Parameters
    /// ----------
    /// state : State
    ///     The state.
    ///
    /// Returns
    /// -------
    /// gap, rate : float
    ///     Gap, m, negative inside the surface, and its rate, m/s.
    fn gap(&self, py: Python<'_>, state: State) -> Result<(f64, f64), Error> {
        let failure = Failure::default();
        let guard = self.contact(py, &failure)?.guard(&state.0);
        match failure.get() {
            Some(error) => Err(error.clone_ref(py).into()),
            None => Ok((guard.gap, guard.rate)),
        }
    }

    fn __repr__(&self, py: Python<'_>) -> PyResult<String> {
        let surface = self.surface.bind(py).repr()?;
        Ok(format!("Contact({:?}, {surface}, {})", self.point.as_slice(), self.law.__repr__()))
    }
}

impl Reader {
    /// The contacts of a body: one, several or none.
    pub(crate) fn contacts(
        &mut self,
        argument: &str,
        value: &Bound<'_, PyAny>,
    ) -> Result<contacts::Contacts, Error> {
        let py = value.py();
        let mut one = |value: &Bound<'_, PyAny>| {
            let contact = value.cast::<Contact>().map_err(|_| {
                Error::input(format!("`{argument}` must hold contacts, found {}", a_type(value)))
            })?;
            self.calls_python |= !contact.get().surface.bind(py).is_instance_of::<Surface>();
            contact.get().contact(py, &self.failure)
        };
        let list = match sequence(value) {
            Some(list) => list.try_iter()?.map(|contact| one(&contact?)).collect::<Result<_, Error>>()?,
            None => vec![one(value)?],
        };
        Ok(contacts::Contacts::new(list))
    }
}

/// A body, its state at the start, and what acts on it: arguments of `somersault.integrate`.
#[pyclass(frozen, get_all, module = "somersault.contact")]
pub(crate) struct Scene {
    /// RigidBody: The body.
    body: RigidBody,
    /// State: Its state at the start.
    state: State,
    /// Gravity: Its weight.
    forces: Py<Gravity>,
    /// list of Contact: Its contacts.
    contacts: Vec<Py<Contact>>,
}

impl Scene {
    fn of(
        py: Python<'_>,
        body: somersault::integrators::body::RigidBody,
        state: somersault::integrators::state::RigidBodyState,
        contact: Contact,
    ) -> Result<Self, Error> {
        Ok(Self {
            body: RigidBody(body),
            state: State(state),
            forces: Gravity::earth(py)?,
            contacts: vec![Py::new(py, contact)?],
        })
    }
}

#[pymethods]
impl Scene {
    fn __repr__(&self) -> String {
        format!("<Scene: a body of {} kg, {} contacts>", self.body.0.mass(), self.contacts.len())
    }
}

/// A ball above the ground z = 0, under weight; frictionless.
///
/// Parameters
/// ----------
/// mass, radius : float
///     Mass, kg, and radius, m.
/// law : CompliantLaw
///     Law of its contact.
/// height : float
///     Height of its lowest point at the start, m.
/// velocity : float, optional
///     Velocity at the start, upwards, m/s.
///
/// Returns
/// -------
/// Scene
#[pyfunction]
#[pyo3(signature = (mass, radius, law, height, velocity=0.0))]
pub(crate) fn bouncing_ball(
    py: Python<'_>,
    mass: f64,
    radius: f64,
    law: CompliantLaw,
    height: f64,
    velocity: f64,
) -> Result<Scene, Error> {
    let ball = models::BouncingBall::try_new(mass, radius, law.0)?;
    let state = ball.at(finite("height", height)?, finite("velocity", velocity)?);
    let ground = surface::HalfSpace::try_new(Vector3::new(0.0, 0.0, radius), Vector3::z())?;
    let contact = Contact::of(py, Vector3::zeros(), ground, law.0)?;
    Scene::of(py, ball.system.body, state, contact)
}

/// The spinning top of thesis 7.3.2: a disk with a tip, on frictionless ground.
///
/// Returns
/// -------
/// Scene
#[pyfunction]
pub(crate) fn spinning_top(py: Python<'_>) -> Result<Scene, Error> {
    let top = models::SpinningTop::thesis()?;
    let tip = &top.system.forces.1[0];
    let contact = Contact::of(py, *tip.point(), surface::HalfSpace::ground(), *tip.law())?;
    Scene::of(py, top.system.body, top.start, contact)
}
