//! What is reported of a document besides its tree.

use super::document::Element;
use super::{Change, Ignored, Repair};
use std::collections::HashMap;

/// The lists of repairs and of what is ignored, with what finds the line of an element.
pub(crate) struct Findings<'a> {
    /// Where the lines of each file end; the document itself has no name.
    ends: HashMap<Option<&'a str>, Vec<usize>>,
    pub(crate) repairs: Vec<Repair>,
    pub(crate) ignored: Vec<Ignored>,
}

impl<'a> Findings<'a> {
    pub(crate) fn new(files: impl IntoIterator<Item = (Option<&'a str>, &'a str)>) -> Self {
        let ends = |text: &str| text.match_indices('\n').map(|(end, _)| end).collect();
        let ends = files.into_iter().map(|(file, text)| (file, ends(text))).collect();
        Self { ends, repairs: Vec::new(), ignored: Vec::new() }
    }

    fn line(&self, element: &Element) -> u32 {
        let ends = self.ends.get(&element.file).map_or(&[][..], Vec::as_slice);
        ends.partition_point(|&end| end < element.start()) as u32 + 1
    }

    pub(crate) fn repair(&mut self, element: &Element, change: Change) {
        let line = self.line(element);
        self.repairs.push(Repair { element: element.to_string(), line, change });
    }

    pub(crate) fn ignore(&mut self, element: &Element, reason: impl Into<String>) {
        let line = self.line(element);
        self.ignored.push(Ignored { element: element.to_string(), line, reason: reason.into() });
    }
}
