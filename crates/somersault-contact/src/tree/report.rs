//! What contacts do in a state: forces, velocities, Jacobians, energies.

use super::system::{TouchingState, TreeInContact};
use crate::encounters::{ContactState, contact_states};
use crate::error::ContactError;
use nalgebra::DMatrix;
use somersault_multibody::motion::{JointDrive, TreeForces};

/// The energy of a tree in contact, J.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ledger {
    /// Kinetic energy.
    pub kinetic: f64,
    /// Potential energy of the weight, zero at the world's origin.
    pub potential: f64,
    /// Energy of the springs of contacts and their friction.
    pub elastic: f64,
    /// The potential of the forces; NaN where they may give energy.
    pub forces: f64,
}

impl Ledger {
    /// The sum. What it falls short of the sum at the start is dissipated.
    pub fn total(&self) -> f64 {
        self.kinetic + self.potential + self.elastic + self.forces
    }
}

impl<F: TreeForces, D: JointDrive> TreeInContact<'_, F, D> {
    /// What every contact does in a state, each in the mode that the state has it in.
    pub fn touches(&self, x: &TouchingState) -> Vec<ContactState> {
        contact_states(self, (&x.configuration, &x.rate))
    }

    /// The Jacobian of contact `i`, 3 × [`n_velocities`](somersault_multibody::Model::n_velocities): with the velocities of the
    /// joints it gives that of the link at the point of contact, relative to that of the second link of a pair, world axes.
    pub fn contact_jacobian(&self, i: usize, x: &TouchingState) -> Result<DMatrix<f64>, ContactError> {
        self.contacts().part(i)?;
        let at = (&x.configuration.0, &x.rate.base);
        match self.seen(at, |bodies| self.relative_jacobian(i, bodies)) {
            Some(found) => Ok(found?.rows(0, 3).into_owned()),
            None => Ok(DMatrix::from_element(3, self.model().n_velocities(), f64::NAN)),
        }
    }

    /// The energies of a state.
    pub fn ledger(&self, x: &TouchingState) -> Ledger {
        let forces = self.tree().potential(x.configuration.0.as_slice()).unwrap_or(f64::NAN);
        let found = self.seen((&x.configuration.0, &x.rate.base), |bodies| Ledger {
            kinetic: bodies.kinetic_energy(),
            potential: bodies.positions().potential_energy(),
            elastic: self.springs(bodies, &x.rate.variables),
            forces,
        });
        let none = f64::NAN;
        found.unwrap_or(Ledger { kinetic: none, potential: none, elastic: none, forces: none })
    }
}
