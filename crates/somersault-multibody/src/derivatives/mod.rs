//! Derivatives of inverse, forward and hybrid dynamics on the configuration manifold.
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
//! for both. Forward and hybrid dynamics follow by elimination, see [`Model::hybrid_dynamics_partials`].
//!
//! Derivatives with respect to q are along q ⊕ ε e_k; wrenches are held fixed in their bodies.
//!
//! Sources: Carpentier and Mansard, *Analytical derivatives of rigid body dynamics algorithms*, RSS 2018;
//! Singh, Russell and Wensing, *Efficient analytical derivatives of rigid-body dynamics using spatial
//! vector algebra*, IEEE RA-L 7 (2022). The compact 2B is this crate's.

pub(crate) mod elimination;
mod links;
mod momentum;
mod parameters;
mod second;
mod transposed;

pub(crate) use links::Varying;
pub use momentum::MomentumPartials;
pub use parameters::TreeParameter;
pub use second::SecondDerivativeData;
pub(crate) use transposed::Pulled;

use crate::data::{Data, TreeData};
use crate::error::DynamicsError;
use crate::inertia::SpatialInertia;
use crate::model::Model;
use crate::spatial::{Force, Motion};
use crate::triples::{
    cross, dot, hat_times, lifted, matrix_difference, matrix_lifted, matrix_sum, of_columns, sum, times,
    transposed, transposed_times,
};
use elimination::way;
use nalgebra::{DMatrix, Matrix3, Vector3};
use somersault_core::argument::expect_length;
use somersault_core::scalar::{Arithmetic, Lift, Scalar};
use std::ops::AddAssign;

/// A result of dynamics with its partial derivatives, each [`n_velocities`](Model::n_velocities) squared.
#[derive(Debug, Clone, Copy)]
pub struct Partials<'a, T: Scalar = f64> {
    /// The joint forces of inverse dynamics, the accelerations of forward dynamics, or of each degree of
    /// freedom what hybrid dynamics finds.
    pub value: &'a [T],
    /// With respect to q along q ⊕ ε e_k: one column for each k.
    pub q: &'a DMatrix<T>,
    /// With respect to v.
    pub v: &'a DMatrix<T>,
    /// With respect to what was given: M for the acceleration given to inverse dynamics, M⁻¹ for the joint
    /// forces given to forward dynamics.
    pub input: &'a DMatrix<T>,
}

/// Workspace of the derivatives, apart from [`Data`] because few need it.
#[derive(Debug, Clone)]
pub struct DerivativeData<T: Scalar = f64> {
    data: Data<T>,
    tables: DerivativeTables<T>,
    /// What `tables.inverse`, `center` and `momentum` are in independent coordinates; empty where no joint follows another.
    gathered: Tables<T>,
    gathered_center: DMatrix<T>,
    gathered_momentum: DMatrix<T>,
    torque: Vec<T>,
    acceleration: Vec<T>,
    input: DMatrix<T>,
    center: DMatrix<T>,
    momentum: DMatrix<T>,
}

/// What the partials of inverse and forward dynamics are computed in, beside [`TreeData`].
#[derive(Debug, Clone)]
pub(crate) struct DerivativeTables<T: Arithmetic> {
    bodies: Vec<Outward<T>>,
    columns: Vec<Column<T>>,
    pub(crate) inverse: Tables<T>,
    /// Of each degree of freedom those on one way to the root with it, itself among them.
    relatives: Vec<Vec<usize>>,
    /// The nearest passive degree of freedom on the way to the root.
    above: Vec<Option<usize>>,
    /// L by rows, LᵀL the passive part of M; a row holds the entries on the way to the root, from the diagonal.
    factor: DMatrix<T>,
    /// What a unit passive joint force does to the result.
    pub(crate) response: DMatrix<T>,
    pub(crate) forward: Tables<T>,
}

