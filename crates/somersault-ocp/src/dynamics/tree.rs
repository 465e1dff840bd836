//! Any tree, with any division into passive and active degrees of freedom.

use super::{Dofs, HybridDynamics, HybridSecondDerivatives};
use crate::error::OcpError;
use nalgebra::{DMatrix, Matrix6};
use somersault_core::argument::expect_length;
use somersault_multibody::{Data, DerivativeData, DynamicsError, Joint, Model, SecondDerivativeData, Split};
use somersault_nlp::EvaluationError;

/// A tree as [`HybridDynamics`]; joint forces of passive degrees of freedom, viscous friction and gravity are its own.
#[derive(Debug, Clone)]
pub struct Tree {
    model: Model,
    split: Split,
    dofs: Dofs,
    /// Of the groups of `dofs`.
    joints: Vec<Joint>,
    data: Data,
    work: DerivativeData,
    acceleration: Vec<f64>,
    torque: Vec<f64>,
    second: Option<Box<Second>>,
}

/// Room for second derivatives, made when these are first requested.
#[derive(Debug, Clone)]
struct Second {
    data: SecondDerivativeData,
    /// ∂a by (q, v, known), column by column.
    slopes: DMatrix<f64>,
    weights: Vec<f64>,
    /// Rows of (dq, dv, da), one for each position and velocity.
    directions: Vec<f64>,
    rows: Vec<f64>,
}

impl Second {
    fn new(n: usize) -> Self {
        Self {
            data: SecondDerivativeData::default(),
            slopes: DMatrix::zeros(n, 3 * n),
            weights: vec![0.0; n],
            directions: vec![0.0; 2 * n * 3 * n],
            rows: vec![0.0; (2 * n + 1) * 3 * n],
        }
    }
}

impl Tree {
    /// `model` with the active degrees of freedom of `split`, each of which must be all of its joint.
    pub fn try_new(model: Model, split: Split) -> Result<Self, OcpError> {
        let n = model.n_velocities();
        expect_length("split", split.active().len(), n)?;
        let mut dofs = Dofs {
            n_positions: model.n_positions(),
            active: split.active().to_vec(),
            positions: vec![None; n],
            groups: Vec::new(),
        };
        let mut joints = Vec::new();
        for (i, link) in model.links().iter().enumerate() {
            let at = model.velocities_of(i);
            if at.len() == 1 {
                dofs.positions[at.start] = Some(model.positions_of(i).start);
                continue;
            }
            let n_active = split.active()[at.clone()].iter().filter(|active| **active).count();
            if n_active > 0 {
                let joint = link.name().to_owned();
                return Err(OcpError::ActiveJoint { joint, n_active, n_velocities: at.len() });
            }
            if at.len() > 1 {
                dofs.groups.push(at);
                joints.push(*link.joint());
            }
        }
        let (data, work) = (Data::new(&model), DerivativeData::new(&model));
        let room = || vec![0.0; n];
        Ok(Self {
            model,
            split,
            dofs,
            joints,
            data,
            work,
            acceleration: room(),
            torque: room(),
            second: None,
        })
    }

    /// The tree.
    pub fn model(&self) -> &Model {
        &self.model
    }

    /// Which degrees of freedom are active.
    pub fn split(&self) -> &Split {
        &self.split
    }
}

pub(crate) fn undefined(error: DynamicsError) -> EvaluationError {
    EvaluationError::Undefined { what: format!("the motion of the tree ({error})") }
}

impl HybridDynamics for Tree {
    fn dofs(&self) -> &Dofs {
        &self.dofs
    }

    fn calc(
        &mut self,
        q: &[f64],
        v: &[f64],
        known: &[f64],
        found: &mut [f64],
    ) -> Result<(), EvaluationError> {
        let Self { model, split, data, acceleration, torque, .. } = self;
        acceleration.copy_from_slice(known);
        torque.copy_from_slice(known);
        model.hybrid_dynamics(data, split, q, v, acceleration, torque, &[]).map_err(undefined)?;
        for (k, active) in split.active().iter().enumerate() {
            found[k] = if *active { torque[k] } else { acceleration[k] };
        }
        Ok(())
    }

