//! What all chapters of the bindings share: arguments, errors, memory, rows of arrays, and waiting.

pub(crate) mod convert;
pub(crate) mod error;
pub(crate) mod memory;
pub(crate) mod rows;
pub(crate) mod waiting;
