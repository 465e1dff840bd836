//! Minimum-torque motions of any tree whose joints have one degree of freedom and are all driven.
//!
//! x = (q, v), q̇ = v, v̇ = a(q, v, u) by forward dynamics, ℓ = ½ Σ γᵢuᵢ². The partials of `somersault-multibody` give
//! u* = −Γ⁻¹M⁻¹λ_v and the field; the Jacobian is the same code over dual numbers, one pass for each entry of p.

use super::{
    HamiltonianSystem, OptimalControlSystem, SystemError, VectorField, expect_controls, expect_positive,
};
use nalgebra::{SMatrix, SVector};
use num_dual::Dual64;
use somersault_multibody::{DerivativeData, DynamicsError, Model, Scalar};
use std::sync::{Mutex, PoisonError};

/// The state–costate system of a tree of n joints, `N` = 4n.
#[derive(Debug)]
pub struct TreeMinimumTorque<const N: usize> {
    weights: Vec<f64>,
    values: Kernel<f64>,
    duals: Kernel<Dual64>,
}

/// A model with workspaces that threads take and give back.
#[derive(Debug)]
struct Kernel<T: Scalar> {
    model: Model<T>,
    pool: Mutex<Vec<Workspace<T>>>,
}

#[derive(Debug)]
struct Workspace<T: Scalar> {
    data: DerivativeData<T>,
    torque: Vec<T>,
}

impl<T: Scalar> Kernel<T> {
    fn new(model: Model<T>) -> Self {
        Self { model, pool: Mutex::new(Vec::new()) }
    }

    /// Writes the optimal torque and the field at p, all of it over the scalar.
    fn evaluate<const N: usize>(
        &self,
        weights: &[f64],
        p: &SVector<T, N>,
    ) -> Result<(SVector<T, N>, SVector<T, N>), DynamicsError> {
        let n = N / 4;
        let pooled = self.pool.lock().unwrap_or_else(PoisonError::into_inner).pop();
        let mut work = pooled.unwrap_or_else(|| Workspace {
            data: DerivativeData::new(&self.model),
            torque: vec![T::zero(); n],
        });
        let result = self.evaluate_with(&mut work, weights, p);
        self.pool.lock().unwrap_or_else(PoisonError::into_inner).push(work);
        result
    }

    fn evaluate_with<const N: usize>(
        &self,
        work: &mut Workspace<T>,
        weights: &[f64],
        p: &SVector<T, N>,
    ) -> Result<(SVector<T, N>, SVector<T, N>), DynamicsError> {
        let n = N / 4;
        let Workspace { data, torque } = work;
        let (q, v) = (&p.as_slice()[..n], &p.as_slice()[n..2 * n]);
        let (costate_q, costate_v) = (&p.as_slice()[2 * n..3 * n], &p.as_slice()[3 * n..]);
        // M⁻¹ does not depend on the torque that it is needed for
        torque.fill(T::zero());
        let mut control = SVector::<T, N>::zeros();
        let inverse = self.model.forward_dynamics_partials(data, q, v, torque, &[])?.input;
        for i in 0..n {
            let projected = (0..n).fold(T::zero(), |sum, j| sum + inverse[(j, i)] * costate_v[j]);
            control[i] = -projected / nalgebra::convert(weights[i]);
        }
        torque.copy_from_slice(&control.as_slice()[..n]);
        let partials = self.model.forward_dynamics_partials(data, q, v, torque, &[])?;
        let mut field = SVector::<T, N>::zeros();
        for i in 0..n {
            field[i] = v[i];
            field[n + i] = partials.value[i];
            field[3 * n + i] = -costate_q[i];
            for j in 0..n {
                field[2 * n + i] -= partials.q[(j, i)] * costate_v[j];
                field[3 * n + i] -= partials.v[(j, i)] * costate_v[j];
            }
        }
        Ok((field, control))
    }
}

impl<const N: usize> TreeMinimumTorque<N> {
    /// `weights` has one γ for each joint of `model`; `N` must be four times their number.
    pub fn try_new(model: &Model, weights: &[f64]) -> Result<Self, SystemError> {
        let n = model.n_velocities();
        if 4 * n != N {
            return Err(SystemError::Length { argument: "p", expected: 4 * n, found: N });
        }
        if weights.len() != n {
            return Err(SystemError::Length { argument: "weights", expected: n, found: weights.len() });
        }
        for i in 0..model.n_bodies() {
            if model.positions_of(i).len() != 1 || model.velocities_of(i).len() != 1 {
                return Err(SystemError::Joint { joint: model.name(i).unwrap_or_default().to_owned() });
            }
        }
        weights.iter().try_for_each(|&w| expect_positive("weights", w))?;
        Ok(Self {
            weights: weights.to_vec(),
            values: Kernel::new(model.clone()),
            duals: Kernel::new(model.cast()),
        })
    }
}

impl<const N: usize> VectorField<N> for TreeMinimumTorque<N> {
    fn field(&self, p: &SVector<f64, N>) -> SVector<f64, N> {
        self.values.evaluate(&self.weights, p).map_or_else(|_| SVector::repeat(f64::NAN), |(field, _)| field)
    }

    fn jacobian(&self, p: &SVector<f64, N>) -> SMatrix<f64, N, N> {
        let mut jacobian = SMatrix::<f64, N, N>::repeat(f64::NAN);
        for j in 0..N {
            let mut seeded = p.map(Dual64::from_re);
            seeded[j].eps = 1.0;
            if let Ok((field, _)) = self.duals.evaluate(&self.weights, &seeded) {
                jacobian.set_column(j, &field.map(|h| h.eps));
            }
        }
        jacobian
    }

    fn fault(&self, p: &SVector<f64, N>) -> Option<SystemError> {
        match self.values.evaluate(&self.weights, p) {
            Ok((field, _)) => (!field.iter().all(|h| h.is_finite())).then_some(SystemError::NonFinite),
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
        let (_, control) = self.values.evaluate(&self.weights, p)?;
        u.copy_from_slice(&control.as_slice()[..N / 4]);
        Ok(())
    }

    fn running_cost(&self, p: &SVector<f64, N>) -> f64 {
        let Ok((_, control)) = self.values.evaluate(&self.weights, p) else { return f64::NAN };
        0.5 * self.weights.iter().zip(&control).map(|(w, u)| w * u * u).sum::<f64>()
    }
}
