//! What a file has of a robot: the tree, its geometry, what had to be repaired to have a tree, and what was ignored.

pub(crate) mod assembly;
pub(crate) mod document;
mod error;
pub(crate) mod findings;

use crate::model::Model;
use std::fmt;

pub use crate::geometry::{Geometry, GeometryPurpose, GeometryShape};
pub use error::DocumentError;

/// A tree read from a file, with what else the file has.
#[derive(Debug, Clone)]
pub struct Robot {
    /// Its name; empty if it has none.
    pub name: String,
    /// The tree.
    pub model: Model,
    /// The configuration in which the file shows it.
    pub reference: Vec<f64>,
    /// Names of its joints in the file, with the numbers of the bodies that they carry.
    pub joints: Vec<(String, usize)>,
    /// What the file says otherwise; empty if the tree is that of the file.
    pub repairs: Vec<Repair>,
    /// What the file says of its motion and the tree has not.
    pub ignored: Vec<Ignored>,
    /// What its bodies look like and collide with, in the order of the bodies. The dynamics do not read it.
    pub geometry: Vec<Geometry>,
}

/// Something of a file that acts on a robot, or is done to it, and is not read.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Ignored {
    /// The element, as in "joint `knee`".
    pub element: String,
    /// Line of the document.
    pub line: u32,
    /// What is ignored, and why.
    pub reason: String,
}

impl fmt::Display for Ignored {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { element, line, reason } = self;
        write!(f, "{element} (line {line}): {reason}")
    }
}

/// Something of a file that no tree can have, and what is in its place.
#[derive(Debug, Clone, PartialEq)]
pub struct Repair {
    /// The element, as in "link `hand`".
    pub element: String,
    /// Line of the document.
    pub line: u32,
    /// What was changed.
    pub change: Change,
}

/// The kinds of repairs.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum Change {
    /// No distribution of mass has these principal moments;
    /// [`MassProperties::nearest_possible`](crate::MassProperties::nearest_possible) stands for them.
    Inertia {
        /// Principal moments in the file, kg m².
        found: [f64; 3],
        /// Principal moments in the model, kg m².
        nearest: [f64; 3],
    },
    /// The joint moves no mass, nor do those that follow it: it is fixed, since nothing determines its acceleration.
    Locked {
        /// Its coordinate: the one in its limits that is nearest to zero, or what it follows makes of that; rad or m.
        at: f64,
    },
    /// A fixed joint that is to follow another one stays fixed.
    FixedFollower,
}

impl fmt::Display for Repair {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { element, line, change } = self;
        write!(f, "{element} (line {line}) ")?;
        match change {
            Change::Inertia { found, nearest } => {
                write!(f, "cannot have the principal moments {found:?}; the nearest possible are {nearest:?}")
            }
            Change::Locked { at } => write!(f, "moves no mass and is fixed at {at}"),
            Change::FixedFollower => write!(f, "is fixed and does not follow another joint"),
        }
    }
}
