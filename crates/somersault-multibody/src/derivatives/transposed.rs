//! The transposes of first variations: they pull covectors on links or accelerations back to the joints.
//!
//! With f̄ᵢ and ḡᵢ the covectors on ηᵢ and δVᵢ of [`links`](super::links), from the leaves to the root
//! ```text
//! f̄ᵢ += (Vᵢ − V_λ) ×* ḡᵢ,   ξ̄_k = S_k · f̄ᵢ,   δv̄_k = S_k · ḡᵢ,   f̄_λ += f̄ᵢ,   ḡ_λ += ḡᵢ.
//! ```

use super::{DerivativeData, DerivativeTables};
use crate::articulated::{Roles, Split};
use crate::data::{Data, TreeData};
use crate::model::Model;
use crate::spatial::{Force, Motion};
use somersault_integrators::state::Twist;
use somersault_integrators::variation::Tangent;

/// Covectors on the motion of a link along a variation and on the change of its velocity, common frame.
pub(crate) type Pulled = [Force<f64>; 2];

impl Model {
    /// Adds to `way` and `rate` the covectors on the tangents of the frames of the links, pulled back to the motion of the joints and
    /// the change of their velocities, in the state of the last partials of dynamics in the workspace.
    pub(crate) fn pull_links(
        &self,
        work: &mut DerivativeData,
        covectors: &[Tangent<Twist>],
        room: &mut [Pulled],
        (way, rate): (&mut [f64], &mut [f64]),
    ) {
        let DerivativeData { data, tables: DerivativeTables { bodies, .. }, gathered, .. } = work;
        let TreeData { nodes, columns, torque: by_way, acceleration: by_rate, .. } = &mut data.tree;
        for ((out, covector), (node, body)) in
            room.iter_mut().zip(covectors).zip(nodes.iter().zip(bodies.iter()))
        {
            let (origin, Tangent { displacement, rate }) = (&node.pose.translation, covector);
            let linear = displacement.linear + rate.linear.cross(&body.velocity.angular);
            *out = [
                Force::new(linear, displacement.angular + origin.cross(&linear)),
                Force::new(rate.linear, rate.angular + origin.cross(&rate.linear)),
            ];
        }
        for (i, body) in self.bodies.iter().enumerate().rev() {
            let outer = body.parent.map_or(Motion::zero(), |parent| bodies[parent].velocity);
            let [mut moved, change] = room[i];
            moved += (bodies[i].velocity - outer).cross_force(&change);
            for k in body.dofs.clone() {
                (by_way[k], by_rate[k]) = (columns[k].dot(&moved), columns[k].dot(&change));
            }
            if let Some(parent) = body.parent {
                room[parent][0] += moved;
                room[parent][1] += change;
            }
        }
        for (out, found) in [(way, &*by_way), (rate, &*by_rate)] {
            let found = self.gather(found, &mut gathered.value);
            out.iter_mut().zip(found).for_each(|(out, found)| *out += found);
        }
    }

    /// out ← the motions of the links, in body axes, by joint velocities `v`, in the state of the last partials of dynamics in
    /// the workspace.
    pub(crate) fn link_motions(&self, work: &mut DerivativeData, v: &[f64], out: &mut [Motion<f64>]) {
        let Data { tree, room, .. } = &mut work.data;
        let v = self.spread(v, &mut room.v);
        for (i, body) in self.bodies.iter().enumerate() {
            let mut motion = body.parent.map_or(Motion::zero(), |parent| out[parent]);
            for k in body.dofs.clone() {
                motion += tree.columns[k] * v[k];
            }
            out[i] = motion;
        }
        for (motion, node) in out.iter_mut().zip(&tree.nodes) {
            *motion = node.pose.inverse_motion(motion);
        }
    }

    /// The transpose of [`acceleration_change`](Self::acceleration_change): pulls a covector on the accelerations back to the
    /// motion of the joints and the change of their velocities, to which it adds, and to joint forces and given accelerations,
    /// which it sets.
    pub(crate) fn pull_acceleration_change(
        work: &DerivativeData,
        split: Option<&Split>,
        covector: &[f64],
        [way, rate]: [&mut [f64]; 2],
        [torque, given]: [&mut [f64]; 2],
    ) {
        let is_active = |k: usize| split.is_some_and(|split| split.is_active(k));
        let of_passive = |column: &[f64]| -> f64 {
            let entries = column.iter().zip(covector).enumerate();
            entries.filter(|(k, _)| !is_active(*k)).map(|(_, (x, weight))| x * weight).sum()
        };
        let n = covector.len();
        let column =
            |matrix: &'_ nalgebra::DMatrix<f64>, k: usize| of_passive(&matrix.as_slice()[k * n..][..n]);
        for k in 0..n {
            way[k] += column(&work.tables.forward.q, k);
            rate[k] += column(&work.tables.forward.v, k);
            (torque[k], given[k]) = if is_active(k) {
                (0.0, covector[k] + column(&work.input, k))
            } else {
                (column(&work.tables.response, k), 0.0)
            };
        }
    }
}
