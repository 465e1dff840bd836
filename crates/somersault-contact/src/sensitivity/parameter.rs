//! What a motion is differentiated by.

use crate::laws::LawParameter;
use nalgebra::Vector3;
use somersault_integrators::body::RigidBody;
use somersault_integrators::force::Wrench;
use somersault_integrators::state::RigidBodyState;
use somersault_multibody::TreeParameter;
use somersault_multibody::motion::Knots;
use std::borrow::Cow;
use std::fmt;
use std::sync::Arc;

/// Derivative of a wrench with respect to a parameter, as a function of time, body and state.
pub type WrenchDerivative = dyn Fn(f64, &RigidBody, &RigidBodyState) -> Wrench + Send + Sync;

/// A constant of the equations of motion.
#[derive(Clone)]
#[non_exhaustive]
pub enum Parameter {
    /// A constant of the normal law of a contact, by one of the names that the law gives them
    /// ([`NormalLaw::parameters`](crate::laws::NormalLaw::parameters)): `stiffness` or `damping`.
    Normal(usize, Cow<'static, str>),
    /// The same of its friction law ([`FrictionLaw::parameters`](crate::laws::FrictionLaw::parameters)):
    /// `coefficient`, in whose proportion a static coefficient changes, `damping`, `stiffness` or `speed`.
    Friction(usize, Cow<'static, str>),
    /// The mass of a body, kg, with the inertia kept.
    Mass,
    /// A factor on the inertia of a body, at 1, with the mass kept. A body of other density has m times the column of
    /// the mass and once this.
    InertiaScale,
    /// A constant of the smooth forces on a body, by the derivative of their wrench with respect to it.
    Force(Arc<WrenchDerivative>),
    /// A constant force of a tree's degree of freedom, N or N m, beside what acts there.
    JointForce(usize),
    /// The force of a tree's degree of freedom at a knot, N or N m, by its number, as in a
    /// [`TorqueProfile`](somersault_multibody::motion::TorqueProfile).
    JointForceAt(usize, Knots, usize),
    /// A mass, a centre of mass or an inertia of a tree, or where one of its joints is.
    Tree(TreeParameter),
}

impl Parameter {
    /// The forces of a tree's degree of freedom at all knots.
    pub fn joint_forces_at(dof: usize, knots: &Knots) -> impl Iterator<Item = Self> {
        let knots = knots.clone();
        (0..knots.times().len()).map(move |knot| Self::JointForceAt(dof, knots.clone(), knot))
    }

    /// A constant of the normal law of a contact.
    pub fn normal(contact: usize, name: impl Into<Cow<'static, str>>) -> Self {
        Self::Normal(contact, name.into())
    }

    /// A constant of the friction law of a contact.
    pub fn friction(contact: usize, name: impl Into<Cow<'static, str>>) -> Self {
        Self::Friction(contact, name.into())
    }

    /// A uniform acceleration in units of `direction` (m/s²): with a unit vector, a component of gravity.
    pub fn uniform_acceleration(direction: Vector3<f64>) -> Self {
        Self::Force(Arc::new(move |_, body, _| Wrench {
            force: direction * body.mass(),
            torque: Vector3::zeros(),
        }))
    }
}

/// A parameter, with the contact and the place among its laws' parameters where it is one of those.
#[derive(Debug)]
pub(super) struct FoundParameter<'a> {
    pub(super) parameter: &'a Parameter,
    pub(super) of_law: Option<(usize, LawParameter)>,
}

impl FoundParameter<'_> {
    /// The parameter of the laws of a contact that it is, if it is one.
    #[inline]
    pub(super) fn of_contact(&self, contact: usize) -> Option<LawParameter> {
        self.of_law.and_then(|(of, place)| (of == contact).then_some(place))
    }
}

impl fmt::Debug for Parameter {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Normal(contact, name) => write!(f, "Normal({contact}, {name:?})"),
            Self::Friction(contact, name) => write!(f, "Friction({contact}, {name:?})"),
            Self::Mass => write!(f, "Mass"),
            Self::InertiaScale => write!(f, "InertiaScale"),
            Self::Force(_) => write!(f, "Force"),
            Self::JointForce(dof) => write!(f, "JointForce({dof})"),
            Self::JointForceAt(dof, knots, knot) => {
                write!(f, "JointForceAt({dof}, {} knots, {knot})", knots.times().len())
            }
            Self::Tree(parameter) => write!(f, "{parameter:?}"),
        }
    }
}

/// What to differentiate by, beyond the initial state, and when not to.
#[derive(Debug, Clone)]
pub struct Differentiation {
    /// The parameters.
    pub parameters: Vec<Parameter>,
    /// Size of the least gap up to which a contact is grazed, in parts of the way ‖u‖ T + ½ |Δẍ| T² that its point
    /// covers in the interval T at its velocity u and the acceleration of the gap.
    ///
    /// Next to a motion with the least gap g there are motions on the other side within a change of g: a
    /// derivative holds for smaller changes only. √ε = 1.5e-8, the default, is the least, below which no double
    /// precision shows the one or the other side; smaller values are taken for it.
    pub grazing: f64,
    /// Stretches of the contacts' friction at the start, m, as
    /// [`WithStretches::stretched`](crate::stretches::WithStretches::stretched) takes them; none are zero. They
    /// do not change with the initial state.
    pub stretches: Vec<Vector3<f64>>,
}

impl Default for Differentiation {
    fn default() -> Self {
        Self { parameters: Vec::new(), grazing: f64::EPSILON.sqrt(), stretches: Vec::new() }
    }
}

impl Differentiation {
    /// By these parameters, with the default bound on grazing and unstretched contacts.
    pub fn by(parameters: impl Into<Vec<Parameter>>) -> Self {
        Self { parameters: parameters.into(), ..Self::default() }
    }
}