    fn calc_diff(
        &mut self,
        q: &[f64],
        v: &[f64],
        known: &[f64],
        partials: &mut [f64],
    ) -> Result<(), EvaluationError> {
        let Self { model, split, work, .. } = self;
        let found = model.hybrid_dynamics_partials(work, split, q, v, known, &[]).map_err(undefined)?;
        let square = known.len() * known.len();
        let (by_q, rest) = partials.split_at_mut(square);
        let (by_v, by_known) = rest.split_at_mut(square);
        by_q.copy_from_slice(found.q.as_slice());
        by_v.copy_from_slice(found.v.as_slice());
        by_known.copy_from_slice(found.input.as_slice());
        Ok(())
    }

    fn second_derivatives(&mut self) -> Option<&mut dyn HybridSecondDerivatives> {
        if self.dofs.groups.is_empty() { Some(self) } else { None }
    }

    fn displace(&self, q: &[f64], d: &[f64], out: &mut [f64]) -> Result<(), EvaluationError> {
        self.model.displace(q, d, out).map_err(undefined)
    }

    fn difference(&self, from: &[f64], to: &[f64], out: &mut [f64]) -> Result<(), EvaluationError> {
        self.model.difference(from, to, out).map_err(undefined)
    }

    fn displacement_maps(&self, group: usize, d: &[f64]) -> [Matrix6<f64>; 2] {
        self.joints[group].displacement_maps(&d[self.dofs.groups[group].clone()])
    }
}

impl HybridSecondDerivatives for Tree {
    /// With y the accelerations of passive and the forces of active degrees of freedom, inverse dynamics τ = ID(q, v, a) and weights w
    /// of y,
    ///
    /// ```text
    /// ∂²(wᵀ y) = Sᵀ ∂²(λᵀ ID) S,   S = ∂(q, v, a)/∂(q, v, known)
    /// ```
    /// where λ is w of active degrees of freedom, and of a passive one −wᵀ ∂y by its force. What is found is linear in what is
    /// known: directions are those of positions and velocities.
    fn add_second_derivatives(
        &mut self,
        q: &[f64],
        v: &[f64],
        known: &[f64],
        weights: &[f64],
        out: &mut [f64],
    ) -> Result<(), EvaluationError> {
        let Self { model, split, work, second, acceleration, .. } = self;
        let n = known.len();
        let Second { data, slopes, weights: lever, directions, rows } =
            &mut **second.get_or_insert_with(|| Box::new(Second::new(n)));
        let partials = model.hybrid_dynamics_partials(work, split, q, v, known, &[]).map_err(undefined)?;
        for k in 0..n {
            if split.active()[k] {
                (acceleration[k], lever[k]) = (known[k], weights[k]);
                slopes.row_mut(k).fill(0.0);
                slopes[(k, 2 * n + k)] = 1.0;
                continue;
            }
            acceleration[k] = partials.value[k];
            lever[k] = -partials.input.column(k).iter().zip(weights).map(|(y, w)| y * w).sum::<f64>();
            for (part, matrix) in [partials.q, partials.v, partials.input].into_iter().enumerate() {
                for j in 0..n {
                    slopes[(k, part * n + j)] = matrix[(k, j)];
                }
            }
        }
        for (j, direction) in directions.chunks_exact_mut(3 * n).enumerate() {
            direction[..2 * n].fill(0.0);
            direction[j] = 1.0;
            direction[2 * n..].copy_from_slice(slopes.column(j).as_slice());
        }
        model
            .inverse_dynamics_second_derivatives(data, q, v, acceleration, &[], lever, directions, rows)
            .map_err(undefined)?;
        for (j, row) in rows.chunks_exact(3 * n).skip(1).enumerate() {
            let (direct, by_a) = row.split_at(2 * n);
            for (i, slopes) in slopes.column_iter().enumerate() {
                let through: f64 = slopes.iter().zip(by_a).map(|(slope, by)| slope * by).sum();
                let value = through + direct.get(i).copied().unwrap_or(0.0);
                out[j * 3 * n + i] += value;
                if i >= 2 * n {
                    out[i * 3 * n + j] += value;
                }
            }
        }
        Ok(())
    }
}
