//! Contacts of bodies with surfaces and with each other.

use crate::contact::laws::{
    Resistance, friction_law, laws, normal_law, normal_law_repr, parts, resistance_law,
};
use crate::contact::surface::{CallableSurface, HalfSpace, Surface};
use crate::core::callable::Failure;
use crate::core::convert::{
    a_type, array, matrix_array, orientation, sequence, vector, vector_array, vector_or, with_shape,
};
use crate::core::error::Error;
use crate::core::value::{brief, value};
use crate::integrators::bodies::State;
use crate::integrators::forces::models::Reader;
use pyo3::prelude::*;
use pyo3::types::{PyTuple, PyType};
use somersault::contact::bodies::{self, BodyContacts, BodySphere};
use somersault::contact::contacts::{self, Contacts};
use somersault::contact::laws::{ContactLaw, Encounter};
use somersault::contact::shape::Shape;
use somersault::contact::surface;
use somersault::integrators::body::RigidBody;
use somersault::integrators::nalgebra::{UnitQuaternion, Vector3};
use std::sync::Arc;

/// A point of a body that touches a surface under some laws; by `ball`, `rim`, `capsule` and `box` one of those.
///
/// Parameters
/// ----------
/// point : array_like, shape (3,)
///     Point, body frame, from the centre of mass, m.
/// surface : Surface or callable
///     A surface, or ``f(point) -> (distance, gradient)``: the signed distance of a point of the world, negative in
///     the solid, and its gradient, of length 1. With p + 1 continuous derivatives it keeps an order p. A
///     `SurfaceFunction` says besides how fast the distance changes; a plain callable counts as a distance,
///     which changes by no more than the point moves.
/// law : CompliantLaw or HuntCrossley
///     Law of the normal force.
/// friction : CoulombFriction or RegularisedFriction, optional
///     Law of friction; none unless given.
/// resistance : Resistance, optional
///     Resistance to rolling and spinning; none unless given.
///
/// Examples
/// --------
/// >>> import somersault
/// >>> from somersault import contact
/// >>> friction = contact.CoulombFriction(0.5, 1e4, 20.0)
/// >>> foot = contact.Contact((0, 0, -0.5), contact.HalfSpace(), contact.CompliantLaw(1e4, 20.0), friction=friction)
/// >>> foot.gap(somersault.State((0, 0, 0.75)))
/// (0.25, 0.0)
#[pyclass(frozen, module = "somersault.contact")]
pub(crate) struct Contact {
    /// Where the surface is a callable this has another, which each run replaces.
    contact: contacts::Contact,
    surface: Py<PyAny>,
    /// Of a rim, as it was given.
    axis: Option<Vector3<f64>>,
}

/// Law, friction and resistance as a file has them.
pub(crate) type GivenLaws<'py> = (Bound<'py, PyAny>, Option<Bound<'py, PyAny>>, Option<Bound<'py, PyAny>>);

/// Point or centre, axis, radius, and ends, size and orientation, of those that a shape has, as a file has them.
type GivenShape<'py> = (
    Bound<'py, PyAny>,
    Option<Bound<'py, PyAny>>,
    Option<f64>,
    (Option<Bound<'py, PyAny>>, Option<Bound<'py, PyAny>>, Option<Bound<'py, PyAny>>),
);

/// What a contact is made against until it meets its surface.
fn built_in(surface: &Bound<'_, PyAny>) -> Result<Arc<dyn surface::Surface>, Error> {
    if let Ok(surface) = surface.cast::<Surface>() {
        return Ok(surface.get().0.clone());
    }
    if surface.is_callable() {
        return Ok(Arc::new(surface::HalfSpace::ground()));
    }
    Err(Error::input(format!(
        "`surface` must be a Surface or a callable f(point) -> (distance, gradient), found {}",
        a_type(surface)
    )))
}

impl Contact {
    /// One of the library's.
    pub(crate) fn of(py: Python<'_>, contact: &contacts::Contact) -> PyResult<Self> {
        let surface = Surface::of(py, contact.surface())?;
        Ok(Self::given(contact, surface.bind(py)))
    }

