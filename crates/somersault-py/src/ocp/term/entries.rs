//! Numbers of the motion as they are.

use super::part::{name_of, part_of};
use super::{Description, Term, numbers_of};
use crate::core::error::Error;
use crate::ocp::arguments::integers_or_none;
use pyo3::prelude::*;
use pyo3::types::PyTuple;
use somersault::ocp::dynamics::Tree;
use somersault::ocp::term::{self, Part};
use somersault::ocp::transcription::NodeSizes;

struct Entries {
    part: Part,
    entries: Option<Vec<usize>>,
}

impl Description for Entries {
    fn made<'py>(&self, py: Python<'py>) -> PyResult<(&'static str, Bound<'py, PyTuple>)> {
        Ok(("entries", (name_of(self.part), self.entries.clone()).into_pyobject(py)?))
    }

    fn what(&self) -> &'static str {
        name_of(self.part)
    }

    fn build(&self, _: Python<'_>, _: &Tree, sizes: &NodeSizes) -> Result<Box<dyn term::Term>, Error> {
        Ok(Box::new(match &self.entries {
            Some(entries) => {
                let made = term::Entries::try_new(sizes, self.part, entries);
                made.map_err(|error| Error::from(error).within("indices"))?
            }
            None => term::Entries::all(sizes, self.part),
        }))
    }
}

/// Numbers of the motion as they are.
///
/// Parameters
/// ----------
/// part : {'time', 'velocity', 'acceleration', 'torque', 'channel', 'channel_rate', 'channel_second_rate'}
///     Of which part: joint velocities, accelerations and forces of the whole tree; channels are the weights of
///     eigenpostures, or the driven joints.
/// indices : sequence of int, optional
///     Which of them; all unless given.
///
/// Returns
/// -------
/// Term
#[pyfunction]
#[pyo3(signature = (part, indices=None))]
pub(crate) fn entries(
    part: &str,
    #[pyo3(from_py_with = integers_or_none)] indices: Option<Vec<i64>>,
) -> Result<Term, Error> {
    Ok(Term::of(Entries { part: part_of(part)?, entries: numbers_of("indices", indices)? }))
}
