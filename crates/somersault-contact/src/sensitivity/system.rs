//! A body in contact together with columns of tangents: its equations, its guards, and the jump of the
//! columns at events.

use super::contact::Linearization;
use super::grazing::{Grazing, Side};
use super::parameter::{FoundParameter, Parameter};
use crate::contacts::{BodyInContact, Contacts};
use crate::encounters::reset;
use crate::event::EventKind;
use crate::laws::{ContactChange, ContactLaw, ContactMode, Encounter};
use crate::stretches::{Touching, WithStretches};
use crate::surface::SurfaceFault;
use nalgebra::Vector3;
use somersault_integrators::augmented::{Augmented, AugmentedRate};
use somersault_integrators::driver::IntegrateError;
use somersault_integrators::events::{Energy, Guard, Hybrid, StepCurve, Sweep};
use somersault_integrators::force::ForceModel;
use somersault_integrators::methods::{Forms, Method, Options, Visitor};
use somersault_integrators::state::{InBody, Pose, Rate, RigidBodyState, State, Twist};
use somersault_integrators::system::{Decoder, Form, OneForm, System, world_acceleration};
use somersault_integrators::variation::{AccelerationDerivative, Tangent, Varied};
use std::cell::RefCell;

/// A pose with columns, and stretches beside both their rates.
pub type VariedPose = Varied<Augmented<Pose>, AugmentedRate<Twist>>;
/// Its rate.
type VariedRate = Varied<AugmentedRate<Twist>>;
/// A state with its columns.
pub type VariedState = State<VariedPose>;

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
    system: WithStretches<&'a BodyInContact<F>>,
    parameters: Vec<FoundParameter<'a>>,
    /// The fraction of the path of a point up to which it grazes.
    grazing: f64,
    /// Length of the interval.
    duration: f64,
    keep_events: bool,
    pub(super) log: RefCell<Log>,
}

impl<'a, F: ForceModel> Variational<'a, F> {
    pub(super) fn new(
        system: WithStretches<&'a BodyInContact<F>>,
        parameters: Vec<FoundParameter<'a>>,
        grazing: f64,
        duration: f64,
        keep_events: bool,
    ) -> Self {
        let grazing = grazing.max(f64::EPSILON.sqrt());
        Self { system, parameters, grazing, duration, keep_events, log: RefCell::default() }
    }