    /// One of the library's, against a surface as it was given.
    pub(crate) fn given(contact: &contacts::Contact, surface: &Bound<'_, PyAny>) -> Self {
        let axis = match contact.shape() {
            Shape::Rim { axis, .. } => Some(axis.into_inner()),
            Shape::Point(_) | Shape::Ball { .. } | Shape::Capsule { .. } | Shape::Box { .. } => None,
        };
        Self { contact: contact.clone(), surface: surface.clone().unbind(), axis }
    }

    /// A surface as it was given, of which a callable is not called.
    pub(crate) fn surface_given(surface: &Bound<'_, PyAny>) -> Result<Arc<dyn surface::Surface>, Error> {
        let known = built_in(surface)?;
        if surface.is_instance_of::<Surface>() {
            return Ok(known);
        }
        Ok(Arc::new(CallableSurface::new(surface, &Failure::default())))
    }

    /// What the laws see in a state of the body, but for its mass.
    fn encounter(&self, py: Python<'_>, state: &State) -> Result<Encounter, Error> {
        let failure = Failure::default();
        // Geometry does not depend on mass and inertia.
        let any = RigidBody::try_principal(1.0, Vector3::repeat(1.0))?;
        let at = self.contact(py, &failure).encounter(&any, &state.0);
        match failure.get() {
            Some(error) => Err(error.clone_ref(py).into()),
            None => Ok(at),
        }
    }

    pub(crate) fn is_built_in(&self, py: Python<'_>) -> bool {
        self.surface.bind(py).is_instance_of::<Surface>()
    }

    /// The contact, for a run in which `failure` collects what Python code raises.
    pub(crate) fn contact(&self, py: Python<'_>, failure: &Failure) -> contacts::Contact {
        let contact = self.contact.clone();
        if self.is_built_in(py) {
            return contact;
        }
        contact.against(Arc::new(CallableSurface::new(self.surface.bind(py), failure)))
    }
}

#[pymethods]
impl Contact {
    #[new]
    #[pyo3(signature = (point, surface, law, *, friction=None, resistance=None))]
    fn new(
        point: &Bound<'_, PyAny>,
        surface: &Bound<'_, PyAny>,
        law: &Bound<'_, PyAny>,
        friction: Option<&Bound<'_, PyAny>>,
        resistance: Option<&Bound<'_, PyAny>>,
    ) -> Result<Self, Error> {
        let against = built_in(surface)?;
        let law = laws(law, friction, resistance)?;
        let contact = contacts::Contact::try_new(vector("point", point)?, against, law)?;
        Ok(Self { contact, surface: surface.clone().unbind(), axis: None })
    }

    /// A ball fixed on a body, against any surface.
    ///
    /// Parameters
    /// ----------
    /// center : array_like, shape (3,)
    ///     Centre, body frame, m.
    /// radius : float
    ///     Radius, m.
    /// surface, law, friction, resistance
    ///     As of a point.
    ///
    /// Examples
    /// --------
    /// >>> import somersault
    /// >>> from somersault import contact
    /// >>> ball = contact.Contact.ball((0, 0, 0), 0.25, contact.HalfSpace(), contact.CompliantLaw(1e4))
    /// >>> ball.gap(somersault.State((0, 0, 1.0), velocity=(0, 0, -2.0)))
    /// (0.75, -2.0)
    #[staticmethod]
    #[pyo3(signature = (center, radius, surface, law, *, friction=None, resistance=None))]
    fn ball(
        center: &Bound<'_, PyAny>,
        radius: f64,
        surface: &Bound<'_, PyAny>,
        law: &Bound<'_, PyAny>,
        friction: Option<&Bound<'_, PyAny>>,
        resistance: Option<&Bound<'_, PyAny>>,
    ) -> Result<Self, Error> {
        let against = built_in(surface)?;
        let law = laws(law, friction, resistance)?;
        let contact = contacts::Contact::try_ball(vector("center", center)?, radius, against, law)?;
        Ok(Self { contact, surface: surface.clone().unbind(), axis: None })
    }

