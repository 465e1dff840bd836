//! The friction of a contact.

use super::coulomb::CoulombFriction;
use super::friction_law::{FrictionInput, FrictionLaw, FrictionResponse};
use std::fmt;
use std::sync::Arc;

/// The friction of a contact: a law, or none.
#[derive(Clone, Default)]
pub struct Friction {
    law: Option<Arc<dyn FrictionLaw>>,
    /// The law itself where it is Coulomb's, the most common one: asked without a call through the object.
    coulomb: Option<CoulombFriction>,
    has_stretch: bool,
}

impl fmt::Debug for Friction {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.law.fmt(f)
    }
}

impl PartialEq for Friction {
    fn eq(&self, other: &Self) -> bool {
        self.law() == other.law()
    }
}

impl<L: FrictionLaw> From<L> for Friction {
    fn from(law: L) -> Self {
        Self::from(Arc::new(law) as Arc<dyn FrictionLaw>)
    }
}

impl From<Arc<dyn FrictionLaw>> for Friction {
    fn from(law: Arc<dyn FrictionLaw>) -> Self {
        let (coulomb, has_stretch) = (law.downcast_ref().copied(), law.spring(0.0).is_some());
        Self { law: Some(law), coulomb, has_stretch }
    }
}

impl Friction {
    /// No friction.
    pub const NONE: Self = Self { law: None, coulomb: None, has_stretch: false };

    /// The law.
    #[inline(always)]
    pub fn law(&self) -> Option<&dyn FrictionLaw> {
        self.law.as_deref()
    }

    /// Whether it has modes, and so a guard.
    pub fn has_modes(&self) -> bool {
        self.law().is_some_and(|law| law.has_modes())
    }

    /// Whether it has a stretch, a part of the state: see [`WithStretches`](crate::stretches::WithStretches).
    #[inline(always)]
    pub fn has_stretch(&self) -> bool {
        self.has_stretch
    }

    /// Force and rate of stretch; zero without friction.
    #[inline(always)]
    pub(super) fn response(&self, by: &FrictionInput<'_>) -> FrictionResponse {
        match (&self.coulomb, &self.law) {
            (Some(law), _) => law.response(by),
            (None, Some(law)) => seen(by, |by| law.response(by)),
            (None, None) => FrictionResponse::default(),
        }
    }

    /// The margin; positive without friction.
    #[inline(always)]
    pub(super) fn margin(&self, by: &FrictionInput<'_>) -> f64 {
        match (&self.coulomb, &self.law) {
            (Some(law), _) => law.margin(by),
            (None, Some(law)) => seen(by, |by| law.margin(by)),
            (None, None) => 1.0,
        }
    }
}

/// Shows a law a copy of what it depends on, so that the original need not be in memory where no object is asked.
#[inline(always)]
fn seen<T>(by: &FrictionInput<'_>, law: impl FnOnce(&FrictionInput<'_>) -> T) -> T {
    let (at, stretch) = (*by.at, *by.stretch);
    law(&FrictionInput { at: &at, stretch: &stretch, ..*by })
}
