//! Minimum-torque motions of any tree, all degrees of freedom driven or some passive.
//!
//! x = (c, v) with as many coordinates c as velocities (those of joints that turn freely in `chart`), v̇ = a(c, v, u) by
//! forward dynamics, ℓ = ½ Σ γᵢuᵢ². The partials of `somersault-multibody` give
//! u* = −Γ⁻¹M⁻¹λ_v, cut off at the limits, and the field; the Jacobian is the same code over dual numbers, one pass for
//! each state, the other half following from its being Hamiltonian. M⁻¹ is diagonal in nothing, but K is a sum over the
//! controls, so that each is cut off by itself.

use super::chart::{Charts, Scratch};
use super::piece::{Bounds, expect_limit};
use super::{
    HamiltonianSystem, OptimalControlSystem, Piece, Side, SystemError, VectorField, expect_controls, no_field,
};
use crate::cold_start::Torque;
use nalgebra::DMatrix;
use num_dual::Dual64;
use somersault_core::Scalar;
use somersault_core::argument::{ArgumentError, expect_positive};
use somersault_multibody::{DerivativeData, DynamicsError, Model};
use std::sync::{Mutex, PoisonError};

/// The state–costate system of a tree of n degrees of freedom, 4n numbers.
///
/// Angles and lengths of joints are their own coordinates. A spherical joint has the vector of its rotation from the home
/// position, which must stay below a whole turn, a free one its place and that vector, a planar one place and angle; the
/// velocities of these are in the axes of the child, as everywhere in `somersault-multibody`.
#[derive(Debug)]
pub struct TreeMinimumTorque {
    effort: Effort,
    values: Kernel<f64>,
    duals: Kernel<Dual64>,
}

impl Kernel<f64> {
    /// ∂v̇/∂λ_v = −M⁻¹Γ⁻¹M⁻ᵀ over the torques that move, into its place in D.
    fn by_costates(
        &self,
        effort: &Effort,
        piece: &Piece,
        p: &[f64],
        jacobian: &mut DMatrix<f64>,
    ) -> Result<(), DynamicsError> {
        let n = p.len() / 4;
        self.with_workspace(|Workspace { data, torque, scratch, .. }| {
            self.charts.place(&self.model, &p[..n], scratch)?;
            torque.fill(0.0);
            let v = &p[n..2 * n];
            let inverse =
                self.model.forward_dynamics_partials(data, &scratch.positions, v, torque, &[])?.input;
            let moves = |k: &usize| effort.driven[*k] && piece.side(*k) == Side::Free;
            for k in (0..n).filter(moves) {
                for (i, j) in (0..n).flat_map(|i| (0..n).map(move |j| (i, j))) {
                    jacobian[(n + i, 3 * n + j)] -= inverse[(i, k)] * inverse[(j, k)] / effort.weights[k];
                }
            }
            Ok(())
        })
    }
}

impl Clone for TreeMinimumTorque {
    fn clone(&self) -> Self {
        Self::with_effort(&self.values.model, self.effort.clone())
    }
}

/// Weights, limits and which joints are driven.
#[derive(Debug, Clone)]
struct Effort {
    weights: Vec<f64>,
    bounds: Vec<Bounds>,
    driven: Vec<bool>,
}

/// A model with workspaces that threads take and give back.
#[derive(Debug)]
struct Kernel<T: Scalar> {
    model: Model<T>,
    charts: Charts,
    pool: Mutex<Vec<Workspace<T>>>,
}

#[derive(Debug)]
struct Workspace<T: Scalar> {
    data: DerivativeData<T>,
    torque: Vec<T>,
    /// The torque that would be best without limits.
    free: Vec<T>,
    scratch: Scratch<T>,
    point: Vec<T>,
    field: Vec<T>,
}

impl<T: Scalar> Kernel<T> {
    fn new(model: Model<T>, charts: Charts) -> Self {
        Self { model, charts, pool: Mutex::new(Vec::new()) }
    }

    fn with_workspace<R>(&self, run: impl FnOnce(&mut Workspace<T>) -> R) -> R {
        let pooled = self.pool.lock().unwrap_or_else(PoisonError::into_inner).pop();
        let zeros = |blocks: usize| vec![T::zero(); blocks * self.model.n_velocities()];
        let mut work = pooled.unwrap_or_else(|| Workspace {
            data: DerivativeData::new(&self.model),
            torque: zeros(1),
            free: zeros(1),
            scratch: Scratch::new(&self.model),
            point: zeros(4),
            field: zeros(4),
        });
        let result = run(&mut work);
        self.pool.lock().unwrap_or_else(PoisonError::into_inner).push(work);
        result
    }