    /// The rim of a disk fixed on a body, against a plane.
    ///
    /// Parameters
    /// ----------
    /// center, axis : array_like, shape (3,)
    ///     Centre, m, and axis, of any length but zero, body frame.
    /// radius : float
    ///     Radius, m.
    /// plane : HalfSpace
    ///     The plane.
    /// law, friction, resistance
    ///     As of a point.
    ///
    /// Examples
    /// --------
    /// A disk that stands on its edge:
    ///
    /// >>> import somersault
    /// >>> from somersault import contact
    /// >>> rim = contact.Contact.rim((0, 0, 0), (0, 0, 1), 0.25, contact.HalfSpace(), contact.CompliantLaw(1e4))
    /// >>> upright = somersault.State((0, 0, 1.0), orientation=(0.5, 0.5, 0.5, 0.5))
    /// >>> round(rim.gap(upright)[0], 6)
    /// 0.75
    #[staticmethod]
    #[pyo3(signature = (center, axis, radius, plane, law, *, friction=None, resistance=None))]
    fn rim(
        center: &Bound<'_, PyAny>,
        axis: &Bound<'_, PyAny>,
        radius: f64,
        plane: &Bound<'_, PyAny>,
        law: &Bound<'_, PyAny>,
        friction: Option<&Bound<'_, PyAny>>,
        resistance: Option<&Bound<'_, PyAny>>,
    ) -> Result<Self, Error> {
        let half_space = plane
            .cast::<HalfSpace>()
            .map_err(|_| Error::input(format!("`plane` must be a HalfSpace, found {}", a_type(plane))))?;
        let law = laws(law, friction, resistance)?;
        let (center, axis) = (vector("center", center)?, vector("axis", axis)?);
        let contact = contacts::Contact::try_rim(center, axis, radius, half_space.get().surface, law)?;
        Ok(Self { contact, surface: plane.clone().unbind(), axis: Some(axis) })
    }

    /// A capsule fixed on a body, against a sphere or a cylinder that is seen from outside; without a radius an edge.
    ///
    /// It touches at the point of its segment nearest to the centre or the axis of the surface. Where that point reaches an end
    /// of the segment, the second derivative of the gap jumps; where the segment is parallel to the axis, the point is not
    /// unique. Against planes and from inside, only the balls at its ends touch.
    ///
    /// Parameters
    /// ----------
    /// ends : array_like, shape (2, 3)
    ///     Ends of its segment, body frame, m.
    /// radius : float
    ///     Radius, m; may be 0.
    /// surface : SphericalSurface or CylindricalSurface
    ///     The surface, whose inside is solid.
    /// law, friction, resistance
    ///     As of a point.
    ///
    /// Examples
    /// --------
    /// A pole across a log:
    ///
    /// >>> import somersault
    /// >>> from somersault import contact
    /// >>> log = contact.CylindricalSurface((0, 0, 0), (0, 1, 0), 0.3)
    /// >>> pole = contact.Contact.capsule([(-1, 0, 0), (1, 0, 0)], 0.05, log, contact.CompliantLaw(1e4))
    /// >>> round(pole.gap(somersault.State((0.5, 0, 0.4)))[0], 6)
    /// 0.05
    #[staticmethod]
    #[pyo3(signature = (ends, radius, surface, law, *, friction=None, resistance=None))]
    fn capsule(
        ends: &Bound<'_, PyAny>,
        radius: f64,
        surface: &Bound<'_, PyAny>,
        law: &Bound<'_, PyAny>,
        friction: Option<&Bound<'_, PyAny>>,
        resistance: Option<&Bound<'_, PyAny>>,
    ) -> Result<Self, Error> {
        let given = with_shape("ends", &[2, 3], ends)?;
        let ends = [Vector3::from_column_slice(&given[..3]), Vector3::from_column_slice(&given[3..])];
        let against = built_in(surface)?;
        let law = laws(law, friction, resistance)?;
        let contact = contacts::Contact::try_capsule(ends, radius, against, law)?;
        Ok(Self { contact, surface: surface.clone().unbind(), axis: None })
    }

