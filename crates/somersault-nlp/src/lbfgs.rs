//! Limited-memory BFGS with bounds on variables.

use crate::error::SolverError;
use crate::first_order::{Direction, Limits, descend};
use crate::nlp::Nlp;
use crate::program::{Point, max_norm};
use crate::report::{Iteration, Report, Start};
use crate::solver::NlpSolver;
use somersault_core::cancel::Flow;
use std::collections::VecDeque;

/// L-BFGS by the two-loop recursion (Nocedal & Wright 2006, algorithm 7.4) on the variables that no bound holds,
/// with a backtracking search along the projected path (Bertsekas 1982).
///
/// For programs without constraints, with too many variables for a dense Hessian. Steps along which the gradient
/// shows no positive curvature are not remembered.
#[derive(Debug, Clone, PartialEq)]
pub struct Lbfgs {
    /// Steps remembered, 3 to 20 as a rule.
    pub memory: usize,
    /// When to stop.
    pub limits: Limits,
}

impl Default for Lbfgs {
    fn default() -> Self {
        Self { memory: 10, limits: Limits::default() }
    }
}

impl NlpSolver for Lbfgs {
    fn solve(
        &self,
        nlp: &mut dyn Nlp,
        start: &Start,
        on_iteration: &mut dyn FnMut(&Iteration<'_>) -> Flow,
    ) -> Result<Report, SolverError> {
        if self.memory == 0 {
            return Err(SolverError::Setting { argument: "memory", found: 0.0, allowed: "at least 1" });
        }
        let mut memory = Memory { capacity: self.memory, pairs: VecDeque::new(), weights: Vec::new() };
        descend("L-BFGS", &self.limits, &mut memory, nlp, start, on_iteration)
    }
}

/// A step s and the change y of the gradient along it.
struct Pair {
    s: Vec<f64>,
    y: Vec<f64>,
}

struct Memory {
    capacity: usize,
    pairs: VecDeque<Pair>,
    /// α of each pair in the recursion, and its 1 / sᵀ y; zero where the free part has no positive curvature.
    weights: Vec<(f64, f64)>,
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

impl Direction for Memory {
    fn direction(&mut self, point: &Point, free: &[bool], direction: &mut [f64]) -> f64 {
        for (i, d) in direction.iter_mut().enumerate() {
            *d = if free[i] { -point.gradient[i] } else { 0.0 };
        }
        let slope = max_norm(direction).max(f64::MIN_POSITIVE);
        let steepest: f64 = dot(direction, direction);
        let free_dot =
            |a: &[f64], b: &[f64]| -> f64 { (0..free.len()).filter(|&i| free[i]).map(|i| a[i] * b[i]).sum() };
        self.weights.clear();
        let mut scale = None;
        for Pair { s, y } in self.pairs.iter().rev() {
            let curvature = free_dot(s, y);
            if curvature <= f64::EPSILON * free_dot(y, y) {
                self.weights.push((0.0, 0.0));
                continue;
            }
            scale.get_or_insert_with(|| curvature / free_dot(y, y));
            let alpha = free_dot(s, direction) / curvature;
            for i in (0..free.len()).filter(|&i| free[i]) {
                direction[i] -= alpha * y[i];
            }
            self.weights.push((alpha, 1.0 / curvature));
        }
        let Some(scale) = scale else { return 1.0 / slope };
        direction.iter_mut().for_each(|d| *d *= scale);
        for (Pair { s, y }, (alpha, inverse)) in self.pairs.iter().zip(self.weights.iter().rev()) {
            let beta = inverse * free_dot(y, direction);
            for i in (0..free.len()).filter(|&i| free[i]) {
                direction[i] += (alpha - beta) * s[i];
            }
        }
        let descent = -dot(direction, &point.gradient);
        if descent.is_finite() && descent > 1e-12 * steepest * scale {
            return 1.0;
        }
        self.pairs.clear();
        for (i, d) in direction.iter_mut().enumerate() {
            *d = if free[i] { -point.gradient[i] } else { 0.0 };
        }
        1.0 / slope
    }

    fn learn(&mut self, point: &Point, next: &Point, _: f64) {
        let mut pair = if self.pairs.len() == self.capacity { self.pairs.pop_front() } else { None }
            .unwrap_or_else(|| Pair { s: vec![0.0; point.z.len()], y: vec![0.0; point.z.len()] });
        for i in 0..point.z.len() {
            pair.s[i] = next.z[i] - point.z[i];
            pair.y[i] = next.gradient[i] - point.gradient[i];
        }
        if dot(&pair.s, &pair.y) > f64::EPSILON * dot(&pair.y, &pair.y) {
            self.pairs.push_back(pair);
        }
    }

    fn forget(&mut self) -> bool {
        let any = !self.pairs.is_empty();
        self.pairs.clear();
        any
    }
}
