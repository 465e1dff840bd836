//! Forward and hybrid dynamics: the articulated-body algorithm (Featherstone 2008, sections 7.2 and
//! 9.2), with every degree of freedom eliminated by itself.
//!
//! Inwards, the body i with articulated inertia I and bias force p feels f = I a + p. Of its degrees of
//! freedom k one after the other is removed from this relation:
//!
//! * **passive**, its force τ known: U = I S, D = S·U, u = τ − S·p; then I −= U Uᵀ/D, p += U u/D;
//! * **active**, its acceleration known: U = I S, u = S·p; then p += U q̈.
//!
//! What remains is added to the parent. Outwards, starting from a = X a_λ + v × S q̇, in reverse order:
//!
//! * passive: q̈ = (u − U·a)/D, a += S q̈;
//! * active: a += S q̈, τ = U·a + u.
//!
//! This is an LDLᵀ factorisation of the joint's block, so no joint needs an inverse of its own and the
//! split may cut through a joint. All passive is forward dynamics, all active inverse dynamics. With
//! the rows of M sorted into passive and active it solves thesis (C.24), hence (C.25) with u_p kept and
//! (C.26). Cost O(n).

use crate::data::{Data, Node, Pivot, TreeData};
use crate::error::DynamicsError;
use crate::inertia::ArticulatedInertia;
use crate::model::Model;
use crate::spatial::{Force, Motion};
use nalgebra::Vector3;
use somersault_core::argument::expect_length;
use somersault_core::scalar::{Lift, Scalar, constant};

/// Which degrees of freedom have a prescribed acceleration.
pub(crate) trait Roles {
    fn is_active(&self, k: usize) -> bool;
}

/// Forward dynamics.
pub(crate) struct AllPassive;

impl Roles for AllPassive {
    #[inline(always)]
    fn is_active(&self, _: usize) -> bool {
        false
    }
}

/// A division of the degrees of freedom into passive ones, whose joint force is given, and active ones,
/// whose acceleration is.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Split {
    active: Vec<bool>,
}

impl Roles for Split {
    #[inline(always)]
    fn is_active(&self, k: usize) -> bool {
        self.active[k]
    }
}

impl Split {
    /// From one flag per degree of freedom, true for the active ones.
    pub fn new(active: Vec<bool>) -> Self {
        Self { active }
    }

    /// All degrees of freedom of the joints of the named bodies are active, the others passive. A joint that follows
    /// another is moved by that one's.
    pub fn try_active<T: Scalar>(model: &Model<T>, bodies: &[&str]) -> Result<Self, DynamicsError> {
        let mut active = vec![false; model.n_velocities()];
        for name in bodies {
            active[model.leading_velocities_of(model.body(name)?)].fill(true);
        }
        Ok(Self { active })
    }

    /// All degrees of freedom are active but those of the root: a body in the air whose joints are driven.
    pub fn all_but_root<T: Scalar>(model: &Model<T>) -> Self {
        let mut active = vec![true; model.n_velocities()];
        active[model.velocities_of(0)].fill(false);
        Self { active }
    }

    /// One flag per degree of freedom, true for the active ones.
    pub fn active(&self) -> &[bool] {
        &self.active
    }
}

