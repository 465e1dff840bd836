//! What moves under what, as the arguments of a run name it.

use crate::core::convert::with_shape;
use crate::core::error::Error;
use crate::integrators::forces::models::Reader;
use crate::integrators::located::InContact;
use crate::integrators::plan::Plan;
use crate::integrators::solve::{self, Bodies, Ended};
use crate::integrators::trajectory::Cast;
use pyo3::prelude::*;
use somersault::contact::bodies::BodiesInContact;
use somersault::contact::contacts::BodyInContact;
use somersault::contact::laws::ContactLaw;
use somersault::contact::stretches::{Touching, WithStretches};
use somersault::integrators::counted::Counted;
use somersault::integrators::driver::Observer;
use somersault::integrators::events::Location;
use somersault::integrators::force::BoxedForce;
use somersault::integrators::nalgebra::Vector3;
use somersault::integrators::reversal::TimeReversed;
use somersault::integrators::state::{Pose, RigidBodyState, State};
use somersault::integrators::system::{
    BoxedInteraction, RigidBodiesSystem, RigidBodySystem, RigidSystem, StateOf,
};

/// A body without forces. Counting would hide from the methods that they can skip the forces.
struct Free(RigidBodySystem);

impl Bodies for Free {
    type Configuration = Pose;

    fn solve(&self, initial: &State<Pose>, plan: &Plan, observer: &mut dyn Observer<Pose>) -> Ended<Pose> {
        Ended::without_events(solve::integrate(&self.0, initial, plan, observer))
    }

    fn evaluations(&self, plan: &Plan, tried: u64) -> u64 {
        tried * plan.evaluations_per_step()
    }
}

/// Bodies under forces.
struct Forced<S>(Counted<S>);

impl<S> Bodies for Forced<S>
where
    S: RigidSystem<Configuration: crate::integrators::seen::Seen> + Send + Sync + 'static,
{
    type Configuration = S::Configuration;

    fn solve(
        &self,
        initial: &StateOf<S>,
        plan: &Plan,
        observer: &mut dyn Observer<S::Configuration>,
    ) -> Ended<S::Configuration> {
        Ended::without_events(solve::integrate(&self.0, initial, plan, observer))
    }

    fn evaluations(&self, _: &Plan, _: u64) -> u64 {
        self.0.calls()
    }
}

/// What is done with bodies of whatever kind.
pub(crate) trait Use {
    /// The result.
    type Output;

    /// Does it with bodies and their state at the start; says whether their forces call Python.
    fn with<B: Bodies>(
        self,
        bodies: B,
        initial: State<B::Configuration>,
        calls_python: bool,
    ) -> Result<Self::Output, Error>;
}

/// The stretches of contacts at the start.
pub(crate) enum Stretches<'a, 'py> {
    /// As an argument has them, which may be left out.
    Argument(Option<&'a Bound<'py, PyAny>>),
    /// Those of a state.
    Known(Vec<Vector3<f64>>),
}

/// Bodies, and what acts on them.
pub(crate) struct Problem<'a, 'py> {
    pub(crate) cast: &'a Cast,
    pub(crate) forces: &'a Bound<'py, PyAny>,
    pub(crate) interaction: Option<&'a Bound<'py, PyAny>>,
    pub(crate) contacts: Option<&'a Bound<'py, PyAny>>,
    pub(crate) pairs: Option<&'a Bound<'py, PyAny>>,
    /// Whether events of contacts are located, and how.
    pub(crate) locate: bool,
    pub(crate) location: Location,
    /// Whether time runs backwards.
    pub(crate) backwards: bool,
}

impl Problem<'_, '_> {
    /// Reads what acts, and uses the bodies from their states at t on.
    pub(crate) fn using<U: Use>(
        &self,
        mut reader: Reader,
        t: f64,
        states: &[RigidBodyState],
        stretches: &Stretches<'_, '_>,
        work: U,
    ) -> Result<U::Output, Error> {
        let touches = self.contacts.is_some() || self.pairs.is_some();
        if matches!(stretches, Stretches::Argument(Some(_))) && !(self.locate && touches) {
            return Err(Error::input(
                "`stretches` are those of contacts that are located, and there are none",
            ));
        }
        let state = State::from_bodies;
        match (self.cast.single, touches) {
            (true, _) => self.one(reader, t, &states[0], stretches, work),
            (false, true) => self.several_in_contact(reader, t, state(states), stretches, work),
            (false, false) => {
                let each = reader.for_each("forces", &self.cast.bodies, self.forces)?;
                let mut between = reader.between(self.interaction)?;
                let each = each.into_iter().map(|models| either_way(models, self.backwards)).collect();
                if self.backwards {
                    between = Box::new(TimeReversed(between));
                }
                let system = RigidBodiesSystem::try_new(self.cast.bodies.to_vec(), each, between)?;
                work.with(Forced(Counted::new(system)), state(states), reader.calls_python)
            }
        }
    }

