//! Centre of mass or momentum of the whole tree.

use super::{Description, Term};
use crate::core::error::Error;
use pyo3::prelude::*;
use pyo3::types::PyTuple;
use somersault::ocp::dynamics::Tree;
use somersault::ocp::term::{self, MomentumPart};
use somersault::ocp::transcription::NodeSizes;

/// Each part with its name, and with what it is.
static PARTS: [(&str, MomentumPart, &str); 3] = [
    ("angular", MomentumPart::Angular, "angular momentum"),
    ("linear", MomentumPart::Linear, "linear momentum"),
    ("center_of_mass", MomentumPart::CenterOfMass, "centre of mass"),
];

/// A row of [`PARTS`].
struct Momentum(&'static (&'static str, MomentumPart, &'static str));

impl Description for Momentum {
    fn made<'py>(&self, py: Python<'py>) -> PyResult<(&'static str, Bound<'py, PyTuple>)> {
        Ok(("momentum", (self.0.0,).into_pyobject(py)?))
    }

    fn what(&self) -> &'static str {
        self.0.2
    }

    fn build(&self, _: Python<'_>, dynamics: &Tree, _: &NodeSizes) -> Result<Box<dyn term::Term>, Error> {
        Ok(Box::new(term::Momentum::new(dynamics.model().clone(), self.0.1)))
    }
}

/// Centre of mass or momentum of the whole tree, three numbers in world axes.
///
/// Parameters
/// ----------
/// part : {'angular', 'linear', 'center_of_mass'}
///     Angular momentum about the centre of mass, kg m²/s; linear momentum, kg m/s; or the centre of mass, m.
///
/// Returns
/// -------
/// Term
#[pyfunction]
pub(crate) fn momentum(part: &str) -> Result<Term, Error> {
    match PARTS.iter().find(|(name, ..)| *name == part) {
        Some(row) => Ok(Term::of(Momentum(row))),
        None => Err(Error::input(format!(
            "`part` must be 'angular', 'linear' or 'center_of_mass', found '{part}'"
        ))),
    }
}
