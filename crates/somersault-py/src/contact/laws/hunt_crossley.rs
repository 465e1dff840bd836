//! The law of Hunt and Crossley.

use super::class::normal_law_class;
use crate::core::convert::finite;
use crate::core::error::Error;
use crate::core::value::value;
use pyo3::prelude::*;
use somersault::contact::laws::{NormalLaw, hunt_crossley};

/// Hertz's spring with the damper of Hunt and Crossley, which grows with the penetration.
///
/// With the gap −x, F = k x^{3/2} (1 + 3/2 α ẋ) where x > 0 and the force pushes. The power of x limits any
/// method to order 5/2 unless the first and last steps of a contact are small.
///
/// Parameters
/// ----------
/// stiffness : float
///     k > 0, N/m^{3/2}.
/// damping : float, optional
///     α ≥ 0, s/m: the coefficient of restitution is 1 − α v for small speeds v of the impact.
///
/// Raises
/// ------
/// InputError
///     If a constant is not one that the law can have.
#[pyclass(frozen, eq, from_py_object, module = "somersault.contact")]
#[derive(Clone, Copy, PartialEq)]
pub(crate) struct HuntCrossley(hunt_crossley::HuntCrossley);

value! {
    impl HuntCrossley(stiffness, damping) {
        /// float: k, N/m^{3/2}.
        stiffness: f64 = |own| own.0.stiffness();
        /// float: α, s/m.
        damping: f64 = |own| own.0.damping();
    }
}

#[pymethods]
impl HuntCrossley {
    #[new]
    #[pyo3(signature = (stiffness, damping=0.0))]
    fn new(stiffness: f64, damping: f64) -> Result<Self, Error> {
        Ok(Self(hunt_crossley::HuntCrossley::try_new(stiffness, damping)?))
    }

    /// Of two elastic bodies, by Hertz.
    ///
    /// Parameters
    /// ----------
    /// young_moduli, poisson_ratios : tuple of float
    ///     Young's modulus, Pa, and Poisson's ratio of each.
    /// effective_radius : float
    ///     R, m: 1/R = 1/R₁ + 1/R₂ for two spheres, the radius of a sphere on a plane.
    /// damping : float, optional
    ///     α, s/m.
    #[staticmethod]
    #[pyo3(signature = (young_moduli, poisson_ratios, effective_radius, damping=0.0))]
    fn from_materials(
        young_moduli: [f64; 2],
        poisson_ratios: [f64; 2],
        effective_radius: f64,
        damping: f64,
    ) -> Result<Self, Error> {
        let material = |i: usize| hunt_crossley::Elastic::try_new(young_moduli[i], poisson_ratios[i]);
        let materials = [material(0)?, material(1)?];
        Ok(Self(hunt_crossley::HuntCrossley::from_materials(materials, effective_radius, damping)?))
    }

    /// From the coefficient of restitution of a central impact at some speed under no other force.
    ///
    /// Parameters
    /// ----------
    /// stiffness : float
    ///     k, N/m^{3/2}.
    /// restitution : float
    ///     0 < e ≤ 1.
    /// speed : float
    ///     Speed of the impact, m/s.
    #[staticmethod]
    fn from_restitution(stiffness: f64, restitution: f64, speed: f64) -> Result<Self, Error> {
        Ok(Self(hunt_crossley::HuntCrossley::from_restitution(stiffness, restitution, speed)?))
    }

    /// Coefficient of restitution of a central impact under no other force.
    ///
    /// Parameters
    /// ----------
    /// speed : float
    ///     Speed of the impact, m/s.
    ///
    /// Returns
    /// -------
    /// float
    fn restitution(&self, speed: f64) -> Result<f64, Error> {
        Ok(self.0.restitution(speed)?)
    }

    fn __repr__(&self) -> String {
        format!("HuntCrossley({:?}, damping={:?})", self.0.stiffness(), self.0.damping())
    }
}

normal_law_class!(HuntCrossley = "hunt_crossley": hunt_crossley::HuntCrossley);
