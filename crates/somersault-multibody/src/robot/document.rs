//! Elements of a document, with errors that name them.

use super::error::DocumentError;
use crate::error::ModelError;
use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use roxmltree::{Document, Node, ParsingOptions};
use std::fmt;

/// Far above any robot: a link with its joint takes some twenty nodes, white space included.
const MAX_NODES: u32 = 200_000;
/// The parser compares every attribute of a tag with every other.
const MAX_ATTRIBUTES: usize = 256;

pub(crate) fn parse(text: &str) -> Result<Document<'_>, DocumentError> {
    count_attributes(text)?;
    let options = ParsingOptions { allow_dtd: false, nodes_limit: MAX_NODES, ..Default::default() };
    Document::parse_with_options(text, options).map_err(|e| DocumentError::Xml { reason: e.to_string() })
}

/// Fails where `="` or `='` follows one `<` too often.
fn count_attributes(text: &str) -> Result<(), DocumentError> {
    let (mut line, mut count, mut assigned) = (1, 0, false);
    for byte in text.bytes() {
        line += u32::from(byte == b'\n');
        if byte == b'<' {
            count = 0;
        } else if assigned && matches!(byte, b'"' | b'\'') {
            count += 1;
            if count > MAX_ATTRIBUTES {
                return Err(DocumentError::TooManyAttributes { line, allowed: MAX_ATTRIBUTES });
            }
        }
        assigned = byte == b'=' || assigned && byte.is_ascii_whitespace();
    }
    Ok(())
}

/// The outermost element, which must have the tag of the format.
pub(crate) fn outermost<'a>(
    document: &'a Document<'a>,
    expected: &'static str,
) -> Result<Node<'a, 'a>, DocumentError> {
    let root = document.root_element();
    match root.tag_name().name() {
        found if found == expected => Ok(root),
        found => Err(DocumentError::OtherFormat { expected, found: shorten(found) }),
    }
}

/// The first 40 characters, for a message.
pub(crate) fn shorten(text: &str) -> String {
    match text.char_indices().nth(40) {
        Some((end, _)) => format!("{}…", &text[..end]),
        None => text.to_owned(),
    }
}

/// An element that has a name, or one inside of it, which is called by that name in messages.
#[derive(Clone, Copy)]
pub(crate) struct Element<'a> {
    node: Node<'a, 'a>,
    /// The tag for messages.
    owner: &'a str,
    pub(crate) name: Option<&'a str>,
    /// The file that it stands in; none for the document itself.
    pub(crate) file: Option<&'a str>,
}

impl<'a> Element<'a> {
    pub(crate) fn new(node: Node<'a, 'a>, name: Option<&'a str>) -> Self {
        Self { node, owner: node.tag_name().name(), name, file: None }
    }

    /// The same, called by another name.
    pub(crate) fn called(self, name: &'a str) -> Self {
        Self { name: Some(name), ..self }
    }

    /// The same, which stands in the file.
    pub(crate) fn of_file(self, file: Option<&'a str>) -> Self {
        Self { file, ..self }
    }

    /// An element that must have a name.
    pub(crate) fn named(node: Node<'a, 'a>) -> Result<Self, DocumentError> {
        let name = Self::new(node, Some("")).attribute("name")?;
        Ok(Self::new(node, Some(name)))
    }

    pub(crate) fn node(&self) -> Node<'a, 'a> {
        self.node
    }

