//! Equations of motion: what a method integrates.
//!
//! A system is q̇ = velocity(t, q, p), ṗ = acceleration(t, q, p) with q on ℝᵐ × SO(3)ᵏ. For most systems p
//! is the velocity itself. The same bodies can be written in three forms, and every general method
//! integrates each of them:
//!
//! | Form | p, rotational part | Equation |
//! |---|---|---|
//! | the system itself | ω, world frame | ω̇ = I⁻¹(M − ω × Iω), Ṙ = ω̂R |
//! | [`MomentumForm`] | L, world frame | L̇ = M, ω = I⁻¹L (thesis 6.2.1) |
//! | [`BodyForm`] | ω, body frame | ω̇ = I⁻¹(M − ω × Iω), Ṙ = Rω̂ |
//!
//! [`System::Forms`] says in which forms the methods of the table find a system: [`OneForm`] for the system itself alone,
//! [`RigidForms`] for the three.

use crate::body::{RigidBody, angular_momentum};
pub use crate::fault::Fault;
use crate::force::ForceModel;
use crate::partials::Partials;
use crate::scratch::Scratch;
use crate::series::WrenchTerm;
use crate::state::{Configuration, Pose, Poses, Rate, RigidBodyState, State, Twist};
use nalgebra::Vector3;
use somersault_core::interval::nearest;
use std::sync::Arc;

/// State of a system.
pub type StateOf<S> = State<<S as System>::Configuration>;
/// Rate of a system.
pub type RateOf<S> = <<S as System>::Configuration as Configuration>::Rate;

/// The forms of a system that is integrated as it is: methods for any system take it.
#[derive(Debug, Clone, Copy)]
pub struct OneForm;

/// The forms of a [`RigidSystem`], in the variables of the world, with angular momentum, and in body axes: all methods take
/// it.
#[derive(Debug, Clone, Copy)]
pub struct RigidForms;

/// Equations of motion on ℝᵐ × SO(3)ᵏ.
pub trait System {
    /// Where the system lives.
    type Configuration: Configuration;
    /// The forms in which the methods of the table take it, [`OneForm`] or [`RigidForms`]; a type of another crate may
    /// offer others, see [`Forms`](crate::methods::Forms).
    type Forms;
    /// Room for intermediate results, made once per trajectory.
    type Workspace;
    /// Whether a run looks at every step, as where it locates events: then nothing is compiled for steps at which nobody looks.
    const IS_WATCHED: bool = false;
    /// A workspace of the right size.
    fn workspace(&self) -> Self::Workspace;
    /// q̇ as a function of time and state; the rate itself unless the system says otherwise.
    #[inline]
    fn velocity(&self, _w: &mut Self::Workspace, _t: f64, x: &StateOf<Self>, out: &mut RateOf<Self>) {
        out.assign(&x.rate);
    }
    /// Time derivative of the rate.
    fn acceleration(&self, w: &mut Self::Workspace, t: f64, x: &StateOf<Self>, out: &mut RateOf<Self>);
    /// Whether velocity and acceleration may depend on the configuration. Where they do not, a method may leave that of its stages as
    /// it was.
    fn depends_on_configuration(&self) -> bool {
        true
    }
    /// The derivatives of the acceleration in a state, for the iterations of implicit methods, which converge the faster the
    /// closer they are; by differences unless the system says otherwise.
    fn partials(
        &self,
        w: &mut Self::Workspace,
        t: f64,
        x: &StateOf<Self>,
        out: &mut Partials<Self::Configuration>,
    ) {
        out.by_differences(x, |x, acceleration| self.acceleration(w, t, x, acceleration));
    }
    /// The first time on the way from `t` to `end`, which may be earlier, at which the equations are not smooth, such as a knot of a force
    /// that is given at knots of time; `None`, the default, where they are smooth between them.
    ///
    /// Adapted steps end there, and so do all steps of runs that locate events, whose stages are evaluated on the near side only, so that
    /// forces may jump.
    fn next_stop(&self, _t: f64, _end: f64) -> Option<f64> {
        None
    }
    /// Takes the reason why values since it was taken last are NaN, where the system keeps one: a run puts it in the place
    /// of the error that the NaN led to.
    fn take_fault(&self) -> Option<Fault> {
        None
    }
}

