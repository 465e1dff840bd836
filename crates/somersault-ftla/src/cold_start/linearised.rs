//! Extremals of any system from boundary states and horizon alone, by way of a linear problem.
//!
//! Near a point p̄ the field is h(p̄) + D(p̄)(p − p̄). Its boundary value problem is linear, so that one Newton step solves it
//! from anything, and the family
//!
//! ```text
//! ṗ = s h(p) + (1 − s) (h(p̄) + D(p̄)(p − p̄)),   0 ≤ s ≤ 1,
//! ```
//! each member of which is Hamiltonian if h is, leads from it to the problem. p̄ is the middle between the ends with λ = 0.
//! Where that stops early, the linear problem stays at the start instead, and the ends are moved apart afterwards.

use crate::budget::Budget;
use crate::continuation::{Continuation, ContinuationResult, Member, Stage};
use crate::shooting::{End, ShootingError, ShootingStatus, graded_times};
use crate::system::{Piece, SystemError, VectorField};
use nalgebra::linalg::balancing::balance_parlett_reinsch;
use nalgebra::{DMatrix, DVector};
use somersault_core::argument::ArgumentError;

/// A field on the way from its linearisation to itself.
#[derive(Debug)]
struct Blend<'a, S> {
    system: &'a S,
    at: DVector<f64>,
    field: DVector<f64>,
    jacobian: DMatrix<f64>,
    s: f64,
}

impl<'a, S: VectorField> Blend<'a, S> {
    fn at(system: &'a S, at: &DVector<f64>, s: f64) -> Self {
        let (field, jacobian) = system.linearize(at.as_slice());
        Self { system, at: at.clone(), field, jacobian, s }
    }

    /// Mixes the field at `p` in `h` with the linear one.
    fn mix(&self, p: &[f64], h: &mut [f64]) {
        for (i, h) in h.iter_mut().enumerate() {
            let parts = p.iter().zip(&self.at).enumerate();
            let linear =
                parts.fold(self.field[i], |sum, (j, (p, at))| sum + self.jacobian[(i, j)] * (p - at));
            *h = *h * self.s + linear * (1.0 - self.s);
        }
    }

    /// The same for a Jacobian.
    fn mix_jacobian(&self, d: &mut DMatrix<f64>) {
        d.zip_apply(&self.jacobian, |d: &mut f64, linear: f64| *d = *d * self.s + linear * (1.0 - self.s));
    }
}

impl<S: VectorField> VectorField for Blend<'_, S> {
    #[inline(always)]
    fn dimension(&self) -> usize {
        self.system.dimension()
    }

    fn field_into(&self, p: &[f64], h: &mut [f64]) {
        self.system.field_into(p, h);
        self.mix(p, h);
    }

    fn jacobian_into(&self, p: &[f64], d: &mut DMatrix<f64>) {
        self.system.jacobian_into(p, d);
        self.mix_jacobian(d);
    }

    fn linearize_into(&self, p: &[f64], h: &mut [f64], d: &mut DMatrix<f64>) {
        self.system.linearize_into(p, h, d);
        self.mix(p, h);
        self.mix_jacobian(d);
    }

    fn n_switches(&self) -> usize {
        self.system.n_switches()
    }

    fn piece(&self, p: &[f64]) -> Piece {
        self.system.piece(p)
    }

    fn field_in(&self, piece: &Piece, p: &[f64], h: &mut [f64]) {
        self.system.field_in(piece, p, h);
        self.mix(p, h);
    }

    fn linearize_in(&self, piece: &Piece, p: &[f64], h: &mut [f64], d: &mut DMatrix<f64>) {
        self.system.linearize_in(piece, p, h, d);
        self.mix(p, h);
        self.mix_jacobian(d);
    }

    fn margins_into(&self, piece: &Piece, p: &[f64], margins: &mut [f64]) {
        self.system.margins_into(piece, p, margins);
    }

    fn next_piece(&self, piece: &Piece, p: &[f64]) -> Piece {
        self.system.next_piece(piece, p)
    }

    /// s H + (1 − s) (H(p̄) + ∇H·δ + ½ δᵀ∇²H δ), δ = p − p̄, with ∇H = −J h and ∇²H = −J D.
    fn conserved(&self, p: &[f64]) -> Option<f64> {
        let n = p.len() / 2;
        let delta = DVector::from_column_slice(p) - &self.at;
        let linear = &self.field + &self.jacobian * &delta * 0.5;
        // δᵀ(−J v), v = (vₓ, v_λ): δₓ·(−v_λ) + δ_λ·vₓ
        let part: f64 = (0..n).map(|i| delta[n + i] * linear[i] - delta[i] * linear[n + i]).sum();
        let (here, there) = (self.system.conserved(p)?, self.system.conserved(self.at.as_slice())?);
        Some(self.s * here + (1.0 - self.s) * (there + part))
    }

    fn fault(&self, p: &[f64]) -> Option<SystemError> {
        self.system.fault(p)
    }
}

