//! Python bindings of somersault.
//!
//! These files convert, validate and delegate. The classes of exceptions are in `somersault.errors`.
//!
//! A folder is a chapter, as the crates are, and `core` has what all of them share. Each public module of the package has
//! its own in the extension, declared as `module` in the folder or file of its chapter.
#![forbid(unsafe_code)]
#![cfg_attr(
    not(test),
    deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::unreachable, clippy::todo)
)]

mod contact;
mod core;
mod expr;
mod ftla;
mod integrators;
mod motion;
mod multibody;
mod nlp;
mod ocp;

// Nothing here relies on the lock of the interpreter: classes are frozen, what they fill in or lend is behind cells and
// mutexes, and `unsafe` is forbidden.
/// Motion of rigid and articulated bodies: what the package `somersault` is made of.
#[pyo3::pymodule(gil_used = false)]
mod _somersault {
    use pyo3::prelude::*;

    #[pymodule_export]
    use crate::contact::module as contact;
    #[pymodule_export]
    use crate::expr::module as expr;
    #[pymodule_export]
    use crate::ftla::module as ftla;
    #[pymodule_export]
    use crate::integrators::batch::module as batch;
    #[pymodule_export]
    use crate::integrators::exact::module as exact;
    #[pymodule_export]
    use crate::integrators::forces::module as forces;
    #[pymodule_export]
    use crate::integrators::module as integrators;
    #[pymodule_export]
    use crate::integrators::studies::module as studies;
    #[pymodule_export]
    use crate::motion::module as motion;
    #[pymodule_export]
    use crate::multibody::module as multibody;
    #[pymodule_export]
    use crate::nlp::module as nlp;
    #[pymodule_export]
    use crate::ocp::module as ocp;

    /// The version of the package.
    #[pymodule_export]
    #[allow(non_upper_case_globals)]
    const __version__: &str = env!("CARGO_PKG_VERSION");

    /// Lets the modules in it be imported by their names, as if it were a package.
    #[pymodule_init]
    fn register(extension: &Bound<'_, PyModule>) -> PyResult<()> {
        let imported = extension.py().import("sys")?.getattr("modules")?;
        for (_, member) in extension.dict() {
            if let Ok(module) = member.cast::<PyModule>() {
                imported.set_item(module.name()?, module)?;
            }
        }
        Ok(())
    }
}
