//! Where costs and constraints are taken.

use crate::core::error::Error;
use crate::ocp::arguments::index;
use somersault::ocp::problem::At;
use std::fmt;

/// Where a term is taken, as Python says it.
#[derive(Clone)]
pub(super) struct Place {
    pub(super) at: String,
    pub(super) node: Option<i64>,
    pub(super) phase: Option<i64>,
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "at '{}'", self.at)?;
        self.node.map_or(Ok(()), |node| write!(f, " {node}"))?;
        self.phase.map_or(Ok(()), |phase| write!(f, " of phase {phase}"))
    }
}

impl Place {
    pub(super) fn nodes(&self) -> Result<At, Error> {
        let node = self.node.map(|node| index("node", node)).transpose()?;
        let phase = self.phase.map(|phase| index("phase", phase)).transpose()?;
        match (self.at.as_str(), node, phase) {
            ("start", None, None) => Ok(At::Start),
            ("finish", None, None) => Ok(At::End),
            ("path" | "integral", None, None) => Ok(At::EveryNode),
            ("start", None, Some(phase)) => Ok(At::StartOf(phase)),
            ("finish", None, Some(phase)) => Ok(At::EndOf(phase)),
            ("path" | "integral", None, Some(phase)) => Ok(At::EveryNodeOf(phase)),
            ("node", Some(node), None) => Ok(At::Node(node)),
            ("node", None, _) => Err(Error::input("`node` must be given where `at` is 'node'")),
            ("node", Some(_), Some(_)) => {
                Err(Error::input("`phase` is not for `at` = 'node': nodes are counted through all phases"))
            }
            ("start" | "finish" | "path" | "integral", Some(_), _) => {
                Err(Error::input("`node` is for `at` = 'node'"))
            }
            (other, ..) => Err(Error::input(format!(
                "`at` must be 'start', 'finish', 'node' or 'path', or 'integral' of a constraint, found '{other}'"
            ))),
        }
    }
}
