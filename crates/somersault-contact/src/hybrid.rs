//! Systems whose equations change at events: modes, guards, and a system frozen in a mode.

mod guard;

pub use guard::Guard;

use crate::event::EventKind;
use crate::surface::SurfaceFault;
use crate::sweep::Sweep;
use somersault_integrators::body::RigidBody;
use somersault_integrators::driver::IntegrateError;
use somersault_integrators::state::State;
use somersault_integrators::system::{
    BodyPoses, BodyRate, Decoder, Fault, FromBody, RateOf, RigidSystem, StateOf, System, torques_in_body_axes,
};
use std::cell::RefCell;

/// The energy of a system whose forces do not drive it.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Energy {
    /// Kinetic energy, J.
    pub kinetic: f64,
    /// Energy of the springs in contact, J.
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
/// As a [`System`] in its own right it reads the mode from the state at every evaluation.
pub trait Hybrid: System {
    /// Which equations hold.
    type Mode: Clone + PartialEq + std::fmt::Debug;

    /// Whether states jump at events; [`reset`](Self::reset) is called only where they do.
    const RESETS: bool = false;

    /// Why the system cannot be integrated as it stands; drivers ask before a run.
    fn check(&self) -> Result<(), IntegrateError>;

    /// The mode that a state belongs to: by [`Guard::is_inside`] of its guards, so that both agree where a
    /// guard is zero.
    fn mode(&self, t: f64, x: &StateOf<Self>) -> Self::Mode;

    /// The mode after an event, from the one before it and the state; by default from the state alone.
    ///
    /// What a mode remembers, say where a contact began to stick, is handed on here.
    fn next_mode(&self, _before: &Self::Mode, t: f64, x: &StateOf<Self>) -> Self::Mode {
        self.mode(t, x)
    }

    /// What it is called that a guard changed sign, given the modes before and after the event; by default
    /// a contact that begins, ends or engages again.
    fn event_kind(
        &self,
        _guard: usize,
        before: &Guard,
        after: &Guard,
        _modes: (&Self::Mode, &Self::Mode),
    ) -> EventKind {
        EventKind::of_contact(before, after)
    }

    /// Writes the guards: as many, in the same order, in every mode.
    fn guards(&self, mode: &Self::Mode, t: f64, x: &StateOf<Self>, out: &mut Vec<Guard>);

    /// Bounds of the motion behind each guard during a step of h from `ends.0` at `t` to `ends.1`, in the order of
    /// the guards; [`Sweep::UNKNOWN`] where none is known.
    ///
    /// With them the driver proves that a guard outside stays so.
    fn sweeps(
        &self,
        mode: &Self::Mode,
        t: f64,
        h: f64,
        ends: (&StateOf<Self>, &StateOf<Self>),
        out: &mut Vec<Sweep>,
    );

    /// For how long, up to `horizon`, no guard can go in, proved from the guards of a state and from what bounds
    /// its motion; zero where nothing is known.
    fn clear_time(&self, mode: &Self::Mode, t: f64, x: &StateOf<Self>, guards: &[Guard], horizon: f64)
    -> f64;

    /// Whether the surface behind a guard is fit to be touched in a state: asked at the first touch.
    fn examine(&self, guard: usize, x: &StateOf<Self>) -> Result<(), SurfaceFault>;

    /// The fastest rate of the contacts closed in a mode, 1/s: an upper bound of |λ| of the springs and dampers
    /// with the masses that they move. Zero where none is closed.
    fn contact_rate(&self, mode: &Self::Mode, x: &StateOf<Self>) -> f64;

    /// Kinetic energy, energy of the springs in contact and potential of the forces, J; `None` where a force may
    /// drive the motion or has no potential.
    fn energy(&self, x: &StateOf<Self>) -> Option<Energy>;

    /// Time derivative of the rate by the equations of a mode, also where they do not hold.
    fn acceleration_in(
        &self,
        mode: &Self::Mode,
        w: &mut Self::Workspace,
        t: f64,
        x: &StateOf<Self>,
        out: &mut RateOf<Self>,
    );

