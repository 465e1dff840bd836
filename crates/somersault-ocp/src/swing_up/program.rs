//! Cost and gradient in one pass forwards and one backwards.

use super::CartPendulumProblem;
use super::tables::Tables;
use crate::error::{OcpError, expect_not_negative, expect_positive};
use crate::nlp::{Bounds, Curvature, EvaluationError, Nlp, Pattern, Structure};
use crate::shooting::Scheme;
use somersault_multibody::models::CartPendulum;

/// The problem of a [`CartPendulumProblem`] for a solver: parameters of the cart are its variables, and it has neither
/// bounds nor constraints. Its Hessian is exact.
///
/// Cost: about ten floating-point operations and one sine with cosine for each stage and direction; the Hessian
/// some six for each stage and pair of parameters.
#[derive(Debug, Clone)]
pub struct SwingUp {
    pub(super) system: CartPendulum,
    /// 1/ℓ: no division in the passes.
    inverse_length: f64,
    pub(super) scheme: Scheme,
    pub(super) n_steps: usize,
    pub(super) step: f64,
    start: [f64; 4],
    pub(super) target: [f64; 4],
    pub(super) terminal_weights: [f64; 4],
    pub(super) force_weight: f64,
    pub(super) running_weights: [f64; 4],
    pub(super) quadrature: Vec<f64>,
    pub(super) tables: Tables,
    structure: Structure,
    coefficients: Vec<f64>,
    pub(super) by_coefficients: Vec<f64>,
    /// Stages of all steps, and the last node.
    pub(super) stages: Vec<Stage>,
    pub(super) work: super::exact::Work,
}

/// One evaluation of the pendulum.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Stage {
    pub(super) angle: f64,
    pub(super) rate: f64,
    pub(super) push: f64,
    pub(super) sin: f64,
    pub(super) cos: f64,
    pub(super) acceleration: f64,
    pub(super) force: f64,
    /// What the acceleration is worth: its multiplier, from the last pass backwards.
    pub(super) multiplier: f64,
}

/// Inner factors of the classical Runge–Kutta method, and its weights.
pub(super) const INNER: [f64; 3] = [0.5, 0.5, 1.0];
pub(super) const WEIGHTS: [f64; 4] = [1.0 / 6.0, 1.0 / 3.0, 1.0 / 3.0, 1.0 / 6.0];

impl SwingUp {
    pub(super) fn try_new(problem: &CartPendulumProblem) -> Result<Self, OcpError> {
        problem.expect_valid()?;
        expect_positive("system.mass", problem.system.mass)?;
        expect_positive("system.length", problem.system.length)?;
        expect_not_negative("system.cart_mass", &[problem.system.cart_mass])?;
        crate::error::expect_finite("system.gravity", &[problem.system.gravity])?;
        let motion = problem.motion()?;
        let (n, n_steps, scheme) = (motion.n_parameters(), problem.n_steps, problem.scheme);
        let n_coefficients = motion.n_coefficients();
        let structure = Structure {
            variables: Bounds::free(n),
            constraints: Bounds::default(),
            jacobian: Pattern::dense(0, n),
            hessian: Pattern::upper_triangle(n),
        };
        let tables = Tables::new(motion, scheme, n_steps, problem.duration);
        let quadrature: Vec<f64> = scheme.quadrature(n_steps).iter().map(|w| w * problem.duration).collect();
        Ok(Self {
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
            quadrature,
            structure,
            coefficients: vec![0.0; n_coefficients],
            by_coefficients: vec![0.0; n_coefficients],
            stages: vec![Stage::default(); scheme.n_stages() * n_steps + 1],
            work: super::exact::Work::new(n),
            tables,
        })
    }

    /// The coefficients of the cart's spline for parameters `z`.
    pub fn coefficients(&self, z: &[f64]) -> Vec<f64> {
        let mut out = vec![0.0; self.coefficients.len()];
        self.tables.motion.coefficients_into(z, &mut out);
        out
    }

