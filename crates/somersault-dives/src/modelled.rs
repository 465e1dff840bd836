//! A dive with the quadratic models of a coarser one.

use crate::DiveProgram;
use somersault_nlp::{Curvature, EvaluationError, Nlp, Structure};

/// The program of a dive, but for its Hessian: that of the same dive with fewer steps of the orientation, at the same
/// point, with the same multipliers and gradients of the constraints.
///
/// What a program is solved to does not depend on its Hessian, and how fast only by how near it is.
pub(crate) struct Modelled<'a> {
    pub(crate) program: &'a mut DiveProgram,
    pub(crate) model: &'a mut DiveProgram,
}

impl Nlp for Modelled<'_> {
    fn structure(&self) -> &Structure {
        self.program.structure()
    }

    fn evaluate(&mut self, z: &[f64], constraints: &mut [f64]) -> Result<f64, EvaluationError> {
        self.program.evaluate(z, constraints)
    }

    fn differentiate(
        &mut self,
        z: &[f64],
        gradient: &mut [f64],
        jacobian: &mut [f64],
    ) -> Result<(), EvaluationError> {
        self.program.differentiate(z, gradient, jacobian)?;
        self.model.take_jacobian(jacobian);
        Ok(())
    }

    fn curvature(&self) -> Curvature {
        self.program.curvature()
    }

    fn hessian(
        &mut self,
        z: &[f64],
        cost_factor: f64,
        multipliers: &[f64],
        hessian: &mut [f64],
    ) -> Result<(), EvaluationError> {
        self.model.hessian(z, cost_factor, multipliers, hessian)
    }
}
