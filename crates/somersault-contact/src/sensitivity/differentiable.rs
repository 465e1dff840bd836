//! What moves in contact and can be differentiated.

use super::outcome::SensitivityError;
use super::parameter::Parameter;
use crate::encounters::Encounters;
use crate::event::EventKind;
use crate::laws::{ContactMode, Encounter};
use crate::surface::SurfaceFault;
use nalgebra::DMatrix;
use somersault_integrators::augmented::{Augmented, AugmentedRate};
use somersault_integrators::events::{Energy, Guard, Located, Sweep};
use somersault_integrators::force::Wrench;
use somersault_integrators::state::{Configuration, State};
use somersault_integrators::system::Fault;
use somersault_integrators::variation::{Tangent, Varied};
use std::fmt::Debug;

/// The configuration that a system moves on.
pub(super) type Moved<S> = <S as Differentiable>::Moved;
/// The rate of what a system moves.
pub(super) type Rate<S> = <Moved<S> as Configuration>::Rate;
/// Configuration and rate with stretches.
pub(super) type At<'a, S> = (&'a Augmented<Moved<S>>, &'a AugmentedRate<Rate<S>>);
/// What a system moves, with columns, and stretches beside both their rates.
pub type VariedOf<S> =
    Varied<Augmented<<S as Differentiable>::Moved>, AugmentedRate<<Moved<S> as Configuration>::Rate>>;

/// What a differentiated run leaves, the columns one after the other.
#[derive(Debug, Clone)]
pub struct Collected<Q: Configuration> {
    /// The run, with the stretches of its contacts.
    pub run: Located<Augmented<Q>, EventKind>,
    /// The columns at its end.
    pub columns: Vec<Tangent<Q::Rate>>,
    /// Derivatives of the times of its events, one row for each.
    pub event_times: DMatrix<f64>,
}

/// Something in contact whose motion can be differentiated: its equations and its contacts in a state, and their changes along
/// a tangent.
///
/// [`SensitivityRun`](super::SensitivityRun) asks in this order: [`linearize`](Self::linearize), then for each column
/// [`vary`](Self::vary), of each contact [`change`](Self::change) and [`press`](Self::press), and
/// [`acceleration_change`](Self::acceleration_change). A
/// [`BodyInContact`](crate::contacts::BodyInContact) and a [`TreeInContact`](crate::tree::TreeInContact) are.
#[expect(clippy::ptr_arg, reason = "a mode of `Hybrid` is a vector")]
pub trait Differentiable: Encounters<<Self as Differentiable>::Moved> {
    /// What moves.
    type Moved: Configuration;
    /// The forms in which methods see it with its columns.
    type Forms;
    /// Room for what is linearised.
    type Workspace: Debug;
    /// What a run leaves.
    type Sensitivities;

    /// Room.
    fn room(&self) -> Self::Workspace;

    /// The tangents of the components of an initial state.
    fn tangents(&self, x: &State<Self::Moved>) -> Vec<Tangent<Rate<Self>>>;

    /// Why it has no derivative with respect to a parameter that is not one of the laws of a contact, if it has none.
    fn refuse(&self, parameter: &Parameter) -> Option<SensitivityError>;

    /// out ← accelerations and rates of stretches in a mode; linearises them, the closed contacts, and where `all` are wanted
    /// the open ones.
    fn linearize(
        &self,
        w: &mut Self::Workspace,
        mode: (&[ContactMode], bool),
        t: f64,
        x: At<'_, Self>,
        out: &mut AugmentedRate<Rate<Self>>,
    );

    /// The encounter of a contact, if it was linearised.
    fn met<'w>(&self, w: &'w Self::Workspace, contact: usize) -> Option<&'w Encounter>;

    /// Goes along a tangent, and along a parameter.
    fn vary(
        &self,
        w: &mut Self::Workspace,
        t: f64,
        x: At<'_, Self>,
        tangent: (&Rate<Self>, &Rate<Self>),
        parameter: Option<&Parameter>,
    );

    /// The change of the encounter of a contact; zero where it was not linearised.
    fn change(&self, w: &mut Self::Workspace, contact: usize) -> Encounter;

    /// Adds the change of an effort at a contact, after its [`change`](Self::change).
    fn press(&self, w: &mut Self::Workspace, contact: usize, effort: (&Wrench, &Wrench), change: &Encounter);

    /// out ← the change of the accelerations along the tangent and the parameter.
    fn acceleration_change(
        &self,
        w: &mut Self::Workspace,
        x: At<'_, Self>,
        parameter: Option<&Parameter>,
        out: &mut Rate<Self>,
    );

    /// out ← the change of the accelerations by an effort at a contact alone.
    fn response(
        &self,
        w: &mut Self::Workspace,
        contact: usize,
        x: At<'_, Self>,
        effort: &Wrench,
        out: &mut Rate<Self>,
    );

    /// What is left of a run.
    fn collect(&self, collected: Collected<Self::Moved>) -> Self::Sensitivities;

    /// As [`Hybrid::sweeps`](somersault_integrators::events::Hybrid::sweeps).
    fn sweeps_between(
        &self,
        mode: &Vec<ContactMode>,
        t: f64,
        h: f64,
        ends: [At<'_, Self>; 2],
        out: &mut Vec<Sweep>,
    );

    /// As [`Hybrid::clear_time`](somersault_integrators::events::Hybrid::clear_time).
    fn clear_time_from(
        &self,
        mode: &Vec<ContactMode>,
        t: f64,
        x: At<'_, Self>,
        guards: &[Guard],
        horizon: f64,
    ) -> f64;

    /// As [`Hybrid::examine`](somersault_integrators::events::Hybrid::examine).
    fn examine_in(&self, guard: usize, x: At<'_, Self>) -> Result<(), SurfaceFault>;

    /// As [`Hybrid::stiffest_rate`](somersault_integrators::events::Hybrid::stiffest_rate).
    fn stiffest_rate_in(&self, mode: &Vec<ContactMode>, x: At<'_, Self>) -> f64;

    /// As [`Hybrid::energy`](somersault_integrators::events::Hybrid::energy), with the springs of friction.
    fn energy_in(&self, x: At<'_, Self>) -> Option<Energy>;

    /// Why the equations had no value, if they had none.
    fn fault(&self) -> Option<Fault>;
}
