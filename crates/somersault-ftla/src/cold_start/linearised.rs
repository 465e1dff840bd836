//! Extremals of any system from boundary states and horizon alone, by way of a linear problem.
//!
//! Near a point p̄ the field is h(p̄) + D(p̄)(p − p̄). Its boundary value problem is linear, so that one Newton step solves it
//! from anything, and the family
//!
//! ```text
//! ṗ = s h(p) + (1 − s) (h(p̄) + D(p̄)(p − p̄)),   0 ≤ s ≤ 1,
//! ```
//! each member of which is Hamiltonian if h is, leads from it to the problem. p̄ is the middle between the ends with λ = 0.
//! Where that breaks off, the linear problem stays at the start instead, and the ends are moved apart afterwards.

use crate::budget::Budget;
use crate::continuation::{Continuation, Continued, Member, Stage};
use crate::shooting::{End, ShootingError, Status, graded_times};
use crate::system::{Piece, SystemError, VectorField};
use nalgebra::linalg::balancing::balance_parlett_reinsch;
use nalgebra::{SMatrix, SVector};
use somersault_core::argument::ArgumentError;

/// A field on the way from its linearisation to itself.
#[derive(Debug)]
struct Blend<'a, S, const N: usize> {
    system: &'a S,
    at: SVector<f64, N>,
    field: SVector<f64, N>,
    jacobian: SMatrix<f64, N, N>,
    s: f64,
}

impl<'a, S: VectorField<N>, const N: usize> Blend<'a, S, N> {
    fn at(system: &'a S, at: SVector<f64, N>, s: f64) -> Self {
        let (field, jacobian) = system.linearize(&at);
        Self { system, at, field, jacobian, s }
    }

    fn mixed(&self, field: SVector<f64, N>, p: &SVector<f64, N>) -> SVector<f64, N> {
        field * self.s + (self.field + self.jacobian * (p - self.at)) * (1.0 - self.s)
    }

    fn bent(&self, jacobian: SMatrix<f64, N, N>) -> SMatrix<f64, N, N> {
        jacobian * self.s + self.jacobian * (1.0 - self.s)
    }
}

impl<S: VectorField<N>, const N: usize> VectorField<N> for Blend<'_, S, N> {
    fn field(&self, p: &SVector<f64, N>) -> SVector<f64, N> {
        self.mixed(self.system.field(p), p)
    }

    fn jacobian(&self, p: &SVector<f64, N>) -> SMatrix<f64, N, N> {
        self.bent(self.system.jacobian(p))
    }

    fn linearize(&self, p: &SVector<f64, N>) -> (SVector<f64, N>, SMatrix<f64, N, N>) {
        let (field, jacobian) = self.system.linearize(p);
        (self.mixed(field, p), self.bent(jacobian))
    }

    fn n_switches(&self) -> usize {
        self.system.n_switches()
    }

    fn piece(&self, p: &SVector<f64, N>) -> Piece<N> {
        self.system.piece(p)
    }

    fn field_in(&self, piece: &Piece<N>, p: &SVector<f64, N>) -> SVector<f64, N> {
        self.mixed(self.system.field_in(piece, p), p)
    }

    fn linearize_in(&self, piece: &Piece<N>, p: &SVector<f64, N>) -> (SVector<f64, N>, SMatrix<f64, N, N>) {
        let (field, jacobian) = self.system.linearize_in(piece, p);
        (self.mixed(field, p), self.bent(jacobian))
    }

    fn margins(&self, piece: &Piece<N>, p: &SVector<f64, N>) -> SVector<f64, N> {
        self.system.margins(piece, p)
    }

    fn next_piece(&self, piece: &Piece<N>, p: &SVector<f64, N>) -> Piece<N> {
        self.system.next_piece(piece, p)
    }

    /// s H + (1 − s) (H(p̄) + ∇H·δ + ½ δᵀ∇²H δ), δ = p − p̄, with ∇H = −J h and ∇²H = −J D.
    fn conserved(&self, p: &SVector<f64, N>) -> Option<f64> {
        let n = N / 2;
        let delta = p - self.at;
        let linear = self.field + self.jacobian * delta * 0.5;
        // δᵀ(−J v), v = (vₓ, v_λ): δₓ·(−v_λ) + δ_λ·vₓ
        let part: f64 = (0..n).map(|i| delta[n + i] * linear[i] - delta[i] * linear[n + i]).sum();
        let (here, there) = (self.system.conserved(p)?, self.system.conserved(&self.at)?);
        Some(self.s * here + (1.0 - self.s) * (there + part))
    }

    fn fault(&self, p: &SVector<f64, N>) -> Option<SystemError> {
        self.system.fault(p)
    }
}

