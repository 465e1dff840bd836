//! What a motion is differentiated by.

use nalgebra::Vector3;
use somersault_integrators::body::RigidBody;
use somersault_integrators::force::Wrench;
use somersault_integrators::state::RigidBodyState;
use std::fmt;
use std::sync::Arc;

/// Derivative of a wrench with respect to a parameter, as a function of time, body and state.
pub type WrenchDerivative = dyn Fn(f64, &RigidBody, &RigidBodyState) -> Wrench + Send + Sync;

/// A constant of the equations of motion.
#[derive(Clone)]
#[non_exhaustive]
pub enum Parameter {
    /// The stiffness of a contact's normal law: k, N/m or N/m^{3/2}.
    Stiffness(usize),
    /// The damping of a contact's normal law: c, N s/m, or α, s/m.
    Damping(usize),
    /// μ of a contact.
    Friction(usize),
    /// The mass, kg, with the inertia kept.
    Mass,
    /// A factor on the inertia, at 1, with the mass kept. A body of other density has m times the column of
    /// the mass and once this.
    InertiaScale,
    /// A constant of the smooth forces, by the derivative of their wrench with respect to it.
    Force(Arc<WrenchDerivative>),
}

impl Parameter {
    /// A uniform acceleration in units of `direction` (m/s²): with a unit vector, a component of gravity.
    pub fn uniform_acceleration(direction: Vector3<f64>) -> Self {
        Self::Force(Arc::new(move |_, body, _| Wrench {
            force: direction * body.mass(),
            torque: Vector3::zeros(),
        }))
    }

    pub(super) fn contact(&self) -> Option<usize> {
        match self {
            Self::Stiffness(contact) | Self::Damping(contact) | Self::Friction(contact) => Some(*contact),
            _ => None,
        }
    }
}

impl fmt::Debug for Parameter {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Stiffness(contact) => write!(f, "Stiffness({contact})"),
            Self::Damping(contact) => write!(f, "Damping({contact})"),
            Self::Friction(contact) => write!(f, "Friction({contact})"),
            Self::Mass => write!(f, "Mass"),
            Self::InertiaScale => write!(f, "InertiaScale"),
            Self::Force(_) => write!(f, "Force"),
        }
    }
}

/// What to differentiate by, beyond the initial state, and when not to.
#[derive(Debug, Clone)]
pub struct Differentiation {
    /// The parameters.
    pub parameters: Vec<Parameter>,
    /// A touch-down within this part of the interval, in time, of where the gap would be least, |Δẋ| ≤
    /// `grazing` |Δẍ| (t₁ − t₀), is a graze.
    ///
    /// The default, 1e-9, is met only by motions that touch to rounding; a larger one warns of derivatives
    /// that hold only for small changes: up to Δẋ²/(2|Δẍ|) of the gap.
    pub grazing: f64,
}

impl Default for Differentiation {
    fn default() -> Self {
        Self { parameters: Vec::new(), grazing: 1e-9 }
    }
}

impl Differentiation {
    /// By these parameters, with the default bound on grazing.
    pub fn by(parameters: impl Into<Vec<Parameter>>) -> Self {
        Self { parameters: parameters.into(), ..Self::default() }
    }
}
