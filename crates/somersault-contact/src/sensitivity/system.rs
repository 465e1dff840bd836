//! A body in contact together with columns of tangents: its equations, its guards, and the jump of the
//! columns at events.

use super::contact::Linearization;
use super::law::{Changes, LawChange, is_open};
use super::outcome::Grazing;
use super::parameter::Parameter;
use crate::contacts::BodyInContact;
use crate::event::EventKind;
use crate::hybrid::{Energy, Guard, Hybrid, HybridBodies};
use crate::interface::{ContactLaw, ContactMode, Encounter};
use crate::surface::SurfaceFault;
use crate::sweep::Sweep;
use nalgebra::Vector3;
use somersault_integrators::force::{ForceModel, Wrench};
use somersault_integrators::state::{Pose, Rate, RigidBodyState, State, Twist};
use somersault_integrators::system::System;
use somersault_integrators::variation::{AccelerationDerivative, Tangent, Varied};
use std::cell::RefCell;

/// A state with its columns.
pub type VariedState = State<Varied<Pose, Twist>>;

/// The derivative of the time of an event along each column.
#[derive(Debug)]
pub(super) struct EventTime {
    pub(super) t: f64,
    pub(super) guard: usize,
    pub(super) columns: Vec<f64>,
}

/// What the events of a run leave behind.
#[derive(Debug, Default)]
pub(super) struct Log {
    pub(super) times: Vec<EventTime>,
    /// The first event without a derivative.
    pub(super) grazing: Option<Grazing>,
}

/// A body in contact with columns of tangents, the last of which belong to parameters.
#[derive(Debug)]
pub struct Variational<'a, F> {
    system: &'a BodyInContact<F>,
    parameters: &'a [Parameter],
    /// Time to a tangency below which a touch-down is one.
    grazing_time: f64,
    /// Time before a stop within which the direction of sliding is settled.
    settling_time: f64,
    keep_events: bool,
    pub(super) log: RefCell<Log>,
    /// Of each contact, the columns of what its mode remembers.
    memories: RefCell<Vec<Vec<Vector3<f64>>>>,
}

impl<'a, F: ForceModel> Variational<'a, F> {
    pub(super) fn new(
        system: &'a BodyInContact<F>,
        parameters: &'a [Parameter],
        (grazing_time, settling_time): (f64, f64),
        keep_events: bool,
        start: &VariedState,
    ) -> Self {
        let base = start.base();
        let memory = |contact| {
            let at = Linearization::new(contact, &system.body, &base);
            let mode = at.contact.law().mode(&at.at);
            start.columns().map(|c| ContactLaw::memory_change(&mode, &at.at, &at.along(&c).at)).collect()
        };
        let memories = RefCell::new(system.forces.1.iter().map(memory).collect());
        Self {
            system,
            parameters,
            grazing_time,
            settling_time,
            keep_events,
            log: RefCell::default(),
            memories,
        }
    }

    /// The columns of a state, each with the parameter it belongs to.
    fn columns(&self, x: &VariedState) -> impl Iterator<Item = (Tangent<Twist>, Option<&Parameter>)> {
        let plain = x.rate.columns.len() - self.parameters.len();
        let parameters = std::iter::repeat_n(None, plain).chain(self.parameters.iter().map(Some));
        x.columns().zip(parameters)
    }

    fn wrench(&self, mode: &Vec<ContactMode>, t: f64, x: &RigidBodyState) -> Twist {
        let mut wrench = Twist::default();
        self.system.wrenches_in(mode, t, x, &mut wrench);
        wrench
    }

