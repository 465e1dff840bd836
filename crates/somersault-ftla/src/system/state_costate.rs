//! The state–costate system of a problem written once.
//!
//! With K = λᵀf + ℓ, the control found by [`minimise`](StateCostate) and F the set of controls not at a bound,
//!
//! ```text
//! ∂u*/∂x = −K_FF⁻¹ K_Fx,   ∂u*/∂λ = −K_FF⁻¹ f_Fᵀ,
//! D = ( f_x + f_u ∂u*/∂x        f_u ∂u*/∂λ             )
//!     ( −K_xx − K_xu ∂u*/∂x     −f_xᵀ − K_xu ∂u*/∂λ   ).
//! ```
//! All derivatives are exact, by hyper-dual numbers; a Jacobian costs (n + m)(n + m + 1)/2 evaluations of f and ℓ on top
//! of those for u*.
//!
//! The minimisation is Newton's method with projection on the bounds and backtracking (D. P. Bertsekas, *Projected Newton
//! methods for optimization problems with simple constraints*, SIAM J. Control Optim. 20 (1982)). Where f is affine and ℓ
//! quadratic in u, and without bounds, its first step is the closed form and the second confirms it. In a [`Piece`] of the
//! field the controls at a bound are held there and the others are minimised over without bounds.

use super::piece::Bounds;
use super::{
    HamiltonianSystem, OptimalControlSystem, Piece, Side, SystemError, VectorField, expect_controls,
};
use nalgebra::{Cholesky, SMatrix, SVector};
use num_dual::{Dual64, HyperDual64};
use somersault_core::Scalar;
use somersault_core::argument::ArgumentError;

/// Dynamics and running cost of an optimal control problem with `NX` states and `NU` controls, written over a scalar
/// so that derivatives follow.
pub trait ControlProblem<const NX: usize, const NU: usize> {
    /// f(x, u).
    fn dynamics<T: Scalar>(&self, x: &SVector<T, NX>, u: &SVector<T, NU>) -> SVector<T, NX>;

    /// ℓ(x, u), such that λᵀf + ℓ is strictly convex in u.
    fn running_cost<T: Scalar>(&self, x: &SVector<T, NX>, u: &SVector<T, NU>) -> T;

    /// Lower and upper bounds of the controls.
    fn bounds(&self) -> [SVector<f64, NU>; 2] {
        [SVector::repeat(f64::NEG_INFINITY), SVector::repeat(f64::INFINITY)]
    }
}

/// A problem with the derivatives that its state–costate system needs, K = λᵀf + ℓ. Every [`ControlProblem`] is one, by
/// hyper-dual numbers; to be implemented where derivatives come from elsewhere.
pub trait DifferentiatedProblem<const NX: usize, const NU: usize> {
    /// f(x, u).
    fn rate(&self, x: &SVector<f64, NX>, u: &SVector<f64, NU>) -> SVector<f64, NX>;

    /// ℓ(x, u).
    fn cost(&self, x: &SVector<f64, NX>, u: &SVector<f64, NU>) -> f64;

    /// K, K_u and K_uu.
    fn by_control(
        &self,
        x: &SVector<f64, NX>,
        costate: &SVector<f64, NX>,
        u: &SVector<f64, NU>,
    ) -> (f64, SVector<f64, NU>, SMatrix<f64, NU, NU>);

    /// K_x.
    fn by_state(
        &self,
        x: &SVector<f64, NX>,
        costate: &SVector<f64, NX>,
        u: &SVector<f64, NU>,
    ) -> SVector<f64, NX>;

    /// First derivatives of f and second ones of K.
    fn derivatives(
        &self,
        x: &SVector<f64, NX>,
        costate: &SVector<f64, NX>,
        u: &SVector<f64, NU>,
    ) -> ProblemDerivatives<NX, NU>;

    /// Number of controls; those beyond it, if any, fill up.
    fn n_controls(&self) -> usize {
        NU
    }

    /// Lower and upper bounds of the controls.
    fn control_bounds(&self) -> [SVector<f64, NU>; 2];
}