    /// The contacts.
    fn contacts(&self) -> &'a Contacts {
        &self.system.0.forces.1
    }

    /// The columns of a state, each with the parameter it belongs to.
    fn columns(
        &self,
        x: &VariedState,
    ) -> impl Iterator<Item = (Tangent<Twist>, Option<&FoundParameter<'a>>)> {
        let plain = x.rate.columns.len() - self.parameters.len();
        let parameters = std::iter::repeat_n(None, plain).chain(self.parameters.iter().map(Some));
        x.columns().zip(parameters)
    }

    fn wrench(&self, mode: &[ContactMode], t: f64, x: &VariedState) -> Twist {
        let mut wrench = Twist::default();
        let (q, rate) = (&x.configuration.base.0, &x.rate.base);
        let effort =
            |i: usize, law: &ContactLaw, at: &Encounter| law.effort_in(&mode[i], at, &rate.variables[i]);
        self.system.0.wrenches_by(t, (q, &rate.base), effort, &mut wrench);
        wrench
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

    /// Notes contacts that are open over a step and just miss their surface within it: the gap is the cubic
    /// through its values and rates at the ends.
    pub(super) fn watch(&self, (t, before): (f64, &VariedState), (t_after, after): (f64, &VariedState)) {
        let (body, h) = (&self.system.0.body, t_after - t);
        let (x, x_after) = (before.body(), after.body());
        for (guard, contact) in self.contacts().iter().enumerate().filter(|(_, c)| c.law().normal().jumps()) {
            let (a, b) = (contact.encounter(body, &x), contact.encounter(body, &x_after));
            if a.gap < 0.0 || b.gap < 0.0 || a.rate > 0.0 || b.rate < 0.0 {
                continue;
            }
            let [first, last] =
                [(a.gap, a.rate), (b.gap, b.rate)].map(|(gap, rate)| Guard { gap, rate, lag: 0.0 });
            // The least gap may be at an end of the step.
            let nearer = if a.gap < b.gap { (0.0, a.gap) } else { (1.0, b.gap) };
            let inside = StepCurve::new(&first, &last, h).least(1.0);
            let (theta, gap) = inside.filter(|(_, gap)| *gap < nearer.1).unwrap_or(nearer);
            let bound = self.bound(a.sliding.norm(), (b.rate - a.rate) / h);
            self.note(Grazing { t: t + theta * h, guard, gap, bound, side: Side::Missing });
        }
    }

    /// The event of one contact: the jump of the columns.
    fn cross(
        &self,
        t: f64,
        contact: usize,
        modes: (&ContactMode, &ContactMode),
        (acceleration, derivative): (&Twist, &AccelerationDerivative),
        x: &mut VariedState,
    ) {
        let (base, contacts) = (x.body(), self.contacts());
        let stretch = x.rate.base.variables[contact];
        let at = Linearization::new(&contacts[contact], &self.system.0.body, &base);
        let law = at.contact.law();
        let flow = Tangent { displacement: base.rate, rate: *acceleration };
        let flowing = at.along(&flow).at;
        let stretching = law.stretch_rate_in(modes.0, &at.at, &stretch);
        let margin_change = |change: &Encounter, parameter, stretch_change: &Vector3<f64>| {
            let along = ContactChange { at: change, stretch: stretch_change, parameter };
            law.margin_derivative(modes, &at.at, &stretch, &along)
        };
        let rate = margin_change(&flowing, None, &stretching);
        let times: Vec<f64> = self
            .columns(x)
            .enumerate()
            .map(|(k, (column, parameter))| {
                let change = &x.rate.columns[k].variables[contact];
                let parameter = parameter.and_then(|parameter| parameter.of_contact(contact));
                -margin_change(&at.along(&column).at, parameter, change) / rate
            })
            .collect();
        let begins = modes.0.is_open() && at.at.rate <= 0.0;
        let (jump, stretching_jump) = law.jump(modes, &at.at, &stretch);
        if begins && law.normal().jumps() && (flowing.rate > 0.0 || rate == 0.0) {
            let gap = if rate == 0.0 { 0.0 } else { -0.5 * rate * rate / flowing.rate };
            let bound = self.bound(at.velocity().norm(), flowing.rate);
            self.note(Grazing { t, guard: contact, gap, bound, side: Side::Touching });
        }
        let resets = modes.0.is_open() || modes.1.is_open();
        let jump = derivative.by_wrench(&at.wrench(&jump));
        for (column, &time) in x.rate.columns.iter_mut().zip(&times) {
            let change = &mut column.variables[contact];
            if resets {
                *change = Vector3::zeros();
            }
            // Where nothing jumps, as between stick and slip, the time of the event does not matter.
            if jump != Twist::default() {
                column.base.axpy(-time, &jump);
            }
            if stretching_jump != Vector3::zeros() {
                *change -= stretching_jump * time;
            }
        }
        if self.keep_events {
            let guard = if resets { contact } else { contacts.len() + contact };
            self.log.borrow_mut().times.push(EventTime { t, guard, columns: times });
        }
    }
}

impl<F: ForceModel> System for Variational<'_, F> {
    type Configuration = VariedPose;
    type Forms = VariedForms;
    type Workspace = ();
    fn workspace(&self) {}

    fn velocity(&self, _: &mut Self::Workspace, _: f64, x: &VariedState, out: &mut VariedRate) {
        out.assign(&x.rate);
        for (column, displacement) in out.columns.iter_mut().zip(&x.configuration.columns) {
            column.add_bracket(1.0, &x.rate.base, displacement);
        }
    }

    fn acceleration(&self, w: &mut (), t: f64, x: &VariedState, out: &mut VariedRate) {
        self.acceleration_in(&self.mode(t, x), w, t, x, out);
    }
}

