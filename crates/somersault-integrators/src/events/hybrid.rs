//! Systems whose equations change at events: modes, guards, and a system frozen in a mode.

use super::guard::Guard;
use super::sweep::Sweep;
use crate::body::RigidBody;
use crate::driver::IntegrateError;
use crate::partials::Partials;
use crate::series::WrenchTerm;
use crate::state::State;
use crate::system::{
    BodyPoses, BodyRate, Decoder, Fault, FromBody, RateOf, RigidSystem, StateOf, System, WorldScratch,
    torques_in_body_axes,
};
use std::cell::{Cell, RefCell};
use std::error::Error;
use std::fmt::Debug;

/// The energy of a system that nothing drives.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Energy {
    /// Kinetic energy, J.
    pub kinetic: f64,
    /// Energy of the springs that act, J.
    pub springs: f64,
    /// Potential of the forces, J.
    pub potential: f64,
}

impl Energy {
    /// The sum, which never grows.
    pub fn total(&self) -> f64 {
        self.kinetic + self.springs + self.potential
    }
}

/// A system with modes. In each mode the equations are smooth; the mode ends where a guard changes sign.
///
/// As a [`System`] in its own right it reads the mode from the state at every evaluation. What a system must say:
/// which mode a state belongs to, the guards, the equations of a mode, and what an event is called. The rest is
/// provided, claims nothing, and costs time at most: [`sweeps`](Self::sweeps) and [`clear_time`](Self::clear_time) prove
/// steps clear of events, [`stiffest_rate`](Self::stiffest_rate) and [`energy`](Self::energy) divide fixed steps that are
/// too long.
pub trait Hybrid: System {
    /// Which equations hold.
    type Mode: Clone + PartialEq + Debug;
    /// What events are called: [`Crossing`](super::Crossing) where the number of the guard tells the rest.
    type Kind: Clone + PartialEq + Debug;
    /// Why a guard may not go in: [`Infallible`](std::convert::Infallible) where every one may.
    type Fault: Error + Clone + PartialEq;

    /// Whether states jump at events; [`reset`](Self::reset) is called only where they do.
    const RESETS: bool = false;

    /// The mode that a state belongs to: by [`Guard::is_inside`] of its guards, so that both agree where a
    /// guard is zero.
    fn mode(&self, t: f64, x: &StateOf<Self>) -> Self::Mode;

    /// Writes the guards: as many, in the same order, in every mode.
    fn guards(&self, mode: &Self::Mode, t: f64, x: &StateOf<Self>, out: &mut Vec<Guard>);

    /// Time derivative of the rate by the equations of a mode, also where they do not hold.
    fn acceleration_in(
        &self,
        mode: &Self::Mode,
        w: &mut Self::Workspace,
        t: f64,
        x: &StateOf<Self>,
        out: &mut RateOf<Self>,
    );

    /// The derivatives of that, as [`System::partials`].
    fn partials_in(
        &self,
        mode: &Self::Mode,
        w: &mut Self::Workspace,
        t: f64,
        x: &StateOf<Self>,
        out: &mut Partials<Self::Configuration>,
    ) {
        out.by_differences(x, |x, acceleration| self.acceleration_in(mode, w, t, x, acceleration));
    }

    /// What it is called that a guard changed sign, given the modes before and after the event.
    fn event_kind(
        &self,
        guard: usize,
        before: &Guard,
        after: &Guard,
        modes: (&Self::Mode, &Self::Mode),
    ) -> Self::Kind;

    /// Why the system cannot be integrated as it stands, if it cannot; asked before a run that locates events.
    fn check(&self) -> Result<(), IntegrateError> {
        Ok(())
    }

    /// The mode after an event, from the one before it and the state; by default from the state alone.
    ///
    /// What a mode remembers, say where a contact began to stick, is forwarded here.
    fn next_mode(&self, _before: &Self::Mode, t: f64, x: &StateOf<Self>) -> Self::Mode {
        self.mode(t, x)
    }

    /// The jump of the state at an event from one mode to the next; by default there is none.
    ///
    /// It is made after the step that ends at the event and before the guards are read again. It must
    /// leave the mode that the state belongs to as it is.
    fn reset(&self, _t: f64, _before: &Self::Mode, _after: &Self::Mode, _x: &mut StateOf<Self>) {}

    /// Whether a guard may be inside in a state: asked when it goes in for the first time, after the jump if there is
    /// one, and where it is not finite.
    fn examine(&self, _guard: usize, _x: &StateOf<Self>) -> Result<(), Self::Fault> {
        Ok(())
    }

