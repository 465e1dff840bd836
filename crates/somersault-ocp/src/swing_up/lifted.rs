//! The problem with the pendulum at a few nodes as variables of their own.

use super::CartPendulumProblem;
use super::curvature::Tangents;
use super::passes::{Passes, finite};
use crate::error::OcpError;
use somersault_nlp::{Bounds, Curvature, EvaluationError, Nlp, Pattern, Structure};
use std::ops::Range;

/// The problem of a [`CartPendulumProblem`] for a solver, lifted: its variables are the parameters p of the cart, then
/// s: (θ, θ̇) at the nodes between segments, and the terminal error e in the order θ, θ̇, r, ṙ. Its Hessian is exact.
///
/// ```text
/// minimise    ½ eᵀ Q e + Σ over segments of what is paid there
/// subject to  g(p, s) − s = 0,    g: the ends of the segments and x(T) − x_f, as they follow from p and s
/// ```
/// In one piece a motion depends on p through the whole of an unstable pendulum, and the penalty bends that into a valley
/// along which every method creeps. Segments are short, and e is linear in one place and squared in another. The minima
/// are those of [`SingleShooting`](super::SingleShooting).
///
/// Cost: three passes backwards for one forwards; a Hessian some six floating-point operations for each stage and pair of
/// parameters that move the cart during its segment.
#[derive(Debug, Clone)]
pub struct SwingUp {
    pub(super) passes: Passes,
    structure: Structure,
    tangents: Tangents,
    pub(super) segments: Vec<Segment>,
    n_parameters: usize,
    by_parameters: Vec<f64>,
    /// Entries of the Jacobian that are the same everywhere.
    constants: Vec<(usize, f64)>,
    /// Q in the order of e, and where it is in the Hessian.
    weights: [f64; ERROR],
    weights_at: Vec<usize>,
}

/// Steps between two nodes.
#[derive(Debug, Clone)]
pub(super) struct Segment {
    pub(super) steps: Range<usize>,
    /// Parameters that move the cart meanwhile.
    parameters: Range<usize>,
    /// Where (θ, θ̇) at its start is among the variables, unless it is given.
    pub(super) start: Option<usize>,
    /// Constraints on (θ, θ̇) at its end.
    rows: [usize; 2],
    jacobian_at: [Vec<usize>; 2],
    /// Its part of the Hessian, upper triangle by columns, and where each entry belongs.
    hessian: Vec<f64>,
    hessian_at: Vec<usize>,
}

impl Segment {
    /// What its end and its cost depend on, ascending.
    fn variables(&self) -> impl Iterator<Item = usize> + Clone + use<> {
        self.parameters.clone().chain(self.start.map_or(0..0, |first| first..first + 2))
    }
}

/// Components of the terminal error.
pub(super) const ERROR: usize = 4;

/// Entries on and above the diagonal, by columns.
fn triangle<T: Copy>(columns: impl Iterator<Item = T> + Clone) -> impl Iterator<Item = (T, T)> {
    let rows = columns.clone();
    columns.enumerate().flat_map(move |(j, column)| rows.clone().take(j + 1).map(move |row| (row, column)))
}

impl SwingUp {
    pub(super) fn try_new(problem: &CartPendulumProblem) -> Result<Self, OcpError> {
        let passes = Passes::try_new(problem)?;
        let (n, n_steps) = (passes.tables.motion.n_parameters(), problem.n_steps);
        let n_segments = problem.n_segments();
        let mut segments: Vec<Segment> = (0..n_segments)
            .map(|k| {
                let steps = k * n_steps / n_segments..(k + 1) * n_steps / n_segments;
                Segment {
                    parameters: passes.tables.active(passes.place(steps.start)..passes.place(steps.end)),
                    start: k.checked_sub(1).map(|before| n + 2 * before),
                    rows: [2 * k, 2 * k + 1],
                    steps,
                    jacobian_at: [Vec::new(), Vec::new()],
                    hessian: Vec::new(),
                    hessian_at: Vec::new(),
                }
            })
            .collect();
        let n_rows = 2 * (n_segments - 1) + ERROR;
        let n_variables = n + n_rows;
        let end = passes.place(n_steps);
        let cart: Vec<(usize, usize)> = (n_rows - 2..n_rows)
            .flat_map(|row| passes.tables.active(end..end).map(move |j| (row, j)))
            .collect();
        let of_segments =
            segments.iter().flat_map(|s| s.rows.into_iter().flat_map(|i| s.variables().map(move |j| (i, j))));
        let of_nodes = (0..n_rows).map(|i| (i, n + i));
        let lists = [of_segments.collect(), of_nodes.collect(), cart.clone()];
        let (jacobian, [segments_at, nodes_at, cart_at]) =
            Pattern::with_places_of(n_rows, n_variables, lists);
        let of_error = (n_variables - ERROR..n_variables).map(|i| (i, i)).collect();
        let of_segments = segments.iter().flat_map(|s| triangle(s.variables())).collect();
        let (hessian, [mut hessians_at, weights_at]) =
            Pattern::with_places_of(n_variables, n_variables, [of_segments, of_error]);
        let mut segments_at = segments_at.into_iter();
        for s in &mut segments {
            let n_columns = s.variables().count();
            s.jacobian_at = s.rows.map(|_| segments_at.by_ref().take(n_columns).collect());
            let rest = hessians_at.split_off(n_columns * (n_columns + 1) / 2);
            s.hessian_at = std::mem::replace(&mut hessians_at, rest);
            s.hessian = vec![0.0; s.hessian_at.len()];
        }
        let mut row = vec![0.0; n];
        let mut constants: Vec<(usize, f64)> = nodes_at.into_iter().map(|at| (at, -1.0)).collect();
        for ((i, j), at) in cart.into_iter().zip(cart_at) {
            passes.tables.row(end, i + 2 - n_rows, 0, &mut row);
            constants.push((at, row[j]));
        }
        let [a, b, c, d] = problem.terminal_weights;
        let zeros = Bounds { lower: vec![0.0; n_rows], upper: vec![0.0; n_rows] };
        Ok(Self {
            weights: [a, c, b, d],
            weights_at,
            structure: Structure {
                variables: Bounds::free(n_variables),
                constraints: zeros,
                jacobian,
                hessian,
            },
            tangents: Tangents::new(n + 2),
            by_parameters: vec![0.0; n],
            n_parameters: n,
            constants,
            passes,
            segments,
        })
    }

