//! Momentum and centre of mass of a tree.

use super::{Node, NodeGradient, Term};
use crate::dynamics::undefined;
use somersault_multibody::{DerivativeData, Model};
use somersault_nlp::EvaluationError;

/// What of it; three numbers each, world axes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum MomentumPart {
    /// Centre of mass, m.
    CenterOfMass,
    /// Linear momentum, kg m/s.
    Linear,
    /// Angular momentum about the centre of mass, kg m²/s.
    Angular,
}

/// Centre of mass, linear or angular momentum of a whole tree.
#[derive(Debug, Clone)]
pub struct Momentum {
    model: Model,
    work: DerivativeData,
    part: MomentumPart,
}

impl Momentum {
    /// Of `model`, whose positions and velocities are those of the nodes.
    pub fn new(model: Model, part: MomentumPart) -> Self {
        Self { work: DerivativeData::new(&model), model, part }
    }
}

impl Term for Momentum {
    fn name(&self) -> &str {
        match self.part {
            MomentumPart::CenterOfMass => "center of mass",
            MomentumPart::Linear => "linear momentum",
            MomentumPart::Angular => "angular momentum",
        }
    }

    fn n_rows(&self) -> usize {
        3
    }

    fn is_linear(&self) -> bool {
        false
    }

    fn evaluate(&mut self, node: &Node<'_>, rows: &mut [f64]) -> Result<(), EvaluationError> {
        let Self { model, work, part } = self;
        let found = model.momentum_partials(work, node.position, node.velocity).map_err(undefined)?;
        let value = match part {
            MomentumPart::CenterOfMass => found.center_of_mass,
            MomentumPart::Linear => found.momentum.linear,
            MomentumPart::Angular => found.momentum.angular,
        };
        rows.copy_from_slice(value.as_slice());
        Ok(())
    }

    fn pull_back(
        &mut self,
        node: &Node<'_>,
        y: &[f64],
        gradient: &mut NodeGradient,
    ) -> Result<(), EvaluationError> {
        let Self { model, work, part } = self;
        let found = model.momentum_partials(work, node.position, node.velocity).map_err(undefined)?;
        let (first, by_q, by_v) = match part {
            MomentumPart::CenterOfMass => (0, found.center_of_mass_q, None),
            MomentumPart::Linear => (0, found.q, Some(found.v)),
            MomentumPart::Angular => (3, found.q, Some(found.v)),
        };
        let add = |gradient: &mut [f64], matrix: &nalgebra::DMatrix<f64>| {
            for (g, column) in gradient.iter_mut().zip(matrix.column_iter()) {
                *g += column.rows(first, 3).iter().zip(y).map(|(m, y)| m * y).sum::<f64>();
            }
        };
        add(&mut gradient.position, by_q);
        if let Some(by_v) = by_v {
            add(&mut gradient.velocity, by_v);
        }
        Ok(())
    }
}
