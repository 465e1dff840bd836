//! A dive as a nonlinear program.

use super::bounds::bezier_points;
use super::clearance::ClearanceRows;
use super::cost::Quadratic;
use super::{Channels, Dive, DiveError, Range};
use crate::flight::{BodyAngles, Counting, NodeDerivatives, OrientationPath};
use crate::motion::{MotionError, SplineMotion};
use crate::nlp::{Bounds, Curvature, EvaluationError, Nlp, Pattern, Structure};
use nalgebra::{DVector, UnitQuaternion, Vector3};
use somersault_multibody::models::Dimension;
use somersault_multibody::{Data, DynamicsError, Model};
use std::f64::consts::TAU;

/// A [`Dive`] as a program for the [solvers](crate::nlp).
///
/// z holds the free spline parameters, then L/L₀, lean and duration, where these are no fixed numbers. Constraints are
/// the bounds of the channels (linear), the angles at the entry, and clearances.
#[derive(Debug, Clone)]
pub struct DiveProgram {
    dive: Dive,
    path: OrientationPath,
    counting: Counting,
    /// L₀.
    momentum_unit: f64,
    /// The spline parameters that are free; the others are zero.
    free: Vec<usize>,
    /// Where z has each spline parameter.
    column_of: Vec<Option<usize>>,
    square_out: usize,
    extra: Extra,
    structure: Structure,
    /// Of rates and second rates, and what their penalties are multiplied by.
    rates: [Quadratic; 2],
    rate_unit: f64,
    linear: Vec<LinearRow>,
    /// The Jacobian with all that is constant.
    jacobian: Vec<f64>,
    clearance: Option<ClearanceRows>,
    soft: Option<Soft>,
    node: NodeDerivatives,
    angle_rows: [Vec<f64>; 3],
    coefficients: Vec<f64>,
    by_coefficient: Vec<f64>,
    parameters: Vec<f64>,
    row: Vec<f64>,
}

/// Where z has what is not a spline parameter.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
struct Extra {
    momentum: Option<usize>,
    lean: Option<usize>,
    duration: Option<usize>,
}

/// Entry and clearances as costs ½ μ Σ violation² instead of constraints.
#[derive(Debug, Clone)]
struct Soft {
    /// μ.
    weight: f64,
    /// The bounds that are violated.
    bounds: Bounds,
    /// Violations and the Jacobian at the last point.
    violations: Vec<f64>,
    jacobian: Vec<f64>,
}

/// Σ factors z, without the constant that its bounds have taken in.
#[derive(Debug, Clone, PartialEq)]
struct LinearRow {
    factors: Vec<(usize, f64)>,
}

/// What is below this in a row does not depend on the parameters.
const NO_DEPENDENCE: f64 = 1e-12;

