//! Taylor series of order 16.
//!
//! A step is the Taylor polynomial of degree 16 of the motion from its start, in closed recurrences, see
//! [`series`](crate::series): position and velocity in world axes, angular momentum in body axes, and the orientation as a
//! quaternion, which is scaled to length 1 at the end.
//!
//! Order 16 on ℝ³ and on SO(3). The terms of the four highest degrees, of positions and of velocities, are the estimate of the error: a
//! term of degree 16 that is small by chance counts by a tenth of that of degree 15, and so on. From them the longest step is known
//! before it is made. The same polynomial is the dense output, at the order of the step, and a step that is made again shorter costs its
//! evaluation only. 1 evaluation, which gives all derivatives; no start-up. Conserves nothing exactly.
//!
//! For small tolerances, 1e-9 and below, under forces that have series: a sum of [`WrenchTerm`]s, as
//! [`ForceModel::add_terms`](crate::force::ForceModel::add_terms) gives it. Others are refused with [`StepError::NoSeries`]. Where the way to a
//! centre of force, or the velocity under quadratic drag, may vanish within a step, this is refused with [`StepError::StepTooLarge`]: behind zero
//! a series has the wrong sign of the length. So a run ends where a body is thrown exactly through the anchor of a spring. A step that is
//! chosen also keeps within the disc in which the series of a length converges, up to its nearest complex zero.
//!
//! À. Jorba and M. Zou, Experimental Mathematics 14 (2005) 99.
//!
//! # Deviations
//! The degree is fixed, where the source chooses it by the tolerance.

use crate::dense::Interpolant;
use crate::series::{BodyMotion, BodySeries, DEGREE, WrenchTerm};
use crate::state::{Configuration, Poses, RigidBodyState, State, Tolerances};
use crate::stepper::{EmbeddedStepper, MethodInfo, Scheme, Scope, StepError, Stepper, weighed_error};
use crate::system::{RateOf, RigidSystem, StateOf, System};

register! {
    415 => Taylor16: TaylorSeries, world, embedded;
}

/// Taylor series of order 16 of rigid bodies under forces with series.
#[derive(Debug, Clone, Copy, Default)]
pub struct TaylorSeries;

impl Scheme for TaylorSeries {
    const INFO: MethodInfo = MethodInfo {
        evaluations: 1,
        dense_order: DEGREE as u8 + 1,
        embedded: Some(DEGREE as u8 - 1),
        scope: Scope::ForcesWithSeries,
        limitations: "unsuitable for forces without series, such as functions and friction, which are refused; a way through the anchor of a spring, or through rest under quadratic drag",
        ..MethodInfo::explicit(
            "taylor16",
            "Taylor series, order 16",
            "À. Jorba and M. Zou, Experimental Mathematics 14 (2005) 99",
            DEGREE as u8,
        )
    };
}

/// The series of each body from the start of the step made last, and room to work in.
pub struct TaylorMemory<S: System> {
    bodies: Vec<BodySeries>,
    terms: Vec<WrenchTerm>,
    errors: [RateOf<S>; 2],
    /// Whether the last call found the longest step, so that the step that follows from the same state has its series.
    is_expanded: bool,
    /// The errors of a step of 1 from there by these tolerances, once they are known.
    of_unit_step: Option<(Tolerances, [f64; RATIOS.len()])>,
}

/// State of body `i`.
fn body_state<Q: Poses>(x: &State<Q>, i: usize) -> RigidBodyState {
    State { configuration: x.configuration.pose(i), rate: Q::twist(&x.rate, i) }
}

/// Moves the bodies, which are in the state at the start, along their series.
fn move_bodies<'a, Q: Poses>(bodies: impl Iterator<Item = &'a BodyMotion>, h: f64, x: &mut State<Q>) {
    for (i, motion) in bodies.enumerate() {
        let (pose, twist) = motion.at(h);
        x.configuration.set_pose(i, pose);
        Q::set_twist(&mut x.rate, i, twist);
    }
}

/// Of the step that is chosen, for an error of SAFETY¹⁶ = 0.44 of the tolerances.
const SAFETY: f64 = 0.95;
/// What the term of the highest degree is at least, in parts of the term of that degree and of those before it. Single coefficients
/// vanish, all of one parity in a motion from rest and others by chance where a singularity is near; then those before them tell the
/// error.
const RATIOS: [f64; 4] = [1.0, 1e-1, 1e-2, 1e-3];
/// The degrees of these.
const DEGREES: [i32; RATIOS.len()] = [DEGREE as i32, DEGREE as i32 - 1, DEGREE as i32 - 2, DEGREE as i32 - 3];
/// How often it is halved at most where a series may not converge.
const HALVINGS: usize = 30;