/// First derivatives of f and second ones of K, by (x, u).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ProblemDerivatives<const NX: usize, const NU: usize> {
    /// f_x.
    pub f_x: SMatrix<f64, NX, NX>,
    /// f_u.
    pub f_u: SMatrix<f64, NX, NU>,
    /// K_xx.
    pub k_xx: SMatrix<f64, NX, NX>,
    /// K_xu.
    pub k_xu: SMatrix<f64, NX, NU>,
}

impl<P: ControlProblem<NX, NU>, const NX: usize, const NU: usize> DifferentiatedProblem<NX, NU> for P {
    fn rate(&self, x: &SVector<f64, NX>, u: &SVector<f64, NU>) -> SVector<f64, NX> {
        self.dynamics(x, u)
    }

    fn cost(&self, x: &SVector<f64, NX>, u: &SVector<f64, NU>) -> f64 {
        self.running_cost(x, u)
    }

    fn by_control(
        &self,
        x: &SVector<f64, NX>,
        costate: &SVector<f64, NX>,
        u: &SVector<f64, NU>,
    ) -> (f64, SVector<f64, NU>, SMatrix<f64, NU, NU>) {
        let (x, costate) = (x.map(HyperDual64::from_re), costate.map(HyperDual64::from_re));
        let (mut gradient, mut hessian) = (SVector::<f64, NU>::zeros(), SMatrix::<f64, NU, NU>::zeros());
        let mut value = 0.0;
        for i in 0..NU {
            for j in 0..=i {
                let mut seeded = u.map(HyperDual64::from_re);
                seeded[i].eps1 = 1.0;
                seeded[j].eps2 = 1.0;
                let k = self.dynamics(&x, &seeded).dot(&costate) + self.running_cost(&x, &seeded);
                value = k.re;
                gradient[i] = k.eps1;
                hessian[(i, j)] = k.eps1eps2;
                hessian[(j, i)] = k.eps1eps2;
            }
        }
        (value, gradient, hessian)
    }

    fn by_state(
        &self,
        x: &SVector<f64, NX>,
        costate: &SVector<f64, NX>,
        u: &SVector<f64, NU>,
    ) -> SVector<f64, NX> {
        let (x, costate, u) = (x.map(Dual64::from_re), costate.map(Dual64::from_re), u.map(Dual64::from_re));
        SVector::from_fn(|i, _| {
            let mut seeded = x;
            seeded[i].eps = 1.0;
            (self.dynamics(&seeded, &u).dot(&costate) + self.running_cost(&seeded, &u)).eps
        })
    }

    fn derivatives(
        &self,
        x: &SVector<f64, NX>,
        costate: &SVector<f64, NX>,
        u: &SVector<f64, NU>,
    ) -> ProblemDerivatives<NX, NU> {
        let mut d = ProblemDerivatives::<NX, NU> {
            f_x: SMatrix::zeros(),
            f_u: SMatrix::zeros(),
            k_xx: SMatrix::zeros(),
            k_xu: SMatrix::zeros(),
        };
        let (x, u) = (x.map(HyperDual64::from_re), u.map(HyperDual64::from_re));
        for i in 0..NX {
            for j in 0..=i {
                let mut seeded = x;
                seeded[i].eps1 = 1.0;
                seeded[j].eps2 = 1.0;
                let f = self.dynamics(&seeded, &u);
                let cost = self.running_cost(&seeded, &u);
                let second = (0..NX).map(|r| costate[r] * f[r].eps1eps2).sum::<f64>() + cost.eps1eps2;
                d.k_xx[(i, j)] = second;
                d.k_xx[(j, i)] = second;
                d.f_x.set_column(i, &f.map(|f| f.eps1));
            }
            for j in 0..NU {
                let (mut seeded, mut control) = (x, u);
                seeded[i].eps1 = 1.0;
                control[j].eps2 = 1.0;
                let f = self.dynamics(&seeded, &control);
                let cost = self.running_cost(&seeded, &control);
                d.k_xu[(i, j)] = (0..NX).map(|r| costate[r] * f[r].eps1eps2).sum::<f64>() + cost.eps1eps2;
                d.f_u.set_column(j, &f.map(|f| f.eps2));
            }
        }
        d
    }

