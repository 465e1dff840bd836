//! What moves in contact and can be differentiated.

use super::outcome::SensitivityError;
use super::parameter::Parameter;
use crate::event::EventKind;
use crate::laws::ContactMode;
use crate::linearized::{At, Linearized, Rate};
use crate::shape::Feature;
use crate::surface::SurfaceFault;
use nalgebra::DMatrix;
use somersault_integrators::augmented::{Augmented, AugmentedRate};
use somersault_integrators::events::{Energy, Guard, Located, Sweep};
use somersault_integrators::state::{Configuration, State};
use somersault_integrators::system::Fault;
use somersault_integrators::variation::{Tangent, Varied};

/// What a system moves, with columns, and stretches beside both their rates.
pub type VariedOf<S> = Varied<
    Augmented<<S as Linearized>::Moved>,
    AugmentedRate<<<S as Linearized>::Moved as Configuration>::Rate>,
>;

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

/// Something in contact whose motion can be differentiated: it is [linearised](Linearized) along tangents and along parameters.
///
/// A [`BodyInContact`](crate::contacts::BodyInContact) and a [`TreeInContact`](crate::tree::TreeInContact) are.
#[expect(clippy::ptr_arg, reason = "a mode of `Hybrid` is a vector")]
pub trait Differentiable: Linearized {
    /// The forms in which methods see it with its columns.
    type Forms;
    /// What a run leaves.
    type Sensitivities;

    /// The tangents of the components of an initial state.
    fn tangents(&self, x: &State<Self::Moved>) -> Vec<Tangent<Rate<Self>>>;

    /// Why it has no derivative at all, if it has none.
    fn without_derivative(&self) -> Option<SensitivityError> {
        None
    }

    /// Why it has no derivative with respect to a parameter that is not one of the laws of a contact, if it has none.
    fn refuse(&self, parameter: &Parameter) -> Option<SensitivityError>;

    /// Goes along a parameter besides, after [`vary`](Linearized::vary).
    fn vary_by(&self, w: &mut Self::Room, t: f64, x: At<'_, Self>, parameter: &Parameter);

    /// Adds what a parameter changes of the accelerations besides, after
    /// [`acceleration_change`](Linearized::acceleration_change).
    fn add_change_by(&self, w: &mut Self::Room, parameter: &Parameter, out: &mut Rate<Self>);

    /// Shows the numbers of the contacts of capsules and boxes, and which of their parts are nearest.
    fn each_feature(&self, x: At<'_, Self>, see: impl FnMut(usize, Feature));

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

    /// As [`System::next_stop`](somersault_integrators::system::System::next_stop).
    fn next_stop_between(&self, t: f64, end: f64) -> Option<f64>;

    /// As [`Hybrid::examine`](somersault_integrators::events::Hybrid::examine).
    fn examine_in(&self, guard: usize, x: At<'_, Self>) -> Result<(), SurfaceFault>;

    /// As [`Hybrid::stiffest_rate`](somersault_integrators::events::Hybrid::stiffest_rate).
    fn stiffest_rate_in(&self, mode: &Vec<ContactMode>, x: At<'_, Self>) -> f64;

    /// As [`Hybrid::energy`](somersault_integrators::events::Hybrid::energy), with the springs of friction.
    fn energy_in(&self, x: At<'_, Self>) -> Option<Energy>;

    /// Why the equations had no value, if they had none.
    fn fault(&self) -> Option<Fault>;
}