    /// The event of one contact: the jump of the columns, and of what its mode remembers.
    fn cross(
        &self,
        t: f64,
        contact: usize,
        modes: (&ContactMode, &ContactMode),
        (acceleration, derivative): (&Twist, &AccelerationDerivative),
        x: &mut VariedState,
    ) {
        let (base, contacts) = (x.base(), &self.system.forces.1);
        let mut at = Linearization::new(&contacts[contact], &self.system.body, &base);
        let law = at.contact.law();
        let effort = law.effort_in(modes.0, &at.at);
        let is_stop = law.stops(modes, &at.at, self.settling_time * at.mobility(&self.system.body));
        if is_stop {
            at.at.sliding = Vector3::zeros();
        }
        let mut flow = Tangent { displacement: base.rate, rate: *acceleration };
        let off = law.effort_in(modes.0, &at.at) - effort;
        flow.rate.axpy(1.0, &derivative.by_wrench(&at.wrench(&off)));
        let flowing = at.along(&flow).at;
        let margin_change = |change: &Encounter, law_change, memory| {
            let by = Changes { at: change, law: law_change, memory, settling: 0.0 };
            law.margin_change(modes, &at.at, &by)
        };
        let rate = margin_change(&flowing, LawChange::default(), Vector3::zeros());
        let mut memories = self.memories.borrow_mut();
        let memory = &mut memories[contact];
        let times: Vec<f64> = self
            .columns(x)
            .zip(memory.iter())
            .map(|((column, parameter), &memory)| {
                -margin_change(&at.along(&column).at, law_change(parameter, contact), memory) / rate
            })
            .collect();
        let touches = is_open(modes.0) && at.at.rate <= 0.0 && law.normal.jumps();
        let jump = law.jump(modes, &at.at);
        let bound = if touches { self.grazing_time * flowing.rate.abs() } else { 0.0 };
        let mut log = self.log.borrow_mut();
        if rate.abs() <= bound && (touches || jump != Wrench::default()) && log.grazing.is_none() {
            log.grazing = Some(Grazing { t, guard: contact, rate, bound });
        }
        if rate != 0.0 {
            let jump = derivative.by_wrench(&at.wrench(&jump));
            for (k, &time) in times.iter().enumerate() {
                // The column at the event itself, whose time it moves.
                let column = x.column(k);
                let displacement = moved(&column.displacement, time, &flow.displacement);
                let there = Tangent { displacement, rate: moved(&column.rate, time, &flow.rate) };
                let change = at.along(&there).at;
                memory[k] = ContactLaw::memory_change(modes.1, &at.at, &change);
                let rate = &mut x.rate.columns[k];
                rate.axpy(-time, &jump);
                if is_stop {
                    // Every motion nearby stops with no sliding velocity at all.
                    rate.axpy(1.0, &at.holding(&self.system.body, &base, &change.sliding));
                }
            }
        }
        if self.keep_events {
            let own = is_open(modes.0) || is_open(modes.1);
            let guard = if own { contact } else { contacts.len() + contact };
            log.times.push(EventTime { t, guard, columns: times });
        }
    }
}

impl<F: ForceModel> System for Variational<'_, F> {
    type Configuration = Varied<Pose, Twist>;
    type Workspace = ();
    fn workspace(&self) {}

    fn velocity(&self, _: &mut Self::Workspace, _: f64, x: &VariedState, out: &mut Varied<Twist>) {
        out.assign(&x.rate);
        for (column, displacement) in out.columns.iter_mut().zip(&x.configuration.columns) {
            column.add_bracket(1.0, &x.rate.base, displacement);
        }
    }

    fn acceleration(&self, w: &mut (), t: f64, x: &VariedState, out: &mut Varied<Twist>) {
        self.acceleration_in(&self.mode(t, x), w, t, x, out);
    }
}

