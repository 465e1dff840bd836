//! Transcriptions: what makes a motion at nodes of a decision vector.
//!
//! ```text
//! z → nodes x_k(z) with quadrature weights ω_k(z), and defects d(z) that vanish where the motion hangs together
//! ∫ L dt ≈ Σ_k ω_k L(x_k)
//! ```
//! The weights are those of the scheme that made the nodes, so that a cost is as accurate as the motion. A free
//! duration enters by the times and the weights of the nodes. A motion may consist of several phases, each with nodes of
//! its own: the last node of a phase and the first of the next are the same instant.
//!
//! Derivatives go both ways. Backwards, [`Transcription::pull_back`] is the adjoint of all that a rollout makes: one
//! sweep gives the gradient of one number. Forwards, [`Transcription::push_forward`] hands out the tangents of each node
//! in turn: one sweep gives all derivatives, at the cost of as many columns as there are variables.

use crate::term::{Node, NodeGradient};
use nalgebra::{DMatrix, DVectorView};
use somersault_nlp::{Bounds, EvaluationError, Pattern};
use std::ops::Range;

/// How many numbers the parts of a node have; a part that a transcription leaves out has none.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct NodeSizes {
    /// q.
    pub n_positions: usize,
    /// v, and displacements of q.
    pub n_velocities: usize,
    /// a.
    pub n_accelerations: usize,
    /// τ.
    pub n_torques: usize,
    /// Channels, and each of their rates.
    pub n_channels: usize,
}

impl NodeSizes {
    /// A gradient of these sizes, zero.
    pub fn gradient(&self) -> NodeGradient {
        NodeGradient {
            time: 0.0,
            position: vec![0.0; self.n_velocities],
            velocity: vec![0.0; self.n_velocities],
            acceleration: vec![0.0; self.n_accelerations],
            torque: vec![0.0; self.n_torques],
            channel: vec![0.0; self.n_channels],
            channel_rate: vec![0.0; self.n_channels],
            channel_second_rate: vec![0.0; self.n_channels],
        }
    }
}

/// What stays the same about a transcription.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Outline {
    /// Of the nodes.
    pub sizes: NodeSizes,
    /// Bounds on z; its length is that of z.
    pub variables: Bounds,
    /// Bounds on the defects, zero for most.
    pub defects: Bounds,
    /// Nodes of each phase, one phase after the other.
    pub phases: Vec<Range<usize>>,
}

impl Outline {
    /// Numbers in z.
    pub fn n_variables(&self) -> usize {
        self.variables.len()
    }

    /// Number of nodes of all phases.
    pub fn n_nodes(&self) -> usize {
        self.phases.last().map_or(0, |phase| phase.end)
    }

    /// Number of defects.
    pub fn n_defects(&self) -> usize {
        self.defects.len()
    }
}

/// The gradient of a number by all that a rollout makes.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct RolloutGradient {
    /// By each node.
    pub nodes: Vec<NodeGradient>,
    /// By each quadrature weight.
    pub weights: Vec<f64>,
    /// By each defect.
    pub defects: Vec<f64>,
}

impl RolloutGradient {
    /// One that fits, zero.
    pub fn new(outline: &Outline) -> Self {
        Self {
            nodes: vec![outline.sizes.gradient(); outline.n_nodes()],
            weights: vec![0.0; outline.n_nodes()],
            defects: vec![0.0; outline.n_defects()],
        }
    }

    /// Zero in all entries.
    pub fn clear(&mut self) {
        self.nodes.iter_mut().for_each(NodeGradient::clear);
        self.weights.fill(0.0);
        self.defects.fill(0.0);
    }
}

/// The derivatives of a node by the variables on which it depends.
///
/// Each matrix has one row for each of these variables and one column for each number of the part, so that a column is
/// the gradient of that number.
#[derive(Debug, Clone, PartialEq)]
pub struct NodeTangent {
    /// The variables, ascending: entries of z.
    pub variables: Vec<usize>,
    /// Of the quadrature weight.
    pub weight: Vec<f64>,
    /// Of the time.
    pub time: Vec<f64>,
    /// Displacements of q.
    pub position: DMatrix<f64>,
    /// Of v.
    pub velocity: DMatrix<f64>,
    /// Of a.
    pub acceleration: DMatrix<f64>,
    /// Of τ.
    pub torque: DMatrix<f64>,
    /// Of the channels.
    pub channel: DMatrix<f64>,
    /// Of their rates.
    pub channel_rate: DMatrix<f64>,
    /// Of their second rates.
    pub channel_second_rate: DMatrix<f64>,
}

