//! Trees of bodies as equations of motion.
//!
//! x = (q, v), u the joint forces of the actuated degrees of freedom: q̇ = v, v̇ = a from forward dynamics. Jacobians
//! are the analytic partials of the tree. With inverse dynamics τ = ID(q, v, a) the Hessian of μᵀa is
//!
//! ```text
//! −Sᵀ ∇²(wᵀ ID) S,   w = M⁻¹ μ,   S = ∂(q, v, a)/∂(q, v, u)
//! ```
//! whose inner part is the partials of inverse dynamics over dual numbers: exact, one sweep for each position
//! and velocity.

use super::error::CollocationError;
use super::function::VectorFunction;
use nalgebra::DMatrix;
use num_dual::Dual64;
use somersault_core::Scalar;
use somersault_multibody::{Data, DerivativeData, Group, Model, Partials};
use somersault_nlp::EvaluationError;

/// Forward dynamics of a tree whose joints are revolute, prismatic or fixed.
#[derive(Debug, Clone)]
pub struct TreeDynamics {
    actuated: Vec<usize>,
    model: Model,
    data: Data,
    derivatives: DerivativeData,
    torque: Vec<f64>,
    dual: Model<Dual64>,
    dual_derivatives: DerivativeData<Dual64>,
    /// q, v, a.
    dual_arguments: Vec<Dual64>,
    /// ∂a by q, v, u.
    slopes: DMatrix<f64>,
    /// w.
    lever: Vec<f64>,
    input_products: Vec<f64>,
}

impl TreeDynamics {
    /// The tree with forces at the degrees of freedom `actuated`, in the order of the controls.
    pub fn try_new(model: &Model, actuated: &[usize]) -> Result<Self, CollocationError> {
        let n = model.n_velocities();
        for link in model.links() {
            if link.joint().group() != Group::Vector {
                return Err(CollocationError::NotAVector { joint: link.name().to_owned() });
            }
        }
        for (i, &k) in actuated.iter().enumerate() {
            if k >= n || actuated[..i].contains(&k) {
                return Err(CollocationError::Actuated { n, found: k });
            }
        }
        let dual: Model<Dual64> = model.cast();
        Ok(Self {
            actuated: actuated.to_vec(),
            data: Data::new(model),
            derivatives: DerivativeData::new(model),
            torque: vec![0.0; n],
            dual_derivatives: DerivativeData::new(&dual),
            dual_arguments: vec![Dual64::from_re(0.0); 3 * n],
            slopes: DMatrix::zeros(n, 2 * n + actuated.len()),
            lever: vec![0.0; n],
            input_products: vec![0.0; n],
            dual,
            model: model.clone(),
        })
    }

    /// Every degree of freedom actuated.
    pub fn try_fully_actuated(model: &Model) -> Result<Self, CollocationError> {
        let all: Vec<usize> = (0..model.n_velocities()).collect();
        Self::try_new(model, &all)
    }

    /// The tree.
    pub fn model(&self) -> &Model {
        &self.model
    }

    /// The degrees of freedom with a force, in the order of the controls.
    pub fn actuated(&self) -> &[usize] {
        &self.actuated
    }

    /// Length of x, twice the degrees of freedom.
    pub fn n_states(&self) -> usize {
        2 * self.model.n_velocities()
    }

    /// Length of u.
    pub fn n_controls(&self) -> usize {
        self.actuated.len()
    }

    /// What each entry of x is: `q_` or `v_` with the body that a joint moves, and a number after it where a joint has several.
    pub fn state_names(&self) -> Vec<String> {
        let bodies = self.bodies();
        ["q", "v"].iter().flat_map(|kind| bodies.iter().map(move |body| format!("{kind}_{body}"))).collect()
    }

    /// What each entry of u is: `u_` with the body that the joint moves.
    pub fn control_names(&self) -> Vec<String> {
        let bodies = self.bodies();
        self.actuated.iter().map(|k| format!("u_{}", bodies[*k])).collect()
    }

    /// The body that each degree of freedom moves, as part of a name of a variable; degrees of freedom are numbered where that is
    /// no name for each.
    fn bodies(&self) -> Vec<String> {
        let mut names = Vec::with_capacity(self.model.n_velocities());
        for body in 0..self.model.n_bodies() {
            let name = self.model.name(body).unwrap_or_default();
            let name: String =
                name.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '_' }).collect();
            let of_body = self.model.velocities_of(body);
            match of_body.len() {
                1 => names.push(name),
                n => names.extend((0..n).map(|k| format!("{name}_{k}"))),
            }
        }
        let mut sorted = names.clone();
        sorted.sort();
        if sorted.windows(2).any(|pair| pair[0] == pair[1]) {
            names.iter_mut().enumerate().for_each(|(k, name)| *name = k.to_string());
        }
        names
    }
}

