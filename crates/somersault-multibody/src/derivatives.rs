//! Derivatives of inverse and forward dynamics on the configuration manifold.
//!
//! With all vectors in one inertial frame, S_k the column of degree of freedom k of joint i, λ the parent
//! of i, and a containing −g,
//!
//! ψ̇_k = v_λ × S_k,  ψ̈_k = a_λ × S_k + v_λ × ψ̇_k,  Ṡ_k = v_i × S_k,
//!
//! a small motion of joint i along k changes the force on every body further out by
//! δf = S_k ×* f + I ψ̈_k + 2B ψ̇_k, and a change of its rate by δf = I (ψ̇_k + Ṡ_k) + 2B S_k, where
//! 2B x = v ×* I x − I (v × x) + x ×* I v. For a rigid body 2B has only the blocks −2 l̂ (linear from
//! angular, l the linear momentum) and C = ω̂ I − I ω̂ − v̂ ĥ − ĥ v̂ − n̂ (angular from angular): twelve
//! numbers that add up over a subtree. Summed over subtrees (superscript C), for j on the way from k to
//! the root:
//!
//! ∂τ_k/∂q_j = S_k·(2B^C_i ψ̇_j + I^C_i ψ̈_j),  ∂τ_j/∂q_k = S_j·(2B^C_i ψ̇_k + I^C_i ψ̈_k + S_k ×* f^C_i) for j
//! in another joint, and likewise with Ṡ + ψ̇ and S for the rates. Within a joint the first form holds
//! for both. Forward dynamics follows from M ∂a = −∂τ.
//!
//! Derivatives with respect to q are along q ⊕ ε e_k; wrenches are held fixed in their bodies.
//!
//! Sources: Carpentier and Mansard, *Analytical derivatives of rigid body dynamics algorithms*, RSS 2018;
//! Singh, Russell and Wensing, *Efficient analytical derivatives of rigid-body dynamics using spatial
//! vector algebra*, IEEE RA-L 7 (2022). The compact 2B is this crate's.

use crate::data::Data;
use crate::error::{DynamicsError, expect_length};
use crate::inertia::{SpatialInertia, hat};
use crate::model::Model;
use crate::scalar::Scalar;
use crate::spatial::{Force, Motion};
use nalgebra::{DMatrix, Matrix3, Vector3};
use std::ops::AddAssign;

/// Partial derivatives of joint forces or accelerations, each
/// [`n_velocities`](Model::n_velocities) squared.
#[derive(Debug, Clone, Copy)]
pub struct Partials<'a, T: Scalar = f64> {
    /// With respect to q along q ⊕ ε e_k: one column for each k.
    pub q: &'a DMatrix<T>,
    /// With respect to v.
    pub v: &'a DMatrix<T>,
    /// Of the joint forces with respect to the acceleration: M. Of the acceleration with respect to the
    /// joint forces: M⁻¹.
    pub input: &'a DMatrix<T>,
}

/// Workspace of the derivatives, apart from [`Data`] because few need it.
#[derive(Debug, Clone)]
pub struct DerivativeData<T: Scalar = f64> {
    bodies: Vec<Outward<T>>,
    columns: Vec<Column<T>>,
    q: DMatrix<T>,
    v: DMatrix<T>,
    inverse: DMatrix<T>,
}

/// State of a body in the common frame, then sums over its subtree.
#[derive(Debug, Clone, Copy)]
struct Outward<T> {
    velocity: Motion<T>,
    acceleration: Motion<T>,
    force: Force<T>,
    coriolis: Coriolis<T>,
}

/// 2B as its twelve numbers.
#[derive(Debug, Clone, Copy)]
struct Coriolis<T> {
    momentum: Vector3<T>,
    angular: Matrix3<T>,
}

/// ψ̇, ψ̈ and ψ̇ + Ṡ of one degree of freedom.
#[derive(Debug, Clone, Copy)]
struct Column<T> {
    first: Motion<T>,
    second: Motion<T>,
    rate: Motion<T>,
}

impl<T: Scalar> Coriolis<T> {
    fn new(inertia: &SpatialInertia<T>, velocity: &Motion<T>, momentum: &Force<T>) -> Self {
        let (omega, h) = (hat(&velocity.angular), hat(&inertia.first_moment));
        let v = hat(&velocity.linear);
        let rotational = inertia.rotational();
        let angular = omega * rotational - rotational * omega - v * h - h * v - hat(&momentum.angular);
        Self { momentum: momentum.linear, angular }
    }

