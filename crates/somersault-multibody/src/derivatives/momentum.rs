//! Derivatives of the centre of mass and of the centroidal momentum.
//!
//! A motion of joint i along k turns the momentum h^C of what is further out and changes it by its
//! velocity: δh = S_k ×* h^C_i + I^C_i ψ̇_k, about the fixed origin. The centre of mass c moves by the linear
//! part of I^C_i S_k over the mass, and the angular momentum about it by δ(n − c × l) = δn − δc × l − c × δl.

use super::{DerivativeData, DerivativeTables};
use crate::data::Data;
use crate::error::DynamicsError;
use crate::model::Model;
use crate::spatial::{Force, Motion};
use nalgebra::{DMatrix, Vector3};
use somersault_core::Scalar;

/// Centre of mass and centroidal momentum with their partials, world axes.
#[derive(Debug, Clone, Copy)]
pub struct MomentumPartials<'a, T: Scalar = f64> {
    /// Centre of mass in the world, m.
    pub center_of_mass: Vector3<T>,
    /// Its Jacobian, 3 × [`n_velocities`](Model::n_velocities): partials along q ⊕ ε e_k.
    pub center_of_mass_q: &'a DMatrix<T>,
    /// Linear momentum (kg m/s), and angular momentum about the centre of mass (kg m²/s).
    pub momentum: Force<T>,
    /// Partials of the momentum along q ⊕ ε e_k, 6 × [`n_velocities`](Model::n_velocities), linear rows
    /// first.
    pub q: &'a DMatrix<T>,
    /// Partials of the momentum with respect to v: the centroidal momentum matrix.
    pub v: &'a DMatrix<T>,
}

impl<T: Scalar> Model<T> {
    /// The centre of mass, the centroidal momentum and their partials. Cost O(n).
    pub fn momentum_partials<'d>(
        &self,
        work: &'d mut DerivativeData<T>,
        q: &[T],
        v: &[T],
    ) -> Result<MomentumPartials<'d, T>, DynamicsError> {
        self.expect_state(&work.data, q, v)?;
        let centroidal = self.centroidal(&mut work.data, q)?;
        let (center_of_mass, momentum) = (centroidal.center_of_mass, centroidal.momentum(v)?);
        let DerivativeData { data, tables: DerivativeTables { bodies, .. }, center, momentum: by_q, .. } =
            work;
        let Data { tree: data, room, .. } = data;
        let v = self.spread(v, &mut room.v);
        let whole = data.nodes[0].composite;
        let middle = whole.first_moment / whole.mass;
        for (i, body) in self.bodies.iter().enumerate() {
            let mut velocity = body.parent.map_or(Motion::zero(), |p| bodies[p].velocity);
            for k in body.dofs.clone() {
                velocity += data.columns[k] * v[k];
            }
            bodies[i].velocity = velocity;
            bodies[i].force = body.inertia.seen_from(&data.nodes[i].pose).times(&velocity);
        }
        for (i, body) in self.bodies.iter().enumerate().rev() {
            let carried = bodies[i].force;
            let outer_velocity = body.parent.map_or(Motion::zero(), |p| bodies[p].velocity);
            for k in body.dofs.clone() {
                let column = &data.columns[k];
                let first = outer_velocity.cross(column);
                let change = column.cross_force(&carried) + data.nodes[i].composite.times(&first);
                let shift = data.momenta[k].linear / whole.mass;
                let angular = change.about(&middle).angular - shift.cross(&momentum.linear);
                center.fixed_view_mut::<3, 1>(0, k).copy_from(&shift);
                by_q.fixed_view_mut::<3, 1>(0, k).copy_from(&change.linear);
                by_q.fixed_view_mut::<3, 1>(3, k).copy_from(&angular);
            }
            if let Some(parent) = body.parent {
                bodies[parent].force += carried;
            }
        }
        Ok(MomentumPartials {
            center_of_mass,
            center_of_mass_q: self.gather_columns(center, &mut work.gathered_center),
            momentum,
            q: self.gather_columns(by_q, &mut work.gathered_momentum),
            v: self.gather_columns(&data.momentum_matrix, &mut room.momentum_matrix),
        })
    }
}
