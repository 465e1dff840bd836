//! What a law is besides its equations.

use std::any::Any;
use std::fmt::Debug;

/// A value that can be shown, compared and recognised behind a pointer.
///
/// Every type that is `Debug`, `PartialEq`, `Send`, `Sync` and borrows nothing is one.
pub trait LawValue: Any + Debug + Send + Sync {
    /// Whether `other` is a law of the same type with the same constants.
    fn is_equal(&self, other: &dyn Any) -> bool;

    /// The name of the type, for messages.
    fn type_name(&self) -> &'static str;
}

impl<T: Any + Debug + PartialEq + Send + Sync> LawValue for T {
    fn is_equal(&self, other: &dyn Any) -> bool {
        other.downcast_ref::<T>() == Some(self)
    }
    fn type_name(&self) -> &'static str {
        let path = std::any::type_name::<T>();
        let end = path.find('<').unwrap_or(path.len());
        path[..end].rfind("::").map_or(path, |at| &path[at + 2..])
    }
}