impl DiveProgram {
    pub(super) fn try_new(dive: &Dive) -> Result<Self, DiveError> {
        dive.check()?;
        let model = dive.diver.model()?;
        let motion = dive.motion(&model)?;
        let counting = Counting { axes: long_axis(dive, &model)? };
        let momentum_unit = dive.diver.mass * dive.diver.height.powi(2);
        let free = free_parameters(dive, &motion)?;
        let mut column_of = vec![None; motion.n_parameters()];
        free.iter().enumerate().for_each(|(column, p)| column_of[*p] = Some(column));
        let mut variables = Bounds::free(free.len());
        let mut add = |range: Range, unit: f64| {
            if range.is_fixed() {
                return None;
            }
            variables.push(range.lower / unit, range.upper / unit);
            Some(variables.len() - 1)
        };
        let extra = Extra {
            momentum: add(dive.momentum, momentum_unit),
            lean: add(dive.lean, 1.0),
            duration: add(dive.duration, 1.0),
        };
        let n_z = variables.len();
        let mut constraints = Bounds::default();
        let linear = channel_rows(dive, &model, &motion, &column_of, &mut constraints);
        let mut entries = Vec::new();
        for (row, LinearRow { factors }) in linear.iter().enumerate() {
            entries.extend(factors.iter().map(|(column, _)| (row, *column)));
        }
        for target in targets(dive) {
            let row = constraints.len();
            constraints.push(target, target);
            entries.extend((0..n_z).map(|column| (row, column)));
        }
        let clearance = match (dive.diver.dimension, dive.clearance) {
            (Dimension::Spatial, Some(clearance)) => {
                let rows =
                    ClearanceRows::try_new(dive, &model, &motion, &column_of, clearance, constraints.len())?;
                (0..rows.n_rows()).for_each(|_| constraints.push(clearance.distance, f64::INFINITY));
                entries.extend(rows.entries(&column_of));
                Some(rows)
            }
            _ => None,
        };
        let pattern = Pattern::from_entries(constraints.len(), n_z, entries);
        let mut jacobian = vec![0.0; pattern.n_entries()];
        for (row, LinearRow { factors }) in linear.iter().enumerate() {
            for (column, factor) in factors {
                jacobian[pattern.position(row, *column).unwrap_or_default()] = *factor;
            }
        }
        let rate_unit = match dive.channels {
            Channels::Weights => 1.0,
            Channels::Joints => {
                let [first, second] = [0, 1].map(|i| DVector::from_column_slice(&dive.postures[i]));
                1.0 / (second - first).norm_squared()
            }
        };
        let program = Self {
            counting,
            momentum_unit,
            extra,
            rates: [1, 2].map(|derivative| Quadratic::of_rate(&motion, &free, derivative)),
            rate_unit,
            linear,
            jacobian,
            clearance,
            soft: None,
            node: NodeDerivatives::new(motion.n_coefficients()),
            angle_rows: [0; 3].map(|_| vec![0.0; n_z]),
            coefficients: vec![0.0; motion.n_coefficients()],
            by_coefficient: vec![0.0; motion.n_coefficients()],
            parameters: vec![0.0; motion.n_parameters()],
            row: vec![0.0; motion.n_parameters()],
            free,
            column_of,
            square_out: 0,
            structure: Structure {
                variables,
                constraints,
                jacobian: pattern,
                hessian: Pattern::upper_triangle(n_z),
            },
            path: OrientationPath::try_new(model, motion, dive.n_steps)?,
            dive: dive.clone(),
        };
        let n_steps = program.path.n_steps();
        let square_out = (dive.square_out * n_steps as f64).round() as usize;
        let path = match dive.diver.dimension {
            Dimension::Spatial if square_out < n_steps => program.path.with_restart(square_out, counting),
            _ => program.path,
        };
        Ok(Self { square_out, path, ..program })
    }

    /// The same with entry and clearances as costs ½ μ Σ violation² (rad², m²): the thesis' soft constraints. What
    /// remains hard are the bounds of the channels, which are linear, so this program is easy from anywhere.
    pub fn softened(&self, weight: f64) -> Result<Self, DiveError> {
        super::error::expect_positive("weight", weight)?;
        let mut program = self.clone();
        let bounds = program.structure.constraints.clone();
        for row in self.linear.len()..bounds.len() {
            program.structure.constraints.lower[row] = f64::NEG_INFINITY;
            program.structure.constraints.upper[row] = f64::INFINITY;
        }
        let violations = vec![0.0; bounds.len()];
        program.soft = Some(Soft { weight, bounds, violations, jacobian: self.jacobian.clone() });
        Ok(program)
    }

    /// Multipliers of entry and clearances that the violations at the last point stand for; zero elsewhere.
    pub(super) fn soft_multipliers(&self) -> Vec<f64> {
        let none = || vec![0.0; self.structure.constraints.len()];
        self.soft.as_ref().map_or_else(none, Soft::multipliers)
    }

    /// The dive.
    pub fn dive(&self) -> &Dive {
        &self.dive
    }

    /// The path of the torso's orientation at the last point that was evaluated.
    pub fn path(&self) -> &OrientationPath {
        &self.path
    }

    /// How angles are counted.
    pub fn counting(&self) -> &Counting {
        &self.counting
    }

    /// L in z, kg m²/s.
    pub fn momentum(&self, z: &[f64]) -> f64 {
        self.extra.momentum.map_or(self.dive.momentum.lower, |k| z[k] * self.momentum_unit)
    }

    /// Lean at take-off in z, rad.
    pub fn lean(&self, z: &[f64]) -> f64 {
        self.extra.lean.map_or(self.dive.lean.lower, |k| z[k])
    }

    /// Duration in z, s.
    pub fn duration(&self, z: &[f64]) -> f64 {
        self.extra.duration.map_or(self.dive.duration.lower, |k| z[k])
    }

    /// The coefficients of the splines for z.
    pub fn coefficients(&self, z: &[f64]) -> Vec<f64> {
        let motion = self.path.motion();
        let mut coefficients = vec![0.0; motion.n_coefficients()];
        let parameter = |column: &Option<usize>| column.map_or(0.0, |k| z[k]);
        let parameters: Vec<f64> = self.column_of.iter().map(parameter).collect();
        motion.coefficients_into(&parameters, &mut coefficients);
        coefficients
    }

