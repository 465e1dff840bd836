//! Small convex quadratic programs with bounds and one sum.
//!
//! ```text
//! minimise ½ δᵀH δ + gᵀδ   subject to   l ≤ δ ≤ u,   Σ_{i ∈ S} δ_i ≤ c
//! ```
//! with H positive definite and 0 feasible. Primal active-set method: from δ = 0 it steps to the minimum on the active
//! constraints, stops at the first constraint in the way and takes it in, or lets the one go whose multiplier is most
//! negative. Some steps of O(n³); nothing is allocated. Made for the some thirty unknowns of a frame, where a general
//! solver allocates for each problem.
//!
//! Source: J. Nocedal and S. J. Wright, *Numerical Optimization*, Springer 2006, algorithm 16.3.

use nalgebra::{Cholesky, DMatrix, DVector};

/// Where a variable is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Activity {
    /// Between its bounds.
    Free,
    /// At the lower bound.
    Lower,
    /// At the upper bound.
    Upper,
}

/// A program with room to solve it.
#[derive(Debug, Clone)]
pub struct BoundedQuadratic {
    /// H; only its lower triangle is read.
    pub hessian: DMatrix<f64>,
    /// g.
    pub gradient: DVector<f64>,
    /// l ≤ 0.
    pub lower: DVector<f64>,
    /// u ≥ 0; infinite for variables whose sum bounds them, lest two constraints meet in one.
    pub upper: DVector<f64>,
    /// Whether a variable is in the sum.
    pub summed: Vec<bool>,
    /// c ≥ 0; infinite where there is no such constraint.
    pub sum_bound: f64,
    /// The minimum, once solved.
    pub solution: DVector<f64>,
    activity: Vec<Activity>,
    sum_active: bool,
    /// Gradient at the current point.
    slope: DVector<f64>,
    step: DVector<f64>,
    sum_step: DVector<f64>,
    factor: DMatrix<f64>,
}

/// H is not positive definite on the free variables, or a number is not finite.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("the Hessian is not positive definite")]
pub struct NotPositiveDefinite;

impl BoundedQuadratic {
    /// A program of `n` variables without constraints, everything else zero.
    pub fn new(n: usize) -> Self {
        Self {
            hessian: DMatrix::zeros(n, n),
            gradient: DVector::zeros(n),
            lower: DVector::repeat(n, f64::NEG_INFINITY),
            upper: DVector::repeat(n, f64::INFINITY),
            summed: vec![false; n],
            sum_bound: f64::INFINITY,
            solution: DVector::zeros(n),
            activity: vec![Activity::Free; n],
            sum_active: false,
            slope: DVector::zeros(n),
            step: DVector::zeros(n),
            sum_step: DVector::zeros(n),
            factor: DMatrix::zeros(n, n),
        }
    }

    /// Where each variable of the solution is.
    pub fn activity(&self) -> &[Activity] {
        &self.activity
    }

    /// Whether the sum of the solution is at its bound.
    pub fn sum_is_active(&self) -> bool {
        self.sum_active
    }

    /// Minimises. The solution is feasible whatever happens.
    pub fn solve(&mut self) -> Result<(), NotPositiveDefinite> {
        let n = self.gradient.len();
        self.solution.fill(0.0);
        self.sum_active = self.sum_bound <= 0.0;
        for i in 0..n {
            self.activity[i] = if self.lower[i] == 0.0 && (self.gradient[i] > 0.0 || self.upper[i] == 0.0) {
                Activity::Lower
            } else if self.upper[i] == 0.0 && self.gradient[i] < 0.0 {
                Activity::Upper
            } else {
                Activity::Free
            };
        }
        // each set of active constraints is met at most once; in practice there are a few
        for _ in 0..10 * (n + 1) {
            self.differentiate();
            let multiplier = self.step_to_minimum()?;
            match self.advance() {
                Some(share) if share < 1.0 => {}
                _ if self.release(multiplier) => {}
                _ => break,
            }
        }
        Ok(())
    }

