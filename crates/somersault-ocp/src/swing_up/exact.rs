//! The exact Hessian of the swing-up.
//!
//! All of a step but the acceleration a(θ, r̈) and the force F(θ, θ̇, r̈) is linear. With the multipliers μ of the
//! accelerations, which the pass backwards leaves, the Hessian is therefore a sum over the stages,
//!
//! ```text
//! H = Σ_s T_sᵀ (μ_s ∇²a + w_s ρ (∇F ∇Fᵀ + F ∇²F) + w_s W) T_s + T_Nᵀ Q T_N
//! ```
//! with the tangents T of (θ, θ̇, r̈), and of (r, ṙ), by the parameters. A stage depends on no parameter whose spline
//! begins later.

use super::SwingUp;
use super::program::{INNER, Stage, WEIGHTS};
use somersault_multibody::models::CartPendulum;

/// Tangents by all parameters.
#[derive(Debug, Clone)]
pub(super) struct Work {
    /// θ and θ̇ at the start of a step, then at its end.
    state: [Vec<f64>; 2],
    sum: [Vec<f64>; 2],
    /// θ, θ̇ and θ̈ at a stage.
    stage: [Vec<f64>; 3],
    products: [Vec<f64>; 3],
}

impl Work {
    pub(super) fn new(n: usize) -> Self {
        let room = || vec![0.0; n];
        Self {
            state: [room(), room()],
            sum: [room(), room()],
            stage: [room(), room(), room()],
            products: [room(), room(), room()],
        }
    }
}

/// Second derivatives by θ, θ̇ and r̈, symmetric: (θθ, θθ̇, θr̈, θ̇θ̇, θ̇r̈, r̈r̈).
type Curvature = [f64; 6];

/// hessian += Σ_i x_i y_iᵀ, whose sum is symmetric, in the first `n` parameters; upper triangle by columns.
fn add_products(hessian: &mut [f64], x: [&[f64]; 3], y: [&[f64]; 3], n: usize) {
    let mut at = 0;
    for j in 0..n {
        let column = &mut hessian[at..=at + j];
        let [a, b, c] = [y[0][j], y[1][j], y[2][j]];
        let [x0, x1, x2] = [&x[0][..=j], &x[1][..=j], &x[2][..=j]];
        for i in 0..=j {
            column[i] += x0[i] * a + x1[i] * b + x2[i] * c;
        }
        at += j + 1;
    }
}

impl SwingUp {
    /// w ρ (∇F ∇Fᵀ + F ∇²F) + μ ∇²a.
    fn stage_curvature(&self, stage: &Stage, weight: f64) -> Curvature {
        let CartPendulum { cart_mass, mass, length, gravity } = self.system;
        let Stage { rate, push, sin, cos, acceleration, force, multiplier, .. } = *stage;
        let inertia = mass * length;
        let by_angle = (gravity * cos - push * sin) / length;
        let factor = weight * self.force_weight;
        let f_angle = inertia * (acceleration * sin + rate * rate * cos - by_angle * cos);
        let f_rate = 2.0 * inertia * rate * sin;
        let f_push = cart_mass + mass - mass * cos * cos;
        let (outer, inner) = (factor, factor * force);
        [
            outer * f_angle * f_angle
                + inner * inertia * (2.0 * (acceleration * cos + by_angle * sin) - rate * rate * sin)
                - multiplier * acceleration,
            outer * f_angle * f_rate + inner * 2.0 * inertia * rate * cos,
            outer * f_angle * f_push + inner * 2.0 * mass * sin * cos - multiplier * sin / length,
            outer * f_rate * f_rate + inner * 2.0 * inertia * sin,
            outer * f_rate * f_push,
            outer * f_push * f_push,
        ]
    }

