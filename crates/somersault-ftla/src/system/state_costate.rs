//! The state–costate system of a problem written once.
//!
//! With K = λᵀf + ℓ, the control found by [`minimise`](StateCostate) and F the set of controls not at a bound,
//!
//! ```text
//! ∂u*/∂x = −K_FF⁻¹ K_Fx,   ∂u*/∂λ = −K_FF⁻¹ f_Fᵀ,
//! D = ( f_x + f_u ∂u*/∂x        f_u ∂u*/∂λ             )
//!     ( −K_xx − K_xu ∂u*/∂x     −f_xᵀ − K_xu ∂u*/∂λ   ).
//! ```
//! The minimisation is Newton's method with projection on the bounds and backtracking (D. P. Bertsekas, *Projected Newton
//! methods for optimization problems with simple constraints*, SIAM J. Control Optim. 20 (1982)). Where f is affine and ℓ
//! quadratic in u, and without bounds, its first step is the closed form and the second confirms it. In a [`Piece`] of the
//! field the controls at a bound are held there and the others are minimised over without bounds.

use super::piece::Bounds;
use super::{
    HamiltonianSystem, OptimalControlSystem, Piece, Side, SystemError, VectorField, expect_controls, no_field,
};
use nalgebra::{Cholesky, DMatrix, DVector};
use somersault_core::argument::ArgumentError;

/// Dynamics and running cost of an optimal control problem with the derivatives that its state–costate system needs,
/// K = λᵀf + ℓ strictly convex in u. A [`PosedProblem`](super::PosedProblem) is one by expressions; to be implemented where
/// derivatives come from elsewhere.
pub trait DifferentiatedProblem {
    /// Numbers of states and of controls.
    fn sizes(&self) -> [usize; 2];

    /// Writes f(x, u) to `f`.
    fn rate_into(&self, x: &[f64], u: &[f64], f: &mut [f64]);

    /// ℓ(x, u).
    fn cost(&self, x: &[f64], u: &[f64]) -> f64;

    /// K, and writes K_u and K_uu.
    fn by_control_into(
        &self,
        x: &[f64],
        costate: &[f64],
        u: &[f64],
        gradient: &mut [f64],
        hessian: &mut DMatrix<f64>,
    ) -> f64;

    /// Writes K_x to `slope`.
    fn by_state_into(&self, x: &[f64], costate: &[f64], u: &[f64], slope: &mut [f64]);

    /// First derivatives of f and second ones of K.
    fn derivatives(&self, x: &[f64], costate: &[f64], u: &[f64]) -> ProblemDerivatives;

    /// Lower and upper bounds of the controls.
    fn control_bounds(&self) -> [Vec<f64>; 2];
}

/// First derivatives of f and second ones of K, by (x, u).
#[derive(Debug, Clone, PartialEq)]
pub struct ProblemDerivatives {
    /// f_x.
    pub f_x: DMatrix<f64>,
    /// f_u.
    pub f_u: DMatrix<f64>,
    /// K_xx.
    pub k_xx: DMatrix<f64>,
    /// K_xu.
    pub k_xu: DMatrix<f64>,
}

/// The state–costate system of a [`DifferentiatedProblem`]: p = (x, λ), two numbers for each state.
#[derive(Debug, Clone, PartialEq)]
pub struct StateCostate<P> {
    problem: P,
    bounds: Vec<Bounds>,
}

/// A control with what its minimisation knows of it.
struct Control {
    u: DVector<f64>,
    /// K_u.
    gradient: DVector<f64>,
    /// The inverse of K_FF, zero in rows and columns of controls at a bound.
    inverse: DMatrix<f64>,
}

/// Iterations of the minimisation over the controls.
const MAX_ITERATIONS: usize = 60;
/// Newton's step, relative to u, that is taken as it is.
const SHORT: f64 = 1e-5;

