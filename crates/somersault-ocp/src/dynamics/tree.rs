//! Any tree, with any division into passive and active degrees of freedom.

use super::{Dofs, HybridDynamics, HybridSecondDerivatives};
use crate::error::OcpError;
use nalgebra::Matrix6;
use num_dual::Dual64;
use somersault_core::argument::expect_length;
use somersault_multibody::{Data, DerivativeData, DynamicsError, Joint, Model, Split};
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
    dual: Option<Box<DualTree>>,
}

/// The tree over dual numbers, made when second derivatives are first requested.
#[derive(Debug, Clone)]
struct DualTree {
    model: Model<Dual64>,
    work: DerivativeData<Dual64>,
    /// q, v, known.
    arguments: [Vec<Dual64>; 3],
}

impl DualTree {
    fn new(model: &Model) -> Self {
        let model: Model<Dual64> = model.cast();
        let zero = vec![Dual64::from_re(0.0); model.n_velocities()];
        let arguments = [zero.clone(), zero.clone(), zero];
        Self { work: DerivativeData::new(&model), model, arguments }
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
        Ok(Self { model, split, dofs, joints, data, work, acceleration: room(), torque: room(), dual: None })
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
    /// By the analytic partials over dual numbers, one sweep for each position and velocity: what is found is linear in
    /// what is known.
    fn add_second_derivatives(
        &mut self,
        q: &[f64],
        v: &[f64],
        known: &[f64],
        weights: &[f64],
        out: &mut [f64],
    ) -> Result<(), EvaluationError> {
        let Self { model, split, dual, .. } = self;
        let DualTree { model, work, arguments } =
            &mut **dual.get_or_insert_with(|| Box::new(DualTree::new(model)));
        let n = known.len();
        for (dual, real) in arguments.iter_mut().zip([q, v, known]) {
            dual.iter_mut().zip(real).for_each(|(dual, re)| *dual = Dual64::from_re(*re));
        }
        for j in 0..2 * n {
            arguments[j / n][j % n].eps = 1.0;
            let [q, v, known] = &*arguments;
            let partials =
                model.hybrid_dynamics_partials(work, split, q, v, known, &[]).map_err(undefined)?;
            for (part, matrix) in [partials.q, partials.v, partials.input].into_iter().enumerate() {
                for (k, column) in matrix.column_iter().enumerate() {
                    let i = part * n + k;
                    let curvature: f64 = column.iter().zip(weights).map(|(d, w)| w * d.eps).sum();
                    out[j * 3 * n + i] += curvature;
                    if part == 2 {
                        out[i * 3 * n + j] += curvature;
                    }
                }
            }
            arguments[j / n][j % n].eps = 0.0;
        }
        Ok(())
    }
}
