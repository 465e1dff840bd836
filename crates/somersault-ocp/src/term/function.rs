//! Functions of the user's.

use super::{Node, NodeGradient, Part, Term};
use crate::dynamics::HybridDynamics;
use somersault_nlp::EvaluationError;
use std::error::Error;

/// What a user's function may fail with; the solver stops and hands it on.
pub type UserError = Box<dyn Error + Send + Sync>;

type Rows = Box<dyn FnMut(&Node<'_>, &mut [f64]) -> Result<(), UserError> + Send>;
type PullBack = Box<dyn FnMut(&Node<'_>, &[f64], &mut NodeGradient) -> Result<(), UserError> + Send>;
type Displace = Box<dyn Fn(&[f64], &[f64], &mut [f64]) -> Result<(), EvaluationError> + Send>;

/// Rows that a closure computes, with a gradient that another one computes, or by central differences.
///
/// Rows that are not finite make the program undefined there: a solver steps back. An error stops it.
pub struct Function {
    name: String,
    n_rows: usize,
    rows: Rows,
    derivative: Derivative,
}

enum Derivative {
    Given(PullBack),
    Differences(Differences),
}

struct Differences {
    parts: Vec<Part>,
    displace: Displace,
    by_position: bool,
    position: Vec<f64>,
    displacement: Vec<f64>,
    varied: Vec<f64>,
    forward: Vec<f64>,
    backward: Vec<f64>,
}

impl Function {
    /// `rows` writes r; `pull_back` adds (∂r/∂node)ᵀ y, positions by displacements.
    pub fn new(
        name: &str,
        n_rows: usize,
        rows: impl FnMut(&Node<'_>, &mut [f64]) -> Result<(), UserError> + Send + 'static,
        pull_back: impl FnMut(&Node<'_>, &[f64], &mut NodeGradient) -> Result<(), UserError> + Send + 'static,
    ) -> Self {
        let derivative = Derivative::Given(Box::new(pull_back));
        Self { name: name.to_owned(), n_rows, rows: Box::new(rows), derivative }
    }

    /// By central differences along displacements of all positions, if `by_position`, and along the numbers of `parts`.
    ///
    /// Two evaluations of `rows` for each of them; error about 1e-10 of the size of r and its third derivative.
    pub fn by_differences<D: HybridDynamics + Sync + 'static>(
        name: &str,
        n_rows: usize,
        dynamics: D,
        by_position: bool,
        parts: &[Part],
        rows: impl FnMut(&Node<'_>, &mut [f64]) -> Result<(), UserError> + Send + 'static,
    ) -> Self {
        let dofs = dynamics.dofs();
        let (n_q, n) = (dofs.n_positions, dofs.n_velocities());
        let differences = Differences {
            parts: parts.to_vec(),
            displace: Box::new(move |q, d, out| dynamics.displace(q, d, out)),
            by_position,
            position: vec![0.0; n_q],
            displacement: vec![0.0; n],
            varied: Vec::new(),
            forward: vec![0.0; n_rows],
            backward: vec![0.0; n_rows],
        };
        let derivative = Derivative::Differences(differences);
        Self { name: name.to_owned(), n_rows, rows: Box::new(rows), derivative }
    }
}

/// The cube root of the rounding unit, near the best for central differences.
const STEP: f64 = 6e-6;

/// The node with one part replaced.
fn with_part<'a>(node: &Node<'a>, part: Part, values: &'a [f64]) -> Node<'a> {
    let mut node = *node;
    match part {
        Part::Time => node.time = values[0],
        Part::Velocity => node.velocity = values,
        Part::Acceleration => node.acceleration = values,
        Part::Torque => node.torque = values,
        Part::Channel => node.channel = values,
        Part::ChannelRate => node.channel_rate = values,
        Part::ChannelSecondRate => node.channel_second_rate = values,
    }
    node
}

impl Differences {
    fn pull_back(
        &mut self,
        rows: &mut Rows,
        node: &Node<'_>,
        y: &[f64],
        gradient: &mut NodeGradient,
    ) -> Result<(), EvaluationError> {
        let Self { parts, displace, by_position, position, displacement, varied, forward, backward } = self;
        let mut call = |node: &Node<'_>, out: &mut [f64]| rows(node, out).map_err(EvaluationError::Failed);
        let slope = |forward: &[f64], backward: &[f64], h: f64| {
            y.iter().zip(forward.iter().zip(backward)).map(|(y, (f, b))| y * (f - b)).sum::<f64>() / (2.0 * h)
        };
        if *by_position {
            for k in 0..displacement.len() {
                for (h, out) in [(STEP, &mut *forward), (-STEP, &mut *backward)] {
                    displacement.fill(0.0);
                    displacement[k] = h;
                    displace(node.position, displacement, position)?;
                    call(&Node { position, ..*node }, out)?;
                }
                gradient.position[k] += slope(forward, backward, STEP);
            }
        }
        for part in &*parts {
            let values = part.of(node);
            for k in 0..values.len() {
                let h = STEP * values[k].abs().max(1.0);
                for (h, out) in [(h, &mut *forward), (-h, &mut *backward)] {
                    varied.clear();
                    varied.extend_from_slice(values);
                    varied[k] += h;
                    call(&with_part(node, *part, varied), out)?;
                }
                part.gradient(gradient)[k] += slope(forward, backward, h);
            }
        }
        Ok(())
    }
}

impl Term for Function {
    fn name(&self) -> &str {
        &self.name
    }

    fn n_rows(&self) -> usize {
        self.n_rows
    }

    fn is_linear(&self) -> bool {
        false
    }

    fn evaluate(&mut self, node: &Node<'_>, rows: &mut [f64]) -> Result<(), EvaluationError> {
        (self.rows)(node, rows).map_err(EvaluationError::Failed)
    }

    fn pull_back(
        &mut self,
        node: &Node<'_>,
        y: &[f64],
        gradient: &mut NodeGradient,
    ) -> Result<(), EvaluationError> {
        match &mut self.derivative {
            Derivative::Given(pull_back) => pull_back(node, y, gradient).map_err(EvaluationError::Failed),
            Derivative::Differences(differences) => differences.pull_back(&mut self.rows, node, y, gradient),
        }
    }
}
