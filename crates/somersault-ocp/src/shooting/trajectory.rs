//! Room for a motion: the stages of its steps, and its nodes.

use super::phase::Scheme;
use crate::dynamics::{Dofs, GroupTransport};
use crate::term::Node;
use crate::transcription::NodeSizes;

/// All evaluations of the dynamics, those of a step together; the first one of a step is that of its node.
#[derive(Debug, Default)]
pub(super) struct Stages {
    n: usize,
    n_positions: usize,
    n_channels: usize,
    per_step: usize,
    position: Vec<f64>,
    velocity: Vec<f64>,
    known: Vec<f64>,
    found: Vec<f64>,
    /// Channels, rates and second rates.
    channels: Vec<f64>,
    partials: Vec<f64>,
    /// Of the moves of each step.
    pub(super) transports: Vec<GroupTransport>,
}

/// Moves from one point of the group to another in a step: to each stage but the first, and those to the end.
pub(super) fn moves_per_step(scheme: Scheme) -> usize {
    let tableau = scheme.tableau();
    tableau.stages.len() + tableau.end.len()
}

impl Stages {
    pub(super) fn new(sizes: &NodeSizes, scheme: Scheme, n_nodes: usize, dofs: &Dofs) -> Self {
        let (n, per_step) = (sizes.n_velocities, scheme.n_stages());
        let count = n_nodes * per_step;
        Self {
            n,
            n_positions: sizes.n_positions,
            n_channels: sizes.n_channels,
            per_step,
            position: vec![0.0; count * sizes.n_positions],
            velocity: vec![0.0; count * n],
            known: vec![0.0; count * n],
            found: vec![0.0; count * n],
            channels: vec![0.0; count * 3 * sizes.n_channels],
            partials: vec![0.0; count * 3 * n * n],
            transports: vec![GroupTransport::new(dofs); n_nodes * moves_per_step(scheme)],
        }
    }

    /// Room for so many stages.
    pub(super) fn count(&self) -> usize {
        self.known.len() / self.n.max(1)
    }

    /// Number of a stage of the step that starts at a node.
    pub(super) fn number(&self, node: usize, stage: usize) -> usize {
        node * self.per_step + stage
    }

    pub(super) fn position(&self, i: usize) -> &[f64] {
        &self.position[i * self.n_positions..][..self.n_positions]
    }

    pub(super) fn velocity(&self, i: usize) -> &[f64] {
        &self.velocity[i * self.n..][..self.n]
    }

    pub(super) fn known(&self, i: usize) -> &[f64] {
        &self.known[i * self.n..][..self.n]
    }

    pub(super) fn found(&self, i: usize) -> &[f64] {
        &self.found[i * self.n..][..self.n]
    }

    /// Channels, their rates and their second rates.
    pub(super) fn channels(&self, i: usize) -> [&[f64]; 3] {
        let m = self.n_channels;
        let all = &self.channels[i * 3 * m..][..3 * m];
        [&all[..m], &all[m..2 * m], &all[2 * m..]]
    }

    /// By displacements of q, by v and by what is known; square, by columns.
    pub(super) fn partials(&self, i: usize) -> [&[f64]; 3] {
        let square = self.n * self.n;
        let all = &self.partials[i * 3 * square..][..3 * square];
        [&all[..square], &all[square..2 * square], &all[2 * square..]]
    }

    /// All of a stage to be written.
    pub(super) fn stage_mut(&mut self, i: usize) -> StageMut<'_> {
        let (n, n_q, m) = (self.n, self.n_positions, self.n_channels);
        let (c, rest) = self.channels[i * 3 * m..][..3 * m].split_at_mut(m);
        let (rate, second) = rest.split_at_mut(m);
        StageMut {
            position: &mut self.position[i * n_q..][..n_q],
            velocity: &mut self.velocity[i * n..][..n],
            known: &mut self.known[i * n..][..n],
            found: &mut self.found[i * n..][..n],
            channels: [c, rate, second],
            partials: &mut self.partials[i * 3 * n * n..][..3 * n * n],
        }
    }

    /// Writes the position of a stage from that of another one.
    pub(super) fn positions_apart(&mut self, from: usize, to: usize) -> (&[f64], &mut [f64]) {
        let n = self.n_positions;
        let (head, tail) = self.position.split_at_mut(to * n);
        (&head[from * n..][..n], &mut tail[..n])
    }
}

/// One evaluation of the dynamics.
pub(super) struct StageMut<'a> {
    pub(super) position: &'a mut [f64],
    pub(super) velocity: &'a mut [f64],
    pub(super) known: &'a mut [f64],
    pub(super) found: &'a mut [f64],
    pub(super) channels: [&'a mut [f64]; 3],
    pub(super) partials: &'a mut [f64],
}

/// What nodes have beyond their stage.
#[derive(Debug, Default)]
pub(super) struct Nodes {
    n: usize,
    pub(super) time: Vec<f64>,
    pub(super) weight: Vec<f64>,
    acceleration: Vec<f64>,
    torque: Vec<f64>,
}

impl Nodes {
    pub(super) fn new(sizes: &NodeSizes, n_nodes: usize) -> Self {
        let n = sizes.n_velocities;
        Self {
            n,
            time: vec![0.0; n_nodes],
            weight: vec![0.0; n_nodes],
            acceleration: vec![0.0; n_nodes * n],
            torque: vec![0.0; n_nodes * n],
        }
    }

    pub(super) fn weight(&self, k: usize) -> f64 {
        self.weight[k]
    }

    /// Sorts what is known and found at a node into accelerations and joint forces.
    pub(super) fn sort(&mut self, k: usize, stages: &Stages, active: &[bool]) {
        let (i, n) = (stages.number(k, 0), self.n);
        let (known, found) = (&stages.known[i * n..][..n], stages.found(i));
        let accelerations = &mut self.acceleration[k * n..][..n];
        let torques = &mut self.torque[k * n..][..n];
        for (dof, active) in active.iter().enumerate() {
            let (acceleration, torque) = (&mut accelerations[dof], &mut torques[dof]);
            (*acceleration, *torque) =
                if *active { (known[dof], found[dof]) } else { (found[dof], known[dof]) };
        }
    }

    pub(super) fn node<'a>(&'a self, k: usize, stages: &'a Stages) -> Node<'a> {
        let i = stages.number(k, 0);
        let [channel, channel_rate, channel_second_rate] = stages.channels(i);
        Node {
            time: self.time[k],
            position: stages.position(i),
            velocity: stages.velocity(i),
            acceleration: &self.acceleration[k * self.n..][..self.n],
            torque: &self.torque[k * self.n..][..self.n],
            channel,
            channel_rate,
            channel_second_rate,
        }
    }
}
