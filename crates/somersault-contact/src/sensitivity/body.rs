//! A body in contact, differentiated.

use super::differentiable::{Collected, Differentiable};
use super::forms::VariedForms;
use super::outcome::{Sensitivities, SensitivityError};
use super::parameter::Parameter;
use crate::contacts::BodyInContact;
use crate::encounters;
use crate::event::EventKind;
use crate::laws::{ContactMode, Encounter};
use crate::linearization::Linearization;
use crate::linearized::{At, Linearized};
use crate::shape::Feature;
use crate::stretches::WithStretches;
use crate::surface::SurfaceFault;
use nalgebra::{Dyn, OMatrix, SMatrix, SVector, U12, Vector3};
use somersault_integrators::augmented::{Augmented, AugmentedRate};
use somersault_integrators::events::{Energy, Event, Guard, Hybrid, Located, Sweep};
use somersault_integrators::force::{ForceModel, Wrench, inertia_scale_derivative};
use somersault_integrators::state::{Pose, Rate, RigidBodyState, State, Twist};
use somersault_integrators::system::{Fault, System, world_acceleration};
use somersault_integrators::variation::{AccelerationDerivative, Tangent};

/// Room for a body linearised in a state.
#[derive(Debug, Default)]
pub struct BodyRoom {
    contacts: Vec<Option<Linearization>>,
    derivative: Option<AccelerationDerivative>,
    wrench: Twist,
    acceleration: Twist,
    tangent: Tangent<Twist>,
    /// The change of the wrench.
    change: Twist,
    /// That of the last lever arm.
    arm: Vector3<f64>,
}

/// The state of the body, without its stretches.
fn state<F: ForceModel>((q, p): At<'_, BodyInContact<F>>) -> RigidBodyState {
    State { configuration: q.0, rate: p.base }
}

/// The run of the body alone.
fn without_stretches(run: Located<Augmented<Pose>, EventKind>) -> Located<Pose, EventKind> {
    let event = |event: Event<Augmented<Pose>, EventKind>| {
        let Event { t, guard, kind, impulse, state } = event;
        Event { t, guard, kind, impulse, state: state.base() }
    };
    Located {
        t: run.t,
        state: run.state.base(),
        status: run.status,
        steps: run.steps,
        rejected: run.rejected,
        trials: run.trials,
        substeps: run.substeps,
        event_count: run.event_count,
        events: run.events.into_iter().map(event).collect(),
    }
}

impl<F: ForceModel> Linearized for BodyInContact<F> {
    type Moved = Pose;
    type Room = BodyRoom;

    fn room(&self) -> BodyRoom {
        BodyRoom::default()
    }

    fn accelerate(
        &self,
        _: &mut BodyRoom,
        mode: &[ContactMode],
        t: f64,
        (q, p): At<'_, Self>,
        out: &mut AugmentedRate<Twist>,
    ) {
        WithStretches(self).wrenches_at(mode, t, q, p, out);
        out.base = world_acceleration(&self.body, &state::<F>((q, p)), &out.base);
    }

    fn linearize(
        &self,
        w: &mut BodyRoom,
        (mode, all): (&[ContactMode], bool),
        t: f64,
        (q, p): At<'_, Self>,
        out: &mut AugmentedRate<Twist>,
    ) {
        let base = state::<F>((q, p));
        WithStretches(self).wrenches_at(mode, t, q, p, out);
        w.wrench = out.base;
        w.acceleration = world_acceleration(&self.body, &base, &w.wrench);
        out.base = w.acceleration;
        w.derivative = Some(AccelerationDerivative::new(&self.body, &base, &w.wrench, &w.acceleration));
        w.contacts.clear();
        w.contacts.extend(self.forces.1.iter().zip(mode).map(|(contact, mode)| {
            (all || !mode.is_open()).then(|| Linearization::new(contact, self.body.mass(), &base))
        }));
    }

    fn met<'w>(&self, w: &'w BodyRoom, contact: usize) -> Option<&'w Encounter> {
        w.contacts.get(contact)?.as_ref().map(|of| &of.at)
    }

    #[inline]
    fn vary(&self, w: &mut BodyRoom, t: f64, x: At<'_, Self>, (displacement, rate): (&Twist, &Twist)) {
        w.tangent = Tangent { displacement: *displacement, rate: *rate };
        let change = self.forces.0.wrench_variation(t, &self.body, &state::<F>(x), &w.tangent);
        w.change = Twist { linear: change.force, angular: change.torque };
    }

    #[inline]
    fn change(&self, w: &mut BodyRoom, contact: usize) -> Encounter {
        match w.contacts.get(contact) {
            Some(Some(of)) => {
                let change = of.along(&self.forces.1[contact], &w.tangent);
                w.arm = change.arm;
                change.at
            }
            Some(None) | None => Encounter::ZERO,
        }
    }

    #[inline]
    fn press(
        &self,
        w: &mut BodyRoom,
        contact: usize,
        (effort, effort_change): (&Wrench, &Wrench),
        _: &Encounter,
    ) {
        if let Some(Some(of)) = w.contacts.get(contact) {
            w.change.axpy(1.0, &of.wrench_change(&w.arm, effort, effort_change));
        }
    }

    #[inline]
    fn acceleration_change(&self, w: &mut BodyRoom, _: At<'_, Self>, out: &mut Twist) {
        if let Some(derivative) = &w.derivative {
            *out = derivative.along(&w.tangent, &w.change);
        }
    }

    fn response(&self, w: &mut BodyRoom, contact: usize, _: At<'_, Self>, effort: &Wrench, out: &mut Twist) {
        let (Some(derivative), Some(Some(of))) = (&w.derivative, w.contacts.get(contact)) else { return };
        *out = derivative.by_wrench(&of.wrench(effort));
    }
}

