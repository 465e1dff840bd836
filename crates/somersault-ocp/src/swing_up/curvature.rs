//! The exact Hessian over steps between two nodes.
//!
//! All of a step but the acceleration a(θ, r̈) and the force F(θ, θ̇, r̈) is linear. With the multipliers μ of the
//! accelerations, which the pass backwards leaves, the Hessian is therefore a sum over the stages,
//!
//! ```text
//! H = Σ_s T_sᵀ (μ_s ∇²a + w_s ρ (∇F ∇Fᵀ + F ∇²F) + w_s W) T_s
//! ```
//! with the tangents T of (θ, θ̇, r̈), and of (r, ṙ), by the columns: the parameters that move the cart during these
//! steps, and the state at their start.

use super::passes::{INNER, Passes, Stage, WEIGHTS};
use somersault_multibody::models::CartPendulum;
use std::ops::Range;

/// Tangents by all columns.
#[derive(Debug, Clone)]
pub(super) struct Tangents {
    /// θ and θ̇ at the start of a step, then at its end.
    pub(super) state: [Vec<f64>; 2],
    sum: [Vec<f64>; 2],
    /// θ, θ̇ and θ̈ at a stage.
    stage: [Vec<f64>; 3],
    products: [Vec<f64>; 3],
    /// r, ṙ and r̈ at a stage.
    pub(super) cart: [Vec<f64>; 3],
}

impl Tangents {
    pub(super) fn new(n: usize) -> Self {
        let room = || vec![0.0; n];
        let three = || [room(), room(), room()];
        Self {
            state: [room(), room()],
            sum: [room(), room()],
            stage: three(),
            products: three(),
            cart: three(),
        }
    }

    /// hessian += factor Σ weight T Tᵀ over the components of the state.
    pub(super) fn add_distance(&self, weights: [f64; 4], factor: f64, n: usize, hessian: &mut [f64]) {
        let [angle, rate] = &self.state;
        let [r, r_rate, _] = &self.cart;
        for (tangent, weight) in [angle, r, rate, r_rate].into_iter().zip(weights) {
            let mut at = 0;
            for j in 0..n {
                let scaled = factor * weight * tangent[j];
                hessian[at..=at + j].iter_mut().zip(tangent).for_each(|(h, t)| *h += scaled * t);
                at += j + 1;
            }
        }
    }
}

/// Second derivatives by θ, θ̇ and r̈, symmetric: (θθ, θθ̇, θr̈, θ̇θ̇, θ̇r̈, r̈r̈).
type Curvature = [f64; 6];

/// hessian += Σ_i x_i y_iᵀ, whose sum is symmetric, in the first `n` columns; upper triangle by columns.
fn add_products(hessian: &mut [f64], x: [&[f64]; 3], y: [&[f64]; 3], n: usize) {
    let mut at = 0;
    for j in 0..n {
        // of equal lengths, so that nothing is checked in the loop
        let m = j + 1;
        let column = &mut hessian[at..at + m];
        let [a, b, c] = [y[0][j], y[1][j], y[2][j]];
        let [x0, x1, x2] = [&x[0][..m], &x[1][..m], &x[2][..m]];
        for i in 0..m {
            column[i] += x0[i] * a + x1[i] * b + x2[i] * c;
        }
        at += m;
    }
}

impl Passes {
    /// w ρ (∇F ∇Fᵀ + F ∇²F) + μ ∇²a.
    fn stage_curvature(&self, stage: &Stage, weight: f64) -> Curvature {
        let CartPendulum { mass, length, .. } = self.system;
        let Stage { rate, sin, cos, acceleration, force, multiplier, .. } = *stage;
        let inertia = mass * length;
        let outer = weight * self.force_weight;
        let ([f_angle, f_rate, f_push], by_angle) = self.slopes(stage);
        let inner = outer * force;
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

    /// Adds a stage whose tangents are there, and completes these by that of the acceleration.
    fn add_stage(&self, i: usize, weight: f64, tangents: &mut Tangents, n: usize, hessian: &mut [f64]) {
        let stage = &self.stages[i];
        let c = self.stage_curvature(stage, weight);
        let Tangents { stage: [angle, rate, acceleration], products, cart: [_, _, push], .. } = tangents;
        let [by_angle, by_rate, by_push] = products;
        let (_, a_angle) = self.slopes(stage);
        let a_push = stage.cos / self.system.length;
        for j in 0..n {
            let (x, v, u) = (angle[j], rate[j], push[j]);
            by_angle[j] = c[0] * x + c[1] * v + c[2] * u;
            by_rate[j] = c[1] * x + c[3] * v + c[4] * u;
            by_push[j] = c[2] * x + c[4] * v + c[5] * u;
            acceleration[j] = a_angle * x + a_push * u;
        }
        add_products(hessian, [angle, rate, push], [by_angle, by_rate, by_push], n);
    }

    /// The Hessian of `cost_factor` times what is paid during `steps`, and of the state at their end times its multipliers
    /// in the last pass backwards; by the `parameters`, then by the state at the start if that varies. Leaves the
    /// tangents at the end.
    pub(super) fn curvature(
        &self,
        steps: Range<usize>,
        parameters: Range<usize>,
        start_varies: bool,
        cost_factor: f64,
        tangents: &mut Tangents,
        hessian: &mut [f64],
    ) {
        let (h, n_stages) = (self.step, self.scheme.n_stages());
        let n_parameters = parameters.len();
        let n = n_parameters + if start_varies { 2 } else { 0 };
        hessian.fill(0.0);
        let Tangents { state, stage, cart, .. } = tangents;
        state.iter_mut().chain(stage).chain(cart).for_each(|part| part.fill(0.0));
        if start_varies {
            (tangents.state[0][n_parameters], tangents.state[1][n_parameters + 1]) = (1.0, 1.0);
        }
        let runs = self.has_running_weights();
        for k in steps.start..=steps.end {
            let last = k == self.n_steps;
            if k == steps.end && !last {
                break;
            }
            let weight = cost_factor * self.quadrature[k];
            for s in 0..if last { 1 } else { n_stages } {
                let place = self.place(k) + if last { 0 } else { self.scheme.point(s) };
                self.tables.row(place, 2, parameters.start, &mut tangents.cart[2][..n_parameters]);
                if s == 0 {
                    if runs || last {
                        for derivative in 0..2 {
                            let row = &mut tangents.cart[derivative][..n_parameters];
                            self.tables.row(place, derivative, parameters.start, row);
                        }
                        tangents.add_distance(self.running_weights, weight, n, hessian);
                    }
                    tangents.sum.iter_mut().for_each(|part| part.fill(0.0));
                }
                let Tangents { state, stage: [x, v, a], .. } = tangents;
                // the stage before is still there
                let inner = if s == 0 { 0.0 } else { h * INNER[s - 1] };
                for j in 0..n {
                    (x[j], v[j]) = (state[0][j] + inner * v[j], state[1][j] + inner * a[j]);
                }
                self.add_stage(k * n_stages + s, if s == 0 { weight } else { 0.0 }, tangents, n, hessian);
                let Tangents { sum, stage: [_, v, a], .. } = tangents;
                let fraction = h * if n_stages == 1 { 1.0 } else { WEIGHTS[s] };
                for j in 0..n {
                    sum[0][j] += fraction * v[j];
                    sum[1][j] += fraction * a[j];
                }
            }
            if !last {
                let Tangents { state, sum, .. } = tangents;
                for (state, sum) in state.iter_mut().zip(sum) {
                    state[..n].iter_mut().zip(&*sum).for_each(|(x, d)| *x += d);
                }
            }
        }
    }
}
