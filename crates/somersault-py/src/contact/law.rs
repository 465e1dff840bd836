//! Laws of contacts: along the normal, against sliding, rolling and spinning.

use crate::core::convert::{a_type, finite};
use crate::core::error::Error;
use pyo3::prelude::*;
use pyo3::types::PyType;
use somersault::contact::interface::ContactLaw;
use somersault::contact::normal::NormalLaw;
use somersault::contact::{friction, hunt_crossley, law};

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
pub(crate) struct CompliantLaw(pub(crate) law::CompliantLaw);

#[pymethods]
impl CompliantLaw {
    #[new]
    #[pyo3(signature = (stiffness, damping=0.0))]
    fn new(stiffness: f64, damping: f64) -> Result<Self, Error> {
        Ok(Self(law::CompliantLaw::try_new(stiffness, damping)?))
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
    #[staticmethod]
    fn from_frequency(mass: f64, frequency: f64, damping_ratio: f64) -> Result<Self, Error> {
        Ok(Self(law::CompliantLaw::from_frequency(mass, frequency, damping_ratio)?))
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
    #[staticmethod]
    fn from_restitution(effective_mass: f64, stiffness: f64, restitution: f64) -> Result<Self, Error> {
        Ok(Self(law::CompliantLaw::from_restitution(effective_mass, stiffness, restitution)?))
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
    fn restitution(&self, effective_mass: f64) -> Result<f64, Error> {
        Ok(self.0.restitution(effective_mass)?)
    }

    /// The force, N.
    ///
    /// Parameters
    /// ----------
    /// gap, rate : float
    ///     Gap, m, and its rate, m/s.
    ///
    /// Returns
    /// -------
    /// float
    fn force(&self, gap: f64, rate: f64) -> Result<f64, Error> {
        Ok(self.0.force(finite("gap", gap)?, finite("rate", rate)?))
    }

    /// Energy of the spring, J.
    ///
    /// Parameters
    /// ----------
    /// gap : float
    ///     Gap, m.
    ///
    /// Returns
    /// -------
    /// float
    fn energy(&self, gap: f64) -> Result<f64, Error> {
        Ok(self.0.energy(finite("gap", gap)?))
    }

    fn __repr__(&self) -> String {
        format!("CompliantLaw({:?}, damping={:?})", self.0.stiffness(), self.0.damping())
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> (Bound<'py, PyType>, (f64, f64)) {
        (slf.get_type(), (slf.get().stiffness(), slf.get().damping()))
    }
}

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
#[pyfunction]
pub(crate) fn restitution(damping_ratio: f64) -> Result<f64, Error> {
    Ok(law::restitution(damping_ratio)?)
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
#[pyfunction]
pub(crate) fn damping_ratio(restitution: f64) -> Result<f64, Error> {
    Ok(law::damping_ratio(restitution)?)
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
#[pyclass(frozen, eq, from_py_object, module = "somersault.contact")]
#[derive(Clone, Copy, PartialEq)]
pub(crate) struct HuntCrossley(hunt_crossley::HuntCrossley);

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

    /// float: k, N/m^{3/2}.
    #[getter]
    fn stiffness(&self) -> f64 {
        self.0.stiffness()
    }

    /// float: α, s/m.
    #[getter]
    fn damping(&self) -> f64 {
        self.0.damping()
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

    /// The force, N.
    ///
    /// Parameters
    /// ----------
    /// gap, rate : float
    ///     Gap, m, and its rate, m/s.
    ///
    /// Returns
    /// -------
    /// float
    fn force(&self, gap: f64, rate: f64) -> Result<f64, Error> {
        let (gap, rate) = (finite("gap", gap)?, finite("rate", rate)?);
        Ok(if self.0.guard(gap, rate).is_inside() { self.0.force_in_contact(gap, rate) } else { 0.0 })
    }

    /// Energy of the spring, J.
    ///
    /// Parameters
    /// ----------
    /// gap : float
    ///     Gap, m.
    ///
    /// Returns
    /// -------
    /// float
    fn energy(&self, gap: f64) -> Result<f64, Error> {
        Ok(self.0.energy(finite("gap", gap)?))
    }

    fn __repr__(&self) -> String {
        format!("HuntCrossley({:?}, damping={:?})", self.0.stiffness(), self.0.damping())
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> (Bound<'py, PyType>, (f64, f64)) {
        (slf.get_type(), (slf.get().stiffness(), slf.get().damping()))
    }
}

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
pub(crate) struct RegularisedFriction(friction::RegularisedFriction);

#[pymethods]
impl RegularisedFriction {
    #[new]
    fn new(coefficient: f64, speed: f64) -> Result<Self, Error> {
        Ok(Self(friction::RegularisedFriction::try_new(coefficient, speed)?))
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
pub(crate) struct CoulombFriction(pub(crate) friction::CoulombFriction);

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
        let law = friction::CoulombFriction::try_new(coefficient, stiffness, damping)?;
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
    law: friction::Resistance,
    arguments: (f64, f64, f64),
}

#[pymethods]
impl Resistance {
    #[new]
    fn new(rolling: f64, spinning: f64, speed: f64) -> Result<Self, Error> {
        let law = friction::Resistance::try_new(rolling, spinning, speed)?;
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

/// The normal law of an argument.
#[derive(FromPyObject)]
enum Normal {
    Compliant(CompliantLaw),
    HuntCrossley(HuntCrossley),
}

/// The friction of an argument.
#[derive(FromPyObject)]
enum AnyFriction {
    Coulomb(CoulombFriction),
    Regularised(RegularisedFriction),
}

/// All laws of a contact.
pub(crate) fn laws(
    law: &Bound<'_, PyAny>,
    friction: Option<&Bound<'_, PyAny>>,
    resistance: Option<&Bound<'_, PyAny>>,
) -> Result<ContactLaw, Error> {
    let wrong = |argument, kinds, found: &Bound<'_, PyAny>| {
        Error::input(format!("`{argument}` must be {kinds}, found {}", a_type(found)))
    };
    let mut laws = match law.extract() {
        Ok(Normal::Compliant(law)) => ContactLaw::from(law.0),
        Ok(Normal::HuntCrossley(law)) => ContactLaw::from(law.0),
        Err(_) => return Err(wrong("law", "a CompliantLaw or a HuntCrossley", law)),
    };
    if let Some(value) = friction {
        laws = match value.extract() {
            Ok(AnyFriction::Coulomb(friction)) => laws.with_friction(friction.0),
            Ok(AnyFriction::Regularised(friction)) => laws.with_friction(friction.0),
            Err(_) => {
                let kinds = "a CoulombFriction or a RegularisedFriction";
                return Err(wrong("friction", kinds, value));
            }
        };
    }
    if let Some(value) = resistance {
        let found: Resistance = value.extract().map_err(|_| wrong("resistance", "a Resistance", value))?;
        laws = laws.with_resistance(found.law);
    }
    Ok(laws)
}

/// The normal law as Python sees it.
pub(crate) fn normal_law<'py>(py: Python<'py>, laws: &ContactLaw) -> PyResult<Bound<'py, PyAny>> {
    Ok(match laws.normal {
        NormalLaw::Compliant(law) => Bound::new(py, CompliantLaw(law))?.into_any(),
        NormalLaw::HuntCrossley(law) => Bound::new(py, HuntCrossley(law))?.into_any(),
    })
}

/// The law of friction as Python sees it.
pub(crate) fn friction_law<'py>(py: Python<'py>, laws: &ContactLaw) -> PyResult<Option<Bound<'py, PyAny>>> {
    Ok(match laws.friction {
        friction::Friction::None => None,
        friction::Friction::Regularised(law) => Some(Bound::new(py, RegularisedFriction(law))?.into_any()),
        friction::Friction::Coulomb(law) => Some(Bound::new(py, CoulombFriction(law))?.into_any()),
    })
}

/// The resistance as Python sees it.
pub(crate) fn resistance_law<'py>(
    py: Python<'py>,
    laws: &ContactLaw,
) -> PyResult<Option<Bound<'py, Resistance>>> {
    let law = laws.resistance;
    let arguments = (law.rolling(), law.spinning(), law.speed());
    if law == friction::Resistance::default() {
        return Ok(None);
    }
    Bound::new(py, Resistance { law, arguments }).map(Some)
}

/// Law, friction and resistance, as contacts take them.
pub(crate) type Laws<'py> = (Bound<'py, PyAny>, Option<Bound<'py, PyAny>>, Option<Bound<'py, Resistance>>);

/// What [`laws`] makes the same of again.
pub(crate) fn parts<'py>(py: Python<'py>, laws: &ContactLaw) -> PyResult<Laws<'py>> {
    Ok((normal_law(py, laws)?, friction_law(py, laws)?, resistance_law(py, laws)?))
}