    #[inline(always)]
    fn times(&self, x: &Motion<T>) -> Force<T> {
        let half = x.angular.cross(&self.momentum);
        Force::new(half + half, self.angular * x.angular)
    }

    /// The row xᵀ 2B, whose linear part is zero.
    #[inline(always)]
    fn transposed(&self, x: &Motion<T>) -> Vector3<T> {
        let half = self.momentum.cross(&x.linear);
        half + half + self.angular.tr_mul(&x.angular)
    }
}

impl<T: Scalar> AddAssign for Coriolis<T> {
    fn add_assign(&mut self, other: Self) {
        self.momentum += other.momentum;
        self.angular += other.angular;
    }
}

impl<T: Scalar> DerivativeData<T> {
    /// A workspace for `model`.
    pub fn new(model: &Model<T>) -> Self {
        let n = model.n_velocities();
        let (motion, force) = (Motion::zero(), Force::zero());
        let coriolis = Coriolis { momentum: Vector3::zeros(), angular: Matrix3::zeros() };
        let body = Outward { velocity: motion, acceleration: motion, force, coriolis };
        Self {
            bodies: vec![body; model.n_bodies()],
            columns: vec![Column { first: motion, second: motion, rate: motion }; n],
            q: DMatrix::zeros(n, n),
            v: DMatrix::zeros(n, n),
            inverse: DMatrix::zeros(n, n),
        }
    }
}

