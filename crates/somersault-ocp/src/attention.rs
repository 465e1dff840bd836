//! Integrations that ask whether to go on.

use somersault_integrators::driver::{Flow, Observer, Step};
use somersault_integrators::state::Configuration;

/// Whether long work is to go on; asked often.
pub type GoOn<'a> = &'a mut dyn FnMut() -> bool;

/// Stops an integration after the step at which it is not to go on.
pub(crate) struct Attention<'a> {
    go_on: GoOn<'a>,
    /// Whether it has stopped one.
    pub(crate) has_stopped: bool,
}

impl<'a> Attention<'a> {
    pub(crate) fn new(go_on: GoOn<'a>) -> Self {
        Self { go_on, has_stopped: false }
    }
}

impl<Q: Configuration> Observer<Q> for Attention<'_> {
    fn observe(&mut self, _: &mut Step<'_, Q>) -> Flow {
        self.has_stopped |= !(self.go_on)();
        if self.has_stopped { Flow::Stop } else { Flow::Continue }
    }
}
