//! What is not read: listed, or where it acts on the tree and nothing may be ignored, refused.

use super::MjcfError;
use crate::robot::document::{Element, shorten};
use crate::robot::findings::Findings;

pub(super) struct Report<'a> {
    pub(super) strict: bool,
    pub(super) findings: Findings<'a>,
}

impl Report<'_> {
    /// What would change the motion of the tree without contacts and actuators.
    pub(super) fn acts(&mut self, element: &Element, reason: &str) -> Result<(), MjcfError> {
        if self.strict {
            return Err(MjcfError::refused(element, reason));
        }
        self.findings.ignore(element, reason);
        Ok(())
    }

    /// What is done to the tree, or seen of it.
    pub(super) fn ignore(&mut self, element: &Element, reason: impl Into<String>) {
        self.findings.ignore(element, reason);
    }

    /// All attributes must be known: a new one may mean anything.
    pub(super) fn check_attributes(&mut self, element: &Element, known: &[&[&str]]) -> Result<(), MjcfError> {
        for attribute in element.node().attributes() {
            let name = attribute.name();
            if !known.iter().any(|names| names.contains(&name)) {
                self.acts(element, &format!("the attribute `{}` is not known", shorten(name)))?;
            }
        }
        Ok(())
    }
}
