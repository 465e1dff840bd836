//! First variations of the motion of a tree: what its accelerations do along a tangent to its state.

use super::{Coordinates, JointDrive, Rates, TreeForces, TreeSystem, TreeVariation, TreeWorkspace};
use crate::model::Model;
use crate::spatial::Force;
use somersault_integrators::state::Configuration;

/// Of a tree that no joint drives.
impl<F: TreeForces, D: JointDrive> TreeSystem<'_, F, D> {
    /// Room for the derivative of accelerations.
    pub fn variation(&self) -> TreeVariation {
        TreeVariation::new(self.model())
    }

    /// Linearises the accelerations in the state, and under the wrenches, whose accelerations were the last to be computed in
    /// the workspace `w`; false where there are none, or joints are driven.
    pub fn linearize(&self, w: &TreeWorkspace, d: &mut TreeVariation, q: &Coordinates) -> bool {
        if self.is_driven() {
            return false;
        }
        d.v.copy_from_slice(&w.v);
        d.acceleration.copy_from_slice(&w.acceleration);
        let model = self.model();
        let found = model.forward_dynamics_partials(&mut d.work, q.as_slice(), &w.v, &w.torque, &w.wrenches);
        self.keep(found.map(|_| ())).is_some()
    }

    /// Goes along a tangent (δq, δp) to the state (q, p): moves the links, and changes the forces of the system.
    pub fn vary(
        &self,
        d: &mut TreeVariation,
        t: f64,
        q: &Coordinates,
        (displacement, change): (&Rates, &Rates),
    ) {
        let model = self.model();
        d.rest();
        let TreeVariation { work, v, way, rate, room, links, .. } = d;
        model.joint_tangent_into((q.as_slice(), v), (displacement, change), (way, rate));
        model.vary_links(work, (way, rate), room, links);
        self.vary_forces(d, t, q, displacement);
    }

    /// The changes of joint forces and wrenches, by central differences.
    fn vary_forces(&self, d: &mut TreeVariation, t: f64, q: &Coordinates, displacement: &Rates) {
        let TreeVariation { v, way, rate, torque, wrenches, ends, .. } = d;
        let norm = |numbers: &[f64]| numbers.iter().map(|x| x * x).sum::<f64>().sqrt();
        let reach = |size: f64, change: f64| f64::EPSILON.cbrt() * size.max(1.0) / change;
        let step = reach(norm(q.as_slice()), norm(way)).min(reach(norm(v), norm(rate)));
        if !step.is_finite() {
            return;
        }
        let moved = ends.moved.get_or_insert_with(|| q.clone());
        for step in [step, -step] {
            let weight = 0.5 / step;
            moved.assign(q);
            moved.drift(displacement, step);
            for ((end, v), rate) in ends.v.iter_mut().zip(&*v).zip(&*rate) {
                *end = v + step * rate;
            }
            ends.torque.fill(0.0);
            self.forces().add_torque(t, moved.as_slice(), &ends.v, &mut ends.torque);
            torque.iter_mut().zip(&ends.torque).for_each(|(torque, end)| *torque += weight * end);
            let Some(forces) = self.forces().wrenches() else { continue };
            let bodies = self.model().velocities(&mut ends.data, moved.as_slice(), &ends.v);
            let Some(bodies) = self.keep(bodies) else { continue };
            ends.wrenches.fill(Force::zero());
            forces.add_wrenches(t, &bodies, &mut ends.wrenches);
            wrenches.iter_mut().zip(&ends.wrenches).for_each(|(wrench, end)| *wrench += *end * weight);
        }
    }

    /// The change of the acceleration of [`System`](somersault_integrators::system::System) along the tangent, with what was
    /// added.
    pub fn acceleration_change(&self, d: &mut TreeVariation, q: &Coordinates, out: &mut Rates) {
        let TreeVariation { work, v, acceleration, way, rate, torque, change, wrenches, .. } = d;
        self.model().add_joint_forces(work, wrenches, torque);
        Model::acceleration_change(work, [way, rate, torque], change);
        let along = (&way[..], &rate[..], &change[..]);
        self.model().second_rates_change(q.as_slice(), (v, acceleration), along, out.as_mut_slice());
    }
}
