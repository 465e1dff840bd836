//! Numbers of a node as they are.

use super::{Node, NodeGradient, Term};
use crate::error::OcpError;
use crate::transcription::NodeSizes;
use somersault_nlp::EvaluationError;

/// A part of a node.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Part {
    /// t, s: one number.
    Time,
    /// v.
    Velocity,
    /// a.
    Acceleration,
    /// τ.
    Torque,
    /// Channels of the joint motion.
    Channel,
    /// Their rates.
    ChannelRate,
    /// Their second rates.
    ChannelSecondRate,
}

impl Part {
    pub(super) const ALL: [Self; 7] = [
        Self::Time,
        Self::Velocity,
        Self::Acceleration,
        Self::Torque,
        Self::Channel,
        Self::ChannelRate,
        Self::ChannelSecondRate,
    ];

    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Time => "time",
            Self::Velocity => "velocity",
            Self::Acceleration => "acceleration",
            Self::Torque => "torque",
            Self::Channel => "channel",
            Self::ChannelRate => "channel rate",
            Self::ChannelSecondRate => "channel second rate",
        }
    }

    fn len(self, sizes: &NodeSizes) -> usize {
        match self {
            Self::Time => 1,
            Self::Velocity => sizes.n_velocities,
            Self::Acceleration => sizes.n_accelerations,
            Self::Torque => sizes.n_torques,
            Self::Channel | Self::ChannelRate | Self::ChannelSecondRate => sizes.n_channels,
        }
    }

    pub(super) fn of<'a>(self, node: &'a Node<'_>) -> &'a [f64] {
        match self {
            Self::Time => std::slice::from_ref(&node.time),
            Self::Velocity => node.velocity,
            Self::Acceleration => node.acceleration,
            Self::Torque => node.torque,
            Self::Channel => node.channel,
            Self::ChannelRate => node.channel_rate,
            Self::ChannelSecondRate => node.channel_second_rate,
        }
    }

    pub(super) fn gradient(self, gradient: &mut NodeGradient) -> &mut [f64] {
        match self {
            Self::Time => std::slice::from_mut(&mut gradient.time),
            Self::Velocity => &mut gradient.velocity,
            Self::Acceleration => &mut gradient.acceleration,
            Self::Torque => &mut gradient.torque,
            Self::Channel => &mut gradient.channel,
            Self::ChannelRate => &mut gradient.channel_rate,
            Self::ChannelSecondRate => &mut gradient.channel_second_rate,
        }
    }
}

/// Some numbers of one part of a node.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Entries {
    part: Part,
    entries: Vec<usize>,
}

impl Entries {
    /// The given entries of a part, which must be there.
    pub fn try_new(sizes: &NodeSizes, part: Part, entries: &[usize]) -> Result<Self, OcpError> {
        for entry in entries {
            crate::error::expect_below(part.name(), *entry, part.len(sizes))?;
        }
        Ok(Self { part, entries: entries.to_vec() })
    }

    /// All entries of a part.
    pub fn all(sizes: &NodeSizes, part: Part) -> Self {
        Self { part, entries: (0..part.len(sizes)).collect() }
    }
}

impl Term for Entries {
    fn name(&self) -> &str {
        self.part.name()
    }

    fn n_rows(&self) -> usize {
        self.entries.len()
    }

    fn is_linear(&self) -> bool {
        true
    }

    fn evaluate(&mut self, node: &Node<'_>, rows: &mut [f64]) -> Result<(), EvaluationError> {
        let part = self.part.of(node);
        rows.iter_mut().zip(&self.entries).for_each(|(row, entry)| *row = part[*entry]);
        Ok(())
    }

    fn pull_back(
        &mut self,
        _node: &Node<'_>,
        y: &[f64],
        gradient: &mut NodeGradient,
    ) -> Result<(), EvaluationError> {
        let part = self.part.gradient(gradient);
        y.iter().zip(&self.entries).for_each(|(y, entry)| part[*entry] += y);
        Ok(())
    }
}