impl<P: DifferentiatedProblem> StateCostate<P> {
    /// Fails without a state or a control, or if a lower bound is NaN or not below its upper bound.
    pub fn try_new(problem: P) -> Result<Self, SystemError> {
        let [n, m] = problem.sizes();
        for (argument, found) in [("n_states", n), ("n_controls", m)] {
            if found == 0 {
                let found = found as f64;
                return Err(ArgumentError::OutOfRange { argument, allowed: "positive", found }.into());
            }
        }
        let [lower, upper] = problem.control_bounds();
        for (argument, found) in [("lower bound", lower.len()), ("upper bound", upper.len())] {
            if found != m {
                return Err(ArgumentError::Length { argument, expected: m, found }.into());
            }
        }
        let bounds: Vec<Bounds> =
            lower.into_iter().zip(upper).map(|(lower, upper)| Bounds { lower, upper }).collect();
        for &Bounds { lower: found, upper } in &bounds {
            if found.is_nan() || upper.is_nan() || found >= upper {
                let allowed = "below the upper bound";
                return Err(ArgumentError::OutOfRange { argument: "lower bound", allowed, found }.into());
            }
        }
        Ok(Self { problem, bounds })
    }

    /// The problem.
    pub fn problem(&self) -> &P {
        &self.problem
    }

    /// u*(p).
    pub fn control(&self, p: &[f64]) -> Result<DVector<f64>, SystemError> {
        let (x, costate) = p.split_at(self.n_states());
        Ok(self.minimise(x, costate, None)?.u)
    }

    fn n_states(&self) -> usize {
        self.problem.sizes()[0]
    }

    fn k(&self, x: &[f64], costate: &[f64], u: &DVector<f64>, f: &mut [f64]) -> f64 {
        self.problem.rate_into(x, u.as_slice(), f);
        let work: f64 = f.iter().zip(costate).map(|(f, costate)| f * costate).sum();
        work + self.problem.cost(x, u.as_slice())
    }

    /// The least K within the bounds, or in `piece`.
    fn minimise(&self, x: &[f64], costate: &[f64], piece: Option<&Piece>) -> Result<Control, SystemError> {
        let m = self.bounds.len();
        let limit = |i: usize, bound: f64, none: f64| match piece {
            Some(piece) => self.bounds[i].control(piece.side(i), none),
            None => bound,
        };
        let lower = DVector::from_fn(m, |i, _| limit(i, self.bounds[i].lower, f64::NEG_INFINITY));
        let upper = DVector::from_fn(m, |i, _| limit(i, self.bounds[i].upper, f64::INFINITY));
        let mut u = DVector::zeros(m).sup(&lower).inf(&upper);
        let mut f = vec![0.0; x.len()];
        let (mut gradient, mut hessian) = (DVector::zeros(m), DMatrix::zeros(m, m));
        let (mut size, mut last) = (f64::INFINITY, f64::INFINITY);
        for _ in 0..MAX_ITERATIONS {
            let at = u.as_slice();
            let value = self.problem.by_control_into(x, costate, at, gradient.as_mut_slice(), &mut hessian);
            if !(value.is_finite() && gradient.iter().chain(hessian.iter()).all(|g| g.is_finite())) {
                return Err(SystemError::NonFinite);
            }
            let free = |i: usize| {
                lower[i] < upper[i]
                    && !(u[i] <= lower[i] && gradient[i] > 0.0 || u[i] >= upper[i] && gradient[i] < 0.0)
            };
            let inverse = invert_free(&hessian, free)?;
            let newton = -(&inverse * &gradient);
            size = (0..m).filter(|&i| free(i)).fold(0.0, |m, i| gradient[i].abs().max(m));
            let rounding =
                newton.iter().zip(&u).all(|(d, u)| d.abs() <= 4.0 * f64::EPSILON * u.abs().max(1e-3));
            // steps that are this short and no longer fall are rounding of the gradient
            let step = newton.amax();
            let floor = step <= 1e-8 * u.amax().max(1e-3) && step >= 0.5 * last;
            if rounding || floor {
                return Ok(Control { u, gradient, inverse });
            }
            last = step;
            let trial = |step: f64| (&u + &newton * step).sup(&lower).inf(&upper);
            // K is a sum that may cancel: of a short step its values tell nothing, and Newton's is the best
            let is_short = step <= SHORT * u.amax().max(1e-3);
            let accepted = (0..40).map(|k| trial(0.5f64.powi(k))).find(|w| {
                let rounding = 8.0 * f64::EPSILON * value.abs().max(1.0);
                is_short || self.k(x, costate, w, &mut f) - value <= 1e-4 * gradient.dot(&(w - &u)) + rounding
            });
            match accepted {
                Some(next) if next != u => u = next,
                Some(_) | None => return Ok(Control { u, gradient, inverse }),
            }
        }
        Err(SystemError::ControlNotConverged { gradient: size, iterations: MAX_ITERATIONS })
    }

