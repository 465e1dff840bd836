//! Expression graphs: `somersault.expr`.
//!
//! Tracing is Python's part, in `somersault._symbols`: a symbol there is a number of an [`ExpressionGraph`](graph::ExpressionGraph)
//! here, and what is evaluated a [`CompiledFunction`](compiled::CompiledFunction).

pub(crate) mod compiled;
mod graph;

use crate::core::error::{Class, Error, inputs};
use somersault::expr::ExprError;

pub(crate) use compiled::CompiledFunction;

inputs!(ExprError);

/// Expression graphs: exact derivatives of any order.
#[pyo3::pymodule(name = "expr", module = "somersault._somersault", submodule)]
pub(crate) mod module {
    #[pymodule_export]
    use crate::expr::compiled::CompiledFunction;
    #[pymodule_export]
    use crate::expr::graph::ExpressionGraph;
}
