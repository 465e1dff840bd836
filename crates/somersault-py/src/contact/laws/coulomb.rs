//! Friction that sticks and slips.

use super::class::LawClass;
use crate::core::error::Error;
use pyo3::prelude::*;
use pyo3::types::PyType;
use somersault::contact::laws::coulomb;

/// Coulomb's law: a spring and a damper in series with a slider.
///
/// With the stretch ξ of the spring and p = k ξ + c v, sticking F = −p and ξ̇ = v as long as ‖p‖ ≤ μ N, slipping
/// F = −μ N p/‖p‖ and ξ̇ = (μ N p/‖p‖ − k ξ)/c: both are continuous between stick and slip. A block on a slope
/// of tan α < μ stays at rest. For points, balls, rims and pairs of spheres alike.
///
/// Parameters
/// ----------
/// coefficient : float
///     μ ≥ 0.
/// stiffness : float
///     k ≥ 0, N/m. With 0 it is viscous creep up to Coulomb's bound, which holds nothing at rest.
/// damping : float
///     c > 0, N s/m. For a mass m that sticks, 2 ζ √(k m) with a damping ratio ζ of 0.05 to 1 suits most ends.
/// static_coefficient : float, optional
///     μ_s ≥ μ, up to which it sticks; at break-away the force falls to μ N at once. μ unless given.
#[pyclass(frozen, eq, from_py_object, module = "somersault.contact")]
#[derive(Clone, Copy, PartialEq)]
pub(crate) struct CoulombFriction(pub(crate) coulomb::CoulombFriction);

#[pymethods]
impl CoulombFriction {
    #[new]
    #[pyo3(signature = (coefficient, stiffness, damping, static_coefficient=None))]
    fn new(
        coefficient: f64,
        stiffness: f64,
        damping: f64,
        static_coefficient: Option<f64>,
    ) -> Result<Self, Error> {
        let law = coulomb::CoulombFriction::try_new(coefficient, stiffness, damping)?;
        Ok(Self(static_coefficient.map_or(Ok(law), |found| law.with_static(found))?))
    }

    /// float: μ.
    #[getter]
    fn coefficient(&self) -> f64 {
        self.0.coefficient()
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

    /// float: μ_s.
    #[getter]
    fn static_coefficient(&self) -> f64 {
        self.0.static_coefficient()
    }

    fn __repr__(&self) -> String {
        let (mu, k, c, s) = (self.coefficient(), self.stiffness(), self.damping(), self.static_coefficient());
        let holding = if s == mu { String::new() } else { format!(", static_coefficient={s:?}") };
        format!("CoulombFriction({mu:?}, {k:?}, {c:?}{holding})")
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> (Bound<'py, PyType>, (f64, f64, f64, f64)) {
        let law = slf.get();
        let arguments = (law.coefficient(), law.stiffness(), law.damping(), law.static_coefficient());
        (slf.get_type(), arguments)
    }
}

impl LawClass for CoulombFriction {
    type Law = coulomb::CoulombFriction;
    fn of(law: Self::Law) -> Self {
        Self(law)
    }
    fn law(&self) -> Self::Law {
        self.0
    }
}
