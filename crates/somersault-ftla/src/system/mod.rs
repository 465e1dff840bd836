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
mod posed;
mod rooms;
mod scalar;
mod state_costate;
mod traced;
mod tree;

pub use arm::ArmMinimumTorque;
pub use piece::{Piece, Side};
pub use posed::PosedProblem;
pub use scalar::{CubicRegulator, LinearRegulator};
pub use state_costate::{DifferentiatedProblem, ProblemDerivatives, StateCostate};
pub use traced::TracedField;
pub use tree::TreeMinimumTorque;

use nalgebra::{DMatrix, DVector};
use somersault_core::argument::ArgumentError;
use somersault_expr::ExprError;
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
    /// A traced function is not the field of a system.
    #[error(transparent)]
    Expr(#[from] ExprError),
    /// A problem that no state–costate system follows from.
    #[error("`problem` must be one whose extremals obey an autonomous state–costate system: {reason}")]
    NoStateCostate {
        /// What it has that such a system does not.
        reason: String,
    },
    /// The dynamics of the tree fail.
    #[error(transparent)]
    Dynamics(#[from] DynamicsError),
}

/// A field ṗ = h(p) with its Jacobian. Points are as many numbers as its dimension.
///
/// A field that depends on time, ṗ = h(t, p), has no switches and implements the methods whose names end in `_at`, which flows call;
/// the others are then those of the time zero. Where the field has no value it writes NaN, and [`fault`](Self::fault) says why.
pub trait VectorField {
    /// How many numbers a point has. Where it is a constant, `#[inline(always)]` keeps flows from being compiled for others.
    fn dimension(&self) -> usize;

    /// Writes h(p) to `h`.
    fn field_into(&self, p: &[f64], h: &mut [f64]);

    /// Writes D = ∂h/∂p to `d`, every entry of it.
    fn jacobian_into(&self, p: &[f64], d: &mut DMatrix<f64>);

    /// Field and Jacobian at once, for systems in which they share work.
    #[inline(always)]
    fn linearize_into(&self, p: &[f64], h: &mut [f64], d: &mut DMatrix<f64>) {
        self.field_into(p, h);
        self.jacobian_into(p, d);
    }

    /// h(p).
    fn field(&self, p: &[f64]) -> DVector<f64> {
        let mut h = DVector::zeros(self.dimension());
        self.field_into(p, h.as_mut_slice());
        h
    }

    /// D(p).
    fn jacobian(&self, p: &[f64]) -> DMatrix<f64> {
        let mut d = DMatrix::zeros(self.dimension(), self.dimension());
        self.jacobian_into(p, &mut d);
        d
    }

    /// h(p) and D(p).
    fn linearize(&self, p: &[f64]) -> (DVector<f64>, DMatrix<f64>) {
        let n = self.dimension();
        let (mut h, mut d) = (DVector::zeros(n), DMatrix::zeros(n, n));
        self.linearize_into(p, h.as_mut_slice(), &mut d);
        (h, d)
    }

    /// D Φ into `out`, for D of `n` columns one after the other, and the others by rows. For systems that know where D is zero;
    /// the default does not. `multiply_add` is a b + c in the way that is quickest on the machine.
    #[inline(always)]
    fn tangent(
        &self,
        n: usize,
        d: &[f64],
        phi: &[f64],
        out: &mut [f64],
        multiply_add: impl Fn(f64, f64, f64) -> f64,
    ) where
        Self: Sized,
    {
        for i in 0..n {
            let out = &mut out[i * n..(i + 1) * n];
            out.fill(0.0);
            for k in 0..n {
                let (entry, phi) = (d[k * n + i], &phi[k * n..(k + 1) * n]);
                for c in 0..n {
                    out[c] = multiply_add(entry, phi[c], out[c]);
                }
            }
        }
    }

    /// h and D Φ of one piece at once, as [`linearize_in`](Self::linearize_in) and [`tangent`](Self::tangent) give them: for
    /// systems whose D need not be written down. `d` is room for it, of unspecified content afterwards.
    #[inline(always)]
    fn variation_in(
        &self,
        piece: &Piece,
        p: &[f64],
        h: &mut [f64],
        d: &mut DMatrix<f64>,
        (phi, out): (&[f64], &mut [f64]),
        multiply_add: impl Fn(f64, f64, f64) -> f64,
    ) where
        Self: Sized,
    {
        self.linearize_in(piece, p, h, d);
        self.tangent(p.len(), d.as_slice(), phi, out, multiply_add);
    }

    /// Number of switches. Where there are any the field is continuous, but smooth only in each [`Piece`], and the methods
    /// below must be there too.
    #[inline(always)]
    fn n_switches(&self) -> usize {
        0
    }

    /// The piece that `p` lies in.
    #[inline(always)]
    fn piece(&self, _p: &[f64]) -> Piece {
        Piece::FREE
    }

    /// Writes h of one piece, which continues smoothly beyond it.
    #[inline(always)]
    fn field_in(&self, _piece: &Piece, p: &[f64], h: &mut [f64]) {
        self.field_into(p, h);
    }

    /// Writes h and D of one piece.
    #[inline(always)]
    fn linearize_in(&self, _piece: &Piece, p: &[f64], h: &mut [f64], d: &mut DMatrix<f64>) {
        self.linearize_into(p, h, d);
    }

    /// Writes h(t, p) of one piece.
    #[inline(always)]
    fn field_at(&self, _t: f64, piece: &Piece, p: &[f64], h: &mut [f64]) {
        self.field_in(piece, p, h);
    }

    /// Writes h(t, p) of one piece and ∂h/∂p.
    #[inline(always)]
    fn linearize_at(&self, _t: f64, piece: &Piece, p: &[f64], h: &mut [f64], d: &mut DMatrix<f64>) {
        self.linearize_in(piece, p, h, d);
    }

    /// h and D Φ at a time, as [`variation_in`](Self::variation_in) has them.
    #[inline(always)]
    fn variation_at(
        &self,
        _t: f64,
        piece: &Piece,
        p: &[f64],
        h: &mut [f64],
        d: &mut DMatrix<f64>,
        variation: (&[f64], &mut [f64]),
        multiply_add: impl Fn(f64, f64, f64) -> f64,
    ) where
        Self: Sized,
    {
        self.variation_in(piece, p, h, d, variation, multiply_add);
    }

    /// Writes, of each switch, a smooth function that is positive where the piece holds and zero where it ends.
    fn margins_into(&self, _piece: &Piece, _p: &[f64], margins: &mut [f64]) {
        margins.fill(f64::INFINITY);
    }

    /// The margins of all switches.
    fn margins(&self, piece: &Piece, p: &[f64]) -> Vec<f64> {
        let mut margins = vec![f64::INFINITY; self.n_switches()];
        self.margins_into(piece, p, &mut margins);
        margins
    }

    /// The piece that follows at `p`, just beyond the end of `piece`: switches with a negative margin change their side, a
    /// free one to the side on which its margin is larger.
    fn next_piece(&self, piece: &Piece, p: &[f64]) -> Piece {
        let margins = self.margins(piece, p);
        let mut next = piece.clone();
        for i in (0..self.n_switches()).filter(|&i| margins[i] < 0.0) {
            let [lower, upper] =
                [Side::Lower, Side::Upper].map(|side| self.margins(&piece.with(i, side), p)[i]);
            // a bound at infinity has no margin
            let side = match piece.side(i) {
                Side::Free if upper.is_nan() || lower > upper => Side::Lower,
                Side::Free => Side::Upper,
                Side::Lower | Side::Upper => Side::Free,
            };
            next.set(i, side);
        }
        next
    }

    /// H(p) where the field is known to be Hamiltonian, to be constant along its motions; none where nothing is known to be.
    ///
    /// Without a default: a system that forwards another one's field and forgets this would lose the check that it is for.
    fn conserved(&self, p: &[f64]) -> Option<f64>;

    /// Why there is no value at `p`, if there is none.
    fn fault(&self, p: &[f64]) -> Option<SystemError> {
        let finite = self.field(p).iter().all(|h| h.is_finite());
        (!finite).then_some(SystemError::NonFinite)
    }
}

/// A field h = J ∇H with J = (0, 1; −1, 0): its flow conserves H and its transition matrices are symplectic.
pub trait HamiltonianSystem: VectorField {
    /// H(p).
    fn hamiltonian(&self, p: &[f64]) -> f64;
}

/// The state–costate system of an optimal control problem.
pub trait OptimalControlSystem: HamiltonianSystem {
    /// Number of controls.
    fn n_controls(&self) -> usize;

    /// Writes the optimal control u*(p) to `u`, of [`n_controls`](Self::n_controls) entries.
    fn control_into(&self, p: &[f64], u: &mut [f64]) -> Result<(), SystemError>;

    /// ℓ at the optimal control.
    fn running_cost(&self, p: &[f64]) -> f64;

    /// ℓ at the control of one piece of the field.
    #[inline(always)]
    fn running_cost_in(&self, _piece: &Piece, p: &[f64]) -> f64 {
        self.running_cost(p)
    }
}

/// A field without a value.
fn no_field(h: &mut [f64]) {
    h.fill(f64::NAN);
}

fn expect_controls(u: &[f64], expected: usize) -> Result<(), SystemError> {
    if u.len() == expected {
        Ok(())
    } else {
        Err(SystemError::Argument(ArgumentError::Length { argument: "u", expected, found: u.len() }))
    }
}
