//! The kernels of a flight, in any arithmetic, and what they write.

use super::Flight;
use crate::inertia::SpatialInertia;
use crate::model::Model;
use crate::spatial::{Force, Motion, Transform};
use crate::triples::{
    cross, difference, hat_times, lifted, matrix_lifted, negative, product, scaled, times, transposed,
    transposed_times,
};
use nalgebra::{Matrix3, Vector3};
use somersault_core::lie::so3::matrix_of_xyzw;
use somersault_core::scalar::{Arithmetic, Lift, Scalar, constant};

/// What is written for one shape, or for those in all lanes.
#[derive(Debug, Clone)]
pub(super) struct FlightTree<N> {
    pub(super) nodes: Vec<Node<N>>,
    /// Of the shape set last.
    pub(super) shape: Shape<N>,
    /// The axis of each degree of freedom after the root's, in axes of the root.
    columns: Vec<Motion<N>>,
    /// In tree coordinates.
    pub(super) by_shape: Vec<Vector3<N>>,
    by_shape_velocity: Vec<Vector3<N>>,
    /// In independent ones, where joints follow others.
    gathered: [Vec<Vector3<N>>; 2],
    /// Positions and velocities of the tree, where joints follow others.
    spread: [Vec<N>; 2],
}

/// One body, in the axes of the root about its origin, the root at rest.
#[derive(Debug, Clone, Copy)]
pub(super) struct Node<N> {
    pose: Transform<N>,
    velocity: Motion<N>,
    /// Of the body and all further out.
    inertia: SpatialInertia<N>,
    /// Of the body and all further out.
    momentum: Force<N>,
}

/// What a shape and its velocities are without the orientation of the root, in its axes.
#[derive(Debug, Clone, Copy)]
pub(super) struct Shape<N> {
    /// Centre of mass from the origin of the root.
    pub(super) center: Vector3<N>,
    /// I⁻¹; of the normal component alone where the root is planar.
    pub(super) inverse_inertia: Matrix3<N>,
    /// A ṡ, about the centre of mass.
    pub(super) angular: Vector3<N>,
    /// The velocity that the joints give the centre of mass, the root at rest.
    pub(super) linear: Vector3<N>,
}

/// The motion of the root that the momentum leaves, seen from the centre of mass, in axes of the root.
pub(super) struct Reduced<N> {
    /// Orientation of the root, its axes → world.
    pub(super) turn: Matrix3<N>,
    /// Rᵀ L.
    momentum: Vector3<N>,
    /// Of the root.
    pub(super) velocity: Motion<N>,
}

impl<N: Arithmetic> FlightTree<N> {
    pub(super) fn new<T: Scalar>(proof: <N as Lift<T>>::Proof, model: &Model<T>) -> Self
    where
        N: Lift<T>,
    {
        let zero = N::lift(proof, T::zero());
        let (motion, force) = (Motion::<T>::zero().lift(proof), Force::<T>::zero().lift(proof));
        let vector: Vector3<N> = motion.linear;
        let node = Node {
            pose: Transform::<T>::identity().lift(proof),
            velocity: motion,
            inertia: SpatialInertia::<T>::zero().lift(proof),
            momentum: force,
        };
        let n_root = model.velocities_of(0).len();
        let n_shape = model.directions.len() - n_root;
        let (n_gathered, n_spread) = model.coupling.as_ref().map_or((0, [0, 0]), |coupling| {
            (model.n_velocities() - n_root, [coupling.positions.len(), coupling.velocities.len()])
        });
        let (vectors, gathered) = (vec![vector; n_shape], vec![vector; n_gathered]);
        Self {
            nodes: vec![node; model.n_bodies()],
            shape: Shape {
                center: vector,
                inverse_inertia: Matrix3::from_element(zero),
                angular: vector,
                linear: vector,
            },
            columns: vec![motion; n_shape],
            by_shape: vectors.clone(),
            by_shape_velocity: vectors,
            gathered: [gathered.clone(), gathered],
            spread: n_spread.map(|n| vec![zero; n]),
        }
    }

    /// Whether it has the sizes of `model`.
    pub(super) fn is_for<T: Scalar>(&self, model: &Model<T>) -> bool {
        let n_spread = model.coupling.as_ref().map_or(0, |coupling| coupling.positions.len());
        self.nodes.len() == model.n_bodies()
            && self.by_shape.len() + model.velocities_of(0).len() == model.directions.len()
            && self.spread[0].len() == n_spread
    }
}

impl<N: Arithmetic> Shape<N> {
    /// What the angular velocity of the root makes up for.
    #[inline(always)]
    fn answer(&self, change: &Force<N>) -> Vector3<N> {
        times(&self.inverse_inertia, &negative(&change.about(&self.center).angular))
    }

    /// ∂ω/∂θ = I⁻¹ (RᵀL)^.
    #[inline(always)]
    pub(super) fn by_orientation(&self, reduced: &Reduced<N>) -> Matrix3<N> {
        transposed(&hat_times(&negative(&reduced.momentum), &self.inverse_inertia))
    }

    /// ∂ω/∂L = I⁻¹ Rᵀ.
    #[inline(always)]
    pub(super) fn by_angular_momentum(&self, reduced: &Reduced<N>) -> Matrix3<N> {
        product(&self.inverse_inertia, &transposed(&reduced.turn))
    }
}