/// q, v and the joint forces of all degrees of freedom.
fn split<'a, T: Scalar>(
    n: usize,
    arguments: &'a [T],
    actuated: &[usize],
    torque: &mut [T],
) -> (&'a [T], &'a [T]) {
    for (k, &dof) in actuated.iter().enumerate() {
        torque[dof] = arguments[2 * n + k];
    }
    (&arguments[..n], &arguments[n..2 * n])
}

/// ∂v̇ₖ by argument j.
fn partial<T: Scalar>(partials: &Partials<'_, T>, actuated: &[usize], n: usize, k: usize, j: usize) -> T {
    match j {
        _ if j < n => partials.q[(k, j)],
        _ if j < 2 * n => partials.v[(k, j - n)],
        _ => partials.input[(k, actuated[j - 2 * n])],
    }
}

/// A tree that cannot accelerate has no value there.
fn undefined(error: somersault_multibody::DynamicsError) -> EvaluationError {
    EvaluationError::Undefined { what: error.to_string() }
}

impl VectorFunction for TreeDynamics {
    fn n_outputs(&self) -> usize {
        self.n_states()
    }

    fn evaluate(&mut self, arguments: &[f64], values: &mut [f64]) -> Result<(), EvaluationError> {
        let n = self.model.n_velocities();
        let (q, v) = split(n, arguments, &self.actuated, &mut self.torque);
        let a = self.model.forward_dynamics(&mut self.data, q, v, &self.torque, &[]).map_err(undefined)?;
        values[..n].copy_from_slice(v);
        values[n..].copy_from_slice(a);
        Ok(())
    }

    fn jacobian(&mut self, arguments: &[f64], jacobian: &mut DMatrix<f64>) -> Result<(), EvaluationError> {
        let n = self.model.n_velocities();
        let (q, v) = split(n, arguments, &self.actuated, &mut self.torque);
        let partials = self
            .model
            .forward_dynamics_partials(&mut self.derivatives, q, v, &self.torque, &[])
            .map_err(undefined)?;
        jacobian.fill(0.0);
        for k in 0..n {
            jacobian[(k, n + k)] = 1.0;
            for j in 0..2 * n + self.actuated.len() {
                jacobian[(n + k, j)] = partial(&partials, &self.actuated, n, k, j);
            }
        }
        Ok(())
    }

    fn add_hessian(
        &mut self,
        arguments: &[f64],
        weights: &[f64],
        hessian: &mut DMatrix<f64>,
    ) -> Result<(), EvaluationError> {
        let n = self.model.n_velocities();
        let (q, v) = split(n, arguments, &self.actuated, &mut self.torque);
        let Self { actuated, slopes, lever, dual, dual_derivatives, .. } = self;
        let partials = self
            .model
            .forward_dynamics_partials(&mut self.derivatives, q, v, &self.torque, &[])
            .map_err(undefined)?;
        let n_arguments = 2 * n + actuated.len();
        for k in 0..n {
            for j in 0..n_arguments {
                slopes[(k, j)] = partial(&partials, actuated, n, k, j);
            }
            lever[k] = (0..n).map(|i| partials.input[(i, k)] * weights[n + i]).sum();
        }
        let (dual_q, rest) = self.dual_arguments.split_at_mut(n);
        let (dual_v, dual_a) = rest.split_at_mut(n);
        let given = q.iter().chain(v).chain(partials.value);
        dual_q.iter_mut().chain(&mut *dual_v).chain(&mut *dual_a).zip(given).for_each(|(x, &re)| x.re = re);
        // accelerations are linear in the forces, so no force is moved
        for j in 0..2 * n {
            for k in 0..n {
                dual_q[k].eps = f64::from(k == j);
                dual_v[k].eps = f64::from(n + k == j);
                dual_a[k].eps = slopes[(k, j)];
            }
            let second = dual
                .inverse_dynamics_partials(dual_derivatives, dual_q, dual_v, dual_a, &[])
                .map_err(undefined)?;
            let contract = |matrix: &DMatrix<Dual64>, i: usize| -> f64 {
                lever.iter().zip(matrix.column(i).iter()).map(|(w, m)| w * m.eps).sum()
            };
            for k in 0..n {
                self.input_products[k] = contract(second.input, k);
            }
            for i in (0..=j).chain(2 * n..n_arguments) {
                let direct = match i {
                    _ if i < n => contract(second.q, i),
                    _ if i < 2 * n => contract(second.v, i - n),
                    _ => 0.0,
                };
                let through: f64 =
                    self.input_products.iter().zip(slopes.column(i).iter()).map(|(p, s)| p * s).sum();
                hessian[(i.min(j), i.max(j))] -= direct + through;
            }
        }
        Ok(())
    }
}
