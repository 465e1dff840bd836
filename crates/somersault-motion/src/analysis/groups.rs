//! Groups of motions side by side: the four panels of Figure 4.1.

use super::{AnalysisError, expect_finite};
use crate::fit::MotionFit;
use crate::recording::{CubicSpline, uniform_times};
use nalgebra::{DMatrix, UnitQuaternion, Vector1, Vector3};
use somersault_core::argument::{ArgumentError, expect_least, expect_length};
use somersault_core::lie::so3;
use somersault_multibody::counting::Counting;
use somersault_multibody::{Group, Joint, Model};

/// Mean and spread of a group at each frame.
#[derive(Debug, Clone, PartialEq)]
pub struct Band {
    /// Mean over the motions.
    pub mean: Vec<f64>,
    /// Standard deviation over the motions, with n − 1 in the denominator; zero for a single motion.
    pub deviation: Vec<f64>,
}

impl Band {
    /// Of `series`, a row for each motion and a column for each frame.
    pub fn of(series: &DMatrix<f64>) -> Result<Self, AnalysisError> {
        let n = series.nrows();
        expect_least("series", n, 1)?;
        expect_finite("series", series)?;
        let mean: Vec<f64> = series.column_iter().map(|c| c.mean()).collect();
        let square = |(c, mean): (nalgebra::DVectorView<f64>, &f64)| c.map(|x| (x - mean).powi(2)).sum();
        let deviation = series.column_iter().zip(&mean).map(square);
        let deviation = deviation.map(|sum: f64| (sum / (n.max(2) - 1) as f64).sqrt()).collect();
        Ok(Self { mean, deviation })
    }
}

/// A quantity of all frames, brought to `n_frames` by a cubic spline: motions of any duration become
/// comparable.
pub fn normalize_frames(times: &[f64], values: &[f64], n_frames: usize) -> Result<Vec<f64>, AnalysisError> {
    expect_length("values", values.len(), times.len())?;
    expect_least("n_frames", n_frames, 1)?;
    expect_least("times", times.len(), 1)?;
    expect_finite("values", &DMatrix::from_column_slice(values.len(), 1, values))?;
    let points = values.iter().map(|x| Vector1::new(*x)).collect();
    let spline = CubicSpline::try_new(times.to_vec(), points)?;
    Ok(uniform_times(times, n_frames).into_iter().map(|t| spline.evaluate(t)[0]).collect())
}

/// Somersaults since the first frame, in turns, forwards positive.
///
/// Of a planar root that is its angle. Of a floating one it is ψ of R = R_z(heading) R_y(ψ) R_x(τ) R_z(φ),
/// counted with its whole turns ([`Counting`]): about the horizontal axis that was lateral in the first frame,
/// whatever the twist φ. Frames must be less than a half turn apart, and the tilt τ off ±π/2, as it is not in a
/// sideflip. None for other roots. Fails where a configuration is not the model's.
pub fn somersaults(model: &Model, configurations: &[&[f64]]) -> Result<Option<Vec<f64>>, AnalysisError> {
    const TURN: f64 = std::f64::consts::TAU;
    let is_planar = match model.joint(0).map(Joint::group) {
        Some(Group::PlanarMotions) => true,
        Some(Group::Motions) => false,
        Some(Group::Vector | Group::Rotations) | None => return Ok(None),
    };
    for (row, q) in configurations.iter().enumerate() {
        expect_length("numbers of a configuration", q.len(), model.n_positions())?;
        if !q.iter().all(|x| x.is_finite()) {
            return Err(AnalysisError::NonFinite { argument: "q", row });
        }
        if !is_planar {
            let found = q[3..7].iter().fold(0.0_f64, |norm, x| norm.hypot(*x));
            if (found - 1.0).abs() > 1e-6 {
                return Err(AnalysisError::NotARotation { row, found });
            }
        }
    }
    let rotation = |q: &&[f64]| so3::from_xyzw(&q[3..7]);
    if is_planar {
        // the planar diver's angle is positive backwards
        let first = configurations.first().map_or(0.0, |q| q[2]);
        return Ok(Some(configurations.iter().map(|q| (first - q[2]) / TURN).collect()));
    }
    let lateral = configurations.first().map_or(Vector3::y(), |q| rotation(q) * Vector3::y());
    let heading = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), (-lateral.x).atan2(lateral.y));
    let orientations: Vec<_> = configurations.iter().map(|q| heading.inverse() * rotation(q)).collect();
    let angles = Counting::default().along(&orientations);
    let first = angles.first().map_or(0.0, |a| a.somersault);
    Ok(Some(angles.iter().map(|a| (a.somersault - first) / TURN).collect()))
}

