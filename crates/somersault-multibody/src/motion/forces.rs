//! What acts on the joints and bodies of a tree, and which joints are driven.

use super::TreeWorkspace;
use crate::articulated::Split;
use crate::error::DynamicsError;
use crate::kinematics::Velocities;
use crate::model::Model;
use crate::spatial::Force;

/// Joint forces and wrenches on a tree.
///
/// `()` is none, a pair of models their sum, and a closure
/// `Fn(f64, &[f64], &[f64], &mut [f64])` that adds joint forces for (t, q, v) is a model.
pub trait TreeForces {
    /// Adds joint forces, dual to v, at time `t` for positions `q` and velocities `v`.
    fn add_torque(&self, t: f64, q: &[f64], v: &[f64], torque: &mut [f64]);

    /// Whether there may be wrenches on bodies besides.
    fn has_wrenches(&self) -> bool {
        false
    }

    /// Adds a wrench on every body, in body axes about the body's origin; `bodies` has their poses and
    /// velocities.
    fn add_wrenches(&self, _t: f64, _bodies: &Velocities<'_>, _wrenches: &mut [Force<f64>]) {}
}

impl TreeForces for () {
    fn add_torque(&self, _: f64, _: &[f64], _: &[f64], _: &mut [f64]) {}
}

impl<F: Fn(f64, &[f64], &[f64], &mut [f64])> TreeForces for F {
    #[inline]
    fn add_torque(&self, t: f64, q: &[f64], v: &[f64], torque: &mut [f64]) {
        self(t, q, v, torque);
    }
}

impl<A: TreeForces, B: TreeForces> TreeForces for (A, B) {
    fn add_torque(&self, t: f64, q: &[f64], v: &[f64], torque: &mut [f64]) {
        self.0.add_torque(t, q, v, torque);
        self.1.add_torque(t, q, v, torque);
    }
    fn has_wrenches(&self) -> bool {
        self.0.has_wrenches() || self.1.has_wrenches()
    }
    fn add_wrenches(&self, t: f64, bodies: &Velocities<'_>, wrenches: &mut [Force<f64>]) {
        self.0.add_wrenches(t, bodies, wrenches);
        self.1.add_wrenches(t, bodies, wrenches);
    }
}

impl TreeForces for Box<dyn TreeForces + Send + Sync> {
    fn add_torque(&self, t: f64, q: &[f64], v: &[f64], torque: &mut [f64]) {
        (**self).add_torque(t, q, v, torque);
    }
    fn has_wrenches(&self) -> bool {
        (**self).has_wrenches()
    }
    fn add_wrenches(&self, t: f64, bodies: &Velocities<'_>, wrenches: &mut [Force<f64>]) {
        (**self).add_wrenches(t, bodies, wrenches);
    }
}

/// How the joints are moved: `()` by forces alone, [`Driven`] partly by prescribed accelerations.
pub trait JointDrive {
    /// Completes accelerations and joint forces in the workspace, which has v, the joint forces given
    /// and the wrenches.
    fn solve(&self, model: &Model, t: f64, q: &[f64], w: &mut TreeWorkspace) -> Result<(), DynamicsError>;
}

impl JointDrive for () {
    #[inline]
    fn solve(&self, model: &Model, _: f64, q: &[f64], w: &mut TreeWorkspace) -> Result<(), DynamicsError> {
        let found = model.forward_dynamics(&mut w.data, q, &w.v, &w.torque, &w.wrenches)?;
        w.acceleration.copy_from_slice(found);
        Ok(())
    }
}

/// Some degrees of freedom follow prescribed accelerations, by whatever joint forces that takes.
///
/// `motion` writes the accelerations of the active degrees of freedom for (t, q, v); what it writes to
/// the others is not read. Positions and velocities of the active ones are integrated like all others,
/// so that a start off the wanted motion stays off it unless `motion` corrects it.
#[derive(Debug, Clone)]
pub struct Driven<P> {
    /// Which degrees of freedom are active.
    pub split: Split,
    /// Their accelerations.
    pub motion: P,
}

impl<P: Fn(f64, &[f64], &[f64], &mut [f64])> JointDrive for Driven<P> {
    #[inline]
    fn solve(&self, model: &Model, t: f64, q: &[f64], w: &mut TreeWorkspace) -> Result<(), DynamicsError> {
        let TreeWorkspace { data, v, torque, wrenches, acceleration } = w;
        (self.motion)(t, q, v, acceleration);
        model.hybrid_dynamics(data, &self.split, q, v, acceleration, torque, wrenches)
    }
}