/// Segments as parts of the time in which the fastest rate grows e-fold, tried in turn: shortest and longest.
const SEGMENTS: [[f64; 2]; 2] = [[0.5, 4.0], [0.25, 1.0]];

/// Most segments.
const MOST: f64 = 2e4;

/// Fails unless a horizon is positive and finite.
pub(super) fn expect_horizon(horizon: f64) -> Result<(), ShootingError> {
    if horizon.is_finite() && horizon > 0.0 {
        return Ok(());
    }
    let allowed = "positive and finite";
    Err(ArgumentError::OutOfRange { argument: "horizon", allowed, found: horizon }.into())
}

/// The fastest rate of the field at a point, by its Jacobian D: eigenvalues come as ±, so that √‖D²‖ is as large as the fastest, and
/// near it in units in which D is balanced.
pub(super) fn fastest_rate<S: VectorField>(system: &S, p: &DVector<f64>) -> f64 {
    let (_, mut jacobian) = system.linearize(p.as_slice());
    if jacobian.iter().all(|d| d.is_finite()) {
        balance_parlett_reinsch(&mut jacobian);
    }
    (&jacobian * &jacobian).norm().sqrt()
}

/// Both ends, if they and the horizon are ones.
pub(super) fn expect_states(
    dimension: usize,
    states: [&[f64]; 2],
    horizon: f64,
) -> Result<[End; 2], ShootingError> {
    expect_horizon(horizon)?;
    let end = |argument, x: &[f64]| {
        if 2 * x.len() != dimension {
            return Err(ArgumentError::Length { argument, expected: dimension / 2, found: x.len() }.into());
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
pub fn cold_start<S: VectorField + Sync>(
    system: &S,
    initial: &[f64],
    last: &[f64],
    horizon: f64,
    continuation: &Continuation,
) -> Result<ContinuationResult, ShootingError> {
    cold_start_within(&continuation.polish.limits.start(), system, initial, last, horizon, continuation)
}

/// The same as a part of a search that has begun.
pub(super) fn cold_start_within<S: VectorField + Sync>(
    budget: &Budget,
    system: &S,
    initial: &[f64],
    last: &[f64],
    horizon: f64,
    continuation: &Continuation,
) -> Result<ContinuationResult, ShootingError> {
    let dimension = system.dimension();
    let ends = expect_states(dimension, [initial, last], horizon)?;
    let state = |weight: f64| initial.iter().zip(last).map(move |(from, to)| from + weight * (to - from));
    let node = |weight: f64| {
        DVector::from_iterator(dimension, state(weight).chain(std::iter::repeat_n(0.0, initial.len())))
    };
    let middle = node(0.5);
    let rate = fastest_rate(system, &middle);
    let mut found: Option<ContinuationResult> = None;
    let mut failed = None;
    for [shortest, longest] in SEGMENTS {
        let part = |factor: f64| (factor / rate).min(0.1 * horizon).max(horizon / MOST);
        let fractions = graded_times(1.0, part(shortest) / horizon, part(longest) / horizon)?;
        let attempt = |stage: Stage, at: &DVector<f64>, ends: &[End; 2]| {
            let bend = |s: f64| Member { system: Blend::at(system, at, s), ends: ends.clone(), horizon };
            continuation.follow_within(budget, stage, bend, &fractions, &vec![at.clone(); fractions.len()])
        };
        let from_start = || {
            let start = node(0.0);
            let bent = attempt(Stage::LinearisedAtStart, &start, &[ends[0].clone(), ends[0].clone()])?;
            if !bent.arrived() {
                return Ok(bent);
            }
            let apart = |s: f64| {
                let ends = [ends[0].clone(), End::from_values(state(s))];
                Member { system: Blend::at(system, &start, 1.0), ends, horizon }
            };
            let moved =
                continuation.follow_within(budget, Stage::Apart, apart, &fractions, &bent.extremal.nodes)?;
            Ok(moved.after(&bent))
        };
        let attempts: [&dyn Fn() -> Result<ContinuationResult, ShootingError>; 2] =
            [&|| attempt(Stage::Linearised, &middle, &ends), &from_start];
        for attempt in attempts {
            let next = match attempt() {
                Ok(next) => found.as_ref().map_or(next.clone(), |before| next.after(before)),
                Err(error) => {
                    failed = Some(error);
                    continue;
                }
            };
            // what stopped early on the way is marked so; at a floor no other way leads lower
            if matches!(next.extremal.status, ShootingStatus::Converged | ShootingStatus::Floor)
                || budget.reached().is_some()
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
