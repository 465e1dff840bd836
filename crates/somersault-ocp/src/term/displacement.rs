//! Displacements of the positions on the groups of the joints.

use super::{Node, NodeGradient, Term};
use crate::dynamics::{GroupTransport, HybridDynamics};
use crate::error::{OcpError, expect_below};
use somersault_core::argument::{expect_finite, expect_length};
use somersault_nlp::EvaluationError;

/// The displacement d with reference ⊕ d = q, of some degrees of freedom. For hinges and sliders it is the difference;
/// for rotations the rotation vector of least length, unique below a half turn.
#[derive(Debug, Clone)]
pub struct Displacement<D> {
    dynamics: D,
    reference: Vec<f64>,
    dofs: Vec<usize>,
    transport: GroupTransport,
    difference: Vec<f64>,
    by_difference: Vec<f64>,
}

impl<D: HybridDynamics> Displacement<D> {
    /// From the positions `reference`, of the given degrees of freedom.
    pub fn try_new(dynamics: D, reference: &[f64], dofs: &[usize]) -> Result<Self, OcpError> {
        let n = dynamics.dofs().n_velocities();
        expect_length("reference", reference.len(), dynamics.dofs().n_positions)?;
        expect_finite("reference", reference)?;
        for dof in dofs {
            expect_below("dofs", *dof, n)?;
        }
        Ok(Self {
            transport: GroupTransport::new(dynamics.dofs()),
            dynamics,
            reference: reference.to_vec(),
            dofs: dofs.to_vec(),
            difference: vec![0.0; n],
            by_difference: vec![0.0; n],
        })
    }
}

impl<D: HybridDynamics> Term for Displacement<D> {
    fn name(&self) -> &str {
        "displacement"
    }

    fn n_rows(&self) -> usize {
        self.dofs.len()
    }

    fn is_linear(&self) -> bool {
        self.transport.is_trivial()
    }

    fn evaluate(&mut self, node: &Node<'_>, rows: &mut [f64]) -> Result<(), EvaluationError> {
        self.dynamics.difference(&self.reference, node.position, &mut self.difference)?;
        rows.iter_mut().zip(&self.dofs).for_each(|(row, dof)| *row = self.difference[*dof]);
        Ok(())
    }

    fn pull_back(
        &mut self,
        _node: &Node<'_>,
        y: &[f64],
        gradient: &mut NodeGradient,
    ) -> Result<(), EvaluationError> {
        let Self { dynamics, dofs, transport, difference, by_difference, .. } = self;
        by_difference.fill(0.0);
        y.iter().zip(&*dofs).for_each(|(y, dof)| by_difference[*dof] += y);
        if !transport.is_trivial() {
            transport.set(dynamics, difference);
            if !transport.invert_jacobian() {
                let what = "the gradient of a displacement by a whole turn".to_owned();
                return Err(EvaluationError::Undefined { what });
            }
            transport.jacobian_transposed(by_difference);
        }
        gradient.position.iter_mut().zip(by_difference).for_each(|(g, by)| *g += *by);
        Ok(())
    }
}