    /// slope ← H δ + g.
    fn differentiate(&mut self) {
        self.slope.copy_from(&self.gradient);
        let n = self.slope.len();
        for j in 0..n {
            let x = self.solution[j];
            self.slope[j] += self.hessian[(j, j)] * x;
            for i in j + 1..n {
                let h = self.hessian[(i, j)];
                self.slope[i] += h * x;
                self.slope[j] += h * self.solution[i];
            }
        }
    }

    /// step ← to the minimum on the active constraints. Returns the multiplier of the sum.
    fn step_to_minimum(&mut self) -> Result<f64, NotPositiveDefinite> {
        let free = |i: usize| self.activity[i] == Activity::Free;
        let n = self.slope.len();
        let mut matrix = std::mem::replace(&mut self.factor, DMatrix::zeros(0, 0));
        // rows of variables that stay are those of the identity: one size for every active set
        for j in 0..n {
            for i in j..n {
                matrix[(i, j)] = match (i == j, free(i) && free(j)) {
                    (_, true) => self.hessian[(i, j)],
                    (same, false) => f64::from(u8::from(same)),
                };
            }
        }
        for i in 0..n {
            self.step[i] = if free(i) { -self.slope[i] } else { 0.0 };
            self.sum_step[i] = if free(i) && self.summed[i] { 1.0 } else { 0.0 };
        }
        let Some(cholesky) = Cholesky::new(matrix) else {
            self.factor = DMatrix::zeros(n, n);
            return Err(NotPositiveDefinite);
        };
        cholesky.solve_mut(&mut self.step);
        let mut multiplier = 0.0;
        if self.sum_active {
            cholesky.solve_mut(&mut self.sum_step);
            let sum = |v: &DVector<f64>| (0..n).filter(|&i| self.summed[i]).map(|i| v[i]).sum::<f64>();
            let (along, across) = (sum(&self.step), sum(&self.sum_step));
            if across > 0.0 {
                multiplier = along / across;
                self.step.axpy(-multiplier, &self.sum_step, 1.0);
            }
        }
        self.factor = cholesky.unpack_dirty();
        if self.step.iter().all(|x| x.is_finite()) { Ok(multiplier) } else { Err(NotPositiveDefinite) }
    }

    /// Goes along the step as far as the constraints let it, and takes the one in that is in the way. Returns the fraction
    /// of the step, if there was a step.
    fn advance(&mut self) -> Option<f64> {
        let (mut share, mut blocking) = (1.0, None);
        for i in 0..self.step.len() {
            let (step, at) = (self.step[i], self.solution[i]);
            if self.activity[i] != Activity::Free || step == 0.0 {
                continue;
            }
            let (bound, activity) =
                if step < 0.0 { (self.lower[i], Activity::Lower) } else { (self.upper[i], Activity::Upper) };
            let reach = ((bound - at) / step).max(0.0);
            if reach < share {
                (share, blocking) = (reach, Some((i, bound, activity)));
            }
        }
        let total = |v: &DVector<f64>| (0..v.len()).filter(|&i| self.summed[i]).map(|i| v[i]).sum::<f64>();
        let mut by_sum = false;
        if !self.sum_active && self.sum_bound.is_finite() {
            let rate = total(&self.step);
            let reach = ((self.sum_bound - total(&self.solution)) / rate).max(0.0);
            if rate > 0.0 && reach < share {
                (share, by_sum) = (reach, true);
            }
        }
        let moved = self.step.amax() > 0.0;
        self.solution.axpy(share, &self.step, 1.0);
        match blocking {
            _ if by_sum => self.sum_active = true,
            Some((i, bound, activity)) => (self.solution[i], self.activity[i]) = (bound, activity),
            None => {}
        }
        moved.then_some(share)
    }

