//! Laws of friction: the table of their classes, and a class for each.

use super::class::{Row, friction, law_class};
use crate::core::error::Error;
use crate::core::value::value;
use pyo3::prelude::*;
use somersault::contact::laws::{FrictionLaw, coulomb, regularised};

pub(super) static CLASSES: &[Row<dyn FrictionLaw>] =
    &[friction::<CoulombFriction>(), friction::<RegularisedFriction>()];

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
///
/// Examples
/// --------
/// A block that slides at 1 m/s stops after v²/(2 μ g):
///
/// >>> import somersault
/// >>> from somersault import contact
/// >>> friction = contact.CoulombFriction(0.3, 1e5, 100.0)
/// >>> block = contact.sliding_block(1.0, (0.2, 0.2, 0.1), contact.CompliantLaw(1e5, 100.0), friction, 1.0)
/// >>> motion = somersault.integrate(
/// ...     block.body, block.state, (0.0, 0.4), dt=1e-3, forces=block.forces, contacts=block.contacts)
/// >>> round(float(motion.position[-1, 0]), 3), round(1.0 / (2 * 0.3 * 9.81), 3)
/// (0.17, 0.17)
#[pyclass(frozen, eq, from_py_object, module = "somersault.contact")]
#[derive(Clone, Copy, PartialEq)]
pub(crate) struct CoulombFriction(pub(crate) coulomb::CoulombFriction);

value! {
    impl CoulombFriction(coefficient, stiffness, damping, static_coefficient) {
        /// float: μ.
        coefficient: f64 = |own| own.0.coefficient();
        /// float: k, N/m.
        stiffness: f64 = |own| own.0.stiffness();
        /// float: c, N s/m.
        damping: f64 = |own| own.0.damping();
        /// float: μ_s.
        static_coefficient: f64 = |own| own.0.static_coefficient();
    }
}

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

    fn __repr__(&self) -> String {
        let (mu, k, c, s) = (self.coefficient(), self.stiffness(), self.damping(), self.static_coefficient());
        let holding = if s == mu { String::new() } else { format!(", static_coefficient={s:?}") };
        format!("CoulombFriction({mu:?}, {k:?}, {c:?}{holding})")
    }
}

law_class!(CoulombFriction = "coulomb": coulomb::CoulombFriction);

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
