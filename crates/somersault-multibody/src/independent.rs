//! From independent coordinates to those of the tree and back, around the kernels; see [`coupling`](crate::coupling).

use crate::model::Model;
use crate::triples::{lifted, scaled, sum};
use nalgebra::{DMatrix, Vector3};
use somersault_core::Scalar;
use somersault_core::scalar::Lift;

/// From independent numbers to those of the tree and back. `room` is for the result, if there is a coupling.
impl<T: Scalar> Model<T> {
    /// q_t = G q + o.
    #[inline(always)]
    pub(crate) fn spread_positions<'a>(&self, q: &'a [T], room: &'a mut [T]) -> &'a [T] {
        self.spread_positions_in((), q, room)
    }

    /// The same in other arithmetic.
    #[inline(always)]
    pub(crate) fn spread_positions_in<'a, N: Lift<T>>(
        &self,
        proof: N::Proof,
        q: &'a [N],
        room: &'a mut [N],
    ) -> &'a [N] {
        let Some(coupling) = &self.coupling else { return q };
        for (out, row) in room.iter_mut().zip(&coupling.positions) {
            *out = q[row.at] * N::lift(proof, row.factor) + N::lift(proof, row.offset);
        }
        room
    }

    /// v_t = G v, for velocities and accelerations.
    #[inline(always)]
    pub(crate) fn spread<'a>(&self, v: &'a [T], room: &'a mut [T]) -> &'a [T] {
        self.spread_in((), v, room)
    }

    /// The same in other arithmetic.
    #[inline(always)]
    pub(crate) fn spread_in<'a, N: Lift<T>>(
        &self,
        proof: N::Proof,
        v: &'a [N],
        room: &'a mut [N],
    ) -> &'a [N] {
        let Some(coupling) = &self.coupling else { return v };
        for (out, row) in room.iter_mut().zip(&coupling.velocities) {
            *out = v[row.at] * N::lift(proof, row.factor);
        }
        room
    }

    /// τ = Gᵀ τ_t.
    #[inline(always)]
    pub(crate) fn gather<'a>(&self, tree: &'a [T], room: &'a mut [T]) -> &'a [T] {
        let Some(coupling) = &self.coupling else { return tree };
        room.fill(T::zero());
        for (row, x) in coupling.velocities.iter().zip(tree) {
            room[row.at] += *x * row.factor;
        }
        room
    }

    /// Of vectors, one for each degree of freedom from `first` on, in other arithmetic; followers come later.
    #[inline(always)]
    pub(crate) fn gather_vectors_in<'a, N: Lift<T>>(
        &self,
        proof: N::Proof,
        first: usize,
        tree: &'a [Vector3<N>],
        room: &'a mut [Vector3<N>],
    ) -> &'a [Vector3<N>] {
        let Some(coupling) = &self.coupling else { return tree };
        for out in room.iter_mut() {
            *out = lifted(proof, &Vector3::zeros());
        }
        for (row, x) in coupling.velocities[first..].iter().zip(tree) {
            let out = &mut room[row.at - first];
            *out = sum(out, &scaled(x, N::lift(proof, row.factor)));
        }
        room
    }

    /// A G, column by column.
    #[inline(always)]
    pub(crate) fn gather_columns<'a>(
        &self,
        tree: &'a DMatrix<T>,
        room: &'a mut DMatrix<T>,
    ) -> &'a DMatrix<T> {
        let Some(coupling) = &self.coupling else { return tree };
        room.fill(T::zero());
        for (row, column) in coupling.velocities.iter().zip(tree.column_iter()) {
            let mut out = room.column_mut(row.at);
            out.zip_apply(&column, |out, x| *out += x * row.factor);
        }
        room
    }

    /// Gᵀ A G.
    #[inline(always)]
    pub(crate) fn gather_square<'a>(&self, tree: &'a DMatrix<T>, room: &'a mut DMatrix<T>) -> &'a DMatrix<T> {
        let Some(coupling) = &self.coupling else { return tree };
        room.fill(T::zero());
        for (row, column) in coupling.velocities.iter().zip(tree.column_iter()) {
            let mut out = room.column_mut(row.at);
            for (x, other) in column.iter().zip(&coupling.velocities) {
                out[other.at] += *x * (other.factor * row.factor);
            }
        }
        room
    }

    /// What was gathered before, if there is a coupling.
    #[inline(always)]
    pub(crate) fn gathered<'a>(&self, tree: &'a DMatrix<T>, room: &'a DMatrix<T>) -> &'a DMatrix<T> {
        if self.coupling.is_some() { room } else { tree }
    }

    /// The column of a Jacobian to which degree of freedom `k` of the tree adds, and with what factor, where joints
    /// follow others.
    #[inline(always)]
    pub(crate) fn shared_column(&self, k: usize) -> Option<(usize, T)> {
        self.coupling.as_ref().map(|coupling| (coupling.velocities[k].at, coupling.velocities[k].factor))
    }

    /// The degree of freedom before each one on the way to the root of the elimination tree of M: where no joint follows
    /// another that of the joints.
    pub(crate) fn elimination_parents(&self) -> &[Option<usize>] {
        self.coupling.as_ref().map_or(&self.dof_parent, |coupling| &coupling.parents)
    }

    /// The same where joints follow others; nothing where none does.
    pub(crate) fn coupled_parents(&self) -> &[Option<usize>] {
        self.coupling.as_ref().map_or(&[], |coupling| &coupling.parents)
    }
}
