//! The method at work: steps in the mode that the system is frozen in.

use crate::event::Interruption;
use crate::hybrid::{Frozen, Guard, Hybrid};
use somersault_integrators::driver::IntegrateError;
use somersault_integrators::state::{Configuration, State};
use somersault_integrators::stepper::Stepper;
use somersault_integrators::system::{Decoder, StateOf, System};

/// A state in the variables of the form and in those of the system, and the guards there.
#[derive(Clone)]
pub(super) struct Point<Q: Configuration, B: Configuration> {
    pub(super) inner: State<B>,
    pub(super) outer: State<Q>,
    pub(super) guards: Vec<Guard>,
}

/// The way from the variables of a system to those of a form.
pub(crate) type Encode<'a, H, B> = &'a dyn Fn(&StateOf<H>) -> StateOf<B>;

/// A system with modes, the form that a method integrates, the method, and the ways between the form's
/// variables and the system's.
pub(super) struct Worker<'a, H: Hybrid, B: System, M, D> {
    pub(super) frozen: &'a Frozen<H>,
    pub(super) form: &'a B,
    pub(super) stepper: &'a M,
    pub(super) decoder: D,
    pub(super) encode: Encode<'a, H, B>,
}

impl<H, B, M, D> Worker<'_, H, B, M, D>
where
    H: Hybrid,
    B: System,
    M: Stepper<B>,
    D: Decoder<B::Configuration, H::Configuration>,
{
    /// A step of h from `x` at `t`, with the guards after it.
    #[inline]
    pub(super) fn step(
        &self,
        t: f64,
        x: &StateOf<B>,
        h: f64,
        memory: &mut M::Memory,
        out: &mut Point<H::Configuration, B::Configuration>,
    ) -> Result<(), Interruption> {
        self.stepper.step(self.form, t, x, h, memory, &mut out.inner).map_err(IntegrateError::from)?;
        self.settle(t + h, out)
    }

    /// Makes a point of the state that a step has left in it.
    #[inline]
    pub(super) fn settle(
        &self,
        t: f64,
        out: &mut Point<H::Configuration, B::Configuration>,
    ) -> Result<(), Interruption> {
        out.inner.configuration.renormalize();
        if !out.inner.is_finite() {
            return Err(IntegrateError::NonFinite { t }.into());
        }
        self.decoder.decode(&out.inner, &mut out.outer);
        self.read_guards(t, out)
    }

    #[inline]
    pub(super) fn read_guards(
        &self,
        t: f64,
        out: &mut Point<H::Configuration, B::Configuration>,
    ) -> Result<(), Interruption> {
        self.frozen.guards(t, &out.outer, &mut out.guards);
        match out.guards.iter().enumerate().find(|(_, g)| !g.is_finite()) {
            None => Ok(()),
            Some((guard, &Guard { gap, rate, .. })) => {
                Err(match self.frozen.system().examine(guard, &out.outer) {
                    Err(fault) => Interruption::Surface { guard, t, fault },
                    Ok(()) => Interruption::NonFiniteGuard { guard, t, gap, rate },
                })
            }
        }
    }
}