    /// The numbers in z that are spline parameters, by their numbers in the motion's.
    pub(super) fn free(&self) -> &[usize] {
        &self.free
    }

    /// L₀.
    pub(super) fn momentum_unit(&self) -> f64 {
        self.momentum_unit
    }

    /// Rotation of the planar torso at the entry, rad.
    pub(super) fn entry_rotation(&self) -> f64 {
        self.counting.axes.euler_angles().1 - targets(&self.dive)[0]
    }

    /// The bounds of the channels: factors of z, lower and upper bound.
    pub(super) fn channel_bounds(&self) -> impl Iterator<Item = (&[(usize, f64)], f64, f64)> {
        let Bounds { lower, upper } = &self.structure.constraints;
        self.linear
            .iter()
            .enumerate()
            .map(|(row, linear)| (linear.factors.as_slice(), lower[row], upper[row]))
    }

    /// What of the clearances there is.
    pub(super) fn clearance(&self) -> Option<&ClearanceRows> {
        self.clearance.as_ref()
    }

    /// z with everything in the middle of its range, splines at their offset.
    pub(super) fn middle(&self) -> Vec<f64> {
        let Bounds { lower, upper } = &self.structure.variables;
        let middle = |(l, u): (&f64, &f64)| if l.is_finite() && u.is_finite() { 0.5 * (l + u) } else { 0.0 };
        lower.iter().zip(upper).map(middle).collect()
    }

