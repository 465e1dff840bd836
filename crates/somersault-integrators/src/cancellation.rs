//! Integrations that are cancelled: an observer that stops after the step at which it was asked to.

use crate::driver::{Flow, Observer, Step};
use crate::state::Configuration;
use somersault_core::cancel::CancellationToken;

impl<Q: Configuration> Observer<Q> for &CancellationToken {
    fn observe(&mut self, _: &mut Step<'_, Q>) -> Flow {
        if self.is_cancelled() { Flow::Stop } else { Flow::Continue }
    }
}
