//! Surfaces, and Python callables in their place.

use crate::convert::{a_type, any_vector, vector, vector_array, vector_or};
use crate::error::Error;
use crate::forces::{Failure, call};
use pyo3::prelude::*;
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
pub(crate) struct HalfSpace(pub(crate) surface::HalfSpace);

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
        let half_space = surface::HalfSpace::try_new(point, normal)?;
        Ok(build(half_space, Self(half_space)))
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
