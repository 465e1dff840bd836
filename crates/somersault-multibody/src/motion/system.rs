//! The equations of motion of a tree as a system for the integrators.

use super::{
    BodyWrenches, Coordinates, Driven, Failure, JointDrive, Rates, TreeForces, TreeState, TreeWorkspace,
};
use crate::articulated::Split;
use crate::error::DynamicsError;
use crate::model::Model;
use crate::spatial::Force;
use somersault_core::argument::expect_length;
use somersault_integrators::partials::Partials;
use somersault_integrators::system::{Fault, OneForm, System};

/// A tree under forces, with joints that may be driven.
#[derive(Debug)]
pub struct TreeSystem<'m, F = (), D = ()> {
    model: &'m Model,
    forces: F,
    drive: D,
    failure: Failure,
}

/// Velocities, accelerations and forces of the joints in one state.
#[derive(Debug, Clone, Copy)]
pub struct TreeDynamics<'a> {
    /// v.
    pub velocity: &'a [f64],
    /// v̇.
    pub acceleration: &'a [f64],
    /// τ: as given for passive degrees of freedom, as needed for active ones.
    pub torque: &'a [f64],
}

impl<'m, F: TreeForces> TreeSystem<'m, F> {
    /// The tree under forces.
    pub fn new(model: &'m Model, forces: F) -> Self {
        Self { model, forces, drive: (), failure: Failure::default() }
    }

    /// Lets the active degrees of freedom of `split` follow accelerations, see [`Driven`].
    pub fn driven<P: Fn(f64, &[f64], &[f64], &mut [f64])>(
        self,
        split: Split,
        motion: P,
    ) -> Result<TreeSystem<'m, F, Driven<P>>, DynamicsError> {
        expect_length("split", split.active().len(), self.model.n_velocities())?;
        let drive = Driven { split, motion };
        Ok(TreeSystem { model: self.model, forces: self.forces, drive, failure: Failure::default() })
    }
}

impl<F: TreeForces, D: JointDrive> TreeSystem<'_, F, D> {
    /// The tree.
    pub fn model(&self) -> &Model {
        self.model
    }

    /// The forces.
    pub fn forces(&self) -> &F {
        &self.forces
    }

    /// What drives joints.
    pub(super) fn drive(&self) -> &D {
        &self.drive
    }

    /// Which degrees of freedom follow prescribed accelerations: [`JointDrive::split`].
    pub fn split(&self) -> Option<&Split> {
        self.drive.split()
    }

    /// Whether some joints follow prescribed accelerations.
    pub fn is_driven(&self) -> bool {
        self.drive.is_active()
    }

    /// Joint velocities, accelerations and forces in state `x` at time `t`.
    pub fn dynamics<'w>(
        &self,
        w: &'w mut TreeWorkspace,
        t: f64,
        x: &TreeState,
    ) -> Result<TreeDynamics<'w>, DynamicsError> {
        self.dynamics_under(w, t, (&x.configuration, &x.rate), None)
    }

    /// The same of a state in its two parts, under wrenches besides those of the forces, in a workspace with
    /// [room for them](Self::workspace_for_wrenches).
    pub fn dynamics_under<'w>(
        &self,
        w: &'w mut TreeWorkspace,
        t: f64,
        (q, p): (&Coordinates, &Rates),
        besides: Option<&dyn BodyWrenches>,
    ) -> Result<TreeDynamics<'w>, DynamicsError> {
        self.model.joint_velocities_at((q, p), &mut w.v)?;
        let q = q.as_slice();
        w.torque.fill(0.0);
        self.forces.add_torque(t, q, &w.v, &mut w.torque);
        w.wrenches.fill(Force::zero());
        if self.forces.wrenches().is_some() || besides.is_some() {
            let bodies = self.model.velocities(&mut w.data, q, &w.v)?;
            for wrenches in self.forces.wrenches().into_iter().chain(besides) {
                wrenches.add_wrenches(t, &bodies, &mut w.wrenches);
            }
        }
        self.drive.solve(self.model, t, q, w)?;
        Ok(TreeDynamics { velocity: &w.v, acceleration: &w.acceleration, torque: &w.torque })
    }

    /// The acceleration of [`System`] under wrenches besides those of the forces, as
    /// [`dynamics_under`](Self::dynamics_under).
    pub fn acceleration_under(
        &self,
        w: &mut TreeWorkspace,
        t: f64,
        (q, p): (&Coordinates, &Rates),
        besides: Option<&dyn BodyWrenches>,
        out: &mut Rates,
    ) {
        match self.failure.keep(self.dynamics_under(w, t, (q, p), besides).map(|_| ())) {
            Some(()) => self.model.second_rates(q.as_slice(), &w.v, &w.acceleration, out.as_mut_slice()),
            None => out.as_mut_slice().fill(f64::NAN),
        }
    }

    /// What there is, unless the equations have no value, whose reason is kept for the run.
    pub(super) fn keep<T>(&self, result: Result<T, DynamicsError>) -> Option<T> {
        self.failure.keep(result)
    }

    /// A workspace with room for wrenches, whatever the forces are.
    pub fn workspace_for_wrenches(&self) -> TreeWorkspace {
        TreeWorkspace::new(self.model, true)
    }

    /// The potential of the forces for positions `q`, J, where neither they nor the drive give the tree energy that is not
    /// taken from it; see [`TreeForces::potential`].
    pub fn potential(&self, q: &[f64]) -> Option<f64> {
        if self.is_driven() { None } else { self.forces.potential(q) }
    }
}

impl<F: TreeForces, D: JointDrive> System for TreeSystem<'_, F, D> {
    type Configuration = Coordinates;
    type Forms = OneForm;
    type Workspace = TreeWorkspace;

    fn workspace(&self) -> TreeWorkspace {
        TreeWorkspace::new(self.model, self.forces.wrenches().is_some())
    }

    fn acceleration(&self, w: &mut TreeWorkspace, t: f64, x: &TreeState, out: &mut Rates) {
        self.acceleration_under(w, t, (&x.configuration, &x.rate), None, out);
    }

    /// Analytic, but for forces other than the weight and the damping of joints, and accelerations of driven joints; by differences
    /// where joints are driven otherwise.
    fn partials(&self, w: &mut TreeWorkspace, t: f64, x: &TreeState, out: &mut Partials<Coordinates>) {
        if self.is_driven() && self.drive.split().is_none() {
            return out.by_differences(x, |x, acceleration| self.acceleration(w, t, x, acceleration));
        }
        let mut variation = w.variation.take().unwrap_or_else(|| Box::new(self.variation()));
        let found = self.keep(self.dynamics(w, t, x).map(|_| ()));
        if found.is_some() && self.linearize(w, &mut variation, &x.configuration) {
            let q = &x.configuration;
            out.by_columns(|tangent, change| {
                self.vary(&mut variation, t, q, tangent);
                self.acceleration_change(&mut variation, q, change);
            });
        } else {
            out.matrices_mut().into_iter().for_each(|matrix| matrix.fill(f64::NAN));
        }
        w.variation = Some(variation);
    }

    fn next_stop(&self, t: f64, end: f64) -> Option<f64> {
        self.forces.next_stop(t, end)
    }

    fn take_fault(&self) -> Option<Fault> {
        self.failure.take()
    }
}
