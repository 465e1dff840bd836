//! Centroidal momentum (Orin, Goswami and Lee, *Centroidal dynamics of a humanoid robot*, Autonomous
//! Robots 35, 2013): A(q) v is the momentum of the whole tree about its centre of mass, world axes.
//!
//! Column k of A is I^C_k J_k with its moment taken about the centre of mass.

use crate::data::Data;
use crate::error::DynamicsError;
use crate::model::Model;
use crate::spatial::Force;
use nalgebra::{DMatrix, Vector3};
use somersault_core::Scalar;
use somersault_core::argument::expect_length;

/// The momentum matrix at one configuration, with the centre of mass.
#[derive(Debug, Clone, Copy)]
pub struct Centroidal<'a, T: Scalar = f64> {
    /// A, 6 × [`n_velocities`](Model::n_velocities): linear rows, then angular rows.
    pub matrix: &'a DMatrix<T>,
    /// Centre of mass in the world, m.
    pub center_of_mass: Vector3<T>,
}

impl<T: Scalar> Centroidal<'_, T> {
    /// A v: linear momentum (kg m/s) and angular momentum about the centre of mass (kg m²/s), world axes.
    pub fn momentum(&self, v: &[T]) -> Result<Force<T>, DynamicsError> {
        expect_length("v", v.len(), self.matrix.ncols())?;
        let mut sum = Force::zero();
        for (column, &rate) in self.matrix.column_iter().zip(v) {
            sum.linear += column.fixed_rows::<3>(0) * rate;
            sum.angular += column.fixed_rows::<3>(3) * rate;
        }
        Ok(sum)
    }
}

impl<T: Scalar> Model<T> {
    /// The centroidal momentum matrix. Cost O(n).
    pub fn centroidal<'d>(&self, data: &'d mut Data<T>, q: &[T]) -> Result<Centroidal<'d, T>, DynamicsError> {
        data.expect_for(self)?;
        expect_length("q", q.len(), self.n_positions())?;
        let Data { tree, room, .. } = data;
        self.place(tree, self.spread_positions(q, &mut room.q));
        self.gather_composites(tree);
        let whole = &tree.nodes[0].composite;
        let center = whole.first_moment / whole.mass;
        for (k, momentum) in tree.momenta.iter().enumerate() {
            let about_center = momentum.about(&center);
            tree.momentum_matrix.fixed_view_mut::<3, 1>(0, k).copy_from(&about_center.linear);
            tree.momentum_matrix.fixed_view_mut::<3, 1>(3, k).copy_from(&about_center.angular);
        }
        let matrix = self.gather_columns(&tree.momentum_matrix, &mut room.momentum_matrix);
        Ok(Centroidal { matrix, center_of_mass: tree.origin + center })
    }
}
