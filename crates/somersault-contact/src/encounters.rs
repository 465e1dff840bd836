//! Contacts of something that moves, seen one by one, and what follows from that alone: modes, guards, energies, stretches.
//!
//! Bodies and trees differ in where their contacts are and in what forces do to them. All else about contacts is here.

use crate::error::ContactError;
use crate::laws::{ContactLaw, ContactMode, Encounter};
use nalgebra::Vector3;
use somersault_integrators::augmented::{Augmented, AugmentedRate};
use somersault_integrators::events::Guard;
use somersault_integrators::state::{Configuration, State};

/// Something that moves on `Q`, and its contacts.
pub trait Encounters<Q: Configuration> {
    /// The laws of the contacts, in their order.
    fn laws(&self) -> impl Iterator<Item = &ContactLaw>;

    /// Shows each contact's number, law and encounter.
    fn each_encounter(&self, q: &Q, p: &Q::Rate, see: impl FnMut(usize, &ContactLaw, &Encounter));
}

impl<Q: Configuration, E: Encounters<Q>> Encounters<Q> for &E {
    fn laws(&self) -> impl Iterator<Item = &ContactLaw> {
        (**self).laws()
    }
    fn each_encounter(&self, q: &Q, p: &Q::Rate, see: impl FnMut(usize, &ContactLaw, &Encounter)) {
        (**self).each_encounter(q, p, see);
    }
}

/// What a contact does in a state.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ContactState {
    /// The number of the contact.
    pub contact: usize,
    /// What it does.
    pub mode: ContactMode,
    /// Gap, negative inside, m.
    pub gap: f64,
    /// Its rate, m/s.
    pub rate: f64,
    /// The point of contact, world frame, m.
    pub point: Vector3<f64>,
    /// Unit normal, along which the body, or the first of two, is pushed.
    pub normal: Vector3<f64>,
    /// Velocity of the body relative to the surface, or to the second body, without its part along the normal, m/s.
    pub sliding: Vector3<f64>,
    /// Stretch of its friction, m.
    pub stretch: Vector3<f64>,
    /// Force on the body, or on the first of two, N; zero of an open contact.
    pub force: Vector3<f64>,
    /// Couple on it by resistance to rolling and spinning, N m.
    pub couple: Vector3<f64>,
}

/// A configuration and its rate with stretches beside it.
pub(crate) type Stretched<'a, Q> = (&'a Augmented<Q>, &'a AugmentedRate<<Q as Configuration>::Rate>);

/// Calls with each contact's number, law, encounter and stretch.
#[inline]
pub(crate) fn each<Q: Configuration>(
    contacts: &impl Encounters<Q>,
    (q, p): Stretched<'_, Q>,
    mut see: impl FnMut(usize, &ContactLaw, &Encounter, &Vector3<f64>),
) {
    contacts.each_encounter(&q.0, &p.base, |i, law, at| see(i, law, at, &p.variables[i]));
}

/// A state with unstretched contacts.
pub(crate) fn unstretched<Q: Configuration>(
    contacts: &impl Encounters<Q>,
    x: State<Q>,
) -> State<Augmented<Q>> {
    State::augmented(x, vec![Vector3::zeros(); contacts.laws().count()])
}

/// A state with given stretches, m, of which the part in the plane of contact counts; none of open contacts.
pub(crate) fn stretched<Q: Configuration>(
    of: &impl Encounters<Q>,
    x: State<Q>,
    stretches: Vec<Vector3<f64>>,
) -> Result<State<Augmented<Q>>, ContactError> {
    let contacts = of.laws().count();
    let finite = stretches.iter().flatten().all(|component| component.is_finite());
    if stretches.len() != contacts || !finite {
        let found = if finite { format!("{}", stretches.len()) } else { format!("{stretches:?}") };
        return Err(ContactError::Stretches { found, contacts });
    }
    let mut state = State::augmented(x, stretches);
    let State { configuration, rate } = &mut state;
    of.each_encounter(&configuration.0, &rate.base, |i, law, at| {
        let stretch = &mut rate.variables[i];
        *stretch = if law.guard(at).is_inside() && law.friction().has_stretch() {
            *stretch - at.normal * at.normal.dot(stretch)
        } else {
            Vector3::zeros()
        };
    });
    Ok(state)
}

/// Energy of the springs of contacts and friction, J.
pub(crate) fn energy<Q: Configuration>(contacts: &impl Encounters<Q>, x: Stretched<'_, Q>) -> f64 {
    let mut sum = 0.0;
    each(contacts, x, |_, law, at, stretch| sum += law.energy(at.gap, stretch));
    sum
}

/// What every contact does in a state, each in the mode that the state has it in.
pub(crate) fn contact_states<Q: Configuration>(
    contacts: &impl Encounters<Q>,
    x: Stretched<'_, Q>,
) -> Vec<ContactState> {
    let mut states = Vec::with_capacity(x.1.variables.len());
    each(contacts, x, |contact, law, at, stretch| {
        let mode = law.mode(at, stretch);
        let effort = law.effort_in(&mode, at, stretch);
        states.push(ContactState {
            contact,
            mode,
            gap: at.gap,
            rate: at.rate,
            point: at.point,
            normal: at.normal,
            sliding: at.sliding,
            stretch: *stretch,
            force: effort.force,
            couple: effort.torque,
        });
    });
    states
}

/// The modes that a state belongs to.
pub(crate) fn modes<Q: Configuration>(
    contacts: &impl Encounters<Q>,
    x: Stretched<'_, Q>,
) -> Vec<ContactMode> {
    let mut modes = Vec::with_capacity(x.1.variables.len());
    each(contacts, x, |_, law, at, stretch| modes.push(law.mode(at, stretch)));
    modes
}

/// The modes after an event.
pub(crate) fn next_modes<Q: Configuration>(
    contacts: &impl Encounters<Q>,
    before: &[ContactMode],
    x: Stretched<'_, Q>,
) -> Vec<ContactMode> {
    let mut modes = Vec::with_capacity(before.len());
    each(contacts, x, |i, law, at, stretch| modes.push(law.next_mode(&before[i], at, stretch)));
    modes
}

/// Writes the guards of the contacts, and those of their friction.
#[inline]
pub(crate) fn guards<Q: Configuration>(
    contacts: &impl Encounters<Q>,
    modes: &[ContactMode],
    x: Stretched<'_, Q>,
    out: &mut Vec<Guard>,
) {
    let n = modes.len();
    out.resize(2 * n, Guard::default());
    each(contacts, x, |i, law, at, stretch| {
        out[i] = law.guard(at);
        out[n + i] = law.friction_guard(&modes[i], at, stretch);
    });
}

/// Contacts begin and end without stretch.
pub(crate) fn reset(before: &[ContactMode], after: &[ContactMode], stretches: &mut [Vector3<f64>]) {
    for (stretch, modes) in stretches.iter_mut().zip(before.iter().zip(after)) {
        if matches!(modes, (ContactMode::Open, _) | (_, ContactMode::Open)) {
            *stretch = Vector3::zeros();
        }
    }
}
