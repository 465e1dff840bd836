//! The flight of a dive, and the angles that it must reach.

use super::DiveProgram;
use crate::dive::{Dive, DiveError};
use crate::flight::BodyAngles;
use crate::nlp::Bounds;
use nalgebra::{UnitQuaternion, Vector3};
use somersault_multibody::models::Dimension;
use somersault_multibody::{Data, DynamicsError, Model};
use std::f64::consts::TAU;

impl DiveProgram {
    /// z with everything in the middle of its range, splines at their offset.
    pub(in crate::dive) fn middle(&self) -> Vec<f64> {
        let Bounds { lower, upper } = &self.structure.variables;
        let middle = |(l, u): (&f64, &f64)| if l.is_finite() && u.is_finite() { 0.5 * (l + u) } else { 0.0 };
        lower.iter().zip(upper).map(middle).collect()
    }

    /// Sets the momentum in `z` so that the somersaults come out, to a tenth of a degree, if it can.
    pub(in crate::dive) fn aim(&mut self, z: &mut [f64]) -> Result<(), DiveError> {
        let Some(k) = self.extra.momentum else { return Ok(()) };
        let (lower, upper) = (self.structure.variables.lower[k], self.structure.variables.upper[k]);
        let target = targets(&self.dive)[0];
        let mut miss = |value: f64, z: &mut [f64]| {
            z[k] = value;
            self.fly(z, false)?;
            Ok::<f64, DiveError>(self.entry_angles()[0] - target)
        };
        let (mut last, mut value) = (0.2f64.clamp(lower, upper), 0.3f64.clamp(lower, upper));
        let mut miss_last = miss(last, z)?;
        for _ in 0..30 {
            let found = miss(value, z)?;
            if found.abs() < 2e-3 || found == miss_last {
                break;
            }
            let next = value - found * (value - last) / (found - miss_last);
            (last, miss_last) = (value, found);
            value = next.clamp(lower, upper);
        }
        Ok(())
    }