    fn one<U: Use>(
        &self,
        mut reader: Reader,
        t: f64,
        state: &RigidBodyState,
        stretches: &Stretches<'_, '_>,
        work: U,
    ) -> Result<U::Output, Error> {
        if self.interaction.is_some() {
            return Err(Error::input("`interaction` acts between several bodies, and there is one"));
        }
        let body = self.cast.bodies[0];
        let mut models = reader.sum("forces", &body, self.forces)?;
        if self.pairs.is_some() {
            return Err(Error::input("`pairs` touch between several bodies, and there is one"));
        }
        let contacts = self.contacts.map(|contacts| reader.contacts("contacts", contacts)).transpose()?;
        if let Some(contacts) = contacts {
            if self.locate {
                let count = contacts.len();
                let system = WithStretches(BodyInContact::new(body, (Counted::new(models), contacts)));
                let initial = stretched(&system, stretches, t, *state)?;
                let bodies = InContact { system, contacts: count, location: self.location };
                return work.with(bodies, initial, reader.calls_python);
            }
            without_stretch(contacts.iter().map(|contact| contact.law()))?;
            models.push(Box::new(contacts));
        }
        if models.is_empty() {
            work.with(Free(RigidBodySystem::free(body)), *state, reader.calls_python)
        } else {
            let system = RigidBodySystem::new(body, either_way(models, self.backwards));
            work.with(Forced(Counted::new(system)), *state, reader.calls_python)
        }
    }

    fn several_in_contact<U: Use>(
        &self,
        mut reader: Reader,
        t: f64,
        state: State<Vec<Pose>>,
        stretches: &Stretches<'_, '_>,
        work: U,
    ) -> Result<U::Output, Error> {
        let bodies = &self.cast.bodies;
        let each = reader.for_each("forces", bodies, self.forces)?;
        if self.interaction.is_some() {
            return Err(Error::input("`interaction` cannot be given together with `contacts` or `pairs`"));
        }
        let contacts = reader.body_contacts(bodies.len(), self.contacts, self.pairs)?;
        if !self.locate {
            without_stretch(contacts.laws())?;
            let between: BoxedInteraction = Box::new(contacts);
            let system = RigidBodiesSystem::try_new(bodies.to_vec(), each, between)?;
            return work.with(Forced(Counted::new(system)), state, reader.calls_python);
        }
        let count = contacts.len();
        let each = each.into_iter().map(Counted::new).collect();
        let system = WithStretches(BodiesInContact::try_new(bodies.to_vec(), each, contacts)?);
        let initial = stretched(&system, stretches, t, state)?;
        let bodies = InContact { system, contacts: count, location: self.location };
        work.with(bodies, initial, reader.calls_python)
    }
}

/// Forces as they are, or those of reversed time.
fn either_way(models: Vec<BoxedForce>, backwards: bool) -> Vec<BoxedForce> {
    let turned =
        |model: BoxedForce| -> BoxedForce { if backwards { Box::new(TimeReversed(model)) } else { model } };
    models.into_iter().map(turned).collect()
}

/// A state with the stretches requested.
fn stretched<S: Touching>(
    system: &WithStretches<S>,
    stretches: &Stretches<'_, '_>,
    t: f64,
    x: StateOf<S>,
) -> Result<StateOf<WithStretches<S>>, Error> {
    match stretches {
        Stretches::Argument(given) => stretched_as_given(system, *given, t, x),
        Stretches::Known(known) if known.is_empty() => Ok(system.unstretched(x)),
        Stretches::Known(known) => Ok(system.stretched(x, known.clone())?),
    }
}

/// A state with the stretches that an argument asks for.
pub(crate) fn stretched_as_given<S: Touching>(
    system: &WithStretches<S>,
    stretches: Option<&Bound<'_, PyAny>>,
    t: f64,
    x: StateOf<S>,
) -> Result<StateOf<WithStretches<S>>, Error> {
    let Some(given) = stretches else { return Ok(system.unstretched(x)) };
    if given.extract::<&str>().is_ok_and(|word| word == "loaded") {
        return Ok(system.loaded(t, x));
    }
    let count = system.0.laws().count();
    let values = with_shape("stretches", &[count, 3], given)?;
    let stretches = values.chunks_exact(3).map(Vector3::from_column_slice).collect();
    Ok(system.stretched(x, stretches)?)
}

/// Refuses friction with a stretch where forces switch with the state, which has no place for it.
fn without_stretch<'a>(laws: impl IntoIterator<Item = &'a ContactLaw>) -> Result<(), Error> {
    if laws.into_iter().any(|law| law.friction().has_stretch()) {
        return Err(Error::input(
            "`locate` must be true where friction is a CoulombFriction with stiffness: it has a state of its own",
        ));
    }
    Ok(())
}
