//! The equations of motion of a tree as a system for the integrators.

use super::{Coordinates, Driven, Failure, JointDrive, Rates, TreeForces, TreeState, TreeWorkspace};
use crate::articulated::Split;
use crate::error::DynamicsError;
use crate::model::Model;
use crate::spatial::Force;
use somersault_core::argument::expect_length;
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

    /// Joint velocities, accelerations and forces in state `x` at time `t`.
    pub fn dynamics<'w>(
        &self,
        w: &'w mut TreeWorkspace,
        t: f64,
        x: &TreeState,
    ) -> Result<TreeDynamics<'w>, DynamicsError> {
        let q = x.configuration.as_slice();
        self.model.joint_velocities(x, &mut w.v)?;
        w.torque.fill(0.0);
        self.forces.add_torque(t, q, &w.v, &mut w.torque);
        if let Some(model) = self.forces.wrenches() {
            w.wrenches.fill(Force::zero());
            let bodies = self.model.velocities(&mut w.data, q, &w.v)?;
            model.add_wrenches(t, &bodies, &mut w.wrenches);
        }
        self.drive.solve(self.model, t, q, w)?;
        Ok(TreeDynamics { velocity: &w.v, acceleration: &w.acceleration, torque: &w.torque })
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
        match self.failure.keep(self.dynamics(w, t, x).map(|_| ())) {
            Some(()) => {
                let q = x.configuration.as_slice();
                self.model.second_rates(q, &w.v, &w.acceleration, out.as_mut_slice());
            }
            None => out.as_mut_slice().fill(f64::NAN),
        }
    }

    fn take_fault(&self) -> Option<Fault> {
        self.failure.take()
    }
}
