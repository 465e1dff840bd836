//! What can be wrong with a document.

use crate::error::ModelError;

/// Why a document is not a tree. `element` is the tag with its name, as in "joint `elbow`".
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum UrdfError {
    /// Not well-formed, a document type declaration, or more nodes than allowed.
    #[error("not a readable XML document: {reason}")]
    Xml {
        /// What the XML parser says, with the position.
        reason: String,
    },
    /// More attributes in one tag than any element of the format has.
    #[error("the tag in line {line} has more than {allowed} attributes")]
    TooManyAttributes {
        /// Line of the document.
        line: u32,
        /// Attributes allowed.
        allowed: usize,
    },
    /// The outermost element is another.
    #[error("the outermost element must be <robot>, found <{found}>")]
    NotARobot {
        /// Its tag.
        found: String,
    },
    /// An attribute that the format requires is missing.
    #[error("{element} (line {line}) has no attribute `{attribute}`")]
    MissingAttribute {
        /// The element.
        element: String,
        /// Line of the document.
        line: u32,
        /// The attribute.
        attribute: &'static str,
    },
    /// An element that the format requires is missing.
    #[error("{element} (line {line}) has no <{child}>")]
    MissingElement {
        /// The element.
        element: String,
        /// Line of the document.
        line: u32,
        /// Tag of what is missing.
        child: &'static str,
    },
    /// An element that may occur once occurs again.
    #[error("{element} (line {line}) has more than one <{child}>")]
    RepeatedElement {
        /// The element.
        element: String,
        /// Line of the document.
        line: u32,
        /// Tag of what is repeated.
        child: &'static str,
    },
    /// An attribute does not hold the finite numbers it must.
    #[error("`{attribute}` of {element} (line {line}) must be {expected} finite number(s), found `{found}`")]
    BadNumber {
        /// The element.
        element: String,
        /// Line of the document.
        line: u32,
        /// The attribute.
        attribute: &'static str,
        /// How many numbers it must hold.
        expected: usize,
        /// Its value, at most 40 characters of it.
        found: String,
    },
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
    /// Two links or two joints of one name.
    #[error("{element} (line {line}) has the name of an earlier one")]
    DuplicateName {
        /// The element.
        element: String,
        /// Line of the document.
        line: u32,
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
    /// The numbers describe no body or no joint.
    #[error("{element} (line {line}): {source}")]
    Rejected {
        /// The link, the joint or the robot.
        element: String,
        /// Line of the document.
        line: u32,
        /// What is wrong.
        source: ModelError,
    },
}
