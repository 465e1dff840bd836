//! What the events of contacts are called.

use somersault_integrators::events::Guard;

/// What happens to a contact at an event.
///
/// The guards of the contacts themselves come first and have the index of the contact; see
/// [`Contacts`](crate::contacts::Contacts) for those of friction.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum EventKind {
    /// A guard goes in at its surface: a point comes to touch.
    TouchDown,
    /// A guard comes out: the force of a contact has returned to zero.
    Release,
    /// A guard goes in while its gap grows: a point that was released below the surface is held again.
    ReEngagement,
    /// A contact that slid begins to stick.
    Stick,
    /// A contact that stuck begins to slide.
    Slip,
}

impl EventKind {
    /// Its name in files and in Python: `touch_down`, `release`, `re_engagement`, `stick` or `slip`.
    pub fn name(self) -> &'static str {
        match self {
            Self::TouchDown => "touch_down",
            Self::Release => "release",
            Self::ReEngagement => "re_engagement",
            Self::Stick => "stick",
            Self::Slip => "slip",
        }
    }

    /// What the change of a guard is called, where the guards of `contacts` contacts are followed by those of
    /// their friction.
    pub fn of_guard(contacts: usize, guard: usize, before: &Guard, after: &Guard) -> Self {
        match (guard < contacts, before.is_inside()) {
            (true, true) => Self::Release,
            (true, false) if after.rate > 0.0 => Self::ReEngagement,
            (true, false) => Self::TouchDown,
            (false, true) => Self::Stick,
            (false, false) => Self::Slip,
        }
    }
}
