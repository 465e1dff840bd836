//! Friction without modes.

use super::class::law_class;
use crate::core::error::Error;
use crate::core::value::value;
use pyo3::prelude::*;
use somersault::contact::laws::regularised;

/// Coulomb's law made smooth: F = −μ Fₙ v/√(v² + v_ε²). It has no modes, and cannot hold a body on a slope.
///
/// Parameters
/// ----------
/// coefficient : float
///     μ ≥ 0.
/// speed : float
///     v_ε > 0, m/s, over which the force builds up.
///
/// Examples
/// --------
/// >>> import somersault
/// >>> from somersault import contact
/// >>> friction = contact.RegularisedFriction(0.3, speed=1e-3)
/// >>> slider = contact.Contact((0, 0, 0), contact.HalfSpace(), contact.CompliantLaw(1e4, 100.0), friction=friction)
/// >>> start = somersault.State((0, 0, -9.81e-4), velocity=(1.0, 0, 0))
/// >>> motion = somersault.integrate(
/// ...     somersault.RigidBody.sphere(1.0, 0.1), start, (0.0, 0.2), dt=1e-3,
/// ...     forces=somersault.forces.Gravity(), contacts=slider)
/// >>> round(float(motion.velocity[-1, 0]), 4), round(1.0 - 0.3 * 9.81 * 0.2, 4)
/// (0.4114, 0.4114)
#[pyclass(frozen, eq, from_py_object, module = "somersault.contact")]
#[derive(Clone, Copy, PartialEq)]
pub(crate) struct RegularisedFriction(regularised::RegularisedFriction);

value! {
    impl RegularisedFriction(coefficient, speed) {
        /// float: μ.
        coefficient: f64 = |own| own.0.coefficient();
        /// float: v_ε, m/s.
        speed: f64 = |own| own.0.speed();
    }
}

#[pymethods]
impl RegularisedFriction {
    #[new]
    fn new(coefficient: f64, speed: f64) -> Result<Self, Error> {
        Ok(Self(regularised::RegularisedFriction::try_new(coefficient, speed)?))
    }

    fn __repr__(&self) -> String {
        format!("RegularisedFriction({:?}, {:?})", self.coefficient(), self.speed())
    }
}

law_class!(RegularisedFriction = "regularised": regularised::RegularisedFriction);
