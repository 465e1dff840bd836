//! Inverse dynamics: the recursive Newton–Euler algorithm (Featherstone 2008, section 5.3, body frames).
//!
//! Outwards: v_i = X v_λ + S q̇, a_i = X a_λ + S q̈ + v_i × S q̇, f_i = I a_i + v_i ×* I v_i − f_ext,
//! with a = −g for the world; inwards: τ_i = Sᵀ f_i + d q̇, f_λ += Xᵀ f_i. Cost O(n).

use crate::data::{Data, Node, TreeData};
use crate::error::DynamicsError;
use crate::model::Model;
use crate::spatial::{Force, Motion};
use nalgebra::Vector3;
use somersault_core::argument::expect_length;
use somersault_core::scalar::{Lift, Scalar};

impl<T: Scalar> Model<T> {
    /// Joint forces that produce the acceleration `a`: τ = M(q) a + h(q, v) − Σ Jᵀ f_ext.
    ///
    /// `wrenches` holds one wrench per body, in body axes about the body's origin, or nothing.
    /// Forces are in N for linear and N m for angular degrees of freedom; damping is part of h.
    pub fn inverse_dynamics<'d>(
        &self,
        data: &'d mut Data<T>,
        q: &[T],
        v: &[T],
        a: &[T],
        wrenches: &[Force<T>],
    ) -> Result<&'d [T], DynamicsError> {
        self.expect_state(data, q, v)?;
        expect_length("a", a.len(), self.n_velocities())?;
        self.expect_wrenches(wrenches)?;
        let Data { tree: TreeData { nodes, torque, .. }, room, .. } = data;
        let q = self.spread_positions(q, &mut room.q);
        let (v, a) = (self.spread(v, &mut room.v), self.spread(a, &mut room.a));
        self.newton_euler::<true, T>((), nodes, torque, q, v, a, wrenches);
        Ok(self.gather(torque, &mut room.torque))
    }

    /// h(q, v): the joint forces of inverse dynamics at zero acceleration and without wrenches, that is
    /// Coriolis and centrifugal forces, damping and weight.
    pub fn bias<'d>(&self, data: &'d mut Data<T>, q: &[T], v: &[T]) -> Result<&'d [T], DynamicsError> {
        self.expect_state(data, q, v)?;
        let Data { tree: TreeData { nodes, torque, zeros, .. }, room, .. } = data;
        let (q, v) = (self.spread_positions(q, &mut room.q), self.spread(v, &mut room.v));
        self.newton_euler::<true, T>((), nodes, torque, q, v, zeros, &[]);
        Ok(self.gather(torque, &mut room.torque))
    }

    /// g(q): the joint forces that hold the tree at rest against gravity.
    pub fn gravity_forces<'d>(&self, data: &'d mut Data<T>, q: &[T]) -> Result<&'d [T], DynamicsError> {
        data.expect_for(self)?;
        expect_length("q", q.len(), self.n_positions())?;
        let Data { tree: TreeData { nodes, torque, zeros, .. }, room, .. } = data;
        let q = self.spread_positions(q, &mut room.q);
        self.newton_euler::<false, T>((), nodes, torque, q, zeros, zeros, &[]);
        Ok(self.gather(torque, &mut room.torque))
    }

    /// `MOVES` is false where v and a are zero.
    #[inline(always)]
    pub(crate) fn newton_euler<const MOVES: bool, N: Lift<T>>(
        &self,
        proof: N::Proof,
        nodes: &mut [Node<N>],
        torque: &mut [N],
        q: &[N],
        v: &[N],
        a: &[N],
        wrenches: &[Force<N>],
    ) {
        let world = Motion::new(-self.gravity, Vector3::zeros()).lift(proof);
        let rest = Motion::zero().lift(proof);
        for (i, body) in self.bodies.iter().enumerate() {
            let (outer_velocity, outer_acceleration) =
                body.parent.map_or((rest, world), |p| (nodes[p].velocity, nodes[p].acceleration));
            let inertia = body.inertia.lift(proof);
            let node = &mut nodes[i];
            node.local = body.mechanism.transform_in(proof, &q[body.q..]);
            node.acceleration = node.local.inverse_motion(&outer_acceleration);
            if MOVES {
                let relative = self.relative_in(proof, body, v);
                node.velocity = node.local.inverse_motion(&outer_velocity) + relative;
                node.acceleration += node.velocity.cross(&relative) + self.relative_in(proof, body, a);
                let momentum = inertia.times(&node.velocity);
                node.force = inertia.times(&node.acceleration) + node.velocity.cross_force(&momentum);
            } else {
                node.force = inertia.times(&node.acceleration);
            }
            if let Some(wrench) = wrenches.get(i) {
                node.force -= *wrench;
            }
        }
        for (i, body) in self.bodies.iter().enumerate().rev() {
            let force = nodes[i].force;
            for k in body.dofs.clone() {
                let damping = N::lift(proof, self.damping[k]);
                torque[k] = self.directions[k].lift(proof).dot(&force) + damping * v[k];
            }
            if let Some(parent) = body.parent {
                let carried = nodes[i].local.force(&force);
                nodes[parent].force += carried;
            }
        }
    }

    /// Checks the arguments that most algorithms share.
    #[inline(always)]
    pub(crate) fn expect_state(&self, data: &Data<T>, q: &[T], v: &[T]) -> Result<(), DynamicsError> {
        data.expect_for(self)?;
        expect_length("q", q.len(), self.n_positions())?;
        expect_length("v", v.len(), self.n_velocities())?;
        Ok(())
    }

    #[inline(always)]
    pub(crate) fn expect_wrenches(&self, wrenches: &[Force<T>]) -> Result<(), DynamicsError> {
        if !wrenches.is_empty() {
            expect_length("wrenches", wrenches.len(), self.n_bodies())?;
        }
        Ok(())
    }
}