    /// Integrates the orientation for `z`.
    pub(in crate::dive) fn fly(&mut self, z: &[f64], with_derivatives: bool) -> Result<(), DiveError> {
        let (lean, turn_momentum) = (self.lean(z), self.momentum(z) * self.duration(z));
        let motion = self.path.motion();
        for (p, value) in self.free.iter().zip(z) {
            self.parameters[*p] = *value;
        }
        motion.coefficients_into(&self.parameters, &mut self.coefficients);
        let momentum = Vector3::new(0.0, turn_momentum, 0.0);
        let upright = self.counting.axes.inverse();
        if self.path.is_planar() {
            let start = -(lean + upright.euler_angles().1);
            self.path.integrate(&self.coefficients, &[start], momentum, with_derivatives)?;
        } else {
            let start = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), lean) * upright;
            self.path.integrate(&self.coefficients, start.coords.as_slice(), momentum, with_derivatives)?;
        }
        Ok(())
    }

    /// Angles at the nodes of the path.
    pub fn angles(&self, z: &[f64]) -> Result<Vec<BodyAngles>, DiveError> {
        let mut program = self.clone();
        program.fly(z, false)?;
        let path = &program.path;
        if path.is_planar() {
            let tilt = self.counting.axes.euler_angles().1;
            let somersault = |angle: &f64| BodyAngles { somersault: tilt - angle, ..BodyAngles::default() };
            return Ok(path.angles().iter().map(somersault).collect());
        }
        Ok(self.counting.along((0..=path.n_steps()).map(|node| path.arrival(node))))
    }

    /// ψ at the entry, then τ and φ at the square-out; in the plane ψ alone.
    pub(super) fn entry_angles(&self) -> [f64; 3] {
        if self.path.is_planar() {
            let angle = self.path.angles()[self.path.n_steps()];
            return [self.counting.axes.euler_angles().1 - angle, 0.0, 0.0];
        }
        let (mut last, mut square) = (BodyAngles::default(), BodyAngles::default());
        for (node, orientation) in self.path.orientations().iter().enumerate() {
            if node == self.square_out {
                square = self.counting.unwrapped(self.path.arrival(node), &last);
            }
            last = self.counting.unwrapped(orientation, &last);
        }
        [last.somersault, square.tilt, square.twist]
    }

    /// The nodes of these angles, and their derivatives by a displacement there, in axes of the torso.
    pub(super) fn entry_gradients(&self) -> [(usize, Vector3<f64>); 3] {
        let n_steps = self.path.n_steps();
        if self.path.is_planar() {
            return [(n_steps, -Vector3::z()), (0, Vector3::zeros()), (0, Vector3::zeros())];
        }
        let at = |node: usize| self.counting.gradients(self.path.arrival(node));
        let [_, tilt, twist] = at(self.square_out);
        [(n_steps, at(n_steps)[0]), (self.square_out, tilt), (self.square_out, twist)]
    }

    /// Angles at entry and square-out that are constraints.
    pub(super) fn n_angles(&self) -> usize {
        if self.path.is_planar() { 1 } else { 3 }
    }

    /// The gradients of these angles by z, for the last flight.
    pub(super) fn angle_gradients(&mut self, z: &[f64], rows: &mut [Vec<f64>; 3]) {
        let mut node_derivatives = std::mem::take(&mut self.node);
        let mut before = usize::MAX;
        for (k, (node, by_node)) in self.entry_gradients().iter().enumerate().take(self.n_angles()) {
            if *node != before {
                self.path.node_derivatives(*node, &mut node_derivatives);
                before = *node;
            }
            for (out, by) in self.by_coefficient.iter_mut().zip(&node_derivatives.by_coefficients) {
                *out = by.dot(by_node);
            }
            self.row.fill(0.0);
            self.path.motion().pull_back(&self.by_coefficient, &mut self.row);
            let row = &mut rows[k];
            self.free.iter().zip(row.iter_mut()).for_each(|(p, out)| *out = self.row[*p]);
            let by_momentum = node_derivatives.by_momentum.tr_mul(by_node).y;
            if let Some(column) = self.extra.momentum {
                row[column] = by_momentum * self.duration(z) * self.momentum_unit;
            }
            if let Some(column) = self.extra.duration {
                row[column] = by_momentum * self.momentum(z);
            }
            if let Some(column) = self.extra.lean {
                // the start turns about the world's lateral axis
                let turn = if self.path.is_planar() {
                    -Vector3::z()
                } else {
                    self.path.orientations()[0].inverse_transform_vector(&Vector3::y())
                };
                row[column] = node_derivatives.by_start.tr_mul(by_node).dot(&turn);
            }
        }
        self.node = node_derivatives;
    }
}

/// Angles at the entry, rad: somersault, tilt and twist, or the first alone.
pub(super) fn targets(dive: &Dive) -> Vec<f64> {
    let somersault = TAU * dive.somersaults + dive.entry_lean;
    match dive.diver.dimension {
        Dimension::Planar => vec![somersault],
        Dimension::Spatial => vec![somersault, 0.0, TAU * dive.twists],
    }
}

/// The body's axes in those of the torso: turned about the lateral axis until z goes from feet to hands.
pub(super) fn long_axis(dive: &Dive, model: &Model) -> Result<UnitQuaternion<f64>, DynamicsError> {
    let mut data = Data::new(model);
    let mut q = model.neutral();
    let n_root = q.len() - dive.postures[dive.last].len();
    q[n_root..].copy_from_slice(&dive.postures[dive.last]);
    let positions = model.positions(&mut data, &q)?;
    let center = |parts: &[&str]| -> Result<Vector3<f64>, DynamicsError> {
        let (mut mass, mut moment) = (0.0, Vector3::zeros());
        for part in parts {
            let body = model.body(part)?;
            if let Some(inertia) = model.inertia(body) {
                let pose = positions.pose(body)?;
                mass += inertia.mass();
                moment += pose.rotation * inertia.first_moment() + pose.translation * inertia.mass();
            }
        }
        Ok(moment / mass)
    };
    let [feet, hands] = match dive.diver.dimension {
        Dimension::Planar => [center(&["foot", "toes"])?, center(&["hand"])?],
        Dimension::Spatial => [
            center(&["right_foot", "right_toes", "left_foot", "left_toes"])?,
            center(&["right_hand", "left_hand"])?,
        ],
    };
    // the neutral torso is upright, the world's axes are forward, left and up
    let along = hands - feet;
    Ok(UnitQuaternion::from_axis_angle(&Vector3::y_axis(), along.x.atan2(along.z)))
}
