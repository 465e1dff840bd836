//! Minimum-torque motions of any tree, all degrees of freedom driven or some passive.
//!
//! x = (c, v) with as many coordinates c as velocities (those of joints that turn freely in `chart`), v̇ = a(c, v, u) by
//! forward dynamics, ℓ = ½ Σ γᵢuᵢ². The partials of `somersault-multibody` give
//! u* = −Γ⁻¹M⁻¹λ_v, cut off at the limits, and the field; the Jacobian is the same code over dual numbers, one pass for
//! each state, the other half following from its being Hamiltonian. M⁻¹ is diagonal in nothing, but K is a sum over the controls, so that each is cut off by itself.

use super::chart::{Charts, Scratch};
use super::piece::{Bounds, expect_limit};
use super::{
    HamiltonianSystem, OptimalControlSystem, Piece, Side, SystemError, VectorField, expect_controls,
};
use crate::cold_start::{Motion, Torque};
use nalgebra::{SMatrix, SVector};
use num_dual::Dual64;
use somersault_core::Scalar;
use somersault_core::argument::{ArgumentError, expect_positive};
use somersault_multibody::{DerivativeData, DynamicsError, Model};
use std::sync::{Mutex, PoisonError};

/// The state–costate system of a tree of n degrees of freedom, `N` = 4n.
///
/// Angles and lengths of joints are their own coordinates. A spherical joint has the vector of its rotation from the home
/// position, which must stay below a whole turn, a free one its place and that vector, a planar one place and angle; the
/// velocities of these are in the axes of the child, as everywhere in `somersault-multibody`.
#[derive(Debug)]
pub struct TreeMinimumTorque<const N: usize> {
    effort: Effort,
    values: Kernel<f64>,
    duals: Kernel<Dual64>,
}

impl Kernel<f64> {
    /// ∂v̇/∂λ_v = −M⁻¹Γ⁻¹M⁻ᵀ over the torques that move, into its place in D.
    fn by_costates<const N: usize>(
        &self,
        effort: &Effort,
        piece: &Piece<N>,
        p: &SVector<f64, N>,
        jacobian: &mut SMatrix<f64, N, N>,
    ) -> Result<(), DynamicsError> {
        let n = N / 4;
        self.with_workspace(|Workspace { data, torque, scratch }| {
            self.charts.place(&self.model, &p.as_slice()[..n], scratch)?;
            torque.fill(0.0);
            let v = &p.as_slice()[n..2 * n];
            let inverse =
                self.model.forward_dynamics_partials(data, &scratch.positions, v, torque, &[])?.input;
            let moves = |k: &usize| effort.driven[*k] && piece.sides[*k] == Side::Free;
            for k in (0..n).filter(moves) {
                for (i, j) in (0..n).flat_map(|i| (0..n).map(move |j| (i, j))) {
                    jacobian[(n + i, 3 * n + j)] -= inverse[(i, k)] * inverse[(j, k)] / effort.weights[k];
                }
            }
            Ok(())
        })
    }
}

impl<const N: usize> Clone for TreeMinimumTorque<N> {
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

/// Field, torque, and the torque that would be best without limits.
struct Values<T, const N: usize> {
    field: SVector<T, N>,
    torque: SVector<T, N>,
    free: SVector<T, N>,
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
    scratch: Scratch<T>,
}

impl<T: Scalar> Kernel<T> {
    fn new(model: Model<T>, charts: Charts) -> Self {
        Self { model, charts, pool: Mutex::new(Vec::new()) }
    }

    /// Torque and field at p in one piece, all of it over the scalar.
    fn evaluate<const N: usize>(
        &self,
        effort: &Effort,
        piece: &Piece<N>,
        p: &SVector<T, N>,
    ) -> Result<Values<T, N>, DynamicsError> {
        self.with_workspace(|work| self.evaluate_with(work, effort, piece, p))
    }

    fn with_workspace<R>(&self, run: impl FnOnce(&mut Workspace<T>) -> R) -> R {
        let pooled = self.pool.lock().unwrap_or_else(PoisonError::into_inner).pop();
        let mut work = pooled.unwrap_or_else(|| Workspace {
            data: DerivativeData::new(&self.model),
            torque: vec![T::zero(); self.model.n_velocities()],
            scratch: Scratch::new(&self.model),
        });
        let result = run(&mut work);
        self.pool.lock().unwrap_or_else(PoisonError::into_inner).push(work);
        result
    }

