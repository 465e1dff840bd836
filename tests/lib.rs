//! Tests live in the test targets of this package, in the README and in the book.

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
mod readme {}

#[cfg(doctest)]
#[doc = include_str!("../docs/start.md")]
mod start {}

#[cfg(doctest)]
#[doc = include_str!("../docs/guides/hyper_sensitive.md")]
mod hyper_sensitive {}

#[cfg(doctest)]
#[doc = include_str!("../docs/rust.md")]
mod rust {}