impl<T: Scalar> Model<T> {
    /// Accelerations under the joint forces `torque`: M(q) a = τ − h(q, v) + Σ Jᵀ f_ext.
    ///
    /// `wrenches` as in [`inverse_dynamics`](Self::inverse_dynamics). Fails where some motion of a joint
    /// meets no inertia, or none beyond the rounding of that of other motions of its body.
    pub fn forward_dynamics<'d>(
        &self,
        data: &'d mut Data<T>,
        q: &[T],
        v: &[T],
        torque: &[T],
        wrenches: &[Force<T>],
    ) -> Result<&'d [T], DynamicsError> {
        self.expect_state(data, q, v)?;
        expect_length("torque", torque.len(), self.n_velocities())?;
        self.expect_wrenches(wrenches)?;
        if self.coupling.is_some() {
            let mut acceleration = std::mem::take(&mut data.room.acceleration);
            let done =
                self.coupled_accelerations(&AllPassive, data, q, v, &mut acceleration, torque, wrenches);
            data.room.acceleration = acceleration;
            return done.map(|()| data.room.acceleration.as_slice());
        }
        let TreeData { nodes, momenta, pivots, acceleration, .. } = &mut data.tree;
        self.articulate((), &AllPassive, nodes, momenta, pivots, q, v, acceleration, torque, wrenches)?;
        self.release((), &AllPassive, nodes, momenta, pivots, acceleration, &mut []);
        Ok(&data.tree.acceleration)
    }

    /// Accelerations of the passive and forces of the active degrees of freedom.
    ///
    /// On entry `acceleration` holds the accelerations of the active degrees of freedom and `torque` the
    /// forces of the passive ones; on return both are complete and satisfy M a + h = τ + Σ Jᵀ f_ext. What
    /// the other entries held is not read.
    pub fn hybrid_dynamics(
        &self,
        data: &mut Data<T>,
        split: &Split,
        q: &[T],
        v: &[T],
        acceleration: &mut [T],
        torque: &mut [T],
        wrenches: &[Force<T>],
    ) -> Result<(), DynamicsError> {
        self.expect_state(data, q, v)?;
        expect_length("split", split.active.len(), self.n_velocities())?;
        expect_length("acceleration", acceleration.len(), self.n_velocities())?;
        expect_length("torque", torque.len(), self.n_velocities())?;
        self.expect_wrenches(wrenches)?;
        if self.coupling.is_some() {
            self.coupled_accelerations(split, data, q, v, acceleration, torque, wrenches)?;
            let found = self.inverse_dynamics(data, q, v, acceleration, wrenches)?;
            for k in (0..found.len()).filter(|&k| split.active[k]) {
                torque[k] = found[k];
            }
            return Ok(());
        }
        let TreeData { nodes, momenta, pivots, .. } = &mut data.tree;
        self.articulate((), split, nodes, momenta, pivots, q, v, acceleration, torque, wrenches)?;
        self.release((), split, nodes, momenta, pivots, acceleration, torque);
        for k in 0..torque.len() {
            if split.active[k] {
                torque[k] += self.damping[k] * v[k];
            }
        }
        Ok(())
    }

    /// Outwards for velocities, then inwards for articulated inertias and bias forces.
    ///
    /// Lanes fail together, where any of them does.
    #[inline(always)]
    pub(crate) fn articulate<N: Lift<T>>(
        &self,
        proof: N::Proof,
        roles: &impl Roles,
        nodes: &mut [Node<N>],
        momenta: &mut [Force<N>],
        pivots: &mut [Pivot<N>],
        q: &[N],
        v: &[N],
        known_acceleration: &[N],
        known_torque: &[N],
        wrenches: &[Force<N>],
    ) -> Result<(), DynamicsError> {
        let rest = Motion::zero().lift(proof);
        for (i, body) in self.bodies.iter().enumerate() {
            let outer = body.parent.map_or(rest, |p| nodes[p].velocity);
            let inertia = body.inertia.lift(proof);
            let node = &mut nodes[i];
            node.local = body.mechanism.transform_in(proof, &q[body.q..]);
            let relative = self.relative_in(proof, body, v);
            node.velocity = node.local.inverse_motion(&outer) + relative;
            node.acceleration = node.velocity.cross(&relative);
            node.articulated = ArticulatedInertia::rigid(&body.inertia).lift(proof);
            node.force = node.velocity.cross_force(&inertia.times(&node.velocity));
            if let Some(wrench) = wrenches.get(i) {
                node.force -= *wrench;
            }
        }
        let (one, rounding) = (N::lift(proof, T::one()), N::lift(proof, constant(4.0 * f64::EPSILON)));
        for (i, body) in self.bodies.iter().enumerate().rev() {
            let (inner, outer) = nodes.split_at_mut(i);
            let node = &mut outer[0];
            for k in body.dofs.clone() {
                let direction = &self.directions[k].lift(proof);
                let momentum = node.articulated.column(direction);
                momenta[k] = momentum;
                if roles.is_active(k) {
                    pivots[k].residual = direction.dot(&node.force);
                    node.force += momentum * known_acceleration[k];
                    continue;
                }
                let pivot = direction.dot(&momentum);
                if !pivot.exceeds(node.articulated.extent(direction) * rounding) {
                    return Err(DynamicsError::Singular { joint: self.links()[i].name.clone() });
                }
                let inverse = one / pivot;
                let damping = N::lift(proof, self.damping[k]);
                let residual = known_torque[k] - damping * v[k] - direction.dot(&node.force);
                pivots[k] = Pivot { inverse, residual };
                // the root has nobody to hand its inertia to
                if body.parent.is_some() || k + 1 < body.dofs.end {
                    node.articulated.subtract_square(&momentum, inverse);
                    node.force += momentum * (residual * inverse);
                }
            }
            if let Some(parent) = body.parent {
                let outer = &mut inner[parent];
                let force = node.force + node.articulated.times(&node.acceleration);
                outer.articulated.add_seen_from(&node.articulated, &node.local);
                outer.force += node.local.force(&force);
            }
        }
        Ok(())
    }

    /// Outwards for accelerations, and for the forces of active degrees of freedom.
    #[inline(always)]
    pub(crate) fn release<N: Lift<T>>(
        &self,
        proof: N::Proof,
        roles: &impl Roles,
        nodes: &mut [Node<N>],
        momenta: &[Force<N>],
        pivots: &[Pivot<N>],
        acceleration: &mut [N],
        torque: &mut [N],
    ) {
        let world = Motion::new(-self.gravity, Vector3::zeros()).lift(proof);
        for (i, body) in self.bodies.iter().enumerate() {
            let outer = body.parent.map_or(world, |p| nodes[p].acceleration);
            let node = &mut nodes[i];
            let mut motion = node.local.inverse_motion(&outer) + node.acceleration;
            for k in body.dofs.clone().rev() {
                let direction = self.directions[k].lift(proof);
                if roles.is_active(k) {
                    direction.add_to(&mut motion, acceleration[k]);
                    torque[k] = motion.dot(&momenta[k]) + pivots[k].residual;
                } else {
                    let rate = (pivots[k].residual - motion.dot(&momenta[k])) * pivots[k].inverse;
                    acceleration[k] = rate;
                    direction.add_to(&mut motion, rate);
                }
            }
            node.acceleration = motion;
        }
    }
}
