//! What all chapters of the bindings share: arguments, callables, errors, functions that register themselves, memory, rows of
//! arrays, classes of values, and waiting.

pub(crate) mod callable;
pub(crate) mod convert;
pub(crate) mod error;
pub(crate) mod functions;
pub(crate) mod memory;
pub(crate) mod rows;
pub(crate) mod value;
pub(crate) mod waiting;