/// A result and its partials with respect to q and v.
#[derive(Debug, Clone)]
pub(crate) struct Tables<T: Arithmetic> {
    pub(crate) value: Vec<T>,
    pub(crate) q: DMatrix<T>,
    pub(crate) v: DMatrix<T>,
}

impl<T: Arithmetic> Tables<T> {
    fn of(zero: T, n: usize) -> Self {
        let square = DMatrix::from_element(n, n, zero);
        Self { value: vec![zero; n], q: square.clone(), v: square }
    }
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

impl<T: Arithmetic> Coriolis<T> {
    /// With A = ω̂ I and V = v̂ ĥ, C = A + Aᵀ − V − Vᵀ − n̂.
    #[inline(always)]
    fn new(inertia: &SpatialInertia<T>, velocity: &Motion<T>, momentum: &Force<T>) -> Self {
        let (v, h, n) = (&velocity.linear, &inertia.first_moment, &momentum.angular);
        let turned = hat_times(&velocity.angular, &inertia.rotational.full());
        // v̂ ĥ = h vᵀ − (v·h) 1
        let (x, y, z) = (h.x * v.x, h.y * v.y, h.z * v.z);
        let moved = of_columns([
            Vector3::new(-(y + z), h.y * v.x, h.z * v.x),
            Vector3::new(h.x * v.y, -(x + z), h.z * v.y),
            Vector3::new(h.x * v.z, h.y * v.z, -(x + y)),
        ]);
        let turned = matrix_sum(&turned, &transposed(&turned));
        let c = matrix_difference(&matrix_difference(&turned, &moved), &transposed(&moved));
        let angular = of_columns([
            Vector3::new(c.m11, c.m21 - n.z, c.m31 + n.y),
            Vector3::new(c.m12 + n.z, c.m22, c.m32 - n.x),
            Vector3::new(c.m13 - n.y, c.m23 + n.x, c.m33),
        ]);
        Self { momentum: momentum.linear, angular }
    }

    #[inline(always)]
    fn times(&self, x: &Motion<T>) -> Force<T> {
        let half = cross(&x.angular, &self.momentum);
        Force::new(sum(&half, &half), times(&self.angular, &x.angular))
    }

    /// The row xᵀ 2B, whose linear part is zero.
    #[inline(always)]
    fn transposed(&self, x: &Motion<T>) -> Vector3<T> {
        let half = cross(&self.momentum, &x.linear);
        sum(&sum(&half, &half), &transposed_times(&self.angular, &x.angular))
    }
}

impl<T: Arithmetic> AddAssign for Coriolis<T> {
    #[inline(always)]
    fn add_assign(&mut self, other: Self) {
        self.momentum = sum(&self.momentum, &other.momentum);
        self.angular = matrix_sum(&self.angular, &other.angular);
    }
}

impl<N: Arithmetic> DerivativeTables<N> {
    pub(crate) fn new<T: Scalar>(proof: <N as Lift<T>>::Proof, model: &Model<T>) -> Self
    where
        N: Lift<T>,
    {
        let (n, n_tree) = (model.n_velocities(), model.directions.len());
        let parents = model.elimination_parents();
        let mut relatives: Vec<Vec<usize>> = vec![Vec::new(); n];
        for k in 0..n {
            let mut ancestor = parents[k];
            while let Some(j) = ancestor {
                relatives[k].push(j);
                relatives[j].push(k);
                ancestor = parents[j];
            }
            relatives[k].push(k);
        }
        let zero = N::lift(proof, T::zero());
        let (motion, force) = (Motion::zero().lift(proof), Force::zero().lift(proof));
        let coriolis = Coriolis {
            momentum: lifted(proof, &Vector3::zeros()),
            angular: matrix_lifted(proof, &Matrix3::zeros()),
        };
        let body = Outward { velocity: motion, acceleration: motion, force, coriolis };
        let square = DMatrix::from_element(n, n, zero);
        Self {
            bodies: vec![body; model.n_bodies()],
            columns: vec![Column { first: motion, second: motion, rate: motion }; n_tree],
            inverse: Tables::of(zero, n_tree),
            relatives,
            above: vec![None; n],
            factor: square.clone(),
            response: square,
            forward: Tables::of(zero, n),
        }
    }
}

impl<T: Scalar> DerivativeData<T> {
    /// Fails unless this workspace has the sizes of `model`.
    pub(crate) fn expect_for(&self, model: &Model<T>) -> Result<(), DynamicsError> {
        self.data.expect_for(model)
    }

