//! What work in the lanes of vector instructions keeps from call to call.

use crate::model::Model;
use somersault_core::lanes::{InstructionSet, Lanes};
use std::any::Any;
use std::fmt::Debug;

/// What the work in lanes of one kind is done with.
pub(crate) trait Room<L: Lanes>: Debug + Send + Sync + 'static {
    fn new(lanes: L, model: &Model) -> Self;
    /// Whether it was made for such a model.
    fn is_for(&self, model: &Model) -> bool;
}

/// Vector instructions and a [`Room`] of their lanes, made for a model when it is first used. A clone makes its own.
#[derive(Debug)]
pub(crate) struct LaneRoom {
    pub(crate) instructions: InstructionSet,
    pub(crate) kept: Kept,
}

/// A [`Room`] of lanes whose kind only a kernel knows, or none yet.
#[derive(Debug, Default)]
pub(crate) struct Kept(Option<Box<dyn Any + Send + Sync>>);

impl LaneRoom {
    /// With chosen vector instructions, which change the duration and not the results.
    pub(crate) fn with_instructions(instructions: InstructionSet) -> Self {
        Self { instructions, kept: Kept::default() }
    }
}

impl Default for LaneRoom {
    /// With the widest vector instructions of this processor.
    fn default() -> Self {
        Self::with_instructions(InstructionSet::detect())
    }
}

impl Clone for LaneRoom {
    fn clone(&self) -> Self {
        Self::with_instructions(self.instructions)
    }
}

impl Kept {
    /// The room of these lanes for a model, made where the one that is kept is another.
    pub(crate) fn fitting<L: Lanes, R: Room<L>>(&mut self, lanes: L, model: &Model) -> Option<&mut R> {
        if self.existing::<L, R>(model).is_none() {
            self.0 = Some(Box::new(R::new(lanes, model)));
        }
        self.existing(model)
    }

    /// The room of these lanes, if one is kept that was made for such a model.
    pub(crate) fn existing<L: Lanes, R: Room<L>>(&mut self, model: &Model) -> Option<&mut R> {
        self.0.as_mut()?.downcast_mut().filter(|room: &&mut R| room.is_for(model))
    }
}
