//! A dive as a nonlinear program.

mod angles;
mod channels;
mod curvature;
mod nlp;
mod soft;

use crate::clearance::ClearanceRows;
use crate::cost::Quadratic;
use crate::flight::{OrientationPath, PathGradient};
use crate::{Channels, Dive, DiveError, Range};
pub(crate) use angles::requested;
use angles::{long_axis, targets};
use channels::{LinearRow, channel_rows, within_windows};
pub(crate) use curvature::entry;
use nalgebra::{DVector, Vector3};
use soft::Soft;
use somersault_core::argument::expect_positive;
use somersault_multibody::counting::Counting;
use somersault_multibody::models::Dimension;
use somersault_nlp::{Bounds, Pattern, Structure};

/// A [`Dive`] as a program for the [solvers](somersault_nlp).
///
/// z holds the parameters of the splines, then L/L₀, lean and duration, where these are no fixed numbers. Constraints are
/// the bounds of the channels (linear), the angles at the entry, and clearances.
#[derive(Debug, Clone)]
pub struct DiveProgram {
    dive: Dive,
    path: OrientationPath,
    counting: Counting,
    /// L₀.
    momentum_unit: f64,
    square_out: usize,
    extra: Extra,
    structure: Structure,
    /// Of rates and second rates, and what their penalties are multiplied by.
    rates: [Quadratic; 2],
    rate_unit: f64,
    linear: Vec<LinearRow>,
    /// Fractions of the duration at which clearances are constraints beside the equidistant ones.
    added: Vec<f64>,
    /// Where the Jacobian has the gradients of the angles, row by row.
    angle_places: Vec<usize>,
    /// The Jacobian with all that is constant.
    jacobian: Vec<f64>,
    /// The Jacobian at the last point.
    last: Vec<f64>,
    clearance: Option<ClearanceRows>,
    soft: Option<Soft>,
    by_nodes: Vec<Vector3<f64>>,
    path_gradient: PathGradient,
    coefficients: Vec<f64>,
    angle_row: Vec<f64>,
}

/// Where z has what is not a spline parameter.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
struct Extra {
    momentum: Option<usize>,
    lean: Option<usize>,
    duration: Option<usize>,
}

impl Dive {
    /// The program to be solved.
    pub fn program(&self) -> Result<DiveProgram, DiveError> {
        DiveProgram::try_new(self)
    }
}

impl DiveProgram {
    fn try_new(dive: &Dive) -> Result<Self, DiveError> {
        dive.check()?;
        Self::with_times(dive, Vec::new())
    }

    /// The same, with clearances as constraints at the given fractions of the duration, too.
    pub(crate) fn with_clearance_at(&self, fractions: &[f64]) -> Result<Self, DiveError> {
        Self::with_times(&self.dive, [&self.added, fractions].concat())
    }

    /// Fractions of the duration at which clearances are constraints beside the equidistant ones.
    pub(crate) fn added(&self) -> &[f64] {
        &self.added
    }

    fn with_times(dive: &Dive, added: Vec<f64>) -> Result<Self, DiveError> {
        let model = dive.diver.model()?;
        let motion = within_windows(dive, dive.motion(&model)?)?;
        let counting = Counting { axes: long_axis(dive, &model)? };
        let momentum_unit = dive.diver.mass * dive.diver.height.powi(2);
        let mut variables = Bounds::free(motion.n_parameters());
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
        let linear = channel_rows(dive, &model, &motion, &mut constraints);
        let of_row = |(row, LinearRow { factors }): (usize, &LinearRow)| {
            factors.iter().map(move |(column, _)| (row, *column)).collect::<Vec<_>>()
        };
        let linear_entries = linear.iter().enumerate().flat_map(of_row).collect();
        let mut angular_entries = Vec::new();
        for target in targets(dive) {
            let row = constraints.len();
            constraints.push(target, target);
            angular_entries.extend((0..n_z).map(|column| (row, column)));
        }
        let mut clearance = match (dive.diver.dimension, dive.clearance) {
            (Dimension::Spatial, Some(clearance)) => {
                let first_row = constraints.len();
                let rows = ClearanceRows::try_new(dive, &model, &motion, clearance, &added, first_row)?;
                rows.bounds().for_each(|least| constraints.push(least, f64::INFINITY));
                Some(rows)
            }
            (Dimension::Spatial, None) | (Dimension::Planar, _) => None,
        };
        let clearance_entries = clearance.iter().flat_map(ClearanceRows::entries).collect();
        let lists = [linear_entries, angular_entries, clearance_entries];
        let (pattern, [linear_places, angle_places, clearance_places]) =
            Pattern::with_places_of(constraints.len(), n_z, lists);
        let mut jacobian = vec![0.0; pattern.n_entries()];
        let factors = linear.iter().flat_map(|row| &row.factors);
        linear_places.iter().zip(factors).for_each(|(place, (_, factor))| jacobian[*place] = *factor);
        if let Some(rows) = &mut clearance {
            rows.set_places(clearance_places);
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
            rates: [1, 2].map(|derivative| Quadratic::of_rate(&motion, derivative)),
            rate_unit,
            linear,
            added,
            angle_places,
            last: jacobian.clone(),
            jacobian,
            clearance,
            soft: None,
            by_nodes: Vec::new(),
            path_gradient: PathGradient::new(motion.n_coefficients()),
            coefficients: vec![0.0; motion.n_coefficients()],
            angle_row: vec![0.0; n_z],
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
            Dimension::Spatial if square_out < n_steps => {
                program.path.with_restart(square_out, counting, requested(dive).twist)
            }
            Dimension::Spatial | Dimension::Planar => program.path,
        };
        let by_nodes = vec![Vector3::zeros(); n_steps + 1];
        Ok(Self { square_out, path, by_nodes, ..program })
    }

    /// The same with entry and clearances as costs ½ μ Σ violation² (rad², m²): the thesis' soft constraints. What
    /// remains hard are the bounds of the channels, which are linear, so this program is easy from anywhere.
    pub fn softened(&self, weight: f64) -> Result<Self, DiveError> {
        expect_positive("weight", weight)?;
        let mut program = self.clone();
        let bounds = program.structure.constraints.clone();
        for row in self.linear.len()..bounds.len() {
            program.structure.constraints.lower[row] = f64::NEG_INFINITY;
            program.structure.constraints.upper[row] = f64::INFINITY;
        }
        let violations = vec![0.0; bounds.len()];
        program.soft = Some(Soft { weight, bounds, violations });
        Ok(program)
    }

    /// Multipliers of entry and clearances that the violations at the last point stand for; zero elsewhere.
    pub(crate) fn soft_multipliers(&self) -> Vec<f64> {
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
        motion.coefficients_into(&z[..motion.n_parameters()], &mut coefficients);
        coefficients
    }

    /// L₀.
    pub(crate) fn momentum_unit(&self) -> f64 {
        self.momentum_unit
    }

    /// Rotation of the planar torso at the entry, rad.
    pub(crate) fn entry_rotation(&self) -> f64 {
        self.counting.axes.euler_angles().1 - targets(&self.dive)[0]
    }

    /// The bounds of the channels: factors of z, lower and upper bound.
    pub(crate) fn channel_bounds(&self) -> impl Iterator<Item = (&[(usize, f64)], f64, f64)> {
        let Bounds { lower, upper } = &self.structure.constraints;
        self.linear
            .iter()
            .enumerate()
            .map(|(row, linear)| (linear.factors.as_slice(), lower[row], upper[row]))
    }

    /// What of the clearances there is.
    pub(crate) fn clearance(&self) -> Option<&ClearanceRows> {
        self.clearance.as_ref()
    }
}
