//! What happens in contacts during a run.

use crate::core::convert::{a_type, entries};
use crate::core::error::Error;
use crate::core::value::value;
use crate::integrators::bodies::State;
use crate::integrators::seen::Seen;
use pyo3::prelude::*;
use somersault::contact::event::EventKind;
use somersault::integrators::events;

/// The events of a run, and what it took to find them.
pub(crate) struct Events<Q: Seen> {
    /// Steps tried.
    pub(crate) trials: u64,
    /// Steps that were parts of longer ones.
    pub(crate) substeps: u64,
    /// How many there were.
    pub(crate) count: u64,
    /// How many contacts there are; the guards of their friction follow theirs.
    pub(crate) contacts: usize,
    /// Those kept.
    pub(crate) events: Vec<events::Event<Q, EventKind>>,
}

impl<Q: Seen> Events<Q> {
    /// Of a run that looks for none.
    pub(crate) fn none() -> Self {
        Self { trials: 0, substeps: 0, count: 0, contacts: 0, events: Vec::new() }
    }
}

/// A change in a contact: its beginning, its end, the change between sticking and sliding.
///
/// Examples
/// --------
/// >>> import somersault
/// >>> from somersault import contact
/// >>> ball = contact.bouncing_ball(1.0, 0.1, contact.CompliantLaw(1e4), height=0.2)
/// >>> motion = somersault.integrate(
/// ...     ball.body, ball.state, (0.0, 0.3), dt=0.01, forces=ball.forces, contacts=ball.contacts)
/// >>> touch = motion.events[0]
/// >>> touch.kind, round(touch.t, 4), touch.state.velocity.round(3)
/// ('touch_down', 0.2019, array([ 0.   ,  0.   , -1.981]))
#[pyclass(frozen, module = "somersault.contact")]
pub(crate) struct Event {
    t: f64,
    contact: usize,
    kind: String,
    impulse: f64,
    state: Py<PyAny>,
}

impl Event {
    pub(crate) fn of<Q: Seen>(
        py: Python<'_>,
        contacts: usize,
        event: &events::Event<Q, EventKind>,
    ) -> PyResult<Self> {
        let state = Q::to_python(py, &event.state)?.unbind();
        Ok(Self::new_at(event.t, (contacts, event.guard), event.kind, event.impulse, state))
    }

    /// The change of a guard where there are so many contacts.
    pub(crate) fn new_at(
        t: f64,
        (contacts, guard): (usize, usize),
        kind: EventKind,
        impulse: f64,
        state: Py<PyAny>,
    ) -> Self {
        Self { t, contact: guard % contacts.max(1), kind: kind.name().to_owned(), impulse, state }
    }
}

value! {
    impl Event(t, contact, kind, impulse, state) {
        /// float: When, s.
        t: f64 = |own| own.t;
        /// int: Which contact, by its place among those given; pairs of spheres follow those with surfaces.
        contact: usize = |own| own.contact;
        /// str: What happened: ``'touch_down'``, ``'release'``, ``'re_engagement'``, where a point that was
        /// released below the surface is held again, ``'stick'`` or ``'slip'``.
        kind: &str = |own| &own.kind;
        /// float: Impulse that a release completes, ∫ F dt, N s, to order 4; 0 for the others.
        impulse: f64 = |own| own.impulse;
        /// State or list of State: The state.
        state: Py<PyAny> = |own, py| own.state.clone_ref(py);
    }
}

#[pymethods]
impl Event {
    #[new]
    fn new(
        t: f64,
        contact: usize,
        kind: &str,
        impulse: f64,
        state: &Bound<'_, PyAny>,
    ) -> Result<Self, Error> {
        let is_one = state.is_instance_of::<State>();
        if !is_one && entries::<State>(state).is_err() {
            let found = a_type(state);
            return Err(Error::input(format!("`state` must be a State or a list of them, found {found}")));
        }
        Ok(Self { t, contact, kind: kind.to_owned(), impulse, state: state.clone().unbind() })
    }

    fn __repr__(&self) -> String {
        format!("<Event: {} of contact {} at t = {}>", self.kind, self.contact, self.t)
    }
}