    fn evaluate_with<const N: usize>(
        &self,
        work: &mut Workspace<T>,
        effort: &Effort,
        piece: &Piece<N>,
        p: &SVector<T, N>,
    ) -> Result<Values<T, N>, DynamicsError> {
        let n = N / 4;
        let Workspace { data, torque, scratch } = work;
        let (c, v) = (&p.as_slice()[..n], &p.as_slice()[n..2 * n]);
        let (costate_q, costate_v) = (&p.as_slice()[2 * n..3 * n], &p.as_slice()[3 * n..]);
        self.charts.place(&self.model, c, scratch)?;
        let q = &scratch.positions;
        // M⁻¹ does not depend on the torque that it is needed for
        torque.fill(T::zero());
        let mut free = SVector::<T, N>::zeros();
        let inverse = self.model.forward_dynamics_partials(data, q, v, torque, &[])?.input;
        for i in (0..n).filter(|&i| effort.driven[i]) {
            let projected = (0..n).fold(T::zero(), |sum, j| sum + inverse[(j, i)] * costate_v[j]);
            free[i] = -projected / nalgebra::convert(effort.weights[i]);
        }
        let mut control = free;
        for i in 0..n {
            control[i] = match piece.sides[i] {
                Side::Free => free[i],
                side => nalgebra::convert(effort.bounds[i].control(side, 0.0)),
            };
        }
        torque.copy_from_slice(&control.as_slice()[..n]);
        let partials = self.model.forward_dynamics_partials(data, q, v, torque, &[])?;
        let mut field = SVector::<T, N>::zeros();
        let (rates, costate_rates) = field.as_mut_slice().split_at_mut(2 * n);
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
        Ok(Values { field, torque: control, free })
    }
}

impl<const N: usize> TreeMinimumTorque<N> {
    /// `weights` has one γ for each degree of freedom of `model`; `N` must be four times their number.
    pub fn try_new(model: &Model, weights: &[f64]) -> Result<Self, SystemError> {
        let n = model.n_velocities();
        if 4 * n != N {
            return Err(ArgumentError::Length { argument: "p", expected: 4 * n, found: N }.into());
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
        if limits.len() != N / 4 {
            return Err(
                ArgumentError::Length { argument: "limits", expected: N / 4, found: limits.len() }.into()
            );
        }
        self.effort.bounds = limits.iter().map(|&limit| expect_limit(limit)).collect::<Result<_, _>>()?;
        Ok(self)
    }

    /// Degree of freedom `joint` is passive: its torque is zero. One at least must be driven.
    pub fn try_with_passive(mut self, joint: usize) -> Result<Self, SystemError> {
        let others = self.effort.driven.iter().enumerate().any(|(i, driven)| *driven && i != joint);
        if joint >= N / 4 || !others {
            let (allowed, found) = ("the number of a joint, another one being driven", joint as f64);
            return Err(ArgumentError::OutOfRange { argument: "joint", allowed, found }.into());
        }
        self.effort.driven[joint] = false;
        Ok(self)
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

    /// The torques of a motion in angles and lengths, with their derivatives; NaN where there are none.
    pub(crate) fn inverse_dynamics<const Q: usize>(&self, motion: &Motion<Q>) -> Torque<Q> {
        let [q, v, a] = motion.each_ref().map(|x| x.as_slice());
        self.values.with_workspace(|work| {
            match self.values.model.inverse_dynamics_partials(&mut work.data, q, v, a, &[]) {
                Ok(found) => Torque {
                    u: SVector::from_column_slice(found.value),
                    by: [found.q, found.v, found.input].map(|m| SMatrix::from_column_slice(m.as_slice())),
                },
                Err(_) => Torque { u: SVector::repeat(f64::NAN), by: [SMatrix::repeat(f64::NAN); 3] },
            }
        })
    }

    fn values_in(&self, piece: &Piece<N>, p: &SVector<f64, N>) -> Result<Values<f64, N>, DynamicsError> {
        self.values.evaluate(&self.effort, piece, p)
    }

    /// With every torque within its limits.
    fn values_at(&self, p: &SVector<f64, N>) -> Result<Values<f64, N>, DynamicsError> {
        let free = self.values_in(&Piece::FREE, p)?;
        let piece = self.piece_of(&free.free);
        if piece == Piece::FREE { Ok(free) } else { self.values_in(&piece, p) }
    }

    fn piece_of(&self, free: &SVector<f64, N>) -> Piece<N> {
        let mut piece = Piece::FREE;
        self.effort.bounds.iter().enumerate().for_each(|(i, b)| piece.sides[i] = b.side(free[i]));
        piece
    }

    fn jacobian_in(&self, piece: &Piece<N>, p: &SVector<f64, N>) -> SMatrix<f64, N, N> {
        let n = N / 4;
        let mut jacobian = SMatrix::<f64, N, N>::zeros();
        for j in 0..2 * n {
            let mut seeded = p.map(Dual64::from_re);
            seeded[j].eps = 1.0;
            let Ok(values) = self.duals.evaluate(&self.effort, piece, &seeded) else {
                return SMatrix::repeat(f64::NAN);
            };
            jacobian.set_column(j, &values.field.map(|h| h.eps));
        }
        for (i, j) in (0..2 * n).flat_map(|i| (0..2 * n).map(move |j| (i, j))) {
            jacobian[(2 * n + i, 2 * n + j)] = -jacobian[(j, i)];
        }
        match self.values.by_costates(&self.effort, piece, p, &mut jacobian) {
            Ok(()) => jacobian,
            Err(_) => SMatrix::repeat(f64::NAN),
        }
    }

    fn cost_of(&self, torque: &SVector<f64, N>) -> f64 {
        0.5 * self.effort.weights.iter().zip(torque).map(|(w, u)| w * u * u).sum::<f64>()
    }
}

impl<const N: usize> VectorField<N> for TreeMinimumTorque<N> {
    fn field(&self, p: &SVector<f64, N>) -> SVector<f64, N> {
        self.values_at(p).map_or_else(|_| SVector::repeat(f64::NAN), |values| values.field)
    }

    fn jacobian(&self, p: &SVector<f64, N>) -> SMatrix<f64, N, N> {
        self.jacobian_in(&self.piece(p), p)
    }

    fn n_switches(&self) -> usize {
        if self.effort.bounds.iter().any(|b| b.upper.is_finite()) { N / 4 } else { 0 }
    }

    fn piece(&self, p: &SVector<f64, N>) -> Piece<N> {
        self.values_in(&Piece::FREE, p).map_or(Piece::FREE, |values| self.piece_of(&values.free))
    }

    fn field_in(&self, piece: &Piece<N>, p: &SVector<f64, N>) -> SVector<f64, N> {
        self.values_in(piece, p).map_or_else(|_| SVector::repeat(f64::NAN), |values| values.field)
    }

    fn linearize_in(&self, piece: &Piece<N>, p: &SVector<f64, N>) -> (SVector<f64, N>, SMatrix<f64, N, N>) {
        (self.field_in(piece, p), self.jacobian_in(piece, p))
    }

    fn margins(&self, piece: &Piece<N>, p: &SVector<f64, N>) -> SVector<f64, N> {
        let Ok(Values { free, torque, .. }) = self.values_in(piece, p) else {
            return SVector::repeat(f64::NAN);
        };
        let margin = |i: usize| {
            let slope = self.effort.weights[i] * (torque[i] - free[i]);
            self.effort.bounds[i].margin(piece.sides[i], torque[i], slope)
        };
        SVector::from_fn(|i, _| if i < N / 4 { margin(i) } else { f64::INFINITY })
    }

    fn conserved(&self, p: &SVector<f64, N>) -> Option<f64> {
        Some(self.hamiltonian(p))
    }

    fn fault(&self, p: &SVector<f64, N>) -> Option<SystemError> {
        match self.values_at(p) {
            Ok(Values { field, .. }) => {
                (!field.iter().all(|h| h.is_finite())).then_some(SystemError::NonFinite)
            }
            Err(error) => Some(error.into()),
        }
    }
}

impl<const N: usize> HamiltonianSystem<N> for TreeMinimumTorque<N> {
    fn hamiltonian(&self, p: &SVector<f64, N>) -> f64 {
        let work: f64 = {
            let field = self.field(p);
            (0..N / 2).map(|i| p[N / 2 + i] * field[i]).sum()
        };
        work + self.running_cost(p)
    }
}

impl<const N: usize> OptimalControlSystem<N> for TreeMinimumTorque<N> {
    fn n_controls(&self) -> usize {
        N / 4
    }

    fn control_into(&self, p: &SVector<f64, N>, u: &mut [f64]) -> Result<(), SystemError> {
        expect_controls(u, N / 4)?;
        u.copy_from_slice(&self.values_at(p)?.torque.as_slice()[..N / 4]);
        Ok(())
    }

    fn running_cost(&self, p: &SVector<f64, N>) -> f64 {
        self.values_at(p).map_or(f64::NAN, |values| self.cost_of(&values.torque))
    }

    fn running_cost_in(&self, piece: &Piece<N>, p: &SVector<f64, N>) -> f64 {
        self.values_in(piece, p).map_or(f64::NAN, |values| self.cost_of(&values.torque))
    }
}
