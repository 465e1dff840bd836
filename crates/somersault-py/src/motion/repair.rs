//! What was put right in a file.

use crate::core::value::{Pickled, brief, by_restore};
use pyo3::prelude::*;
use somersault::motion::readers::{self, Place};

/// Something that was put right in a file, or decided where the file leaves it open.
///
/// Entries of `repairs` of a recording that was read.
#[pyclass(frozen, from_py_object, module = "somersault.motion")]
#[derive(Clone, PartialEq)]
pub(crate) struct Repair {
    /// str: What was found, and what was made of it.
    #[pyo3(get)]
    what: String,
    /// int or None: The line, from 1, of several the first; that of files that are text.
    #[pyo3(get)]
    line: Option<usize>,
    /// int or None: The byte, from 0, of other files.
    #[pyo3(get)]
    byte: Option<usize>,
    /// int: In how many places.
    #[pyo3(get)]
    count: usize,
    /// bool: Whether nothing was wrong: the file left something open, or its numbers were converted.
    #[pyo3(get)]
    is_decision: bool,
}

impl Repair {
    pub(super) fn all(repairs: Vec<readers::Repair>) -> Vec<Self> {
        let one = |repair: readers::Repair| {
            let (line, byte) = match repair.place {
                Place::Line(line) => (Some(line), None),
                Place::Byte(byte) => (None, Some(byte)),
            };
            let readers::Repair { is_decision, what, count, .. } = repair;
            Self { what: what.into_owned(), line, byte, count, is_decision }
        };
        repairs.into_iter().map(one).collect()
    }
}

#[pymethods]
impl Repair {
    #[classmethod]
    fn _restore(
        _class: &Bound<'_, pyo3::types::PyType>,
        what: String,
        line: Option<usize>,
        byte: Option<usize>,
        count: usize,
        is_decision: bool,
    ) -> Self {
        Self { what, line, byte, count, is_decision }
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> Pickled<'py> {
        let own = slf.get();
        by_restore(slf, (own.what.clone(), own.line, own.byte, own.count, own.is_decision))
    }

    fn __eq__(&self, other: &Self) -> bool {
        self == other
    }

    fn __str__(&self) -> String {
        let place = match (self.line, self.byte) {
            (Some(line), _) => format!("line {line}: "),
            (None, Some(byte)) => format!("byte {byte}: "),
            (None, None) => String::new(),
        };
        let times = if self.count > 1 { format!(" ({} times)", self.count) } else { String::new() };
        format!("{place}{}{times}", self.what)
    }

    fn __repr__(&self) -> String {
        format!("<Repair: {}>", brief(&self.__str__(), 120))
    }
}
