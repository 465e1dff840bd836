//! Tests live in the test targets of this package, and in the README.

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
mod readme {}
