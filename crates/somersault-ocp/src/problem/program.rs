//! The problem as a nonlinear program.

use super::{Constraint, Cost, Model, MotionProblem, SampledTerm};
use crate::WrongDerivative;
use crate::term::{Node, Term};
use crate::transcription::Transcription;
use somersault_nlp::{Curvature, EvaluationError, Nlp, NoHessian, Structure};

/// The rows of a term at a node; numbers that are not finite are an error.
fn evaluate(term: &mut dyn Term, node: &Node<'_>, rows: &mut [f64]) -> Result<(), EvaluationError> {
    term.evaluate(node, rows)?;
    if rows.iter().all(|r| r.is_finite()) {
        Ok(())
    } else {
        Err(EvaluationError::Undefined { what: format!("`{}` at t = {}", term.name(), node.time) })
    }
}

impl<T: Transcription> MotionProblem<T> {
    /// The value of each part of the cost at `z`, by name.
    pub fn costs(&mut self, z: &[f64]) -> Result<Vec<(String, f64)>, EvaluationError> {
        self.transcription.rollout(z)?;
        (0..self.costs.len())
            .map(|c| Ok((self.costs[c].sampled.term.name().to_owned(), self.cost(c)?)))
            .collect()
    }

    /// The first derivative of a term of a user's that differences contradict at `z`, of those that can be compared: what may be behind
    /// a solve that did not converge.
    pub fn wrong_derivative(&mut self, z: &[f64]) -> Result<Option<WrongDerivative>, EvaluationError> {
        self.transcription.rollout(z)?;
        let costs = self.costs.iter_mut().map(|cost| &mut cost.sampled);
        for SampledTerm { term, nodes } in costs.chain(self.constraints.iter_mut().map(|c| &mut c.sampled)) {
            let rows = &mut self.work.value[..term.n_rows()];
            // at first, halfway and last
            let mut last = None;
            for k in [0, nodes.len() / 2, nodes.len().saturating_sub(1)] {
                let Some(&number) = nodes.get(k).filter(|number| last.replace(**number) != Some(**number))
                else {
                    continue;
                };
                let node = self.transcription.node(number);
                evaluate(&mut **term, &node, rows)?;
                if let Some(wrong) = term.wrong_derivative(&node)? {
                    return Ok(Some(wrong));
                }
            }
        }
        Ok(None)
    }

    /// One part of the cost of the last rollout.
    fn cost(&mut self, c: usize) -> Result<f64, EvaluationError> {
        let Cost { sampled: SampledTerm { term, nodes }, loss, integrated } = &mut self.costs[c];
        let rows = &mut self.work.value[..term.n_rows()];
        let mut sum = 0.0;
        for &k in &*nodes {
            evaluate(&mut **term, &self.transcription.node(k), rows)?;
            let weight = if *integrated { self.transcription.weight(k) } else { 1.0 };
            sum += weight * loss.value(rows);
        }
        Ok(sum)
    }

    fn constraint(&mut self, c: usize, values: &mut [f64]) -> Result<(), EvaluationError> {
        let Constraint { sampled: SampledTerm { term, nodes }, integrated, first_row, .. } =
            &mut self.constraints[c];
        let n_rows = term.n_rows();
        if *integrated {
            let (sums, rows) = (&mut values[*first_row..*first_row + n_rows], &mut self.work.value[..n_rows]);
            sums.fill(0.0);
            for &k in &*nodes {
                evaluate(&mut **term, &self.transcription.node(k), rows)?;
                let weight = self.transcription.weight(k);
                sums.iter_mut().zip(&*rows).for_each(|(sum, r)| *sum += weight * r);
            }
        } else {
            for (rows, &k) in values[*first_row..].chunks_exact_mut(n_rows).zip(&*nodes) {
                evaluate(&mut **term, &self.transcription.node(k), rows)?;
            }
        }
        Ok(())
    }

    /// ∇f by one adjoint sweep.
    fn gradient(&mut self, gradient: &mut [f64]) -> Result<(), EvaluationError> {
        self.seed_costs(1.0)?;
        gradient.fill(0.0);
        self.transcription.pull_back(&self.work.rollout, gradient)
    }