    /// h at the point of a control.
    fn field_of(&self, control: &Control, (x, costate): (&[f64], &[f64]), h: &mut [f64]) {
        let (rate, slope) = h.split_at_mut(x.len());
        self.problem.rate_into(x, control.u.as_slice(), rate);
        self.problem.by_state_into(x, costate, control.u.as_slice(), slope);
        slope.iter_mut().for_each(|slope| *slope = -*slope);
    }

    /// D at the point of a control.
    fn jacobian_of(&self, control: &Control, (x, costate): (&[f64], &[f64]), d: &mut DMatrix<f64>) {
        let n = x.len();
        let Control { u, inverse, .. } = control;
        let ProblemDerivatives { f_x, f_u, k_xx, k_xu } = self.problem.derivatives(x, costate, u.as_slice());
        let u_x = -(inverse * k_xu.transpose());
        let u_costate = -(inverse * f_u.transpose());
        d.view_mut((0, 0), (n, n)).copy_from(&(&f_x + &f_u * &u_x));
        d.view_mut((0, n), (n, n)).copy_from(&(&f_u * &u_costate));
        d.view_mut((n, 0), (n, n)).copy_from(&(-k_xx - &k_xu * &u_x));
        d.view_mut((n, n), (n, n)).copy_from(&(-f_x.transpose() - &k_xu * &u_costate));
    }

    /// Writes h and D where they are requested, NaN where no control minimises K.
    fn write(&self, p: &[f64], piece: Option<&Piece>, h: Option<&mut [f64]>, d: Option<&mut DMatrix<f64>>) {
        let at = p.split_at(self.n_states());
        match self.minimise(at.0, at.1, piece) {
            Ok(control) => {
                h.into_iter().for_each(|h| self.field_of(&control, at, h));
                d.into_iter().for_each(|d| self.jacobian_of(&control, at, d));
            }
            Err(_) => {
                h.into_iter().for_each(no_field);
                d.into_iter().for_each(|d| d.fill(f64::NAN));
            }
        }
    }
}

/// The inverse of the rows and columns of `hessian` that are free, filled up with zeros.
fn invert_free(hessian: &DMatrix<f64>, free: impl Fn(usize) -> bool) -> Result<DMatrix<f64>, SystemError> {
    let m = hessian.nrows();
    let padded = DMatrix::from_fn(m, m, |i, j| match (free(i) && free(j), i == j) {
        (true, _) => hessian[(i, j)],
        (false, true) => 1.0,
        (false, false) => 0.0,
    });
    let scale = (0..m).fold(0.0, |m: f64, i| m.max(padded[(i, i)].abs()));
    // pivots of LDLᵀ, to name the first that is not positive
    let mut rest = padded.clone();
    for k in 0..m {
        let pivot = rest[(k, k)];
        if pivot.is_nan() || pivot <= 16.0 * f64::EPSILON * scale {
            return Err(SystemError::SingularControlHessian { control: k, pivot });
        }
        for i in k + 1..m {
            for j in k + 1..m {
                rest[(i, j)] -= rest[(i, k)] * rest[(k, j)] / pivot;
            }
        }
    }
    let mut inverse = Cholesky::new(padded).ok_or(SystemError::NonFinite)?.inverse();
    for i in (0..m).filter(|&i| !free(i)) {
        inverse[(i, i)] = 0.0;
    }
    Ok(inverse)
}

impl<P: DifferentiatedProblem> VectorField for StateCostate<P> {
    fn dimension(&self) -> usize {
        2 * self.n_states()
    }

