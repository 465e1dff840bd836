//! Splitting of a rigid body's motion into kicks by its wrench and exact free drifts.

use crate::augmented::advance;
use crate::body::angular_momentum;
use crate::exact::FreeRotation;
use crate::state::{Poses, Rate, Twist};
use crate::system::{RateOf, RigidSystem, StateOf, angular_velocity};
use crate::tableau::{ButcherTableau, RUNGE_KUTTA_4};

/// How a kick is solved where the wrench depends on the rates.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Kick {
    /// Explicit midpoint method.
    SecondOrder,
    /// Classic Runge–Kutta method.
    FourthOrder,
}

/// A splitting method: kicks and drifts by turns, in parts of the step, a kick first and last.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Splitting<'a> {
    pub(crate) kicks: &'a [f64],
    pub(crate) drifts: &'a [f64],
    pub(crate) kick: Kick,
}

/// Velocities and angular momenta of the bodies, and the slopes of the kicks.
pub struct SplittingMemory<S: RigidSystem> {
    /// Velocity and angular momentum in the world frame, carried from step to step so that angular
    /// momentum is constant bit for bit without torque.
    carried: RateOf<S>,
    carried_holds: bool,
    /// Their time derivative: force by mass, and torque.
    slope: RateOf<S>,
    /// Whether `slope` belongs to the state the next step starts from.
    slope_holds: bool,
    stage: RateOf<S>,
    sum: RateOf<S>,
}

impl<S: RigidSystem> SplittingMemory<S> {
    pub(crate) fn new(x: &StateOf<S>) -> Self {
        let mut zero = x.rate.clone();
        zero.set_zero();
        Self {
            carried: zero.clone(),
            carried_holds: false,
            slope: zero.clone(),
            slope_holds: false,
            stage: zero.clone(),
            sum: zero,
        }
    }

    pub(crate) fn restart(&mut self) {
        self.carried_holds = false;
        self.slope_holds = false;
    }

    pub(crate) fn step(
        &mut self,
        system: &S,
        splitting: &Splitting<'_>,
        t: f64,
        x: &StateOf<S>,
        h: f64,
        out: &mut StateOf<S>,
    ) {
        out.assign(x);
        if !self.carried_holds {
            for i in 0..x.configuration.count() {
                let twist = S::Configuration::twist(&x.rate, i);
                let angular = angular_momentum(system.body(i), &x.configuration.pose(i), &twist.angular);
                S::Configuration::set_twist(&mut self.carried, i, Twist { linear: twist.linear, angular });
            }
            advance::<S::Configuration>(&x.rate, &[], &mut self.carried);
            self.carried_holds = true;
        }
        if system.is_free() {
            self.drift(system, h, out);
        } else {
            let mut fraction = 0.0;
            for (k, &part) in splitting.kicks.iter().enumerate() {
                self.kick(system, splitting.kick, t + fraction * h, part * h, out);
                if let Some(part) = splitting.drifts.get(k) {
                    self.drift(system, part * h, out);
                    fraction += part;
                }
            }
        }
        set_rates(system, &self.carried, out);
    }

    /// The exact free motion over `h`.
    fn drift(&mut self, system: &S, h: f64, out: &mut StateOf<S>) {
        for i in 0..out.configuration.count() {
            let inertia = system.body(i).inertia();
            let mut pose = out.configuration.pose(i);
            let twist = S::Configuration::twist(&self.carried, i);
            let (diagonal, axes) = (inertia.is_diagonal(), inertia.principal_axes());
            let principal = if diagonal { pose.orientation } else { pose.orientation * axes };
            let moments = inertia.principal_moments();
            let omega = principal.inverse_transform_vector(&twist.angular).component_div(moments);
            let (turned, _) = FreeRotation::new(moments, &principal, &omega).at(h);
            pose.orientation = if diagonal { turned } else { turned * axes.inverse() };
            pose.position += twist.linear * h;
            out.configuration.set_pose(i, pose);
        }
        self.slope_holds = false;
    }

    /// The motion over `h` under the wrench alone, the configuration at rest.
    fn kick(&mut self, system: &S, kick: Kick, t: f64, h: f64, out: &mut StateOf<S>) {
        if !system.depends_on_velocity() {
            if !self.slope_holds {
                evaluate(system, t, out, &mut self.slope);
            }
            self.carried.axpy(h, &self.slope);
            self.slope_holds = true;
            return;
        }
        set_rates(system, &self.carried, out);
        evaluate(system, t, out, &mut self.slope);
        match kick {
            Kick::SecondOrder => {
                self.evaluate_ahead(system, t, 0.5 * h, out);
                self.carried.axpy(h, &self.slope);
            }
            Kick::FourthOrder => {
                let ButcherTableau { rows, weights, .. } = RUNGE_KUTTA_4;
                self.sum.assign(&self.slope);
                let parts = rows.iter().filter_map(|row| row.last());
                for (part, numerator) in parts.zip(&weights.numerators[1..]) {
                    self.evaluate_ahead(system, t, part * h, out);
                    self.sum.axpy(*numerator, &self.slope);
                }
                self.carried.axpy(h / weights.denominator, &self.sum);
            }
        }
    }

    /// The slope after `h` of the slope known.
    fn evaluate_ahead(&mut self, system: &S, t: f64, h: f64, out: &mut StateOf<S>) {
        self.stage.assign(&self.carried);
        self.stage.axpy(h, &self.slope);
        set_rates(system, &self.stage, out);
        evaluate(system, t, out, &mut self.slope);
    }
}

/// Sets the rates of a state from velocities and angular momenta.
fn set_rates<S: RigidSystem>(system: &S, carried: &RateOf<S>, out: &mut StateOf<S>) {
    for i in 0..out.configuration.count() {
        let twist = S::Configuration::twist(carried, i);
        let angular = angular_velocity(system.body(i), &out.configuration.pose(i), &twist.angular);
        S::Configuration::set_twist(&mut out.rate, i, Twist { linear: twist.linear, angular });
    }
    advance::<S::Configuration>(carried, &[], &mut out.rate);
}

/// Time derivative of velocities and angular momenta.
fn evaluate<S: RigidSystem>(system: &S, t: f64, x: &StateOf<S>, slope: &mut RateOf<S>) {
    system.wrenches(t, x, slope);
    for i in 0..x.configuration.count() {
        let mut wrench = S::Configuration::twist(slope, i);
        wrench.linear /= system.body(i).mass();
        S::Configuration::set_twist(slope, i, wrench);
    }
}