#[deny(clippy::missing_trait_methods)]
impl<S: System + ?Sized> System for &S {
    type Configuration = S::Configuration;
    type Forms = S::Forms;
    type Workspace = S::Workspace;
    const IS_WATCHED: bool = S::IS_WATCHED;
    fn workspace(&self) -> Self::Workspace {
        (**self).workspace()
    }
    #[inline(always)]
    fn velocity(&self, w: &mut S::Workspace, t: f64, x: &StateOf<S>, out: &mut RateOf<S>) {
        (**self).velocity(w, t, x, out);
    }
    #[inline(always)]
    fn acceleration(&self, w: &mut S::Workspace, t: f64, x: &StateOf<S>, out: &mut RateOf<S>) {
        (**self).acceleration(w, t, x, out);
    }
    #[inline(always)]
    fn depends_on_configuration(&self) -> bool {
        (**self).depends_on_configuration()
    }
    fn partials(&self, w: &mut S::Workspace, t: f64, x: &StateOf<S>, out: &mut Partials<S::Configuration>) {
        (**self).partials(w, t, x, out);
    }
    fn next_stop(&self, t: f64, end: f64) -> Option<f64> {
        (**self).next_stop(t, end)
    }
    fn take_fault(&self) -> Option<Fault> {
        (**self).take_fault()
    }
}

/// One or several rigid bodies, for the methods that need inertia and torque rather than acceleration.
pub trait RigidSystem: System<Configuration: Poses, Forms = RigidForms> {
    /// Body `i`, for `i` below the number of poses.
    fn body(&self, i: usize) -> &RigidBody;
    /// A state of the right size: all bodies at rest at the origin.
    fn rest(&self) -> StateOf<Self>;
    /// Force (linear part) and torque about the centre of mass (angular part) on every body, world frame, and the
    /// derivatives of the variables of first order beside the bodies.
    fn wrenches(&self, t: f64, x: &StateOf<Self>, out: &mut RateOf<Self>);
    /// The same with angular velocities and torques in body axes; by default by way of `world`, in world axes.
    #[inline(always)]
    fn body_wrenches(
        &self,
        t: f64,
        x: &State<BodyPoses<Self>>,
        (world, wrenches): &mut WorldScratch<Self>,
        out: &mut BodyRate<Self>,
    ) {
        let (mut world, mut wrenches) = (world.lend(), wrenches.lend());
        FromBody.decode(x, &mut world);
        self.wrenches(t, &world, &mut wrenches);
        torques_in_body_axes::<Self::Configuration>(x, &wrenches, out);
    }
    /// Adds terms whose sum is the wrench on body `i`, as [`ForceModel::add_terms`]; false, as by default, where none are known.
    fn add_terms(&self, _i: usize, _terms: &mut Vec<WrenchTerm>) -> bool {
        false
    }
    /// Whether all wrenches are always zero.
    fn is_free(&self) -> bool;
    /// Whether all torques are always zero.
    fn is_torque_free(&self) -> bool;
    /// Whether wrenches may depend on the rates.
    fn depends_on_velocity(&self) -> bool;
}

/// Configuration of a rigid system in the body frame.
pub type BodyPoses<S> = <<S as System>::Configuration as Poses>::InBodyFrame;
/// A state and wrenches of a rigid system in world axes, to work on.
pub type WorldScratch<S> = (Scratch<StateOf<S>>, Scratch<RateOf<S>>);
/// Rate of a rigid system in the body frame.
pub type BodyRate<S> = <BodyPoses<S> as Configuration>::Rate;

/// Copies the variables of first order beside bodies.
#[inline(always)]
fn copy_variables<From: Poses, To: Poses>(from: &From::Rate, to: &mut To::Rate) {
    To::variables_mut(to).copy_from_slice(From::variables(from));
}

