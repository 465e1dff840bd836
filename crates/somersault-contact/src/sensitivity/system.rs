//! A body in contact together with columns of tangents: its equations, its guards, and the jump of the
//! columns at events.

use super::contact::{LawChange, Linearization};
use super::{Grazing, Parameter};
use crate::contacts::BodyInContact;
use crate::event::EventKind;
use crate::hybrid::{Guard, Hybrid, HybridBodies};
use somersault_integrators::force::{ForceModel, Wrench};
use somersault_integrators::state::{Pose, Rate, RigidBodyState, State, Twist};
use somersault_integrators::system::{System, world_acceleration};
use somersault_integrators::variation::{Tangent, Varied, world_acceleration_variation};
use std::cell::RefCell;

/// A state with its columns.
pub type VariedState = State<Varied<Pose, Twist>>;

/// What the events of a run leave behind.
#[derive(Debug, Default)]
pub(super) struct Log {
    /// Derivative of the time of each event along each column.
    pub(super) event_times: Vec<Vec<f64>>,
    /// The first event without a derivative.
    pub(super) grazing: Option<Grazing>,
}

/// A body in contact with columns of tangents, the last of which belong to parameters.
#[derive(Debug)]
pub struct Variational<'a, F> {
    system: &'a BodyInContact<F>,
    parameters: &'a [Parameter],
    /// Time to a tangency below which an event is one.
    grazing_time: f64,
    keep_events: bool,
    pub(super) log: RefCell<Log>,
}

impl<'a, F: ForceModel> Variational<'a, F> {
    pub(super) fn new(
        system: &'a BodyInContact<F>,
        parameters: &'a [Parameter],
        grazing_time: f64,
        keep_events: bool,
    ) -> Self {
        Self { system, parameters, grazing_time, keep_events, log: RefCell::default() }
    }

    /// The columns of a state, each with the parameter it belongs to.
    fn columns(&self, x: &VariedState) -> impl Iterator<Item = (Tangent<Twist>, Option<&Parameter>)> {
        let plain = x.rate.columns.len() - self.parameters.len();
        let parameters = std::iter::repeat_n(None, plain).chain(self.parameters.iter().map(Some));
        x.columns().zip(parameters)
    }

    /// Acceleration by a wrench on the body at rest: F/m and R I⁻¹ Rᵀ M.
    fn acceleration_by(&self, x: &RigidBodyState, wrench: &Twist) -> Twist {
        let still = Twist::default();
        world_acceleration_variation(&self.system.body, x, &still, &still, &Tangent::default(), wrench)
    }

    fn wrench(&self, mode: &Vec<bool>, t: f64, x: &VariedState) -> Twist {
        let mut wrench = Twist::default();
        self.system.wrenches_in(mode, t, &x.base(), &mut wrench);
        wrench
    }
}