    /// The jump of the state at an event from one mode to the next; by default there is none.
    ///
    /// It is made after the step that ends at the event and before the guards are read again. It must
    /// leave the mode that the state belongs to as it is.
    fn reset(&self, _t: f64, _before: &Self::Mode, _after: &Self::Mode, _x: &mut StateOf<Self>) {}

    /// Impulse (N s) that belongs to a guard over a step of h inside it.
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
        (world, wrenches): &mut (StateOf<Self>, RateOf<Self>),
        out: &mut BodyRate<Self>,
    ) {
        FromBody.decode(x, world);
        self.wrenches_in(mode, t, world, wrenches);
        torques_in_body_axes::<Self::Configuration>(x, wrenches, out);
    }
}

impl<S: Hybrid + ?Sized> Hybrid for &S {
    type Mode = S::Mode;
    const RESETS: bool = S::RESETS;
    fn check(&self) -> Result<(), IntegrateError> {
        (**self).check()
    }
    fn mode(&self, t: f64, x: &StateOf<S>) -> S::Mode {
        (**self).mode(t, x)
    }
    fn next_mode(&self, before: &S::Mode, t: f64, x: &StateOf<S>) -> S::Mode {
        (**self).next_mode(before, t, x)
    }
    fn event_kind(
        &self,
        guard: usize,
        before: &Guard,
        after: &Guard,
        modes: (&S::Mode, &S::Mode),
    ) -> EventKind {
        (**self).event_kind(guard, before, after, modes)
    }
    #[inline(always)]
    fn guards(&self, mode: &S::Mode, t: f64, x: &StateOf<S>, out: &mut Vec<Guard>) {
        (**self).guards(mode, t, x, out);
    }
    fn sweeps(&self, mode: &S::Mode, t: f64, h: f64, ends: (&StateOf<S>, &StateOf<S>), out: &mut Vec<Sweep>) {
        (**self).sweeps(mode, t, h, ends, out);
    }
    fn clear_time(&self, mode: &S::Mode, t: f64, x: &StateOf<S>, guards: &[Guard], horizon: f64) -> f64 {
        (**self).clear_time(mode, t, x, guards, horizon)
    }
    fn examine(&self, guard: usize, x: &StateOf<S>) -> Result<(), SurfaceFault> {
        (**self).examine(guard, x)
    }
    fn contact_rate(&self, mode: &S::Mode, x: &StateOf<S>) -> f64 {
        (**self).contact_rate(mode, x)
    }
    fn energy(&self, x: &StateOf<S>) -> Option<Energy> {
        (**self).energy(x)
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
    fn reset(&self, t: f64, before: &S::Mode, after: &S::Mode, x: &mut StateOf<S>) {
        (**self).reset(t, before, after, x);
    }
    #[inline(always)]
    fn impulse(&self, guard: usize, h: f64, before: &Guard, after: &Guard) -> f64 {
        (**self).impulse(guard, h, before, after)
    }
}

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
        world: &mut (StateOf<S>, RateOf<S>),
        out: &mut BodyRate<S>,
    ) {
        (**self).body_wrenches_in(mode, t, x, world, out);
    }
}

/// A system frozen in one of its modes: smooth, and so fit for any method.
///
/// Forms and steppers borrow it for a whole trajectory. The mode sits behind a cell that only the
/// event-locating driver sets, between steps.
#[derive(Debug, Clone)]
pub struct Frozen<H: Hybrid> {
    system: H,
    mode: RefCell<H::Mode>,
}

impl<H: Hybrid> Frozen<H> {
    /// The system in the mode of a state.
    pub fn new(system: H, t: f64, x: &StateOf<H>) -> Self {
        let mode = RefCell::new(system.mode(t, x));
        Self { system, mode }
    }

    /// The system with its modes.
    pub fn system(&self) -> &H {
        &self.system
    }

