//! Passes by explicit Euler, whose steps have one stage each.
//!
//! What a step waits for is short: the next sine for two sums after this one, since θ + h θ̇ is known before; backwards
//! two products and sums, since all that multiplies the gradients is known from the pass forwards.

use super::passes::{Passes, Stage, half_squares};
use super::sine::Quadrant;
use std::ops::Range;

impl Passes {
    /// [`forward`](Self::forward) by explicit Euler.
    pub(super) fn forward_euler(
        &mut self,
        steps: Range<usize>,
        [mut angle, rate]: [f64; 2],
    ) -> (f64, [f64; 2]) {
        let (system, h, per_length) = (self.system, self.step, self.inverse_length);
        let (total, inertia) = (system.cart_mass + system.mass, system.mass * system.length);
        let nodes = self.nodes(&steps);
        let mut quadrant = Quadrant::of(angle);
        let (mut turn, per_step, to_turn) = (h * rate, 1.0 / h, h * h * per_length);
        let (mut cost, mut end) = (0.0, [angle, rate]);
        // slices of one length: no bounds are checked in the loop
        let n = nodes.len();
        let stages = &mut self.stages[nodes.clone()][..n];
        let (pushes, weights) = (&self.pushes[nodes.clone()][..n], &self.quadrature[nodes.clone()][..n]);
        for k in 0..n {
            let push = pushes[k];
            let (sin, cos) = quadrant.sin_cos_here(angle);
            let rate = turn * per_step;
            end = [angle, rate];
            quadrant.turn(turn);
            angle += turn;
            turn += (push * to_turn) * cos + (system.gravity * to_turn) * sin;
            let acceleration = (push * per_length) * cos + (system.gravity * per_length) * sin;
            let force = total * push - inertia * (acceleration * cos - rate * rate * sin);
            cost += weights[k] * (force * force);
            stages[k] = Stage { angle: end[0], rate, push, sin, cos, acceleration, force, multiplier: 0.0 };
        }
        if steps.end < self.n_steps {
            end = [angle, turn * per_step];
        }
        cost *= 0.5 * self.force_weight;
        if self.has_running_weights() {
            for k in nodes {
                let apart = self.apart(k, [self.stages[k].angle, self.stages[k].rate]);
                cost += self.quadrature[k] * half_squares(&self.running_weights, &apart);
            }
        }
        (cost, end)
    }

    /// [`backward`](Self::backward) by explicit Euler.
    pub(super) fn backward_euler(
        &mut self,
        steps: Range<usize>,
        [mut by_angle, mut by_rate]: [f64; 2],
        cost_factor: f64,
    ) -> [f64; 2] {
        let (system, per_length) = (self.system, self.inverse_length);
        let total = system.cart_mass + system.mass;
        let runs = self.has_running_weights();
        let force_factor = cost_factor * self.force_weight;
        // the force at the last node of all is paid, and moves nothing
        let mut h = if steps.end == self.n_steps { 0.0 } else { self.step };
        let nodes = self.nodes(&steps);
        let n = nodes.len();
        let (stages, by_pushes) =
            (&mut self.stages[nodes.clone()][..n], &mut self.by_pushes[nodes.clone()][..n]);
        let weights = &self.quadrature[nodes.clone()][..n];
        for k in (0..n).rev() {
            let stage = &mut stages[k];
            let Stage { angle, rate, push, sin, cos, acceleration, force, .. } = *stage;
            let by_force = force_factor * weights[k] * force;
            let on_mass = system.mass * by_force;
            let slope = system.gravity * cos - push * sin;
            let along = on_mass * (system.length * (acceleration * sin + rate * rate * cos) - cos * slope);
            let spin = 2.0 * on_mass * system.length * rate * sin;
            let to_pull = h * per_length;
            stage.multiplier = h * by_rate;
            by_pushes[k] = by_rate * (to_pull * cos) + (by_force * total - on_mass * cos * cos);
            let before = by_rate;
            by_rate = (by_rate + spin) + h * by_angle;
            by_angle = (by_angle + along) + before * (to_pull * slope);
            h = self.step;
            if runs {
                let place = steps.start + k;
                let apart = self.tables.apart(place, [angle, rate], &self.target, &self.coefficients);
                let weight = cost_factor * weights[k];
                let by = std::array::from_fn(|i| weight * self.running_weights[i] * apart[i]);
                let [x, v] = self.tables.pull_state(place, by, &mut self.by_coefficients);
                by_angle += x;
                by_rate += v;
            }
        }
        self.tables.pull_pushes(nodes, &self.by_pushes, &mut self.by_coefficients);
        [by_angle, by_rate]
    }
}
