//! Surfaces, and Python callables in their place.

use crate::core::callable::{Failure, call, callable_name, check_callable, noted};
use crate::core::convert::{a_type, any_vector, vector, vector_array, vector_or};
use crate::core::error::Error;
use crate::core::value::{Pickled, brief, by_restore, value};
use pyo3::prelude::*;
use pyo3::types::PyType;
use somersault::contact::surface::{self, SignedDistance, Solid};
use somersault::integrators::nalgebra::Vector3;
use std::fmt;
use std::sync::Arc;

/// Base of the built-in surfaces, which are fixed in the world.
#[pyclass(frozen, subclass, module = "somersault.contact")]
pub(crate) struct Surface(pub(crate) Arc<dyn surface::Surface>);

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
    ///
    /// Examples
    /// --------
    /// >>> from somersault import contact
    /// >>> contact.HalfSpace().signed_distance((0.0, 0.0, 2.0))
    /// (2.0, array([0., 0., 1.]))
    fn signed_distance<'py>(
        &self,
        py: Python<'py>,
        point: &Bound<'py, PyAny>,
    ) -> Result<(f64, Bound<'py, PyAny>), Error> {
        let at = self.0.signed_distance(&vector("point", point)?);
        Ok((at.distance, vector_array(py, &at.gradient)))
    }

    fn __repr__(&self) -> String {
        format!("<Surface: {}>", brief(&format!("{:?}", self.0), 150))
    }
}

fn build<S, C>(surface: S, class: C) -> PyClassInitializer<C>
where
    S: surface::Surface + 'static,
    C: pyo3::PyClass<BaseType = Surface>,
{
    PyClassInitializer::from(Surface(Arc::new(surface))).add_subclass(class)
}

impl Surface {
    /// One of the library's.
    pub(crate) fn of(py: Python<'_>, surface: &Arc<dyn surface::Surface>) -> PyResult<Py<PyAny>> {
        match surface.as_half_space() {
            Some(plane) => {
                let (point, normal) = (plane.normal() * plane.offset(), *plane.normal());
                Ok(Py::new(py, build(*plane, HalfSpace { surface: *plane, point, normal }))?.into_any())
            }
            None => Ok(Py::new(py, Self(surface.clone()))?.into_any()),
        }
    }
}

fn solid_name(solid: Solid) -> &'static str {
    match solid {
        Solid::Inside => "inside",
        Solid::Outside => "outside",
    }
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
///
/// Examples
/// --------
/// A slope of 45°:
///
/// >>> from somersault import contact
/// >>> slope = contact.HalfSpace(normal=(1.0, 0.0, 1.0))
/// >>> round(slope.signed_distance((0.0, 0.0, 1.0))[0], 4)
/// 0.7071
#[pyclass(frozen, extends = Surface, module = "somersault.contact")]
pub(crate) struct HalfSpace {
    pub(crate) surface: surface::HalfSpace,
    point: Vector3<f64>,
    normal: Vector3<f64>,
}