#[deny(clippy::missing_trait_methods)]
impl<F: ForceModel> Hybrid for Variational<'_, F> {
    type Mode = Vec<ContactMode>;
    type Kind = EventKind;
    type Fault = SurfaceFault;
    const RESETS: bool = true;

    fn check(&self) -> Result<(), IntegrateError> {
        Ok(())
    }

    fn mode(&self, _: f64, x: &VariedState) -> Vec<ContactMode> {
        self.system.mode_at(&x.configuration.base, &x.rate.base)
    }

    fn next_mode(&self, before: &Vec<ContactMode>, _: f64, x: &VariedState) -> Vec<ContactMode> {
        self.system.next_mode_at(before, &x.configuration.base, &x.rate.base)
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

    fn guards(&self, mode: &Vec<ContactMode>, _: f64, x: &VariedState, out: &mut Vec<Guard>) {
        self.system.guards_at(mode, &x.configuration.base, &x.rate.base, out);
    }

    fn sweeps(
        &self,
        mode: &Vec<ContactMode>,
        t: f64,
        h: f64,
        ends: (&VariedState, &VariedState),
        out: &mut Vec<Sweep>,
    ) {
        self.system.0.sweeps(mode, t, h, (&ends.0.body(), &ends.1.body()), out);
    }

    fn clear_time(
        &self,
        mode: &Vec<ContactMode>,
        t: f64,
        x: &VariedState,
        guards: &[Guard],
        horizon: f64,
    ) -> f64 {
        self.system.0.clear_time(mode, t, &x.body(), guards, horizon)
    }

    fn examine(&self, guard: usize, x: &VariedState) -> Result<(), SurfaceFault> {
        self.system.0.examine(guard, &x.body())
    }

    fn stiffest_rate(&self, mode: &Vec<ContactMode>, x: &VariedState) -> f64 {
        self.system.0.stiffest_rate(mode, &x.body())
    }

    fn energy(&self, x: &VariedState) -> Option<Energy> {
        let of_body = self.system.0.energy(&x.body())?;
        let springs = self.system.energy_at(&x.configuration.base, &x.rate.base);
        Some(Energy { springs, ..of_body })
    }

    fn acceleration_in(
        &self,
        mode: &Vec<ContactMode>,
        (): &mut (),
        t: f64,
        x: &VariedState,
        out: &mut VariedRate,
    ) {
        let (base, body, (smooth, contacts)) = (x.body(), &self.system.0.body, &self.system.0.forces);
        let stretches = &x.rate.base.variables;
        self.system.wrenches_at(mode, t, &x.configuration.base, &x.rate.base, &mut out.base);
        let wrench = out.base.base;
        out.base.base = world_acceleration(body, &base, &wrench);
        for ((column, parameter), change) in self.columns(x).zip(&mut out.columns) {
            let mut sum = smooth.wrench_variation(t, body, &base, &column);
            match parameter.map(|found| found.parameter) {
                Some(Parameter::Mass) => sum = sum + smooth.mass_derivative(t, body, &base),
                Some(Parameter::Force(derivative)) => sum = sum + derivative(t, body, &base),
                Some(Parameter::Normal(..) | Parameter::Friction(..) | Parameter::InertiaScale) | None => {}
            }
            change.base = Twist { linear: sum.force, angular: sum.torque };
            change.variables.fill(Vector3::zeros());
        }
        for (i, mode) in mode.iter().enumerate().filter(|(_, mode)| !mode.is_open()) {
            let (at, stretch) = (Linearization::new(&contacts[i], body, &base), &stretches[i]);
            let law = at.contact.law();
            let effort = law.effort_in(mode, &at.at, stretch);
            let columns = self.columns(x).zip(&x.rate.columns).zip(&mut out.columns);
            for (((column, parameter), carried), change) in columns {
                let moved = at.along(&column);
                let parameter = parameter.and_then(|parameter| parameter.of_contact(i));
                let along = ContactChange { at: &moved.at, stretch: &carried.variables[i], parameter };
                let (effort_change, stretch_rate) = law.derivative_in(mode, &at.at, stretch, &along);
                change.base.axpy(1.0, &at.wrench_change(&moved, &effort, &effort_change));
                change.variables[i] = stretch_rate;
            }
        }
        let acceleration = out.base.base;
        let derivative = AccelerationDerivative::new(body, &base, &wrench, &acceleration);
        for ((column, parameter), change) in self.columns(x).zip(&mut out.columns) {
            change.base = derivative.along(&column, &change.base);
            match parameter.map(|found| found.parameter) {
                Some(Parameter::Mass) => change.base.linear -= acceleration.linear / body.mass(),
                Some(Parameter::InertiaScale) => {
                    change.base.angular -= derivative.by_wrench(&wrench).angular;
                }
                Some(Parameter::Normal(..) | Parameter::Friction(..) | Parameter::Force(_)) | None => {}
            }
        }
    }

    /// The saltation of the columns, and the stretches of contacts that begin and end.
    fn reset(&self, t: f64, before: &Vec<ContactMode>, after: &Vec<ContactMode>, x: &mut VariedState) {
        let base = x.body();
        let wrench = self.wrench(before, t, x);
        let acceleration = world_acceleration(&self.system.0.body, &base, &wrench);
        let derivative = AccelerationDerivative::new(&self.system.0.body, &base, &wrench, &acceleration);
        for (contact, modes) in before.iter().zip(after).enumerate() {
            if modes.0 != modes.1 {
                self.cross(t, contact, modes, (&acceleration, &derivative), x);
            }
        }
        reset(before, after, &mut x.rate.base.variables);
    }

    fn impulse(&self, guard: usize, h: f64, before: &Guard, after: &Guard) -> f64 {
        self.system.impulse(guard, h, before, after)
    }
}

/// A state with columns whose base is in body axes; the columns stay in those of the world.
type BodyVariedPose = Varied<Augmented<InBody<Pose>>, AugmentedRate<Twist>>;