/// A quantity of Figure 4.1.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Panel {
    /// (a) An eigenweight by its number.
    Eigenweight(usize),
    /// (b) Root mean square of the distances of markers, m.
    MarkerError,
    /// (c) Scale of the model.
    Scale,
    /// (d) Somersaults, in turns. The caption of the thesis' panel says "scaling factor".
    Rotation,
}

/// A group of fitted motions, with the same number of frames each.
#[derive(Debug, Clone, PartialEq)]
pub struct GroupComparison {
    n_frames: usize,
    groups: Vec<Vec<Vec<f64>>>,
    panel: Panel,
}

impl GroupComparison {
    /// One panel for `groups` of motions fitted by `model`, normalised to `n_frames`. Frames without markers
    /// are left out.
    pub fn try_new(
        model: &Model,
        groups: &[&[&MotionFit]],
        panel: Panel,
        n_frames: usize,
    ) -> Result<Self, AnalysisError> {
        let series = |group: usize, motion: usize| -> Result<Vec<f64>, AnalysisError> {
            let number = motion;
            let motion = groups[group][motion];
            let seen = || motion.frames.iter().filter(|f| f.rms.is_some());
            let times: Vec<f64> = (motion.times.iter().zip(&motion.frames))
                .filter(|(_, f)| f.rms.is_some())
                .map(|(t, _)| *t)
                .collect();
            if times.is_empty() {
                return Err(AnalysisError::NothingSeen { group, motion: number });
            }
            let values: Vec<f64> = match panel {
                Panel::Eigenweight(k) => {
                    let weights = seen().map(|f| f.estimate.weights.get(k).copied());
                    let found = motion.frames.first().map_or(0, |f| f.estimate.weights.len());
                    let least = k + 1;
                    weights.collect::<Option<_>>().ok_or(ArgumentError::TooFew {
                        argument: "weights",
                        least,
                        found,
                    })?
                }
                Panel::MarkerError => seen().filter_map(|f| f.rms).collect(),
                Panel::Scale => seen().map(|f| f.estimate.scale).collect(),
                Panel::Rotation => {
                    let all: Vec<&[f64]> = seen().map(|f| f.estimate.q.as_slice()).collect();
                    somersaults(model, &all)?.ok_or(AnalysisError::Held)?
                }
            };
            normalize_frames(&times, &values, n_frames)
        };
        let of = |group: usize| (0..groups[group].len()).map(|motion| series(group, motion)).collect();
        let groups = (0..groups.len()).map(of).collect::<Result<_, _>>()?;
        Ok(Self { n_frames, groups, panel })
    }

    /// From the series of its groups, a row for each motion and a column for each frame, as [`series`](Self::series) gives them.
    pub fn from_series(series: &[DMatrix<f64>], panel: Panel) -> Result<Self, AnalysisError> {
        let n_frames = series.first().map_or(0, DMatrix::ncols);
        expect_least("series", n_frames, 1)?;
        for group in series {
            expect_length("columns of series", group.ncols(), n_frames)?;
            expect_finite("series", group)?;
        }
        let rows = |group: &DMatrix<f64>| group.row_iter().map(|row| row.iter().copied().collect()).collect();
        Ok(Self { n_frames, groups: series.iter().map(rows).collect(), panel })
    }

    /// What is compared.
    pub fn panel(&self) -> Panel {
        self.panel
    }

    /// The motions of each group, a row each.
    pub fn series(&self) -> impl ExactSizeIterator<Item = DMatrix<f64>> {
        let n = self.n_frames;
        self.groups.iter().map(move |group| DMatrix::from_fn(group.len(), n, |i, j| group[i][j]))
    }

    /// Mean and spread of each group.
    pub fn bands(&self) -> Result<Vec<Band>, AnalysisError> {
        self.series().map(|series| Band::of(&series)).collect()
    }
}