    /// Field, torque, and the torque that would be best without limits, at the point of a workspace in one piece.
    fn evaluate(&self, work: &mut Workspace<T>, effort: &Effort, piece: &Piece) -> Result<(), DynamicsError> {
        let Workspace { data, torque, free, scratch, point, field } = work;
        let n = torque.len();
        let (state, costate) = point.split_at(2 * n);
        let ((c, v), (costate_q, costate_v)) = (state.split_at(n), costate.split_at(n));
        self.charts.place(&self.model, c, scratch)?;
        let q = &scratch.positions;
        // M⁻¹ does not depend on the torque that it is needed for
        torque.fill(T::zero());
        free.fill(T::zero());
        let inverse = self.model.forward_dynamics_partials(data, q, v, torque, &[])?.input;
        for i in (0..n).filter(|&i| effort.driven[i]) {
            let projected = (0..n).fold(T::zero(), |sum, j| sum + inverse[(j, i)] * costate_v[j]);
            free[i] = -projected / nalgebra::convert(effort.weights[i]);
        }
        for i in 0..n {
            torque[i] = match piece.side(i) {
                Side::Free => free[i],
                side => nalgebra::convert(effort.bounds[i].control(side, 0.0)),
            };
        }
        let partials = self.model.forward_dynamics_partials(data, q, v, torque, &[])?;
        let (rates, costate_rates) = field.split_at_mut(2 * n);
        let (of_q, of_v) = costate_rates.split_at_mut(n);
        rates[..n].copy_from_slice(v);
        rates[n..].copy_from_slice(&partials.value[..n]);
        of_v.copy_from_slice(costate_q);
        for i in 0..n {
            of_q[i] = (0..n).fold(T::zero(), |sum, j| sum + partials.q[(j, i)] * costate_v[j]);
        }
        self.charts.rates(c, q, &mut rates[..n]);
        self.charts.gradient(c, v, q, of_q, of_v);
        for i in 0..n {
            of_q[i] = -of_q[i];
            of_v[i] = (0..n).fold(-of_v[i], |sum, j| sum - partials.v[(j, i)] * costate_v[j]);
        }
        Ok(())
    }
}

impl TreeMinimumTorque {
    /// `weights` has one γ for each degree of freedom of `model`, which must have one at least.
    pub fn try_new(model: &Model, weights: &[f64]) -> Result<Self, SystemError> {
        let n = model.n_velocities();
        if n == 0 {
            let (argument, allowed) = ("model", "of one degree of freedom at least");
            return Err(ArgumentError::OutOfRange { argument, allowed, found: 0.0 }.into());
        }
        if weights.len() != n {
            return Err(
                ArgumentError::Length { argument: "weights", expected: n, found: weights.len() }.into()
            );
        }
        weights.iter().try_for_each(|&w| expect_positive("weights", w).map(|_| ()))?;
        let bounds = vec![Bounds { lower: f64::NEG_INFINITY, upper: f64::INFINITY }; n];
        Ok(Self::with_effort(model, Effort { weights: weights.to_vec(), bounds, driven: vec![true; n] }))
    }

    fn with_effort(model: &Model, effort: Effort) -> Self {
        Self {
            effort,
            values: Kernel::new(model.clone(), Charts::of(model)),
            duals: Kernel::new(model.cast(), Charts::of(model)),
        }
    }

    /// Bounds |uᵢ| by `limits`, N m or N; infinite for none.
    pub fn try_with_torque_limits(mut self, limits: &[f64]) -> Result<Self, SystemError> {
        let expected = self.degrees();
        if limits.len() != expected {
            return Err(ArgumentError::Length { argument: "limits", expected, found: limits.len() }.into());
        }
        self.effort.bounds = limits.iter().map(|&limit| expect_limit(limit)).collect::<Result<_, _>>()?;
        Ok(self)
    }

