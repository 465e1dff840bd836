//! What can be wrong with a document of MJCF.

use crate::robot::DocumentError;
use crate::robot::document::{Element, shorten};

/// Why a document is not a tree that can be read. `element` is the tag with its name, as in "joint `knee`", and its file if that was
/// included.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum MjcfError {
    /// No readable document, or an element that is not as every format has it.
    #[error(transparent)]
    Document(#[from] DocumentError),
    /// A file that is included is no readable document.
    #[error("the included file `{file}`: {source}")]
    Included {
        /// The file.
        file: String,
        /// What is wrong.
        source: DocumentError,
    },
    /// A file that is to be included is not in the folder of the document, or one below it.
    #[error(
        "{element} (line {line}) includes `{file}`: only files beside the document are, or in folders beside it"
    )]
    FileElsewhere {
        /// The element.
        element: String,
        /// Line of the document.
        line: u32,
        /// The file.
        file: String,
    },
    /// A file that is to be included cannot be read.
    #[error("{element} (line {line}) includes `{file}`: {reason}")]
    Unreadable {
        /// The element.
        element: String,
        /// Line of the document.
        line: u32,
        /// The file.
        file: String,
        /// Why.
        reason: String,
    },
    /// A file is included twice.
    #[error("{element} (line {line}) includes `{file}` again")]
    IncludedTwice {
        /// The element.
        element: String,
        /// Line of the document.
        line: u32,
        /// The file.
        file: String,
    },
    /// More files are included than allowed.
    #[error("more than {allowed} files are included")]
    TooManyFiles {
        /// Files allowed.
        allowed: usize,
    },
    /// An element that the format does not have in this place.
    #[error("{element} (line {line}) does not belong in <{parent}>")]
    UnknownElement {
        /// The element.
        element: String,
        /// Line of the document.
        line: u32,
        /// Tag of the element around it.
        parent: String,
    },
    /// An element names another that the document does not have.
    #[error("{element} (line {line}) names the {kind} `{name}`, which does not exist")]
    UnknownName {
        /// The element.
        element: String,
        /// Line of the document.
        line: u32,
        /// What is named: a class, a mesh or a joint.
        kind: &'static str,
        /// The name, at most 40 characters of it.
        name: String,
    },
    /// A rotation is given twice.
    #[error("{element} (line {line}) is turned by both `{first}` and `{second}`")]
    TwoRotations {
        /// The element.
        element: String,
        /// Line of the document.
        line: u32,
        /// An attribute.
        first: &'static str,
        /// The other one.
        second: &'static str,
    },
    /// What no tree of rigid bodies has, or what its file does not determine.
    #[error("{element} (line {line}) cannot be read: {reason}")]
    Refused {
        /// The element.
        element: String,
        /// Line of the document.
        line: u32,
        /// Why.
        reason: String,
    },
    /// The world of the document has no body.
    #[error("the document has no body")]
    NoBody,
}

impl MjcfError {
    pub(super) fn refused(element: &Element, reason: impl Into<String>) -> Self {
        Self::Refused { element: element.to_string(), line: element.line(), reason: reason.into() }
    }

    pub(super) fn unknown_name(element: &Element, kind: &'static str, name: &str) -> Self {
        Self::UnknownName { element: element.to_string(), line: element.line(), kind, name: shorten(name) }
    }

    pub(super) fn unknown_element(element: &Element, parent: &str) -> Self {
        Self::UnknownElement { element: element.to_string(), line: element.line(), parent: parent.to_owned() }
    }
}
