//! What the orientations of a path depend on: forward to a node, or backward from all.

use super::OrientationPath;
use nalgebra::{Matrix3, Vector3};
use somersault_core::argument::{expect_length, expect_range};
use somersault_multibody::DynamicsError;
use somersault_multibody::flight::FlightError;
use somersault_multibody::flight::step::{SIMPSON, STAGES};

/// Derivatives of the orientation at a node.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct NodeDerivatives {
    /// By a displacement of the start, in axes of the root there.
    pub by_start: Matrix3<f64>,
    /// By the turn momentum, world axes.
    pub by_momentum: Matrix3<f64>,
    /// By each coefficient.
    pub by_coefficients: Vec<Vector3<f64>>,
}

impl NodeDerivatives {
    /// Room for them.
    pub fn new(n_coefficients: usize) -> Self {
        Self { by_coefficients: vec![Vector3::zeros(); n_coefficients], ..Self::default() }
    }
}

impl NodeDerivatives {
    /// Those at the first node.
    pub(super) fn begin(&mut self) {
        self.by_start = Matrix3::identity();
        self.by_momentum = Matrix3::zeros();
        self.by_coefficients.fill(Vector3::zeros());
    }
}

/// The gradient of a number by all that a path depends on.
#[derive(Debug, Clone, PartialEq)]
pub struct PathGradient {
    /// By a displacement of the start, in axes of the root there.
    pub by_start: Vector3<f64>,
    /// By the turn momentum, world axes.
    pub by_momentum: Vector3<f64>,
    /// By each coefficient.
    pub by_coefficients: Vec<f64>,
}

impl PathGradient {
    /// Room for it, zero.
    pub fn new(n_coefficients: usize) -> Self {
        let by_start = Vector3::zeros();
        Self { by_start, by_momentum: by_start, by_coefficients: vec![0.0; n_coefficients] }
    }

    /// Zero in all entries.
    pub fn clear(&mut self) {
        self.by_start = Vector3::zeros();
        self.by_momentum = Vector3::zeros();
        self.by_coefficients.fill(0.0);
    }
}

impl OrientationPath {
    /// The derivatives of the orientation at a node: of its displacement in axes of the root there.
    pub fn node_derivatives(&self, node: usize, out: &mut NodeDerivatives) -> Result<(), FlightError> {
        self.expect_derived("node_derivatives")?;
        let (allowed, inside) = ("at most the number of steps", |_| node <= self.n_steps);
        expect_range("node", node as f64, allowed, inside).map_err(DynamicsError::from)?;
        self.expect_coefficients("out.by_coefficients", out.by_coefficients.len())?;
        out.by_coefficients.fill(Vector3::zeros());
        out.by_momentum = Matrix3::zeros();
        let mut transition = Matrix3::identity();
        for step in (0..node).rev() {
            if step + 1 < node {
                transition *= self.passage(step + 1);
            }
            let derivative = &self.derivatives[step];
            for stage in (0..STAGES).filter(|stage| !self.is_idle(*stage)) {
                let to_node = transition * derivative.by_stage[stage];
                out.by_momentum += to_node * self.stages.by_momentum[step * STAGES + stage];
                self.add_inputs(step, stage, |coefficient, by| {
                    out.by_coefficients[coefficient] += to_node * by
                });
            }
            transition *= derivative.by_start;
        }
        out.by_start = transition;
        Ok(())
    }

    /// Refuses to read derivatives that the last run has not made.
    fn expect_derived(&self, reader: &'static str) -> Result<(), FlightError> {
        if self.is_derived { Ok(()) } else { Err(FlightError::NoDerivatives { reader }) }
    }

    /// Takes the derivatives at the start of a step to where it arrives.
    pub(super) fn carry_to_arrival(&self, step: usize, derivatives: &mut NodeDerivatives) {
        let own = &self.derivatives[step];
        let NodeDerivatives { by_start, by_momentum, by_coefficients } = derivatives;
        *by_start = own.by_start * *by_start;
        *by_momentum = own.by_start * *by_momentum;
        by_coefficients.iter_mut().for_each(|by| *by = own.by_start * *by);
        for stage in (0..STAGES).filter(|stage| !self.is_idle(*stage)) {
            let to_end = own.by_stage[stage];
            *by_momentum += to_end * self.stages.by_momentum[step * STAGES + stage];
            self.add_inputs(step, stage, |coefficient, by| by_coefficients[coefficient] += to_end * by);
        }
    }

