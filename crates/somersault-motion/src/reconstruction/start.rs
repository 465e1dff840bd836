//! Where a reconstruction begins: fits of single frames, which know no law of flight.

use super::attitude::read_orientation;
use super::joints::JointSplines;
use super::normal::Observed;
use super::unknowns::{Estimate, Layout};
use super::{BodyScale, ReconstructionError, ReconstructionOptions};
use crate::fit::{FitOptions, FitStatus, FrameFit, MarkerFit, MarkerSet, Scale, UnknownStatus};
use crate::noise::chi_squared_quantile;
use crate::recording::MarkerRecording;
use nalgebra::Vector3;
use somersault_core::cancel::CancellationToken;
use somersault_core::lie::so3;
use somersault_multibody::{Data, Model};
use std::ops::Range;

/// The fits of all frames.
pub(super) struct FrameFits {
    frames: Vec<FrameFit>,
    /// Root, and centre of mass, in each frame.
    centers: Vec<Vector3<f64>>,
}

/// The noise that single frames show, and coordinates measured beyond the unknowns of the frames.
#[derive(Debug, Clone, Copy)]
pub(super) struct FrameNoise {
    pub(super) size: f64,
    pub(super) n_over: f64,
}

/// Coordinates that a frame must have beyond its unknowns to say something of the noise.
const LEAST_OVER: usize = 3;
/// Markers without noise have that of rounding, m.
const LEAST_NOISE: f64 = 1e-7;
/// Half of the time over which velocities are estimated, s.
const SPAN: f64 = 0.05;
/// And of that over which the centre of mass is.
const WIDE_SPAN: f64 = 0.25;

impl FrameFits {
    pub(super) fn try_new(
        model: &Model,
        markers: &MarkerSet,
        options: &ReconstructionOptions,
        recording: &MarkerRecording,
        token: &CancellationToken,
    ) -> Result<Self, ReconstructionError> {
        let scale = match options.scale {
            BodyScale::Known(size) => Scale::Fixed(size),
            BodyScale::Sought { mean, deviation } => {
                Scale::PerFrame { lower: mean - 3.0 * deviation, upper: mean + 3.0 * deviation }
            }
        };
        let options = FitOptions { scale, max_iterations: 100, ..FitOptions::default() };
        let fit = MarkerFit::try_new(model, markers.clone(), options)?.fit_cancellable(recording, token)?;
        let mut data = Data::new(model);
        let mut centers = Vec::with_capacity(fit.frames.len());
        for frame in &fit.frames {
            let positions = model.positions(&mut data, &frame.estimate.q)?;
            let root = positions.pose(0)?.translation;
            centers.push(root + (positions.center_of_mass() - root) * frame.estimate.scale);
        }
        Ok(Self { frames: fit.frames, centers })
    }

    /// Heights of the centre of mass along `up`; none where no marker was seen.
    pub(super) fn heights(&self, up: &Vector3<f64>) -> Vec<Option<f64>> {
        let height = |(i, center): (usize, &Vector3<f64>)| self.has_markers(i).then(|| center.dot(up));
        self.centers.iter().enumerate().map(height).collect()
    }

    /// Those of a part of the frames.
    pub(super) fn part(&self, frames: Range<usize>) -> Self {
        Self { frames: self.frames[frames.clone()].to_vec(), centers: self.centers[frames].to_vec() }
    }

    fn has_markers(&self, i: usize) -> bool {
        self.frames[i].status != FitStatus::NoMarkers
    }

    /// The frame nearest to `fraction` of the duration whose fit is no worse than most.
    pub(super) fn reference(&self, times: &[f64], fraction: f64) -> usize {
        let middle = times[0] + fraction * (times[times.len() - 1] - times[0]);
        let mut costs: Vec<f64> =
            (0..times.len()).filter(|i| self.has_markers(*i)).map(|i| self.frames[i].cost).collect();
        costs.sort_unstable_by(f64::total_cmp);
        let usual = costs.get(costs.len() / 2).copied().unwrap_or(0.0) * 1.5;
        let of = |i: &usize| (times[*i] - middle).abs();
        let all = (0..times.len()).filter(|i| self.has_markers(*i));
        let good = all.clone().filter(|i| self.frames[*i].cost <= usual);
        good.min_by(|a, b| of(a).total_cmp(&of(b))).unwrap_or(times.len() / 2)
    }

    /// The configuration of a frame.
    pub(super) fn configuration(&self, i: usize) -> &[f64] {
        &self.frames[i].estimate.q
    }

    /// The middle of the sizes of all frames.
    pub(super) fn scale(&self) -> f64 {
        let mut sizes: Vec<f64> = self.frames.iter().map(|frame| frame.estimate.scale).collect();
        sizes.sort_unstable_by(f64::total_cmp);
        sizes[sizes.len() / 2]
    }

