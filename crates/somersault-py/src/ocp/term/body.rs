//! Where a body is and how it is turned.

use super::{Description, Term};
use crate::core::convert::{components, orientation, vector, vector_or};
use crate::core::error::Error;
use pyo3::prelude::*;
use pyo3::types::PyTuple;
use somersault::integrators::nalgebra::{UnitQuaternion, Vector3};
use somersault::ocp::dynamics::Tree;
use somersault::ocp::term;
use somersault::ocp::transcription::NodeSizes;

struct PointPosition {
    body: String,
    point: Vector3<f64>,
}

impl Description for PointPosition {
    fn made<'py>(&self, py: Python<'py>) -> PyResult<(&'static str, Bound<'py, PyTuple>)> {
        Ok(("point_position", (&self.body, self.point.as_slice().to_vec()).into_pyobject(py)?))
    }

    fn what(&self) -> &'static str {
        "point position"
    }

    fn build(&self, _: Python<'_>, dynamics: &Tree, _: &NodeSizes) -> Result<Box<dyn term::Term>, Error> {
        Ok(Box::new(term::PointPosition::try_new(dynamics.model().clone(), &self.body, self.point)?))
    }
}

/// Position of a point of a body in the world, m.
///
/// Parameters
/// ----------
/// body : str
/// point : array_like, shape (3,), optional
///     In the axes of the body, m; its origin unless given.
///
/// Returns
/// -------
/// Term
#[pyfunction]
#[pyo3(signature = (body, point=None))]
pub(crate) fn point_position(body: String, point: Option<&Bound<'_, PyAny>>) -> Result<Term, Error> {
    let point = vector_or("point", point, Vector3::zeros())?;
    Ok(Term::of(PointPosition { body, point }))
}

struct AxisDirection {
    body: String,
    axis: Vector3<f64>,
}

impl Description for AxisDirection {
    fn made<'py>(&self, py: Python<'py>) -> PyResult<(&'static str, Bound<'py, PyTuple>)> {
        Ok(("axis_direction", (&self.body, self.axis.as_slice().to_vec()).into_pyobject(py)?))
    }

    fn what(&self) -> &'static str {
        "axis direction"
    }

    fn build(&self, _: Python<'_>, dynamics: &Tree, _: &NodeSizes) -> Result<Box<dyn term::Term>, Error> {
        Ok(Box::new(term::AxisDirection::try_new(dynamics.model().clone(), &self.body, self.axis)?))
    }
}

/// Direction of an axis of a body in the world.
///
/// Parameters
/// ----------
/// body : str
/// axis : array_like, shape (3,)
///     In the axes of the body.
///
/// Returns
/// -------
/// Term
#[pyfunction]
pub(crate) fn axis_direction(body: String, axis: &Bound<'_, PyAny>) -> Result<Term, Error> {
    let axis = vector("axis", axis)?;
    if axis.amax() == 0.0 {
        return Err(Error::input("`axis` must not be zero"));
    }
    Ok(Term::of(AxisDirection { body, axis }))
}

struct BodyOrientation {
    body: String,
    target: UnitQuaternion<f64>,
}

impl Description for BodyOrientation {
    fn made<'py>(&self, py: Python<'py>) -> PyResult<(&'static str, Bound<'py, PyTuple>)> {
        Ok(("body_orientation", (&self.body, components(&self.target)).into_pyobject(py)?))
    }

    fn what(&self) -> &'static str {
        "body orientation"
    }

    fn build(&self, _: Python<'_>, dynamics: &Tree, _: &NodeSizes) -> Result<Box<dyn term::Term>, Error> {
        Ok(Box::new(term::BodyOrientation::try_new(dynamics.model().clone(), &self.body, self.target)?))
    }
}

/// Rotation of a body from a reference orientation, as a rotation vector in body axes, rad.
///
/// Parameters
/// ----------
/// body : str
/// target : Rotation or array_like, shape (4,) or (3, 3)
///     From the body to the world.
///
/// Returns
/// -------
/// Term
#[pyfunction]
pub(crate) fn body_orientation(body: String, target: &Bound<'_, PyAny>) -> Result<Term, Error> {
    Ok(Term::of(BodyOrientation { body, target: orientation("target", target)? }))
}
