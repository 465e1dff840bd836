//! A body with its mass and the joint that carries it.

use crate::error::ModelError;
use crate::joint::Joint;
use crate::mimic::Mimic;
use crate::spatial::Transform;
use nalgebra::{Matrix3, SymmetricEigen, UnitQuaternion, Vector3};
use somersault_core::Inertia;

/// Mass, centre of mass and inertia of a body in its own frame.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct MassProperties {
    /// Mass, kg.
    pub mass: f64,
    /// Centre of mass, m.
    pub center: Vector3<f64>,
    /// Inertia tensor about the centre of mass, body axes, kg m². Rods and points may have zero moments.
    pub inertia: Matrix3<f64>,
}

impl MassProperties {
    /// A body with volume.
    pub fn new(mass: f64, center: Vector3<f64>, inertia: &Inertia) -> Self {
        Self { mass, center, inertia: *inertia.tensor() }
    }

    /// A point mass.
    pub fn point(mass: f64, center: Vector3<f64>) -> Self {
        Self { mass, center, inertia: Matrix3::zeros() }
    }

    /// A thin uniform rod between two points: inertia m (ℓ² 1 − d dᵀ)/12 with d from one to the other.
    pub fn rod(mass: f64, from: Vector3<f64>, to: Vector3<f64>) -> Self {
        let d = to - from;
        let inertia = (Matrix3::from_diagonal_element(d.norm_squared()) - d * d.transpose()) * (mass / 12.0);
        Self { mass, center: (from + to) * 0.5, inertia }
    }

    /// A frame between two joints, without mass.
    pub fn massless() -> Self {
        Self::point(0.0, Vector3::zeros())
    }

    /// These properties where a body can have them, and the nearest that one can have where it cannot.
    ///
    /// The second moments of the mass about its centre, Σ = ∫ x xᵀ dm = ½ tr(I) 1 − I, are positive semidefinite. The
    /// nearest such matrix in the Frobenius norm has zero in the place of the negative eigenvalues of Σ, and gives back
    /// I = tr(Σ) 1 − Σ; mass, centre and principal axes stay. So where one moment exceeds the sum of the two others, it stays and
    /// half of the excess is added to each of these. Without mass there is no inertia. The tensor is taken as its symmetric part;
    /// numbers that are not finite, and negative masses, are left as they are.
    ///
    /// Source: P. M. Wensing, S. Kim, J.-J. E. Slotine, *Linear matrix inequalities for physically consistent inertial
    /// parameter identification*, IEEE Robotics and Automation Letters 3 (2018), for the condition.
    pub fn nearest_possible(&self) -> Self {
        let size = self.inertia.amax();
        if !(self.mass >= 0.0 && self.inertia.iter().all(|x| x.is_finite())) || self.is_possible() {
            return *self;
        }
        if self.mass == 0.0 {
            return Self { inertia: Matrix3::zeros(), ..*self };
        }
        // of unit size, so that no sum overflows
        let tensor = self.inertia / size;
        let tensor = (tensor + tensor.transpose()) * 0.5;
        let mut moments = SymmetricEigen::new(Matrix3::from_diagonal_element(tensor.trace() * 0.5) - tensor);
        moments.eigenvalues.iter_mut().for_each(|x| *x = x.max(0.0));
        let second = moments.recompose();
        let inertia = (Matrix3::from_diagonal_element(second.trace()) - second) * size;
        Self { inertia: (inertia + inertia.transpose()) * 0.5, ..*self }
    }

    /// The same mass in a body that is `scale` times as long along each of its axes: its centre is at S c, and the second moments
    /// Σ = ½ tr(I) 1 − I of its mass are S Σ S, with S = diag(`scale`).
    pub(crate) fn scaled(&self, scale: &Vector3<f64>) -> Self {
        let second = Matrix3::from_diagonal_element(0.5 * self.inertia.trace()) - self.inertia;
        let second = second.component_mul(&(scale * scale.transpose()));
        let inertia = Matrix3::from_diagonal_element(second.trace()) - second;
        Self { center: self.center.component_mul(scale), inertia, ..*self }
    }

