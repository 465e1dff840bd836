//! What moves in contact together with columns of tangents: its equations, its guards, and the jump of the columns at
//! events.

use super::differentiable::{Differentiable, VariedOf};
use super::grazing::{Grazing, Side};
use super::outcome::SensitivityError;
use super::parameter::FoundParameter;
use super::record::{Passage, Record};
use crate::encounters::{self, reset};
use crate::event::EventKind;
use crate::laws::{ContactChange, ContactLaw, ContactMode, Encounter};
use crate::linearized::{At, LinearizedRoom, Rate};
use crate::shape::Feature;
use crate::surface::SurfaceFault;
use nalgebra::Vector3;
use somersault_integrators::augmented::AugmentedRate;
use somersault_integrators::driver::IntegrateError;
use somersault_integrators::events::{Energy, Guard, Hybrid, StepCurve, Sweep};
use somersault_integrators::force::Wrench;
use somersault_integrators::partials::Partials;
use somersault_integrators::state::{Rate as _, State};
use somersault_integrators::system::{Fault, System};
use somersault_integrators::variation::Varied;
use std::cell::{RefCell, RefMut};

/// A state with its columns.
type StateOf<S> = State<VariedOf<S>>;
/// Its rate.
type RateOf<S> = Varied<AugmentedRate<Rate<S>>>;

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
    /// The first contact whose nearest point passed to another part under friction, and the end of that step.
    pub(super) feature: Option<(usize, f64)>,
}

impl Log {
    /// Why there is no derivative of a run that went to its end.
    pub(super) fn reason(&self) -> Option<SensitivityError> {
        let of_feature = |(contact, t)| SensitivityError::Feature { contact, t };
        self.grazing.map(SensitivityError::Grazing).or(self.feature.map(of_feature))
    }
}

/// Something in contact with columns of tangents, the last of which belong to parameters.
///
/// One that keeps a record has no columns: it is the forward run of the adjoint.
#[derive(Debug)]
pub struct Variational<'a, S: Differentiable> {
    system: &'a S,
    parameters: Vec<FoundParameter<'a>>,
    /// The fraction of the path of a point up to which it grazes.
    grazing: f64,
    /// Length of the interval.
    duration: f64,
    keep_events: bool,
    pub(super) log: RefCell<Log>,
    /// Of a run for the adjoint.
    record: Option<RefCell<Record<S>>>,
    /// For what happens between steps.
    between: RefCell<Between<S::Room>>,
}

/// Room for what happens between steps.
#[derive(Debug)]
struct Between<W> {
    system: W,
    encounters: Vec<Encounter>,
    features: Vec<Feature>,
}

/// A contact that passes from one mode to another at an event.
#[derive(Debug, Clone, Copy)]
pub(super) struct Passing<'a> {
    pub(super) contact: usize,
    pub(super) law: &'a ContactLaw,
    pub(super) modes: (&'a ContactMode, &'a ContactMode),
}

/// What ends the mode of a contact, at the event.
#[derive(Debug)]
pub(super) struct Margin {
    pub(super) at: Encounter,
    pub(super) stretch: Vector3<f64>,
    /// The change of the encounter along the motion before.
    flowing: Encounter,
    /// The rate of the margin along that.
    pub(super) rate: f64,
}

impl Passing<'_> {
    /// Its margin in a state that is linearised with all its contacts, with the acceleration before the event.
    pub(super) fn margin<S: Differentiable>(
        &self,
        system: &S,
        w: &mut S::Room,
        t: f64,
        x: At<'_, S>,
        acceleration: &Rate<S>,
    ) -> Option<Margin> {
        let Self { contact, law, modes } = *self;
        let at = system.met(w, contact).copied()?;
        let stretch = x.1.variables[contact];
        system.vary(w, t, x, (&x.1.base, acceleration));
        let flowing = system.change(w, contact);
        let stretching = law.stretch_rate_in(modes.0, &at, &stretch);
        let along = ContactChange { at: &flowing, stretch: &stretching, parameter: None };
        let rate = law.margin_derivative(modes, &at, &stretch, &along);
        Some(Margin { at, stretch, flowing, rate })
    }

    /// Whether its stretch begins or ends.
    pub(super) fn resets(&self) -> bool {
        self.modes.0.is_open() || self.modes.1.is_open()
    }

    /// The guard that changes sign, among those of so many contacts.
    pub(super) fn guard(&self, contacts: usize) -> usize {
        if self.resets() { self.contact } else { contacts + self.contact }
    }
}

/// The parts of a state without its columns.
fn base<S: Differentiable>(x: &StateOf<S>) -> At<'_, S> {
    (&x.configuration.base, &x.rate.base)
}