    /// A box fixed on a body, against a sphere that is seen from outside.
    ///
    /// It touches at its point nearest to the centre of the sphere, on a face, an edge or a corner; where that changes, the second
    /// derivative of the gap jumps. Against planes and from inside, only its corners touch.
    ///
    /// Parameters
    /// ----------
    /// size : array_like, shape (3,)
    ///     Lengths of its edges, m.
    /// surface : SphericalSurface
    ///     The sphere, whose inside is solid.
    /// law : CompliantLaw or HuntCrossley
    ///     Law of the normal force.
    /// center : array_like, shape (3,), optional
    ///     Its centre, body frame, m; the centre of mass unless given.
    /// orientation : Rotation or array_like, shape (4,), optional
    ///     Rotation from its axes to those of the body; none unless given.
    /// friction, resistance
    ///     As of a point.
    ///
    /// Examples
    /// --------
    /// >>> import somersault
    /// >>> from somersault import contact
    /// >>> dome = contact.SphericalSurface((0, 0, 0), 1.0)
    /// >>> slab = contact.Contact.box((2.0, 2.0, 0.2), dome, contact.CompliantLaw(1e4))
    /// >>> round(slab.gap(somersault.State((0.5, 0, 1.15)))[0], 6)
    /// 0.05
    #[staticmethod]
    #[pyo3(signature = (size, surface, law, *, center=None, orientation=None, friction=None, resistance=None))]
    fn r#box(
        size: &Bound<'_, PyAny>,
        surface: &Bound<'_, PyAny>,
        law: &Bound<'_, PyAny>,
        center: Option<&Bound<'_, PyAny>>,
        orientation: Option<&Bound<'_, PyAny>>,
        friction: Option<&Bound<'_, PyAny>>,
        resistance: Option<&Bound<'_, PyAny>>,
    ) -> Result<Self, Error> {
        let turn = orientation
            .map_or(Ok(UnitQuaternion::identity()), |turn| self::orientation("orientation", turn))?;
        let place = (vector_or("center", center, Vector3::zeros())?, turn);
        let against = built_in(surface)?;
        let law = laws(law, friction, resistance)?;
        let contact = contacts::Contact::try_box(vector("size", size)?, place, against, law)?;
        Ok(Self { contact, surface: surface.clone().unbind(), axis: None })
    }

    /// ndarray, shape (3,): The point, or the centre of the ball, the rim, the capsule or the box, body frame, m.
    #[getter]
    fn point<'py>(&self, py: Python<'py>) -> Bound<'py, PyAny> {
        vector_array(py, self.contact.shape().centre())
    }

    /// Surface or callable: The surface.
    #[getter]
    pub(crate) fn surface(&self, py: Python<'_>) -> Py<PyAny> {
        self.surface.clone_ref(py)
    }

    /// CompliantLaw or HuntCrossley: The law of the normal force.
    #[getter]
    fn law<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        normal_law(py, self.contact.law())
    }

    /// CoulombFriction, RegularisedFriction or None: The law of friction.
    #[getter]
    fn friction<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyAny>>> {
        friction_law(py, self.contact.law())
    }

    /// Resistance or None: The resistance to rolling and spinning.
    #[getter]
    fn resistance<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, Resistance>>> {
        resistance_law(py, self.contact.law())
    }

    /// float or None: The radius of the ball, the rim or the capsule, m.
    #[getter]
    fn radius(&self) -> Option<f64> {
        match self.contact.shape() {
            Shape::Ball { radius, .. } | Shape::Rim { radius, .. } | Shape::Capsule { radius, .. } => {
                Some(*radius)
            }
            Shape::Point(_) | Shape::Box { .. } => None,
        }
    }

    /// ndarray, shape (2, 3), or None: The ends of the segment of the capsule, body frame, m.
    #[getter]
    fn ends<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyAny>>> {
        match self.contact.shape() {
            Shape::Capsule { centre, half, .. } => {
                let ends = [centre - half, centre + half];
                let numbers = ends.iter().flatten().copied().collect();
                Ok(Some(array(py, numbers, &[2, 3])?.into_any()))
            }
            Shape::Point(_) | Shape::Ball { .. } | Shape::Rim { .. } | Shape::Box { .. } => Ok(None),
        }
    }

    /// ndarray, shape (3,), or None: The lengths of the edges of the box, m.
    #[getter]
    fn size<'py>(&self, py: Python<'py>) -> Option<Bound<'py, PyAny>> {
        match self.contact.shape() {
            Shape::Box { half, .. } => Some(vector_array(py, &(half * 2.0))),
            Shape::Point(_) | Shape::Ball { .. } | Shape::Rim { .. } | Shape::Capsule { .. } => None,
        }
    }

    /// ndarray, shape (3, 3), or None: The rotation matrix from the axes of the box to those of the body.
    #[getter]
    fn orientation<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyAny>>> {
        match self.contact.shape() {
            Shape::Box { axes, .. } => matrix_array(py, axes).map(Some),
            Shape::Point(_) | Shape::Ball { .. } | Shape::Rim { .. } | Shape::Capsule { .. } => Ok(None),
        }
    }

    /// ndarray, shape (3,), or None: The axis of the rim, body frame.
    #[getter]
    fn axis<'py>(&self, py: Python<'py>) -> Option<Bound<'py, PyAny>> {
        self.axis.map(|axis| vector_array(py, &axis))
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
    ///
    /// Examples
    /// --------
    /// >>> import somersault
    /// >>> from somersault import contact
    /// >>> tip = contact.Contact((0, 0, -1.0), contact.HalfSpace(), contact.CompliantLaw(1e4))
    /// >>> tip.gap(somersault.State((0, 0, 1.5), velocity=(3.0, 0, -2.0)))
    /// (0.5, -2.0)
    fn gap(&self, py: Python<'_>, state: State) -> Result<(f64, f64), Error> {
        self.encounter(py, &state).map(|at| (at.gap, at.rate))
    }

    /// The point of contact in a state of the body, and the normal there.
    ///
    /// Parameters
    /// ----------
    /// state : State
    ///     The state.
    ///
    /// Returns
    /// -------
    /// point, normal : ndarray, shape (3,)
    ///     The point of the body that is nearest to the surface, m, and the unit vector along which it is pushed, world frame.
    ///
    /// Examples
    /// --------
    /// >>> import somersault
    /// >>> from somersault import contact
    /// >>> ball = contact.Contact.ball((0, 0, 0), 0.25, contact.HalfSpace(), contact.CompliantLaw(1e4))
    /// >>> point, normal = ball.touch(somersault.State((1.0, 0, 0.5)))
    /// >>> point, normal
    /// (array([1.  , 0.  , 0.25]), array([0., 0., 1.]))
    fn touch<'py>(
        &self,
        py: Python<'py>,
        state: State,
    ) -> Result<(Bound<'py, PyAny>, Bound<'py, PyAny>), Error> {
        let at = self.encounter(py, &state)?;
        Ok((vector_array(py, &at.point), vector_array(py, &at.normal)))
    }

    fn __repr__(&self, py: Python<'_>) -> PyResult<String> {
        let surface = brief(&self.surface.bind(py).repr()?.to_cow()?, 60);
        let law = brief(&normal_law_repr(py, self.contact.law())?, 60);
        Ok(format!("Contact({:?}, {surface}, {law})", self.contact.shape().centre().as_slice()))
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyTuple>)> {
        let (py, own) = (slf.py(), slf.get());
        let extent = (own.ends(py)?, own.size(py), own.orientation(py)?);
        let shape = (own.point(py), own.axis(py), own.radius(), extent);
        let arguments = (shape, own.surface(py), parts(py, own.contact.law())?);
        Ok((slf.get_type().getattr("_restore")?, arguments.into_pyobject(py)?))
    }

    /// A pickled contact.
    #[classmethod]
    fn _restore(
        _: &Bound<'_, PyType>,
        shape: GivenShape<'_>,
        surface: &Bound<'_, PyAny>,
        laws: GivenLaws<'_>,
    ) -> Result<Self, Error> {
        let (center, axis, radius, (ends, size, orientation)) = shape;
        let (law, friction, resistance) = (&laws.0, laws.1.as_ref(), laws.2.as_ref());
        if let Some(size) = size {
            let (center, orientation) = (Some(&center), orientation.as_ref());
            return Self::r#box(&size, surface, law, center, orientation, friction, resistance);
        }
        if let (Some(ends), Some(radius)) = (&ends, radius) {
            return Self::capsule(ends, radius, surface, law, friction, resistance);
        }
        match (axis, radius) {
            (Some(axis), Some(radius)) => {
                Self::rim(&center, &axis, radius, surface, law, friction, resistance)
            }
            (None, Some(radius)) => Self::ball(&center, radius, surface, law, friction, resistance),
            _ => Self::new(&center, surface, law, friction, resistance),
        }
    }
}