    /// Adds a stage whose tangents are in the workspace, and completes these by that of the acceleration.
    fn add_stage(&mut self, i: usize, place: usize, weight: f64, cost_factor: f64, hessian: &mut [f64]) {
        let CartPendulum { length, gravity, .. } = self.system;
        let stage = self.stages[i];
        let c = self.stage_curvature(&stage, weight).map(|c| cost_factor * c);
        let n = self.tables.reached[place];
        let push = &self.tables.rows[place][2];
        let Work { stage: tangents, products, .. } = &mut self.work;
        let [angle, rate, acceleration] = tangents;
        let [by_angle, by_rate, by_push] = products;
        let (a_angle, a_push) = ((gravity * stage.cos - stage.push * stage.sin) / length, stage.cos / length);
        for j in 0..n {
            let (x, v, u) = (angle[j], rate[j], push[j]);
            by_angle[j] = c[0] * x + c[1] * v + c[2] * u;
            by_rate[j] = c[1] * x + c[3] * v + c[4] * u;
            by_push[j] = c[2] * x + c[4] * v + c[5] * u;
            acceleration[j] = a_angle * x + a_push * u;
        }
        add_products(hessian, [angle, rate, push], [by_angle, by_rate, by_push], n);
    }

    /// Adds Σ weight T Tᵀ over the components of the state at a node, whose tangents are in the workspace.
    fn add_distance(&mut self, weights: [f64; 4], factor: f64, k: usize, hessian: &mut [f64]) {
        let place = k * self.scheme.points_per_step();
        let n = self.tables.reached[place];
        let rows = &self.tables.rows[place];
        let [angle, rate] = &self.work.state;
        for (tangent, weight) in [angle, &rows[0], rate, &rows[1]].into_iter().zip(weights) {
            let mut at = 0;
            for j in 0..n {
                let scaled = factor * weight * tangent[j];
                hessian[at..=at + j].iter_mut().zip(tangent).for_each(|(h, t)| *h += scaled * t);
                at += j + 1;
            }
        }
    }

    pub(super) fn exact_hessian(&mut self, cost_factor: f64, hessian: &mut [f64]) {
        let (h, n_stages) = (self.step, self.scheme.n_stages());
        let per_step = self.scheme.points_per_step();
        hessian.fill(0.0);
        // what no spline has reached stays zero
        let Work { state, stage, .. } = &mut self.work;
        state.iter_mut().chain(stage).for_each(|part| part.fill(0.0));
        for k in 0..=self.n_steps {
            let weight = self.quadrature[k];
            if self.running_weights != [0.0; 4] {
                self.add_distance(self.running_weights, cost_factor * weight, k, hessian);
            }
            let n = self.tables.reached[(k * per_step + per_step).min(self.tables.reached.len() - 1)];
            let last = k == self.n_steps;
            for s in 0..if last { 1 } else { n_stages } {
                let Work { state, sum, stage, .. } = &mut self.work;
                let [x, v, a] = stage;
                // the stage before is still there
                let inner = if s == 0 { 0.0 } else { h * INNER[s - 1] };
                for j in 0..n {
                    (x[j], v[j]) = (state[0][j] + inner * v[j], state[1][j] + inner * a[j]);
                }
                if s == 0 {
                    sum.iter_mut().for_each(|part| part[..n].fill(0.0));
                }
                let place = k * per_step + if last { 0 } else { self.scheme.point(s) };
                let weight = if s == 0 { weight } else { 0.0 };
                self.add_stage(k * n_stages + s, place, weight, cost_factor, hessian);
                let Work { sum, stage, .. } = &mut self.work;
                let share = h * if n_stages == 1 { 1.0 } else { WEIGHTS[s] };
                for j in 0..n {
                    sum[0][j] += share * stage[1][j];
                    sum[1][j] += share * stage[2][j];
                }
            }
            if !last {
                let Work { state, sum, .. } = &mut self.work;
                for (state, sum) in state.iter_mut().zip(sum) {
                    state[..n].iter_mut().zip(&*sum).for_each(|(x, d)| *x += d);
                }
            }
        }
        self.add_distance(self.terminal_weights, cost_factor, self.n_steps, hessian);
    }
}
