//! Elements of a document, with errors that name them.

use super::UrdfError;
use crate::error::ModelError;
use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use roxmltree::{Document, Node, ParsingOptions};
use std::fmt;

/// Far above any robot: a link with its joint takes some twenty nodes, white space included.
const MAX_NODES: u32 = 200_000;
/// The parser compares every attribute of a tag with every other.
const MAX_ATTRIBUTES: usize = 256;

pub(super) fn parse(text: &str) -> Result<Document<'_>, UrdfError> {
    count_attributes(text)?;
    let options = ParsingOptions { allow_dtd: false, nodes_limit: MAX_NODES, ..Default::default() };
    Document::parse_with_options(text, options).map_err(|e| UrdfError::Xml { reason: e.to_string() })
}

/// Fails where `="` or `='` follows one `<` too often.
fn count_attributes(text: &str) -> Result<(), UrdfError> {
    let (mut line, mut count, mut assigned) = (1, 0, false);
    for byte in text.bytes() {
        line += u32::from(byte == b'\n');
        if byte == b'<' {
            count = 0;
        } else if assigned && matches!(byte, b'"' | b'\'') {
            count += 1;
            if count > MAX_ATTRIBUTES {
                return Err(UrdfError::TooManyAttributes { line, allowed: MAX_ATTRIBUTES });
            }
        }
        assigned = byte == b'=' || assigned && byte.is_ascii_whitespace();
    }
    Ok(())
}

/// The first 40 characters, for a message.
pub(super) fn shorten(text: &str) -> String {
    match text.char_indices().nth(40) {
        Some((end, _)) => format!("{}…", &text[..end]),
        None => text.to_owned(),
    }
}

/// An element of a link or a joint, or one of these itself.
#[derive(Clone, Copy)]
pub(super) struct Element<'a> {
    node: Node<'a, 'a>,
    /// Tag and name of the link or the joint, for messages.
    owner: &'a str,
    pub(super) name: &'a str,
}

impl<'a> Element<'a> {
    /// A link, a joint or the robot; `name` is of it.
    pub(super) fn new(node: Node<'a, 'a>, name: &'a str) -> Self {
        Self { node, owner: node.tag_name().name(), name }
    }

    /// A link or a joint, which must have a name.
    pub(super) fn named(node: Node<'a, 'a>) -> Result<Self, UrdfError> {
        let name = Self::new(node, "").attribute("name")?;
        Ok(Self::new(node, name))
    }

    /// Looked up from the start of the document: for errors only.
    pub(super) fn line(&self) -> u32 {
        self.node.document().text_pos_at(self.node.range().start).row
    }

    /// The byte of the document at which it starts.
    pub(super) fn start(&self) -> usize {
        self.node.range().start
    }

    pub(super) fn rejected(&self, source: ModelError) -> UrdfError {
        UrdfError::Rejected { element: self.to_string(), line: self.line(), source }
    }

    pub(super) fn optional(&self, child: &'static str) -> Result<Option<Self>, UrdfError> {
        let mut found = self.node.children().filter(|n| n.is_element() && n.tag_name().name() == child);
        match (found.next(), found.next()) {
            (first, None) => Ok(first.map(|node| Self { node, ..*self })),
            (_, Some(_)) => {
                Err(UrdfError::RepeatedElement { element: self.to_string(), line: self.line(), child })
            }
        }
    }

    pub(super) fn required(&self, child: &'static str) -> Result<Self, UrdfError> {
        self.optional(child)?.ok_or_else(|| UrdfError::MissingElement {
            element: self.to_string(),
            line: self.line(),
            child,
        })
    }