    /// Number of parameters of the cart, which come first among the variables.
    pub fn n_parameters(&self) -> usize {
        self.n_parameters
    }
}

impl Nlp for SwingUp {
    fn structure(&self) -> &Structure {
        &self.structure
    }

    fn evaluate(&mut self, z: &[f64], constraints: &mut [f64]) -> Result<f64, EvaluationError> {
        let Self { passes, segments, weights, n_parameters, .. } = self;
        let (parameters, lifted) = z.split_at(*n_parameters);
        passes.set_cart(parameters);
        let (mut cost, mut end) = (0.0, passes.first_state());
        for segment in segments {
            let from = segment.start.map_or(end, |i| [z[i], z[i + 1]]);
            let paid;
            (paid, end) = passes.forward(segment.steps.clone(), from);
            cost += paid;
            constraints[segment.rows[0]..=segment.rows[1]].copy_from_slice(&end);
        }
        let [angle, r, rate, r_rate] = passes.apart(passes.n_steps, end);
        let n_nodes = lifted.len() - ERROR;
        constraints[n_nodes..].copy_from_slice(&[angle, rate, r, r_rate]);
        constraints.iter_mut().zip(lifted).for_each(|(c, s)| *c -= s);
        finite(cost + 0.5 * lifted[n_nodes..].iter().zip(weights).map(|(e, q)| *q * e * e).sum::<f64>())
    }

    fn differentiate(
        &mut self,
        z: &[f64],
        gradient: &mut [f64],
        jacobian: &mut [f64],
    ) -> Result<(), EvaluationError> {
        let Self { passes, segments, by_parameters, n_parameters, .. } = self;
        gradient.fill(0.0);
        jacobian.fill(0.0);
        passes.by_coefficients.fill(0.0);
        for segment in &*segments {
            let by_start = passes.backward(segment.steps.clone(), [0.0; 2], 1.0);
            if let Some(i) = segment.start {
                gradient[i..i + 2].copy_from_slice(&by_start);
            }
        }
        passes.tables.motion.pull_back(&passes.by_coefficients, &mut gradient[..*n_parameters]);
        let first = z.len() - ERROR;
        for i in 0..ERROR {
            gradient[first + i] = self.weights[i] * z[first + i];
        }
        for segment in segments {
            for (at, seed) in segment.jacobian_at.iter().zip([[1.0, 0.0], [0.0, 1.0]]) {
                passes.by_coefficients.fill(0.0);
                let by_start = passes.backward(segment.steps.clone(), seed, 0.0);
                by_parameters.fill(0.0);
                passes.tables.motion.pull_back(&passes.by_coefficients, by_parameters);
                let by_variables = by_parameters[segment.parameters.clone()].iter().chain(&by_start);
                at.iter().zip(by_variables).for_each(|(at, by)| jacobian[*at] = *by);
            }
        }
        self.constants.iter().for_each(|(at, value)| jacobian[*at] = *value);
        Ok(())
    }

    fn curvature(&self) -> Curvature {
        Curvature::Exact
    }

    fn hessian(
        &mut self,
        _z: &[f64],
        cost_factor: f64,
        multipliers: &[f64],
        hessian: &mut [f64],
    ) -> Result<(), EvaluationError> {
        let Self { passes, segments, tangents, .. } = self;
        hessian.fill(0.0);
        for segment in segments {
            let Segment { steps, parameters, start, rows, hessian: own, hessian_at, .. } = segment;
            passes.backward(steps.clone(), rows.map(|i| multipliers[i]), cost_factor);
            passes.curvature(steps.clone(), parameters.clone(), start.is_some(), cost_factor, tangents, own);
            hessian_at.iter().zip(&*own).for_each(|(at, h)| hessian[*at] += h);
        }
        for (at, weight) in self.weights_at.iter().zip(self.weights) {
            hessian[*at] += cost_factor * weight;
        }
        Ok(())
    }
}
