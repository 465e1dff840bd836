//! Where a step keeps its stages: on the stack if the state is small, in the memory if it is not.
//!
//! Stages kept behind a reference must be written back, which costs a single body a fifth to a half
//! of its time; new stages would allocate for a state with a heap part. [`Scratch::lend`] gives
//! each kind of state what suits it, and the choice is a constant.

use std::ops::{Deref, DerefMut};

/// Whether values of a type are small enough to be copied to the stack for each step.
pub trait Storage {
    /// True for a dozen numbers, false for anything that owns heap memory.
    const ON_STACK: bool;
}

/// A value that a step overwrites before it reads it.
#[derive(Debug, Clone)]
pub struct Scratch<T>(T);

impl<T: Storage + Clone> Scratch<T> {
    /// Scratch of the size of `prototype`.
    pub fn like(prototype: &T) -> Self {
        Self(prototype.clone())
    }

    /// The value to work on; its content is unspecified.
    #[inline(always)]
    pub fn lend(&mut self) -> Lent<'_, T> {
        if T::ON_STACK { Lent::Owned(self.0.clone()) } else { Lent::Borrowed(&mut self.0) }
    }
}

/// Scratch in use.
pub enum Lent<'a, T> {
    /// A copy on the stack.
    Owned(T),
    /// The value in the memory.
    Borrowed(&'a mut T),
}

// Which variant there is follows from the constant. Asking the constant first, rather than the value,
// lets the compiler keep the owned variant in registers.
impl<T: Storage> Deref for Lent<'_, T> {
    type Target = T;
    #[inline(always)]
    fn deref(&self) -> &T {
        match (T::ON_STACK, self) {
            (true, Self::Owned(value)) => value,
            (false, Self::Borrowed(value)) => value,
            _ => unreachable!("`lend` makes the variant that the constant names"),
        }
    }
}

impl<T: Storage> DerefMut for Lent<'_, T> {
    #[inline(always)]
    fn deref_mut(&mut self) -> &mut T {
        match (T::ON_STACK, self) {
            (true, Self::Owned(value)) => value,
            (false, Self::Borrowed(value)) => value,
            _ => unreachable!("`lend` makes the variant that the constant names"),
        }
    }
}
