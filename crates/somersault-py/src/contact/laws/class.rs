//! Classes of Python that stand for laws of the library.

use pyo3::PyClass;
use pyo3::prelude::*;
use pyo3::pyclass::boolean_struct::True;
use pyo3::types::{PyDict, PyType};
use somersault::contact::laws::{FrictionLaw, NormalLaw};
use std::sync::Arc;

/// A class that stands for a type of laws.
pub(crate) trait LawClass: PyClass<Frozen = True> + Into<PyClassInitializer<Self>> + Sync {
    /// What it is called in the documents of the command line.
    const KIND: &'static str;
    /// The type.
    type Law: Clone;
    /// An object for a law.
    fn of(law: Self::Law) -> Self;
    /// The law.
    fn law(&self) -> Self::Law;
}

/// Lets a class around a law stand for its type.
macro_rules! law_class {
    ($class:ident = $kind:literal: $law:ty) => {
        impl crate::contact::laws::class::LawClass for $class {
            const KIND: &'static str = $kind;
            type Law = $law;
            fn of(law: $law) -> Self {
                Self(law)
            }
            fn law(&self) -> $law {
                self.0
            }
        }
    };
}
pub(super) use law_class;

/// The same for a normal law, with its force and energy as methods. For their examples it has both 1 cm deep, with a stiffness
/// of 10⁴.
macro_rules! normal_law_class {
    ($class:ident = $kind:literal: $law:ty, $force:literal, $energy:literal) => {
        crate::contact::laws::class::law_class!($class = $kind: $law);

        #[pymethods]
        impl $class {
            /// The force, N.
            ///
            /// Parameters
            /// ----------
            /// gap, rate : float
            ///     Gap, m, and its rate, m/s.
            ///
            /// Returns
            /// -------
            /// float
            ///
            /// Examples
            /// --------
            #[doc = concat!(">>> from somersault.contact import ", stringify!($class))]
            #[doc = concat!(">>> law = ", stringify!($class), "(1e4)")]
            /// >>> round(law.force(-0.01, 0.0), 9), law.force(0.01, 0.0)
            #[doc = concat!("(", $force, ", 0.0)")]
            fn force(&self, gap: f64, rate: f64) -> Result<f64, Error> {
                Ok(self.0.force(finite("gap", gap)?, finite("rate", rate)?))
            }

            /// Energy of the spring, J.
            ///
            /// Parameters
            /// ----------
            /// gap : float
            ///     Gap, m.
            ///
            /// Returns
            /// -------
            /// float
            ///
            /// Examples
            /// --------
            #[doc = concat!(">>> from somersault.contact import ", stringify!($class))]
            #[doc = concat!(">>> round(", stringify!($class), "(1e4).energy(-0.01), 9)")]
            #[doc = $energy]
            fn energy(&self, gap: f64) -> Result<f64, Error> {
                Ok(self.0.energy(finite("gap", gap)?))
            }
        }
    };
}
pub(super) use normal_law_class;

/// A row of the table of classes that stand for laws of a kind, `dyn NormalLaw` or `dyn FrictionLaw`.
pub(super) struct Row<L: ?Sized> {
    kind: &'static str,
    class: fn(Python<'_>) -> Bound<'_, PyType>,
    add: fn(&Bound<'_, PyModule>) -> PyResult<()>,
    /// The law of an object, if it is of the class.
    read: fn(&Bound<'_, PyAny>) -> Option<Arc<L>>,
    /// An object for a law, if it is of the type.
    show: for<'py> fn(Python<'py>, &L) -> Option<PyResult<Bound<'py, PyAny>>>,
}

/// The row of a class of normal laws.
pub(super) const fn normal<C: LawClass<Law: NormalLaw>>() -> Row<dyn NormalLaw> {
    Row {
        kind: C::KIND,
        class: |py| py.get_type::<C>(),
        add: |module| module.add_class::<C>(),
        read: |value| Some(Arc::new(value.cast::<C>().ok()?.get().law())),
        show: |py, law| Some(object::<C>(py, law.downcast_ref::<C::Law>()?)),
    }
}

/// The row of a class of friction laws.
pub(super) const fn friction<C: LawClass<Law: FrictionLaw>>() -> Row<dyn FrictionLaw> {
    Row {
        kind: C::KIND,
        class: |py| py.get_type::<C>(),
        add: |module| module.add_class::<C>(),
        read: |value| Some(Arc::new(value.cast::<C>().ok()?.get().law())),
        show: |py, law| Some(object::<C>(py, law.downcast_ref::<C::Law>()?)),
    }
}

fn object<'py, C: LawClass>(py: Python<'py>, law: &C::Law) -> PyResult<Bound<'py, PyAny>> {
    Ok(Bound::new(py, C::of(law.clone()))?.into_any())
}

/// Adds the classes to the module of the extension, and under `name` a dictionary of them by their kinds.
pub(super) fn add<L: ?Sized>(table: &[Row<L>], name: &str, module: &Bound<'_, PyModule>) -> PyResult<()> {
    let classes = PyDict::new(module.py());
    for row in table {
        (row.add)(module)?;
        classes.set_item(row.kind, (row.class)(module.py()))?;
    }
    module.setattr(name, classes)
}

/// The law of an argument.
pub(super) fn read<L: ?Sized>(table: &[Row<L>], value: &Bound<'_, PyAny>) -> Option<Arc<L>> {
    table.iter().find_map(|row| (row.read)(value))
}

/// An object for a law, if it has a class.
pub(super) fn show<'py, L: ?Sized>(
    table: &[Row<L>],
    py: Python<'py>,
    law: &L,
) -> PyResult<Option<Bound<'py, PyAny>>> {
    table.iter().find_map(|row| (row.show)(py, law)).transpose()
}

/// What an argument must be.
pub(super) fn kinds<L: ?Sized>(table: &[Row<L>], py: Python<'_>) -> PyResult<String> {
    let names = table.iter().map(|row| Ok(format!("a {}", (row.class)(py).name()?)));
    Ok(names.collect::<PyResult<Vec<_>>>()?.join(" or "))
}
