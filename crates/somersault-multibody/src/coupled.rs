//! Forward and hybrid dynamics where joints follow others: articulated inertias end at a coupling between branches.

use crate::articulated::Roles;
use crate::data::{Data, Room};
use crate::derivatives::elimination::factorize;
use crate::error::DynamicsError;
use crate::model::Model;
use crate::spatial::Force;
use somersault_core::Scalar;

impl<T: Scalar> Model<T> {
    /// Accelerations of the passive degrees of freedom where joints follow others: with M sorted into passive and
    /// active ones
    ///
    /// M_pp a_p = τ_p − h_p − M_pa a_a,
    ///
    /// by inverse dynamics, the mass matrix and its sparse factors. Cost O(n² × depth).
    pub(crate) fn coupled_accelerations(
        &self,
        roles: &impl Roles,
        data: &mut Data<T>,
        q: &[T],
        v: &[T],
        acceleration: &mut [T],
        torque: &[T],
        wrenches: &[Force<T>],
    ) -> Result<(), DynamicsError> {
        let n = acceleration.len();
        let passive = |k: &usize| !roles.is_active(*k);
        for k in (0..n).filter(passive) {
            acceleration[k] = T::zero();
        }
        self.inverse_dynamics(data, q, v, acceleration, wrenches)?;
        self.mass_matrix(data, q)?;
        let Room { torque: held, mass_matrix, residual, above, factor, .. } = &mut data.room;
        factorize(self, roles, mass_matrix.as_slice(), above, factor.as_mut_slice())?;
        // M_pp = LᵀL; row k of L starts at its diagonal and goes the way to the root
        let factor = factor.as_slice();
        let way = |k: usize| std::iter::successors(above[k], |&j| above[j]).zip(&factor[k * n + 1..]);
        for k in (0..n).filter(passive) {
            residual[k] = torque[k] - held[k];
        }
        for k in (0..n).rev().filter(passive) {
            let known = residual[k] / factor[k * n];
            residual[k] = known;
            for (j, &entry) in way(k) {
                residual[j] -= entry * known;
            }
        }
        for k in (0..n).filter(passive) {
            let known = way(k).fold(residual[k], |rest, (j, &entry)| rest - entry * acceleration[j]);
            acceleration[k] = known / factor[k * n];
        }
        Ok(())
    }
}
