//! Bodies without torque: the discrete Moser–Veselov map for the rotation, velocity Verlet for the
//! translation.

use crate::augmented::advance;
use crate::moser_veselov::{CompensatedVector, MoserVeselov};
use crate::preprocessing::{ModifiedMoments, Preprocessing};
use crate::state::{Pose, Poses, Twist};
use crate::stepper::{Scheme, StepError};
use crate::system::{RateOf, RigidSystem, StateOf};
use nalgebra::{Quaternion, UnitQuaternion, Vector3};

/// The rotations in progress and the wrenches at the start of the next step.
pub struct TorqueFreeMemory<S: RigidSystem> {
    rotations: Vec<FreeRotation>,
    wrenches: RateOf<S>,
    wrenches_ahead: RateOf<S>,
    /// Whether `wrenches` belong to the state the next step starts from.
    wrenches_hold: bool,
}

/// A free rotation in progress, in the principal frame.
struct FreeRotation {
    map: MoserVeselov,
    inverse_moments: Vector3<f64>,
    momentum: CompensatedVector,
    /// Angular momentum in the world frame, constant.
    world_momentum: Vector3<f64>,
}

impl FreeRotation {
    fn start(
        moments: &Vector3<f64>,
        principal: &UnitQuaternion<f64>,
        omega: &Vector3<f64>,
        h: f64,
        preprocessing: Option<Preprocessing>,
    ) -> Option<Self> {
        let momentum = moments.component_mul(&principal.inverse_transform_vector(omega));
        let map = match preprocessing {
            None => MoserVeselov::new(moments),
            Some(order) => {
                MoserVeselov::new(ModifiedMoments::try_new(moments, &momentum, h, order).ok()?.moments())
            }
        };
        Some(Self {
            map,
            inverse_moments: moments.map(f64::recip),
            momentum: CompensatedVector::new(momentum),
            world_momentum: principal * momentum,
        })
    }

    /// Moves the principal frame and returns it with the angular velocity in the world frame.
    #[inline]
    fn step<M: Scheme>(
        &mut self,
        t: f64,
        principal: &UnitQuaternion<f64>,
        h: f64,
    ) -> Result<(UnitQuaternion<f64>, Vector3<f64>), StepError> {
        let increment = self
            .map
            .increment(self.momentum.value(), h)
            .map_err(|e| e.of::<M>(t, h, self.inverse_moments.component_mul(self.momentum.value()).norm()))?;
        self.momentum.add(&increment.momentum_change);
        let turned = principal * increment.rotation;
        let r = turned.to_rotation_matrix().into_inner();
        let momentum = self.momentum.value();
        // The rounding of the orientation would walk away from R L = constant; turn it back.
        let gap = (r * momentum).cross(&self.world_momentum);
        let square = self.world_momentum.norm_squared();
        let half_gap = if square > 0.0 { gap * (0.5 / square) } else { Vector3::zeros() };
        let correction = Quaternion::from_parts(1.0, half_gap);
        let aligned = UnitQuaternion::new_unchecked(correction * turned.into_inner());
        Ok((aligned, r * self.inverse_moments.component_mul(momentum)))
    }
}

impl<S: RigidSystem> TorqueFreeMemory<S> {
    pub(crate) fn new<M: Scheme>(system: &S, x: &StateOf<S>) -> Result<Self, StepError> {
        if !system.is_torque_free() {
            return Err(StepError::Torque { method: M::INFO.name });
        }
        Ok(Self {
            rotations: Vec::with_capacity(x.configuration.count()),
            wrenches: x.rate.clone(),
            wrenches_ahead: x.rate.clone(),
            wrenches_hold: false,
        })
    }

    pub(crate) fn restart(&mut self) {
        self.rotations.clear();
        self.wrenches_hold = false;
    }

    pub(crate) fn step<M: Scheme>(
        &mut self,
        preprocessing: Option<Preprocessing>,
        system: &S,
        t: f64,
        x: &StateOf<S>,
        h: f64,
        out: &mut StateOf<S>,
    ) -> Result<(), StepError> {
        let free = system.is_free();
        if !free && !self.wrenches_hold {
            system.wrenches(t, x, &mut self.wrenches);
        }
        for i in 0..x.configuration.count() {
            let (pose, twist) = (x.configuration.pose(i), S::Configuration::twist(&x.rate, i));
            let inertia = system.body(i).inertia();
            let diagonal = inertia.is_diagonal();
            let axes = inertia.principal_axes();
            let principal = if diagonal { pose.orientation } else { pose.orientation * axes };
            if self.rotations.len() <= i {
                if preprocessing.is_some() {
                    // Beyond its limit the series is none, whatever the map makes of it.
                    M::check_angle(t, h, twist.angular.norm())?;
                }
                let moments = inertia.principal_moments();
                let started = FreeRotation::start(moments, &principal, &twist.angular, h, preprocessing);
                let method = M::INFO.name;
                self.rotations.push(started.ok_or(StepError::StepTooLarge { method, t, h })?);
            }
            let (turned, angular) = self.rotations[i].step::<M>(t, &principal, h)?;
            let a = self.acceleration(system, free, i);
            let next = Pose {
                position: pose.position + (twist.linear + a * (0.5 * h)) * h,
                orientation: if diagonal { turned } else { turned * axes.inverse() },
            };
            out.configuration.set_pose(i, next);
            // Where forces depend on the velocity, this prediction is good enough for order 2.
            S::Configuration::set_twist(&mut out.rate, i, Twist { linear: twist.linear + a * h, angular });
        }
        let ahead: &[_] = if free { &[] } else { &[(h, &self.wrenches)] };
        advance::<S::Configuration>(&x.rate, ahead, &mut out.rate);
        if free {
            return Ok(());
        }
        system.wrenches(t + h, out, &mut self.wrenches_ahead);
        for i in 0..x.configuration.count() {
            let before = self.acceleration(system, free, i);
            let ahead = S::Configuration::twist(&self.wrenches_ahead, i).linear / system.body(i).mass();
            let mut twist = S::Configuration::twist(&out.rate, i);
            twist.linear = S::Configuration::twist(&x.rate, i).linear + (before + ahead) * (0.5 * h);
            S::Configuration::set_twist(&mut out.rate, i, twist);
        }
        let slopes = [(0.5 * h, &self.wrenches), (0.5 * h, &self.wrenches_ahead)];
        advance::<S::Configuration>(&x.rate, &slopes, &mut out.rate);
        std::mem::swap(&mut self.wrenches, &mut self.wrenches_ahead);
        self.wrenches_hold = !system.depends_on_velocity();
        Ok(())
    }

    #[inline]
    fn acceleration(&self, system: &S, free: bool, i: usize) -> Vector3<f64> {
        if free {
            Vector3::zeros()
        } else {
            S::Configuration::twist(&self.wrenches, i).linear / system.body(i).mass()
        }
    }
}
