//! Nonlinear programs.

mod program;
mod solve;

/// The solvers of nonlinear programs, as `somersault.nlp` calls them.
#[pyo3::pymodule(name = "nlp", module = "somersault._somersault", submodule)]
pub(crate) mod module {
    #[pymodule_export]
    use crate::nlp::solve::solve_program;
}