/// Turns the torques on bodies in the poses of `x` from world axes into body axes; the derivatives of variables
/// beside them stay.
#[inline(always)]
pub fn torques_in_body_axes<Q: Poses>(
    x: &State<Q::InBodyFrame>,
    wrenches: &Q::Rate,
    out: &mut <Q::InBodyFrame as Configuration>::Rate,
) {
    for i in 0..x.configuration.count() {
        let wrench = Q::twist(wrenches, i);
        let angular = x.configuration.pose(i).orientation.inverse_transform_vector(&wrench.angular);
        Q::InBodyFrame::set_twist(out, i, Twist { linear: wrench.linear, angular });
    }
    copy_variables::<Q, Q::InBodyFrame>(wrenches, out);
}

#[deny(clippy::missing_trait_methods)]
impl<S: RigidSystem + ?Sized> RigidSystem for &S {
    #[inline(always)]
    fn body(&self, i: usize) -> &RigidBody {
        (**self).body(i)
    }
    fn rest(&self) -> StateOf<S> {
        (**self).rest()
    }
    #[inline(always)]
    fn wrenches(&self, t: f64, x: &StateOf<S>, out: &mut RateOf<S>) {
        (**self).wrenches(t, x, out);
    }
    #[inline(always)]
    fn body_wrenches(
        &self,
        t: f64,
        x: &State<BodyPoses<S>>,
        world: &mut WorldScratch<S>,
        out: &mut BodyRate<S>,
    ) {
        (**self).body_wrenches(t, x, world, out);
    }
    fn add_terms(&self, i: usize, terms: &mut Vec<WrenchTerm>) -> bool {
        (**self).add_terms(i, terms)
    }
    #[inline(always)]
    fn is_free(&self) -> bool {
        (**self).is_free()
    }
    #[inline(always)]
    fn is_torque_free(&self) -> bool {
        (**self).is_torque_free()
    }
    #[inline(always)]
    fn depends_on_velocity(&self) -> bool {
        (**self).depends_on_velocity()
    }
}

/// Linear and angular acceleration in the world frame under a wrench:
/// a = F/m, α = R I⁻¹(M_B − ω_B × I ω_B) with the products taken in the body frame.
#[inline(always)]
pub fn world_acceleration(body: &RigidBody, x: &RigidBodyState, wrench: &Twist) -> Twist {
    let r = x.orientation().to_rotation_matrix().into_inner();
    let omega = r.tr_mul(x.angular_velocity());
    let torque = r.tr_mul(&wrench.angular);
    Twist { linear: wrench.linear / body.mass(), angular: r * euler(body, &omega, &torque) }
}

/// As [`world_acceleration`] without a wrench.
#[inline(always)]
fn free_acceleration(body: &RigidBody, x: &RigidBodyState) -> Twist {
    let r = x.orientation().to_rotation_matrix().into_inner();
    let omega = r.tr_mul(x.angular_velocity());
    Twist { linear: Vector3::zeros(), angular: r * euler(body, &omega, &Vector3::zeros()) }
}

/// Euler's equations: I⁻¹(M − ω × Iω), all in the body frame.
#[inline(always)]
pub fn euler(body: &RigidBody, omega: &Vector3<f64>, torque: &Vector3<f64>) -> Vector3<f64> {
    let inertia = body.inertia();
    inertia.velocity(&(torque - omega.cross(&inertia.momentum(omega))))
}

/// One rigid body under a force model.
#[derive(Debug, Clone, Copy)]
pub struct RigidBodySystem<F = ()> {
    /// The body.
    pub body: RigidBody,
    /// The forces on it.
    pub forces: F,
}

impl RigidBodySystem {
    /// A body under no force.
    pub fn free(body: RigidBody) -> Self {
        Self { body, forces: () }
    }
}

impl<F: ForceModel> RigidBodySystem<F> {
    /// A body under a force model.
    pub fn new(body: RigidBody, forces: F) -> Self {
        Self { body, forces }
    }
}

impl<F: ForceModel> System for RigidBodySystem<F> {
    type Configuration = Pose;
    type Forms = RigidForms;
    type Workspace = ();
    fn workspace(&self) {}
    #[inline(always)]
    fn acceleration(&self, (): &mut (), t: f64, x: &RigidBodyState, out: &mut Twist) {
        *out = if self.forces.is_free() {
            free_acceleration(&self.body, x)
        } else {
            let wrench = self.forces.wrench(t, &self.body, x);
            world_acceleration(&self.body, x, &Twist { linear: wrench.force, angular: wrench.torque })
        };
    }
    fn next_stop(&self, t: f64, end: f64) -> Option<f64> {
        self.forces.next_stop(t, end)
    }
}