/// The forms of a body with columns: in the variables of the world, and with its rotation in body axes. Methods for any
/// system take both.
#[derive(Debug, Clone, Copy)]
pub struct VariedForms;

impl<S: System<Configuration = VariedPose, Workspace = ()>> Forms<S> for VariedForms {
    fn visit<V: Visitor<VariedPose>>(
        method: Method,
        options: Options,
        system: &S,
        visitor: V,
    ) -> Option<V::Output> {
        method.visit_frames(options, system, InBodyAxes(system), visitor)
    }
}

/// A body with columns, its rotation in body axes.
struct InBodyAxes<'a, S>(&'a S);

/// Turns states with columns whose base is in body axes into those of the world.
#[derive(Debug, Clone, Copy)]
struct FromBodyAxes;

impl Decoder<BodyVariedPose, VariedPose> for FromBodyAxes {
    fn decode(&self, x: &State<BodyVariedPose>, out: &mut VariedState) {
        let (pose, rate) = (x.configuration.base.0.0, &x.rate.base.base.0);
        out.configuration.base.0 = pose;
        out.rate.base.base = Twist { linear: rate.linear, angular: pose.orientation * rate.angular };
        out.rate.base.variables.copy_from_slice(&x.rate.base.variables);
        out.configuration.columns.assign(&x.configuration.columns);
        out.rate.columns.assign(&x.rate.columns);
    }
}

impl<S: System<Configuration = VariedPose, Workspace = ()>> Form<VariedPose> for InBodyAxes<'_, S> {
    type Decoder = FromBodyAxes;
    fn encode(&self, x: &VariedState) -> State<BodyVariedPose> {
        State {
            configuration: Varied {
                base: Augmented(InBody(x.configuration.base.0)),
                columns: x.configuration.columns.clone(),
            },
            rate: rate_in_body_axes(&x.configuration.base.0, &x.rate),
        }
    }
    fn decoder(&self) -> FromBodyAxes {
        FromBodyAxes
    }
}

fn rate_in_body_axes(
    pose: &Pose,
    rate: &VariedRate,
) -> Varied<AugmentedRate<InBody<Twist>>, AugmentedRate<Twist>> {
    let Twist { linear, angular } = rate.base.base;
    let angular = pose.orientation.inverse_transform_vector(&angular);
    let base =
        AugmentedRate { base: InBody(Twist { linear, angular }), variables: rate.base.variables.clone() };
    Varied { base, columns: rate.columns.clone() }
}

impl<S: System<Configuration = VariedPose, Workspace = ()>> System for InBodyAxes<'_, S> {
    type Configuration = BodyVariedPose;
    type Forms = OneForm;
    type Workspace = Option<(VariedState, VariedRate)>;
    const IS_WATCHED: bool = S::IS_WATCHED;
    fn workspace(&self) -> Self::Workspace {
        None
    }

    fn velocity(
        &self,
        _: &mut Self::Workspace,
        _: f64,
        x: &State<BodyVariedPose>,
        out: &mut Varied<AugmentedRate<InBody<Twist>>, AugmentedRate<Twist>>,
    ) {
        out.assign(&x.rate);
        let (pose, rate) = (&x.configuration.base.0.0, &x.rate.base.base.0);
        let angular = pose.orientation * rate.angular;
        for (column, displacement) in out.columns.iter_mut().zip(&x.configuration.columns) {
            column.base.angular += angular.cross(&displacement.base.angular);
        }
    }

    fn acceleration(
        &self,
        w: &mut Self::Workspace,
        t: f64,
        x: &State<BodyVariedPose>,
        out: &mut Varied<AugmentedRate<InBody<Twist>>, AugmentedRate<Twist>>,
    ) {
        let (world, slope) = w.get_or_insert_with(|| {
            let pose = x.configuration.base.0.0;
            let base = State::augmented(
                RigidBodyState { configuration: pose, rate: Twist::default() },
                x.rate.base.variables.clone(),
            );
            let columns = x.configuration.columns.iter().zip(&x.rate.columns);
            let columns = columns.map(|(displacement, rate)| Tangent {
                displacement: displacement.clone(),
                rate: rate.clone(),
            });
            let world = VariedState::varied(base, columns);
            let slope = world.rate.clone();
            (world, slope)
        });
        FromBodyAxes.decode(x, world);
        self.0.acceleration(&mut (), t, world, slope);
        let Twist { linear, angular } = slope.base.base;
        let angular = world.configuration.base.0.orientation.inverse_transform_vector(&angular);
        out.base.base = InBody(Twist { linear, angular });
        out.base.variables.copy_from_slice(&slope.base.variables);
        out.columns.assign(&slope.columns);
    }
}
