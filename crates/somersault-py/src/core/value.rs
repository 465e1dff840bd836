//! Classes that are values: their getters as a table, and what they are pickled as.

use pyo3::prelude::*;
use pyo3::types::PyTuple;
use std::fmt::Display;

/// What `__reduce__` returns: what makes the object again, and its arguments.
pub(crate) type Pickled<'py> = PyResult<(Bound<'py, PyAny>, Bound<'py, PyTuple>)>;

/// An object that its class makes again from `arguments`.
pub(crate) fn by_class<'py, A>(object: &Bound<'py, PyAny>, arguments: A) -> Pickled<'py>
where
    A: IntoPyObject<'py, Target = PyTuple, Output = Bound<'py, PyTuple>, Error: Into<PyErr>>,
{
    Ok((object.get_type().into_any(), arguments.into_pyobject(object.py()).map_err(Into::into)?))
}

/// An object that its class makes again from attributes of these names.
pub(crate) fn by_attributes<'py>(object: &Bound<'py, PyAny>, names: &[&str]) -> Pickled<'py> {
    let arguments = names.iter().map(|name| object.getattr(*name)).collect::<PyResult<Vec<_>>>()?;
    by_class(object, PyTuple::new(object.py(), arguments)?)
}

/// An object that the class method `_restore` makes again from `arguments`, which are not those of the class.
pub(crate) fn by_restore<'py, A>(object: &Bound<'py, PyAny>, arguments: A) -> Pickled<'py>
where
    A: IntoPyObject<'py, Target = PyTuple, Output = Bound<'py, PyTuple>, Error: Into<PyErr>>,
{
    let restore = object.get_type().getattr("_restore")?;
    Ok((restore, arguments.into_pyobject(object.py()).map_err(Into::into)?))
}

/// A text of somebody else's in a `repr`: in one line, and cut after so many characters.
pub(crate) fn brief(text: &str, most: usize) -> String {
    let line = text.split_whitespace().collect::<Vec<_>>().join(" ");
    if line.chars().count() <= most { line } else { line.chars().take(most - 1).chain(['…']).collect() }
}

/// A number in a `repr`, in six significant digits.
pub(crate) fn digits(x: f64) -> f64 {
    format!("{x:.5e}").parse().unwrap_or(x)
}

/// A count in a `repr`, with the noun that it counts.
pub(crate) fn counted(n: usize, one: &str, more: &str) -> String {
    format!("{n} {}", if n == 1 { one } else { more })
}

/// A list in a `repr`: all of it if it is short, and otherwise its ends.
pub(crate) fn few<T: Display>(items: &[T]) -> String {
    const ENDS: usize = 3;
    let shown = |items: &[T]| items.iter().map(ToString::to_string).collect::<Vec<_>>().join(", ");
    match items {
        [first @ .., _, _, _] if first.len() > ENDS => {
            format!("{}, …, {}", shown(&items[..ENDS]), shown(&items[items.len() - ENDS..]))
        }
        all => shown(all),
    }
}

/// The getters of a class, a row for each: its documentation, its name, its type, and what of the object it is. Names in
/// brackets are those of the attributes by which the class makes an equal object, for pickles.
macro_rules! value {
    (
        impl $class:ident $(($($attribute:ident),+))? {
            $($(#[doc = $text:tt])+ $name:ident: $type:ty = |$own:ident $(, $py:ident)?| $value:expr;)*
        }
    ) => {
        #[pymethods]
        #[allow(clippy::extra_unused_lifetimes, reason = "rows that need no interpreter have no use for it")]
        impl $class {
            $(
                $(#[doc = $text])+
                #[getter]
                fn $name<'py>(&self $(, $py: Python<'py>)?) -> $type {
                    let $own = self;
                    $value
                }
            )*

            $(
                fn __reduce__<'py>(slf: &Bound<'py, Self>) -> crate::core::value::Pickled<'py> {
                    crate::core::value::by_attributes(slf, &[$(stringify!($attribute)),+])
                }
            )?
        }
    };
}
pub(crate) use value;
