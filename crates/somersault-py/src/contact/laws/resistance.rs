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
///
/// Examples
/// --------
/// A ball that spins on the spot is slowed down by s m g/I:
///
/// >>> import somersault
/// >>> from somersault import contact
/// >>> body = somersault.RigidBody.sphere(1.0, 0.1)
/// >>> spinning = contact.Resistance(rolling=0.0, spinning=1e-3, speed=0.01)
/// >>> ball = contact.Contact.ball(
/// ...     (0, 0, 0), 0.1, contact.HalfSpace(), contact.CompliantLaw(1e4, 100.0), resistance=spinning)
/// >>> start = somersault.State((0, 0, 0.1 - 9.81e-4), angular_velocity=(0, 0, 10.0))
/// >>> motion = somersault.integrate(
/// ...     body, start, (0.0, 0.5), dt=1e-3, forces=somersault.forces.Gravity(), contacts=ball)
/// >>> round(float(motion.angular_velocity[-1, 2]), 3), round(10.0 - 0.5 * 1e-3 * 9.81 / 0.004, 3)
/// (8.774, 8.774)
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