    fn field_into(&self, p: &[f64], h: &mut [f64]) {
        self.write(p, None, Some(h), None);
    }

    fn jacobian_into(&self, p: &[f64], d: &mut DMatrix<f64>) {
        self.write(p, None, None, Some(d));
    }

    fn linearize_into(&self, p: &[f64], h: &mut [f64], d: &mut DMatrix<f64>) {
        self.write(p, None, Some(h), Some(d));
    }

    fn n_switches(&self) -> usize {
        let unbounded = |b: &Bounds| b.lower == f64::NEG_INFINITY && b.upper == f64::INFINITY;
        if self.bounds.iter().all(unbounded) { 0 } else { self.bounds.len() }
    }

    fn piece(&self, p: &[f64]) -> Piece {
        let (x, costate) = p.split_at(self.n_states());
        let Ok(Control { u, gradient, .. }) = self.minimise(x, costate, None) else { return Piece::FREE };
        let side = |(i, bounds): (usize, &Bounds)| match (u[i] <= bounds.lower, u[i] >= bounds.upper) {
            (true, _) if gradient[i] > 0.0 => Side::Lower,
            (_, true) if gradient[i] < 0.0 => Side::Upper,
            (_, _) => Side::Free,
        };
        self.bounds.iter().enumerate().map(side).collect()
    }

    fn field_in(&self, piece: &Piece, p: &[f64], h: &mut [f64]) {
        self.write(p, Some(piece), Some(h), None);
    }

    fn linearize_in(&self, piece: &Piece, p: &[f64], h: &mut [f64], d: &mut DMatrix<f64>) {
        self.write(p, Some(piece), Some(h), Some(d));
    }

    fn margins_into(&self, piece: &Piece, p: &[f64], margins: &mut [f64]) {
        let (x, costate) = p.split_at(self.n_states());
        let Ok(Control { u, gradient, .. }) = self.minimise(x, costate, Some(piece)) else {
            return margins.fill(f64::NAN);
        };
        for (i, margin) in margins.iter_mut().enumerate() {
            *margin = self.bounds[i].margin(piece.side(i), u[i], gradient[i]);
        }
    }

    fn conserved(&self, p: &[f64]) -> Option<f64> {
        Some(self.hamiltonian(p))
    }

    fn fault(&self, p: &[f64]) -> Option<SystemError> {
        let at = p.split_at(self.n_states());
        match self.minimise(at.0, at.1, None) {
            Ok(control) => {
                let mut h = vec![0.0; p.len()];
                self.field_of(&control, at, &mut h);
                (!h.iter().all(|h| h.is_finite())).then_some(SystemError::NonFinite)
            }
            Err(error) => Some(error),
        }
    }
}

impl<P: DifferentiatedProblem> HamiltonianSystem for StateCostate<P> {
    fn hamiltonian(&self, p: &[f64]) -> f64 {
        let (x, costate) = p.split_at(self.n_states());
        let mut f = vec![0.0; x.len()];
        self.minimise(x, costate, None).map_or(f64::NAN, |c| self.k(x, costate, &c.u, &mut f))
    }
}

impl<P: DifferentiatedProblem> OptimalControlSystem for StateCostate<P> {
    fn n_controls(&self) -> usize {
        self.bounds.len()
    }

    fn control_into(&self, p: &[f64], u: &mut [f64]) -> Result<(), SystemError> {
        expect_controls(u, self.bounds.len())?;
        u.copy_from_slice(self.control(p)?.as_slice());
        Ok(())
    }

    fn running_cost(&self, p: &[f64]) -> f64 {
        let (x, costate) = p.split_at(self.n_states());
        let control = self.minimise(x, costate, None);
        control.map_or(f64::NAN, |c| self.problem.cost(x, c.u.as_slice()))
    }

    fn running_cost_in(&self, piece: &Piece, p: &[f64]) -> f64 {
        let (x, costate) = p.split_at(self.n_states());
        let control = self.minimise(x, costate, Some(piece));
        control.map_or(f64::NAN, |c| self.problem.cost(x, c.u.as_slice()))
    }
}