    /// Principal moments about the centre of mass, kg m².
    pub fn principal_moments(&self) -> [f64; 3] {
        SymmetricEigen::new(self.inertia).eigenvalues.into()
    }

    /// No negative principal moment, the triangle inequality; zero if there is no mass. Compared with a relative
    /// rounding of 1e-12.
    fn is_possible(&self) -> bool {
        let slack = ROUNDING * self.inertia.amax();
        let moments = self.principal_moments();
        let total: f64 = moments.iter().sum();
        let possible = moments.iter().all(|&m| m >= -slack && 2.0 * m <= total + 4.0 * slack);
        possible && (self.mass > 0.0 || self.inertia.amax() == 0.0)
    }
}

/// Of an inertia tensor, relative.
const ROUNDING: f64 = 1e-12;

/// One body with the joint that carries it.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Link {
    pub(crate) name: String,
    pub(crate) parent: Option<String>,
    pub(crate) mass: MassProperties,
    pub(crate) joint: Joint,
    pub(crate) origin: Vector3<f64>,
    pub(crate) orientation: UnitQuaternion<f64>,
    pub(crate) damping: f64,
    pub(crate) limits: Option<[f64; 2]>,
    #[cfg_attr(feature = "serde", serde(default))]
    pub(crate) mimic: Option<Mimic>,
}

impl Link {
    /// The root of the tree: its joint connects it to the world.
    pub fn root(name: impl Into<String>, joint: Joint, mass: MassProperties) -> Self {
        Self {
            name: name.into(),
            parent: None,
            mass,
            joint,
            origin: Vector3::zeros(),
            orientation: UnitQuaternion::identity(),
            damping: 0.0,
            limits: None,
            mimic: None,
        }
    }

    /// A body on a joint that is fixed in the body `parent`.
    pub fn child(
        name: impl Into<String>,
        parent: impl Into<String>,
        joint: Joint,
        mass: MassProperties,
    ) -> Self {
        Self::root(name, joint, mass).carried_by(parent)
    }

    /// The same body on a joint that is fixed in the body `parent`.
    pub fn carried_by(mut self, parent: impl Into<String>) -> Self {
        self.parent = Some(parent.into());
        self
    }

    /// Where the joint frame is in the parent, m. The frame of the child coincides with it at q = 0.
    pub fn at(mut self, origin: Vector3<f64>) -> Self {
        self.origin = origin;
        self
    }

    /// How the joint frame is turned: its axes → the parent's axes.
    pub fn turned(mut self, orientation: UnitQuaternion<f64>) -> Self {
        self.orientation = orientation;
        self
    }

    /// Viscous friction: the joint resists with −`damping` · v in each degree of freedom (N s/m, N m s).
    pub fn with_damping(mut self, damping: f64) -> Self {
        self.damping = damping;
        self
    }

    /// Range of a revolute (rad) or prismatic (m) joint; infinite bounds are allowed. Recorded, not enforced.
    pub fn with_limits(mut self, lower: f64, upper: f64) -> Self {
        self.limits = Some([lower, upper]);
        self
    }

    /// Lets the joint, revolute or prismatic, follow that of the body `leader`, which may be added later: its coordinate is
    /// `multiplier` · q + `offset`. It has no numbers in q and v.
    pub fn following(mut self, leader: impl Into<String>, multiplier: f64, offset: f64) -> Self {
        self.mimic = Some(Mimic { leader: leader.into(), multiplier, offset });
        self
    }

    /// Name of the body.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Name of the parent; the root has none.
    pub fn parent(&self) -> Option<&str> {
        self.parent.as_deref()
    }

    /// Mass, centre of mass and inertia, body frame.
    pub fn mass_properties(&self) -> &MassProperties {
        &self.mass
    }

    /// The joint.
    pub fn joint(&self) -> &Joint {
        &self.joint
    }

