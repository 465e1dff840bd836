//! Where the rows of the constraints have their entries, and the two ways to compute them.

use super::{Constraint, Cost, LinearConstraint, MotionProblem};
use crate::term::{Node, NodeNumber, Part, Term};
use crate::transcription::{NodeTangent, Transcription};
use nalgebra::{DMatrixView, DMatrixViewMut};
use somersault_nlp::{EvaluationError, Pattern};

/// How the Jacobian of the constraints is made.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Sweep {
    /// One adjoint sweep for each row.
    Adjoint,
    /// One forward sweep with a tangent for each variable.
    Forward,
}

/// For each row of the constraints its variables, ascending, and where in the values of the Jacobian they are.
pub(super) struct Rows {
    variables: Vec<Vec<usize>>,
    places: Vec<Vec<usize>>,
    n_defects: usize,
    /// Constraints and costs taken at each node, with the number of the node in their list.
    pub(super) constraints_at: Vec<Vec<(usize, usize)>>,
    pub(super) costs_at: Vec<Vec<usize>>,
}

impl Rows {
    pub(super) fn new<T: Transcription>(
        transcription: &T,
        costs: &[Cost],
        constraints: &[Constraint],
        linear: &[LinearConstraint],
        with_terms: bool,
    ) -> (Self, Pattern) {
        let outline = transcription.outline();
        let n_defects = outline.n_defects();
        let mut variables: Vec<Vec<usize>> =
            (0..n_defects).map(|i| transcription.variables_of_defect(i)).collect();
        let mut constraints_at = vec![Vec::new(); outline.n_nodes()];
        for (c, constraint) in constraints.iter().enumerate() {
            let of_nodes = constraint.sampled.nodes.iter().map(|k| transcription.variables_of_node(*k));
            let n_rows = constraint.sampled.term.n_rows();
            if constraint.integrated {
                let mut all: Vec<usize> = of_nodes.flatten().collect();
                all.sort_unstable();
                all.dedup();
                variables.extend(vec![all; n_rows]);
            } else {
                variables.extend(of_nodes.flat_map(|v| vec![v; n_rows]));
            }
            for (i, k) in constraint.sampled.nodes.iter().enumerate() {
                constraints_at[*k].push((c, i));
            }
        }
        let mut costs_at = vec![Vec::new(); outline.n_nodes()];
        let is_curved = |cost: &Cost| cost.loss.is_curved() || with_terms && !cost.sampled.term.is_linear();
        for (c, cost) in costs.iter().enumerate().filter(|(_, cost)| is_curved(cost)) {
            cost.sampled.nodes.iter().for_each(|k| costs_at[*k].push(c));
        }
        for constraint in linear {
            let mut all: Vec<usize> = constraint.factors.iter().map(|(variable, _)| *variable).collect();
            all.sort_unstable();
            all.dedup();
            variables.push(all);
        }
        let entries = variables.iter().enumerate().flat_map(|(i, v)| v.iter().map(move |j| (i, *j)));
        let (pattern, places) = Pattern::with_places(variables.len(), outline.n_variables(), entries);
        let mut rest = places.into_iter();
        let places = variables.iter().map(|v| rest.by_ref().take(v.len()).collect()).collect();
        (Self { variables, places, n_defects, constraints_at, costs_at }, pattern)
    }

    pub(super) fn n_defect_entries(&self) -> usize {
        self.variables[..self.n_defects].iter().map(Vec::len).sum()
    }

    /// Writes the entries of one row from a gradient by all variables.
    fn scatter(&self, row: usize, gradient: &[f64], jacobian: &mut [f64]) {
        for (variable, place) in self.variables[row].iter().zip(&self.places[row]) {
            jacobian[*place] = gradient[*variable];
        }
    }
}

impl<T: Transcription> MotionProblem<T> {
    pub(super) fn jacobian(&mut self, values: &mut [f64]) -> Result<(), EvaluationError> {
        values.fill(0.0);
        match self.sweep {
            Sweep::Adjoint => self.adjoint_jacobian(values)?,
            Sweep::Forward => self.forward_jacobian(values)?,
        }
        let first = self.structure.constraints.len() - self.linear.len();
        for (row, constraint) in (first..).zip(&self.linear) {
            let variables = &mut self.work.variables;
            variables.fill(0.0);
            for (variable, factor) in &constraint.factors {
                variables[*variable] += factor;
            }
            self.rows.scatter(row, variables, values);
        }
        Ok(())
    }