impl<F: ForceModel> RigidSystem for RigidBodySystem<F> {
    #[inline(always)]
    fn body(&self, _: usize) -> &RigidBody {
        &self.body
    }
    fn rest(&self) -> RigidBodyState {
        RigidBodyState::default()
    }
    #[inline(always)]
    fn wrenches(&self, t: f64, x: &RigidBodyState, out: &mut Twist) {
        let wrench = self.forces.wrench(t, &self.body, x);
        *out = Twist { linear: wrench.force, angular: wrench.torque };
    }
    fn add_terms(&self, _: usize, terms: &mut Vec<WrenchTerm>) -> bool {
        self.forces.add_terms(&self.body, terms)
    }
    #[inline(always)]
    fn is_free(&self) -> bool {
        self.forces.is_free()
    }
    #[inline(always)]
    fn is_torque_free(&self) -> bool {
        self.forces.is_torque_free()
    }
    #[inline(always)]
    fn depends_on_velocity(&self) -> bool {
        self.forces.depends_on_velocity()
    }
}

/// Forces between bodies.
pub trait Interaction {
    /// Adds force and torque on every body, world frame.
    fn add_wrenches(&self, t: f64, bodies: &[RigidBody], x: &State<Vec<Pose>>, out: &mut [Twist]);
    /// Whether it never acts.
    fn is_none(&self) -> bool {
        false
    }
    /// The number of bodies it is made for; `None` if it takes any.
    fn bodies(&self) -> Option<usize> {
        None
    }
    /// Whether no body feels a torque about its centre of mass.
    fn is_torque_free(&self) -> bool {
        false
    }
    /// Whether the wrenches may depend on the rates.
    fn depends_on_velocity(&self) -> bool {
        true
    }
}

impl Interaction for () {
    fn add_wrenches(&self, _: f64, _: &[RigidBody], _: &State<Vec<Pose>>, _: &mut [Twist]) {}
    fn is_none(&self) -> bool {
        true
    }
    fn is_torque_free(&self) -> bool {
        true
    }
    fn depends_on_velocity(&self) -> bool {
        false
    }
}

/// A boxed interaction, for choices made at run time.
pub type BoxedInteraction = Box<dyn Interaction + Send + Sync>;

#[deny(clippy::missing_trait_methods)]
impl Interaction for BoxedInteraction {
    fn add_wrenches(&self, t: f64, bodies: &[RigidBody], x: &State<Vec<Pose>>, out: &mut [Twist]) {
        (**self).add_wrenches(t, bodies, x, out);
    }
    fn is_none(&self) -> bool {
        (**self).is_none()
    }
    fn bodies(&self) -> Option<usize> {
        (**self).bodies()
    }
    fn is_torque_free(&self) -> bool {
        (**self).is_torque_free()
    }
    fn depends_on_velocity(&self) -> bool {
        (**self).depends_on_velocity()
    }
}

/// Newtonian attraction of the centres of mass: F = G m₁ m₂ / d² along the line between them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Gravitation {
    /// G in the units of the problem; 6.6743e-11 m³/(kg s²) in SI (CODATA 2018).
    pub constant: f64,
}

impl Interaction for Gravitation {
    fn add_wrenches(&self, _: f64, bodies: &[RigidBody], x: &State<Vec<Pose>>, out: &mut [Twist]) {
        for i in 0..bodies.len() {
            for j in 0..i {
                let span = x.configuration[j].position - x.configuration[i].position;
                let distance = span.norm();
                let force = span
                    * (self.constant * bodies[i].mass() * bodies[j].mass()
                        / (distance * distance * distance));
                out[i].linear += force;
                out[j].linear -= force;
            }
        }
    }
    fn is_torque_free(&self) -> bool {
        true
    }
    fn depends_on_velocity(&self) -> bool {
        false
    }
}

/// Several rigid bodies, each under its own force model, with forces between them.
#[derive(Debug, Clone)]
pub struct RigidBodiesSystem<F = (), I = ()> {
    bodies: Vec<RigidBody>,
    forces: Vec<F>,
    interaction: I,
}