    fn control_bounds(&self) -> [SVector<f64, NU>; 2] {
        self.bounds()
    }
}

/// The state–costate system of a [`ControlProblem`], or of a [`DifferentiatedProblem`], p = (x, λ) of `N` = 2 `NX` numbers.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StateCostate<P, const NX: usize, const NU: usize, const N: usize> {
    problem: P,
    lower: SVector<f64, NU>,
    upper: SVector<f64, NU>,
}

/// A control with what its minimisation knows of it.
struct Control<const NU: usize> {
    u: SVector<f64, NU>,
    /// K_u.
    gradient: SVector<f64, NU>,
    /// The inverse of K_FF, zero in rows and columns of controls at a bound.
    inverse: SMatrix<f64, NU, NU>,
}

/// Iterations of the minimisation over the controls.
const MAX_ITERATIONS: usize = 60;

impl<P: DifferentiatedProblem<NX, NU>, const NX: usize, const NU: usize, const N: usize>
    StateCostate<P, NX, NU, N>
{
    const DIMENSIONS: () = assert!(N == 2 * NX && NU <= N, "N must be 2 NX, and NU not larger");

    /// Fails if a lower bound is NaN or not below its upper bound.
    pub fn try_new(problem: P) -> Result<Self, SystemError> {
        const { Self::DIMENSIONS };
        let [lower, upper] = problem.control_bounds();
        for i in 0..NU {
            if lower[i].is_nan() || upper[i].is_nan() || lower[i] >= upper[i] {
                let allowed = "below the upper bound";
                return Err(
                    ArgumentError::OutOfRange { argument: "lower bound", allowed, found: lower[i] }.into()
                );
            }
        }
        Ok(Self { problem, lower, upper })
    }

    /// The problem.
    pub fn problem(&self) -> &P {
        &self.problem
    }

    /// u*(p).
    pub fn control(&self, p: &SVector<f64, N>) -> Result<SVector<f64, NU>, SystemError> {
        let (x, costate) = Self::halves(p);
        Ok(self.minimise(&x, &costate, None)?.u)
    }

    #[inline(always)]
    fn halves(p: &SVector<f64, N>) -> (SVector<f64, NX>, SVector<f64, NX>) {
        (SVector::from_fn(|i, _| p[i]), SVector::from_fn(|i, _| p[NX + i]))
    }

    fn k(&self, x: &SVector<f64, NX>, costate: &SVector<f64, NX>, u: &SVector<f64, NU>) -> f64 {
        self.problem.rate(x, u).dot(costate) + self.problem.cost(x, u)
    }

    fn bounds(&self, i: usize) -> Bounds {
        Bounds { lower: self.lower[i], upper: self.upper[i] }
    }

    /// The least K within the bounds, or in `piece`.
    fn minimise(
        &self,
        x: &SVector<f64, NX>,
        costate: &SVector<f64, NX>,
        piece: Option<&Piece<N>>,
    ) -> Result<Control<NU>, SystemError> {
        let limit = |i: usize, bound: f64, none: f64| match piece {
            Some(piece) => self.bounds(i).control(piece.sides[i], none),
            None => bound,
        };
        let lower = SVector::<f64, NU>::from_fn(|i, _| limit(i, self.lower[i], f64::NEG_INFINITY));
        let upper = SVector::<f64, NU>::from_fn(|i, _| limit(i, self.upper[i], f64::INFINITY));
        let mut u = SVector::<f64, NU>::zeros().sup(&lower).inf(&upper);
        let mut size = f64::INFINITY;
        for _ in 0..MAX_ITERATIONS {
            let (value, gradient, hessian) = self.problem.by_control(x, costate, &u);
            if !(value.is_finite() && gradient.iter().chain(hessian.iter()).all(|g| g.is_finite())) {
                return Err(SystemError::NonFinite);
            }
            let free: [bool; NU] = std::array::from_fn(|i| {
                lower[i] < upper[i]
                    && !(u[i] <= lower[i] && gradient[i] > 0.0 || u[i] >= upper[i] && gradient[i] < 0.0)
            });
            let inverse = invert_free(&hessian, &free)?;
            let newton = -(inverse * gradient);
            size = (0..NU).filter(|&i| free[i]).fold(0.0, |m, i| gradient[i].abs().max(m));
            let rounding =
                newton.iter().zip(&u).all(|(d, u)| d.abs() <= 4.0 * f64::EPSILON * u.abs().max(1e-3));
            if rounding {
                return Ok(Control { u, gradient, inverse });
            }
            let trial = |step: f64| (u + newton * step).sup(&lower).inf(&upper);
            let accepted = (0..40).map(|k| trial(0.5f64.powi(k))).find(|w| {
                let change = self.k(x, costate, w) - value;
                // below rounding of K the Newton step is better than what K can tell
                change <= 1e-4 * gradient.dot(&(w - u)) + 8.0 * f64::EPSILON * value.abs().max(1.0)
            });
            match accepted {
                Some(next) if next != u => u = next,
                Some(_) | None => return Ok(Control { u, gradient, inverse }),
            }
        }
        Err(SystemError::ControlNotConverged { gradient: size, iterations: MAX_ITERATIONS })
    }

    fn try_field(
        &self,
        p: &SVector<f64, N>,
        piece: Option<&Piece<N>>,
    ) -> Result<SVector<f64, N>, SystemError> {
        let (x, costate) = Self::halves(p);
        let u = self.minimise(&x, &costate, piece)?.u;
        let (f, slope) = (self.problem.rate(&x, &u), self.problem.by_state(&x, &costate, &u));
        Ok(SVector::from_fn(|i, _| if i < NX { f[i] } else { -slope[i - NX] }))
    }

    fn try_jacobian(
        &self,
        p: &SVector<f64, N>,
        piece: Option<&Piece<N>>,
    ) -> Result<SMatrix<f64, N, N>, SystemError> {
        let (x, costate) = Self::halves(p);
        let Control { u, inverse, .. } = self.minimise(&x, &costate, piece)?;
        let d = self.problem.derivatives(&x, &costate, &u);
        let u_x = -(inverse * d.k_xu.transpose());
        let u_costate = -(inverse * d.f_u.transpose());
        let blocks = [
            [d.f_x + d.f_u * u_x, d.f_u * u_costate],
            [-d.k_xx - d.k_xu * u_x, -d.f_x.transpose() - d.k_xu * u_costate],
        ];
        Ok(SMatrix::from_fn(|i, j| blocks[i / NX][j / NX][(i % NX, j % NX)]))
    }
}