    fn adjoint_jacobian(&mut self, values: &mut [f64]) -> Result<(), EvaluationError> {
        let Self { transcription, constraints, rows, work, .. } = self;
        work.rollout.clear();
        for i in 0..rows.n_defects {
            work.rollout.defects[i] = 1.0;
            work.variables.fill(0.0);
            transcription.pull_back(&work.rollout, &mut work.variables)?;
            work.rollout.defects[i] = 0.0;
            rows.scatter(i, &work.variables, values);
        }
        for constraint in constraints {
            let term = &mut constraint.sampled.term;
            let n_rows = term.n_rows();
            let sets = constraint.sampled.nodes.chunks(if constraint.integrated {
                constraint.sampled.nodes.len()
            } else {
                1
            });
            for (set, nodes) in sets.enumerate() {
                for i in 0..n_rows {
                    let value = &mut work.value[..n_rows];
                    for &k in nodes {
                        let node = transcription.node(k);
                        term.evaluate(&node, value)?;
                        let seed = &mut work.seed[..n_rows];
                        seed.fill(0.0);
                        seed[i] = if constraint.integrated { transcription.weight(k) } else { 1.0 };
                        term.pull_back(&node, seed, &mut work.rollout.nodes[k])?;
                        if constraint.integrated {
                            work.rollout.weights[k] = value[i];
                        }
                    }
                    work.variables.fill(0.0);
                    transcription.pull_back(&work.rollout, &mut work.variables)?;
                    rows.scatter(constraint.first_row + set * n_rows + i, &work.variables, values);
                    for &k in nodes {
                        work.rollout.nodes[k].clear();
                        work.rollout.weights[k] = 0.0;
                    }
                }
            }
        }
        Ok(())
    }

    fn forward_jacobian(&mut self, values: &mut [f64]) -> Result<(), EvaluationError> {
        let Self { transcription, constraints, rows, work, .. } = self;
        let super::Work { value, seed, node: by_node, variables: row_values, defects, .. } = work;
        transcription.push_forward(defects, &mut |k, node, weight, tangent| {
            for &(c, index) in &rows.constraints_at[k] {
                let Constraint { sampled, integrated, first_row, .. } = &mut constraints[c];
                let n_rows = sampled.term.n_rows();
                let (value, seed) = (&mut value[..n_rows], &mut seed[..n_rows]);
                sampled.term.evaluate(node, value)?;
                for i in 0..n_rows {
                    let row_values = &mut row_values[..tangent.variables.len()];
                    row_values.fill(0.0);
                    seed.fill(0.0);
                    seed[i] = if *integrated { weight } else { 1.0 };
                    by_node.clear();
                    sampled.term.pull_back(node, seed, by_node)?;
                    tangent.add_pulled_back(by_node, row_values);
                    if *integrated {
                        row_values.iter_mut().zip(&tangent.weight).for_each(|(r, w)| *r += value[i] * w);
                        let row = *first_row + i;
                        add_row(rows, row, &tangent.variables, row_values, values);
                    } else {
                        let row = *first_row + index * n_rows + i;
                        for (place, x) in rows.places[row].iter().zip(&*row_values) {
                            values[*place] = *x;
                        }
                    }
                }
            }
            Ok(())
        })?;
        let places = rows.places[..rows.n_defects].iter().flatten();
        places.zip(&*defects).for_each(|(place, x)| values[*place] = *x);
        Ok(())
    }

    /// Σ c (∂r/∂z)ᵀ (∂r/∂z) over the rows r of all costs, c the curvature of their loss. With multipliers also what terms have for
    /// curvature of their own, those of costs and of constraints.
    pub(super) fn gauss_newton(
        &mut self,
        factor: f64,
        multipliers: Option<&[f64]>,
        hessian: &mut [f64],
    ) -> Result<(), EvaluationError> {
        let Self { transcription, costs, constraints, rows, work, structure, .. } = self;
        let super::Work {
            value, seed, node: by_node, variables: row_values, defects, tangents, bent, ..
        } = work;
        let pattern = &structure.hessian;
        hessian.fill(0.0);
        transcription.push_forward(defects, &mut |k, node, weight, tangent: &NodeTangent| {
            for &c in &rows.costs_at[k] {
                let Cost { sampled, loss, integrated } = &mut costs[c];
                let n_rows = sampled.term.n_rows();
                let (value, seed) = (&mut value[..n_rows], &mut seed[..n_rows]);
                sampled.term.evaluate(node, value)?;
                let factor = factor * if *integrated { weight } else { 1.0 };
                for i in 0..n_rows {
                    let curvature = factor * loss.curvature(value, i);
                    if curvature == 0.0 {
                        continue;
                    }
                    let row_values = &mut row_values[..tangent.variables.len()];
                    row_values.fill(0.0);
                    seed.fill(0.0);
                    seed[i] = 1.0;
                    by_node.clear();
                    sampled.term.pull_back(node, seed, by_node)?;
                    tangent.add_pulled_back(by_node, row_values);
                    add_product(pattern, &tangent.variables, [row_values, row_values], curvature, hessian);
                }
                if multipliers.is_some() && !sampled.term.is_linear() {
                    loss.gradient_into(value, factor, seed);
                    add_curvature(
                        &mut *sampled.term,
                        (node, seed),
                        tangent,
                        [tangents, bent],
                        pattern,
                        hessian,
                    )?;
                }
            }
            let Some(multipliers) = multipliers else { return Ok(()) };
            for &(c, index) in &rows.constraints_at[k] {
                let Constraint { sampled, integrated, first_row, .. } = &mut constraints[c];
                if sampled.term.is_linear() {
                    continue;
                }
                let n_rows = sampled.term.n_rows();
                let first = *first_row + if *integrated { 0 } else { index * n_rows };
                let weight = if *integrated { weight } else { 1.0 };
                let seed = &mut seed[..n_rows];
                seed.iter_mut().zip(&multipliers[first..]).for_each(|(seed, y)| *seed = weight * y);
                if seed.iter().any(|y| *y != 0.0) {
                    add_curvature(
                        &mut *sampled.term,
                        (node, seed),
                        tangent,
                        [tangents, bent],
                        pattern,
                        hessian,
                    )?;
                }
            }
            Ok(())
        })
    }
}

