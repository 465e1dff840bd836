//! What acts on the joints and bodies of a tree, and which joints are driven.

use super::TreeWorkspace;
use crate::articulated::Split;
use crate::error::DynamicsError;
use crate::kinematics::Velocities;
use crate::model::Model;
use crate::spatial::Force;
use somersault_core::interval::nearest;

/// Joint forces and wrenches on a tree.
///
/// `()` stands for no forces, a pair of models their sum, and a closure
/// `Fn(f64, &[f64], &[f64], &mut [f64])` that adds joint forces for (t, q, v) is a model.
pub trait TreeForces {
    /// Adds joint forces, dual to v, at time `t` for positions `q` and velocities `v`.
    fn add_torque(&self, t: f64, q: &[f64], v: &[f64], torque: &mut [f64]);

    /// Wrenches on the bodies besides, if there are any; those of a closure and of `()` are none.
    fn wrenches(&self) -> Option<&dyn BodyWrenches> {
        None
    }

    /// Whether the forces depend on positions or velocities, which is the default; forces that depend on time alone are not
    /// differentiated by the state.
    fn depends_on_state(&self) -> bool {
        true
    }

    /// The first time on the way from `t` to `end`, which may be earlier, at which the forces are not smooth in time; by default `None`: they
    /// are smooth in between. Adapted steps end at that time, and so do all steps of runs that locate events.
    fn next_stop(&self, _t: f64, _end: f64) -> Option<f64> {
        None
    }

    /// The potential of the forces for positions `q`, J, where they give the tree no energy that is not taken from it;
    /// never negative. `None`, as by default, where they may give energy, or nothing is known.
    fn potential(&self, _q: &[f64]) -> Option<f64> {
        None
    }
}

/// Wrenches on the bodies of a tree.
pub trait BodyWrenches {
    /// Adds a wrench on every body at time `t`, in body axes about the body's origin; `bodies` has their poses and
    /// velocities.
    fn add_wrenches(&self, t: f64, bodies: &Velocities<'_>, wrenches: &mut [Force<f64>]);
}

impl TreeForces for () {
    fn add_torque(&self, _: f64, _: &[f64], _: &[f64], _: &mut [f64]) {}
    fn depends_on_state(&self) -> bool {
        false
    }
    fn potential(&self, _: &[f64]) -> Option<f64> {
        Some(0.0)
    }
}

impl<F: Fn(f64, &[f64], &[f64], &mut [f64])> TreeForces for F {
    #[inline]
    fn add_torque(&self, t: f64, q: &[f64], v: &[f64], torque: &mut [f64]) {
        self(t, q, v, torque);
    }
}

#[deny(clippy::missing_trait_methods)]
impl<A: TreeForces, B: TreeForces> TreeForces for (A, B) {
    fn add_torque(&self, t: f64, q: &[f64], v: &[f64], torque: &mut [f64]) {
        self.0.add_torque(t, q, v, torque);
        self.1.add_torque(t, q, v, torque);
    }
    fn wrenches(&self) -> Option<&dyn BodyWrenches> {
        (self.0.wrenches().is_some() || self.1.wrenches().is_some()).then_some(self)
    }
    fn depends_on_state(&self) -> bool {
        self.0.depends_on_state() || self.1.depends_on_state()
    }
    fn next_stop(&self, t: f64, end: f64) -> Option<f64> {
        nearest(t, [self.0.next_stop(t, end), self.1.next_stop(t, end)])
    }
    fn potential(&self, q: &[f64]) -> Option<f64> {
        Some(self.0.potential(q)? + self.1.potential(q)?)
    }
}

impl<A: TreeForces, B: TreeForces> BodyWrenches for (A, B) {
    fn add_wrenches(&self, t: f64, bodies: &Velocities<'_>, wrenches: &mut [Force<f64>]) {
        for model in self.0.wrenches().into_iter().chain(self.1.wrenches()) {
            model.add_wrenches(t, bodies, wrenches);
        }
    }
}

#[deny(clippy::missing_trait_methods)]
impl TreeForces for Box<dyn TreeForces + Send + Sync> {
    fn add_torque(&self, t: f64, q: &[f64], v: &[f64], torque: &mut [f64]) {
        (**self).add_torque(t, q, v, torque);
    }
    fn wrenches(&self) -> Option<&dyn BodyWrenches> {
        (**self).wrenches()
    }
    fn depends_on_state(&self) -> bool {
        (**self).depends_on_state()
    }
    fn next_stop(&self, t: f64, end: f64) -> Option<f64> {
        (**self).next_stop(t, end)
    }
    fn potential(&self, q: &[f64]) -> Option<f64> {
        (**self).potential(q)
    }
}

/// How the joints are moved: `()` by forces alone, [`Driven`] partly by prescribed accelerations.
pub trait JointDrive {
    /// Completes accelerations and joint forces in the workspace, which has v, the joint forces given
    /// and the wrenches.
    fn solve(&self, model: &Model, t: f64, q: &[f64], w: &mut TreeWorkspace) -> Result<(), DynamicsError>;

    /// Whether it may give the tree energy.
    fn is_active(&self) -> bool {
        true
    }

    /// Which degrees of freedom follow the accelerations that [`accelerations`](Self::accelerations) writes; derivatives of the motion are
    /// then those of [`hybrid_dynamics`](Model::hybrid_dynamics). `None`, the default, for a drive of another kind or without effect.
    fn split(&self) -> Option<&Split> {
        None
    }

    /// Writes the accelerations of those degrees of freedom for (t, q, v); the other entries are ignored.
    fn accelerations(&self, _t: f64, _q: &[f64], _v: &[f64], _out: &mut [f64]) {}
}

impl JointDrive for () {
    #[inline]
    fn solve(&self, model: &Model, _: f64, q: &[f64], w: &mut TreeWorkspace) -> Result<(), DynamicsError> {
        let found = model.forward_dynamics(&mut w.data, q, &w.v, &w.torque, &w.wrenches)?;
        w.acceleration.copy_from_slice(found);
        Ok(())
    }
    fn is_active(&self) -> bool {
        false
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
        let TreeWorkspace { data, v, torque, wrenches, acceleration, .. } = w;
        (self.motion)(t, q, v, acceleration);
        model.hybrid_dynamics(data, &self.split, q, v, acceleration, torque, wrenches)
    }
    fn is_active(&self) -> bool {
        self.split.active().iter().any(|active| *active)
    }
    fn split(&self) -> Option<&Split> {
        self.is_active().then_some(&self.split)
    }
    fn accelerations(&self, t: f64, q: &[f64], v: &[f64], out: &mut [f64]) {
        (self.motion)(t, q, v, out);
    }
}