    /// Writes bounds of the motion behind each guard during a step of h from `ends.0` at `t` to `ends.1`, in the order of
    /// the guards. Of those left out at the end nothing is known, as of [`Sweep::UNKNOWN`].
    ///
    /// With them the driver proves that a guard outside stays so; without them it believes the cubic through the ends of
    /// the step.
    fn sweeps(
        &self,
        _mode: &Self::Mode,
        _t: f64,
        _h: f64,
        _ends: (&StateOf<Self>, &StateOf<Self>),
        _out: &mut Vec<Sweep>,
    ) {
    }

    /// For how long, up to `horizon`, no guard can go in, proved from the guards of a state and from what bounds
    /// its motion; zero, as by default, where nothing is known.
    fn clear_time(
        &self,
        _mode: &Self::Mode,
        _t: f64,
        _x: &StateOf<Self>,
        _guards: &[Guard],
        _horizon: f64,
    ) -> f64 {
        0.0
    }

    /// An upper bound of |λ|, 1/s, of the springs and dampers that act in a mode with the masses that they move; zero,
    /// as by default, where none acts.
    ///
    /// While it is not zero fixed steps are divided by it, and the energy is watched.
    fn stiffest_rate(&self, _mode: &Self::Mode, _x: &StateOf<Self>) -> f64 {
        0.0
    }

    /// The energy, where it cannot grow; `None`, as by default, where it may, or is not known.
    fn energy(&self, _x: &StateOf<Self>) -> Option<Energy> {
        None
    }

    /// What a guard gathers over a step of h inside it, say the impulse of a contact, N s; none by default. The event at
    /// which it comes out has the sum.
    fn impulse(&self, _guard: usize, _h: f64, _before: &Guard, _after: &Guard) -> f64 {
        0.0
    }
}

/// Rigid bodies with modes.
pub trait HybridBodies: Hybrid + RigidSystem {
    /// Force and torque about the centre of mass on every body by the equations of a mode.
    fn wrenches_in(&self, mode: &Self::Mode, t: f64, x: &StateOf<Self>, out: &mut RateOf<Self>);
    /// The same with angular velocities and torques in body axes; by default by way of `world`, in world axes.
    #[inline(always)]
    fn body_wrenches_in(
        &self,
        mode: &Self::Mode,
        t: f64,
        x: &State<BodyPoses<Self>>,
        (world, wrenches): &mut WorldScratch<Self>,
        out: &mut BodyRate<Self>,
    ) {
        let (mut world, mut wrenches) = (world.lend(), wrenches.lend());
        FromBody.decode(x, &mut world);
        self.wrenches_in(mode, t, &world, &mut wrenches);
        torques_in_body_axes::<Self::Configuration>(x, &wrenches, out);
    }
    /// Adds terms whose sum is the wrench on body `i` by the equations of a mode, as [`RigidSystem::add_terms`]; false, as by default,
    /// where none are known.
    fn add_terms_in(&self, _mode: &Self::Mode, _i: usize, _terms: &mut Vec<WrenchTerm>) -> bool {
        false
    }
}

