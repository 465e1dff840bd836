//! Functions of the user's.

use super::{Node, NodeGradient, Part, Term};
use crate::WrongDerivative;
use crate::dynamics::HybridDynamics;
use somersault_core::differences::{Differences, Slopes};
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
    /// With what moves positions, where it can be compared.
    Given(PullBack, Option<Displace>),
    Differences(Differenced),
}

struct Differenced {
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
        let derivative = Derivative::Given(Box::new(pull_back), None);
        Self { name: name.to_owned(), n_rows, rows: Box::new(rows), derivative }
    }

    /// The same, whose gradient is compared with differences along displacements of these dynamics where a solve does not converge.
    pub fn compared_by<D: HybridDynamics + Sync + 'static>(mut self, dynamics: D) -> Self {
        if let Derivative::Given(_, displace) = &mut self.derivative {
            *displace = Some(Box::new(move |q, d, out| dynamics.displace(q, d, out)));
        }
        self
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
        let differences = Differenced {
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

impl Differenced {
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
        let step = |x: f64| Differences::OF_ROUNDED.step(x, 1.0);
        if *by_position {
            let size = step(0.0);
            for k in 0..displacement.len() {
                for (h, out) in [(size, &mut *forward), (-size, &mut *backward)] {
                    displacement.fill(0.0);
                    displacement[k] = h;
                    displace(node.position, displacement, position)?;
                    call(&Node { position, ..*node }, out)?;
                }
                gradient.position[k] += slope(forward, backward, size);
            }
        }
        for part in &*parts {
            let values = part.of(node);
            for k in 0..values.len() {
                let h = step(values[k]);
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
            Derivative::Given(pull_back, _) => pull_back(node, y, gradient).map_err(EvaluationError::Failed),
            Derivative::Differences(differences) => differences.pull_back(&mut self.rows, node, y, gradient),
        }
    }

    fn wrong_derivative(&mut self, node: &Node<'_>) -> Result<Option<WrongDerivative>, EvaluationError> {
        let Self { name, n_rows, rows, derivative } = self;
        let Derivative::Given(pull_back, Some(displace)) = derivative else { return Ok(None) };
        let mut evaluate =
            |node: &Node<'_>, out: &mut [f64]| rows(node, out).map_err(EvaluationError::Failed);
        let mut pull_back = |y: &[f64], gradient: &mut NodeGradient| {
            pull_back(node, y, gradient).map_err(EvaluationError::Failed)
        };
        compare(name, *n_rows, node, &mut evaluate, &mut pull_back, &**displace)
    }
}

/// Rows of a term at a node.
type Evaluate<'a> = &'a mut dyn FnMut(&Node<'_>, &mut [f64]) -> Result<(), EvaluationError>;
/// What moves positions.
type Displaced<'a> = &'a dyn Fn(&[f64], &[f64], &mut [f64]) -> Result<(), EvaluationError>;
/// Its gradient at the node in question.
type PulledBack<'a> = &'a mut dyn FnMut(&[f64], &mut NodeGradient) -> Result<(), EvaluationError>;

/// The gradient of any term compared with differences at a node, along displacements of the dynamics: the first entry that they
/// contradict.
pub fn wrong_derivative<D: HybridDynamics + Sync>(
    term: &mut dyn Term,
    node: &Node<'_>,
    dynamics: &D,
) -> Result<Option<WrongDerivative>, EvaluationError> {
    let (name, n_rows) = (term.name().to_owned(), term.n_rows());
    let term = std::cell::RefCell::new(term);
    let mut evaluate = |node: &Node<'_>, out: &mut [f64]| term.borrow_mut().evaluate(node, out);
    let mut pull_back = |y: &[f64], gradient: &mut NodeGradient| {
        let mut rows = vec![0.0; n_rows];
        let mut term = term.borrow_mut();
        term.evaluate(node, &mut rows)?;
        term.pull_back(node, y, gradient)
    };
    let displace = |q: &[f64], d: &[f64], out: &mut [f64]| dynamics.displace(q, d, out);
    compare(&name, n_rows, node, &mut evaluate, &mut pull_back, &displace)
}

fn compare(
    name: &str,
    n_rows: usize,
    node: &Node<'_>,
    evaluate: Evaluate<'_>,
    pull_back: PulledBack<'_>,
    displace: Displaced<'_>,
) -> Result<Option<WrongDerivative>, EvaluationError> {
    let mut gradients = Vec::with_capacity(n_rows);
    for i in 0..n_rows {
        let mut gradient = NodeGradient {
            position: vec![0.0; node.velocity.len()],
            velocity: vec![0.0; node.velocity.len()],
            acceleration: vec![0.0; node.acceleration.len()],
            torque: vec![0.0; node.torque.len()],
            channel: vec![0.0; node.channel.len()],
            channel_rate: vec![0.0; node.channel_rate.len()],
            channel_second_rate: vec![0.0; node.channel_second_rate.len()],
            time: 0.0,
        };
        let unit: Vec<f64> = (0..n_rows).map(|k| f64::from(u8::from(k == i))).collect();
        pull_back(&unit, &mut gradient)?;
        gradients.push(gradient);
    }
    let mut moved = vec![0.0; node.position.len()];
    let still = vec![0.0; node.velocity.len()];
    for part in std::iter::once(None).chain(Part::ALL.into_iter().map(Some)) {
        let at = part.map_or(&still[..], |part| part.of(node));
        let n = at.len();
        let mut values = |points: &[f64], out: &mut [f64]| {
            let mut pairs = points.chunks_exact(n.max(1)).zip(out.chunks_exact_mut(n_rows.max(1)));
            pairs.try_for_each(|(point, out)| match part {
                Some(part) => evaluate(&with_part(node, part, point), out),
                None => {
                    displace(node.position, point, &mut moved)?;
                    evaluate(&Node { position: &moved, ..*node }, out)
                }
            })
        };
        let slopes = Slopes::try_of(at, &vec![1.0; n], n_rows, Differences::OF_ROUNDED, &mut values)?;
        let own = |gradient: &mut NodeGradient| match part {
            Some(part) => part.gradient(gradient).to_vec(),
            None => gradient.position.clone(),
        };
        let given: Vec<f64> = gradients.iter_mut().flat_map(own).collect();
        if let Some(wrong) = slopes.and_then(|slopes| slopes.contradicted(&given)) {
            let what = part.map_or("position", Part::name).replace(' ', "_");
            let entry = format!("∂(row {})/∂({what}[{}])", wrong.row, wrong.column);
            let place = std::iter::once(("t", node.time));
            return Ok(Some(WrongDerivative::new(name, "gradient", entry, wrong, place)));
        }
    }
    Ok(None)
}