    /// Where the joint frame is in the parent, m.
    pub fn origin(&self) -> &Vector3<f64> {
        &self.origin
    }

    /// Rotation of the joint frame: its axes → the parent's axes.
    pub fn orientation(&self) -> &UnitQuaternion<f64> {
        &self.orientation
    }

    /// Viscous friction, N s/m or N m s.
    pub fn damping(&self) -> f64 {
        self.damping
    }

    /// Lower and upper limit, if it was given any.
    pub fn limits(&self) -> Option<[f64; 2]> {
        self.limits
    }

    /// Which joint this one follows, if it follows any.
    pub fn mimic(&self) -> Option<&Mimic> {
        self.mimic.as_ref()
    }

    pub(crate) fn placement(&self) -> Transform<f64> {
        Transform::from_parts(&self.orientation, self.origin)
    }

    /// Checks the numbers and brings the joint axis to unit length.
    pub(crate) fn validate(mut self) -> Result<Self, ModelError> {
        let name = || self.name.clone();
        let finite = |argument, numbers: &[f64]| {
            if numbers.iter().all(|x| x.is_finite()) {
                Ok(())
            } else {
                Err(ModelError::NonFinite { name: name(), argument })
            }
        };
        finite("mass", &[self.mass.mass])?;
        finite("center", self.mass.center.as_slice())?;
        finite("inertia", self.mass.inertia.as_slice())?;
        finite("origin", self.origin.as_slice())?;
        finite("orientation", self.orientation.coords.as_slice())?;
        finite("damping", &[self.damping])?;
        for (argument, found) in [("mass", self.mass.mass), ("damping", self.damping)] {
            if found < 0.0 {
                return Err(ModelError::Negative { name: name(), argument, found });
            }
        }
        let norm = self.orientation.coords.norm();
        if (norm - 1.0).abs() > 1e-9 {
            return Err(ModelError::NotARotation { name: name(), found: norm });
        }
        physical_inertia(&self.name, &self.mass)?;
        if let Some([lower, upper]) = self.limits {
            if self.joint.n_positions() != 1 {
                return Err(ModelError::LimitsNotApplicable { name: name() });
            }
            if lower.is_nan() || upper.is_nan() {
                return Err(ModelError::NonFinite { name: name(), argument: "limits" });
            }
            if lower > upper {
                return Err(ModelError::LimitsCrossed { name: name(), lower, upper });
            }
        }
        if let Some(Mimic { multiplier, offset, .. }) = &self.mimic {
            finite("mimic", &[*multiplier, *offset])?;
            if self.joint.n_velocities() != 1 {
                return Err(ModelError::NoSingleCoordinate { name: name() });
            }
        }
        if let Some(given) = self.joint.axis_mut() {
            let axis = *given;
            finite("axis", axis.as_slice())?;
            let largest = axis.amax();
            if largest == 0.0 {
                return Err(ModelError::ZeroAxis { name: name() });
            }
            // scaled first, so that no length over- or underflows
            *given = if is_unit(axis.norm_squared()) { axis } else { (axis / largest).normalize() };
        }
        if !is_unit(self.orientation.norm_squared()) {
            self.orientation = UnitQuaternion::new_normalize(self.orientation.into_inner());
        }
        Ok(self)
    }
}

/// Whether something of this squared norm is of unit length to rounding: then it keeps its bits, and a link
/// of a model builds the same model again.
fn is_unit(norm_squared: f64) -> bool {
    (norm_squared - 1.0).abs() <= 4.0 * f64::EPSILON
}

fn physical_inertia(name: &str, body: &MassProperties) -> Result<(), ModelError> {
    let tensor = &body.inertia;
    if (tensor - tensor.transpose()).amax() > ROUNDING * tensor.amax() {
        return Err(ModelError::AsymmetricInertia { name: name.to_owned() });
    }
    if body.is_possible() {
        return Ok(());
    }
    let moments = body.principal_moments();
    Err(ModelError::NonPhysicalInertia { name: name.to_owned(), mass: body.mass, moments })
}
