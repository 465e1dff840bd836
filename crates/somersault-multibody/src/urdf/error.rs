//! What can be wrong with a document.

use crate::robot::DocumentError;

/// Why a document is not a tree. `element` is the tag with its name, as in "joint `elbow`".
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum UrdfError {
    /// No readable document, or an element that is not as every format has it.
    #[error(transparent)]
    Document(#[from] DocumentError),
    /// A rotation is given twice.
    #[error("{element} (line {line}) has an origin with both `rpy` and `quat_xyzw`")]
    TwoRotations {
        /// The element.
        element: String,
        /// Line of the document.
        line: u32,
    },
    /// There is no such type of joint.
    #[error("{element} (line {line}) has the unknown type `{found}`")]
    UnknownJointType {
        /// The joint.
        element: String,
        /// Line of the document.
        line: u32,
        /// The type, at most 40 characters of it.
        found: String,
    },
    /// A joint mimics one that the document does not have.
    #[error("{element} (line {line}) mimics the joint `{joint}`, which does not exist")]
    UnknownJoint {
        /// The joint.
        element: String,
        /// Line of the document.
        line: u32,
        /// The joint that was to lead.
        joint: String,
    },
    /// A joint names a link that the document does not have.
    #[error("{element} (line {line}) names the link `{link}`, which does not exist")]
    UnknownLink {
        /// The joint.
        element: String,
        /// Line of the document.
        line: u32,
        /// The link.
        link: String,
    },
    /// A link is the child of two joints.
    #[error("{element} (line {line}) has the child `{link}`, which is that of joint `{other}` already")]
    SecondParent {
        /// The joint.
        element: String,
        /// Line of the document.
        line: u32,
        /// The link.
        link: String,
        /// The other joint.
        other: String,
    },
    /// A tree has one root.
    #[error("link `{second}` is the child of no joint, but neither is link `{first}`")]
    SeveralRoots {
        /// The first link without a parent.
        first: String,
        /// The second.
        second: String,
    },
    /// A link hangs on itself.
    #[error("link `{link}` is part of a cycle, or hangs on one")]
    Cycle {
        /// The link.
        link: String,
    },
    /// The document has no link.
    #[error("the robot has no link")]
    NoLink,
    /// URDF cannot say this.
    #[error("{element} cannot be written: {reason}")]
    NotRepresentable {
        /// The link.
        element: String,
        /// Why.
        reason: &'static str,
    },
}
