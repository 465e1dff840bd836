//! Laws along the normal: the table of their classes, and a class for each.

use super::class::{Row, normal, normal_law_class};
use crate::core::convert::finite;
use crate::core::error::Error;
use crate::core::value::value;
use pyo3::prelude::*;
use somersault::contact::laws::{NormalLaw, compliant, hunt_crossley};

pub(super) static CLASSES: &[Row<dyn NormalLaw>] = &[normal::<CompliantLaw>(), normal::<HuntCrossley>()];

/// Spring and damper that push and never pull (thesis 7.10).
///
/// With the gap x, negative inside the surface, F = −k x − c ẋ where x < 0 and k x + c ẋ < 0, else F = 0.
///
/// Parameters
/// ----------
/// stiffness : float
///     k > 0, N/m.
/// damping : float, optional
///     c ≥ 0, N s/m.
///
/// Raises
/// ------
/// InputError
///     If a constant is not one that the law can have.
///
/// Examples
/// --------
/// >>> from somersault.contact import CompliantLaw
/// >>> law = CompliantLaw.from_restitution(1.0, 1e4, 0.5)
/// >>> round(law.restitution(1.0), 12)
/// 0.5
#[pyclass(frozen, eq, from_py_object, module = "somersault.contact")]
#[derive(Clone, Copy, PartialEq)]
pub(crate) struct CompliantLaw(pub(crate) compliant::CompliantLaw);

value! {
    impl CompliantLaw(stiffness, damping) {
        /// float: k, N/m.
        stiffness: f64 = |own| own.0.stiffness();
        /// float: c, N s/m.
        damping: f64 = |own| own.0.damping();
    }
}

#[pymethods]
impl CompliantLaw {
    #[new]
    #[pyo3(signature = (stiffness, damping=0.0))]
    fn new(stiffness: f64, damping: f64) -> Result<Self, Error> {
        Ok(Self(compliant::CompliantLaw::try_new(stiffness, damping)?))
    }

    /// From what a mass does on the contact: k = m ωₙ², c = 2 m ωₙ ζ.
    ///
    /// Parameters
    /// ----------
    /// mass : float
    ///     Mass, kg.
    /// frequency : float
    ///     Natural frequency ωₙ, rad/s.
    /// damping_ratio : float
    ///     ζ ≥ 0.
    ///
    /// Examples
    /// --------
    /// >>> from somersault.contact import CompliantLaw
    /// >>> CompliantLaw.from_frequency(2.0, 100.0, 0.1)
    /// CompliantLaw(20000.0, damping=40.0)
    #[staticmethod]
    fn from_frequency(mass: f64, frequency: f64, damping_ratio: f64) -> Result<Self, Error> {
        Ok(Self(compliant::CompliantLaw::from_frequency(mass, frequency, damping_ratio)?))
    }

    /// From the coefficient of restitution of a central impact under no other force.
    ///
    /// Parameters
    /// ----------
    /// effective_mass : float
    ///     Mass that the contact moves, kg.
    /// stiffness : float
    ///     k, N/m.
    /// restitution : float
    ///     0 < e ≤ 1.
    ///
    /// Examples
    /// --------
    /// >>> from somersault.contact import CompliantLaw
    /// >>> law = CompliantLaw.from_restitution(1.0, 1e4, 0.5)
    /// >>> round(law.damping, 2)
    /// 51.06
    #[staticmethod]
    fn from_restitution(effective_mass: f64, stiffness: f64, restitution: f64) -> Result<Self, Error> {
        Ok(Self(compliant::CompliantLaw::from_restitution(effective_mass, stiffness, restitution)?))
    }

    /// Coefficient of restitution of a central impact under no other force.
    ///
    /// Parameters
    /// ----------
    /// effective_mass : float
    ///     Mass that the contact moves, kg.
    ///
    /// Returns
    /// -------
    /// float
    ///
    /// Examples
    /// --------
    /// >>> from somersault.contact import CompliantLaw
    /// >>> round(CompliantLaw(1e4, damping=40.0).restitution(1.0), 4)
    /// 0.5717
    fn restitution(&self, effective_mass: f64) -> Result<f64, Error> {
        Ok(self.0.restitution(effective_mass)?)
    }

    fn __repr__(&self) -> String {
        format!("CompliantLaw({:?}, damping={:?})", self.0.stiffness(), self.0.damping())
    }
}

normal_law_class!(CompliantLaw = "compliant": compliant::CompliantLaw, "100.0", "0.5");

/// Coefficient of restitution at a damping ratio ζ ≥ 0, where contact ends as the force returns to zero.
///
/// e = exp(−2 ζ arccos ζ/√(1 − ζ²)), continued through ζ = 1.
///
/// Parameters
/// ----------
/// damping_ratio : float
///     ζ.
///
/// Returns
/// -------
/// float
///
/// Examples
/// --------
/// >>> from somersault import contact
/// >>> [round(contact.restitution(zeta), 3) for zeta in (0.0, 0.2, 1.0)]
/// [1.0, 0.572, 0.135]
#[pyfunction]
pub(crate) fn restitution(damping_ratio: f64) -> Result<f64, Error> {
    Ok(compliant::restitution(damping_ratio)?)
}

/// The damping ratio that gives a coefficient of restitution 0 < e ≤ 1; the inverse of `restitution`.
///
/// Parameters
/// ----------
/// restitution : float
///     e.
///
/// Returns
/// -------
/// float
///
/// Examples
/// --------
/// >>> from somersault import contact
/// >>> round(contact.damping_ratio(0.5), 4)
/// 0.2553
#[pyfunction]
pub(crate) fn damping_ratio(restitution: f64) -> Result<f64, Error> {
    Ok(compliant::damping_ratio(restitution)?)
}

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
