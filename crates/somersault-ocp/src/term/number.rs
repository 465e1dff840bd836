//! One number of a node.

use super::{Node, NodeGradient, Part};

/// A number of a node, by itself.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum NodeNumber {
    /// The position of a joint that has one: its place in q, and its degree of freedom.
    Position {
        /// In q.
        place: usize,
        /// In v.
        dof: usize,
    },
    /// An entry of a part.
    Of(Part, usize),
}

impl NodeNumber {
    /// Its value.
    pub fn value(self, node: &Node<'_>) -> f64 {
        match self {
            Self::Position { place, .. } => node.position[place],
            Self::Of(part, entry) => part.of(node)[entry],
        }
    }

    /// What a gradient has for it.
    pub fn gradient(self, gradient: &mut NodeGradient) -> &mut f64 {
        match self {
            Self::Position { dof, .. } => &mut gradient.position[dof],
            Self::Of(part, entry) => &mut part.gradient(gradient)[entry],
        }
    }
}
