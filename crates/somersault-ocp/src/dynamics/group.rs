//! Displacements of joints that do not commute.
//!
//! ```text
//! (q ⊕ ε) ⊕ d = (q ⊕ d) ⊕ A ε
//! q ⊕ (d + ε) = (q ⊕ d) ⊕ J ε + O(ε²)
//! ```
//! Both matrices are those of [`HybridDynamics::displacement_maps`].

use super::{Dofs, HybridDynamics};
use nalgebra::Matrix6;
use std::ops::Range;

/// A and J of one displacement, for each group.
#[derive(Debug, Clone, Default)]
pub(crate) struct GroupTransport {
    blocks: Vec<Block>,
}

#[derive(Debug, Clone)]
struct Block {
    dofs: Range<usize>,
    along: Matrix6<f64>,
    jacobian: Matrix6<f64>,
}

impl GroupTransport {
    pub(crate) fn new(dofs: &Dofs) -> Self {
        let identity = Matrix6::identity();
        let block = |d: &Range<usize>| Block { dofs: d.clone(), along: identity, jacobian: identity };
        Self { blocks: dofs.groups.iter().map(block).collect() }
    }

    /// Whether all displacements commute.
    pub(crate) fn is_trivial(&self) -> bool {
        self.blocks.is_empty()
    }

    /// Those of `d`.
    pub(crate) fn set<D: HybridDynamics>(&mut self, dynamics: &D, d: &[f64]) {
        for (i, block) in self.blocks.iter_mut().enumerate() {
            [block.along, block.jacobian] = dynamics.displacement_maps(i, d);
        }
    }

    /// ε ← A ε.
    pub(crate) fn along(&self, e: &mut [f64]) {
        self.blocks.iter().for_each(|b| multiply(&b.along, &mut e[b.dofs.clone()]));
    }

    /// ε ← J ε.
    pub(crate) fn jacobian(&self, e: &mut [f64]) {
        self.blocks.iter().for_each(|b| multiply(&b.jacobian, &mut e[b.dofs.clone()]));
    }

    /// Adjoint of [`along`](Self::along).
    pub(crate) fn along_transposed(&self, e: &mut [f64]) {
        self.blocks.iter().for_each(|b| multiply_transposed(&b.along, &mut e[b.dofs.clone()]));
    }

    /// Adjoint of [`jacobian`](Self::jacobian).
    pub(crate) fn jacobian_transposed(&self, e: &mut [f64]) {
        self.blocks.iter().for_each(|b| multiply_transposed(&b.jacobian, &mut e[b.dofs.clone()]));
    }

    /// J⁻¹ in the place of J: the derivative of the logarithm.
    pub(crate) fn invert_jacobian(&mut self) -> bool {
        self.blocks.iter_mut().all(|b| b.jacobian.try_inverse_mut())
    }
}

fn multiply(matrix: &Matrix6<f64>, e: &mut [f64]) {
    let mut out = [0.0; 6];
    for (j, x) in e.iter().enumerate() {
        out.iter_mut().zip(matrix.column(j).iter()).for_each(|(out, m)| *out += m * x);
    }
    e.iter_mut().zip(out).for_each(|(e, out)| *e = out);
}

fn multiply_transposed(matrix: &Matrix6<f64>, e: &mut [f64]) {
    let mut out = [0.0; 6];
    for (j, out) in out.iter_mut().enumerate().take(e.len()) {
        *out = matrix.column(j).iter().zip(&*e).map(|(m, x)| m * x).sum();
    }
    e.iter_mut().zip(out).for_each(|(e, out)| *e = out);
}