impl NodeTangent {
    /// Room for tangents along `variables`, zero.
    pub fn new(sizes: &NodeSizes, variables: Vec<usize>) -> Self {
        let n = variables.len();
        let room = |columns| DMatrix::zeros(n, columns);
        Self {
            variables,
            weight: vec![0.0; n],
            time: vec![0.0; n],
            position: room(sizes.n_velocities),
            velocity: room(sizes.n_velocities),
            acceleration: room(sizes.n_accelerations),
            torque: room(sizes.n_torques),
            channel: room(sizes.n_channels),
            channel_rate: room(sizes.n_channels),
            channel_second_rate: room(sizes.n_channels),
        }
    }

    /// Adds to `out`, one entry for each of the variables, what a gradient by the node is for them.
    pub fn add_pulled_back(&self, gradient: &NodeGradient, out: &mut [f64]) {
        if gradient.time != 0.0 {
            out.iter_mut().zip(&self.time).for_each(|(out, t)| *out += gradient.time * t);
        }
        let parts = [
            (&self.position, &gradient.position),
            (&self.velocity, &gradient.velocity),
            (&self.acceleration, &gradient.acceleration),
            (&self.torque, &gradient.torque),
            (&self.channel, &gradient.channel),
            (&self.channel_rate, &gradient.channel_rate),
            (&self.channel_second_rate, &gradient.channel_second_rate),
        ];
        for (tangents, gradient) in parts {
            for (column, factor) in tangents.column_iter().zip(gradient) {
                // most gradients of terms are zero in most entries
                if *factor != 0.0 {
                    add_scaled(out, *factor, &column);
                }
            }
        }
    }
}

fn add_scaled(out: &mut [f64], factor: f64, column: &DVectorView<'_, f64>) {
    out.iter_mut().zip(column.iter()).for_each(|(out, x)| *out += factor * x);
}

/// What looks at the nodes of a forward sweep: number, node, quadrature weight, tangents.
pub type Visit<'a> = dyn FnMut(usize, &Node<'_>, f64, &NodeTangent) -> Result<(), EvaluationError> + 'a;

/// Makes of a decision vector a motion at nodes.
///
/// [`rollout`](Self::rollout) comes first; all else is at the z of the last one. After construction nothing allocates.
pub trait Transcription: Send {
    /// Sizes, bounds and phases, the same at all times.
    fn outline(&self) -> &Outline;

    /// Makes the nodes, their weights and the defects. Numbers that are not finite are an error.
    fn rollout(&mut self, z: &[f64]) -> Result<(), EvaluationError>;

    /// Node k of the last rollout.
    fn node(&self, k: usize) -> Node<'_>;

    /// ω_k, s: the weight of node k in integrals over time.
    fn weight(&self, k: usize) -> f64;

    /// The defects of the last rollout.
    fn defects(&self) -> &[f64];

    /// The variables on which node k depends, ascending.
    fn variables_of_node(&self, k: usize) -> Vec<usize>;

    /// The variables on which defect i depends, ascending.
    fn variables_of_defect(&self, i: usize) -> Vec<usize>;

    /// Adds to `gradient`, as long as z, what a gradient by the rollout is for z.
    fn pull_back(&mut self, by: &RolloutGradient, gradient: &mut [f64]) -> Result<(), EvaluationError>;

    /// Its second derivatives, where it has them.
    fn second_derivatives(&mut self) -> Option<&mut dyn RolloutSecondDerivatives>;

    /// Hands the tangents of all nodes to `visit`, in their order, and writes the gradient of each defect by its
    /// [`variables_of_defect`](Self::variables_of_defect) to `defects`, one after the other.
    fn push_forward(&mut self, defects: &mut [f64], visit: &mut Visit<'_>) -> Result<(), EvaluationError>;
}

/// Second derivatives of a [`Transcription`].
pub trait RolloutSecondDerivatives {
    /// Adds the second derivatives by z of a number whose gradient by the rollout is constant and is `by`, to the values
    /// of `pattern`, an upper triangle that holds the variables of each node together.
    fn add_second_derivatives(
        &mut self,
        by: &RolloutGradient,
        pattern: &Pattern,
        hessian: &mut [f64],
    ) -> Result<(), EvaluationError>;
}
