//! Vector fields, Hamiltonian systems, and the state–costate systems of optimal control.
//!
//! Minimise ∫ ℓ(x, u) dt subject to ẋ = f(x, u). With K(x, λ, u) = λᵀf + ℓ and u* = argmin K the extremals obey (8.9)
//!
//! ```text
//! ẋ = ∂H*/∂λ = f(x, u*),   λ̇ = −∂H*/∂x = −∂K/∂x,   H*(x, λ) = K(x, λ, u*)
//! ```
//! for p = (x, λ). The running cost carries its ½ (thesis (8.7) and appendix H; the Hamiltonian printed in 8.3 lacks it).

mod arm;
mod chart;
mod piece;
mod scalar;
mod state_costate;
mod tree;

pub use arm::ArmMinimumTorque;
pub use piece::{Piece, Side};
pub use scalar::{CubicRegulator, LinearRegulator};
pub use state_costate::{ControlProblem, DifferentiatedProblem, ProblemDerivatives, StateCostate};
pub use tree::TreeMinimumTorque;

use nalgebra::{SMatrix, SVector};
use somersault_core::argument::ArgumentError;
use somersault_multibody::{DynamicsError, ModelError};

/// Why a system has no value at a point, or cannot be made.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SystemError {
    /// An argument that is not allowed.
    #[error(transparent)]
    Argument(#[from] ArgumentError),
    /// ∂²K/∂u² is not positive definite, so that no control minimises K.
    #[error("the control Hessian must be positive definite, found pivot {pivot:e} for control {control}")]
    SingularControlHessian {
        /// The control whose pivot fails.
        control: usize,
        /// Pivot of the Cholesky factorisation.
        pivot: f64,
    },
    /// The minimisation over the controls did not converge.
    #[error(
        "the minimisation over the controls stopped at a gradient of {gradient:e} after {iterations} iterations"
    )]
    ControlNotConverged {
        /// Largest entry of the gradient over the free controls.
        gradient: f64,
        /// Iterations made.
        iterations: usize,
    },
    /// Dynamics or cost are NaN or infinite at a finite point.
    #[error("dynamics or running cost are not finite at this point")]
    NonFinite,
    /// One of the functions that a user wrote has no value at a finite point.
    #[error("`{quantity}` is not finite at this point")]
    NoValue {
        /// Its name.
        quantity: &'static str,
    },
    /// The model cannot be built.
    #[error(transparent)]
    Model(#[from] ModelError),
    /// The dynamics of the tree fail.
    #[error(transparent)]
    Dynamics(#[from] DynamicsError),
}

/// An autonomous field ṗ = h(p) with its Jacobian.
///
/// Where the field has no value it returns NaN, and [`fault`](Self::fault) says why.
pub trait VectorField<const N: usize> {
    /// h(p).
    fn field(&self, p: &SVector<f64, N>) -> SVector<f64, N>;

    /// D = ∂h/∂p.
    fn jacobian(&self, p: &SVector<f64, N>) -> SMatrix<f64, N, N>;

    /// Field and Jacobian at once, for systems in which they share work.
    #[inline(always)]
    fn linearize(&self, p: &SVector<f64, N>) -> (SVector<f64, N>, SMatrix<f64, N, N>) {
        (self.field(p), self.jacobian(p))
    }

    /// D Φ into `out`, both by rows. For systems that know where D is zero; the default does not. `multiply_add` is
    /// a b + c in the way that is quickest on the machine.
    #[inline(always)]
    fn tangent(
        &self,
        d: &SMatrix<f64, N, N>,
        phi: &[[f64; N]; N],
        out: &mut [[f64; N]; N],
        multiply_add: impl Fn(f64, f64, f64) -> f64,
    ) where
        Self: Sized,
    {
        for i in 0..N {
            let mut sum = [0.0; N];
            for k in 0..N {
                for c in 0..N {
                    sum[c] = multiply_add(d[(i, k)], phi[k][c], sum[c]);
                }
            }
            out[i] = sum;
        }
    }

    /// Number of switches, at most `N`. Where there are any the field is continuous, but smooth only in each [`Piece`], and
    /// the methods below must be there too.
    #[inline(always)]
    fn n_switches(&self) -> usize {
        0
    }

    /// The piece that `p` lies in.
    #[inline(always)]
    fn piece(&self, _p: &SVector<f64, N>) -> Piece<N> {
        Piece::FREE
    }

    /// h of one piece, which goes on smoothly beyond it.
    #[inline(always)]
    fn field_in(&self, _piece: &Piece<N>, p: &SVector<f64, N>) -> SVector<f64, N> {
        self.field(p)
    }

    /// h and D of one piece.
    #[inline(always)]
    fn linearize_in(&self, _piece: &Piece<N>, p: &SVector<f64, N>) -> (SVector<f64, N>, SMatrix<f64, N, N>) {
        self.linearize(p)
    }

    /// Of each switch, a smooth function that is positive where the piece holds and zero where it ends.
    fn margins(&self, _piece: &Piece<N>, _p: &SVector<f64, N>) -> SVector<f64, N> {
        SVector::repeat(f64::INFINITY)
    }

    /// The piece that follows at `p`, just beyond the end of `piece`: switches with a negative margin change their side, a
    /// free one to the side on which its margin is larger.
    fn next_piece(&self, piece: &Piece<N>, p: &SVector<f64, N>) -> Piece<N> {
        let margins = self.margins(piece, p);
        let mut next = *piece;
        for i in (0..self.n_switches()).filter(|&i| margins[i] < 0.0) {
            let [lower, upper] = [Side::Lower, Side::Upper].map(|side| {
                let mut other = *piece;
                other.sides[i] = side;
                self.margins(&other, p)[i]
            });
            // a bound at infinity has no margin
            next.sides[i] = match piece.sides[i] {
                Side::Free if upper.is_nan() || lower > upper => Side::Lower,
                Side::Free => Side::Upper,
                Side::Lower | Side::Upper => Side::Free,
            };
        }
        next
    }

    /// H(p) where the field is known to be Hamiltonian, to be constant along its motions; none where nothing is known to be.
    ///
    /// Without a default: a system that hands on another one's field and forgets this would lose the check that it is for.
    fn conserved(&self, p: &SVector<f64, N>) -> Option<f64>;

    /// Why there is no value at `p`, if there is none.
    fn fault(&self, p: &SVector<f64, N>) -> Option<SystemError> {
        let finite = self.field(p).iter().all(|h| h.is_finite());
        (!finite).then_some(SystemError::NonFinite)
    }
}

/// A field h = J ∇H with J = (0, 1; −1, 0): its flow conserves H and its transition matrices are symplectic.
pub trait HamiltonianSystem<const N: usize>: VectorField<N> {
    /// H(p).
    fn hamiltonian(&self, p: &SVector<f64, N>) -> f64;
}

/// The state–costate system of an optimal control problem.
pub trait OptimalControlSystem<const N: usize>: HamiltonianSystem<N> {
    /// Number of controls.
    fn n_controls(&self) -> usize;

    /// Writes the optimal control u*(p) to `u`, of [`n_controls`](Self::n_controls) entries.
    fn control_into(&self, p: &SVector<f64, N>, u: &mut [f64]) -> Result<(), SystemError>;

    /// ℓ at the optimal control.
    fn running_cost(&self, p: &SVector<f64, N>) -> f64;

    /// ℓ at the control of one piece of the field.
    #[inline(always)]
    fn running_cost_in(&self, _piece: &Piece<N>, p: &SVector<f64, N>) -> f64 {
        self.running_cost(p)
    }
}

fn expect_controls(u: &[f64], expected: usize) -> Result<(), SystemError> {
    if u.len() == expected {
        Ok(())
    } else {
        Err(SystemError::Argument(ArgumentError::Length { argument: "u", expected, found: u.len() }))
    }
}
