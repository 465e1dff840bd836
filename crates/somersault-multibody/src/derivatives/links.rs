//! First variations of the links of a tree, and what changes of forces do to its accelerations.
//!
//! With all vectors in one inertial frame, S the columns of the joint of body i, λ its parent, ξ a small motion of the
//! joints and δv a change of their rates,
//! ```text
//! ηᵢ = η_λ + S ξ,    δVᵢ = δV_λ + ηᵢ × (Vᵢ − V_λ) + S δv,
//! ```
//! since the columns of a joint move with its body.

use super::{DerivativeData, DerivativeTables};
use crate::articulated::{Roles, Split};
use crate::model::Model;
use crate::spatial::{Force, Motion};
use nalgebra::DMatrix;
use somersault_integrators::state::Twist;
use somersault_integrators::variation::Tangent;

/// The motion of a link along a variation and the change of its velocity, common frame.
pub(crate) type Varying = [Motion<f64>; 2];

impl Model {
    /// The tangents of the frames of all links, world axes, along a motion `way` of the joints and a change `rate` of their
    /// velocities, in the state of the last partials of dynamics in the workspace.
    pub(crate) fn vary_links(
        &self,
        work: &mut DerivativeData,
        (way, rate): (&[f64], &[f64]),
        room: &mut [Varying],
        out: &mut [Tangent<Twist>],
    ) {
        let DerivativeData { data, tables: DerivativeTables { bodies, .. }, .. } = work;
        let crate::data::Data { tree, room: spread, .. } = data;
        let (way, rate) = (self.spread(way, &mut spread.v), self.spread(rate, &mut spread.a));
        for (i, body) in self.bodies.iter().enumerate() {
            let zero = (Motion::zero(), [Motion::zero(); 2]);
            let (outer, [mut moved, mut change]) =
                body.parent.map_or(zero, |parent| (bodies[parent].velocity, room[parent]));
            for k in body.dofs.clone() {
                moved += tree.columns[k] * way[k];
                change += tree.columns[k] * rate[k];
            }
            let velocity = bodies[i].velocity;
            change += moved.cross(&(velocity - outer));
            room[i] = [moved, change];
            let origin = &tree.nodes[i].pose.translation;
            let displacement =
                Twist { linear: moved.linear + moved.angular.cross(origin), angular: moved.angular };
            let linear =
                change.linear + change.angular.cross(origin) + velocity.angular.cross(&displacement.linear);
            out[i] = Tangent { displacement, rate: Twist { linear, angular: change.angular } };
        }
    }

    /// Adds to `torque` the joint forces of wrenches in body axes, in the state of the last partials in the workspace.
    /// The wrenches are summed over subtrees in their place, in the common frame.
    pub(crate) fn add_joint_forces(
        &self,
        work: &mut DerivativeData,
        wrenches: &mut [Force<f64>],
        torque: &mut [f64],
    ) {
        let DerivativeData { data, gathered, .. } = work;
        let crate::data::Data { tree, .. } = data;
        for (wrench, node) in wrenches.iter_mut().zip(&tree.nodes) {
            *wrench = node.pose.force(wrench);
        }
        for (i, body) in self.bodies.iter().enumerate().rev() {
            let carried = wrenches[i];
            for k in body.dofs.clone() {
                tree.torque[k] = tree.columns[k].dot(&carried);
            }
            if let Some(parent) = body.parent {
                wrenches[parent] += carried;
            }
        }
        let found = self.gather(&tree.torque, &mut gathered.value);
        torque.iter_mut().zip(found).for_each(|(torque, found)| *torque += found);
    }

    /// The change of the accelerations along a motion of the joints, a change of their velocities and one of the joint forces,
    /// by the last partials of forward dynamics in the workspace, or of hybrid dynamics with a split, of whose active degrees of
    /// freedom the accelerations `given` change.
    pub(crate) fn acceleration_change(
        work: &DerivativeData,
        split: Option<&Split>,
        along: [&[f64]; 3],
        given: &[f64],
        out: &mut [f64],
    ) {
        out.fill(0.0);
        let by: [&DMatrix<f64>; 3] = [&work.tables.forward.q, &work.tables.forward.v, &work.tables.response];
        for (matrix, change) in by.into_iter().zip(along) {
            for (column, &change) in matrix.column_iter().zip(change) {
                if change != 0.0 {
                    out.iter_mut().zip(&column).for_each(|(out, x)| *out += x * change);
                }
            }
        }
        let Some(split) = split else { return };
        let active = |k: &usize| split.is_active(*k);
        for k in (0..out.len()).filter(active) {
            out.iter_mut().zip(&work.input.column(k)).for_each(|(out, x)| *out += x * given[k]);
        }
        for k in (0..out.len()).filter(active) {
            out[k] = given[k];
        }
    }
}