    pub(super) fn attribute(&self, attribute: &'static str) -> Result<&'a str, UrdfError> {
        self.node.attribute(attribute).ok_or_else(|| self.missing(attribute))
    }

    pub(super) fn attribute_or_none(&self, attribute: &'static str) -> Option<&'a str> {
        self.node.attribute(attribute)
    }

    /// Those of its children that have this tag.
    pub(super) fn all(self, child: &'static str) -> impl Iterator<Item = Self> {
        let found = self.node.children().filter(move |n| n.is_element() && n.tag_name().name() == child);
        found.map(move |node| Self { node, ..self })
    }

    pub(super) fn missing(&self, attribute: &'static str) -> UrdfError {
        UrdfError::MissingAttribute { element: self.to_string(), line: self.line(), attribute }
    }

    /// N numbers that are not NaN, if the attribute is there.
    fn numbers<const N: usize>(&self, attribute: &'static str) -> Result<Option<[f64; N]>, UrdfError> {
        let Some(text) = self.node.attribute(attribute) else { return Ok(None) };
        let mut numbers = [f64::NAN; N];
        let mut words = text.split_ascii_whitespace();
        for x in &mut numbers {
            *x = words.next().and_then(|word| word.parse().ok()).unwrap_or(f64::NAN);
        }
        if words.next().is_some() || numbers.iter().any(|x| x.is_nan()) {
            return Err(self.bad_number(attribute, N, text));
        }
        Ok(Some(numbers))
    }

    fn bad_number(&self, attribute: &'static str, expected: usize, found: &str) -> UrdfError {
        let (element, line) = (self.to_string(), self.line());
        UrdfError::BadNumber { element, line, attribute, expected, found: shorten(found) }
    }

    /// N finite numbers, if the attribute is there.
    fn finite<const N: usize>(&self, attribute: &'static str) -> Result<Option<[f64; N]>, UrdfError> {
        match self.numbers::<N>(attribute)? {
            Some(numbers) if numbers.iter().any(|x| x.is_infinite()) => {
                Err(self.bad_number(attribute, N, self.attribute(attribute)?))
            }
            numbers => Ok(numbers),
        }
    }

    pub(super) fn number(&self, attribute: &'static str) -> Result<f64, UrdfError> {
        self.number_or_none(attribute)?.ok_or_else(|| self.missing(attribute))
    }

    pub(super) fn number_or_none(&self, attribute: &'static str) -> Result<Option<f64>, UrdfError> {
        Ok(self.finite(attribute)?.map(|[x]| x))
    }

    /// A bound, which may be infinite; 0 if it is not given.
    pub(super) fn bound(&self, attribute: &'static str) -> Result<f64, UrdfError> {
        Ok(self.numbers(attribute)?.map_or(0.0, |[x]| x))
    }

    pub(super) fn vector(&self, attribute: &'static str) -> Result<Option<Vector3<f64>>, UrdfError> {
        Ok(self.finite(attribute)?.map(Vector3::from))
    }

    /// Position and rotation of the `<origin>` of this element.
    pub(super) fn origin(&self) -> Result<(Vector3<f64>, UnitQuaternion<f64>), UrdfError> {
        let Some(origin) = self.optional("origin")? else {
            return Ok((Vector3::zeros(), UnitQuaternion::identity()));
        };
        let position = origin.vector("xyz")?.unwrap_or_default();
        let rotation = match (origin.finite("rpy")?, origin.finite("quat_xyzw")?) {
            (None, None) => UnitQuaternion::identity(),
            (Some([roll, pitch, yaw]), None) => UnitQuaternion::from_euler_angles(roll, pitch, yaw),
            (None, Some(q)) => UnitQuaternion::try_new(Quaternion::from_vector(q.into()), 0.0)
                .filter(|q| q.coords.iter().all(|x| x.is_finite()))
                .ok_or_else(|| origin.bad_number("quat_xyzw", 4, "a quaternion without direction"))?,
            (Some(_), Some(_)) => {
                return Err(UrdfError::TwoRotations { element: self.to_string(), line: origin.line() });
            }
        };
        Ok((position, rotation))
    }
}

impl fmt::Display for Element<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} `{}`", self.owner, shorten(self.name))
    }
}