#[deny(clippy::missing_trait_methods)]
impl<S: Hybrid + ?Sized> Hybrid for &S {
    type Mode = S::Mode;
    type Kind = S::Kind;
    type Fault = S::Fault;
    const RESETS: bool = S::RESETS;
    fn mode(&self, t: f64, x: &StateOf<S>) -> S::Mode {
        (**self).mode(t, x)
    }
    #[inline(always)]
    fn guards(&self, mode: &S::Mode, t: f64, x: &StateOf<S>, out: &mut Vec<Guard>) {
        (**self).guards(mode, t, x, out);
    }
    #[inline(always)]
    fn acceleration_in(
        &self,
        mode: &S::Mode,
        w: &mut S::Workspace,
        t: f64,
        x: &StateOf<S>,
        out: &mut RateOf<S>,
    ) {
        (**self).acceleration_in(mode, w, t, x, out);
    }
    fn partials_in(
        &self,
        mode: &S::Mode,
        w: &mut S::Workspace,
        t: f64,
        x: &StateOf<S>,
        out: &mut Partials<S::Configuration>,
    ) {
        (**self).partials_in(mode, w, t, x, out);
    }
    fn event_kind(
        &self,
        guard: usize,
        before: &Guard,
        after: &Guard,
        modes: (&S::Mode, &S::Mode),
    ) -> S::Kind {
        (**self).event_kind(guard, before, after, modes)
    }
    fn check(&self) -> Result<(), IntegrateError> {
        (**self).check()
    }
    fn next_mode(&self, before: &S::Mode, t: f64, x: &StateOf<S>) -> S::Mode {
        (**self).next_mode(before, t, x)
    }
    fn reset(&self, t: f64, before: &S::Mode, after: &S::Mode, x: &mut StateOf<S>) {
        (**self).reset(t, before, after, x);
    }
    fn examine(&self, guard: usize, x: &StateOf<S>) -> Result<(), S::Fault> {
        (**self).examine(guard, x)
    }
    fn sweeps(&self, mode: &S::Mode, t: f64, h: f64, ends: (&StateOf<S>, &StateOf<S>), out: &mut Vec<Sweep>) {
        (**self).sweeps(mode, t, h, ends, out);
    }
    fn clear_time(&self, mode: &S::Mode, t: f64, x: &StateOf<S>, guards: &[Guard], horizon: f64) -> f64 {
        (**self).clear_time(mode, t, x, guards, horizon)
    }
    fn stiffest_rate(&self, mode: &S::Mode, x: &StateOf<S>) -> f64 {
        (**self).stiffest_rate(mode, x)
    }
    fn energy(&self, x: &StateOf<S>) -> Option<Energy> {
        (**self).energy(x)
    }
    #[inline(always)]
    fn impulse(&self, guard: usize, h: f64, before: &Guard, after: &Guard) -> f64 {
        (**self).impulse(guard, h, before, after)
    }
}

#[deny(clippy::missing_trait_methods)]
impl<S: HybridBodies + ?Sized> HybridBodies for &S {
    #[inline(always)]
    fn wrenches_in(&self, mode: &S::Mode, t: f64, x: &StateOf<S>, out: &mut RateOf<S>) {
        (**self).wrenches_in(mode, t, x, out);
    }
    #[inline(always)]
    fn body_wrenches_in(
        &self,
        mode: &S::Mode,
        t: f64,
        x: &State<BodyPoses<S>>,
        world: &mut WorldScratch<S>,
        out: &mut BodyRate<S>,
    ) {
        (**self).body_wrenches_in(mode, t, x, world, out);
    }
    fn add_terms_in(&self, mode: &S::Mode, i: usize, terms: &mut Vec<WrenchTerm>) -> bool {
        (**self).add_terms_in(mode, i, terms)
    }
}

/// A system frozen in one of its modes: smooth, and so fit for any method.
///
/// It is what the method of a run that locates events sees ([`Run::locating`](crate::run::Run::locating)). Forms and steppers
/// borrow it for a whole trajectory. The mode sits behind a cell that only the run sets, between steps, as it does the time at which
/// they must end.
#[derive(Debug, Clone)]
pub struct Frozen<'a, H: Hybrid> {
    system: &'a H,
    mode: RefCell<H::Mode>,
    /// The last time at which the equations are evaluated.
    last: Cell<f64>,
}

impl<'a, H: Hybrid> Frozen<'a, H> {
    /// The system in the mode of a state.
    pub fn new(system: &'a H, t: f64, x: &StateOf<H>) -> Self {
        let mode = RefCell::new(system.mode(t, x));
        let frozen = Self { system, mode, last: Cell::new(f64::INFINITY) };
        frozen.begin(t);
        frozen
    }

    /// Begins steps from t; returns the time at which they must end ([`System::next_stop`]), which may be infinite.
    pub fn begin(&self, t: f64) -> f64 {
        let stop = self.system.next_stop(t, f64::INFINITY).unwrap_or(f64::INFINITY);
        self.last.set(if stop.is_finite() { stop.next_down() } else { stop });
        stop
    }

    /// The time at which the equations are evaluated.
    #[inline(always)]
    fn time(&self, t: f64) -> f64 {
        t.min(self.last.get())
    }

