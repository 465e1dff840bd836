//! Resistance to rolling and spinning.

use crate::core::error::Error;
use pyo3::prelude::*;
use pyo3::types::PyType;
use somersault::contact::laws::resistance;

/// Couples against rolling and spinning: M = −Fₙ (b ω_t/√(ω_t² + ω_ε²) + s ωₙ n/√(ωₙ² + ω_ε²)).
///
/// Parameters
/// ----------
/// rolling, spinning : float
///     Lengths b ≥ 0 and s ≥ 0, m.
/// speed : float
///     ω_ε > 0, rad/s, over which the couples build up.
#[pyclass(frozen, eq, from_py_object, module = "somersault.contact")]
#[derive(Clone, Copy, PartialEq)]
pub(crate) struct Resistance {
    pub(super) law: resistance::Resistance,
    arguments: (f64, f64, f64),
}

impl Resistance {
    /// One of the library's.
    pub(super) fn of(law: resistance::Resistance) -> Self {
        Self { law, arguments: (law.rolling(), law.spinning(), law.speed()) }
    }
}

#[pymethods]
impl Resistance {
    #[new]
    fn new(rolling: f64, spinning: f64, speed: f64) -> Result<Self, Error> {
        let law = resistance::Resistance::try_new(rolling, spinning, speed)?;
        Ok(Self { law, arguments: (rolling, spinning, speed) })
    }

    fn __repr__(&self) -> String {
        let (rolling, spinning, speed) = self.arguments;
        format!("Resistance({rolling:?}, {spinning:?}, {speed:?})")
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> (Bound<'py, PyType>, (f64, f64, f64)) {
        (slf.get_type(), slf.get().arguments)
    }
}