    /// The mode it is frozen in.
    pub fn mode(&self) -> H::Mode {
        self.mode.borrow().clone()
    }

    /// Reads the mode of a state, whatever went before, and freezes the system in it.
    pub(crate) fn freeze(&self, t: f64, x: &StateOf<H>) {
        self.mode.replace(self.system.mode(t, x));
    }

    /// Freezes the system in the mode after an event; returns the mode before.
    pub(crate) fn refreeze(&self, t: f64, x: &StateOf<H>) -> H::Mode {
        let next = self.system.next_mode(&self.mode.borrow(), t, x);
        self.mode.replace(next)
    }

    /// What the change of a guard is called at an event from the mode before to the present one.
    pub(crate) fn event_kind(&self, guard: usize, a: &Guard, b: &Guard, before: &H::Mode) -> EventKind {
        self.system.event_kind(guard, a, b, (before, &self.mode.borrow()))
    }

    /// Lets the state jump from the mode before an event to the present one.
    pub(crate) fn reset(&self, t: f64, before: &H::Mode, x: &mut StateOf<H>) {
        self.system.reset(t, before, &self.mode.borrow(), x);
    }

    pub(crate) fn guards(&self, t: f64, x: &StateOf<H>, out: &mut Vec<Guard>) {
        out.clear();
        self.system.guards(&self.mode.borrow(), t, x, out);
    }

    pub(crate) fn sweeps(&self, t: f64, h: f64, ends: (&StateOf<H>, &StateOf<H>), out: &mut Vec<Sweep>) {
        out.clear();
        self.system.sweeps(&self.mode.borrow(), t, h, ends, out);
    }

    pub(crate) fn clear_time(&self, t: f64, x: &StateOf<H>, guards: &[Guard], horizon: f64) -> f64 {
        self.system.clear_time(&self.mode.borrow(), t, x, guards, horizon)
    }

    pub(crate) fn contact_rate(&self, x: &StateOf<H>) -> f64 {
        self.system.contact_rate(&self.mode.borrow(), x)
    }

    pub(crate) fn energy(&self, x: &StateOf<H>) -> Option<Energy> {
        self.system.energy(x)
    }
}

#[deny(clippy::missing_trait_methods)]
impl<H: Hybrid> System for Frozen<H> {
    type Configuration = H::Configuration;
    type Forms = H::Forms;
    type Workspace = H::Workspace;
    fn workspace(&self) -> H::Workspace {
        self.system.workspace()
    }
    #[inline(always)]
    fn velocity(&self, w: &mut H::Workspace, t: f64, x: &StateOf<H>, out: &mut RateOf<H>) {
        self.system.velocity(w, t, x, out);
    }
    #[inline(always)]
    fn acceleration(&self, w: &mut H::Workspace, t: f64, x: &StateOf<H>, out: &mut RateOf<H>) {
        self.system.acceleration_in(&self.mode.borrow(), w, t, x, out);
    }
    fn take_fault(&self) -> Option<Fault> {
        self.system.take_fault()
    }
}

#[deny(clippy::missing_trait_methods)]
impl<H: HybridBodies> RigidSystem for Frozen<H> {
    #[inline(always)]
    fn body(&self, i: usize) -> &RigidBody {
        self.system.body(i)
    }
    fn rest(&self) -> StateOf<H> {
        self.system.rest()
    }
    #[inline(always)]
    fn wrenches(&self, t: f64, x: &StateOf<H>, out: &mut RateOf<H>) {
        self.system.wrenches_in(&self.mode.borrow(), t, x, out);
    }
    #[inline(always)]
    fn body_wrenches(
        &self,
        t: f64,
        x: &State<BodyPoses<H>>,
        world: &mut (StateOf<H>, RateOf<H>),
        out: &mut BodyRate<H>,
    ) {
        self.system.body_wrenches_in(&self.mode.borrow(), t, x, world, out);
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
