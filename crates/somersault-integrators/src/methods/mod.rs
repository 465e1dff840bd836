//! The method table: each method is one file.
//!
//! A file of a method registers it: `register!` gives each of its rows a place in the table, the name in the enumeration, the
//! type, how to make it and the variables it takes. The build script finds these files, declares them as modules and puts
//! their rows in order. The table yields the enumeration [`Method`], its list, its parser and the `match` that enters the
//! loop of a method, once per trajectory. Bindings, benchmarks, documentation and tests iterate over
//! it. A method of your own is a type that implements [`Stepper`]; every driver and study takes one.

/// Rows of the table, read by the build script:
/// `PLACE [thesis] => Variant: Type = value, variables[(name, title)][, embedded];`.
///
/// The table is in the order of the places, which leave room for others between them. `thesis` marks Table 7.3 of the thesis.
/// The variables are `any` for a method that takes every system as it is, `world` for one that takes rigid bodies as they are,
/// and `momentum` or `body` for one that takes them in that form, with its name and title there. A value may read
/// `options`, see [`Options`]. `embedded` says that the type is an
/// [`EmbeddedStepper`](crate::stepper::EmbeddedStepper).
macro_rules! register {
    ($($row:tt)*) => {};
}

mod adams;
mod kick_drift_kick;
mod splitting;
mod table;
mod torque_free;

include!(concat!(env!("OUT_DIR"), "/modules.rs"));

pub use adams::StartUp;
pub use table::{
    EmbeddedFrameVisitor, EmbeddedSystemVisitor, EmbeddedVisitor, FrameVisitor, Method, Options,
    SystemVisitor, UnknownMethod, Visitor,
};

#[cfg(doc)]
use crate::stepper::Stepper;
