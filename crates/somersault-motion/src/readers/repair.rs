//! What is put right in a file that is not quite of its format.

use super::{Place, ReadError};
use std::borrow::Cow;
use std::fmt;

/// Something that was put right in a file, or decided where the file leaves it open.
#[derive(Debug, Clone, PartialEq)]
pub struct Repair {
    /// Whether nothing was wrong: a decision, which strict readers make too.
    pub is_decision: bool,
    /// Where, of several places the first.
    pub place: Place,
    /// What was found, and what was made of it.
    pub what: Cow<'static, str>,
    /// In how many places.
    pub count: usize,
}

impl fmt::Display for Repair {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { place, what, count, .. } = self;
        write!(f, "{place}: {what}")?;
        if *count > 1 { write!(f, " ({count} times)") } else { Ok(()) }
    }
}

/// The repairs of a file, where they are allowed; a strict reader refuses the file at the first.
#[derive(Debug, Clone)]
pub struct Repairs {
    strict: bool,
    list: Vec<Repair>,
}

impl Repairs {
    /// For a reader that repairs what it can and lists it.
    pub fn allowed() -> Self {
        Self { strict: false, list: Vec::new() }
    }

    /// For a reader that refuses whatever needs a repair.
    pub fn refused() -> Self {
        Self { strict: true, list: Vec::new() }
    }

    /// What was repaired, in the order in which it was found; what occurs several times is one entry.
    pub fn list(&self) -> &[Repair] {
        &self.list
    }

    /// The same list.
    pub fn into_list(self) -> Vec<Repair> {
        self.list
    }

    pub(crate) fn are_refused(&self) -> bool {
        self.strict
    }

    /// A repair, or the error that says that none is allowed.
    pub(super) fn make(&mut self, place: Place, what: impl Into<Cow<'static, str>>) -> Result<(), ReadError> {
        let what = what.into();
        if self.strict {
            return Err(ReadError::Repairable { place, what: what.into_owned() });
        }
        self.add(place, what, false);
        Ok(())
    }

    /// Something that the file leaves open, or that was done to its numbers.
    pub(super) fn decide(&mut self, place: Place, what: impl Into<Cow<'static, str>>) {
        self.add(place, what.into(), true);
    }

    fn add(&mut self, place: Place, what: Cow<'static, str>, is_decision: bool) {
        match self.list.iter_mut().find(|repair| repair.what == what) {
            Some(repair) => repair.count += 1,
            None => self.list.push(Repair { is_decision, place, what, count: 1 }),
        }
    }

    /// A repair in the place of an error, which a strict reader returns.
    pub(super) fn instead_of(
        &mut self,
        error: ReadError,
        what: impl Into<Cow<'static, str>>,
    ) -> Result<(), ReadError> {
        match error.place() {
            Some(place) if !self.strict => self.make(place, what),
            _ => Err(error),
        }
    }
}