/// The inverse of the rows and columns of `hessian` that are free, filled up with zeros.
fn invert_free<const M: usize>(
    hessian: &SMatrix<f64, M, M>,
    free: &[bool; M],
) -> Result<SMatrix<f64, M, M>, SystemError> {
    let padded = SMatrix::<f64, M, M>::from_fn(|i, j| match (free[i] && free[j], i == j) {
        (true, _) => hessian[(i, j)],
        (false, true) => 1.0,
        (false, false) => 0.0,
    });
    let scale = (0..M).fold(0.0, |m: f64, i| m.max(padded[(i, i)].abs()));
    // pivots of LDLᵀ, to name the first that is not positive
    let mut rest = padded;
    for k in 0..M {
        let pivot = rest[(k, k)];
        if pivot.is_nan() || pivot <= 16.0 * f64::EPSILON * scale {
            return Err(SystemError::SingularControlHessian { control: k, pivot });
        }
        for i in k + 1..M {
            for j in k + 1..M {
                rest[(i, j)] -= rest[(i, k)] * rest[(k, j)] / pivot;
            }
        }
    }
    let mut inverse = Cholesky::new(padded).ok_or(SystemError::NonFinite)?.inverse();
    for i in (0..M).filter(|&i| !free[i]) {
        inverse[(i, i)] = 0.0;
    }
    Ok(inverse)
}

