//! The pendulum integrated forwards, and adjoint passes backwards, over steps between two nodes.

use super::CartPendulumProblem;
use super::sine::Quadrant;
use super::tables::Tables;
use crate::error::OcpError;
use crate::shooting::Scheme;
use somersault_core::argument::{expect_finite, expect_not_negative, expect_positive};
use somersault_integrators::tableau::RUNGE_KUTTA_4;
use somersault_multibody::joint_motion::JointMotionError;
use somersault_multibody::models::CartPendulum;
use somersault_nlp::EvaluationError;
use std::ops::Range;

/// What both forms of the problem share: the numbers of the problem, the cart's coefficients, and all stages.
///
/// Cost: about ten floating-point operations and one sine with cosine for each stage and direction.
#[derive(Debug, Clone)]
pub(super) struct Passes {
    pub(super) system: CartPendulum,
    /// 1/ℓ: no division in the passes.
    pub(super) inverse_length: f64,
    pub(super) scheme: Scheme,
    pub(super) n_steps: usize,
    pub(super) step: f64,
    pub(super) start: [f64; 4],
    pub(super) target: [f64; 4],
    pub(super) terminal_weights: [f64; 4],
    pub(super) force_weight: f64,
    pub(super) running_weights: [f64; 4],
    pub(super) quadrature: Vec<f64>,
    pub(super) tables: Tables,
    pub(super) coefficients: Vec<f64>,
    differences: Vec<f64>,
    pub(super) by_coefficients: Vec<f64>,
    /// r̈ at all places, and the gradient by it.
    pub(super) pushes: Vec<f64>,
    pub(super) by_pushes: Vec<f64>,
    /// Stages of all steps, and the last node.
    pub(super) stages: Vec<Stage>,
}

/// One evaluation of the pendulum, a line of the cache.
#[derive(Debug, Clone, Copy, Default)]
#[repr(align(64))]
pub(super) struct Stage {
    pub(super) angle: f64,
    pub(super) rate: f64,
    pub(super) push: f64,
    pub(super) sin: f64,
    pub(super) cos: f64,
    pub(super) acceleration: f64,
    pub(super) force: f64,
    /// The value of the acceleration: its multiplier, from the last pass backwards.
    pub(super) multiplier: f64,
}

/// Inner factors of the classical Runge–Kutta method, each of the stage before, and its weights.
pub(super) const INNER: [f64; 3] =
    [RUNGE_KUTTA_4.rows[1][0], RUNGE_KUTTA_4.rows[2][1], RUNGE_KUTTA_4.rows[3][2]];
pub(super) const WEIGHTS: [f64; 4] = {
    let factors = RUNGE_KUTTA_4.weights.factors;
    [factors[0], factors[1], factors[2], factors[3]]
};

impl Passes {
    pub(super) fn try_new(problem: &CartPendulumProblem) -> Result<Self, OcpError> {
        problem.expect_valid()?;
        expect_positive("system.mass", problem.system.mass)?;
        expect_positive("system.length", problem.system.length)?;
        expect_not_negative("system.cart_mass", problem.system.cart_mass)?;
        expect_finite("system.gravity", &[problem.system.gravity])?;
        let motion = problem.motion()?;
        let (n_coefficients, n_steps, scheme) = (motion.n_coefficients(), problem.n_steps, problem.scheme);
        let n_places = scheme.points_per_step() * n_steps + 1;
        Ok(Self {
            pushes: vec![0.0; n_places],
            by_pushes: vec![0.0; n_places],
            system: problem.system,
            inverse_length: 1.0 / problem.system.length,
            scheme,
            n_steps,
            step: problem.duration / n_steps as f64,
            start: problem.start,
            target: problem.target,
            terminal_weights: problem.terminal_weights,
            force_weight: problem.force_weight,
            running_weights: problem.running_weights,
            quadrature: scheme.quadrature(n_steps).iter().map(|w| w * problem.duration).collect(),
            coefficients: vec![0.0; n_coefficients],
            differences: vec![0.0; n_coefficients - 2],
            by_coefficients: vec![0.0; n_coefficients],
            stages: vec![Stage::default(); scheme.n_stages() * n_steps + 1],
            tables: Tables::try_new(motion, scheme, n_steps, problem.duration)
                .map_err(JointMotionError::from)?,
        })
    }