/// Two spheres fixed on two of several bodies, which touch under some laws.
///
/// Parameters
/// ----------
/// bodies : tuple of int
///     The two bodies, by their places among those integrated.
/// radii : tuple of float
///     Radii of the spheres, m.
/// law : CompliantLaw or HuntCrossley
///     Law of the normal force.
/// centers : tuple of array_like, shape (3,), optional
///     Centres of the spheres, each in the frame of its body, m; the centres of mass unless given.
/// friction : CoulombFriction or RegularisedFriction, optional
///     Law of friction; none unless given.
/// resistance : Resistance, optional
///     Resistance to rolling and spinning; none unless given.
///
/// Examples
/// --------
/// A ball hits an equal one at rest, and they exchange their velocities:
///
/// >>> import somersault
/// >>> from somersault import contact
/// >>> ball = somersault.RigidBody.sphere(1.0, 0.1)
/// >>> states = [somersault.State(velocity=(1.0, 0, 0)), somersault.State((0.5, 0, 0))]
/// >>> pair = contact.SpherePair((0, 1), (0.1, 0.1), contact.CompliantLaw(1e5))
/// >>> motion = somersault.integrate([ball, ball], states, (0.0, 0.5), dt=1e-3, pairs=pair)
/// >>> [round(float(speed), 2) for speed in motion.velocity[-1, :, 0]]
/// [0.0, 1.0]
#[pyclass(frozen, from_py_object, module = "somersault.contact")]
#[derive(Clone)]
pub(crate) struct SpherePair {
    pair: bodies::SpherePair,
    bodies: [usize; 2],
    radii: [f64; 2],
    centers: [Vector3<f64>; 2],
    law: ContactLaw,
}