/// The number of bodies and of something that belongs to each differ.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("`{argument}` must have one entry for each of the {bodies} bodies, found {found}")]
pub struct CountMismatch {
    /// Name of the argument.
    pub argument: &'static str,
    /// Number of bodies.
    pub bodies: usize,
    /// Number of entries.
    pub found: usize,
}

impl<F: ForceModel, I: Interaction> RigidBodiesSystem<F, I> {
    /// Bodies, the force model of each, and what acts between them.
    pub fn try_new(bodies: Vec<RigidBody>, forces: Vec<F>, interaction: I) -> Result<Self, CountMismatch> {
        let count = bodies.len();
        let taken = interaction.bodies().unwrap_or(count);
        for (argument, found) in [("forces", forces.len()), ("interaction", taken)] {
            if found != count {
                return Err(CountMismatch { argument, bodies: count, found });
            }
        }
        Ok(Self { bodies, forces, interaction })
    }

    /// The bodies.
    pub fn bodies(&self) -> &[RigidBody] {
        &self.bodies
    }

    /// The force model of each.
    pub fn forces(&self) -> &[F] {
        &self.forces
    }

    /// What acts between them.
    pub fn interaction(&self) -> &I {
        &self.interaction
    }
}

impl<F: ForceModel, I: Interaction> System for RigidBodiesSystem<F, I> {
    type Configuration = Vec<Pose>;
    type Forms = RigidForms;
    type Workspace = Vec<Twist>;
    fn workspace(&self) -> Vec<Twist> {
        vec![Twist::default(); self.bodies.len()]
    }
    fn acceleration(&self, wrenches: &mut Vec<Twist>, t: f64, x: &State<Vec<Pose>>, out: &mut Vec<Twist>) {
        self.wrenches(t, x, wrenches);
        for (i, body) in self.bodies.iter().enumerate() {
            let state = State { configuration: x.configuration[i], rate: x.rate[i] };
            out[i] = world_acceleration(body, &state, &wrenches[i]);
        }
    }
    fn next_stop(&self, t: f64, end: f64) -> Option<f64> {
        nearest(t, self.forces.iter().map(|force| force.next_stop(t, end)))
    }
}

impl<F: ForceModel, I: Interaction> RigidSystem for RigidBodiesSystem<F, I> {
    fn body(&self, i: usize) -> &RigidBody {
        &self.bodies[i]
    }
    fn rest(&self) -> State<Vec<Pose>> {
        let n = self.bodies.len();
        State { configuration: vec![Pose::default(); n], rate: vec![Twist::default(); n] }
    }
    fn wrenches(&self, t: f64, x: &State<Vec<Pose>>, out: &mut Vec<Twist>) {
        for (i, (body, force)) in self.bodies.iter().zip(&self.forces).enumerate() {
            let state = State { configuration: x.configuration[i], rate: x.rate[i] };
            let wrench = force.wrench(t, body, &state);
            out[i] = Twist { linear: wrench.force, angular: wrench.torque };
        }
        self.interaction.add_wrenches(t, &self.bodies, x, out);
    }
    fn add_terms(&self, i: usize, terms: &mut Vec<WrenchTerm>) -> bool {
        self.interaction.is_none() && self.forces[i].add_terms(&self.bodies[i], terms)
    }
    fn is_free(&self) -> bool {
        // An interaction is not asked whether it ever acts; without one there is nothing to gain.
        false
    }
    fn is_torque_free(&self) -> bool {
        self.forces.iter().all(F::is_torque_free) && self.interaction.is_torque_free()
    }
    fn depends_on_velocity(&self) -> bool {
        self.forces.iter().any(F::depends_on_velocity) || self.interaction.depends_on_velocity()
    }
}

/// How the variables of a form turn into those of the system, and back.
pub trait Form<Q: Configuration>: System {
    /// Turns states back without borrowing the system, so that dense output can keep it.
    type Decoder: Decoder<Self::Configuration, Q>;
    /// The state of the system in the variables of this form.
    fn encode(&self, x: &State<Q>) -> StateOf<Self>;
    /// Writes that into `out`, a state of the same size.
    fn encode_into(&self, x: &State<Q>, out: &mut StateOf<Self>) {
        *out = self.encode(x);
    }
    /// The way back.
    fn decoder(&self) -> Self::Decoder;
}

