//! Runs backwards in time.
//!
//! With s = −t, the configuration as it is and the velocity reversed, v′ = dq/ds = −v, the equations q̇ = v, v̇ = a(t, q, v) become
//! dv′/ds = a(−s, q, −v′). Those of rigid bodies are their own but for the forces, as a product of two angular velocities keeps its
//! sign: bodies under [`TimeReversed`] forces move backwards along their motion, and so does any other [`TimeReversed`] system. Any method
//! integrates them, with the steps that it would make backwards, and [`Backwards`] shows these to an observer with decreasing times.
//!
//! ```
//! use somersault_integrators::driver::TimeGrid;
//! use somersault_integrators::reversal::{Backwards, TimeReversed, reversed};
//! use somersault_integrators::{body::RigidBody, force::Drag, methods::Method, nalgebra::Vector3, run::Run};
//! use somersault_integrators::{solution::Recorder, state::RigidBodyState, system::RigidBodySystem};
//!
//! let (body, drag) = (RigidBody::try_box(1.0, Vector3::new(0.2, 0.4, 0.6))?, Drag { linear: 0.3, quadratic: 0.0, angular: 0.02 });
//! let system = RigidBodySystem::new(body, drag);
//! let start = RigidBodyState::spinning(Vector3::new(0.1, 8.0, 0.0));
//! let end = Run::new(&system, Method::Rkmk8, TimeGrid::try_new(0.0, 1.0, 0.01)?).from(&start)?;
//!
//! let mut recorder = Recorder::new(1.0, &end.state, 1);
//! let grid = TimeGrid::try_new(-1.0, 0.0, 0.01)?;
//! let back = RigidBodySystem::new(body, TimeReversed(drag));
//! let mut observer = Backwards(&mut recorder);
//! Run::new(&back, Method::Rkmk8, grid).observed_by(&mut observer).from(&reversed(&end.state))?;
//! let motion = recorder.into_solution();
//! assert_eq!(motion.times.last(), Some(&0.0));
//! assert!((motion.states[100].angular_velocity() - start.angular_velocity()).norm() < 1e-9);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

use crate::body::RigidBody;
use crate::dense::Interpolant;
use crate::driver::{Flow, Observer, Step};
use crate::engine::Interior;
use crate::error::IntegrateError;
use crate::force::{ForceModel, Reach, StatesInLanes, Wrench, WrenchBound, WrenchesInLanes, add_one_by_one};
use crate::partials::Partials;
use crate::series::WrenchTerm;
use crate::state::{Configuration, Pose, Rate, RigidBodyState, State, Twist};
use crate::system::{Fault, Interaction, OneForm, RateOf, StateOf, System};
use crate::variation::{Tangent, central_difference};

/// A state with its rates reversed.
pub fn reversed<Q: Configuration>(x: &State<Q>) -> State<Q> {
    let mut turned = x.clone();
    // Zero stays zero, and is not made −0.
    turned.rate.set_zero();
    turned.rate.axpy(-1.0, &x.rate);
    turned
}

/// Forces on bodies, or a system, for which time runs backwards, in s = −t and with reversed rates: those of the state that is meant.
#[derive(Debug, Clone, Copy)]
pub struct TimeReversed<F>(pub F);

#[deny(clippy::missing_trait_methods)]
impl<F: ForceModel> ForceModel for TimeReversed<F> {
    fn wrench(&self, s: f64, body: &RigidBody, x: &RigidBodyState) -> Wrench {
        self.0.wrench(-s, body, &reversed(x))
    }
    fn is_free(&self) -> bool {
        self.0.is_free()
    }
    fn is_torque_free(&self) -> bool {
        self.0.is_torque_free()
    }
    fn depends_on_velocity(&self) -> bool {
        self.0.depends_on_velocity()
    }
    fn add_terms(&self, body: &RigidBody, terms: &mut Vec<WrenchTerm>) -> bool {
        let before = terms.len();
        let has_terms = self.0.add_terms(body, terms);
        terms[before..].iter_mut().for_each(|term| *term = term.reversed());
        has_terms
    }
    fn add_in_lanes(&self, on: &StatesInLanes<'_>, sums: &mut WrenchesInLanes) {
        add_one_by_one(self, on, sums);
    }
    fn next_stop(&self, s: f64, end: f64) -> Option<f64> {
        self.0.next_stop(-s, -end).map(|t| -t)
    }
    fn wrench_variation(
        &self,
        s: f64,
        body: &RigidBody,
        x: &RigidBodyState,
        along: &Tangent<Twist>,
    ) -> Wrench {
        central_difference(x, along, |moved| self.wrench(s, body, moved))
    }
    fn mass_derivative(&self, s: f64, body: &RigidBody, x: &RigidBodyState) -> Wrench {
        self.0.mass_derivative(-s, body, &reversed(x))
    }
    fn bound(&self, body: &RigidBody, reach: &Reach) -> Option<WrenchBound> {
        self.0.bound(body, reach)
    }
    /// None is known: what dissipates drives the body backwards.
    fn potential(&self, _: &RigidBody, _: &RigidBodyState) -> Option<f64> {
        None
    }
}

