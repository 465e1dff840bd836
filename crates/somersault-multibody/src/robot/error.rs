//! What can be wrong with a document of any format.

use crate::error::ModelError;

/// Why a document cannot be read, whatever its format. `element` is the tag with its name, as in "joint `elbow`".
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum DocumentError {
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
    #[error("the outermost element must be <{expected}>, found <{found}>")]
    OtherFormat {
        /// The tag of the format.
        expected: &'static str,
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
    /// An attribute holds none of its words, or a number out of its range.
    #[error("`{attribute}` of {element} (line {line}) must be {allowed}, found `{found}`")]
    BadValue {
        /// The element.
        element: String,
        /// Line of the document.
        line: u32,
        /// The attribute.
        attribute: &'static str,
        /// What it may hold.
        allowed: String,
        /// Its value, at most 40 characters of it.
        found: String,
    },
    /// Two elements of one kind and one name.
    #[error("{element} (line {line}) has the name of an earlier one")]
    DuplicateName {
        /// The element.
        element: String,
        /// Line of the document.
        line: u32,
    },
    /// The numbers describe no body or no joint.
    #[error("{element} (line {line}): {source}")]
    Rejected {
        /// The body, the joint or the robot.
        element: String,
        /// Line of the document.
        line: u32,
        /// What is wrong.
        source: ModelError,
    },
}