/// The gradient of one number of a node.
fn column(tangent: &NodeTangent, number: NodeNumber) -> &[f64] {
    let (matrix, entry) = match number {
        NodeNumber::Position { dof, .. } => (&tangent.position, dof),
        NodeNumber::Of(part, entry) => match part {
            Part::Time => return &tangent.time,
            Part::Velocity => (&tangent.velocity, entry),
            Part::Acceleration => (&tangent.acceleration, entry),
            Part::Torque => (&tangent.torque, entry),
            Part::Channel => (&tangent.channel, entry),
            Part::ChannelRate => (&tangent.channel_rate, entry),
            Part::ChannelSecondRate => (&tangent.channel_second_rate, entry),
        },
    };
    let n = tangent.variables.len();
    &matrix.as_slice()[entry * n..(entry + 1) * n]
}

/// Adds Xᵀ (Σ y_i ∂²r_i) X, X the tangents of the numbers of the node that the term depends on.
fn add_curvature(
    term: &mut dyn Term,
    (node, y): (&Node<'_>, &[f64]),
    tangent: &NodeTangent,
    [tangents, bent]: [&mut Vec<f64>; 2],
    pattern: &Pattern,
    hessian: &mut [f64],
) -> Result<(), EvaluationError> {
    let Some(term) = term.second_derivatives() else { return Ok(()) };
    tangents.clear();
    term.numbers().iter().for_each(|number| tangents.extend_from_slice(column(tangent, *number)));
    let second = term.weighted(node, y)?;
    let (n, m) = (tangent.variables.len(), second.ncols());
    bent.clear();
    bent.resize(n * m, 0.0);
    let tangents = DMatrixView::from_slice(tangents, n, m);
    let mut product = DMatrixViewMut::from_slice(bent, n, m);
    tangents.mul_to(second, &mut product);
    for (row, (column, bent)) in tangents.column_iter().zip(product.column_iter()).enumerate() {
        if second.column(row).iter().any(|x| *x != 0.0) {
            add_product(pattern, &tangent.variables, [bent.as_slice(), column.as_slice()], 1.0, hessian);
        }
    }
    Ok(())
}

/// Adds entries by `variables`, which are among those of the row.
fn add_row(rows: &Rows, row: usize, variables: &[usize], entries: &[f64], values: &mut [f64]) {
    let mut at = rows.variables[row].iter().zip(&rows.places[row]);
    for (variable, x) in variables.iter().zip(entries) {
        if let Some((_, place)) = at.find(|(v, _)| *v == variable) {
            values[*place] += x;
        }
    }
}

/// Adds c x yᵀ, x and y by `variables`, to the upper triangle; its entries are in the pattern.
fn add_product(pattern: &Pattern, variables: &[usize], [x, y]: [&[f64]; 2], c: f64, hessian: &mut [f64]) {
    for (j, column) in variables.iter().enumerate() {
        let factor = c * y[j];
        if factor == 0.0 {
            continue;
        }
        let place = pattern.columns[*column];
        let rows = &pattern.rows[place..pattern.columns[column + 1]];
        let values = &mut hessian[place..pattern.columns[column + 1]];
        if rows.len() == j + 1 {
            values.iter_mut().zip(x).for_each(|(h, x)| *h += factor * x);
            continue;
        }
        let mut at = rows.iter().zip(values);
        for (variable, x) in variables[..=j].iter().zip(x) {
            if let Some((_, h)) = at.find(|(row, _)| *row == variable) {
                *h += factor * x;
            }
        }
    }
}