    /// Lets the constraint go that keeps the value most from falling. False at the minimum.
    fn release(&mut self, multiplier: f64) -> bool {
        self.differentiate();
        let scale = self.gradient.amax().max(f64::MIN_POSITIVE);
        // what is rounding must not set a constraint free, which the next step would take in again
        let (mut worst, mut found) = (-1e-12 * scale, None);
        for i in 0..self.slope.len() {
            let sum = if self.sum_active && self.summed[i] { multiplier } else { 0.0 };
            let of_bound = match self.activity[i] {
                Activity::Lower if self.lower[i] < self.upper[i] => self.slope[i] + sum,
                Activity::Upper => -(self.slope[i] + sum),
                // a bound that is an equation is never let go
                Activity::Lower | Activity::Free => continue,
            };
            if of_bound < worst {
                (worst, found) = (of_bound, Some(i));
            }
        }
        if self.sum_active && multiplier < worst {
            self.sum_active = false;
            return true;
        }
        let Some(i) = found else { return false };
        self.activity[i] = Activity::Free;
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    /// A random program with a strictly convex H; every third has the sum.
    fn random(rng: &mut ChaCha8Rng, n: usize) -> BoundedQuadratic {
        let mut program = BoundedQuadratic::new(n);
        let root = DMatrix::from_fn(n, n, |_, _| rng.random_range(-1.0..1.0));
        program.hessian = &root * root.transpose() + DMatrix::identity(n, n) * 0.05;
        program.gradient = DVector::from_fn(n, |_, _| rng.random_range(-1.0..1.0));
        for i in 0..n {
            if rng.random_range(0..4) > 0 {
                program.lower[i] =
                    if rng.random_range(0..3) == 0 { 0.0 } else { -rng.random_range(0.0..0.5) };
            }
            program.summed[i] = i % 2 == 0;
            if rng.random_range(0..3) == 0 && !program.summed[i] {
                program.upper[i] = rng.random_range(0.0..0.3);
            }
        }
        if rng.random_range(0..3) > 0 {
            program.sum_bound = rng.random_range(0.0..0.4);
        }
        program
    }

    #[test]
    fn solutions_meet_the_conditions_of_karush_kuhn_and_tucker() {
        let mut rng = ChaCha8Rng::seed_from_u64(31);
        for case in 0..2000 {
            let n = rng.random_range(1..12);
            let mut program = random(&mut rng, n);
            program.solve().unwrap();
            let x = &program.solution;
            let sum: f64 = (0..n).filter(|&i| program.summed[i]).map(|i| x[i]).sum();
            assert!(sum <= program.sum_bound + 1e-12, "case {case}: sum {sum} of {}", program.sum_bound);
            let slope = &program.hessian * x + &program.gradient;
            // the multiplier is what any free variable of the sum says
            let free = |i: usize| program.activity()[i] == Activity::Free;
            let of_sum = (0..n).find(|&i| program.summed[i] && free(i)).map_or(0.0, |i| -slope[i]);
            let active = (sum - program.sum_bound).abs() < 1e-10;
            assert!(of_sum.abs() < 1e-9 || (active && of_sum > 0.0), "case {case}: multiplier {of_sum}");
            for i in 0..n {
                assert!(x[i] >= program.lower[i] && x[i] <= program.upper[i], "case {case}: bounds of {i}");
                let of_bound = slope[i] + if program.summed[i] { of_sum } else { 0.0 };
                let fits = of_bound.abs() < 1e-9
                    || (of_bound > 0.0 && x[i] == program.lower[i])
                    || (of_bound < 0.0 && x[i] == program.upper[i]);
                assert!(fits, "case {case}: variable {i} at {} is pulled by {of_bound}", x[i]);
            }
        }
    }

    #[test]
    fn an_indefinite_hessian_is_said_to_be_so() {
        let mut program = BoundedQuadratic::new(2);
        program.hessian[(0, 0)] = 1.0;
        program.hessian[(1, 1)] = -1.0;
        assert_eq!(program.solve(), Err(NotPositiveDefinite));
        program.hessian.fill(f64::NAN);
        assert_eq!(program.solve(), Err(NotPositiveDefinite));
    }
}
