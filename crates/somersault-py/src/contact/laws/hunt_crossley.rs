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
///
/// Examples
/// --------
/// >>> from somersault.contact import HuntCrossley
/// >>> law = HuntCrossley(1e6, damping=0.2)
/// >>> round(law.force(-1e-3, 0.0), 3), round(law.restitution(1.0), 3)
/// (31.623, 0.833)
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
    ///
    /// Examples
    /// --------
    /// A steel ball of 10 mm on a steel plate:
    ///
    /// >>> from somersault.contact import HuntCrossley
    /// >>> law = HuntCrossley.from_materials((210e9, 210e9), (0.3, 0.3), 0.01)
    /// >>> f"{law.stiffness:.3e}"
    /// '1.538e+10'
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
    ///
    /// Examples
    /// --------
    /// >>> from somersault.contact import HuntCrossley
    /// >>> law = HuntCrossley.from_restitution(1e6, 0.8, 2.0)
    /// >>> round(law.restitution(2.0), 6)
    /// 0.8
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
    ///
    /// Examples
    /// --------
    /// The faster the impact, the more it loses:
    ///
    /// >>> from somersault.contact import HuntCrossley
    /// >>> law = HuntCrossley(1e6, damping=0.2)
    /// >>> [round(law.restitution(speed), 3) for speed in (0.01, 0.1, 1.0)]
    /// [0.998, 0.98, 0.833]
    fn restitution(&self, speed: f64) -> Result<f64, Error> {
        Ok(self.0.restitution(speed)?)
    }

    fn __repr__(&self) -> String {
        format!("HuntCrossley({:?}, damping={:?})", self.0.stiffness(), self.0.damping())
    }
}

normal_law_class!(HuntCrossley = "hunt_crossley": hunt_crossley::HuntCrossley, "10.0", "0.04");