value! {
    impl SpherePair {
        /// tuple of int: The two bodies.
        bodies: (usize, usize) = |own| own.bodies.into();
        /// tuple of float: Radii of the spheres, m.
        radii: (f64, f64) = |own| own.radii.into();
        /// tuple of ndarray, shape (3,): Centres of the spheres, each in the frame of its body, m.
        centers: (Bound<'py, PyAny>, Bound<'py, PyAny>) =
            |own, py| own.centers.map(|center| vector_array(py, &center)).into();
        /// CompliantLaw or HuntCrossley: The law of the normal force.
        law: PyResult<Bound<'py, PyAny>> = |own, py| normal_law(py, &own.law);
        /// CoulombFriction, RegularisedFriction or None: The law of friction.
        friction: PyResult<Option<Bound<'py, PyAny>>> = |own, py| friction_law(py, &own.law);
        /// Resistance or None: The resistance to rolling and spinning.
        resistance: PyResult<Option<Bound<'py, Resistance>>> = |own, py| resistance_law(py, &own.law);
    }
}

#[pymethods]
impl SpherePair {
    #[new]
    #[pyo3(signature = (bodies, radii, law, *, centers=None, friction=None, resistance=None))]
    fn new(
        bodies: [usize; 2],
        radii: [f64; 2],
        law: &Bound<'_, PyAny>,
        centers: Option<[Bound<'_, PyAny>; 2]>,
        friction: Option<&Bound<'_, PyAny>>,
        resistance: Option<&Bound<'_, PyAny>>,
    ) -> Result<Self, Error> {
        let center = |i: usize| vector_or("centers", centers.as_ref().map(|c| &c[i]), Vector3::zeros());
        let centers = [center(0)?, center(1)?];
        let sphere = |i: usize| BodySphere::try_new(bodies[i], centers[i], radii[i]);
        let law = laws(law, friction, resistance)?;
        let pair = bodies::SpherePair::try_new(sphere(0)?, sphere(1)?, law.clone())?;
        Ok(Self { pair, bodies, radii, centers, law })
    }

    fn __repr__(&self, py: Python<'_>) -> PyResult<String> {
        let ([i, k], [r, s]) = (self.bodies, self.radii);
        Ok(format!("SpherePair(({i}, {k}), ({r:?}, {s:?}), {})", brief(&normal_law_repr(py, &self.law)?, 60)))
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyTuple>)> {
        let (py, own) = (slf.py(), slf.get());
        let spheres = (own.bodies(), own.radii(), own.centers(py));
        let arguments = (spheres, parts(py, &own.law)?).into_pyobject(py)?;
        Ok((slf.get_type().getattr("_restore")?, arguments))
    }

    /// A pickled pair.
    #[classmethod]
    fn _restore(
        _: &Bound<'_, PyType>,
        spheres: ([usize; 2], [f64; 2], [Bound<'_, PyAny>; 2]),
        laws: GivenLaws<'_>,
    ) -> Result<Self, Error> {
        let (bodies, radii, centers) = spheres;
        Self::new(bodies, radii, &laws.0, Some(centers), laws.1.as_ref(), laws.2.as_ref())
    }
}

impl Reader {
    fn contact(&mut self, argument: &str, value: &Bound<'_, PyAny>) -> Result<contacts::Contact, Error> {
        let py = value.py();
        let contact = value
            .cast::<Contact>()
            .map_err(|_| Error::input(format!("`{argument}` must hold contacts, found {}", a_type(value))))?;
        self.calls_python |= !contact.get().is_built_in(py);
        Ok(contact.get().contact(py, &self.failure))
    }

    fn some_contacts(
        &mut self,
        argument: &str,
        value: &Bound<'_, PyAny>,
    ) -> Result<Vec<contacts::Contact>, Error> {
        match sequence(value) {
            Some(list) => list.try_iter()?.map(|contact| self.contact(argument, &contact?)).collect(),
            None if value.is_none() => Ok(Vec::new()),
            None => Ok(vec![self.contact(argument, value)?]),
        }
    }

    /// The contacts of a body: one, several or none.
    pub(crate) fn contacts(&mut self, argument: &str, value: &Bound<'_, PyAny>) -> Result<Contacts, Error> {
        Ok(Contacts::new(self.some_contacts(argument, value)?))
    }

    /// The contacts of several bodies: an entry for each with surfaces, and pairs of spheres.
    pub(crate) fn body_contacts(
        &mut self,
        count: usize,
        contacts: Option<&Bound<'_, PyAny>>,
        pairs: Option<&Bound<'_, PyAny>>,
    ) -> Result<BodyContacts, Error> {
        let mut on_surfaces = Vec::new();
        if let Some(value) = contacts {
            let wrong = |found: String| {
                Error::input(format!(
                    "`contacts` must have an entry for each of {count} bodies, found {found}"
                ))
            };
            let list = sequence(value).ok_or_else(|| wrong(a_type(value)))?;
            if list.len()? != count {
                return Err(wrong(format!("{} entries", list.len()?)));
            }
            for (body, entry) in list.try_iter()?.enumerate() {
                let found = self.some_contacts("contacts", &entry?)?;
                on_surfaces.extend(found.into_iter().map(|contact| (body, contact)));
            }
        }
        let wrong = |value: &Bound<'_, PyAny>| {
            Error::input(format!("`pairs` must hold sphere pairs, found {}", a_type(value)))
        };
        let one = |value: &Bound<'_, PyAny>| match value.extract() {
            Ok(SpherePair { pair, .. }) => Ok(pair),
            Err(_) => Err(wrong(value)),
        };
        let pairs = match pairs {
            None => Vec::new(),
            Some(value) => match sequence(value) {
                Some(list) => list.try_iter()?.map(|pair| one(&pair?)).collect::<Result<_, _>>()?,
                None => vec![one(value)?],
            },
        };
        Ok(BodyContacts::try_new(count, on_surfaces, pairs)?)
    }
}