impl<F: ForceModel> System for Variational<'_, F> {
    type Configuration = Varied<Pose, Twist>;
    type Workspace = ();
    fn workspace(&self) {}

    fn velocity(&self, x: &VariedState, out: &mut Varied<Twist>) {
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
    type Mode = Vec<bool>;
    const RESETS: bool = true;

    fn mode(&self, t: f64, x: &VariedState) -> Vec<bool> {
        self.system.mode(t, &x.base())
    }

    fn next_mode(&self, before: &Vec<bool>, t: f64, x: &VariedState) -> Vec<bool> {
        self.system.next_mode(before, t, &x.base())
    }

    fn event_kind(
        &self,
        guard: usize,
        before: &Guard,
        after: &Guard,
        modes: (&Vec<bool>, &Vec<bool>),
    ) -> EventKind {
        self.system.event_kind(guard, before, after, modes)
    }

    fn guards(&self, mode: &Vec<bool>, t: f64, x: &VariedState, out: &mut Vec<Guard>) {
        self.system.guards(mode, t, &x.base(), out);
    }

    fn acceleration_in(
        &self,
        mode: &Vec<bool>,
        (): &mut (),
        t: f64,
        x: &VariedState,
        out: &mut Varied<Twist>,
    ) {
        let (base, body, (smooth, contacts)) = (x.base(), &self.system.body, &self.system.forces);
        let wrench = self.wrench(mode, t, x);
        out.base = world_acceleration(body, &base, &wrench);
        for ((column, parameter), change) in self.columns(x).zip(&mut out.columns) {
            let mut sum = smooth.wrench_variation(t, body, &base, &column);
            match parameter {
                Some(Parameter::Mass) => sum = sum + smooth.mass_derivative(t, body, &base),
                Some(Parameter::Force(derivative)) => sum = sum + derivative(t, body, &base),
                _ => {}
            }
            *change = twist(sum);
        }
        for (i, contact) in contacts.iter().enumerate().filter(|(i, _)| mode[*i]) {
            let at = Linearization::new(contact, &base);
            for ((column, parameter), change) in self.columns(x).zip(&mut out.columns) {
                change.axpy(1.0, &at.wrench_change(&column, &law_change(parameter, i)));
            }
        }
        for ((column, parameter), change) in self.columns(x).zip(&mut out.columns) {
            *change = world_acceleration_variation(body, &base, &wrench, &out.base, &column, change);
            match parameter {
                Some(Parameter::Mass) => change.linear -= out.base.linear / body.mass(),
                Some(Parameter::InertiaScale) => {
                    let torque = Twist { angular: wrench.angular, ..Twist::default() };
                    change.axpy(-1.0, &self.acceleration_by(&base, &torque));
                }
                _ => {}
            }
        }
    }

    /// The saltation of the columns, and the derivative of the event's time.
    fn reset(&self, t: f64, before: &Vec<bool>, after: &Vec<bool>, x: &mut VariedState) {
        let base = x.base();
        let acceleration = world_acceleration(&self.system.body, &base, &self.wrench(before, t, x));
        let mut log = self.log.borrow_mut();
        for (i, contact) in self.system.forces.1.iter().enumerate().filter(|(i, _)| before[*i] != after[*i]) {
            let at = Linearization::new(contact, &base);
            let second_rate = at.second_rate(&base, &acceleration);
            let rate = at.margin_rate(second_rate);
            if self.keep_events {
                let time = |(column, parameter)| -at.margin_change(&column, &law_change(parameter, i)) / rate;
                log.event_times.push(self.columns(x).map(time).collect());
            }
            // The force is continuous but at a touch-down with damping.
            if !after[i] || at.guard().rate > 0.0 || contact.law().damping() == 0.0 {
                continue;
            }
            let bound = second_rate.abs() * self.grazing_time;
            if rate.abs() <= bound && log.grazing.is_none() {
                log.grazing = Some(Grazing { t, guard: i, rate, bound });
            }
            if rate != 0.0 {
                let jump = self.acceleration_by(&base, &at.first_wrench());
                for (displacement, change) in x.configuration.columns.iter().zip(&mut x.rate.columns) {
                    change.axpy(at.gap_change(displacement) / rate, &jump);
                }
            }
        }
    }

    fn impulse(&self, guard: usize, h: f64, before: &Guard, after: &Guard) -> f64 {
        self.system.impulse(guard, h, before, after)
    }
}

/// What a parameter changes in the law of contact `i`.
fn law_change(parameter: Option<&Parameter>, i: usize) -> LawChange {
    match parameter {
        Some(&Parameter::Stiffness(contact)) if contact == i => LawChange { stiffness: 1.0, damping: 0.0 },
        Some(&Parameter::Damping(contact)) if contact == i => LawChange { stiffness: 0.0, damping: 1.0 },
        _ => LawChange::default(),
    }
}

fn twist(wrench: Wrench) -> Twist {
    Twist { linear: wrench.force, angular: wrench.torque }
}