impl<'a, S: Differentiable> Variational<'a, S> {
    pub(super) fn new(
        system: &'a S,
        parameters: Vec<FoundParameter<'a>>,
        grazing: f64,
        duration: f64,
        keep_events: bool,
    ) -> Self {
        let grazing = grazing.max(f64::EPSILON.sqrt());
        let between =
            RefCell::new(Between { system: system.room(), encounters: Vec::new(), features: Vec::new() });
        let log = RefCell::default();
        Self { system, parameters, grazing, duration, keep_events, log, record: None, between }
    }

    /// The same without columns, with a record of its steps and events.
    pub(super) fn recording(self, record: Record<S>) -> Self {
        Self { record: Some(RefCell::new(record)), ..self }
    }

    /// The record of steps and events, if one is kept.
    pub(super) fn record(&self) -> Option<RefMut<'_, Record<S>>> {
        self.record.as_ref().map(RefCell::borrow_mut)
    }

    /// The system.
    pub(super) fn system(&self) -> &'a S {
        self.system
    }

    /// What columns belong to, besides those of the initial state.
    pub(super) fn parameters(&self) -> &[FoundParameter<'a>] {
        &self.parameters
    }

    /// The parameter that column `k` of so many belongs to.
    #[inline]
    fn parameter(&self, k: usize, columns: usize) -> Option<&FoundParameter<'a>> {
        (k + self.parameters.len()).checked_sub(columns).and_then(|p| self.parameters.get(p))
    }

    /// The size of a least gap up to which a contact is grazed.
    fn bound(&self, speed: f64, acceleration: f64) -> f64 {
        self.grazing * self.duration * (speed + 0.5 * acceleration.abs() * self.duration)
    }

    /// Notes a graze, unless there was one before.
    fn note(&self, grazing: Grazing) {
        let mut log = self.log.borrow_mut();
        if grazing.gap.abs() <= grazing.bound && log.grazing.is_none() {
            log.grazing = Some(grazing);
        }
    }

    /// Notes contacts that are open over a step and just miss their surface within it, by the cubic through gap and rate at the ends, and
    /// those that touch with friction and pass to another part of their shape.
    pub(super) fn watch(&self, (t, before): (f64, &StateOf<S>), (t_after, after): (f64, &StateOf<S>)) {
        let h = t_after - t;
        let Between { encounters, features, .. } = &mut *self.between.borrow_mut();
        encounters.clear();
        let see = |_: usize, _: &ContactLaw, at: &Encounter| encounters.push(*at);
        self.system.each_encounter(&before.configuration.base.0, &before.rate.base.base, see);
        let see = |guard: usize, law: &ContactLaw, b: &Encounter| {
            let Some(a) = encounters.get(guard).filter(|_| law.normal().jumps()) else { return };
            if a.gap < 0.0 || b.gap < 0.0 || a.rate > 0.0 || b.rate < 0.0 {
                return;
            }
            let [first, last] =
                [(a.gap, a.rate), (b.gap, b.rate)].map(|(gap, rate)| Guard { gap, rate, lag: 0.0 });
            // The least gap may be at an end of the step.
            let nearer = if a.gap < b.gap { (0.0, a.gap) } else { (1.0, b.gap) };
            let inside = StepCurve::new(&first, &last, h).least(1.0);
            let (theta, gap) = inside.filter(|(_, gap)| *gap < nearer.1).unwrap_or(nearer);
            let bound = self.bound(a.sliding.norm(), (b.rate - a.rate) / h);
            self.note(Grazing { t: t + theta * h, guard, gap, bound, side: Side::Missing });
        };
        self.system.each_encounter(&after.configuration.base.0, &after.rate.base.base, see);
        features.clear();
        self.system.each_feature(base::<S>(before), |_, feature| features.push(feature));
        let mut of_before = features.iter();
        self.system.each_feature(base::<S>(after), |contact, feature| {
            let passes = of_before.next().is_some_and(|before| *before != feature);
            if passes && self.is_stretched(contact, [base::<S>(before), base::<S>(after)]) {
                self.log.borrow_mut().feature.get_or_insert((contact, t_after));
            }
        });
    }

    /// Whether the friction of a contact has a stretch, which is zero where it is open, at an end of a step.
    fn is_stretched(&self, contact: usize, ends: [At<'_, S>; 2]) -> bool {
        let has_stretch = self.system.laws().nth(contact).is_some_and(|law| law.friction().has_stretch());
        has_stretch && ends.iter().any(|(_, p)| p.variables[contact] != Vector3::zeros())
    }

    /// The event of one contact: the jump of the columns, in a state that is linearised with all its contacts.
    fn cross(
        &self,
        w: &mut S::Room,
        t: f64,
        (contact, law): (usize, &ContactLaw),
        modes: (&ContactMode, &ContactMode),
        acceleration: &Rate<S>,
        x: &mut StateOf<S>,
    ) {
        let passing = Passing { contact, law, modes };
        let Some(Margin { at, stretch, flowing, rate }) =
            passing.margin(self.system, w, t, base::<S>(x), acceleration)
        else {
            return;
        };
        let margin_change = |change: &Encounter, parameter, stretch_change: &Vector3<f64>| {
            let along = ContactChange { at: change, stretch: stretch_change, parameter };
            law.margin_derivative(modes, &at, &stretch, &along)
        };
        let count = x.rate.columns.len();
        let columns = x.configuration.columns.iter().zip(&x.rate.columns).enumerate();
        let times: Vec<f64> = columns
            .map(|(k, (displacement, change))| {
                let parameter = self.parameter(k, count);
                let along = (&displacement.base, &change.base);
                self.system.vary(w, t, base::<S>(x), along);
                if let Some(of) = parameter {
                    self.system.vary_by(w, t, base::<S>(x), of.parameter);
                }
                let of_law = parameter.and_then(|parameter| parameter.of_contact(contact));
                -margin_change(&self.system.change(w, contact), of_law, &change.variables[contact]) / rate
            })
            .collect();
        let begins = modes.0.is_open() && at.rate <= 0.0;
        let (jump, stretching_jump) = law.jump(modes, &at, &stretch);
        if begins && law.normal().jumps() && (flowing.rate > 0.0 || rate == 0.0) {
            let gap = if rate == 0.0 { 0.0 } else { -0.5 * rate * rate / flowing.rate };
            let bound = self.bound(at.sliding.norm().hypot(at.rate), flowing.rate);
            self.note(Grazing { t, guard: contact, gap, bound, side: Side::Touching });
        }
        let resets = passing.resets();
        // Where nothing jumps, as between stick and slip, the time of the event does not matter.
        let jumps = jump != Wrench::default();
        let mut response = acceleration.clone();
        if jumps {
            self.system.response(w, contact, base::<S>(x), &jump, &mut response);
        }
        for (column, &time) in x.rate.columns.iter_mut().zip(&times) {
            let change = &mut column.variables[contact];
            if resets {
                *change = Vector3::zeros();
            }
            if stretching_jump != Vector3::zeros() {
                *change -= stretching_jump * time;
            }
            if jumps {
                column.base.axpy(-time, &response);
            }
        }
        if self.keep_events {
            let guard = passing.guard(self.system.laws().count());
            self.log.borrow_mut().times.push(EventTime { t, guard, columns: times });
        }
    }
}

