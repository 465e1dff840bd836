//! Forward kinematics: poses, velocities, accelerations and frame Jacobians.
//!
//! Poses are computed in the common frame, whose axes are those of the world and whose origin is that of
//! the root body; far from the world's origin nothing is lost by cancellation.

use crate::data::{Data, TreeData};
use crate::error::DynamicsError;
use crate::model::Model;
use crate::spatial::{Motion, Transform};
use crate::triples::lifted;
use nalgebra::{DMatrix, Matrix3, Vector3};
use somersault_core::argument::{ArgumentError, expect_length};
use somersault_core::scalar::{Lift, Scalar, constant};

/// The axes in which the velocity of a frame's origin is written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Axes {
    /// Those of the frame.
    Frame,
    /// Those of the world.
    World,
}

/// Poses of all bodies at one configuration.
#[derive(Debug, Clone, Copy)]
pub struct Positions<'a, T: Scalar = f64> {
    model: &'a Model<T>,
    data: &'a TreeData<T>,
}

/// Velocities of all bodies in one state.
#[derive(Debug, Clone, Copy)]
pub struct Velocities<'a, T: Scalar = f64> {
    model: &'a Model<T>,
    data: &'a TreeData<T>,
}

/// Accelerations of all bodies.
#[derive(Debug, Clone, Copy)]
pub struct Accelerations<'a, T: Scalar = f64> {
    model: &'a Model<T>,
    data: &'a TreeData<T>,
}

impl<T: Scalar> Model<T> {
    /// Poses of all bodies. Cost O(n).
    pub fn positions<'a>(
        &'a self,
        data: &'a mut Data<T>,
        q: &[T],
    ) -> Result<Positions<'a, T>, DynamicsError> {
        data.expect_for(self)?;
        expect_length("q", q.len(), self.n_positions())?;
        let Data { tree, room, .. } = data;
        self.place(tree, self.spread_positions(q, &mut room.q));
        Ok(Positions { model: self, data: tree })
    }

    /// Poses and velocities of all bodies. Cost O(n).
    pub fn velocities<'a>(
        &'a self,
        data: &'a mut Data<T>,
        q: &[T],
        v: &[T],
    ) -> Result<Velocities<'a, T>, DynamicsError> {
        self.expect_state(data, q, v)?;
        let Data { tree, room, .. } = data;
        self.place(tree, self.spread_positions(q, &mut room.q));
        self.move_bodies(tree, self.spread(v, &mut room.v));
        Ok(Velocities { model: self, data: tree })
    }

    /// Poses, velocities and accelerations of all bodies. Cost O(n).
    pub fn accelerations<'a>(
        &'a self,
        data: &'a mut Data<T>,
        q: &[T],
        v: &[T],
        a: &[T],
    ) -> Result<Accelerations<'a, T>, DynamicsError> {
        self.expect_state(data, q, v)?;
        expect_length("a", a.len(), self.n_velocities())?;
        let Data { tree: data, room, .. } = data;
        let (v, a) = (self.spread(v, &mut room.v), self.spread(a, &mut room.a));
        self.place(data, self.spread_positions(q, &mut room.q));
        self.move_bodies(data, v);
        for (i, body) in self.bodies.iter().enumerate() {
            let outer = body.parent.map_or(Motion::zero(), |p| data.nodes[p].acceleration);
            let node = &mut data.nodes[i];
            let relative = self.relative(body, v);
            node.acceleration =
                node.local.inverse_motion(&outer) + node.velocity.cross(&relative) + self.relative(body, a);
        }
        Ok(Accelerations { model: self, data })
    }

    /// Local transforms, poses and motion subspaces in the common frame.
    #[inline]
    pub(crate) fn place(&self, data: &mut TreeData<T>, q: &[T]) {
        self.place_in((), data, q);
        data.origin = data.nodes[0].local.translation;
    }

    /// [`place`](Self::place) in other arithmetic, but for the position of the root.
    #[inline(always)]
    pub(crate) fn place_in<N: Lift<T>>(&self, proof: N::Proof, data: &mut TreeData<N>, q: &[N]) {
        let local = self.bodies[0].mechanism.transform_in(proof, q);
        data.nodes[0].local = local;
        let root = Transform::new(local.rotation, lifted(proof, &Vector3::zeros()));
        self.place_from_in(proof, data, q, root);
    }

    /// The same in any frame, from the pose of the root in it.
    #[inline(always)]
    pub(crate) fn place_from_in<N: Lift<T>>(
        &self,
        proof: N::Proof,
        data: &mut TreeData<N>,
        q: &[N],
        root: Transform<N>,
    ) {
        for (i, body) in self.bodies.iter().enumerate() {
            let pose = match body.parent {
                Some(parent) => {
                    let local = body.mechanism.transform_in(proof, &q[body.q..]);
                    data.nodes[i].local = local;
                    data.nodes[parent].pose.compose(&local)
                }
                None => root,
            };
            data.nodes[i].pose = pose;
            for k in body.dofs.clone() {
                data.columns[k] = self.directions[k].seen_from(proof, &pose);
            }
        }
    }

    /// Velocities in body axes; poses must be up to date.
    fn move_bodies(&self, data: &mut TreeData<T>, v: &[T]) {
        for (i, body) in self.bodies.iter().enumerate() {
            let outer = body.parent.map_or(Motion::zero(), |p| data.nodes[p].velocity);
            let node = &mut data.nodes[i];
            node.velocity = node.local.inverse_motion(&outer) + self.relative(body, v);
        }
    }
}