impl<T: Scalar> Model<T> {
    /// Partials of [`inverse_dynamics`](Self::inverse_dynamics). Cost O(n × depth).
    pub fn inverse_dynamics_partials<'d>(
        &self,
        data: &'d mut Data<T>,
        work: &'d mut DerivativeData<T>,
        q: &[T],
        v: &[T],
        a: &[T],
        wrenches: &[Force<T>],
    ) -> Result<Partials<'d, T>, DynamicsError> {
        self.expect_state(data, q, v)?;
        expect_length("a", a, self.n_velocities())?;
        self.expect_wrenches(wrenches)?;
        if work.bodies.len() != self.n_bodies() || work.columns.len() != self.n_velocities() {
            return Err(DynamicsError::ForeignData);
        }
        self.place(data, q);
        self.gather_composites(data);
        self.spread(data, work, v, a, wrenches);
        self.collect(data, work);
        Ok(Partials { q: &work.q, v: &work.v, input: &data.mass_matrix })
    }

    /// Partials of [`forward_dynamics`](Self::forward_dynamics): −M⁻¹ ∂τ/∂q, −M⁻¹ ∂τ/∂v and M⁻¹ at the
    /// acceleration under `torque`. Cost O(n³), of which the factorisation of M and its inverse.
    pub fn forward_dynamics_partials<'d>(
        &self,
        data: &'d mut Data<T>,
        work: &'d mut DerivativeData<T>,
        q: &[T],
        v: &[T],
        torque: &[T],
        wrenches: &[Force<T>],
    ) -> Result<Partials<'d, T>, DynamicsError> {
        self.forward_dynamics(data, q, v, torque, wrenches)?;
        let a = std::mem::take(&mut data.acceleration);
        let partials = self.inverse_dynamics_partials(data, work, q, v, &a, wrenches).map(|_| ());
        data.acceleration = a;
        partials?;
        self.factorize(&mut data.mass_matrix)?;
        work.inverse.fill_with_identity();
        for right in [&mut work.q, &mut work.v] {
            self.solve(&data.mass_matrix, right);
            right.neg_mut();
        }
        self.solve(&data.mass_matrix, &mut work.inverse);
        Ok(Partials { q: &work.q, v: &work.v, input: &work.inverse })
    }

    /// Outwards: velocities, accelerations, forces and columns in the common frame.
    fn spread(&self, data: &Data<T>, work: &mut DerivativeData<T>, v: &[T], a: &[T], wrenches: &[Force<T>]) {
        let world = Motion::new(-self.gravity, Vector3::zeros());
        for (i, body) in self.bodies.iter().enumerate() {
            let (outer_velocity, outer_acceleration) = body
                .parent
                .map_or((Motion::zero(), world), |p| (work.bodies[p].velocity, work.bodies[p].acceleration));
            let (mut relative, mut pushed) = (Motion::zero(), Motion::zero());
            for k in body.dofs.clone() {
                relative += data.columns[k] * v[k];
                pushed += data.columns[k] * a[k];
            }
            let velocity = outer_velocity + relative;
            let acceleration = outer_acceleration + pushed + velocity.cross(&relative);
            let pose = &data.nodes[i].pose;
            let inertia = body.inertia.seen_from(pose);
            let momentum = inertia.times(&velocity);
            let mut force = inertia.times(&acceleration) + velocity.cross_force(&momentum);
            if let Some(wrench) = wrenches.get(i) {
                force -= pose.force(wrench);
            }
            let coriolis = Coriolis::new(&inertia, &velocity, &momentum);
            work.bodies[i] = Outward { velocity, acceleration, force, coriolis };
            for k in body.dofs.clone() {
                let column = &data.columns[k];
                let first = outer_velocity.cross(column);
                let second = outer_acceleration.cross(column) + outer_velocity.cross(&first);
                work.columns[k] = Column { first, second, rate: first + velocity.cross(column) };
            }
        }
    }

    /// Inwards: sums over subtrees, and all entries of a joint with its ancestors.
    fn collect(&self, data: &mut Data<T>, work: &mut DerivativeData<T>) {
        for (i, body) in self.bodies.iter().enumerate().rev() {
            let Outward { force, coriolis, .. } = work.bodies[i];
            let composite = data.nodes[i].composite;
            let further_in = body.dofs.clone().next().and_then(|k| self.dof_parent[k]);
            for k in body.dofs.clone() {
                let (column, momentum) = (data.columns[k], data.momenta[k]);
                let Column { first, second, rate } = work.columns[k];
                let row = coriolis.transposed(&column);
                let mut ancestor = further_in;
                let mut own = body.dofs.clone();
                while let Some(j) = own.next().or(ancestor) {
                    if j < body.dofs.start {
                        ancestor = self.dof_parent[j];
                    }
                    let other = &work.columns[j];
                    work.q[(k, j)] = row.dot(&other.first.angular) + other.second.dot(&momentum);
                    work.v[(k, j)] = row.dot(&data.columns[j].angular) + other.rate.dot(&momentum);
                    let entry = data.columns[j].dot(&momentum);
                    data.mass_matrix[(k, j)] = entry;
                    data.mass_matrix[(j, k)] = entry;
                }
                let by_q = coriolis.times(&first) + composite.times(&second) + column.cross_force(&force);
                let by_v = coriolis.times(&column) + composite.times(&rate);
                let mut ancestor = further_in;
                while let Some(j) = ancestor {
                    work.q[(j, k)] = data.columns[j].dot(&by_q);
                    work.v[(j, k)] = data.columns[j].dot(&by_v);
                    ancestor = self.dof_parent[j];
                }
                work.v[(k, k)] += self.damping[k];
            }
            if let Some(parent) = body.parent {
                work.bodies[parent].force += force;
                work.bodies[parent].coriolis += coriolis;
            }
        }
    }

    /// M = LᵀL in place in the lower triangle, with the zeros of M kept (Featherstone 2008, table 6.3).
    fn factorize(&self, m: &mut DMatrix<T>) -> Result<(), DynamicsError> {
        for k in (0..self.n_velocities()).rev() {
            let square = m[(k, k)];
            if !(square > T::zero() && square.is_finite()) {
                let joint = self.bodies.iter().position(|b| b.dofs.contains(&k));
                let joint = joint.and_then(|i| self.name(i)).unwrap_or_default().to_owned();
                return Err(DynamicsError::Singular { joint });
            }
            let pivot = square.sqrt();
            m[(k, k)] = pivot;
            let mut i = self.dof_parent[k];
            while let Some(at) = i {
                m[(k, at)] /= pivot;
                i = self.dof_parent[at];
            }
            let mut i = self.dof_parent[k];
            while let Some(at) = i {
                let factor = m[(k, at)];
                let mut j = i;
                while let Some(to) = j {
                    let product = factor * m[(k, to)];
                    m[(at, to)] -= product;
                    j = self.dof_parent[to];
                }
                i = self.dof_parent[at];
            }
        }
        Ok(())
    }

    /// x ← (LᵀL)⁻¹ x for every column.
    fn solve(&self, factor: &DMatrix<T>, x: &mut DMatrix<T>) {
        let n = self.n_velocities();
        for mut column in x.column_iter_mut() {
            for k in (0..n).rev() {
                column[k] /= factor[(k, k)];
                let value = column[k];
                let mut i = self.dof_parent[k];
                while let Some(at) = i {
                    column[at] -= factor[(k, at)] * value;
                    i = self.dof_parent[at];
                }
            }
            for k in 0..n {
                let mut value = column[k];
                let mut i = self.dof_parent[k];
                while let Some(at) = i {
                    value -= factor[(k, at)] * column[at];
                    i = self.dof_parent[at];
                }
                column[k] = value / factor[(k, k)];
            }
        }
    }
}
