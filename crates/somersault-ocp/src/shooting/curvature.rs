//! Second derivatives of a rollout where displacements commute and durations are fixed.
//!
//! Steps are then linear but for the dynamics at their stages. With w the adjoint of what is found at a stage, from one
//! backward sweep, and X the tangents of (q, v, known) there, from one forward sweep,
//!
//! ```text
//! ∂²(number) = Σ over stages  Xᵀ ( Σ_i w_i ∂²found_i ) X
//! ```

use super::Shooting;
use crate::dynamics::HybridDynamics;
use crate::transcription::RolloutGradient;
use nalgebra::{DMatrix, DMatrixView};
use somersault_nlp::{EvaluationError, Pattern};

/// Room that is made when second derivatives are first requested.
#[derive(Debug, Default)]
pub(super) struct Work {
    /// The adjoint of what is found at each stage.
    pub(super) weights: Vec<f64>,
    /// The weighted second derivatives at each stage.
    stages: Vec<f64>,
    gradient: Vec<f64>,
}

/// Second derivatives by the variables of a segment.
#[derive(Debug)]
pub(super) struct Sum<'a> {
    stages: &'a [f64],
    tangents: DMatrix<f64>,
    bent: DMatrix<f64>,
    total: DMatrix<f64>,
}

impl Sum<'_> {
    /// Adds those that stage number `i` has, with the tangents X of its (q, v, known).
    pub(super) fn add(&mut self, i: usize, tangents: [&DMatrix<f64>; 3]) {
        let (n_variables, n) = tangents[0].shape();
        for (part, tangents) in tangents.into_iter().enumerate() {
            tangents.transpose_to(&mut self.tangents.view_mut((part * n, 0), (n, n_variables)));
        }
        let size = 9 * n * n;
        let curvature = DMatrixView::from_slice(&self.stages[i * size..(i + 1) * size], 3 * n, 3 * n);
        curvature.mul_to(&self.tangents, &mut self.bent);
        self.total.gemm_tr(1.0, &self.tangents, &self.bent, 1.0);
    }
}

impl<D: HybridDynamics> Shooting<D> {
    pub(super) fn sweep_curvature(
        &mut self,
        by: &RolloutGradient,
        pattern: &Pattern,
        hessian: &mut [f64],
    ) -> Result<(), EvaluationError> {
        let n = self.dynamics.dofs().n_velocities();
        let count = self.stages.count();
        let mut work = std::mem::take(&mut self.curvature);
        work.stages.resize(count * 9 * n * n, 0.0);
        work.stages.fill(0.0);
        work.gradient.resize(self.layout.n_variables, 0.0);
        work.weights.resize(count * n, 0.0);
        self.curvature.weights = std::mem::take(&mut work.weights);
        let swept = self.sweep_backward(by, &mut work.gradient);
        work.weights = std::mem::take(&mut self.curvature.weights);
        let done = swept.and_then(|()| self.bend(&mut work)).and_then(|()| {
            let mut added = Ok(());
            let mut forward = std::mem::take(&mut self.forward);
            for (number, tangents) in forward.iter_mut().enumerate() {
                let n_variables = self.segments[number].variables.len();
                let mut sum = Sum {
                    stages: &work.stages,
                    tangents: DMatrix::zeros(3 * n, n_variables),
                    bent: DMatrix::zeros(3 * n, n_variables),
                    total: DMatrix::zeros(n_variables, n_variables),
                };
                self.bend_segment(number, tangents, &mut sum);
                for (j, column) in self.segments[number].variables.iter().enumerate() {
                    for (i, row) in self.segments[number].variables[..=j].iter().enumerate() {
                        let value = sum.total[(i, j)];
                        added = added.and_then(|()| Ok(pattern.add(hessian, *row, *column, value)?));
                    }
                }
            }
            self.forward = forward;
            added
        });
        self.curvature = work;
        done
    }

    /// The weighted second derivatives at all stages.
    fn bend(&mut self, work: &mut Work) -> Result<(), EvaluationError> {
        let n_stages = self.n_stages();
        let Self { dynamics, stages, phases, .. } = self;
        let n = dynamics.dofs().n_velocities();
        let what = || EvaluationError::Undefined { what: "the second derivative of the dynamics".to_owned() };
        let dynamics = dynamics.second_derivatives().ok_or_else(what)?;
        for phase in phases {
            for step in 0..=phase.n_steps {
                for s in 0..if step == phase.n_steps { 1 } else { n_stages } {
                    let i = stages.number(phase.first_node + step, s);
                    let (weights, size) = (&work.weights[i * n..(i + 1) * n], 9 * n * n);
                    let out = &mut work.stages[i * size..(i + 1) * size];
                    let (q, v, known) = (stages.position(i), stages.velocity(i), stages.known(i));
                    dynamics.add_second_derivatives(q, v, known, weights, out)?;
                }
            }
        }
        Ok(())
    }
}