    /// Sets the momentum in `z` so that the somersaults come out, to a tenth of a degree, if it can.
    pub(super) fn aim(&mut self, z: &mut [f64]) -> Result<(), DiveError> {
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
    pub(super) fn fly(&mut self, z: &[f64], with_derivatives: bool) -> Result<(), DiveError> {
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
    fn entry_angles(&self) -> [f64; 3] {
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
    fn entry_gradients(&self) -> [(usize, Vector3<f64>); 3] {
        let n_steps = self.path.n_steps();
        if self.path.is_planar() {
            return [(n_steps, -Vector3::z()), (0, Vector3::zeros()), (0, Vector3::zeros())];
        }
        let at = |node: usize| self.counting.gradients(self.path.arrival(node));
        let [_, tilt, twist] = at(self.square_out);
        [(n_steps, at(n_steps)[0]), (self.square_out, tilt), (self.square_out, twist)]
    }

    /// Angles at entry and square-out that are constraints.
    fn n_angles(&self) -> usize {
        if self.path.is_planar() { 1 } else { 3 }
    }

    /// The gradients of these angles by z, for the last flight.
    fn angle_gradients(&mut self, z: &[f64], rows: &mut [Vec<f64>; 3]) {
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

    fn cost(&self, z: &[f64], mut gradient: Option<&mut [f64]>) -> f64 {
        let n_p = self.free.len();
        let (p, duration) = (&z[..n_p], self.duration(z));
        let penalties = &self.dive.penalties;
        let momentum = self.momentum(z) / self.momentum_unit;
        let mut cost = 0.5 * penalties.momentum * momentum * momentum;
        if let (Some(gradient), Some(k)) = (&mut gradient, self.extra.momentum) {
            gradient[k] += penalties.momentum * momentum;
        }
        for (quadratic, penalty, power) in
            [(&self.rates[0], penalties.rate, 1), (&self.rates[1], penalties.acceleration, 3)]
        {
            // by the share of the duration: dt = T dx, d/dt = (1/T) d/dx
            let factor = penalty * self.rate_unit * duration.powi(-power);
            let value = factor * quadratic.evaluate(p, factor, gradient.as_deref_mut());
            cost += value;
            if let (Some(gradient), Some(k)) = (&mut gradient, self.extra.duration) {
                gradient[k] -= f64::from(power) * value / duration;
            }
        }
        cost
    }
}

impl Nlp for DiveProgram {
    fn structure(&self) -> &Structure {
        &self.structure
    }

    fn evaluate(&mut self, z: &[f64], constraints: &mut [f64]) -> Result<f64, EvaluationError> {
        self.fly(z, false).map_err(undefined)?;
        for (value, LinearRow { factors }) in constraints.iter_mut().zip(&self.linear) {
            *value = factors.iter().map(|(k, factor)| z[*k] * factor).sum();
        }
        let angles = self.entry_angles();
        let rest = &mut constraints[self.linear.len()..];
        let n_angles = self.n_angles();
        rest[..n_angles].copy_from_slice(&angles[..n_angles]);
        if let Some(clearance) = &mut self.clearance {
            let found = clearance.evaluate(
                self.path.model(),
                self.path.motion(),
                &self.coefficients,
                &mut rest[n_angles..],
            );
            found.map_err(|error| undefined(error.into()))?;
        }
        let mut cost = self.cost(z, None);
        if let Some(soft) = &mut self.soft {
            cost += soft.evaluate(constraints, self.linear.len());
        }
        if cost.is_finite() && constraints.iter().all(|c| c.is_finite()) {
            return Ok(cost);
        }
        Err(EvaluationError::Undefined { what: "the dive".into() })
    }

    fn differentiate(
        &mut self,
        z: &[f64],
        gradient: &mut [f64],
        jacobian: &mut [f64],
    ) -> Result<(), EvaluationError> {
        self.fly(z, true).map_err(undefined)?;
        gradient.fill(0.0);
        self.cost(z, Some(gradient));
        jacobian.copy_from_slice(&self.jacobian);
        let n_angles = self.n_angles();
        let mut rows = std::mem::take(&mut self.angle_rows);
        self.angle_gradients(z, &mut rows);
        let pattern = &self.structure.jacobian;
        for (k, row) in rows.iter().enumerate().take(n_angles) {
            for (column, value) in row.iter().enumerate() {
                jacobian[pattern.position(self.linear.len() + k, column).unwrap_or_default()] = *value;
            }
        }
        self.angle_rows = rows;
        if let Some(clearance) = &mut self.clearance {
            let (model, motion) = (self.path.model(), self.path.motion());
            let found = clearance.differentiate(
                model,
                motion,
                &self.column_of,
                &self.coefficients,
                pattern,
                jacobian,
            );
            found.map_err(|error| undefined(error.into()))?;
        }
        if let Some(soft) = &mut self.soft {
            soft.jacobian.copy_from_slice(jacobian);
            for (column, out) in gradient.iter_mut().enumerate() {
                for k in pattern.columns[column]..pattern.columns[column + 1] {
                    *out += soft.weight * soft.violations[pattern.rows[k]] * jacobian[k];
                }
            }
        }
        Ok(())
    }

    fn curvature(&self) -> Curvature {
        if self.soft.is_some() { Curvature::GaussNewton } else { Curvature::None }
    }

    /// Of the cost, and of the soft constraints after Gauss and Newton.
    fn hessian(
        &mut self,
        z: &[f64],
        cost_factor: f64,
        _multipliers: &[f64],
        hessian: &mut [f64],
    ) -> Result<(), EvaluationError> {
        let n_p = self.free.len();
        let duration = self.duration(z);
        let penalties = &self.dive.penalties;
        hessian.fill(0.0);
        let mut at = 0;
        for j in 0..z.len() {
            for i in 0..=j {
                if j < n_p {
                    hessian[at] = cost_factor
                        * self.rate_unit
                        * (penalties.rate / duration * self.rates[0].matrix[(i, j)]
                            + penalties.acceleration / duration.powi(3) * self.rates[1].matrix[(i, j)]);
                }
                at += 1;
            }
        }
        if let Some(k) = self.extra.momentum {
            hessian[k * (k + 3) / 2] += cost_factor * penalties.momentum;
        }
        if let Some(soft) = &self.soft {
            soft.add_hessian(&self.structure.jacobian, self.linear.len(), cost_factor, hessian);
        }
        Ok(())
    }
}

impl Soft {
    /// What the violations at the last point are as multipliers of constraints.
    fn multipliers(&self) -> Vec<f64> {
        self.violations.iter().map(|v| self.weight * v).collect()
    }

    /// Leaves the violations of the rows from `first` on, and returns what they cost.
    fn evaluate(&mut self, constraints: &[f64], first: usize) -> f64 {
        let Bounds { lower, upper } = &self.bounds;
        for row in first..constraints.len() {
            let value = constraints[row];
            self.violations[row] = (value - upper[row]).max(0.0) + (value - lower[row]).min(0.0);
        }
        0.5 * self.weight * self.violations.iter().map(|v| v * v).sum::<f64>()
    }

    /// μ Jᵀ J of the violated rows.
    fn add_hessian(&self, pattern: &Pattern, first: usize, factor: f64, hessian: &mut [f64]) {
        let n = pattern.n_columns();
        let mut row = vec![0.0; n];
        for violated in (first..pattern.n_rows).filter(|row| self.violations[*row] != 0.0) {
            for (column, value) in row.iter_mut().enumerate() {
                *value = pattern.position(violated, column).map_or(0.0, |k| self.jacobian[k]);
            }
            let mut at = 0;
            for j in 0..n {
                for i in 0..=j {
                    hessian[at] += factor * self.weight * row[i] * row[j];
                    at += 1;
                }
            }
        }
    }
}

fn undefined(error: DiveError) -> EvaluationError {
    EvaluationError::Undefined { what: error.to_string() }
}

/// Angles at the entry, rad: somersault, tilt and twist, or the first alone.
fn targets(dive: &Dive) -> Vec<f64> {
    let somersault = TAU * dive.somersaults + dive.entry_lean;
    match dive.diver.dimension {
        Dimension::Planar => vec![somersault],
        Dimension::Spatial => vec![somersault, 0.0, TAU * dive.twists],
    }
}

/// The body's axes in those of the torso: turned about the lateral axis until z goes from feet to hands.
fn long_axis(dive: &Dive, model: &Model) -> Result<UnitQuaternion<f64>, DynamicsError> {
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

/// The parameters on which no channel depends outside of its window.
fn free_parameters(dive: &Dive, motion: &SplineMotion) -> Result<Vec<usize>, DiveError> {
    if !dive.windows.is_empty() && dive.windows.len() != motion.n_channels() {
        let (expected, found) = (motion.n_channels(), dive.windows.len());
        return Err(MotionError::Length { argument: "windows", expected, found }.into());
    }
    let (n, degree) = (motion.basis().n_coefficients(), motion.basis().degree());
    let n_intervals = motion.basis().n_intervals() as f64;
    let mut is_free = vec![true; motion.n_parameters()];
    for (coefficient, parameter, _) in motion.dependences() {
        let Some(window) = dive.windows.get(coefficient / n) else { continue };
        let j = (coefficient % n) as f64;
        let from = ((j - degree as f64) / n_intervals).max(0.0);
        let to = ((j + 1.0) / n_intervals).min(1.0);
        is_free[parameter] &= from >= window.lower - NO_DEPENDENCE && to <= window.upper + NO_DEPENDENCE;
    }
    Ok((0..is_free.len()).filter(|p| is_free[*p]).collect())
}

/// The bounds of the channels at all times, by their Bézier points.
fn channel_rows(
    dive: &Dive,
    model: &Model,
    motion: &SplineMotion,
    column_of: &[Option<usize>],
    bounds: &mut Bounds,
) -> Vec<LinearRow> {
    let (n, n_channels) = (motion.basis().n_coefficients(), motion.n_channels());
    let mut dependences = vec![Vec::new(); motion.n_coefficients()];
    for (coefficient, parameter, factor) in motion.dependences() {
        if let Some(column) = column_of[parameter] {
            dependences[coefficient].push((column, factor));
        }
    }
    let mut rows = Vec::new();
    let mut dense = vec![0.0; motion.n_parameters()];
    let mut add = |coefficients: &mut dyn Iterator<Item = (usize, f64)>, lower: f64, upper: f64| {
        dense.fill(0.0);
        let mut constant = 0.0;
        for (coefficient, factor) in coefficients {
            constant += factor * motion.offset()[coefficient];
            for (parameter, share) in &dependences[coefficient] {
                dense[*parameter] += factor * share;
            }
        }
        let of_weight = |(_, factor): &(usize, f64)| factor.abs() > NO_DEPENDENCE;
        let factors: Vec<_> = dense.iter().copied().enumerate().filter(of_weight).collect();
        // what the conditions at the ends fix is within its bounds by them
        if !factors.is_empty() {
            rows.push(LinearRow { factors });
            bounds.push(lower - constant, upper - constant);
        }
    };
    let n_root = model.velocities_of(0).len();
    for point in bezier_points(motion.basis(), dive.n_pieces) {
        let of = |channel: usize| {
            let first = channel * n + point.first;
            point.factors.iter().enumerate().map(move |(j, factor)| (first + j, *factor))
        };
        match dive.channels {
            Channels::Weights if n_channels == 1 => add(&mut of(0), 0.0, 1.0),
            Channels::Weights => {
                (0..n_channels).for_each(|channel| add(&mut of(channel), 0.0, f64::INFINITY));
                add(&mut (0..n_channels).flat_map(of), f64::NEG_INFINITY, 1.0);
            }
            Channels::Joints => {
                for body in 1..model.n_bodies() {
                    let Some([lower, upper]) = model.limits(body) else { continue };
                    model.velocities_of(body).for_each(|dof| add(&mut of(dof - n_root), lower, upper));
                }
            }
        }
    }
    rows
}
