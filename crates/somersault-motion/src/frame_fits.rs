//! Fits of single frames, in which smoothed motions and reconstructed flights begin, and the noise that they show.

use crate::fit::{
    BodyScale, FitError, FitOptions, FitStatus, FrameFit, MarkerFit, MarkerSet, Scale, Targets, UnknownStatus,
};
use crate::noise::{MarkerNoise, chi_squared_quantile};
use crate::recording::MarkerRecording;
use nalgebra::{Matrix3, Vector3};
use somersault_core::cancel::CancellationToken;
use somersault_multibody::{Data, Group, Joint, Model};
use std::ops::Range;

/// The fits of all frames.
pub(crate) struct FrameFits {
    frames: Vec<FrameFit>,
    /// The centre of mass in each frame.
    centers: Vec<Vector3<f64>>,
}

/// The noise that single frames show, and coordinates measured beyond the unknowns of the frames.
#[derive(Debug, Clone, Copy)]
pub(crate) struct FrameNoise {
    pub(crate) size: f64,
    pub(crate) n_over: f64,
}

/// Standard deviations by which χ² is a misfit.
const MISFIT: f64 = 5.0;
/// What χ² may differ from 1 by, whatever the noise is: angles at limits, robust losses.
const TOLERANCE: f64 = 0.1;
/// Mass that joints may carry which no marker sees, in fractions of the whole.
const UNSEEN: f64 = 0.1;
/// Noise where nothing is known of it, m.
pub(crate) const UNKNOWN_NOISE: f64 = 0.03;
/// Coordinates that a frame must have beyond its unknowns to say something of the noise.
const LEAST_OVER: usize = 3;
/// Markers without noise have that of rounding, m.
const LEAST_NOISE: f64 = 1e-7;

