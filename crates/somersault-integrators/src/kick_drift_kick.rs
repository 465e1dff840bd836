//! Half kick of the momenta, free drift, half kick: the frame of the splitting methods for rigid bodies.

use crate::augmented::advance;
use crate::body::angular_momentum;
use crate::state::{Pose, Poses, Twist};
use crate::stepper::StepError;
use crate::system::{RateOf, RigidSystem, StateOf, angular_velocity};
use nalgebra::{UnitQuaternion, Vector3};

/// World angular momenta of the bodies and the wrenches at the start of the next step.
pub struct KickDriftKickMemory<S: RigidSystem> {
    /// Carried rather than formed from the angular velocity in each step: without torque they are then
    /// constant bit for bit.
    momenta: Vec<Vector3<f64>>,
    wrenches: RateOf<S>,
    wrenches_ahead: RateOf<S>,
    /// Whether `wrenches` belong to the state the next step starts from.
    wrenches_hold: bool,
}

impl<S: RigidSystem> KickDriftKickMemory<S> {
    pub(crate) fn new(x: &StateOf<S>) -> Self {
        let mut wrenches = x.rate.clone();
        crate::state::Rate::set_zero(&mut wrenches);
        Self {
            momenta: Vec::with_capacity(x.configuration.count()),
            wrenches_ahead: wrenches.clone(),
            wrenches,
            wrenches_hold: false,
        }
    }

    pub(crate) fn restart(&mut self) {
        self.momenta.clear();
        self.wrenches_hold = false;
    }

    /// One step; `drift` gives the body-frame rotation of body i by its body-frame angular momentum.
    #[inline(always)]
    pub(crate) fn step(
        &mut self,
        system: &S,
        t: f64,
        x: &StateOf<S>,
        h: f64,
        out: &mut StateOf<S>,
        drift: impl Fn(usize, &Vector3<f64>) -> Result<UnitQuaternion<f64>, StepError>,
    ) -> Result<(), StepError> {
        let free = system.is_free();
        if !free && !self.wrenches_hold {
            system.wrenches(t, x, &mut self.wrenches);
        }
        for i in 0..x.configuration.count() {
            let (body, pose) = (system.body(i), x.configuration.pose(i));
            let twist = S::Configuration::twist(&x.rate, i);
            if self.momenta.len() <= i {
                self.momenta.push(angular_momentum(body, &pose, &twist.angular));
            }
            let wrench = S::Configuration::twist(&self.wrenches, i);
            let half_way = self.momenta[i] + wrench.angular * (0.5 * h);
            let rotation = drift(i, &pose.orientation.inverse_transform_vector(&half_way))?;
            let a = wrench.linear / body.mass();
            let next = Pose {
                position: pose.position + (twist.linear + a * (0.5 * h)) * h,
                orientation: pose.orientation * rotation,
            };
            out.configuration.set_pose(i, next);
            // Where wrenches depend on the rates, this prediction of them is good enough for order 2.
            let momentum = self.momenta[i] + wrench.angular * h;
            let angular = angular_velocity(body, &next, &momentum);
            S::Configuration::set_twist(&mut out.rate, i, Twist { linear: twist.linear + a * h, angular });
        }
        let ahead: &[_] = if free { &[] } else { &[(h, &self.wrenches)] };
        advance::<S::Configuration>(&x.rate, ahead, &mut out.rate);
        if free {
            return Ok(());
        }
        system.wrenches(t + h, out, &mut self.wrenches_ahead);
        for i in 0..x.configuration.count() {
            let (body, pose) = (system.body(i), out.configuration.pose(i));
            let before = S::Configuration::twist(&self.wrenches, i);
            let ahead = S::Configuration::twist(&self.wrenches_ahead, i);
            self.momenta[i] += (before.angular + ahead.angular) * (0.5 * h);
            let rate = Twist {
                linear: S::Configuration::twist(&x.rate, i).linear
                    + (before.linear + ahead.linear) * (0.5 * h / body.mass()),
                angular: angular_velocity(body, &pose, &self.momenta[i]),
            };
            S::Configuration::set_twist(&mut out.rate, i, rate);
        }
        let slopes = [(0.5 * h, &self.wrenches), (0.5 * h, &self.wrenches_ahead)];
        advance::<S::Configuration>(&x.rate, &slopes, &mut out.rate);
        std::mem::swap(&mut self.wrenches, &mut self.wrenches_ahead);
        self.wrenches_hold = !system.depends_on_velocity();
        Ok(())
    }
}