    /// Moves the cart as the parameters say.
    pub(super) fn set_cart(&mut self, parameters: &[f64]) {
        self.tables.motion.coefficients_into(parameters, &mut self.coefficients);
        self.tables.pushes(&self.coefficients, &mut self.differences, &mut self.pushes);
    }

    /// θ(0), θ̇(0).
    pub(super) fn first_state(&self) -> [f64; 2] {
        let [angle, _, rate, _] = self.start;
        [angle, rate]
    }

    /// Places before the start of step `k`.
    pub(super) fn place(&self, k: usize) -> usize {
        k * self.scheme.points_per_step()
    }

    /// Where steps begin, and the last node of all, which belongs to the steps before it.
    pub(super) fn nodes(&self, steps: &Range<usize>) -> Range<usize> {
        steps.start..steps.end + usize::from(steps.end == self.n_steps)
    }

    #[inline(always)]
    fn stage(&self, place: usize, angle: f64, rate: f64, (sin, cos): (f64, f64)) -> Stage {
        let CartPendulum { mass, length, gravity, .. } = self.system;
        let push = self.pushes[place];
        let acceleration = (push * self.inverse_length) * cos + (gravity * self.inverse_length) * sin;
        let total = self.system.cart_mass + mass;
        let force = total * push - mass * length * (acceleration * cos - rate * rate * sin);
        Stage { angle, rate, push, sin, cos, acceleration, force, multiplier: 0.0 }
    }

    /// x − x_f at node `k`.
    pub(super) fn apart(&self, k: usize, state: [f64; 2]) -> [f64; 4] {
        self.tables.apart(self.place(k), state, &self.target, &self.coefficients)
    }

    pub(super) fn has_running_weights(&self) -> bool {
        self.running_weights != [0.0; 4]
    }

    /// Integrates from a state (θ, θ̇) at the start of `steps`: what is paid on the way, and the state at their end.
    pub(super) fn forward(
        &mut self,
        steps: Range<usize>,
        [mut angle, mut rate]: [f64; 2],
    ) -> (f64, [f64; 2]) {
        if self.scheme.n_stages() == 1 {
            return self.forward_euler(steps, [angle, rate]);
        }
        let (h, n_stages) = (self.step, self.scheme.n_stages());
        let runs = self.has_running_weights();
        let mut quadrant = Quadrant::of(angle);
        let mut cost = 0.0;
        for k in self.nodes(&steps) {
            let first = self.stage(self.place(k), angle, rate, quadrant.sin_cos(angle));
            self.stages[k * n_stages] = first;
            cost += 0.5 * self.quadrature[k] * self.force_weight * first.force * first.force;
            if runs {
                let apart = self.apart(k, [angle, rate]);
                cost += self.quadrature[k] * half_squares(&self.running_weights, &apart);
            }
            if k == self.n_steps {
                break;
            }
            let mut before = first;
            let mut sum = [WEIGHTS[0] * first.rate, WEIGHTS[0] * first.acceleration];
            for s in 1..n_stages {
                let (x, v) =
                    (angle + h * INNER[s - 1] * before.rate, rate + h * INNER[s - 1] * before.acceleration);
                before = self.stage(self.place(k) + self.scheme.point(s), x, v, quadrant.sin_cos(x));
                self.stages[k * n_stages + s] = before;
                sum[0] += WEIGHTS[s] * before.rate;
                sum[1] += WEIGHTS[s] * before.acceleration;
            }
            angle += h * sum[0];
            rate += h * sum[1];
        }
        (cost, [angle, rate])
    }

    /// F by θ, θ̇ and r̈, and θ̈ by θ.
    #[inline(always)]
    pub(super) fn slopes(&self, stage: &Stage) -> ([f64; 3], f64) {
        let CartPendulum { cart_mass, mass, length, gravity } = self.system;
        let Stage { rate, push, sin, cos, acceleration, .. } = *stage;
        let inertia = mass * length;
        let by_angle = (gravity * cos - push * sin) * self.inverse_length;
        let force_by_angle = inertia * (acceleration * sin + rate * rate * cos - by_angle * cos);
        let force_by_rate = 2.0 * inertia * rate * sin;
        ([force_by_angle, force_by_rate, cart_mass + mass - mass * cos * cos], by_angle)
    }

