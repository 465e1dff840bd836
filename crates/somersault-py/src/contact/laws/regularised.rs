//! Friction without modes.

use super::class::LawClass;
use crate::core::error::Error;
use pyo3::prelude::*;
use pyo3::types::PyType;
use somersault::contact::laws::regularised;

/// Coulomb's law made smooth: F = −μ Fₙ v/√(v² + v_ε²). It has no modes, and cannot hold a body on a slope.
///
/// Parameters
/// ----------
/// coefficient : float
///     μ ≥ 0.
/// speed : float
///     v_ε > 0, m/s, over which the force builds up.
#[pyclass(frozen, eq, from_py_object, module = "somersault.contact")]
#[derive(Clone, Copy, PartialEq)]
pub(crate) struct RegularisedFriction(regularised::RegularisedFriction);

#[pymethods]
impl RegularisedFriction {
    #[new]
    fn new(coefficient: f64, speed: f64) -> Result<Self, Error> {
        Ok(Self(regularised::RegularisedFriction::try_new(coefficient, speed)?))
    }

    /// float: μ.
    #[getter]
    fn coefficient(&self) -> f64 {
        self.0.coefficient()
    }

    /// float: v_ε, m/s.
    #[getter]
    fn speed(&self) -> f64 {
        self.0.speed()
    }

    fn __repr__(&self) -> String {
        format!("RegularisedFriction({:?}, {:?})", self.coefficient(), self.speed())
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> (Bound<'py, PyType>, (f64, f64)) {
        (slf.get_type(), (slf.get().coefficient(), slf.get().speed()))
    }
}

impl LawClass for RegularisedFriction {
    type Law = regularised::RegularisedFriction;
    fn of(law: Self::Law) -> Self {
        Self(law)
    }
    fn law(&self) -> Self::Law {
        self.0
    }
}
