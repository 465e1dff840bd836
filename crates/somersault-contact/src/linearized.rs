//! What moves in contact, linearised in a state: how its accelerations and stretches change along a tangent.
//!
//! ```text
//! δv̇ = ∂v̇/∂q δq + ∂v̇/∂v δv + M⁻¹ (δτ + Σ Jᵢᵀ δFᵢ),   δξ̇ᵢ = …
//! ```
//! Variational equations and the iterations of implicit methods are made of these changes.

use crate::encounters::Encounters;
use crate::laws::{ContactChange, ContactMode, Encounter, LawParameter};
use nalgebra::Vector3;
use somersault_integrators::augmented::{Augmented, AugmentedRate};
use somersault_integrators::force::Wrench;
use somersault_integrators::state::Configuration;
use std::fmt::Debug;

/// The rate of what a system moves.
pub(crate) type Rate<S> = <<S as Linearized>::Moved as Configuration>::Rate;
/// Configuration and rate with stretches.
pub(crate) type At<'a, S> = (&'a Augmented<<S as Linearized>::Moved>, &'a AugmentedRate<Rate<S>>);

/// Something in contact that can be linearised: its equations and its contacts in a state, and their changes along a tangent.
///
/// It is asked in this order: [`linearize`](Self::linearize), then for each tangent [`vary`](Self::vary), of each contact
/// [`change`](Self::change) and [`press`](Self::press), and [`acceleration_change`](Self::acceleration_change).
pub trait Linearized: Encounters<<Self as Linearized>::Moved> {
    /// What moves.
    type Moved: Configuration;
    /// Room for what is linearised.
    type Room: Debug;

    /// Room.
    fn room(&self) -> Self::Room;

    /// out ← accelerations and rates of stretches in a mode.
    fn accelerate(
        &self,
        w: &mut Self::Room,
        mode: &[ContactMode],
        t: f64,
        x: At<'_, Self>,
        out: &mut AugmentedRate<Rate<Self>>,
    );

    /// out ← accelerations and rates of stretches in a mode; linearises them, the closed contacts, and where `all` are wanted
    /// the open ones.
    fn linearize(
        &self,
        w: &mut Self::Room,
        mode: (&[ContactMode], bool),
        t: f64,
        x: At<'_, Self>,
        out: &mut AugmentedRate<Rate<Self>>,
    );

    /// The encounter of a contact, if it was linearised.
    fn met<'w>(&self, w: &'w Self::Room, contact: usize) -> Option<&'w Encounter>;

    /// Goes along a tangent.
    fn vary(&self, w: &mut Self::Room, t: f64, x: At<'_, Self>, tangent: (&Rate<Self>, &Rate<Self>));

    /// The change of the encounter of a contact; zero where it was not linearised.
    fn change(&self, w: &mut Self::Room, contact: usize) -> Encounter;

    /// Adds the change of an effort at a contact, after its [`change`](Self::change).
    fn press(&self, w: &mut Self::Room, contact: usize, effort: (&Wrench, &Wrench), change: &Encounter);

    /// out ← the change of the accelerations along the tangent, with what was added.
    fn acceleration_change(&self, w: &mut Self::Room, x: At<'_, Self>, out: &mut Rate<Self>);

    /// out ← the change of the accelerations by an effort at a contact alone.
    fn response(
        &self,
        w: &mut Self::Room,
        contact: usize,
        x: At<'_, Self>,
        effort: &Wrench,
        out: &mut Rate<Self>,
    );
}

/// Room for the equations of a system linearised in a state: that of the system, and the efforts of its contacts.
#[derive(Debug)]
pub struct LinearizedRoom<W> {
    pub(crate) system: W,
    pub(crate) efforts: Vec<Wrench>,
}

impl<W> LinearizedRoom<W> {
    /// With the room of a system.
    pub(crate) fn new(system: W) -> Self {
        Self { system, efforts: Vec::new() }
    }

    /// out ← accelerations and rates of stretches in a mode; linearises them.
    pub(crate) fn linearize<S: Linearized<Room = W>>(
        &mut self,
        system: &S,
        mode: &[ContactMode],
        t: f64,
        x: At<'_, S>,
        out: &mut AugmentedRate<Rate<S>>,
    ) {
        let Self { system: w, efforts } = self;
        system.linearize(w, (mode, false), t, x, out);
        efforts.clear();
        efforts.extend(system.laws().zip(mode).enumerate().map(|(i, (law, mode))| {
            system.met(w, i).map_or_else(Wrench::default, |at| law.effort_in(mode, at, &x.1.variables[i]))
        }));
    }

    /// Goes along a tangent and what is beside it, and for each contact along a parameter of its laws: the efforts change, and
    /// stretching ← the changes of the rates of stretches. [`Linearized::acceleration_change`] is then that of all.
    pub(crate) fn vary<S: Linearized<Room = W>>(
        &mut self,
        system: &S,
        mode: &[ContactMode],
        t: f64,
        x: At<'_, S>,
        (displacement, change): (&Rate<S>, &AugmentedRate<Rate<S>>),
        beside: impl FnOnce(&mut W),
        parameter: impl Fn(usize) -> Option<LawParameter>,
        stretching: &mut [Vector3<f64>],
    ) {
        let Self { system: w, efforts } = self;
        system.vary(w, t, x, (displacement, &change.base));
        beside(w);
        stretching.fill(Vector3::zeros());
        for (i, (law, mode)) in system.laws().zip(mode).enumerate() {
            let Some(at) = system.met(w, i).copied() else { continue };
            let moved = system.change(w, i);
            let along = ContactChange { at: &moved, stretch: &change.variables[i], parameter: parameter(i) };
            let (effort_change, stretch_rate) = law.derivative_in(mode, &at, &x.1.variables[i], &along);
            system.press(w, i, (&efforts[i], &effort_change), &moved);
            stretching[i] = stretch_rate;
        }
    }
}
