//! The callables of an optimal control problem, differentiated by its user, in a run.

use super::differences::{expect_derivative, slopes_of};
use super::run::Run;
use super::watched::{call, no_value};
use crate::core::error::Error;
use pyo3::prelude::*;
use somersault::core::differences::Slopes;
use somersault::ftla::nalgebra::DMatrix;
use somersault::ftla::system::{DifferentiatedProblem, ProblemDerivatives};
use std::sync::Arc;

/// The callables of a problem, and the bounds of its controls.
pub(crate) struct Problem {
    /// `dynamics`, `running_cost`, `jacobian`, `gradient` and `hessian`.
    pub(super) callables: [Py<PyAny>; 5],
    pub(super) n_states: usize,
    pub(super) n_controls: usize,
    /// Lower ones, then upper ones.
    pub(super) bounds: Vec<f64>,
}

/// What the callables are called.
pub(super) const NAMES: [&str; 5] = ["dynamics", "running_cost", "jacobian", "gradient", "hessian"];

/// How far a Hessian may be from symmetric, as a part of its largest entry: differences of first order get there.
const UNEVEN: f64 = 1e-6;

/// A problem in one run.
pub(super) struct DifferentiatedCallables {
    problem: Arc<Problem>,
    run: Arc<Run>,
}

impl DifferentiatedCallables {
    pub(super) fn new(problem: &Arc<Problem>, run: &Arc<Run>) -> Self {
        Self { problem: Arc::clone(problem), run: Arc::clone(run) }
    }

    /// What callable number `which` makes of vectors; NaN once anything has been raised.
    fn call(&self, which: usize, vectors: &[&[f64]], shape: &[usize]) -> Vec<f64> {
        let (name, callable) = (NAMES[which], &self.problem.callables[which]);
        // a control tried at a bound at infinity is no fault of the callable
        if vectors.iter().any(|vector| vector.iter().any(|x| !x.is_finite())) {
            return vec![f64::NAN; shape.iter().product()];
        }
        let arguments = if vectors.len() == 2 { "x, u" } else { "x, u, costate" };
        let found = call(&self.run, name, arguments, callable, vectors, shape);
        let found = found.unwrap_or_else(|| vec![f64::NAN; shape.iter().product()]);
        if let Some(value) = found.iter().find(|x| !x.is_finite()) {
            no_value(&self.run, name, *value);
        }
        found
    }

    /// Holds what the callables give as derivatives against differences, where the run wants it.
    fn check(&self, x: &[f64], costate: &[f64], u: &[f64]) {
        if !self.run.checks_derivatives() {
            return;
        }
        let n = x.len();
        let width = n + u.len();
        let at: Vec<f64> = x.iter().chain(u).copied().collect();
        let given = |which: usize, shape: &[usize], at: &[f64]| {
            let found = self.call(which, &[&at[..n], &at[n..]], shape);
            found.iter().all(|value| value.is_finite()).then_some(found)
        };
        let slopes = |at: &[f64]| {
            let slopes = self.slopes(&at[..n], costate, &at[n..]);
            slopes.iter().all(|value| value.is_finite()).then_some(slopes)
        };
        let of_dynamics = slopes_of(&at, n, |at| given(0, &[n], at));
        let of_cost = slopes_of(&at, 1, |at| given(1, &[], at));
        let of_slopes = slopes_of(&at, width, slopes);
        let jacobian = self.call(2, &[x, u], &[x.len(), width]);
        let gradient = self.call(3, &[x, u], &[width]);
        let (hessian, _) = self.hessian(x, costate, u);
        let expect = |name: &str, of: &str, written: &[f64], found: &Option<Slopes>| {
            expect_derivative(&self.run, name, of, written, found.as_ref());
        };
        expect("jacobian(x, u)", "dynamics", &jacobian, &of_dynamics);
        expect("gradient(x, u)", "running_cost", &gradient, &of_cost);
        expect("hessian(x, u, costate)", "costate @ jacobian + gradient", &hessian, &of_slopes);
    }