/// Turns states of a form into states of the system.
pub trait Decoder<From: Configuration, Q: Configuration>: Clone + Send + Sync + 'static {
    /// Writes the system's state into `out`.
    fn decode(&self, x: &State<From>, out: &mut State<Q>);
}

/// Decoder of the form that is the system itself.
#[derive(Debug, Clone, Copy)]
pub struct Unchanged;

impl<Q: Configuration> Decoder<Q, Q> for Unchanged {
    #[inline(always)]
    fn decode(&self, x: &State<Q>, out: &mut State<Q>) {
        out.assign(x);
    }
}

impl<S: System> Form<S::Configuration> for &S {
    type Decoder = Unchanged;
    fn encode(&self, x: &StateOf<S>) -> StateOf<S> {
        x.clone()
    }
    fn encode_into(&self, x: &StateOf<S>, out: &mut StateOf<S>) {
        out.assign(x);
    }
    fn decoder(&self) -> Unchanged {
        Unchanged
    }
}

/// The bodies with angular momentum in the place of angular velocity: L̇ = M.
///
/// Without torque L is constant bit for bit whatever the method, which bounds the rotational energy by
/// L²/(2 I_min) (thesis 6.4).
#[derive(Debug, Clone, Copy)]
pub struct MomentumForm<'a, S>(pub &'a S);

/// I⁻¹ L in the world frame.
#[inline(always)]
pub(crate) fn angular_velocity(body: &RigidBody, pose: &Pose, momentum: &Vector3<f64>) -> Vector3<f64> {
    let r = pose.orientation.to_rotation_matrix().into_inner();
    r * body.inertia().velocity(&r.tr_mul(momentum))
}

impl<S: RigidSystem> MomentumForm<'_, S> {
    #[inline(always)]
    fn twist(&self, x: &StateOf<S>, i: usize) -> Twist {
        let (pose, rate) = (x.configuration.pose(i), <S::Configuration as Poses>::twist(&x.rate, i));
        Twist { linear: rate.linear, angular: angular_velocity(self.0.body(i), &pose, &rate.angular) }
    }

    #[inline(always)]
    fn twists(&self, x: &StateOf<S>, out: &mut RateOf<S>) {
        for i in 0..x.configuration.count() {
            S::Configuration::set_twist(out, i, self.twist(x, i));
        }
        copy_variables::<S::Configuration, S::Configuration>(&x.rate, out);
    }
}

impl<S: RigidSystem> System for MomentumForm<'_, S> {
    type Configuration = S::Configuration;
    type Forms = OneForm;
    type Workspace = StateOf<S>;
    const IS_WATCHED: bool = S::IS_WATCHED;
    fn workspace(&self) -> StateOf<S> {
        self.0.rest()
    }
    #[inline(always)]
    fn velocity(&self, _: &mut StateOf<S>, _: f64, x: &StateOf<S>, out: &mut RateOf<S>) {
        self.twists(x, out);
    }
    #[inline(always)]
    fn acceleration(&self, world: &mut StateOf<S>, t: f64, x: &StateOf<S>, out: &mut RateOf<S>) {
        if self.0.is_free() {
            out.set_zero();
            return;
        }
        world.configuration.assign(&x.configuration);
        self.twists(x, &mut world.rate);
        self.0.wrenches(t, world, out);
        for i in 0..x.configuration.count() {
            let wrench = S::Configuration::twist(out, i);
            let linear = wrench.linear / self.0.body(i).mass();
            S::Configuration::set_twist(out, i, Twist { linear, angular: wrench.angular });
        }
    }
    fn take_fault(&self) -> Option<Fault> {
        self.0.take_fault()
    }
}

/// Decoder of [`MomentumForm`].
#[derive(Debug, Clone)]
pub struct FromMomentum(Arc<[RigidBody]>);

impl<Q: Poses> Decoder<Q, Q> for FromMomentum {
    fn decode(&self, x: &State<Q>, out: &mut State<Q>) {
        out.configuration.assign(&x.configuration);
        for (i, body) in self.0.iter().enumerate() {
            let rate = Q::twist(&x.rate, i);
            let angular = angular_velocity(body, &x.configuration.pose(i), &rate.angular);
            Q::set_twist(&mut out.rate, i, Twist { linear: rate.linear, angular });
        }
        copy_variables::<Q, Q>(&x.rate, &mut out.rate);
    }
}

