//! Building a model, body by body, from the root outwards.
//!
//! A body names its parent, which must have been added before: cycles cannot be written down.

use crate::joint::Joint;
use crate::model::Model;
use crate::spatial::Transform;
use nalgebra::{Matrix3, SymmetricEigen, UnitQuaternion, Vector3};
use somersault_core::Inertia;
use std::collections::HashSet;

/// Why a body cannot be part of a model. Every variant names the body.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ModelError {
    /// A model needs a body.
    #[error("the model has no body")]
    Empty,
    /// Two bodies of one name.
    #[error("a body named `{name}` was added before")]
    DuplicateName {
        /// The name.
        name: String,
    },
    /// The parent is not among the bodies added before.
    #[error("the parent `{parent}` of `{name}` is not among the bodies added before it")]
    UnknownParent {
        /// The body.
        name: String,
        /// The parent asked for.
        parent: String,
    },
    /// A tree has one root.
    #[error("`{name}` has no parent, but `{root}` is the root already")]
    SecondRoot {
        /// The body.
        name: String,
        /// The root.
        root: String,
    },
    /// A number is NaN or infinite.
    #[error("`{argument}` of `{name}` must be finite")]
    NonFinite {
        /// The body.
        name: String,
        /// Name of the quantity.
        argument: &'static str,
    },
    /// A mass or a damping coefficient is negative.
    #[error("`{argument}` of `{name}` must not be negative, found {found}")]
    Negative {
        /// The body.
        name: String,
        /// Name of the quantity.
        argument: &'static str,
        /// Its value.
        found: f64,
    },
    /// The size of a named model is zero or negative.
    #[error("`{argument}` of `{name}` must be positive and finite, found {found}")]
    NotPositive {
        /// The model.
        name: String,
        /// Name of the quantity.
        argument: &'static str,
        /// Its value.
        found: f64,
    },
    /// The inertia tensor is not symmetric.
    #[error("the inertia of `{name}` is not symmetric")]
    AsymmetricInertia {
        /// The body.
        name: String,
    },
    /// No distribution of mass has these principal moments: one is negative, or exceeds the sum of the
    /// other two, or the body has no mass.
    #[error("`{name}` of mass {mass} cannot have the principal moments {moments:?}")]
    NonPhysicalInertia {
        /// The body.
        name: String,
        /// Its mass.
        mass: f64,
        /// Its principal moments.
        moments: [f64; 3],
    },
    /// The joint of the body moves no mass at all, neither its own nor further out.
    #[error("the joint of `{name}` carries no mass")]
    CarriesNoMass {
        /// The body.
        name: String,
    },
    /// The axis of a joint is zero.
    #[error("the joint axis of `{name}` is zero")]
    ZeroAxis {
        /// The body.
        name: String,
    },
    /// The rotation of a placement is not of unit norm.
    #[error("the placement of `{name}` is not a unit quaternion, its norm is {found}")]
    NotARotation {
        /// The body.
        name: String,
        /// Norm of the quaternion.
        found: f64,
    },
    /// The lower limit exceeds the upper one.
    #[error("the limits of `{name}` cross: lower {lower}, upper {upper}")]
    LimitsCrossed {
        /// The body.
        name: String,
        /// Lower limit.
        lower: f64,
        /// Upper limit.
        upper: f64,
    },
    /// Only revolute and prismatic joints have limits.
    #[error("the joint of `{name}` has no single coordinate to limit")]
    LimitsNotApplicable {
        /// The body.
        name: String,
    },
}

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
}

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

    pub(crate) fn placement(&self) -> Transform<f64> {
        Transform::from_parts(&self.orientation, self.origin)
    }

    /// Checks the numbers and brings the joint axis to unit length.
    fn validate(mut self) -> Result<Self, ModelError> {
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

/// Symmetric, no negative principal moment, the triangle inequality; zero if there is no mass. Compared
/// with a relative rounding of 1e-12.
fn physical_inertia(name: &str, body: &MassProperties) -> Result<(), ModelError> {
    const ROUNDING: f64 = 1e-12;
    let tensor = &body.inertia;
    let slack = ROUNDING * tensor.amax();
    if (tensor - tensor.transpose()).amax() > slack {
        return Err(ModelError::AsymmetricInertia { name: name.to_owned() });
    }
    let moments: [f64; 3] = SymmetricEigen::new(*tensor).eigenvalues.into();
    let total: f64 = moments.iter().sum();
    let possible = moments.iter().all(|&m| m >= -slack && 2.0 * m <= total + 4.0 * slack);
    if possible && (body.mass > 0.0 || tensor.amax() == 0.0) {
        Ok(())
    } else {
        Err(ModelError::NonPhysicalInertia { name: name.to_owned(), mass: body.mass, moments })
    }
}

/// Collects the bodies of a model.
#[derive(Debug, Clone)]
pub struct ModelBuilder {
    links: Vec<Link>,
    names: HashSet<String>,
    gravity: Vector3<f64>,
}

impl Default for ModelBuilder {
    fn default() -> Self {
        Self { links: Vec::new(), names: HashSet::new(), gravity: Vector3::new(0.0, 0.0, -9.81) }
    }
}

impl ModelBuilder {
    /// No body yet; gravity (0, 0, −9.81) m/s².
    pub fn new() -> Self {
        Self::default()
    }

    /// Gravitational acceleration in the world frame, m/s².
    pub fn with_gravity(mut self, gravity: Vector3<f64>) -> Self {
        self.gravity = gravity;
        self
    }

    /// Adds a body. The root comes first; every other body after its parent.
    pub fn add(&mut self, link: Link) -> Result<&mut Self, ModelError> {
        if self.names.contains(&link.name) {
            return Err(ModelError::DuplicateName { name: link.name });
        }
        match (&link.parent, self.links.first()) {
            (None, Some(root)) => {
                return Err(ModelError::SecondRoot { name: link.name, root: root.name.clone() });
            }
            (Some(parent), _) if !self.names.contains(parent) => {
                return Err(ModelError::UnknownParent { parent: parent.clone(), name: link.name });
            }
            (None, None) | (Some(_), _) => {}
        }
        let link = link.validate()?;
        self.names.insert(link.name.clone());
        self.links.push(link);
        Ok(self)
    }

    /// The model.
    pub fn build(self) -> Result<Model, ModelError> {
        if self.links.is_empty() {
            return Err(ModelError::Empty);
        }
        if !self.gravity.iter().all(|g| g.is_finite()) {
            let name = self.links[0].name.clone();
            return Err(ModelError::NonFinite { name, argument: "gravity" });
        }
        let model = Model::from_links(self.links, self.gravity);
        let mut carried: Vec<f64> = model.links().iter().map(|l| l.mass.mass).collect();
        for i in (0..carried.len()).rev() {
            if carried[i] == 0.0 && model.links()[i].joint != Joint::Fixed {
                return Err(ModelError::CarriesNoMass { name: model.links()[i].name.clone() });
            }
            if let Some(parent) = model.parent(i) {
                carried[parent] += carried[i];
            }
        }
        Ok(model)
    }
}