    pub(crate) fn tag(&self) -> &'a str {
        self.node.tag_name().name()
    }

    /// Looked up from the start of the document: for errors only.
    pub(crate) fn line(&self) -> u32 {
        self.node.document().text_pos_at(self.node.range().start).row
    }

    /// The byte of the document at which it starts.
    pub(crate) fn start(&self) -> usize {
        self.node.range().start
    }

    pub(crate) fn rejected(&self, source: ModelError) -> DocumentError {
        DocumentError::Rejected { element: self.to_string(), line: self.line(), source }
    }

    pub(crate) fn duplicate(&self) -> DocumentError {
        DocumentError::DuplicateName { element: self.to_string(), line: self.line() }
    }

    pub(crate) fn optional(&self, child: &'static str) -> Result<Option<Self>, DocumentError> {
        let mut found = self.node.children().filter(|n| n.is_element() && n.tag_name().name() == child);
        match (found.next(), found.next()) {
            (first, None) => Ok(first.map(|node| Self { node, ..*self })),
            (_, Some(_)) => {
                Err(DocumentError::RepeatedElement { element: self.to_string(), line: self.line(), child })
            }
        }
    }

    pub(crate) fn required(&self, child: &'static str) -> Result<Self, DocumentError> {
        self.optional(child)?.ok_or_else(|| DocumentError::MissingElement {
            element: self.to_string(),
            line: self.line(),
            child,
        })
    }

    pub(crate) fn attribute(&self, attribute: &'static str) -> Result<&'a str, DocumentError> {
        self.node.attribute(attribute).ok_or_else(|| self.missing(attribute))
    }

    pub(crate) fn attribute_or_none(&self, attribute: &str) -> Option<&'a str> {
        self.node.attribute(attribute)
    }

    /// Those of its children that have this tag.
    pub(crate) fn all(self, child: &'static str) -> impl Iterator<Item = Self> {
        let found = self.node.children().filter(move |n| n.is_element() && n.tag_name().name() == child);
        found.map(move |node| Self { node, ..self })
    }

    pub(crate) fn missing(&self, attribute: &'static str) -> DocumentError {
        DocumentError::MissingAttribute { element: self.to_string(), line: self.line(), attribute }
    }

    /// N numbers that are not NaN, if the attribute is there.
    pub(crate) fn numbers<const N: usize>(
        &self,
        attribute: &'static str,
    ) -> Result<Option<[f64; N]>, DocumentError> {
        let Some(text) = self.node.attribute(attribute) else { return Ok(None) };
        let mut numbers = [f64::NAN; N];
        match self.fill(attribute, &mut numbers)? {
            count if count == N => Ok(Some(numbers)),
            _ => Err(self.bad_number(attribute, N, text)),
        }
    }

    /// Writes the numbers of an attribute, at most as many as there is room for, and says how many they are. NaN is refused.
    pub(crate) fn fill(&self, attribute: &'static str, room: &mut [f64]) -> Result<usize, DocumentError> {
        let Some(text) = self.node.attribute(attribute) else { return Ok(0) };
        let (most, mut count) = (room.len(), 0);
        for word in text.split_ascii_whitespace() {
            let number: f64 = word.parse().unwrap_or(f64::NAN);
            match room.get_mut(count) {
                Some(place) if !number.is_nan() => *place = number,
                _ => return Err(self.bad_number(attribute, most, text)),
            }
            count += 1;
        }
        Ok(count)
    }

    pub(crate) fn bad_number(&self, attribute: &'static str, expected: usize, found: &str) -> DocumentError {
        let (element, line) = (self.to_string(), self.line());
        DocumentError::BadNumber { element, line, attribute, expected, found: shorten(found) }
    }

    /// The attribute must be what `allowed` says.
    pub(crate) fn bad_value(&self, attribute: &'static str, allowed: impl Into<String>) -> DocumentError {
        let found = shorten(self.attribute_or_none(attribute).unwrap_or_default());
        let (element, line) = (self.to_string(), self.line());
        DocumentError::BadValue { element, line, attribute, allowed: allowed.into(), found }
    }

    /// Which of the words the attribute holds, if it is there.
    pub(crate) fn word(
        &self,
        attribute: &'static str,
        words: &[&'static str],
    ) -> Result<Option<&'static str>, DocumentError> {
        let Some(found) = self.attribute_or_none(attribute) else { return Ok(None) };
        let known = words.iter().copied().find(|word| *word == found);
        known.map(Some).ok_or_else(|| self.bad_value(attribute, words.join(", ")))
    }

    /// N finite numbers, if the attribute is there.
    pub(crate) fn finite<const N: usize>(
        &self,
        attribute: &'static str,
    ) -> Result<Option<[f64; N]>, DocumentError> {
        match self.numbers::<N>(attribute)? {
            Some(numbers) if numbers.iter().any(|x| x.is_infinite()) => {
                Err(self.bad_number(attribute, N, self.attribute(attribute)?))
            }
            numbers => Ok(numbers),
        }
    }

    pub(crate) fn number(&self, attribute: &'static str) -> Result<f64, DocumentError> {
        self.number_or_none(attribute)?.ok_or_else(|| self.missing(attribute))
    }

    pub(crate) fn number_or_none(&self, attribute: &'static str) -> Result<Option<f64>, DocumentError> {
        Ok(self.finite(attribute)?.map(|[x]| x))
    }

    /// A bound, which may be infinite; 0 if it is not given.
    pub(crate) fn bound(&self, attribute: &'static str) -> Result<f64, DocumentError> {
        Ok(self.numbers(attribute)?.map_or(0.0, |[x]| x))
    }

    pub(crate) fn vector(&self, attribute: &'static str) -> Result<Option<Vector3<f64>>, DocumentError> {
        Ok(self.finite(attribute)?.map(Vector3::from))
    }

    /// The rotation of a quaternion x, y, z, w of any length but zero, which is that of the attribute.
    pub(crate) fn rotation(
        &self,
        attribute: &'static str,
        xyzw: [f64; 4],
    ) -> Result<UnitQuaternion<f64>, DocumentError> {
        UnitQuaternion::try_new(Quaternion::from_vector(xyzw.into()), 0.0)
            .filter(|q| q.coords.iter().all(|x| x.is_finite()))
            .ok_or_else(|| self.bad_number(attribute, 4, "a quaternion without direction"))
    }
}

impl fmt::Display for Element<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.name {
            Some(name) => write!(f, "{} `{}`", self.owner, shorten(name))?,
            None => write!(f, "<{}>", self.owner)?,
        }
        match self.file {
            Some(file) => write!(f, " of `{}`", shorten(file)),
            None => Ok(()),
        }
    }
}