    #[inline(always)]
    fn stage(&self, place: usize, angle: f64, rate: f64) -> Stage {
        let CartPendulum { mass, length, gravity, .. } = self.system;
        let push = self.tables.places[place].value(2, &self.coefficients);
        let (sin, cos) = angle.sin_cos();
        let acceleration = (push * cos + gravity * sin) * self.inverse_length;
        let total = self.system.cart_mass + mass;
        let force = total * push - mass * length * (acceleration * cos - rate * rate * sin);
        Stage { angle, rate, push, sin, cos, acceleration, force, multiplier: 0.0 }
    }

    /// ½ (x − x_f)ᵀ diag(w) (x − x_f) with the cart at `place`.
    fn distance(&self, weights: &[f64; 4], place: usize, angle: f64, rate: f64) -> f64 {
        0.5 * self.apart(place, angle, rate).iter().zip(weights).map(|(x, w)| w * x * x).sum::<f64>()
    }

    fn apart(&self, place: usize, angle: f64, rate: f64) -> [f64; 4] {
        let place = &self.tables.places[place];
        let [r, r_rate] = [place.value(0, &self.coefficients), place.value(1, &self.coefficients)];
        let [a, b, c, d] = self.target;
        [angle - a, r - b, rate - c, r_rate - d]
    }

    fn has_running_weights(&self) -> bool {
        self.running_weights != [0.0; 4]
    }

    fn forward(&mut self) -> f64 {
        let (h, n_stages) = (self.step, self.scheme.n_stages());
        let per_step = self.scheme.points_per_step();
        let runs = self.has_running_weights();
        let [mut angle, _, mut rate, _] = self.start;
        let mut cost = 0.0;
        for k in 0..=self.n_steps {
            let first = self.stage(k * per_step, angle, rate);
            self.stages[k * n_stages] = first;
            cost += 0.5 * self.quadrature[k] * self.force_weight * first.force * first.force;
            if runs {
                let distance = self.distance(&self.running_weights, k * per_step, angle, rate);
                cost += self.quadrature[k] * distance;
            }
            if k == self.n_steps {
                break;
            }
            if n_stages == 1 {
                angle += h * rate;
                rate += h * first.acceleration;
                continue;
            }
            let mut before = first;
            let mut sum = [WEIGHTS[0] * first.rate, WEIGHTS[0] * first.acceleration];
            for s in 1..n_stages {
                let (x, v) =
                    (angle + h * INNER[s - 1] * before.rate, rate + h * INNER[s - 1] * before.acceleration);
                before = self.stage(k * per_step + self.scheme.point(s), x, v);
                self.stages[k * n_stages + s] = before;
                sum[0] += WEIGHTS[s] * before.rate;
                sum[1] += WEIGHTS[s] * before.acceleration;
            }
            angle += h * sum[0];
            rate += h * sum[1];
        }
        cost + self.distance(&self.terminal_weights, self.n_steps * per_step, angle, rate)
    }

    /// Gradients by (θ, θ̇) at a stage, from those by its acceleration and by its force; adds that by r̈.
    #[inline(always)]
    fn pull_stage(&mut self, i: usize, place: usize, multiplier: f64, by_force: f64) -> [f64; 2] {
        let CartPendulum { cart_mass, mass, length, gravity } = self.system;
        let Stage { rate, push, sin, cos, acceleration, .. } = self.stages[i];
        let inertia = mass * length;
        // F = (m_c + m) r̈ − m ℓ (θ̈ cos θ − θ̇² sin θ)
        let by_acceleration = multiplier - by_force * inertia * cos;
        let inverse = self.inverse_length;
        let by_push = by_acceleration * cos * inverse + by_force * (cart_mass + mass);
        let by_angle = by_acceleration * (gravity * cos - push * sin) * inverse
            + by_force * inertia * (acceleration * sin + rate * rate * cos);
        let by_rate = by_force * 2.0 * inertia * rate * sin;
        self.stages[i].multiplier = multiplier;
        self.tables.places[place].pull_back(2, by_push, &mut self.by_coefficients);
        [by_angle, by_rate]
    }

