//! First variations of the motion of a tree: what its accelerations do along a tangent to its state.

use super::variation::Ends;
use super::{Coordinates, JointDrive, Rates, TreeForces, TreeSystem, TreeVariation, TreeWorkspace};
use crate::articulated::Roles;
use crate::derivatives::TreeParameter;
use crate::error::DynamicsError;
use crate::model::Model;
use crate::spatial::Force;
use somersault_integrators::state::{Configuration, Rate};

impl<F: TreeForces, D: JointDrive> TreeSystem<'_, F, D> {
    /// Room for the derivative of accelerations.
    pub fn variation(&self) -> TreeVariation {
        TreeVariation::new(self.model())
    }

    /// Linearises the accelerations in the state, and under the wrenches, whose accelerations were the last to be computed in
    /// the workspace `w`; false where there are none, or joints are driven otherwise than by accelerations
    /// ([`JointDrive::split`]).
    pub fn linearize(&self, w: &TreeWorkspace, d: &mut TreeVariation, q: &Coordinates) -> bool {
        d.v.copy_from_slice(&w.v);
        d.acceleration.copy_from_slice(&w.acceleration);
        let TreeVariation { work, known, .. } = d;
        let (model, q) = (self.model(), q.as_slice());
        let found = match self.drive().split() {
            Some(split) => {
                for (k, known) in known.iter_mut().enumerate() {
                    *known = if split.is_active(k) { w.acceleration[k] } else { w.torque[k] };
                }
                model.hybrid_dynamics_partials(work, split, q, &w.v, known, &w.wrenches)
            }
            None if self.is_driven() => return false,
            None => model.forward_dynamics_partials(work, q, &w.v, &w.torque, &w.wrenches),
        };
        self.keep(found.map(|_| ())).is_some()
    }

    /// Fails where the accelerations have no derivative with respect to a parameter of the tree: no such body, numbers that are not finite,
    /// or the placement of a joint while the forces exert wrenches, which are functions of the poses of bodies.
    pub fn check_parameter(&self, parameter: &TreeParameter) -> Result<(), DynamicsError> {
        parameter.check(self.model())?;
        match parameter {
            TreeParameter::Placement(..) if self.forces().wrenches().is_some() => {
                Err(DynamicsError::PlacementUnderWrenches)
            }
            TreeParameter::Mass(_)
            | TreeParameter::Center(..)
            | TreeParameter::Inertia(..)
            | TreeParameter::Placement(..) => Ok(()),
        }
    }

    /// Adds the change along a parameter of the tree, after [`vary`](Self::vary): moves the links, and adds the forces that change the
    /// accelerations as the parameter does. A body that the model does not have changes nothing.
    pub fn vary_parameter(&self, d: &mut TreeVariation, parameter: &TreeParameter) {
        let model = self.model();
        let TreeVariation { work, torque, wrenches, links, .. } = d;
        if parameter.body() >= model.n_bodies() {
            return;
        }
        if let Some(wrench) = model.inertia_wrench(work, parameter) {
            wrenches[parameter.body()] += wrench;
        }
        if let TreeParameter::Placement(body, direction) = parameter {
            model.add_placement_forces(work, (*body, direction), torque);
            let tangent = model.placement_tangent(work, (*body, direction));
            for (i, link) in links.iter_mut().enumerate().skip(*body) {
                if model.carries(*body, i) {
                    link.displacement.axpy(1.0, &tangent.displacement);
                    link.rate.axpy(1.0, &tangent.rate);
                }
            }
        }
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

    /// The changes of joint forces, wrenches, and accelerations of driven joints, by central differences.
    fn vary_forces(&self, d: &mut TreeVariation, t: f64, q: &Coordinates, displacement: &Rates) {
        let TreeVariation { v, way, rate, torque, given, wrenches, ends, .. } = d;
        self.difference(ends, t, (q, v), (displacement, way, rate), (torque, given, wrenches));
    }

    /// Adds the changes of joint forces, accelerations of driven joints and wrenches along a displacement, by which the joints move along
    /// `way`, and a change of their velocities: central differences.
    pub(super) fn difference(
        &self,
        ends: &mut Ends,
        t: f64,
        (q, v): (&Coordinates, &[f64]),
        (displacement, way, rate): (&Rates, &[f64], &[f64]),
        (torque, given, wrenches): (&mut [f64], &mut [f64], &mut [Force<f64>]),
    ) {
        if !self.is_driven() && !self.forces().depends_on_state() {
            return;
        }
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
            for ((end, v), rate) in ends.v.iter_mut().zip(v).zip(rate) {
                *end = v + step * rate;
            }
            ends.torque.fill(0.0);
            self.forces().add_torque(t, moved.as_slice(), &ends.v, &mut ends.torque);
            torque.iter_mut().zip(&ends.torque).for_each(|(torque, end)| *torque += weight * end);
            if let Some(split) = self.drive().split() {
                self.drive().accelerations(t, moved.as_slice(), &ends.v, &mut ends.given);
                for (k, (given, end)) in given.iter_mut().zip(&ends.given).enumerate() {
                    *given += if split.is_active(k) { weight * end } else { 0.0 };
                }
            }
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
        let TreeVariation { work, v, acceleration, way, rate, torque, given, change, wrenches, .. } = d;
        self.model().add_joint_forces(work, wrenches, torque);
        Model::acceleration_change(work, self.drive().split(), [way, rate, torque], given, change);
        let along = (&way[..], &rate[..], &change[..]);
        self.model().second_rates_change(q.as_slice(), (v, acceleration), along, out.as_mut_slice());
    }
}
