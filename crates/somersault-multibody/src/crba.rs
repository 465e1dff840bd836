//! The mass matrix: the composite-rigid-body algorithm (Featherstone 2008, section 6.2), in one frame for all,
//! where composite inertias are sums and motion subspaces need no transforms. It is that of the root body,
//! in which the root's own motion subspace is pure and where the root is does not matter.
//!
//! M_jk = J_jᵀ I^C_k J_k for j on the way from k to the root, zero across branches. Cost O(n d) for
//! depth d.

use crate::data::{Data, TreeData};
use crate::error::DynamicsError;
use crate::model::Model;
use crate::spatial::Transform;
use nalgebra::DMatrix;
use somersault_core::argument::expect_length;
use somersault_core::scalar::{Lift, Scalar};

impl<T: Scalar> Model<T> {
    /// M(q), symmetric, [`n_velocities`](Self::n_velocities) squared.
    pub fn mass_matrix<'d>(&self, data: &'d mut Data<T>, q: &[T]) -> Result<&'d DMatrix<T>, DynamicsError> {
        data.expect_for(self)?;
        expect_length("q", q.len(), self.n_positions())?;
        let Data { tree, room, .. } = data;
        self.compose_mass_matrix((), tree, self.spread_positions(q, &mut room.q));
        Ok(self.gather_square(&tree.mass_matrix, &mut room.mass_matrix))
    }

    /// The mass matrix of the tree, in its place in the workspace.
    #[inline(always)]
    pub(crate) fn compose_mass_matrix<N: Lift<T>>(&self, proof: N::Proof, tree: &mut TreeData<N>, q: &[N]) {
        self.place_from_in(proof, tree, q, Transform::identity().lift(proof));
        self.gather_composites_in(proof, tree);
        let (n, root) = (self.directions.len(), self.bodies[0].dofs.end);
        let entries = tree.mass_matrix.as_mut_slice();
        for (k, momentum) in tree.momenta.iter().enumerate() {
            for (j, direction) in self.directions[..root.min(k + 1)].iter().enumerate() {
                let entry = direction.lift(proof).dot(momentum);
                entries[k * n + j] = entry;
                entries[j * n + k] = entry;
            }
            let mut ancestor = Some(k);
            while let Some(j) = ancestor.filter(|&j| j >= root) {
                let entry = tree.columns[j].dot(momentum);
                entries[k * n + j] = entry;
                entries[j * n + k] = entry;
                ancestor = self.dof_parent[j];
            }
        }
    }

    /// Composite inertias, and their products with the motion subspaces; poses must be up to date.
    pub(crate) fn gather_composites(&self, data: &mut TreeData<T>) {
        self.gather_composites_in((), data);
    }

    /// The same in other arithmetic.
    #[inline(always)]
    fn gather_composites_in<N: Lift<T>>(&self, proof: N::Proof, data: &mut TreeData<N>) {
        for (body, node) in self.bodies.iter().zip(&mut data.nodes) {
            node.composite = body.inertia.seen_from_in(proof, &node.pose);
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
