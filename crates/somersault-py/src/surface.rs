//! Surfaces, and Python callables in their place.

use crate::convert::{a_type, any_vector, vector, vector_array, vector_or};
use crate::error::Error;
use crate::forces::{Failure, call};
use pyo3::prelude::*;
use pyo3::types::{PyTuple, PyType};
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
#[pyclass(frozen, extends = Surface, module = "somersault.contact")]
pub(crate) struct HalfSpace {
    pub(crate) surface: surface::HalfSpace,
    point: Vector3<f64>,
    normal: Vector3<f64>,
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

    /// ndarray, shape (3,): A point of the plane, m.
    #[getter]
    fn point<'py>(&self, py: Python<'py>) -> Bound<'py, PyAny> {
        vector_array(py, &self.point)
    }

    /// ndarray, shape (3,): Outward normal, of the length that was given.
    #[getter]
    fn normal<'py>(&self, py: Python<'py>) -> Bound<'py, PyAny> {
        vector_array(py, &self.normal)
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<(Bound<'py, PyType>, Bound<'py, PyTuple>)> {
        let (py, own) = (slf.py(), slf.get());
        Ok((slf.get_type(), (own.point(py), own.normal(py)).into_pyobject(py)?))
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
pub(crate) struct Sphere {
    center: Vector3<f64>,
    radius: f64,
    solid: Solid,
}

#[pymethods]
impl Sphere {
    #[new]
    #[pyo3(signature = (center, radius, solid="inside"))]
    fn new(center: &Bound<'_, PyAny>, radius: f64, solid: &str) -> Result<PyClassInitializer<Self>, Error> {
        let (center, solid) = (vector("center", center)?, solid_of(solid)?);
        let sphere = surface::Sphere::try_new(center, radius, solid)?;
        Ok(build(sphere, Self { center, radius, solid }))
    }

    /// ndarray, shape (3,): Centre, m.
    #[getter]
    fn center<'py>(&self, py: Python<'py>) -> Bound<'py, PyAny> {
        vector_array(py, &self.center)
    }

    /// float: Radius, m.
    #[getter]
    fn radius(&self) -> f64 {
        self.radius
    }

    /// str: Which side is solid, ``'inside'`` or ``'outside'``.
    #[getter]
    fn solid(&self) -> &'static str {
        solid_name(self.solid)
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<(Bound<'py, PyType>, Bound<'py, PyTuple>)> {
        let (py, own) = (slf.py(), slf.get());
        Ok((slf.get_type(), (own.center(py), own.radius(), own.solid()).into_pyobject(py)?))
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
pub(crate) struct Cylinder {
    center: Vector3<f64>,
    axis: Vector3<f64>,
    radius: f64,
    solid: Solid,
}

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
        let (center, axis, solid) = (vector("center", center)?, vector("axis", axis)?, solid_of(solid)?);
        let cylinder = surface::Cylinder::try_new(center, axis, radius, solid)?;
        Ok(build(cylinder, Self { center, axis, radius, solid }))
    }

    /// ndarray, shape (3,): A point of the axis, m.
    #[getter]
    fn center<'py>(&self, py: Python<'py>) -> Bound<'py, PyAny> {
        vector_array(py, &self.center)
    }

    /// ndarray, shape (3,): Direction of the axis, of the length that was given.
    #[getter]
    fn axis<'py>(&self, py: Python<'py>) -> Bound<'py, PyAny> {
        vector_array(py, &self.axis)
    }

    /// float: Radius, m.
    #[getter]
    fn radius(&self) -> f64 {
        self.radius
    }

    /// str: Which side is solid, ``'inside'`` or ``'outside'``.
    #[getter]
    fn solid(&self) -> &'static str {
        solid_name(self.solid)
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<(Bound<'py, PyType>, Bound<'py, PyTuple>)> {
        let (py, own) = (slf.py(), slf.get());
        Ok((slf.get_type(), (own.center(py), own.axis(py), own.radius(), own.solid()).into_pyobject(py)?))
    }
}

/// A callable ``f(point) -> (distance, gradient)``.
pub(crate) struct CallableSurface {
    pub(crate) callable: Py<PyAny>,
    pub(crate) name: String,
    pub(crate) failure: Failure,
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