impl<T: Scalar> Flight<'_, T> {
    /// Poses, velocities and, gathered inwards, inertias and momenta; nothing where the tree has no inertia about some axis.
    #[inline(always)]
    pub(super) fn set_shape_in<N: Lift<T>>(
        &self,
        proof: N::Proof,
        tree: &mut FlightTree<N>,
        q: &[N],
        v: &[N],
    ) -> Option<()> {
        let FlightTree { nodes, shape, spread: [q_room, v_room], .. } = tree;
        let (q, v) =
            (self.model.spread_positions_in(proof, q, q_room), self.model.spread_in(proof, v, v_room));
        let bodies = &self.model.bodies;
        nodes[0] = Node {
            pose: Transform::identity().lift(proof),
            velocity: Motion::zero().lift(proof),
            inertia: bodies[0].inertia.lift(proof),
            momentum: Force::zero().lift(proof),
        };
        for (i, body) in bodies.iter().enumerate() {
            let Some(parent) = body.parent else { continue };
            let pose = nodes[parent].pose.compose(&body.mechanism.transform_in(proof, &q[body.q..]));
            let velocity = nodes[parent].velocity + pose.motion(&self.model.relative_in(proof, body, v));
            let inertia = body.inertia.seen_from_in(proof, &pose);
            nodes[i] = Node { pose, velocity, inertia, momentum: inertia.times(&velocity) };
        }
        for (i, body) in bodies.iter().enumerate().rev() {
            if let Some(parent) = body.parent {
                let Node { inertia, momentum, .. } = nodes[i];
                nodes[parent].inertia += inertia;
                nodes[parent].momentum += momentum;
            }
        }
        let Node { inertia, momentum, .. } = &nodes[0];
        let numbers @ [_, one] = [N::lift(proof, T::zero()), N::lift(proof, T::one())];
        let (center, about_center) = inertia.about_center(one);
        let inverse = if self.is_planar {
            about_center.inverse_of_normal(numbers)?
        } else {
            about_center.inverse(numbers)?
        };
        // beyond a condition of 1/ε the inverse is rounding, or not finite
        let squared = N::lift(proof, constant(f64::EPSILON * f64::EPSILON));
        if !one.exceeds(inverse.norm_squared() * squared * about_center.norm_squared()) {
            return None;
        }
        *shape = Shape {
            inverse_inertia: inverse.full(),
            angular: momentum.about(&center).angular,
            linear: scaled(&momentum.linear, one / inertia.mass),
            center,
        };
        Some(())
    }

    /// What the derivatives by the shape that was set last have in common for all orientations.
    #[inline(always)]
    pub(super) fn set_directions_in<N: Lift<T>>(&self, proof: N::Proof, tree: &mut FlightTree<N>) {
        let FlightTree { nodes, shape, columns, by_shape_velocity, .. } = tree;
        for (node, body) in nodes.iter().zip(&self.model.bodies) {
            if body.parent.is_none() {
                continue;
            }
            for k in body.dofs.clone() {
                let column = self.model.directions[k].seen_from(proof, &node.pose);
                by_shape_velocity[k - self.n_root()] = shape.answer(&node.inertia.times(&column));
                columns[k - self.n_root()] = column;
            }
        }
    }

    /// The motion of the root at an `orientation`, an angle or a quaternion.
    #[inline(always)]
    pub(super) fn reduce_in<N: Lift<T>>(
        &self,
        proof: N::Proof,
        shape: &Shape<N>,
        orientation: &[N],
    ) -> Reduced<N> {
        let own = if self.is_planar {
            let (s, c) = orientation[0].sine_and_cosine();
            let (o, i) = (N::lift(proof, T::zero()), N::lift(proof, T::one()));
            Matrix3::new(c, -s, o, s, c, o, o, o, i)
        } else {
            matrix_of_xyzw(orientation)
        };
        let turn = product(&matrix_lifted(proof, &self.placement.rotation), &own);
        let momentum = transposed_times(&turn, &lifted(proof, &self.take_off.angular_momentum));
        let angular = times(&shape.inverse_inertia, &difference(&momentum, &shape.angular));
        let linear = difference(&cross(&shape.center, &angular), &shape.linear);
        Reduced { turn, momentum, velocity: Motion::new(linear, angular) }
    }

    /// ∂ω/∂s, and ∂ω/∂ṡ as the directions have it, for independent degrees of freedom.
    #[inline(always)]
    pub(super) fn derive_in<'d, N: Lift<T>>(
        &self,
        proof: N::Proof,
        tree: &'d mut FlightTree<N>,
        reduced: &Reduced<N>,
    ) -> [&'d [Vector3<N>]; 2] {
        let FlightTree { nodes, shape, columns, by_shape, by_shape_velocity, gathered, .. } = tree;
        for (node, body) in nodes.iter().zip(&self.model.bodies) {
            let Some(parent) = body.parent else { continue };
            let outer = reduced.velocity + nodes[parent].velocity;
            let carried = node.momentum + node.inertia.times(&reduced.velocity);
            for k in body.dofs.clone() {
                let column = &columns[k - self.n_root()];
                let change = column.cross_force(&carried) - node.inertia.times(&column.cross(&outer));
                by_shape[k - self.n_root()] = shape.answer(&change);
            }
        }
        let [of_shape, of_velocity] = gathered;
        let from = self.n_root();
        [
            self.model.gather_vectors_in(proof, from, by_shape, of_shape),
            self.model.gather_vectors_in(proof, from, by_shape_velocity, of_velocity),
        ]
    }
}