#[deny(clippy::missing_trait_methods)]
impl<I: Interaction> Interaction for TimeReversed<I> {
    fn add_wrenches(&self, s: f64, bodies: &[RigidBody], x: &State<Vec<Pose>>, out: &mut [Twist]) {
        self.0.add_wrenches(-s, bodies, &reversed(x), out);
    }
    fn is_none(&self) -> bool {
        self.0.is_none()
    }
    fn bodies(&self) -> Option<usize> {
        self.0.bodies()
    }
    fn is_torque_free(&self) -> bool {
        self.0.is_torque_free()
    }
    fn depends_on_velocity(&self) -> bool {
        self.0.depends_on_velocity()
    }
}

#[deny(clippy::missing_trait_methods)]
impl<S: System<Forms = OneForm>> System for TimeReversed<S> {
    type Configuration = S::Configuration;
    type Forms = OneForm;
    type Workspace = S::Workspace;
    const IS_WATCHED: bool = S::IS_WATCHED;
    fn workspace(&self) -> S::Workspace {
        self.0.workspace()
    }
    fn velocity(&self, w: &mut S::Workspace, s: f64, x: &StateOf<S>, out: &mut RateOf<S>) {
        let mut ahead = x.rate.clone();
        self.0.velocity(w, -s, &reversed(x), &mut ahead);
        out.set_zero();
        out.axpy(-1.0, &ahead);
    }
    fn acceleration(&self, w: &mut S::Workspace, s: f64, x: &StateOf<S>, out: &mut RateOf<S>) {
        self.0.acceleration(w, -s, &reversed(x), out);
    }
    fn partials(&self, w: &mut S::Workspace, s: f64, x: &StateOf<S>, out: &mut Partials<S::Configuration>) {
        out.by_differences(x, |x, acceleration| self.acceleration(w, s, x, acceleration));
    }
    fn depends_on_configuration(&self) -> bool {
        self.0.depends_on_configuration()
    }
    fn next_stop(&self, s: f64, end: f64) -> Option<f64> {
        self.0.next_stop(-s, -end).map(|t| -t)
    }
    fn take_fault(&self) -> Option<Fault> {
        self.0.take_fault()
    }
}

/// Shows the steps of a run of a [`TimeReversed`] system to an observer as those of the system itself.
pub struct Backwards<O>(pub O);

impl<Q: Configuration, O: Observer<Q>> Observer<Q> for Backwards<O> {
    fn is_active(&self) -> bool {
        self.0.is_active()
    }
    fn observe(&mut self, step: &mut Step<'_, Q>) -> Flow {
        let Step { index, rejected, changes, .. } = *step;
        let times = (-step.t_before, -step.t_after);
        let (before, after) = (reversed(step.before), reversed(step.after));
        let mut interior = InteriorBackwards(step.interior());
        let mut turned = Step::new(index, times, &before, &after, &mut interior);
        (turned.rejected, turned.changes) = (rejected, changes);
        let flow = self.0.observe(&mut turned);
        let end = turned.end().map(|(t, state)| (-t, reversed(state)));
        if let Some((s, state)) = end {
            step.end_at(s, state);
        }
        flow
    }
}

/// The inside of a step, seen backwards.
struct InteriorBackwards<'a, Q: Configuration>(&'a mut dyn Interior<Q>);

impl<Q: Configuration> Interior<Q> for InteriorBackwards<'_, Q> {
    fn interpolant(&mut self) -> Box<dyn Interpolant<Q>> {
        Box::new(CurveBackwards(self.0.interpolant()))
    }
    fn is_curve_of_full_order(&self) -> bool {
        self.0.is_curve_of_full_order()
    }
    fn part(&mut self, length: f64, out: &mut State<Q>) -> Result<(), IntegrateError> {
        self.0.part(length, out)?;
        *out = reversed(out);
        Ok(())
    }
    fn nudge(&mut self, t: f64, x: &State<Q>, dt: f64, out: &mut State<Q>) {
        self.0.nudge(-t, &reversed(x), -dt, out);
        *out = reversed(out);
    }
}

/// A curve, seen backwards.
struct CurveBackwards<Q: Configuration>(Box<dyn Interpolant<Q>>);

impl<Q: Configuration> Interpolant<Q> for CurveBackwards<Q> {
    fn evaluate(&self, t: f64, out: &mut State<Q>) {
        self.0.evaluate(-t, out);
        *out = reversed(out);
    }
}