impl<S: Differentiable> System for Variational<'_, S> {
    type Configuration = VariedOf<S>;
    type Forms = S::Forms;
    type Workspace = LinearizedRoom<S::Room>;
    fn workspace(&self) -> Self::Workspace {
        LinearizedRoom::new(self.system.room())
    }

    fn velocity(&self, _: &mut Self::Workspace, _: f64, x: &StateOf<S>, out: &mut RateOf<S>) {
        out.assign(&x.rate);
        for (column, displacement) in out.columns.iter_mut().zip(&x.configuration.columns) {
            column.add_bracket(1.0, &x.rate.base, displacement);
        }
    }

    fn acceleration(&self, w: &mut Self::Workspace, t: f64, x: &StateOf<S>, out: &mut RateOf<S>) {
        self.acceleration_in(&self.mode(t, x), w, t, x, out);
    }

    fn partials(&self, w: &mut Self::Workspace, t: f64, x: &StateOf<S>, out: &mut Partials<VariedOf<S>>) {
        self.partials_in(&self.mode(t, x), w, t, x, out);
    }

    fn next_stop(&self, t: f64, end: f64) -> Option<f64> {
        self.system.next_stop_between(t, end)
    }

    fn take_fault(&self) -> Option<Fault> {
        self.system.fault()
    }
}