    /// Degree of freedom `joint` is passive: its torque is zero. One at least must be driven.
    pub fn try_with_passive(mut self, joint: usize) -> Result<Self, SystemError> {
        let others = self.effort.driven.iter().enumerate().any(|(i, driven)| *driven && i != joint);
        if joint >= self.degrees() || !others {
            let (allowed, found) = ("the number of a joint, another one being driven", joint as f64);
            return Err(ArgumentError::OutOfRange { argument: "joint", allowed, found }.into());
        }
        self.effort.driven[joint] = false;
        Ok(self)
    }

    fn degrees(&self) -> usize {
        self.effort.weights.len()
    }

    /// γ of every degree of freedom, driven or not.
    pub(crate) fn weights(&self) -> &[f64] {
        &self.effort.weights
    }

    /// Whether no degree of freedom is passive.
    pub(crate) fn is_fully_driven(&self) -> bool {
        self.effort.driven.iter().all(|driven| *driven)
    }

    /// Of every torque the largest that is allowed.
    pub(crate) fn torque_limits(&self) -> Vec<f64> {
        self.effort.bounds.iter().map(|b| b.upper).collect()
    }

    /// Whether every coordinate is the integral of its velocity.
    pub(crate) fn is_flat(&self) -> bool {
        self.values.charts.is_empty()
    }

    /// Without limits, and with what is passive driven at γ/(1 − s): at s = 1 not at all.
    pub(crate) fn released(&self, s: f64) -> Self {
        let mut effort = self.effort.clone();
        effort.bounds.fill(Bounds { lower: f64::NEG_INFINITY, upper: f64::INFINITY });
        if s < 1.0 {
            for (weight, driven) in effort.weights.iter_mut().zip(&mut effort.driven) {
                if !std::mem::replace(driven, true) {
                    *weight /= 1.0 - s;
                }
            }
        }
        Self::with_effort(&self.values.model, effort)
    }

    /// With limits on the way from `peaks` to its own, where these are lower.
    pub(crate) fn limited_from(&self, peaks: &[f64], s: f64) -> Self {
        let mut effort = self.effort.clone();
        for (bounds, &peak) in effort.bounds.iter_mut().zip(peaks) {
            if bounds.upper < peak {
                let limit = peak + s * (bounds.upper - peak);
                *bounds = Bounds { lower: -limit, upper: limit };
            }
        }
        Self::with_effort(&self.values.model, effort)
    }

    /// The torques of a motion in angles and lengths, given by q, v and a one after the other, with their derivatives; NaN
    /// where there are none.
    pub(crate) fn inverse_dynamics(&self, motion: &[f64], torque: &mut Torque) {
        let n = self.degrees();
        let (q, v, a) = (&motion[..n], &motion[n..2 * n], &motion[2 * n..]);
        self.values.with_workspace(|work| {
            match self.values.model.inverse_dynamics_partials(&mut work.data, q, v, a, &[]) {
                Ok(found) => {
                    torque.u.copy_from_slice(found.value);
                    for (by, part) in torque.by.iter_mut().zip([found.q, found.v, found.input]) {
                        by.copy_from(part);
                    }
                }
                Err(_) => torque.fill(f64::NAN),
            }
        });
    }

    /// What `read` makes of the workspace after an evaluation at `p`, in `piece` or with every torque within its limits.
    fn at<R>(
        &self,
        piece: Option<&Piece>,
        p: &[f64],
        read: impl FnOnce(&Workspace<f64>) -> R,
    ) -> Result<R, DynamicsError> {
        self.values.with_workspace(|work| {
            work.point.copy_from_slice(p);
            self.values.evaluate(work, &self.effort, piece.unwrap_or(&Piece::FREE))?;
            if piece.is_none() {
                let there = self.piece_of(&work.free);
                if there != Piece::FREE {
                    self.values.evaluate(work, &self.effort, &there)?;
                }
            }
            Ok(read(work))
        })
    }

    fn write_field(&self, piece: Option<&Piece>, p: &[f64], h: &mut [f64]) {
        if self.at(piece, p, |work| h.copy_from_slice(&work.field)).is_err() {
            no_field(h);
        }
    }

    fn piece_of(&self, free: &[f64]) -> Piece {
        self.effort.bounds.iter().zip(free).map(|(bounds, free)| bounds.side(*free)).collect()
    }