impl<S: RigidSystem> Form<S::Configuration> for MomentumForm<'_, S> {
    type Decoder = FromMomentum;
    fn encode(&self, x: &StateOf<S>) -> StateOf<S> {
        let mut y = x.clone();
        for i in 0..x.configuration.count() {
            let rate = S::Configuration::twist(&x.rate, i);
            let angular = angular_momentum(self.0.body(i), &x.configuration.pose(i), &rate.angular);
            S::Configuration::set_twist(&mut y.rate, i, Twist { linear: rate.linear, angular });
        }
        y
    }
    fn decoder(&self) -> FromMomentum {
        FromMomentum((0..self.0.rest().configuration.count()).map(|i| *self.0.body(i)).collect())
    }
}

/// The bodies with angular velocity in the body frame: Ṙ = Rω̂.
///
/// Euler's equations then hold the rotation only through the torque, which makes a free body cheap,
/// and the error of a rotation about an unstable axis stays in the axis where it arose.
#[derive(Debug, Clone, Copy)]
pub struct BodyForm<'a, S>(pub &'a S);

impl<S: RigidSystem> System for BodyForm<'_, S> {
    type Configuration = BodyPoses<S>;
    type Forms = OneForm;
    type Workspace = WorldScratch<S>;
    const IS_WATCHED: bool = S::IS_WATCHED;
    fn workspace(&self) -> Self::Workspace {
        let rest = self.0.rest();
        (Scratch::like(&rest), Scratch::like(&rest.rate))
    }
    #[inline(always)]
    fn acceleration(&self, world: &mut Self::Workspace, t: f64, x: &StateOf<Self>, out: &mut RateOf<Self>) {
        let is_free = self.0.is_free();
        if is_free {
            out.set_zero();
        } else {
            self.0.body_wrenches(t, x, world, out);
        }
        for i in 0..x.configuration.count() {
            let body = self.0.body(i);
            let omega = BodyPoses::<S>::twist(&x.rate, i).angular;
            let wrench = BodyPoses::<S>::twist(out, i);
            let angular = euler(body, &omega, &wrench.angular);
            let linear = if is_free { wrench.linear } else { wrench.linear / body.mass() };
            BodyPoses::<S>::set_twist(out, i, Twist { linear, angular });
        }
    }
    /// Euler's equations of a free body have no orientation in them.
    #[inline(always)]
    fn depends_on_configuration(&self) -> bool {
        !self.0.is_free()
    }
    fn take_fault(&self) -> Option<Fault> {
        self.0.take_fault()
    }
}

/// Decoder of [`BodyForm`].
#[derive(Debug, Clone, Copy)]
pub struct FromBody;

impl<B: Poses, Q: Poses> Decoder<B, Q> for FromBody {
    #[inline(always)]
    fn decode(&self, x: &State<B>, out: &mut State<Q>) {
        for i in 0..x.configuration.count() {
            let (pose, rate) = (x.configuration.pose(i), B::twist(&x.rate, i));
            out.configuration.set_pose(i, pose);
            let angular = pose.orientation * rate.angular;
            Q::set_twist(&mut out.rate, i, Twist { linear: rate.linear, angular });
        }
        copy_variables::<B, Q>(&x.rate, &mut out.rate);
    }
}

impl<S: RigidSystem> Form<S::Configuration> for BodyForm<'_, S> {
    type Decoder = FromBody;
    fn encode(&self, x: &StateOf<S>) -> StateOf<Self> {
        let mut y = S::Configuration::in_body_frame(x);
        for i in 0..x.configuration.count() {
            let rate = S::Configuration::twist(&x.rate, i);
            let orientation = x.configuration.pose(i).orientation;
            let angular = orientation.inverse_transform_vector(&rate.angular);
            BodyPoses::<S>::set_twist(&mut y.rate, i, Twist { linear: rate.linear, angular });
        }
        y
    }
    fn decoder(&self) -> FromBody {
        FromBody
    }
}
