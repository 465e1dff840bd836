//! Laws of contacts: along the normal, against sliding, rolling and spinning.
//!
//! A class stands in the file of its kind, under the table that has its row.

mod class;
mod friction;
mod normal;
mod resistance;

pub(crate) use friction::CoulombFriction;
pub(crate) use normal::{CompliantLaw, damping_ratio, restitution};
pub(crate) use resistance::Resistance;

use crate::core::convert::a_type;
use crate::core::error::Error;
use class::{add, kinds, read, show};
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;
use somersault::contact::laws::ContactLaw;

/// Adds the classes of laws to the module of the extension.
pub(super) fn add_classes(module: &Bound<'_, PyModule>) -> PyResult<()> {
    add(normal::CLASSES, "_NORMAL_LAWS", module)?;
    add(friction::CLASSES, "_FRICTION_LAWS", module)
}

/// All laws of a contact.
pub(crate) fn laws(
    law: &Bound<'_, PyAny>,
    friction: Option<&Bound<'_, PyAny>>,
    resistance: Option<&Bound<'_, PyAny>>,
) -> Result<ContactLaw, Error> {
    let wrong = |argument, kinds: &str, found: &Bound<'_, PyAny>| {
        Error::input(format!("`{argument}` must be {kinds}, found {}", a_type(found)))
    };
    let mut laws = match read(normal::CLASSES, law) {
        Some(law) => ContactLaw::from(law),
        None => return Err(wrong("law", &kinds(normal::CLASSES, law.py())?, law)),
    };
    if let Some(value) = friction {
        laws = match read(friction::CLASSES, value) {
            Some(friction) => laws.with_friction(friction),
            None => return Err(wrong("friction", &kinds(friction::CLASSES, value.py())?, value)),
        };
    }
    if let Some(value) = resistance {
        let found: Resistance = value.extract().map_err(|_| wrong("resistance", "a Resistance", value))?;
        laws = laws.with_resistance(found.law);
    }
    Ok(laws)
}

fn without_class(law: &str) -> PyErr {
    PyTypeError::new_err(format!("the law {law} has no class in Python"))
}

/// The normal law as Python sees it.
pub(crate) fn normal_law<'py>(py: Python<'py>, laws: &ContactLaw) -> PyResult<Bound<'py, PyAny>> {
    show(normal::CLASSES, py, laws.normal())?.ok_or_else(|| without_class(laws.normal().type_name()))
}

/// The law of friction as Python sees it.
pub(crate) fn friction_law<'py>(py: Python<'py>, laws: &ContactLaw) -> PyResult<Option<Bound<'py, PyAny>>> {
    let Some(law) = laws.friction().law() else { return Ok(None) };
    show(friction::CLASSES, py, law)?.ok_or_else(|| without_class(law.type_name())).map(Some)
}

/// The normal law in words, also where it has no class.
pub(crate) fn normal_law_repr(py: Python<'_>, laws: &ContactLaw) -> PyResult<String> {
    match show(normal::CLASSES, py, laws.normal())? {
        Some(law) => law.repr()?.extract(),
        None => Ok(format!("<{:?}>", laws.normal())),
    }
}

/// The resistance as Python sees it.
pub(crate) fn resistance_law<'py>(
    py: Python<'py>,
    laws: &ContactLaw,
) -> PyResult<Option<Bound<'py, Resistance>>> {
    let law = *laws.resistance();
    if law == Default::default() {
        return Ok(None);
    }
    Bound::new(py, Resistance::of(law)).map(Some)
}

/// Law, friction and resistance, as contacts take them.
pub(crate) type Laws<'py> = (Bound<'py, PyAny>, Option<Bound<'py, PyAny>>, Option<Bound<'py, Resistance>>);

/// What [`laws`] makes the same of again.
pub(crate) fn parts<'py>(py: Python<'py>, laws: &ContactLaw) -> PyResult<Laws<'py>> {
    Ok((normal_law(py, laws)?, friction_law(py, laws)?, resistance_law(py, laws)?))
}
