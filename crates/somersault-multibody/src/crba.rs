//! The mass matrix: the composite-rigid-body algorithm (Featherstone 2008, section 6.2), in the common
//! frame, where composite inertias are sums and motion subspaces need no transforms.
//!
//! M_jk = J_jᵀ I^C_k J_k for j on the way from k to the root, zero across branches. Cost O(n d) for
//! depth d.

use crate::data::Data;
use crate::error::{DynamicsError, expect_length};
use crate::model::Model;
use crate::scalar::Scalar;
use nalgebra::DMatrix;

impl<T: Scalar> Model<T> {
    /// M(q), symmetric, [`n_velocities`](Self::n_velocities) squared.
    pub fn mass_matrix<'d>(&self, data: &'d mut Data<T>, q: &[T]) -> Result<&'d DMatrix<T>, DynamicsError> {
        data.expect_for(self)?;
        expect_length("q", q, self.n_positions())?;
        self.place(data, q);
        self.gather_composites(data);
        let n = self.n_velocities();
        let entries = data.mass_matrix.as_mut_slice();
        for (k, momentum) in data.momenta.iter().enumerate() {
            let mut ancestor = Some(k);
            while let Some(j) = ancestor {
                let entry = data.columns[j].dot(momentum);
                entries[k * n + j] = entry;
                entries[j * n + k] = entry;
                ancestor = self.dof_parent[j];
            }
        }
        Ok(&data.mass_matrix)
    }

    /// Composite inertias, and their products with the motion subspaces; poses must be up to date.
    pub(crate) fn gather_composites(&self, data: &mut Data<T>) {
        for (body, node) in self.bodies.iter().zip(&mut data.nodes) {
            node.composite = body.inertia.seen_from(&node.pose);
        }
        for (i, body) in self.bodies.iter().enumerate().rev() {
            let composite = data.nodes[i].composite;
            for k in body.dofs.clone() {
                data.momenta[k] = composite.times(&data.columns[k]);
            }
            if let Some(parent) = body.parent {
                data.nodes[parent].composite += composite;
            }
        }
    }
}
