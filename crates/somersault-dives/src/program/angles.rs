//! The flight of a dive, and the angles that it must reach.

use super::{DiveProgram, entry};
use crate::flight::{COEFFICIENTS, MOMENTUM, NodeExpansion, PathGradient, START};
use crate::{Dive, DiveError};
use nalgebra::{DMatrix, UnitQuaternion, Vector3};
use somersault_multibody::counting::BodyAngles;
use somersault_multibody::models::Dimension;
use somersault_multibody::{Data, DynamicsError, Model};
use somersault_nlp::Bounds;
use std::f64::consts::TAU;

impl DiveProgram {
    /// z with everything in the middle of its range, splines at their offset.
    pub(crate) fn middle(&self) -> Vec<f64> {
        let Bounds { lower, upper } = &self.structure.variables;
        let middle = |(l, u): (&f64, &f64)| if l.is_finite() && u.is_finite() { 0.5 * (l + u) } else { 0.0 };
        lower.iter().zip(upper).map(middle).collect()
    }

    /// Sets the momentum in `z` so that the somersaults come out, to a tenth of a degree, if it can.
    pub(crate) fn aim(&mut self, z: &mut [f64]) -> Result<(), DiveError> {
        let Some(k) = self.extra.momentum else { return Ok(()) };
        let (lower, upper) = (self.structure.variables.lower[k], self.structure.variables.upper[k]);
        let target = targets(&self.dive)[0];
        let sense = if target < self.lean(z) { -1.0 } else { 1.0 };
        let mut miss = |value: f64, z: &mut [f64]| {
            z[k] = value;
            self.fly(z, false)?;
            Ok::<f64, DiveError>(self.entry_angles()[0] - target)
        };
        let [mut last, mut value] = [0.2, 0.3].map(|size: f64| (sense * size).clamp(lower, upper));
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
    pub(crate) fn fly(&mut self, z: &[f64], with_derivatives: bool) -> Result<(), DiveError> {
        let motion = self.path.motion();
        motion.coefficients_into(&z[..motion.n_parameters()], &mut self.coefficients);
        let (lean, momentum) = (self.lean(z), self.turn_momentum(z));
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

    /// T L.
    fn turn_momentum(&self, z: &[f64]) -> Vector3<f64> {
        Vector3::new(0.0, self.momentum(z) * self.duration(z), 0.0)
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

    /// Angles at entry and square-out that are constraints.
    pub(super) fn n_angles(&self) -> usize {
        if self.path.is_planar() { 1 } else { 3 }
    }

    /// Leaves in `angle_row` the gradient by z of these angles times `factors`, for the last flight.
    pub(super) fn pull_back_angles(&mut self, z: &[f64], factors: &[f64]) -> Result<(), DiveError> {
        let [last, arrival] = self.expand_angles(factors);
        self.by_nodes.fill(Vector3::zeros());
        self.by_nodes[self.path.n_steps()] = last.gradient;
        self.path_gradient.clear();
        self.path.pull_back_arrival(&self.by_nodes, &arrival.gradient, &mut self.path_gradient)?;
        let PathGradient { by_start, by_momentum, by_coefficients } = &self.path_gradient;
        self.angle_row.fill(0.0);
        let motion = self.path.motion();
        motion.pull_back(by_coefficients, &mut self.angle_row[..motion.n_parameters()]);
        if let Some(column) = self.extra.momentum {
            self.angle_row[column] += by_momentum.y * self.duration(z) * self.momentum_unit;
        }
        if let Some(column) = self.extra.duration {
            self.angle_row[column] += by_momentum.y * self.momentum(z);
        }
        if let Some(column) = self.extra.lean {
            self.angle_row[column] += by_start.dot(&self.turn_by_lean());
        }
        Ok(())
    }

    /// Σ factors angles around the last flight, by displacements of the last node and of the arrival at the square-out.
    fn expand_angles(&self, factors: &[f64]) -> [NodeExpansion; 2] {
        let n_steps = self.path.n_steps();
        if self.path.is_planar() {
            let last = NodeExpansion { gradient: -Vector3::z() * factors[0], ..NodeExpansion::default() };
            return [last, NodeExpansion::default()];
        }
        let at = |node: usize, factors: [f64; 3]| {
            let orientation = self.path.arrival(node);
            let gradients = self.counting.gradients(orientation);
            NodeExpansion {
                gradient: gradients.iter().zip(factors).map(|(g, factor)| g * factor).sum(),
                hessian: self.counting.curvature(orientation, factors),
            }
        };
        let [somersault, tilt, twist] = [factors[0], factors[1], factors[2]];
        if self.square_out < n_steps {
            [at(n_steps, [somersault, 0.0, 0.0]), at(self.square_out, [0.0, tilt, twist])]
        } else {
            [at(n_steps, [somersault, tilt, twist]), NodeExpansion::default()]
        }
    }

    /// What the lean turns the start by: about the world's lateral axis.
    fn turn_by_lean(&self) -> Vector3<f64> {
        if self.path.is_planar() {
            return -Vector3::z();
        }
        self.path.orientations()[0].inverse_transform_vector(&Vector3::y())
    }

    /// Adds to the upper triangle `hessian` that of Σ factors angles.
    pub(super) fn add_angle_curvature(
        &mut self,
        z: &[f64],
        factors: &[f64],
        hessian: &mut [f64],
    ) -> Result<(), DiveError> {
        if factors.iter().all(|factor| *factor == 0.0) {
            return Ok(());
        }
        self.fly(z, true)?;
        let [last, arrival] = self.expand_angles(factors);
        // what a path depends on is linear in z but for the turn momentum, a product, about the lateral axis y
        let mut inputs = DMatrix::zeros(COEFFICIENTS + self.coefficients.len(), z.len());
        for (coefficient, parameter, factor) in self.path.motion().dependences() {
            inputs[(COEFFICIENTS + coefficient, parameter)] = factor;
        }
        if let Some(column) = self.extra.lean {
            inputs.fixed_view_mut::<3, 1>(START, column).copy_from(&self.turn_by_lean());
        }
        if let Some(column) = self.extra.momentum {
            inputs[(MOMENTUM + 1, column)] = self.duration(z) * self.momentum_unit;
        }
        if let Some(column) = self.extra.duration {
            inputs[(MOMENTUM + 1, column)] = self.momentum(z);
        }
        let second = self.path.curvature(&last, &arrival, &inputs)?;
        for j in 0..z.len() {
            (0..=j).for_each(|i| hessian[entry(i, j)] += 0.5 * (second[(i, j)] + second[(j, i)]));
        }
        if let (Some(i), Some(j)) = (self.extra.momentum, self.extra.duration) {
            self.pull_back_angles(z, factors)?;
            hessian[entry(i, j)] += self.path_gradient.by_momentum.y * self.momentum_unit;
        }
        Ok(())
    }
}

/// Angles at the entry.
pub(crate) fn requested(dive: &Dive) -> BodyAngles {
    let somersault = TAU * dive.somersaults + dive.entry_lean;
    BodyAngles { somersault, tilt: 0.0, twist: TAU * dive.twists }
}

/// Those that are constraints, rad: somersault, tilt and twist, or the first alone.
pub(super) fn targets(dive: &Dive) -> Vec<f64> {
    let BodyAngles { somersault, tilt, twist } = requested(dive);
    match dive.diver.dimension {
        Dimension::Planar => vec![somersault],
        Dimension::Spatial => vec![somersault, tilt, twist],
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