    /// The gradient of σ f by the rollout.
    fn seed_costs(&mut self, factor: f64) -> Result<(), EvaluationError> {
        let Self { transcription, costs, work, .. } = self;
        work.rollout.clear();
        for Cost { sampled: SampledTerm { term, nodes }, loss, integrated } in costs {
            let n_rows = term.n_rows();
            let (rows, seed) = (&mut work.value[..n_rows], &mut work.seed[..n_rows]);
            for &k in &*nodes {
                let node = transcription.node(k);
                term.evaluate(&node, rows)?;
                let weight = factor * if *integrated { transcription.weight(k) } else { 1.0 };
                loss.gradient_into(rows, weight, seed);
                term.pull_back(&node, seed, &mut work.rollout.nodes[k])?;
                if *integrated {
                    work.rollout.weights[k] += factor * loss.value(rows);
                }
            }
        }
        Ok(())
    }

    /// Adds the gradient of yᵀ c by the rollout; linear constraints on variables have no part in it.
    fn seed_constraints(&mut self, multipliers: &[f64]) -> Result<(), EvaluationError> {
        let Self { transcription, constraints, work, .. } = self;
        let n_defects = work.rollout.defects.len();
        work.rollout.defects.copy_from_slice(&multipliers[..n_defects]);
        for Constraint { sampled: SampledTerm { term, nodes }, integrated, first_row, .. } in constraints {
            let n_rows = term.n_rows();
            for (set, &k) in nodes.iter().enumerate() {
                let first = *first_row + if *integrated { 0 } else { set * n_rows };
                let weight = if *integrated { transcription.weight(k) } else { 1.0 };
                let seed = &mut work.seed[..n_rows];
                seed.iter_mut().zip(&multipliers[first..]).for_each(|(seed, y)| *seed = weight * y);
                let node = transcription.node(k);
                term.evaluate(&node, &mut work.value[..n_rows])?;
                term.pull_back(&node, seed, &mut work.rollout.nodes[k])?;
            }
        }
        Ok(())
    }
}

impl<T: Transcription> Nlp for MotionProblem<T> {
    fn structure(&self) -> &Structure {
        &self.structure
    }

    fn evaluate(&mut self, z: &[f64], constraints: &mut [f64]) -> Result<f64, EvaluationError> {
        self.transcription.rollout(z)?;
        let defects = self.transcription.defects();
        constraints[..defects.len()].copy_from_slice(defects);
        for c in 0..self.constraints.len() {
            self.constraint(c, constraints)?;
        }
        let first = constraints.len() - self.linear.len();
        for (value, constraint) in constraints[first..].iter_mut().zip(&self.linear) {
            *value = constraint.factors.iter().map(|(variable, factor)| factor * z[*variable]).sum();
        }
        let mut sum = 0.0;
        for c in 0..self.costs.len() {
            sum += self.cost(c)?;
        }
        Ok(sum)
    }

    fn differentiate(
        &mut self,
        _z: &[f64],
        gradient: &mut [f64],
        jacobian: &mut [f64],
    ) -> Result<(), EvaluationError> {
        self.gradient(gradient)?;
        self.jacobian(jacobian)
    }

    fn curvature(&self) -> Curvature {
        if self.model == Model::Exact {
            Curvature::Exact
        } else if self.model == Model::Terms || self.costs.iter().any(|cost| cost.loss.is_curved()) {
            Curvature::GaussNewton
        } else {
            Curvature::None
        }
    }

    fn hessian(
        &mut self,
        _z: &[f64],
        cost_factor: f64,
        multipliers: &[f64],
        hessian: &mut [f64],
    ) -> Result<(), EvaluationError> {
        if self.curvature() == Curvature::None {
            return Err(NoHessian.into());
        }
        let multipliers_of_terms = (self.model != Model::GaussNewton).then_some(multipliers);
        self.gauss_newton(cost_factor, multipliers_of_terms, hessian)?;
        if self.model == Model::Exact {
            self.seed_costs(cost_factor)?;
            self.seed_constraints(multipliers)?;
            let what =
                || EvaluationError::Undefined { what: "the second derivative of the motion".to_owned() };
            let motion = self.transcription.second_derivatives().ok_or_else(what)?;
            motion.add_second_derivatives(&self.work.rollout, &self.structure.hessian, hessian)?;
        }
        Ok(())
    }
}