    /// Which channels some marker sees in some frame.
    pub(super) fn seen(&self, n_channels: usize) -> Vec<bool> {
        let is_seen = |c: usize| {
            let known = |frame: &FrameFit| {
                let at = frame.unknowns.len().checked_sub(n_channels).map(|first| first + c);
                at.and_then(|k| frame.unknowns.get(k)).is_some_and(|s| *s != UnknownStatus::Undetermined)
            };
            self.frames.iter().filter(|frame| frame.status != FitStatus::NoMarkers).any(known)
        };
        (0..n_channels).map(is_seen).collect()
    }

    /// The noise: the median over the frames of squares over the coordinates beyond the unknowns, so that exchanged markers and
    /// outliers of a few frames do not count. None where no frame has enough of them.
    pub(super) fn noise(
        &self,
        model: &Model,
        markers: &MarkerSet,
        layout: &Layout,
        observed: &Observed,
    ) -> Result<Option<FrameNoise>, ReconstructionError> {
        let mut data = Data::new(model);
        let mut found = Vec::new();
        let mut n_over = 0;
        for ((frame, points), weights) in self.frames.iter().zip(&observed.points).zip(&observed.weights) {
            let n_unknown = frame.unknowns.iter().filter(|s| **s == UnknownStatus::Determined).count();
            let measured = layout.dimension() * points.iter().flatten().count();
            let over = measured.saturating_sub(n_unknown);
            if over >= LEAST_OVER {
                let positions = model.positions(&mut data, &frame.estimate.q)?;
                let root = positions.pose(0)?.translation;
                let mut squares = 0.0;
                for ((marker, point), weight) in markers.markers().iter().zip(points).zip(weights) {
                    let Some(point) = point else { continue };
                    let arm = positions.pose(marker.body)?.point(&marker.point) - root;
                    let residual = root + arm * frame.estimate.scale - point;
                    squares += marker.weight * weight * layout.within(&residual).norm_squared();
                }
                let median = chi_squared_quantile(over, 0.0);
                found.push(squares / (over as f64 * median));
                n_over += over;
            }
        }
        found.sort_unstable_by(f64::total_cmp);
        let size = found.get(found.len() / 2).map(|squared| squared.sqrt().max(LEAST_NOISE));
        Ok(size.map(|size| FrameNoise { size, n_over: n_over as f64 }))
    }

    /// Where the search begins: joints at rest as in the reference frame, the momentum of a rigid body that turns as the root does
    /// about that frame, the centre of mass on the parabola nearest to those of the frames around.
    pub(super) fn estimate(
        &self,
        model: &Model,
        splines: &JointSplines,
        is_planar: bool,
        times: &[f64],
        reference: usize,
    ) -> Result<Estimate, ReconstructionError> {
        let q = self.configuration(reference);
        let orientation = |q: &[f64]| read_orientation(is_planar, q);
        let near = |span: f64| {
            let is_near = move |i: &usize| (times[*i] - times[reference]).abs() <= span;
            (0..times.len()).filter(is_near).filter(|i| self.has_markers(*i))
        };
        // the mean rate of turning, by least squares over the frames around, in axes of the root
        let (mut turned, mut squares) = (Vector3::zeros(), 0.0);
        for i in near(SPAN) {
            let t = times[i] - times[reference];
            let turn = so3::log(&(orientation(q).inverse() * orientation(self.configuration(i))));
            turned += turn * t;
            squares += t * t;
        }
        let rate: Vector3<f64> = if squares > 0.0 { turned / squares } else { Vector3::zeros() };
        let mut v = vec![0.0; model.n_velocities()];
        let rates = model.velocities_of(0);
        let angular = if is_planar { &rate.as_slice()[2..] } else { rate.as_slice() };
        v[rates.end - angular.len()..rates.end].copy_from_slice(angular);
        let mut data = Data::new(model);
        let momentum = model.centroidal(&mut data, q)?.momentum(&v)?.angular;
        // the line through c − ½ g t²
        let (mut n, mut sum, mut squares) = (0.0, 0.0, 0.0);
        let mut right = [Vector3::zeros(); 2];
        for i in near(WIDE_SPAN) {
            let t = times[i] - times[reference];
            let point = self.centers[i] - model.gravity() * (0.5 * t * t);
            n += 1.0;
            sum += t;
            squares += t * t;
            right[0] += point;
            right[1] += point * t;
        }
        let determinant = n * squares - sum * sum;
        let (center, velocity) = if determinant > 0.0 {
            let center = (right[0] * squares - right[1] * sum) / determinant;
            (center, (right[1] * n - right[0] * sum) / determinant)
        } else {
            (self.centers[reference], Vector3::zeros())
        };
        Ok(Estimate {
            orientation: orientation(q),
            momentum,
            center,
            velocity,
            scale: self.scale(),
            gravity: 1.0,
            coefficients: splines.at_rest(q),
        })
    }
}