    /// Gradients by (θ, θ̇) at a stage, from those by its acceleration and by its force; adds that by r̈.
    #[inline(always)]
    fn pull_stage(&mut self, i: usize, place: usize, multiplier: f64, by_force: f64) -> [f64; 2] {
        let ([force_by_angle, force_by_rate, force_by_push], by_angle) = self.slopes(&self.stages[i]);
        self.stages[i].multiplier = multiplier;
        self.by_pushes[place] +=
            multiplier * self.stages[i].cos * self.inverse_length + by_force * force_by_push;
        [multiplier * by_angle + by_force * force_by_angle, by_force * force_by_rate]
    }

    /// From a gradient by the whole state at node `k` that by (θ, θ̇); adds that by the cart.
    pub(super) fn pull_state(&mut self, k: usize, by: [f64; 4]) -> [f64; 2] {
        self.tables.pull_state(self.place(k), by, &mut self.by_coefficients)
    }

    /// From a gradient by the state at the end of `steps` that by the state at their start, with `cost_factor` times what
    /// is paid on the way; adds that by the cart's coefficients, and leaves the multipliers of the accelerations.
    pub(super) fn backward(
        &mut self,
        steps: Range<usize>,
        [mut by_angle, mut by_rate]: [f64; 2],
        cost_factor: f64,
    ) -> [f64; 2] {
        if self.scheme.n_stages() == 1 {
            return self.backward_euler(steps, [by_angle, by_rate], cost_factor);
        }
        let (h, n_stages) = (self.step, self.scheme.n_stages());
        let runs = self.has_running_weights();
        let places = self.place(steps.start)..self.place(steps.end) + 1;
        self.by_pushes[places.clone()].fill(0.0);
        for k in self.nodes(&steps).rev() {
            let (i, place) = (k * n_stages, self.place(k));
            let weight = cost_factor * self.quadrature[k];
            let by_force = weight * self.force_weight * self.stages[i].force;
            let [x, v] = if k == self.n_steps {
                self.pull_stage(i, place, 0.0, by_force)
            } else {
                let (mut x, mut v) = (0.0, 0.0);
                // by rate and acceleration of the stage at hand
                let (mut on_rate, mut on_acceleration) =
                    (h * WEIGHTS[3] * by_angle, h * WEIGHTS[3] * by_rate);
                for s in (1..n_stages).rev() {
                    let place = place + self.scheme.point(s);
                    let [by_x, by_v] = self.pull_stage(i + s, place, on_acceleration, 0.0);
                    let by_v = by_v + on_rate;
                    x += by_x;
                    v += by_v;
                    on_rate = h * (WEIGHTS[s - 1] * by_angle + INNER[s - 1] * by_x);
                    on_acceleration = h * (WEIGHTS[s - 1] * by_rate + INNER[s - 1] * by_v);
                }
                let [by_x, by_v] = self.pull_stage(i, place, on_acceleration, by_force);
                [x + by_x, v + by_v + on_rate]
            };
            by_angle += x;
            by_rate += v;
            if runs {
                let Stage { angle, rate, .. } = self.stages[i];
                let apart = self.apart(k, [angle, rate]);
                let by = std::array::from_fn(|i| weight * self.running_weights[i] * apart[i]);
                let [x, v] = self.pull_state(k, by);
                by_angle += x;
                by_rate += v;
            }
        }
        self.tables.pull_pushes(places, &self.by_pushes, &mut self.by_coefficients);
        [by_angle, by_rate]
    }
}

/// ½ xᵀ diag(w) x.
pub(super) fn half_squares(weights: &[f64; 4], x: &[f64; 4]) -> f64 {
    0.5 * x.iter().zip(weights).map(|(x, w)| w * x * x).sum::<f64>()
}

/// The cost, if it is a number.
pub(super) fn finite(cost: f64) -> Result<f64, EvaluationError> {
    if cost.is_finite() {
        Ok(cost)
    } else {
        Err(EvaluationError::Undefined { what: "the cost of the swing-up".to_owned() })
    }
}