impl<F: ForceModel> Hybrid for Variational<'_, F> {
    type Mode = Vec<ContactMode>;
    const RESETS: bool = true;

    fn mode(&self, t: f64, x: &VariedState) -> Vec<ContactMode> {
        self.system.mode(t, &x.base())
    }

    fn next_mode(&self, before: &Vec<ContactMode>, t: f64, x: &VariedState) -> Vec<ContactMode> {
        self.system.next_mode(before, t, &x.base())
    }

    fn event_kind(
        &self,
        guard: usize,
        before: &Guard,
        after: &Guard,
        modes: (&Vec<ContactMode>, &Vec<ContactMode>),
    ) -> EventKind {
        self.system.event_kind(guard, before, after, modes)
    }

    fn guards(&self, mode: &Vec<ContactMode>, t: f64, x: &VariedState, out: &mut Vec<Guard>) {
        self.system.guards(mode, t, &x.base(), out);
    }

    fn sweeps(
        &self,
        mode: &Vec<ContactMode>,
        t: f64,
        h: f64,
        ends: (&VariedState, &VariedState),
        out: &mut Vec<Sweep>,
    ) {
        self.system.sweeps(mode, t, h, (&ends.0.base(), &ends.1.base()), out);
    }

    fn clear_time(
        &self,
        mode: &Vec<ContactMode>,
        t: f64,
        x: &VariedState,
        guards: &[Guard],
        horizon: f64,
    ) -> f64 {
        self.system.clear_time(mode, t, &x.base(), guards, horizon)
    }

    fn examine(&self, guard: usize, x: &VariedState) -> Result<(), SurfaceFault> {
        self.system.examine(guard, &x.base())
    }

    fn contact_rate(&self, mode: &Vec<ContactMode>, x: &VariedState) -> f64 {
        self.system.contact_rate(mode, &x.base())
    }

    fn energy(&self, mode: &Vec<ContactMode>, x: &VariedState) -> Option<Energy> {
        self.system.energy(mode, &x.base())
    }

    fn acceleration_in(
        &self,
        mode: &Vec<ContactMode>,
        (): &mut (),
        t: f64,
        x: &VariedState,
        out: &mut Varied<Twist>,
    ) {
        let (base, body, (smooth, contacts)) = (x.base(), &self.system.body, &self.system.forces);
        let wrench = self.wrench(mode, t, &base);
        self.system.acceleration_in(mode, &mut (), t, &base, &mut out.base);
        for ((column, parameter), change) in self.columns(x).zip(&mut out.columns) {
            let mut sum = smooth.wrench_variation(t, body, &base, &column);
            match parameter {
                Some(Parameter::Mass) => sum = sum + smooth.mass_derivative(t, body, &base),
                Some(Parameter::Force(derivative)) => sum = sum + derivative(t, body, &base),
                _ => {}
            }
            *change = Twist { linear: sum.force, angular: sum.torque };
        }
        let memories = self.memories.borrow();
        for (i, mode) in mode.iter().enumerate().filter(|(_, mode)| !is_open(mode)) {
            let at = Linearization::new(&contacts[i], body, &base);
            let effort = at.contact.law().effort_in(mode, &at.at);
            let settling = self.settling_time * at.mobility(body);
            let columns = self.columns(x).zip(&memories[i]).zip(&mut out.columns);
            for (((column, parameter), &memory), change) in columns {
                let moved = at.along(&column);
                let by = Changes { at: &moved.at, law: law_change(parameter, i), memory, settling };
                let effort_change = at.contact.law().effort_change(mode, &at.at, &by);
                change.axpy(1.0, &at.wrench_change(&moved, &effort, &effort_change));
            }
        }
        let derivative = AccelerationDerivative::new(body, &base, &wrench, &out.base);
        for ((column, parameter), change) in self.columns(x).zip(&mut out.columns) {
            *change = derivative.along(&column, change);
            match parameter {
                Some(Parameter::Mass) => change.linear -= out.base.linear / body.mass(),
                Some(Parameter::InertiaScale) => {
                    change.angular -= derivative.by_wrench(&wrench).angular;
                }
                _ => {}
            }
        }
    }

    /// The saltation of the columns.
    fn reset(&self, t: f64, before: &Vec<ContactMode>, after: &Vec<ContactMode>, x: &mut VariedState) {
        let base = x.base();
        let wrench = self.wrench(before, t, &base);
        let mut acceleration = Twist::default();
        self.system.acceleration_in(before, &mut (), t, &base, &mut acceleration);
        let derivative = AccelerationDerivative::new(&self.system.body, &base, &wrench, &acceleration);
        for (contact, modes) in before.iter().zip(after).enumerate() {
            if modes.0 != modes.1 {
                self.cross(t, contact, modes, (&acceleration, &derivative), x);
            }
        }
    }

    fn impulse(&self, guard: usize, h: f64, before: &Guard, after: &Guard) -> f64 {
        self.system.impulse(guard, h, before, after)
    }
}

/// column + time · flow.
fn moved(column: &Twist, time: f64, flow: &Twist) -> Twist {
    let mut sum = *column;
    sum.axpy(time, flow);
    sum
}

/// What a parameter changes in the law of contact `i`.
fn law_change(parameter: Option<&Parameter>, i: usize) -> LawChange {
    let mut change = LawChange::default();
    match parameter {
        Some(&Parameter::Stiffness(contact)) if contact == i => change.stiffness = 1.0,
        Some(&Parameter::Damping(contact)) if contact == i => change.damping = 1.0,
        Some(&Parameter::Friction(contact)) if contact == i => change.friction = 1.0,
        _ => {}
    }
    change
}
