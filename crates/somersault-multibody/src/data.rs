//! Workspace of the algorithms.

use crate::error::DynamicsError;
use crate::inertia::{ArticulatedInertia, SpatialInertia};
use crate::model::Model;
use crate::spatial::{Force, Motion, Transform};
use nalgebra::{DMatrix, Vector3};
use somersault_core::scalar::{Arithmetic, Lift, Scalar};

/// Room for intermediate results and results, made once for a model and used repeatedly.
///
/// Nothing in it carries over from one call to the next: every algorithm computes all that it needs,
/// and its results are reached through what it returns. After construction nothing allocates.
#[derive(Debug, Clone)]
pub struct Data<T: Scalar = f64> {
    n_positions: usize,
    /// Those of the degrees of freedom in the tree, and in the elimination of M where joints follow others.
    parents: [Vec<Option<usize>>; 2],
    pub(crate) tree: TreeData<T>,
    pub(crate) room: Room<T>,
}

/// What the kernels write, in tree coordinates.
#[derive(Debug, Clone)]
pub(crate) struct TreeData<T: Arithmetic> {
    pub(crate) nodes: Vec<Node<T>>,
    /// Position of the root in the world, the origin of the common frame.
    pub(crate) origin: Vector3<T>,
    /// Motion subspaces in the common frame.
    pub(crate) columns: Vec<Motion<T>>,
    /// Per degree of freedom, inertia times motion subspace.
    pub(crate) momenta: Vec<Force<T>>,
    pub(crate) pivots: Vec<Pivot<T>>,
    pub(crate) torque: Vec<T>,
    pub(crate) acceleration: Vec<T>,
    pub(crate) zeros: Vec<T>,
    pub(crate) mass_matrix: DMatrix<T>,
    pub(crate) momentum_matrix: DMatrix<T>,
}

/// One body. Quantities are in body axes at the body's origin unless they say otherwise.
#[derive(Debug, Clone)]
pub(crate) struct Node<T> {
    /// Pose in the parent.
    pub(crate) local: Transform<T>,
    /// Pose in the common frame: axes of the world, origin at the root.
    pub(crate) pose: Transform<T>,
    pub(crate) velocity: Motion<T>,
    pub(crate) acceleration: Motion<T>,
    pub(crate) force: Force<T>,
    pub(crate) articulated: ArticulatedInertia<T>,
    /// Of the body and all further out, common frame.
    pub(crate) composite: SpatialInertia<T>,
}

impl<N> Node<N> {
    /// What is there before anything is computed.
    pub(crate) fn at_rest<T: Scalar>(proof: <N as Lift<T>>::Proof) -> Self
    where
        N: Lift<T>,
    {
        let (motion, force, inertia) = (Motion::zero(), Force::zero(), SpatialInertia::zero());
        let frame = Transform::identity();
        Self {
            local: frame.lift(proof),
            pose: frame.lift(proof),
            velocity: motion.lift(proof),
            acceleration: motion.lift(proof),
            force: force.lift(proof),
            articulated: ArticulatedInertia::rigid(&inertia).lift(proof),
            composite: inertia.lift(proof),
        }
    }
}

impl<N: Arithmetic> TreeData<N> {
    pub(crate) fn new<T: Scalar>(proof: <N as Lift<T>>::Proof, model: &Model<T>) -> Self
    where
        N: Lift<T>,
    {
        let n = model.directions.len();
        let zero = N::lift(proof, T::zero());
        let (motion, force) = (Motion::<T>::zero().lift(proof), Force::<T>::zero().lift(proof));
        Self {
            nodes: vec![Node::at_rest::<T>(proof); model.n_bodies()],
            origin: motion.linear,
            columns: vec![motion; n],
            momenta: vec![force; n],
            pivots: vec![Pivot { inverse: zero, residual: zero }; n],
            torque: vec![zero; n],
            acceleration: vec![zero; n],
            zeros: vec![zero; n],
            mass_matrix: DMatrix::from_element(n, n, zero),
            momentum_matrix: DMatrix::from_element(6, n, zero),
        }
    }
}

/// What the elimination of one degree of freedom leaves behind.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Pivot<T> {
    /// 1/(Sᵀ I_A S).
    pub(crate) inverse: T,
    /// Joint force that is left for this degree of freedom.
    pub(crate) residual: T,
}

impl<T: Scalar> Data<T> {
    /// A workspace for `model`.
    pub fn new(model: &Model<T>) -> Self {
        let tree = TreeData::new((), model);
        let parents = [&model.dof_parent[..], model.coupled_parents()].map(<[_]>::to_vec);
        Self { n_positions: model.n_positions(), parents, tree, room: Room::new(model) }
    }

    /// Fails unless this workspace has the sizes of `model` and its degrees of freedom are on the same ways to the root: entries of
    /// matrices between others stay zero.
    #[inline(always)]
    pub(crate) fn expect_for(&self, model: &Model<T>) -> Result<(), DynamicsError> {
        let [of_tree, coupled] = &self.parents;
        if self.tree.nodes.len() == model.n_bodies()
            && *of_tree == model.dof_parent
            && coupled == model.coupled_parents()
            && self.room.v.len() == model.coupling.as_ref().map_or(0, |_| model.directions.len())
            && self.n_positions == model.n_positions()
        {
            Ok(())
        } else {
            Err(DynamicsError::ForeignData)
        }
    }
}

/// Room for what is spread to tree coordinates and gathered from them; empty for a model without followers.
#[derive(Debug, Clone)]
pub(crate) struct Room<T: Scalar> {
    pub(crate) q: Vec<T>,
    pub(crate) v: Vec<T>,
    pub(crate) a: Vec<T>,
    pub(crate) torque: Vec<T>,
    pub(crate) mass_matrix: DMatrix<T>,
    pub(crate) momentum_matrix: DMatrix<T>,
    pub(crate) acceleration: Vec<T>,
    /// Joint forces that are left for the passive degrees of freedom.
    pub(crate) residual: Vec<T>,
    pub(crate) above: Vec<Option<usize>>,
    pub(crate) factor: DMatrix<T>,
}

impl<T: Scalar> Room<T> {
    pub(crate) fn new(model: &Model<T>) -> Self {
        let (n, n_q, n_tree) = match &model.coupling {
            None => (0, 0, 0),
            Some(coupling) => (coupling.parents.len(), coupling.positions.len(), coupling.velocities.len()),
        };
        let (vector, tree) = (vec![T::zero(); n], vec![T::zero(); n_tree]);
        Self {
            q: vec![T::zero(); n_q],
            v: tree.clone(),
            a: tree,
            torque: vector.clone(),
            mass_matrix: DMatrix::zeros(n, n),
            momentum_matrix: DMatrix::zeros(6, n),
            acceleration: vector.clone(),
            residual: vector,
            above: vec![None; n],
            factor: DMatrix::zeros(n, n),
        }
    }
}
