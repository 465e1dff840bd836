//! Functions that register themselves in a module.

/// Functions of Python, each as `#[pyfunction]` takes it, with their `NAMES` and `add_functions` for the module that has them.
macro_rules! functions {
    ($($(#[$attribute:meta])* fn $name:ident($($arguments:tt)*) -> $result:ty $body:block)*) => {
        $(
            #[pyfunction]
            $(#[$attribute])*
            pub(crate) fn $name($($arguments)*) -> $result $body
        )*

        /// The names of the functions.
        pub(crate) const NAMES: &[&str] = &[$(stringify!($name)),*];

        /// Adds the functions to their module.
        pub(crate) fn add_functions(module: &Bound<'_, PyModule>) -> PyResult<()> {
            $(module.add_function(wrap_pyfunction!($name, module)?)?;)*
            Ok(())
        }
    };
}
pub(crate) use functions;
