//! Terms: numbers made of a motion at one time, of which costs and constraints are composed.
//!
//! | Term | Rows |
//! |---|---|
//! | [`Entries`] | numbers of the node: time, velocities, accelerations, joint forces (thesis C.26), channels, their rates |
//! | [`Displacement`] | displacement of the positions from a reference, on the groups of the joints |
//! | [`Momentum`] | centre of mass, linear or angular momentum of a tree |
//! | [`PointPosition`], [`AxisDirection`], [`BodyOrientation`] | where a body is and how it is turned |
//! | [`Function`] | a function of the user's, with its gradient or by differences |

mod body;
mod displacement;
mod entries;
mod function;
mod momentum;
mod number;

pub use body::{AxisDirection, BodyOrientation, PointPosition};
pub use displacement::Displacement;
pub use entries::{Entries, Part};
pub use function::{Function, UserError, wrong_derivative};
pub use momentum::{Momentum, MomentumPart};
pub use number::NodeNumber;

use crate::WrongDerivative;
use nalgebra::DMatrix;
use somersault_nlp::EvaluationError;

/// A motion at one time, all of it, as a transcription leaves it.
#[derive(Debug, Clone, Copy)]
pub struct Node<'a> {
    /// t, s.
    pub time: f64,
    /// q, positions of the whole tree.
    pub position: &'a [f64],
    /// v.
    pub velocity: &'a [f64],
    /// a; empty where the transcription has none.
    pub acceleration: &'a [f64],
    /// τ, joint forces; empty where the transcription has none.
    pub torque: &'a [f64],
    /// Channels of the joint motion: weights of eigenpostures, or joints.
    pub channel: &'a [f64],
    /// Their rates, 1/s.
    pub channel_rate: &'a [f64],
    /// Their second rates, 1/s².
    pub channel_second_rate: &'a [f64],
}

/// The gradient of a number by a node: entries as in [`Node`], by displacements of the positions.
///
/// A transcription sizes it; entries that it has no use for are empty.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct NodeGradient {
    /// By time.
    pub time: f64,
    /// By a displacement q ⊕ δ, as long as the velocity.
    pub position: Vec<f64>,
    /// By velocity.
    pub velocity: Vec<f64>,
    /// By acceleration.
    pub acceleration: Vec<f64>,
    /// By joint forces.
    pub torque: Vec<f64>,
    /// By the channels.
    pub channel: Vec<f64>,
    /// By their rates.
    pub channel_rate: Vec<f64>,
    /// By their second rates.
    pub channel_second_rate: Vec<f64>,
}

impl NodeGradient {
    /// Zero in all entries.
    pub fn clear(&mut self) {
        self.time = 0.0;
        for part in [
            &mut self.position,
            &mut self.velocity,
            &mut self.acceleration,
            &mut self.torque,
            &mut self.channel,
            &mut self.channel_rate,
            &mut self.channel_second_rate,
        ] {
            part.fill(0.0);
        }
    }
}

/// Rows r(node) of numbers, differentiable.
pub trait Term: Send {
    /// What it is, for reports and errors.
    fn name(&self) -> &str;

    /// Number of rows.
    fn n_rows(&self) -> usize;

    /// Whether r is linear in the node, so that it has no curvature of its own.
    fn is_linear(&self) -> bool;

    /// Writes r.
    fn evaluate(&mut self, node: &Node<'_>, rows: &mut [f64]) -> Result<(), EvaluationError>;

    /// Adds (∂r/∂node)ᵀ y to `gradient`, at the node of the last [`evaluate`](Self::evaluate).
    fn pull_back(
        &mut self,
        node: &Node<'_>,
        y: &[f64],
        gradient: &mut NodeGradient,
    ) -> Result<(), EvaluationError>;

    /// Its second derivatives, where it is curved and has them.
    fn second_derivatives(&mut self) -> Option<&mut dyn TermSecondDerivatives> {
        None
    }

    /// An entry of the gradient that differences contradict at a node, where it is one that a user wrote and can be compared; see
    /// [`wrong_derivative`].
    fn wrong_derivative(&mut self, _node: &Node<'_>) -> Result<Option<WrongDerivative>, EvaluationError> {
        Ok(None)
    }
}

/// Second derivatives of a [`Term`].
pub trait TermSecondDerivatives {
    /// The numbers of a node that it depends on.
    fn numbers(&self) -> &[NodeNumber];

    /// Σ y_i ∂²r_i by these numbers, symmetric.
    fn weighted(&mut self, node: &Node<'_>, y: &[f64]) -> Result<&DMatrix<f64>, EvaluationError>;
}

#[deny(clippy::missing_trait_methods)]
impl<T: Term + ?Sized> Term for Box<T> {
    fn name(&self) -> &str {
        (**self).name()
    }

    fn n_rows(&self) -> usize {
        (**self).n_rows()
    }

    fn is_linear(&self) -> bool {
        (**self).is_linear()
    }

    fn evaluate(&mut self, node: &Node<'_>, rows: &mut [f64]) -> Result<(), EvaluationError> {
        (**self).evaluate(node, rows)
    }

    fn pull_back(
        &mut self,
        node: &Node<'_>,
        y: &[f64],
        gradient: &mut NodeGradient,
    ) -> Result<(), EvaluationError> {
        (**self).pull_back(node, y, gradient)
    }

    fn second_derivatives(&mut self) -> Option<&mut dyn TermSecondDerivatives> {
        (**self).second_derivatives()
    }

    fn wrong_derivative(&mut self, node: &Node<'_>) -> Result<Option<WrongDerivative>, EvaluationError> {
        (**self).wrong_derivative(node)
    }
}