impl<'a, T: Scalar> Positions<'a, T> {
    /// Pose of body `i` in the world.
    pub fn pose(&self, i: usize) -> Result<Transform<T>, DynamicsError> {
        self.model.expect_body(i)?;
        let pose = &self.data.nodes[i].pose;
        Ok(Transform::new(pose.rotation, pose.translation + self.data.origin))
    }

    /// Origin of body `i` in the world, and its rotation, body axes → world, which is not copied.
    #[inline]
    pub fn origin_and_rotation(&self, i: usize) -> Result<(Vector3<T>, &'a Matrix3<T>), DynamicsError> {
        self.model.expect_body(i)?;
        let pose = &self.data.nodes[i].pose;
        Ok((pose.translation + self.data.origin, &pose.rotation))
    }

    /// out ← J, 6 × [`n_velocities`](Model::n_velocities), with J v the velocity (linear, then angular)
    /// of a frame at the pose `frame` in body `i`: of its origin, in the chosen axes. Cost: that of
    /// the path to the root.
    pub fn jacobian_into(
        &self,
        i: usize,
        frame: &Transform<T>,
        axes: Axes,
        out: &mut DMatrix<T>,
    ) -> Result<(), DynamicsError> {
        self.model.expect_body(i)?;
        expect_columns(out, 6, self.model.n_velocities())?;
        let pose = &self.data.nodes[i].pose;
        let origin = pose.point(&frame.translation);
        let turn = (axes == Axes::Frame).then(|| pose.rotation * frame.rotation);
        out.fill(T::zero());
        let mut body = Some(i);
        while let Some(b) = body {
            for k in self.model.bodies[b].dofs.clone() {
                let mut column = self.data.columns[k].at(&origin);
                if let Some(turn) = &turn {
                    column.linear = turn.tr_mul(&column.linear);
                    column.angular = turn.tr_mul(&column.angular);
                }
                if let Some((at, factor)) = self.model.shared_column(k) {
                    let mut sum = out.fixed_view_mut::<3, 1>(0, at);
                    sum += column.linear * factor;
                    let mut sum = out.fixed_view_mut::<3, 1>(3, at);
                    sum += column.angular * factor;
                } else {
                    out.fixed_view_mut::<3, 1>(0, k).copy_from(&column.linear);
                    out.fixed_view_mut::<3, 1>(3, k).copy_from(&column.angular);
                }
            }
            body = self.model.bodies[b].parent;
        }
        Ok(())
    }

    /// Centre of mass of the whole tree in the world, m; not finite if there is no mass.
    pub fn center_of_mass(&self) -> Vector3<T> {
        let (mut mass, mut moment) = (T::zero(), Vector3::zeros());
        for (body, node) in self.model.bodies.iter().zip(&self.data.nodes) {
            mass += body.inertia.mass;
            moment +=
                node.pose.rotation * body.inertia.first_moment + node.pose.translation * body.inertia.mass;
        }
        self.data.origin + moment / mass
    }

    /// −Σ m g·c: potential energy in uniform gravity, zero at the world's origin, J.
    pub fn potential_energy(&self) -> T {
        -self.model.gravity.dot(&self.center_of_mass()) * self.model.mass()
    }
}

impl<'a, T: Scalar> Velocities<'a, T> {
    /// Those that a workspace was left with.
    pub(crate) fn of(model: &'a Model<T>, data: &'a TreeData<T>) -> Self {
        Self { model, data }
    }

    /// The poses.
    pub fn positions(&self) -> Positions<'a, T> {
        Positions { model: self.model, data: self.data }
    }

    /// Velocity of body `i`: of its origin and about it, in body axes.
    pub fn velocity(&self, i: usize) -> Result<Motion<T>, DynamicsError> {
        self.model.expect_body(i)?;
        Ok(self.data.nodes[i].velocity)
    }

    /// Σ ½ v·I v, J.
    pub fn kinetic_energy(&self) -> T {
        let mut twice = T::zero();
        for (body, node) in self.model.bodies.iter().zip(&self.data.nodes) {
            twice += node.velocity.dot(&body.inertia.times(&node.velocity));
        }
        twice * constant(0.5)
    }
}

impl<'a, T: Scalar> Accelerations<'a, T> {
    /// The velocities.
    pub fn velocities(&self) -> Velocities<'a, T> {
        Velocities { model: self.model, data: self.data }
    }

    /// Spatial acceleration of body `i` in body axes: the rate of [`Velocities::velocity`] in an inertial
    /// frame that coincides with the body. The origin itself accelerates with linear + ω × v.
    pub fn acceleration(&self, i: usize) -> Result<Motion<T>, DynamicsError> {
        self.model.expect_body(i)?;
        Ok(self.data.nodes[i].acceleration)
    }
}

/// Fails unless `out` has the given shape.
pub(crate) fn expect_columns<T: Scalar>(
    out: &DMatrix<T>,
    rows: usize,
    columns: usize,
) -> Result<(), DynamicsError> {
    if out.nrows() != rows {
        return Err(
            ArgumentError::Length { argument: "rows of out", expected: rows, found: out.nrows() }.into()
        );
    }
    if out.ncols() != columns {
        let found = out.ncols();
        return Err(ArgumentError::Length { argument: "columns of out", expected: columns, found }.into());
    }
    Ok(())
}