    /// Takes the derivatives of an arrival past a restart.
    pub(super) fn pass(&self, node: usize, derivatives: &mut NodeDerivatives) {
        let NodeDerivatives { by_start, by_momentum, by_coefficients } = derivatives;
        let passage = self.passage(node);
        *by_start = passage * *by_start;
        *by_momentum = passage * *by_momentum;
        by_coefficients.iter_mut().for_each(|by| *by = passage * *by);
    }

    /// What a restart at this node makes of a displacement.
    fn passage(&self, node: usize) -> Matrix3<f64> {
        self.restart.as_ref().filter(|r| r.node == node).map_or_else(Matrix3::identity, |r| r.derivative)
    }

    /// Adds to `gradient` what a gradient by displacements of the orientation at each node, after a restart, is for the start, the
    /// turn momentum and the coefficients. Costs two sweeps of the steps, whatever the number of parameters.
    pub fn pull_back(
        &self,
        by_nodes: &[Vector3<f64>],
        gradient: &mut PathGradient,
    ) -> Result<(), FlightError> {
        self.pull_back_arrival(by_nodes, &Vector3::zeros(), gradient)
    }

    /// The same, and what a gradient by a displacement with which the path arrives at its restart is.
    pub fn pull_back_arrival(
        &self,
        by_nodes: &[Vector3<f64>],
        by_arrival: &Vector3<f64>,
        gradient: &mut PathGradient,
    ) -> Result<(), FlightError> {
        self.expect_coefficients("gradient.by_coefficients", gradient.by_coefficients.len())?;
        let at_start = self.sweep_back(by_nodes, by_arrival, |step, _, adjoint| {
            let derivative = &self.derivatives[step];
            for stage in (0..STAGES).filter(|stage| !self.is_idle(*stage)) {
                let weight = derivative.by_stage[stage].tr_mul(adjoint);
                gradient.by_momentum += self.stages.by_momentum[step * STAGES + stage].tr_mul(&weight);
                self.add_inputs(step, stage, |coefficient, by| {
                    gradient.by_coefficients[coefficient] += by.dot(&weight);
                });
            }
        })?;
        gradient.by_start += at_start;
        Ok(())
    }

    /// Hands out the adjoints of a number at the end of each step, last first: past a restart there, and before it.
    /// Returns that of the start.
    pub(super) fn sweep_back(
        &self,
        by_nodes: &[Vector3<f64>],
        by_arrival: &Vector3<f64>,
        mut visit: impl FnMut(usize, &Vector3<f64>, &Vector3<f64>),
    ) -> Result<Vector3<f64>, FlightError> {
        self.expect_derived("pull_back")?;
        expect_length("by_nodes", by_nodes.len(), self.n_steps + 1).map_err(DynamicsError::from)?;
        let mut adjoint = by_nodes[self.n_steps];
        for step in (0..self.n_steps).rev() {
            let past = adjoint;
            if let Some(restart) = self.restart.as_ref().filter(|restart| restart.node == step + 1) {
                adjoint = restart.derivative.tr_mul(&past) + by_arrival;
            }
            visit(step, &past, &adjoint);
            adjoint = self.derivatives[step].by_start.tr_mul(&adjoint) + by_nodes[step];
        }
        Ok(adjoint)
    }

    /// Whether a stage repeats another.
    pub(super) fn is_idle(&self, stage: usize) -> bool {
        self.is_planar && SIMPSON[stage] == 0.0
    }

    /// Hands out ∂ω of a stage by each coefficient that acts in it.
    fn add_inputs(&self, step: usize, stage: usize, mut add: impl FnMut(usize, Vector3<f64>)) {
        let (n, n_channels) = (self.motion.basis().n_coefficients(), self.motion.n_channels());
        let [values, slopes] = &self.basis[self.sample(step, stage)];
        let at = (step * STAGES + stage) * n_channels;
        for k in 0..n_channels {
            let (by_channel, by_rate) = (self.stages.by_channel[at + k], self.stages.by_rate[at + k]);
            for j in 0..self.motion.basis().n_active() {
                add(k * n + self.first(step) + j, by_channel * values[j] + by_rate * slopes[j]);
            }
        }
    }
}