    /// The Hessian of λᵀf + ℓ by (x, u), row by row, and how long a row is.
    fn hessian(&self, x: &[f64], costate: &[f64], u: &[f64]) -> (Vec<f64>, usize) {
        let width = x.len() + u.len();
        let found = self.call(4, &[x, u, costate], &[width, width]);
        let largest = found.iter().fold(0.0, |m: f64, entry| m.max(entry.abs()));
        let pairs = (0..width).flat_map(|i| (0..i).map(move |j| (i, j)));
        for (below, above) in pairs.map(|(i, j)| (found[i * width + j], found[j * width + i])) {
            if (below - above).abs() > UNEVEN * largest && !self.run.is_stopped() {
                let message =
                    format!("`hessian(x, u, costate)` must be symmetric, found {above} and {below}");
                self.run.stop(Error::input(message).into());
            }
        }
        (found, width)
    }

    /// The gradient of λᵀf + ℓ by (x, u).
    fn slopes(&self, x: &[f64], costate: &[f64], u: &[f64]) -> Vec<f64> {
        let width = x.len() + u.len();
        let by = self.call(2, &[x, u], &[x.len(), width]);
        let mut slopes = self.call(3, &[x, u], &[width]);
        for (j, slope) in slopes.iter_mut().enumerate() {
            *slope += (0..x.len()).map(|i| costate[i] * by[i * width + j]).sum::<f64>();
        }
        slopes
    }
}

impl DifferentiatedProblem for DifferentiatedCallables {
    fn sizes(&self) -> [usize; 2] {
        [self.problem.n_states, self.problem.n_controls]
    }

    fn rate_into(&self, x: &[f64], u: &[f64], f: &mut [f64]) {
        f.copy_from_slice(&self.call(0, &[x, u], &[x.len()]));
    }

    fn cost(&self, x: &[f64], u: &[f64]) -> f64 {
        self.call(1, &[x, u], &[])[0]
    }

    fn by_control_into(
        &self,
        x: &[f64],
        costate: &[f64],
        u: &[f64],
        gradient: &mut [f64],
        hessian: &mut DMatrix<f64>,
    ) -> f64 {
        let n = x.len();
        let rate = self.call(0, &[x, u], &[n]);
        let value = rate.iter().zip(costate).map(|(f, costate)| f * costate).sum::<f64>() + self.cost(x, u);
        gradient.copy_from_slice(&self.slopes(x, costate, u)[n..]);
        let (second, width) = self.hessian(x, costate, u);
        for (i, j) in (0..u.len()).flat_map(|i| (0..u.len()).map(move |j| (i, j))) {
            hessian[(i, j)] = second[(n + i) * width + n + j];
        }
        value
    }

    fn by_state_into(&self, x: &[f64], costate: &[f64], u: &[f64], slope: &mut [f64]) {
        self.check(x, costate, u);
        slope.copy_from_slice(&self.slopes(x, costate, u)[..x.len()]);
    }

    fn derivatives(&self, x: &[f64], costate: &[f64], u: &[f64]) -> ProblemDerivatives {
        self.check(x, costate, u);
        let (n, m) = (x.len(), u.len());
        let (second, width) = self.hessian(x, costate, u);
        let by = self.call(2, &[x, u], &[n, width]);
        ProblemDerivatives {
            f_x: DMatrix::from_fn(n, n, |i, j| by[i * width + j]),
            f_u: DMatrix::from_fn(n, m, |i, j| by[i * width + n + j]),
            k_xx: DMatrix::from_fn(n, n, |i, j| second[i * width + j]),
            k_xu: DMatrix::from_fn(n, m, |i, j| second[i * width + n + j]),
        }
    }

    fn control_bounds(&self) -> [Vec<f64>; 2] {
        let (lower, upper) = self.problem.bounds.split_at(self.problem.n_controls);
        [lower.to_vec(), upper.to_vec()]
    }
}