impl<F: ForceModel> Differentiable for BodyInContact<F> {
    type Forms = VariedForms;
    type Sensitivities = Sensitivities;

    fn tangents(&self, _: &RigidBodyState) -> Vec<Tangent<Twist>> {
        (0..12).map(Tangent::unit).collect()
    }

    fn refuse(&self, parameter: &Parameter) -> Option<SensitivityError> {
        match parameter {
            Parameter::JointForce(_) | Parameter::JointForceAt(..) | Parameter::Tree(_) => {
                Some(SensitivityError::NotOf { found: format!("{parameter:?}"), of: "a body" })
            }
            Parameter::Normal(..)
            | Parameter::Friction(..)
            | Parameter::Mass
            | Parameter::InertiaScale
            | Parameter::Force(_) => None,
        }
    }

    #[inline]
    fn vary_by(&self, w: &mut BodyRoom, t: f64, x: At<'_, Self>, parameter: &Parameter) {
        let (base, body) = (state::<F>(x), &self.body);
        let change = match parameter {
            Parameter::Mass => self.forces.0.mass_derivative(t, body, &base),
            Parameter::InertiaScale => inertia_scale_derivative(&self.forces.0, t, body, &base),
            Parameter::Force(derivative) => derivative(t, body, &base),
            Parameter::Normal(..)
            | Parameter::Friction(..)
            | Parameter::JointForce(_)
            | Parameter::JointForceAt(..)
            | Parameter::Tree(_) => return,
        };
        w.change.axpy(1.0, &Twist { linear: change.force, angular: change.torque });
    }

    #[inline]
    fn add_change_by(&self, w: &mut BodyRoom, parameter: &Parameter, out: &mut Twist) {
        let Some(derivative) = &w.derivative else { return };
        match parameter {
            Parameter::Mass => out.linear -= w.acceleration.linear / self.body.mass(),
            Parameter::InertiaScale => out.angular -= derivative.by_wrench(&w.wrench).angular,
            Parameter::Normal(..)
            | Parameter::Friction(..)
            | Parameter::Force(_)
            | Parameter::JointForce(_)
            | Parameter::JointForceAt(..)
            | Parameter::Tree(_) => {}
        }
    }

    fn each_feature(&self, x: At<'_, Self>, mut see: impl FnMut(usize, Feature)) {
        let x = state::<F>(x);
        for (i, contact) in self.forces.1.iter().enumerate().filter(|(_, contact)| contact.has_features()) {
            see(i, contact.feature(&x));
        }
    }

    fn collect(&self, collected: Collected<Pose>) -> Sensitivities {
        let Collected { run, columns, event_times } = collected;
        let stretches = run.state.rate.variables.clone();
        let columns: Vec<SVector<f64, 12>> = columns.iter().map(Tangent::components).collect();
        Sensitivities {
            run: without_stretches(run),
            state: SMatrix::from_fn(|row, column| columns[column][row]),
            parameters: OMatrix::<f64, U12, Dyn>::from_fn(columns.len() - 12, |row, p| columns[12 + p][row]),
            event_times,
            stretches,
        }
    }

    fn sweeps_between(
        &self,
        mode: &Vec<ContactMode>,
        t: f64,
        h: f64,
        [before, after]: [At<'_, Self>; 2],
        out: &mut Vec<Sweep>,
    ) {
        self.sweeps(mode, t, h, (&state::<F>(before), &state::<F>(after)), out);
    }

    fn clear_time_from(
        &self,
        mode: &Vec<ContactMode>,
        t: f64,
        x: At<'_, Self>,
        guards: &[Guard],
        horizon: f64,
    ) -> f64 {
        self.clear_time(mode, t, &state::<F>(x), guards, horizon)
    }

    fn next_stop_between(&self, t: f64, end: f64) -> Option<f64> {
        self.next_stop(t, end)
    }

    fn examine_in(&self, guard: usize, x: At<'_, Self>) -> Result<(), SurfaceFault> {
        self.examine(guard, &state::<F>(x))
    }

    fn stiffest_rate_in(&self, mode: &Vec<ContactMode>, x: At<'_, Self>) -> f64 {
        self.stiffest_rate(mode, &state::<F>(x))
    }

    fn energy_in(&self, x: At<'_, Self>) -> Option<Energy> {
        let of_body = self.energy(&state::<F>(x))?;
        Some(Energy { springs: encounters::energy(self, x), ..of_body })
    }

    fn fault(&self) -> Option<Fault> {
        self.take_fault()
    }
}