#[deny(clippy::missing_trait_methods)]
impl<S: Differentiable> Hybrid for Variational<'_, S> {
    type Mode = Vec<ContactMode>;
    type Kind = EventKind;
    type Fault = SurfaceFault;
    const RESETS: bool = true;

    fn check(&self) -> Result<(), IntegrateError> {
        Ok(())
    }

    fn mode(&self, _: f64, x: &StateOf<S>) -> Vec<ContactMode> {
        encounters::modes::<S::Moved>(self.system, base::<S>(x))
    }

    fn next_mode(&self, before: &Vec<ContactMode>, _: f64, x: &StateOf<S>) -> Vec<ContactMode> {
        encounters::next_modes::<S::Moved>(self.system, before, base::<S>(x))
    }

    fn event_kind(
        &self,
        guard: usize,
        before: &Guard,
        after: &Guard,
        modes: (&Vec<ContactMode>, &Vec<ContactMode>),
    ) -> EventKind {
        EventKind::of_guard(modes.0.len(), guard, before, after)
    }

    fn guards(&self, mode: &Vec<ContactMode>, _: f64, x: &StateOf<S>, out: &mut Vec<Guard>) {
        encounters::guards::<S::Moved>(self.system, mode, base::<S>(x), out);
    }

    fn sweeps(
        &self,
        mode: &Vec<ContactMode>,
        t: f64,
        h: f64,
        ends: (&StateOf<S>, &StateOf<S>),
        out: &mut Vec<Sweep>,
    ) {
        self.system.sweeps_between(mode, t, h, [base::<S>(ends.0), base::<S>(ends.1)], out);
    }

    fn clear_time(
        &self,
        mode: &Vec<ContactMode>,
        t: f64,
        x: &StateOf<S>,
        guards: &[Guard],
        horizon: f64,
    ) -> f64 {
        self.system.clear_time_from(mode, t, base::<S>(x), guards, horizon)
    }

    fn examine(&self, guard: usize, x: &StateOf<S>) -> Result<(), SurfaceFault> {
        self.system.examine_in(guard, base::<S>(x))
    }

    fn stiffest_rate(&self, mode: &Vec<ContactMode>, x: &StateOf<S>) -> f64 {
        self.system.stiffest_rate_in(mode, base::<S>(x))
    }

    fn energy(&self, x: &StateOf<S>) -> Option<Energy> {
        self.system.energy_in(base::<S>(x))
    }

    fn acceleration_in(
        &self,
        mode: &Vec<ContactMode>,
        w: &mut Self::Workspace,
        t: f64,
        x: &StateOf<S>,
        out: &mut RateOf<S>,
    ) {
        let (system, at) = (self.system, base::<S>(x));
        if let Some(mut record) = self.record() {
            record.stages.note(t, at);
            return system.accelerate(&mut w.system, mode, t, at, &mut out.base);
        }
        w.linearize(system, mode, t, at, &mut out.base);
        let columns = x.configuration.columns.iter().zip(&x.rate.columns);
        let count = x.rate.columns.len();
        for (k, ((displacement, carried), change)) in columns.zip(&mut out.columns).enumerate() {
            let parameter = self.parameter(k, count);
            let of_law = |contact| parameter.and_then(|parameter| parameter.of_contact(contact));
            let AugmentedRate { base: change, variables } = change;
            let beside = |w: &mut S::Room| {
                if let Some(of) = parameter {
                    system.vary_by(w, t, at, of.parameter);
                }
            };
            w.vary(system, mode, t, at, (&displacement.base, carried), beside, of_law, variables);
            let w = &mut w.system;
            system.acceleration_change(w, at, change);
            if let Some(of) = parameter {
                system.add_change_by(w, of.parameter, change);
            }
        }
    }

    /// Those of the motion without columns, along which they are the same.
    fn partials_in(
        &self,
        mode: &Vec<ContactMode>,
        w: &mut Self::Workspace,
        t: f64,
        x: &StateOf<S>,
        out: &mut Partials<VariedOf<S>>,
    ) {
        let (system, at) = (self.system, base::<S>(x));
        w.linearize(system, mode, t, at, &mut out.room_mut().base);
        out.by_columns(|(displacement, change), slope| {
            let AugmentedRate { base, variables } = &mut slope.base;
            w.vary(system, mode, t, at, (&displacement.base.base, &change.base), |_| {}, |_| None, variables);
            system.acceleration_change(&mut w.system, at, base);
        });
    }

    /// The saltation of the columns, and the stretches of contacts that begin and end.
    fn reset(&self, t: f64, before: &Vec<ContactMode>, after: &Vec<ContactMode>, x: &mut StateOf<S>) {
        if let Some(mut record) = self.record() {
            record.passages.push(Passage { t, modes: (before.clone(), after.clone()), state: x.base() });
        }
        let Between { system: w, .. } = &mut *self.between.borrow_mut();
        let mut slope = x.rate.base.clone();
        self.system.linearize(w, (before, true), t, base::<S>(x), &mut slope);
        for (contact, (law, modes)) in self.system.laws().zip(before.iter().zip(after)).enumerate() {
            if modes.0 != modes.1 {
                self.cross(w, t, (contact, law), modes, &slope.base, x);
            }
        }
        reset(before, after, &mut x.rate.base.variables);
    }

    fn impulse(&self, guard: usize, h: f64, before: &Guard, after: &Guard) -> f64 {
        self.system.laws().nth(guard).map_or(0.0, |law| law.normal().impulse(h, before, after))
    }
}