    fn try_jacobian(&self, piece: &Piece, p: &[f64], d: &mut DMatrix<f64>) -> Result<(), DynamicsError> {
        let n = self.degrees();
        d.fill(0.0);
        self.duals.with_workspace(|work| {
            work.point.iter_mut().zip(p).for_each(|(dual, p)| *dual = Dual64::from_re(*p));
            for j in 0..2 * n {
                work.point[j].eps = 1.0;
                self.duals.evaluate(work, &self.effort, piece)?;
                work.point[j].eps = 0.0;
                work.field.iter().enumerate().for_each(|(i, h)| d[(i, j)] = h.eps);
            }
            Ok::<_, DynamicsError>(())
        })?;
        for (i, j) in (0..2 * n).flat_map(|i| (0..2 * n).map(move |j| (i, j))) {
            d[(2 * n + i, 2 * n + j)] = -d[(j, i)];
        }
        self.values.by_costates(&self.effort, piece, p, d)
    }

    fn write_jacobian(&self, piece: &Piece, p: &[f64], d: &mut DMatrix<f64>) {
        if self.try_jacobian(piece, p, d).is_err() {
            d.fill(f64::NAN);
        }
    }

    fn cost_of(&self, torque: &[f64]) -> f64 {
        0.5 * self.effort.weights.iter().zip(torque).map(|(w, u)| w * u * u).sum::<f64>()
    }
}

impl VectorField for TreeMinimumTorque {
    fn dimension(&self) -> usize {
        4 * self.degrees()
    }

    fn field_into(&self, p: &[f64], h: &mut [f64]) {
        self.write_field(None, p, h);
    }

    fn jacobian_into(&self, p: &[f64], d: &mut DMatrix<f64>) {
        self.write_jacobian(&self.piece(p), p, d);
    }

    fn n_switches(&self) -> usize {
        if self.effort.bounds.iter().any(|b| b.upper.is_finite()) { self.degrees() } else { 0 }
    }

    fn piece(&self, p: &[f64]) -> Piece {
        self.at(Some(&Piece::FREE), p, |work| self.piece_of(&work.free)).unwrap_or(Piece::FREE)
    }

    fn field_in(&self, piece: &Piece, p: &[f64], h: &mut [f64]) {
        self.write_field(Some(piece), p, h);
    }

    fn linearize_in(&self, piece: &Piece, p: &[f64], h: &mut [f64], d: &mut DMatrix<f64>) {
        self.write_field(Some(piece), p, h);
        self.write_jacobian(piece, p, d);
    }

    fn margins_into(&self, piece: &Piece, p: &[f64], margins: &mut [f64]) {
        let found = self.at(Some(piece), p, |Workspace { free, torque, .. }| {
            for (i, margin) in margins.iter_mut().enumerate() {
                let slope = self.effort.weights[i] * (torque[i] - free[i]);
                *margin = self.effort.bounds[i].margin(piece.side(i), torque[i], slope);
            }
        });
        if found.is_err() {
            margins.fill(f64::NAN);
        }
    }

    fn conserved(&self, p: &[f64]) -> Option<f64> {
        Some(self.hamiltonian(p))
    }

    fn fault(&self, p: &[f64]) -> Option<SystemError> {
        match self.at(None, p, |work| work.field.iter().all(|h| h.is_finite())) {
            Ok(finite) => (!finite).then_some(SystemError::NonFinite),
            Err(error) => Some(error.into()),
        }
    }
}

impl HamiltonianSystem for TreeMinimumTorque {
    fn hamiltonian(&self, p: &[f64]) -> f64 {
        let n = 2 * self.degrees();
        let found = self.at(None, p, |work| {
            let power: f64 = p[n..].iter().zip(&work.field).map(|(costate, rate)| costate * rate).sum();
            power + self.cost_of(&work.torque)
        });
        found.unwrap_or(f64::NAN)
    }
}

impl OptimalControlSystem for TreeMinimumTorque {
    fn n_controls(&self) -> usize {
        self.degrees()
    }

    fn control_into(&self, p: &[f64], u: &mut [f64]) -> Result<(), SystemError> {
        expect_controls(u, self.degrees())?;
        Ok(self.at(None, p, |work| u.copy_from_slice(&work.torque))?)
    }

    fn running_cost(&self, p: &[f64]) -> f64 {
        self.at(None, p, |work| self.cost_of(&work.torque)).unwrap_or(f64::NAN)
    }

    fn running_cost_in(&self, piece: &Piece, p: &[f64]) -> f64 {
        self.at(Some(piece), p, |work| self.cost_of(&work.torque)).unwrap_or(f64::NAN)
    }
}