impl FrameFits {
    pub(crate) fn try_new(
        model: &Model,
        markers: &MarkerSet,
        scale: BodyScale,
        recording: &MarkerRecording,
        token: &CancellationToken,
    ) -> Result<Self, FitError> {
        let scale = match scale {
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
    pub(crate) fn heights(&self, up: &Vector3<f64>) -> Vec<Option<f64>> {
        let height = |(i, center): (usize, &Vector3<f64>)| self.has_markers(i).then(|| center.dot(up));
        self.centers.iter().enumerate().map(height).collect()
    }

    /// Those of a part of the frames.
    pub(crate) fn part(&self, frames: Range<usize>) -> Self {
        Self { frames: self.frames[frames.clone()].to_vec(), centers: self.centers[frames].to_vec() }
    }

    /// Whether frame `i` has markers.
    pub(crate) fn has_markers(&self, i: usize) -> bool {
        self.frames[i].status != FitStatus::NoMarkers
    }

    /// The frame nearest to `fraction` of the duration whose fit is no worse than most.
    pub(crate) fn reference(&self, times: &[f64], fraction: f64) -> usize {
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

    /// The centres of mass.
    pub(crate) fn centers(&self) -> &[Vector3<f64>] {
        &self.centers
    }

    /// The configuration of a frame.
    pub(crate) fn configuration(&self, i: usize) -> &[f64] {
        &self.frames[i].estimate.q
    }

    /// The middle of the sizes of all frames.
    pub(crate) fn scale(&self) -> f64 {
        let mut sizes: Vec<f64> = self.frames.iter().map(|frame| frame.estimate.scale).collect();
        sizes.sort_unstable_by(f64::total_cmp);
        sizes[sizes.len() / 2]
    }

    /// Which channels some marker sees in some frame.
    pub(crate) fn seen(&self, n_channels: usize) -> Vec<bool> {
        let is_seen = |c: usize| {
            let known = |frame: &FrameFit| {
                let at = frame.unknowns.len().checked_sub(n_channels).map(|first| first + c);
                at.and_then(|k| frame.unknowns.get(k)).is_some_and(|s| *s != UnknownStatus::Undetermined)
            };
            self.frames.iter().filter(|frame| frame.status != FitStatus::NoMarkers).any(known)
        };
        (0..n_channels).map(is_seen).collect()
    }

    /// The noise in coordinates along `axes`: the median over the frames of squares over the coordinates beyond the unknowns, so that exchanged markers and
    /// outliers of a few frames do not count. None where no frame has enough of them.
    pub(crate) fn noise(
        &self,
        model: &Model,
        markers: &MarkerSet,
        axes: &[Vector3<f64>],
        points: &[Vec<Option<Vector3<f64>>>],
        weights: &[Vec<f64>],
    ) -> Result<Option<FrameNoise>, FitError> {
        let mut data = Data::new(model);
        let mut found = Vec::new();
        let mut n_over = 0;
        for ((frame, points), weights) in self.frames.iter().zip(points).zip(weights) {
            let n_unknown = frame.unknowns.iter().filter(|s| **s == UnknownStatus::Determined).count();
            let measured = axes.len() * points.iter().flatten().count();
            let over = measured.saturating_sub(n_unknown);
            if over >= LEAST_OVER {
                let positions = model.positions(&mut data, &frame.estimate.q)?;
                let root = positions.pose(0)?.translation;
                let mut squares = 0.0;
                for ((marker, point), weight) in markers.markers().iter().zip(points).zip(weights) {
                    let Some(point) = point else { continue };
                    let arm = positions.pose(marker.body)?.point(&marker.point) - root;
                    let residual = root + arm * frame.estimate.scale - point;
                    let counted: f64 = axes.iter().map(|axis| axis.dot(&residual).powi(2)).sum();
                    squares += marker.weight * weight * counted;
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
}

/// The axes in the world along which a model moves: all, or the two of its plane where its root is planar.
pub(crate) fn axes_of(model: &Model) -> Vec<Vector3<f64>> {
    if model.joint(0).map(Joint::group) == Some(Group::PlanarMotions) {
        let rotation: Matrix3<f64> =
            model.placement(0).map_or_else(Matrix3::identity, |placement| placement.rotation);
        vec![rotation.column(0).into_owned(), rotation.column(1).into_owned()]
    } else {
        vec![Vector3::x(), Vector3::y(), Vector3::z()]
    }
}

/// The frames of `recording` between two times that have some of `markers`: all from the first to the last of them.
pub(crate) fn frames_between(
    markers: &MarkerSet,
    recording: &MarkerRecording,
    (start, end): (f64, f64),
) -> (Range<usize>, usize) {
    let known: Vec<usize> =
        markers.markers().iter().filter_map(|marker| recording.marker(&marker.name).ok()).collect();
    let times = recording.times();
    let shows = |i: &usize| {
        let frame = recording.frame(*i).unwrap_or_default();
        (start..=end).contains(&times[*i]) && known.iter().any(|k| frame[*k].is_some())
    };
    let frames: Vec<usize> = (0..times.len()).filter(shows).collect();
    let range = frames.first().copied().unwrap_or(0)..frames.last().map_or(0, |last| last + 1);
    (range, frames.len())
}

/// χ² per degree of freedom and where it must lie: of `squares` of residuals under the noise `found`, with `n_over` coordinates beyond the
/// unknowns, against the noise that was given or that of single frames, of which the motion may leave `followed`, m.
pub(crate) fn chi_squared(
    given: Option<MarkerNoise>,
    of_frames: Option<FrameNoise>,
    found: MarkerNoise,
    times: &[f64],
    squares: f64,
    n_over: f64,
    followed: f64,
) -> (Option<f64>, [f64; 2]) {
    // how many times fewer frames are independent
    let spacing = (times[times.len() - 1] - times[0]) / (times.len() - 1) as f64;
    let repeats = 1.0 + found.correlated.powi(2) * found.time / spacing;
    let variance = 2.0 / n_over.max(1.0);
    let (reference, least, variance) = match (given, of_frames) {
        (Some(given), _) => (Some(given.size), 1.0, variance),
        (None, Some(FrameNoise { size, n_over })) => {
            let whole = size.hypot(followed);
            (Some(whole), (size / whole).powi(2), variance + 2.0 * repeats / n_over)
        }
        (None, None) => (None, 1.0, variance),
    };
    let width = TOLERANCE + MISFIT * variance.sqrt();
    let per_degree = reference.map(|size| squares / n_over.max(1.0) * (found.size / size).powi(2));
    (per_degree, [(1.0 - width).max(0.0) * least, 1.0 + width])
}

/// Whether the degrees of freedom `unseen`, which no marker sees, carry more than a tenth of the mass.
pub(crate) fn carry_much(model: &Model, unseen: &[usize]) -> bool {
    let moves = |i: usize| unseen.iter().any(|k| model.velocities_of(i).contains(k));
    let mut is_carried = vec![false; model.n_bodies()];
    for i in 1..model.n_bodies() {
        is_carried[i] = moves(i) || model.parent(i).is_some_and(|parent| is_carried[parent]);
    }
    let links = model.links().iter().zip(is_carried).filter(|(_, is_carried)| *is_carried);
    links.map(|(link, _)| link.mass_properties().mass).sum::<f64>() > UNSEEN * model.mass()
}

/// For each frame the place of each marker that it has.
pub(crate) type Points = Vec<Vec<Option<Vector3<f64>>>>;

/// The points of all frames, and their weights in the recording.
pub(crate) fn points_and_weights(targets: &[Targets]) -> (Points, Vec<Vec<f64>>) {
    let points = |frame: &Targets| frame.iter().map(|y| Some((*y)?.point)).collect();
    let weights = |frame: &Targets| frame.iter().map(|y| y.map_or(1.0, |y| y.weight)).collect();
    (targets.iter().map(points).collect(), targets.iter().map(weights).collect())
}
