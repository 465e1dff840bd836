//! Accelerations and joint forces of a flight.
//!
//! With the joints active and the root passive, hybrid dynamics have the accelerations a_s of the joints as known and give
//!
//! ```text
//! (a_root, τ_s) = h(q, v, a_s),   δ(a_root, τ_s) = ∂h/∂q δq + ∂h/∂v δv + ∂h/∂a_s δa_s
//! ```

use crate::term::NodeGradient;
use crate::transcription::NodeTangent;
use nalgebra::{DMatrix, DVector};
use somersault_multibody::joint_motion::EigenpostureBase;
use somersault_multibody::{Data, DerivativeData, DynamicsError, Model, Split};
use somersault_nlp::EvaluationError;

/// The root passive, all other degrees of freedom active.
pub(crate) fn joints_active(model: &Model) -> Split {
    let n_root = model.velocities_of(0).len();
    Split::new((0..model.n_velocities()).map(|k| k >= n_root).collect())
}

/// Accelerations and forces at the nodes, and room for their derivatives.
#[derive(Debug, Clone)]
pub(super) struct Forces {
    split: Split,
    n_root: usize,
    data: Data,
    partials: DerivativeData,
    accelerations: Vec<f64>,
    torques: Vec<f64>,
    weights: DVector<f64>,
    by_known: DVector<f64>,
    by_channel: Vec<f64>,
    answers: DMatrix<f64>,
    directions: DMatrix<f64>,
}

impl Forces {
    pub(super) fn new(model: &Model, base: &EigenpostureBase, n_nodes: usize, n_variables: usize) -> Self {
        let n = model.n_velocities();
        let n_root = model.velocities_of(0).len();
        let mut directions = DMatrix::zeros(n, base.n_weights());
        directions.rows_mut(n_root, n - n_root).copy_from(&base.directions());
        Self {
            split: joints_active(model),
            n_root,
            data: Data::new(model),
            partials: DerivativeData::new(model),
            accelerations: vec![0.0; n_nodes * n],
            torques: vec![0.0; n_nodes * n],
            weights: DVector::zeros(n),
            by_known: DVector::zeros(n),
            by_channel: vec![0.0; base.n_weights()],
            answers: DMatrix::zeros(n_variables, n),
            directions,
        }
    }

    /// Accelerations of a node.
    pub(super) fn acceleration(&self, k: usize) -> &[f64] {
        let n = self.weights.len();
        &self.accelerations[k * n..(k + 1) * n]
    }

    /// Forces at a node, zero for the root.
    pub(super) fn torque(&self, k: usize) -> &[f64] {
        let n = self.weights.len();
        &self.torques[k * n..(k + 1) * n]
    }

    /// Computes them from the second rates of the channels.
    pub(super) fn evaluate(
        &mut self,
        model: &Model,
        base: &EigenpostureBase,
        k: usize,
        [q, v, second]: [&[f64]; 3],
    ) -> Result<(), DynamicsError> {
        let n = v.len();
        let acceleration = &mut self.accelerations[k * n..(k + 1) * n];
        let torque = &mut self.torques[k * n..(k + 1) * n];
        base.rates_into(second, &mut acceleration[self.n_root..]);
        torque.fill(0.0);
        model.hybrid_dynamics(&mut self.data, &self.split, q, v, acceleration, torque, &[])
    }

    /// Moves the parts of a gradient by accelerations and forces to those by positions, velocities and second rates.
    pub(super) fn pull_back(
        &mut self,
        model: &Model,
        base: &EigenpostureBase,
        k: usize,
        [q, v]: [&[f64]; 2],
        gradient: &mut NodeGradient,
    ) -> Result<(), EvaluationError> {
        let none = |values: &[f64]| values.iter().all(|g| *g == 0.0);
        if none(&gradient.acceleration) && none(&gradient.torque) {
            return Ok(());
        }
        let (n, n_root) = (v.len(), self.n_root);
        self.weights.rows_mut(0, n_root).copy_from_slice(&gradient.acceleration[..n_root]);
        self.weights.rows_mut(n_root, n - n_root).copy_from_slice(&gradient.torque[n_root..]);
        let known = known(&self.accelerations[k * n..(k + 1) * n], n_root);
        let found = model
            .hybrid_dynamics_partials(&mut self.partials, &self.split, q, v, &known, &[])
            .map_err(undefined)?;
        for dof in 0..n {
            gradient.position[dof] += found.q.column(dof).dot(&self.weights);
            gradient.velocity[dof] += found.v.column(dof).dot(&self.weights);
        }
        found.input.tr_mul_to(&self.weights, &mut self.by_known);
        for dof in n_root..n {
            self.by_known[dof] += gradient.acceleration[dof];
        }
        self.by_channel.fill(0.0);
        base.pull_back(&self.by_known.as_slice()[n_root..], &mut self.by_channel);
        let parts = gradient.channel_second_rate.iter_mut().zip(&self.by_channel);
        parts.for_each(|(sum, by)| *sum += by);
        Ok(())
    }

    /// Completes the tangents of a node.
    pub(super) fn push_forward(
        &mut self,
        model: &Model,
        k: usize,
        [q, v]: [&[f64]; 2],
        tangent: &mut NodeTangent,
    ) -> Result<(), EvaluationError> {
        let (n, n_root) = (v.len(), self.n_root);
        let known = known(&self.accelerations[k * n..(k + 1) * n], n_root);
        let found = model
            .hybrid_dynamics_partials(&mut self.partials, &self.split, q, v, &known, &[])
            .map_err(undefined)?;
        let by_channel = found.input * &self.directions;
        self.answers.gemm(1.0, &tangent.position, &found.q.transpose(), 0.0);
        self.answers.gemm(1.0, &tangent.velocity, &found.v.transpose(), 1.0);
        self.answers.gemm(1.0, &tangent.channel_second_rate, &by_channel.transpose(), 1.0);
        tangent.torque.fill(0.0);
        tangent.acceleration.gemm(1.0, &tangent.channel_second_rate, &self.directions.transpose(), 0.0);
        tangent.acceleration.columns_mut(0, n_root).copy_from(&self.answers.columns(0, n_root));
        tangent.torque.columns_mut(n_root, n - n_root).copy_from(&self.answers.columns(n_root, n - n_root));
        Ok(())
    }
}

/// What hybrid dynamics take: no force on the root, accelerations of the joints.
fn known(acceleration: &[f64], n_root: usize) -> Vec<f64> {
    acceleration.iter().enumerate().map(|(dof, a)| if dof < n_root { 0.0 } else { *a }).collect()
}

fn undefined(error: DynamicsError) -> EvaluationError {
    EvaluationError::Undefined { what: error.to_string() }
}