impl<S: RigidSystem> TaylorMemory<S> {
    /// The errors of a step of 1 from x, where the series begin, by the terms of each of the [`DEGREES`].
    fn of_unit_step(&mut self, x: &StateOf<S>, tolerances: &Tolerances) -> [f64; RATIOS.len()] {
        if let Some((_, errors)) = self.of_unit_step.filter(|(known, _)| known == tolerances) {
            return errors;
        }
        let mut errors = RATIOS;
        for (error, degree) in errors.iter_mut().zip(DEGREES) {
            let [of_configuration, of_rate] = &mut self.errors;
            for (i, series) in self.bodies.iter().enumerate() {
                let [displacement, change] = series.motion().terms(degree as usize);
                S::Configuration::set_twist(of_configuration, i, displacement);
                S::Configuration::set_twist(of_rate, i, change);
            }
            *error *= weighed_error(x, x, of_configuration, of_rate, tolerances);
        }
        self.of_unit_step = Some((*tolerances, errors));
        errors
    }

    /// Whether the series are those that the longest step from x was found by.
    fn take_expanded(&mut self, x: &StateOf<S>) -> bool {
        let mut bodies = self.bodies.iter().enumerate();
        std::mem::take(&mut self.is_expanded) && bodies.all(|(i, series)| series.begins_at(&body_state(x, i)))
    }

    fn expand(&mut self, system: &S, x: &StateOf<S>) -> Result<(), StepError> {
        for (i, series) in self.bodies.iter_mut().enumerate() {
            self.terms.clear();
            if !system.add_terms(i, &mut self.terms) {
                return Err(StepError::NoSeries { method: TaylorSeries::INFO.name });
            }
            if series.expand(system.body(i), &body_state(x, i), &self.terms) {
                self.of_unit_step = None;
            }
        }
        Ok(())
    }
}

impl<S: RigidSystem> Stepper<S> for TaylorSeries {
    type Memory = TaylorMemory<S>;

    fn start(&self, system: &S, x: &StateOf<S>) -> Result<Self::Memory, StepError> {
        let bodies = vec![BodySeries::new(); x.configuration.count()];
        let errors = [x.rate.clone(), x.rate.clone()];
        let mut memory =
            TaylorMemory { bodies, terms: Vec::new(), errors, is_expanded: false, of_unit_step: None };
        memory.expand(system, x)?;
        Ok(memory)
    }

    fn step(
        &self,
        system: &S,
        t: f64,
        x: &StateOf<S>,
        h: f64,
        memory: &mut Self::Memory,
        out: &mut StateOf<S>,
    ) -> Result<(), StepError> {
        if !memory.take_expanded(x) {
            memory.expand(system, x)?;
        }
        if !memory.bodies.iter().all(|series| series.holds_to(h)) {
            return Err(StepError::StepTooLarge { method: Self::INFO.name, t, h });
        }
        out.assign(x);
        move_bodies(memory.bodies.iter().map(BodySeries::motion), h, out);
        Ok(())
    }

    fn segment(
        &self,
        _: &S,
        t: f64,
        x: &StateOf<S>,
        _: f64,
        memory: &mut Self::Memory,
        _: &StateOf<S>,
    ) -> Box<dyn Interpolant<S::Configuration>> {
        Box::new(TaylorCurve {
            t,
            start: x.clone(),
            bodies: memory.bodies.iter().map(|series| *series.motion()).collect(),
        })
    }
}

impl<S: RigidSystem> EmbeddedStepper<S> for TaylorSeries {
    fn error(
        &self,
        x: &StateOf<S>,
        _: &StateOf<S>,
        h: f64,
        memory: &mut Self::Memory,
        tolerances: &Tolerances,
    ) -> f64 {
        let of_unit_step = memory.of_unit_step(x, tolerances).into_iter().zip(DEGREES);
        of_unit_step.map(|(error, degree)| error * h.powi(degree)).fold(0.0, f64::max)
    }

    /// From the terms of highest degree, which grow by powers of the step.
    fn longest_step(
        &self,
        system: &S,
        x: &StateOf<S>,
        memory: &mut Self::Memory,
        tolerances: &Tolerances,
    ) -> Result<Option<f64>, StepError> {
        memory.expand(system, x)?;
        memory.is_expanded = true;
        let mut longest = f64::INFINITY;
        for (error, degree) in memory.of_unit_step(x, tolerances).into_iter().zip(DEGREES) {
            if longest.is_infinite() || error * longest.powi(degree) > 1.0 {
                longest = error.powf(-1.0 / f64::from(degree));
            }
        }
        longest *= SAFETY;
        // What is not finite is for the driver to see, in a step of its own choice.
        let halved = std::iter::successors(Some(longest), |h| Some(0.5 * h)).take(HALVINGS);
        let mut halved = halved.filter(|h| memory.bodies.iter().all(|series| series.converges_to(*h)));
        Ok(halved.next().filter(|h| !h.is_nan()))
    }
}

/// The polynomials of a step.
struct TaylorCurve<Q: Configuration> {
    t: f64,
    start: State<Q>,
    bodies: Vec<BodyMotion>,
}

impl<Q: Poses> Interpolant<Q> for TaylorCurve<Q> {
    fn evaluate(&self, t: f64, out: &mut State<Q>) {
        out.assign(&self.start);
        move_bodies(self.bodies.iter(), t - self.t, out);
    }
}
