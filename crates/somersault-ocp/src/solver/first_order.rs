//! ẋ = f(x, u, p, t) for shooting.
//!
//! A first-order system is one of second order whose forces do not depend on its positions: x, p and t are velocities, with
//! the accelerations f, 0 and 1, and u are the forces of degrees of freedom that do not move. The integral of the running cost is one
//! more velocity: a quadrature with weights other than those of the steps would have the controls move to where they are cheap.

use crate::collocation::{Shared, VectorFunction};
use crate::dynamics::{Dofs, HybridDynamics, HybridSecondDerivatives};
use nalgebra::DMatrix;
use somersault_nlp::EvaluationError;

/// Equations of motion whose controls are forces.
pub(super) struct FirstOrder {
    function: Shared,
    /// L, then path constraints.
    path: Shared,
    /// Lengths of x, p and u.
    sizes: [usize; 3],
    dofs: Dofs,
    arguments: Vec<f64>,
    jacobian: DMatrix<f64>,
    hessian: DMatrix<f64>,
    weights: Vec<f64>,
    path_values: Vec<f64>,
    path_jacobian: DMatrix<f64>,
}

impl FirstOrder {
    pub(super) fn new(
        [function, path]: [Shared; 2],
        n: usize,
        n_parameters: usize,
        n_controls: usize,
    ) -> Self {
        let n_arguments = n + n_parameters + 1 + n_controls;
        let (all, n_path) = (n_arguments + 1, path.n_outputs());
        Self {
            sizes: [n, n_parameters, n_controls],
            dofs: Dofs {
                n_positions: all,
                active: vec![false; all],
                positions: (0..all).map(Some).collect(),
                groups: Vec::new(),
            },
            arguments: vec![0.0; n_arguments],
            jacobian: DMatrix::zeros(n, n_arguments),
            hessian: DMatrix::zeros(n_arguments, n_arguments),
            weights: vec![0.0; n],
            path_values: vec![0.0; n_path],
            path_jacobian: DMatrix::zeros(n_path, n_arguments),
            function,
            path,
        }
    }

    /// The degrees of freedom whose forces are u.
    pub(super) fn controls(&self) -> std::ops::Range<usize> {
        let [n, n_parameters, n_controls] = self.sizes;
        let first = n + n_parameters + 2;
        first..first + n_controls
    }

    /// The degree of freedom whose velocity is the integral of the running cost.
    pub(super) fn cost(&self) -> usize {
        self.controls().start - 1
    }

    /// The degree of freedom that argument `a` of f is the velocity or the force of, and whether it is the force.
    fn place(&self, a: usize) -> (usize, bool) {
        let [n, _, m] = self.sizes;
        match a {
            _ if a < n => (a, false),
            _ if a < n + m => (self.controls().start + a - n, true),
            _ => (a - m, false),
        }
    }

    fn gather(&mut self, v: &[f64], known: &[f64]) {
        for a in 0..self.arguments.len() {
            let (dof, is_force) = self.place(a);
            self.arguments[a] = if is_force { known[dof] } else { v[dof] };
        }
    }
}

impl HybridDynamics for FirstOrder {
    fn dofs(&self) -> &Dofs {
        &self.dofs
    }

    fn calc(
        &mut self,
        _q: &[f64],
        v: &[f64],
        known: &[f64],
        found: &mut [f64],
    ) -> Result<(), EvaluationError> {
        self.gather(v, known);
        let [n, n_parameters, _] = self.sizes;
        found.fill(0.0);
        found[n + n_parameters] = 1.0;
        self.path.evaluate(&self.arguments, &mut self.path_values)?;
        found[self.cost()] = self.path_values[0];
        self.function.evaluate(&self.arguments, &mut found[..n])
    }

    fn calc_diff(
        &mut self,
        _q: &[f64],
        v: &[f64],
        known: &[f64],
        partials: &mut [f64],
    ) -> Result<(), EvaluationError> {
        self.gather(v, known);
        self.function.jacobian(&self.arguments, &mut self.jacobian)?;
        self.path.jacobian(&self.arguments, &mut self.path_jacobian)?;
        let (n, all, cost) = (self.sizes[0], v.len(), self.cost());
        partials.fill(0.0);
        for (a, column) in self.jacobian.column_iter().enumerate() {
            let (dof, is_force) = self.place(a);
            let first = (if is_force { 2 } else { 1 }) * all * all + dof * all;
            partials[first..first + n].iter_mut().zip(column.iter()).for_each(|(to, x)| *to = *x);
            partials[first + cost] = self.path_jacobian[(0, a)];
        }
        Ok(())
    }

    fn second_derivatives(&mut self) -> Option<&mut dyn HybridSecondDerivatives> {
        Some(self)
    }
}

impl HybridSecondDerivatives for FirstOrder {
    fn add_second_derivatives(
        &mut self,
        _q: &[f64],
        v: &[f64],
        known: &[f64],
        weights: &[f64],
        out: &mut [f64],
    ) -> Result<(), EvaluationError> {
        self.gather(v, known);
        self.weights.copy_from_slice(&weights[..self.sizes[0]]);
        self.hessian.fill(0.0);
        self.function.add_hessian(&self.arguments, &self.weights, &mut self.hessian)?;
        self.path_values.fill(0.0);
        self.path_values[0] = weights[self.cost()];
        self.path.add_hessian(&self.arguments, &self.path_values, &mut self.hessian)?;
        let all = v.len();
        for b in 0..self.arguments.len() {
            let column = self.row_of(b);
            for a in 0..=b {
                let (row, value) = (self.row_of(a), self.hessian[(a, b)]);
                out[column * 3 * all + row] += value;
                if a != b {
                    out[row * 3 * all + column] += value;
                }
            }
        }
        Ok(())
    }
}

impl FirstOrder {
    /// The place of argument `a` in (q, v, known).
    fn row_of(&self, a: usize) -> usize {
        let (dof, is_force) = self.place(a);
        (if is_force { 2 } else { 1 }) * self.dofs.n_velocities() + dof
    }
}