    /// What the state itself costs at a node, by (θ, θ̇); adds that by the cart.
    fn pull_distance(&mut self, weights: [f64; 4], factor: f64, k: usize) -> [f64; 2] {
        let place = k * self.scheme.points_per_step();
        let Stage { angle, rate, .. } = self.stages[k * self.scheme.n_stages()];
        let apart = self.apart(place, angle, rate);
        let by: [f64; 4] = std::array::from_fn(|i| factor * weights[i] * apart[i]);
        let place = &self.tables.places[place];
        place.pull_back(0, by[1], &mut self.by_coefficients);
        place.pull_back(1, by[3], &mut self.by_coefficients);
        [by[0], by[2]]
    }

    fn backward(&mut self) {
        let (h, n_stages) = (self.step, self.scheme.n_stages());
        let per_step = self.scheme.points_per_step();
        let runs = self.has_running_weights();
        self.by_coefficients.fill(0.0);
        let [mut by_angle, mut by_rate] = self.pull_distance(self.terminal_weights, 1.0, self.n_steps);
        for k in (0..=self.n_steps).rev() {
            let i = k * n_stages;
            let weight = self.quadrature[k];
            let by_force = weight * self.force_weight * self.stages[i].force;
            let [x, v] = if k == self.n_steps {
                self.pull_stage(i, k * per_step, 0.0, by_force)
            } else if n_stages == 1 {
                let [x, v] = self.pull_stage(i, k * per_step, h * by_rate, by_force);
                [x, v + h * by_angle]
            } else {
                let (mut x, mut v) = (0.0, 0.0);
                // by rate and acceleration of the stage at hand
                let (mut on_rate, mut on_acceleration) =
                    (h * WEIGHTS[3] * by_angle, h * WEIGHTS[3] * by_rate);
                for s in (1..n_stages).rev() {
                    let place = k * per_step + self.scheme.point(s);
                    let [by_x, by_v] = self.pull_stage(i + s, place, on_acceleration, 0.0);
                    let by_v = by_v + on_rate;
                    x += by_x;
                    v += by_v;
                    on_rate = h * (WEIGHTS[s - 1] * by_angle + INNER[s - 1] * by_x);
                    on_acceleration = h * (WEIGHTS[s - 1] * by_rate + INNER[s - 1] * by_v);
                }
                let [by_x, by_v] = self.pull_stage(i, k * per_step, on_acceleration, by_force);
                [x + by_x, v + by_v + on_rate]
            };
            by_angle += x;
            by_rate += v;
            if runs {
                let [x, v] = self.pull_distance(self.running_weights, weight, k);
                by_angle += x;
                by_rate += v;
            }
        }
    }
}

impl Nlp for SwingUp {
    fn structure(&self) -> &Structure {
        &self.structure
    }

    fn evaluate(&mut self, z: &[f64], _constraints: &mut [f64]) -> Result<f64, EvaluationError> {
        self.tables.motion.coefficients_into(z, &mut self.coefficients);
        let cost = self.forward();
        if cost.is_finite() {
            Ok(cost)
        } else {
            Err(EvaluationError::Undefined { what: "the cost of the swing-up".to_owned() })
        }
    }

    fn differentiate(
        &mut self,
        _z: &[f64],
        gradient: &mut [f64],
        _jacobian: &mut [f64],
    ) -> Result<(), EvaluationError> {
        self.backward();
        gradient.fill(0.0);
        self.tables.motion.pull_back(&self.by_coefficients, gradient);
        Ok(())
    }

    fn curvature(&self) -> Curvature {
        Curvature::Exact
    }

    fn hessian(
        &mut self,
        _z: &[f64],
        cost_factor: f64,
        _multipliers: &[f64],
        hessian: &mut [f64],
    ) -> Result<(), EvaluationError> {
        self.exact_hessian(cost_factor, hessian);
        Ok(())
    }
}
