//! What contacts do in a state: forces, velocities, Jacobians, energies.

use super::system::{TouchingState, TreeInContact};
use crate::encounters::{ContactState, contact_states};
use crate::error::ContactError;
use crate::laws::{ContactLaw, Encounter};
use nalgebra::{DMatrix, Vector3};
use somersault_integrators::force::Wrench;
use somersault_multibody::Data;
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

/// The momentum of a tree in contact, world frame, and what changes it.
///
/// If the joints to the world are free and no other forces act on links, the rate of `linear` is `weight + force` and that of `angular` is
/// `moment`. Other joints to the world add their reactions.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MomentumLedger {
    /// Momentum, kg m/s.
    pub linear: Vector3<f64>,
    /// Angular momentum about the centre of mass, kg m²/s.
    pub angular: Vector3<f64>,
    /// Weight, N.
    pub weight: Vector3<f64>,
    /// Sum of the forces of contacts with surfaces that stand in the world, N.
    pub force: Vector3<f64>,
    /// Moment of these contacts about the centre of mass, N m.
    pub moment: Vector3<f64>,
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

    /// The joint forces that accelerate the tree by `a` in a state, by inverse dynamics: M(q) a + C(q, v) v + g(q) − Σ Jᵢᵀ Fᵢ. The forces
    /// of the contacts are those of their laws in the state, or `measured`: one for each contact, N, world frame, at the points of
    /// contact. Wrenches of the forces on links at time t act besides.
    pub fn inverse_dynamics(
        &self,
        t: f64,
        x: &TouchingState,
        a: &[f64],
        measured: Option<&[Vector3<f64>]>,
    ) -> Result<Vec<f64>, ContactError> {
        let contacts = self.contacts().len();
        if let Some(forces) = measured
            && (forces.len() != contacts || !forces.iter().flatten().all(|number| number.is_finite()))
        {
            let found = match forces.iter().find(|force| !force.iter().all(|number| number.is_finite())) {
                Some(force) => format!("{:?}", <[f64; 3]>::from(*force)),
                None => format!("{} forces", forces.len()),
            };
            return Err(ContactError::MeasuredForces { found, contacts });
        }
        let (q, stretches) = (&x.configuration.0, &x.rate.variables);
        let mut v = vec![0.0; self.model().n_velocities()];
        self.model().joint_velocities_at((q, &x.rate.base), &mut v)?;
        let effort = |i: usize, law: &ContactLaw, at: &Encounter| match measured {
            Some(forces) => Wrench { force: forces[i], torque: Vector3::zeros() },
            None => law.effort_in(&law.mode(at, &stretches[i]), at, &stretches[i]),
        };
        Ok(self.forces_for(t, (q.as_slice(), &v, a), effort)?)
    }

    /// The momentum in a state, and what changes it.
    pub fn momentum(&self, x: &TouchingState) -> Result<MomentumLedger, ContactError> {
        let (model, q) = (self.model(), &x.configuration.0);
        let mut v = vec![0.0; model.n_velocities()];
        model.joint_velocities_at((q, &x.rate.base), &mut v)?;
        let mut data = Data::new(model);
        let centroidal = model.centroidal(&mut data, q.as_slice())?;
        let (center, momentum) = (centroidal.center_of_mass, centroidal.momentum(&v)?);
        let (mut force, mut moment) = (Vector3::zeros(), Vector3::zeros());
        for state in self.touches(x).iter().filter(|state| self.contacts().is_of_world(state.contact)) {
            force += state.force;
            moment += (state.point - center).cross(&state.force) + state.couple;
        }
        let weight = model.gravity() * model.mass();
        Ok(MomentumLedger { linear: momentum.linear, angular: momentum.angular, weight, force, moment })
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