/// Segments as parts of the time in which the fastest rate grows e-fold, tried in turn: shortest and longest.
const SEGMENTS: [[f64; 2]; 2] = [[0.5, 4.0], [0.25, 1.0]];

/// Most segments.
const MOST: f64 = 2e4;

/// Both ends, if they and the horizon are ones.
pub(super) fn expect_states<const N: usize>(
    states: [&[f64]; 2],
    horizon: f64,
) -> Result<[End<N>; 2], ShootingError> {
    if !horizon.is_finite() || horizon <= 0.0 {
        let allowed = "positive and finite";
        return Err(ArgumentError::OutOfRange { argument: "horizon", allowed, found: horizon }.into());
    }
    let end = |argument, x: &[f64]| {
        if x.len() != N / 2 {
            return Err(ArgumentError::Length { argument, expected: N / 2, found: x.len() }.into());
        }
        match x.iter().find(|x| !x.is_finite()) {
            Some(&found) => {
                Err(ShootingError::Argument(ArgumentError::OutOfRange { argument, allowed: "finite", found }))
            }
            None => End::try_state(x),
        }
    };
    Ok([end("initial", states[0])?, end("last", states[1])?])
}

/// An extremal from `initial` to `last` in `horizon`, from nothing else. What comes back has arrived if its `s` is one and
/// its extremal has converged; its counts are of all attempts.
///
/// States that are to be free are not meant; several extremals may join two states, and this finds one of them.
pub fn cold_start<S: VectorField<N> + Sync, const N: usize>(
    system: &S,
    initial: &[f64],
    last: &[f64],
    horizon: f64,
    continuation: &Continuation,
) -> Result<Continued<N>, ShootingError> {
    cold_start_within(&continuation.polish.limits.start(), system, initial, last, horizon, continuation)
}

/// The same as a part of a search that has begun.
pub(super) fn cold_start_within<S: VectorField<N> + Sync, const N: usize>(
    budget: &Budget,
    system: &S,
    initial: &[f64],
    last: &[f64],
    horizon: f64,
    continuation: &Continuation,
) -> Result<Continued<N>, ShootingError> {
    let ends = expect_states::<N>([initial, last], horizon)?;
    let node =
        |weight: f64| {
            SVector::<f64, N>::from_fn(|i, _| {
                if i < N / 2 { initial[i] + weight * (last[i] - initial[i]) } else { 0.0 }
            })
        };
    let middle = node(0.5);
    // eigenvalues of D come as ±: √‖D²‖ is as large as the fastest, and near it in units in which D is balanced
    let (_, mut jacobian) = system.linearize(&middle);
    if jacobian.iter().all(|d| d.is_finite()) {
        balance_parlett_reinsch(&mut jacobian);
    }
    let rate = (jacobian * jacobian).norm().sqrt();
    let mut found: Option<Continued<N>> = None;
    let mut failed = None;
    for [shortest, longest] in SEGMENTS {
        let part = |factor: f64| (factor / rate).min(0.1 * horizon).max(horizon / MOST);
        let fractions = graded_times(1.0, part(shortest) / horizon, part(longest) / horizon)?;
        let attempt = |stage: Stage, at: SVector<f64, N>, ends: [End<N>; 2]| {
            let bend = |s: f64| Member { system: Blend::at(system, at, s), ends, horizon };
            continuation.follow_within(budget, stage, bend, &fractions, &vec![at; fractions.len()])
        };
        let from_start = || {
            let start = node(0.0);
            let bent = attempt(Stage::LinearisedAtStart, start, [ends[0]; 2])?;
            if !bent.arrived() {
                return Ok(bent);
            }
            let apart = |s: f64| {
                let ends = [ends[0], End::from_values(node(s).iter().copied())];
                Member { system: Blend::at(system, start, 1.0), ends, horizon }
            };
            let moved =
                continuation.follow_within(budget, Stage::Apart, apart, &fractions, &bent.extremal.nodes)?;
            Ok(moved.after(&bent))
        };
        let attempts: [&dyn Fn() -> Result<Continued<N>, ShootingError>; 2] =
            [&|| attempt(Stage::Linearised, middle, ends), &from_start];
        for attempt in attempts {
            let next = match attempt() {
                Ok(next) => found.as_ref().map_or(next.clone(), |before| next.after(before)),
                Err(error) => {
                    failed = Some(error);
                    continue;
                }
            };
            // what broke off on the way is marked so; at a floor no other way leads lower
            if matches!(next.extremal.status, Status::Converged | Status::Floor) || budget.reached().is_some()
            {
                return Ok(next);
            }
            found = Some(next);
        }
    }
    match (found, failed) {
        (Some(found), _) => Ok(found),
        (None, Some(error)) => Err(error),
        (None, None) => {
            Err(ShootingError::Argument(ArgumentError::Length { argument: "horizon", expected: 1, found: 0 }))
        }
    }
}