    /// A workspace for `model`.
    pub fn new(model: &Model<T>) -> Self {
        let (n, n_tree) = (model.n_velocities(), model.directions.len());
        let n_gathered = model.coupling.as_ref().map_or(0, |_| n);
        let vector = vec![T::zero(); n];
        Self {
            data: Data::new(model),
            tables: DerivativeTables::new((), model),
            gathered: Tables::of(T::zero(), n_gathered),
            gathered_center: DMatrix::zeros(3, n_gathered),
            gathered_momentum: DMatrix::zeros(6, n_gathered),
            torque: vector.clone(),
            acceleration: vector,
            input: DMatrix::zeros(n, n),
            center: DMatrix::zeros(3, n_tree),
            momentum: DMatrix::zeros(6, n_tree),
        }
    }
}

impl<T: Scalar> Model<T> {
    /// [`inverse_dynamics`](Self::inverse_dynamics) and its partials. Cost O(n × depth).
    pub fn inverse_dynamics_partials<'d>(
        &self,
        work: &'d mut DerivativeData<T>,
        q: &[T],
        v: &[T],
        a: &[T],
        wrenches: &[Force<T>],
    ) -> Result<Partials<'d, T>, DynamicsError> {
        self.expect_state(&work.data, q, v)?;
        expect_length("a", a.len(), self.n_velocities())?;
        self.expect_wrenches(wrenches)?;
        let DerivativeData { data: Data { tree, room, .. }, tables, gathered, .. } = work;
        self.place(tree, self.spread_positions(q, &mut room.q));
        let (v, a) = (self.spread(v, &mut room.v), self.spread(a, &mut room.a));
        self.differentiate(tree, tables, v, a, wrenches);
        Ok(Partials {
            value: self.gather(&tables.inverse.value, &mut gathered.value),
            q: self.gather_square(&tables.inverse.q, &mut gathered.q),
            v: self.gather_square(&tables.inverse.v, &mut gathered.v),
            input: self.gather_square(&tree.mass_matrix, &mut room.mass_matrix),
        })
    }

    /// The joint forces, their partials and the mass matrix in tree coordinates; poses must be up to date.
    ///
    /// Not inlined: where `v` may be spread or given, only the arguments of a function are known not to overlap.
    #[inline(never)]
    fn differentiate(
        &self,
        data: &mut TreeData<T>,
        tables: &mut DerivativeTables<T>,
        v: &[T],
        a: &[T],
        wrenches: &[Force<T>],
    ) {
        self.differentiate_in((), data, tables, v, a, wrenches);
    }

    /// The same in other arithmetic.
    #[inline(always)]
    pub(crate) fn differentiate_in<N: Lift<T>>(
        &self,
        proof: N::Proof,
        data: &mut TreeData<N>,
        tables: &mut DerivativeTables<N>,
        v: &[N],
        a: &[N],
        wrenches: &[Force<N>],
    ) {
        let DerivativeTables { bodies, columns, inverse, .. } = tables;
        self.sweep_outwards(proof, data, bodies, columns, v, a, wrenches);
        self.collect(proof, data, bodies, columns, inverse, v);
    }

    /// Outwards: velocities, accelerations, forces and columns in the common frame.
    #[inline(always)]
    fn sweep_outwards<N: Lift<T>>(
        &self,
        proof: N::Proof,
        data: &mut TreeData<N>,
        bodies: &mut [Outward<N>],
        columns: &mut [Column<N>],
        v: &[N],
        a: &[N],
        wrenches: &[Force<N>],
    ) {
        let rest = Motion::zero().lift(proof);
        let world = Motion::new(-self.gravity, Vector3::zeros()).lift(proof);
        for (i, body) in self.bodies.iter().enumerate() {
            let (outer_velocity, outer_acceleration) =
                body.parent.map_or((rest, world), |p| (bodies[p].velocity, bodies[p].acceleration));
            let (mut relative, mut pushed) = (rest, rest);
            for k in body.dofs.clone() {
                relative += data.columns[k] * v[k];
                pushed += data.columns[k] * a[k];
            }
            let velocity = outer_velocity + relative;
            let acceleration = outer_acceleration + pushed + velocity.cross(&relative);
            let node = &mut data.nodes[i];
            let inertia = body.inertia.seen_from_in(proof, &node.pose);
            node.composite = inertia;
            let momentum = inertia.times(&velocity);
            let mut force = inertia.times(&acceleration) + velocity.cross_force(&momentum);
            if let Some(wrench) = wrenches.get(i) {
                force -= node.pose.force(wrench);
            }
            let coriolis = Coriolis::new(&inertia, &velocity, &momentum);
            bodies[i] = Outward { velocity, acceleration, force, coriolis };
            for k in body.dofs.clone() {
                let column = &data.columns[k];
                let first = outer_velocity.cross(column);
                let second = outer_acceleration.cross(column) + outer_velocity.cross(&first);
                columns[k] = Column { first, second, rate: first + velocity.cross(column) };
            }
        }
    }

    /// Inwards: sums over subtrees, and all entries of a joint with its ancestors.
    #[inline(always)]
    fn collect<N: Lift<T>>(
        &self,
        proof: N::Proof,
        data: &mut TreeData<N>,
        bodies: &mut [Outward<N>],
        columns: &[Column<N>],
        tables: &mut Tables<N>,
        v: &[N],
    ) {
        let n = self.directions.len();
        let Tables { value, q: by_q, v: by_v } = tables;
        let (by_q, by_v) = (by_q.as_mut_slice(), by_v.as_mut_slice());
        let mass = data.mass_matrix.as_mut_slice();
        for (i, body) in self.bodies.iter().enumerate().rev() {
            let Outward { force, coriolis, .. } = bodies[i];
            let composite = data.nodes[i].composite;
            let further_in = body.dofs.clone().next().and_then(|k| self.dof_parent[k]);
            for k in body.dofs.clone() {
                let column = data.columns[k];
                let momentum = composite.times(&column);
                let Column { first, second, rate } = columns[k];
                let damping = N::lift(proof, self.damping[k]);
                value[k] = column.dot(&force) + damping * v[k];
                let row = coriolis.transposed(&column);
                for j in body.dofs.clone().chain(way(&self.dof_parent, further_in)) {
                    let other = &columns[j];
                    by_q[j * n + k] = dot(&row, &other.first.angular) + other.second.dot(&momentum);
                    by_v[j * n + k] = dot(&row, &data.columns[j].angular) + other.rate.dot(&momentum);
                    let entry = data.columns[j].dot(&momentum);
                    mass[j * n + k] = entry;
                    mass[k * n + j] = entry;
                }
                let change_q = coriolis.times(&first) + composite.times(&second) + column.cross_force(&force);
                let change_v = coriolis.times(&column) + composite.times(&rate);
                for j in way(&self.dof_parent, further_in) {
                    by_q[k * n + j] = data.columns[j].dot(&change_q);
                    by_v[k * n + j] = data.columns[j].dot(&change_v);
                }
                by_v[k * n + k] += damping;
            }
            if let Some(parent) = body.parent {
                bodies[parent].force += force;
                bodies[parent].coriolis += coriolis;
                data.nodes[parent].composite += composite;
            }
        }
    }
}