impl<P: DifferentiatedProblem<NX, NU>, const NX: usize, const NU: usize, const N: usize> VectorField<N>
    for StateCostate<P, NX, NU, N>
{
    fn field(&self, p: &SVector<f64, N>) -> SVector<f64, N> {
        self.try_field(p, None).unwrap_or_else(|_| SVector::repeat(f64::NAN))
    }

    fn jacobian(&self, p: &SVector<f64, N>) -> SMatrix<f64, N, N> {
        self.try_jacobian(p, None).unwrap_or_else(|_| SMatrix::repeat(f64::NAN))
    }

    fn n_switches(&self) -> usize {
        if (0..NU).all(|i| self.lower[i] == f64::NEG_INFINITY && self.upper[i] == f64::INFINITY) {
            0
        } else {
            NU
        }
    }

    fn piece(&self, p: &SVector<f64, N>) -> Piece<N> {
        let (x, costate) = Self::halves(p);
        let mut piece = Piece::FREE;
        if let Ok(Control { u, gradient, .. }) = self.minimise(&x, &costate, None) {
            for i in 0..NU {
                piece.sides[i] = match (u[i] <= self.lower[i], u[i] >= self.upper[i]) {
                    (true, _) if gradient[i] > 0.0 => Side::Lower,
                    (_, true) if gradient[i] < 0.0 => Side::Upper,
                    (_, _) => Side::Free,
                };
            }
        }
        piece
    }

    fn field_in(&self, piece: &Piece<N>, p: &SVector<f64, N>) -> SVector<f64, N> {
        self.try_field(p, Some(piece)).unwrap_or_else(|_| SVector::repeat(f64::NAN))
    }

    fn linearize_in(&self, piece: &Piece<N>, p: &SVector<f64, N>) -> (SVector<f64, N>, SMatrix<f64, N, N>) {
        let jacobian = self.try_jacobian(p, Some(piece)).unwrap_or_else(|_| SMatrix::repeat(f64::NAN));
        (self.field_in(piece, p), jacobian)
    }

    fn margins(&self, piece: &Piece<N>, p: &SVector<f64, N>) -> SVector<f64, N> {
        let (x, costate) = Self::halves(p);
        let Ok(Control { u, gradient, .. }) = self.minimise(&x, &costate, Some(piece)) else {
            return SVector::repeat(f64::NAN);
        };
        let margin = |i: usize| self.bounds(i).margin(piece.sides[i], u[i], gradient[i]);
        SVector::from_fn(|i, _| if i < NU { margin(i) } else { f64::INFINITY })
    }

    fn conserved(&self, p: &SVector<f64, N>) -> Option<f64> {
        Some(self.hamiltonian(p))
    }

    fn fault(&self, p: &SVector<f64, N>) -> Option<SystemError> {
        match self.try_field(p, None) {
            Ok(field) => (!field.iter().all(|h| h.is_finite())).then_some(SystemError::NonFinite),
            Err(error) => Some(error),
        }
    }
}

impl<P: DifferentiatedProblem<NX, NU>, const NX: usize, const NU: usize, const N: usize> HamiltonianSystem<N>
    for StateCostate<P, NX, NU, N>
{
    fn hamiltonian(&self, p: &SVector<f64, N>) -> f64 {
        let (x, costate) = Self::halves(p);
        self.minimise(&x, &costate, None).map_or(f64::NAN, |c| self.k(&x, &costate, &c.u))
    }
}

impl<P: DifferentiatedProblem<NX, NU>, const NX: usize, const NU: usize, const N: usize>
    OptimalControlSystem<N> for StateCostate<P, NX, NU, N>
{
    fn n_controls(&self) -> usize {
        self.problem.n_controls()
    }

    fn control_into(&self, p: &SVector<f64, N>, u: &mut [f64]) -> Result<(), SystemError> {
        let count = self.problem.n_controls();
        expect_controls(u, count)?;
        u.copy_from_slice(&self.control(p)?.as_slice()[..count]);
        Ok(())
    }

    fn running_cost(&self, p: &SVector<f64, N>) -> f64 {
        let (x, costate) = Self::halves(p);
        self.minimise(&x, &costate, None).map_or(f64::NAN, |c| self.problem.cost(&x, &c.u))
    }

    fn running_cost_in(&self, piece: &Piece<N>, p: &SVector<f64, N>) -> f64 {
        let (x, costate) = Self::halves(p);
        let control = self.minimise(&x, &costate, Some(piece));
        control.map_or(f64::NAN, |c| self.problem.cost(&x, &c.u))
    }
}