    /// The system with its modes.
    pub fn system(&self) -> &'a H {
        self.system
    }

    /// Freezes it in another mode.
    pub fn freeze(&self, mode: &H::Mode) {
        self.mode.borrow_mut().clone_from(mode);
    }

    /// The mode it is frozen in.
    pub fn mode(&self) -> H::Mode {
        self.mode.borrow().clone()
    }

    /// Freezes the system in the mode after an event; returns the mode before.
    pub(super) fn refreeze(&self, t: f64, x: &StateOf<H>) -> H::Mode {
        let next = self.system.next_mode(&self.mode.borrow(), t, x);
        self.mode.replace(next)
    }

    /// What the change of a guard is called at an event from the mode before to the present one.
    pub(super) fn event_kind(&self, guard: usize, a: &Guard, b: &Guard, before: &H::Mode) -> H::Kind {
        self.system.event_kind(guard, a, b, (before, &self.mode.borrow()))
    }

    /// Lets the state jump from the mode before an event to the present one.
    pub(super) fn reset(&self, t: f64, before: &H::Mode, x: &mut StateOf<H>) {
        self.system.reset(t, before, &self.mode.borrow(), x);
    }

    pub(super) fn guards(&self, t: f64, x: &StateOf<H>, out: &mut Vec<Guard>) {
        out.clear();
        self.system.guards(&self.mode.borrow(), t, x, out);
    }

    pub(super) fn sweeps(&self, t: f64, h: f64, ends: (&StateOf<H>, &StateOf<H>), out: &mut Vec<Sweep>) {
        self.system.sweeps(&self.mode.borrow(), t, h, ends, out);
    }

    pub(super) fn clear_time(&self, t: f64, x: &StateOf<H>, guards: &[Guard], horizon: f64) -> f64 {
        self.system.clear_time(&self.mode.borrow(), t, x, guards, horizon)
    }

    pub(super) fn stiffest_rate(&self, x: &StateOf<H>) -> f64 {
        self.system.stiffest_rate(&self.mode.borrow(), x)
    }

    pub(super) fn energy(&self, x: &StateOf<H>) -> Option<Energy> {
        self.system.energy(x)
    }
}

#[deny(clippy::missing_trait_methods)]
impl<H: Hybrid> System for Frozen<'_, H> {
    type Configuration = H::Configuration;
    type Forms = H::Forms;
    type Workspace = H::Workspace;
    const IS_WATCHED: bool = true;
    fn workspace(&self) -> H::Workspace {
        self.system.workspace()
    }
    #[inline(always)]
    fn velocity(&self, w: &mut H::Workspace, t: f64, x: &StateOf<H>, out: &mut RateOf<H>) {
        self.system.velocity(w, t, x, out);
    }
    #[inline(always)]
    fn acceleration(&self, w: &mut H::Workspace, t: f64, x: &StateOf<H>, out: &mut RateOf<H>) {
        self.system.acceleration_in(&self.mode.borrow(), w, self.time(t), x, out);
    }
    fn partials(&self, w: &mut H::Workspace, t: f64, x: &StateOf<H>, out: &mut Partials<H::Configuration>) {
        self.system.partials_in(&self.mode.borrow(), w, self.time(t), x, out);
    }
    /// What the equations of a mode depend on is not known.
    fn depends_on_configuration(&self) -> bool {
        true
    }
    fn next_stop(&self, t: f64, end: f64) -> Option<f64> {
        self.system.next_stop(t, end)
    }
    fn take_fault(&self) -> Option<Fault> {
        self.system.take_fault()
    }
}

#[deny(clippy::missing_trait_methods)]
impl<H: HybridBodies> RigidSystem for Frozen<'_, H> {
    #[inline(always)]
    fn body(&self, i: usize) -> &RigidBody {
        self.system.body(i)
    }
    fn rest(&self) -> StateOf<H> {
        self.system.rest()
    }
    #[inline(always)]
    fn wrenches(&self, t: f64, x: &StateOf<H>, out: &mut RateOf<H>) {
        self.system.wrenches_in(&self.mode.borrow(), self.time(t), x, out);
    }
    #[inline(always)]
    fn body_wrenches(
        &self,
        t: f64,
        x: &State<BodyPoses<H>>,
        world: &mut WorldScratch<H>,
        out: &mut BodyRate<H>,
    ) {
        self.system.body_wrenches_in(&self.mode.borrow(), self.time(t), x, world, out);
    }
    fn add_terms(&self, i: usize, terms: &mut Vec<WrenchTerm>) -> bool {
        self.system.add_terms_in(&self.mode.borrow(), i, terms)
    }
    #[inline(always)]
    fn is_free(&self) -> bool {
        self.system.is_free()
    }
    #[inline(always)]
    fn is_torque_free(&self) -> bool {
        self.system.is_torque_free()
    }
    #[inline(always)]
    fn depends_on_velocity(&self) -> bool {
        self.system.depends_on_velocity()
    }
}
