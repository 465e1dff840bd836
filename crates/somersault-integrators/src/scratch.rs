//! Where a step keeps its stages: on the stack if the state is small, in the memory if it is not.
//!
//! Stages kept behind a reference must be written back, which costs a single body a fifth to a half
//! of its time; stages rebuilt would allocate for a state with a heap part. [`Scratch::lend`] gives
//! each kind of state what suits it, and the choice is a type.

use std::ops::{Deref, DerefMut};

/// Values that a step overwrites, with the memory that suits them.
pub trait Storage {
    /// [`OnStack`] for a dozen numbers, [`OnHeap`] for anything that owns heap memory.
    type Allocation: Allocation;
}

/// Where values lie that a step overwrites.
pub trait Allocation {
    /// Whether they are small enough to be copied to the stack for each step.
    const ON_STACK: bool;
    /// A value in use.
    type Lent<'a, T: 'a>: DerefMut<Target = T>;
    /// A value to work on, from the one in the memory.
    fn lend<T: Clone>(value: &mut T) -> Self::Lent<'_, T>;
}

/// On the stack: each step has a copy.
#[derive(Debug, Clone, Copy)]
pub struct OnStack;

/// In the memory: each step works on the value there.
#[derive(Debug, Clone, Copy)]
pub struct OnHeap;

impl Allocation for OnStack {
    const ON_STACK: bool = true;
    type Lent<'a, T: 'a> = Copied<T>;
    #[inline(always)]
    fn lend<T: Clone>(value: &mut T) -> Copied<T> {
        Copied(value.clone())
    }
}

impl Allocation for OnHeap {
    const ON_STACK: bool = false;
    type Lent<'a, T: 'a> = &'a mut T;
    #[inline(always)]
    fn lend<T: Clone>(value: &mut T) -> &mut T {
        value
    }
}

/// A copy on the stack.
#[derive(Debug)]
pub struct Copied<T>(T);

impl<T> Deref for Copied<T> {
    type Target = T;
    #[inline(always)]
    fn deref(&self) -> &T {
        &self.0
    }
}

impl<T> DerefMut for Copied<T> {
    #[inline(always)]
    fn deref_mut(&mut self) -> &mut T {
        &mut self.0
    }
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
    pub fn lend(&mut self) -> <T::Allocation as Allocation>::Lent<'_, T> {
        T::Allocation::lend(&mut self.0)
    }
}