value! {
    impl HalfSpace(point, normal) {
        /// ndarray, shape (3,): A point of the plane, m.
        point: Bound<'py, PyAny> = |own, py| vector_array(py, &own.point);
        /// ndarray, shape (3,): Outward normal, of the length that was given.
        normal: Bound<'py, PyAny> = |own, py| vector_array(py, &own.normal);
    }
}

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
        let surface = surface::HalfSpace::try_new(point, normal)?;
        Ok(build(surface, Self { surface, point, normal }))
    }

    fn __repr__(&self) -> String {
        format!("HalfSpace({:?}, {:?})", self.point.as_slice(), self.normal.as_slice())
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
///
/// Examples
/// --------
/// A bowl, and a point half a metre above its lowest one:
///
/// >>> from somersault import contact
/// >>> bowl = contact.SphericalSurface((0.0, 0.0, 2.0), 2.0, solid="outside")
/// >>> bowl.signed_distance((0.0, 0.0, 0.5))[0]
/// 0.5
#[pyclass(frozen, extends = Surface, module = "somersault.contact")]
pub(crate) struct SphericalSurface {
    center: Vector3<f64>,
    radius: f64,
    solid: Solid,
}

value! {
    impl SphericalSurface(center, radius, solid) {
        /// ndarray, shape (3,): Centre, m.
        center: Bound<'py, PyAny> = |own, py| vector_array(py, &own.center);
        /// float: Radius, m.
        radius: f64 = |own| own.radius;
        /// str: Which side is solid, ``'inside'`` or ``'outside'``.
        solid: &'static str = |own| solid_name(own.solid);
    }
}

#[pymethods]
impl SphericalSurface {
    #[new]
    #[pyo3(signature = (center, radius, solid="inside"))]
    fn new(center: &Bound<'_, PyAny>, radius: f64, solid: &str) -> Result<PyClassInitializer<Self>, Error> {
        let (center, solid) = (vector("center", center)?, solid_of(solid)?);
        let sphere = surface::SphericalSurface::try_new(center, radius, solid)?;
        Ok(build(sphere, Self { center, radius, solid }))
    }

    fn __repr__(&self) -> String {
        let (center, solid) = (self.center.as_slice(), self.solid());
        format!("SphericalSurface({center:?}, {:?}, solid='{solid}')", self.radius)
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
///
/// Examples
/// --------
/// >>> from somersault import contact
/// >>> pole = contact.CylindricalSurface((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), 0.5)
/// >>> pole.signed_distance((3.0, 0.0, 2.0))
/// (1.5, array([0., 0., 1.]))
#[pyclass(frozen, extends = Surface, module = "somersault.contact")]
pub(crate) struct CylindricalSurface {
    center: Vector3<f64>,
    axis: Vector3<f64>,
    radius: f64,
    solid: Solid,
}

value! {
    impl CylindricalSurface(center, axis, radius, solid) {
        /// ndarray, shape (3,): A point of the axis, m.
        center: Bound<'py, PyAny> = |own, py| vector_array(py, &own.center);
        /// ndarray, shape (3,): Direction of the axis, of the length that was given.
        axis: Bound<'py, PyAny> = |own, py| vector_array(py, &own.axis);
        /// float: Radius, m.
        radius: f64 = |own| own.radius;
        /// str: Which side is solid, ``'inside'`` or ``'outside'``.
        solid: &'static str = |own| solid_name(own.solid);
    }
}

#[pymethods]
impl CylindricalSurface {
    #[new]
    #[pyo3(signature = (center, axis, radius, solid="inside"))]
    fn new(
        center: &Bound<'_, PyAny>,
        axis: &Bound<'_, PyAny>,
        radius: f64,
        solid: &str,
    ) -> Result<PyClassInitializer<Self>, Error> {
        let (center, axis, solid) = (vector("center", center)?, vector("axis", axis)?, solid_of(solid)?);
        let cylinder = surface::CylindricalSurface::try_new(center, axis, radius, solid)?;
        Ok(build(cylinder, Self { center, axis, radius, solid }))
    }

    fn __repr__(&self) -> String {
        let (center, axis, solid) = (self.center.as_slice(), self.axis.as_slice(), self.solid());
        format!("CylindricalSurface({center:?}, {axis:?}, {:?}, solid='{solid}')", self.radius)
    }
}

/// A surface by a function, with what is known of how fast its distance changes.
///
/// Steps in flight are proved clear of a surface by the Lipschitz constant K of its distance, and near the surface
/// by a bound of its second derivative. A callable that is given to a contact as it is counts as a distance, with
/// K = 1 and no such bound. A gradient longer than K, anywhere on the way, and one that is zero, of the wrong sign,
/// not of length 1 or not the gradient of the distance where the surface is touched first are an `InputError`.
///
/// Parameters
/// ----------
/// function : callable
///     ``f(point) -> (distance, gradient)``: the signed distance of a point of the world, m, negative in the solid,
///     and its gradient.
/// lipschitz : float, optional
///     K with |f(p) − f(q)| ≤ K ‖p − q‖; 1 for a distance. A function that is a distance at its surface only may
///     rise faster elsewhere.
/// concavity : float, optional
///     κ ≥ 0, 1/m: the second derivative of the distance in every direction is at least −κ. 0 for a convex
///     obstacle; infinite unless given, which means that nothing is known. Then a hit shallower than `graze` of
///     `somersault.integrate` may be missed.
///
/// Examples
/// --------
/// >>> import numpy as np
/// >>> import somersault
/// >>> from somersault import contact
/// >>> def ball(point):
/// ...     away = np.linalg.norm(point)
/// ...     return away - 1.0, point / away
/// >>> surface = contact.SurfaceFunction(ball, concavity=0.0)
/// >>> touch = contact.Contact((0, 0, 0), surface, contact.CompliantLaw(1e4))
/// >>> touch.gap(somersault.State((0, 0, 1.5)))
/// (0.5, 0.0)
#[pyclass(frozen, module = "somersault.contact")]
pub(crate) struct SurfaceFunction {
    pub(crate) function: Py<PyAny>,
    pub(crate) lipschitz: f64,
    pub(crate) concavity: f64,
}

value! {
    impl SurfaceFunction {
        /// callable: The function.
        function: Py<PyAny> = |own, py| own.function.clone_ref(py);
        /// float: K.
        lipschitz: f64 = |own| own.lipschitz;
        /// float: κ, 1/m.
        concavity: f64 = |own| own.concavity;
    }
}

#[pymethods]
impl SurfaceFunction {
    #[new]
    #[pyo3(signature = (function, *, lipschitz=1.0, concavity=f64::INFINITY))]
    fn new(function: &Bound<'_, PyAny>, lipschitz: f64, concavity: f64) -> Result<Self, Error> {
        check_callable("function", "f(point) -> (distance, gradient)", function)?;
        if !(lipschitz.is_finite() && lipschitz > 0.0) {
            return Err(Error::input(format!("`lipschitz` must be positive and finite, found {lipschitz}")));
        }
        if concavity.is_nan() || concavity < 0.0 {
            return Err(Error::input(format!("`concavity` must not be negative, found {concavity}")));
        }
        Ok(Self { function: function.clone().unbind(), lipschitz, concavity })
    }

    fn __call__<'py>(&self, py: Python<'py>, point: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
        self.function.bind(py).call1((point,))
    }

    fn __repr__(&self, py: Python<'_>) -> PyResult<String> {
        let function = brief(&self.function.bind(py).repr()?.to_cow()?, 100);
        Ok(format!("SurfaceFunction({function}, lipschitz={}, concavity={})", self.lipschitz, self.concavity))
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> Pickled<'py> {
        let (py, own) = (slf.py(), slf.get());
        by_restore(slf, (own.function(py), own.lipschitz, own.concavity))
    }

    /// A pickled surface.
    #[classmethod]
    fn _restore(
        _: &Bound<'_, PyType>,
        function: &Bound<'_, PyAny>,
        lipschitz: f64,
        concavity: f64,
    ) -> Result<Self, Error> {
        Self::new(function, lipschitz, concavity)
    }
}

/// A callable ``f(point) -> (distance, gradient)``.
pub(crate) struct CallableSurface {
    callable: Py<PyAny>,
    name: String,
    failure: Failure,
    lipschitz: f64,
    concavity: f64,
}

impl CallableSurface {
    /// A callable or a [`SurfaceFunction`], for a run in which `failure` collects what Python code raises.
    pub(crate) fn new(surface: &Bound<'_, PyAny>, failure: &Failure) -> Self {
        let (callable, lipschitz, concavity) = match surface.cast::<SurfaceFunction>() {
            Ok(known) => {
                let known = known.get();
                (known.function(surface.py()), known.lipschitz, known.concavity)
            }
            Err(_) => (surface.clone().unbind(), 1.0, f64::INFINITY),
        };
        let name = callable_name(callable.bind(surface.py()));
        Self { callable, name, failure: failure.clone(), lipschitz, concavity }
    }
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
            let returned = self.callable.call1(py, (vector_array(py, point),));
            let returned = noted(py, returned, || {
                format!("the surface {} at the point {:?}", self.name, point.as_slice())
            })?;
            let returned = returned.bind(py);
            let (distance, gradient): (f64, Bound<'_, PyAny>) = returned.extract().map_err(|_| {
                Error::input(format!(
                    "`{}` must return a pair (distance, gradient), a number and numbers of shape (3,), found {}",
                    self.name,
                    a_type(returned)
                ))
            })?;
            let gradient = any_vector("returned", &gradient)
                .map_err(|error| error.with_names(&[("returned", &format!("{}(point)[1]", self.name))]))?;
            if !(distance.is_finite() && gradient.iter().all(|x| x.is_finite())) {
                return Err(Error::input(format!(
                    "`{}` returned a distance or gradient that is NaN or infinite at {:?}",
                    self.name,
                    point.as_slice()
                )));
            }
            Ok(SignedDistance { distance, gradient })
        })
    }
    fn lipschitz(&self) -> f64 {
        self.lipschitz
    }
    fn concavity(&self, _: &Vector3<f64>, _: f64) -> f64 {
        self.concavity
    }
}
