//! What is smoothed, and whether the minimum is a motion.

use super::channels::{Channels, State};
use super::motion::{SmoothedFrame, SmoothedMotion, SmoothingStatus};
use super::search::{DAMPING, Posterior, ROUGHNESS, Search};
use super::{SmoothingError, SmoothingOptions};
use crate::fit::{BodyScale, FitOptions, MarkerFit, MarkerSet};
use crate::frame_fits::{
    FrameFits, FrameNoise, UNKNOWN_NOISE, axes_of, carry_much, chi_squared, frames_between,
    points_and_weights,
};
use crate::noise::{MarkerNoise, chi_squared_quantile};
use crate::reconstruction::BeyondLimit;
use crate::recording::MarkerRecording;
use somersault_core::argument::expect_range;
use somersault_core::cancel::CancellationToken;
use somersault_multibody::Model;
use std::f64::consts::{PI, TAU};

/// A model with markers, whose motion is to be smoothed.
///
/// ```
/// use somersault_motion::fit::MarkerSet;
/// use somersault_motion::smoothing::{MotionSmoother, SmoothingOptions};
/// use somersault_motion::synthetic::synthetic_markers;
/// use somersault_multibody::models::{Diver, Posture};
///
/// // a diver who bends and stands up again in 1 s, seen with noise of 10 mm
/// let diver = Diver::planar();
/// let model = diver.model()?;
/// let markers = MarkerSet::joint_centres(&model)?;
/// let (straight, pike) = (diver.configuration(Posture::A)?, diver.configuration(Posture::H)?);
/// let times: Vec<f64> = (0..51).map(|i| 0.02 * f64::from(i)).collect();
/// let bent = |t: f64| (std::f64::consts::PI * t).sin().powi(2);
/// let positions: Vec<f64> =
///     times.iter().flat_map(|t| straight.iter().zip(&pike).map(move |(a, b)| a + bent(*t) * (b - a))).collect();
/// let seen = synthetic_markers(&model, &markers, &times, &positions, 0.01, 1)?;
/// let motion = MotionSmoother::try_new(&model, markers, SmoothingOptions::default())?.smooth(&seen)?;
/// assert!(motion.success());
/// // the hips, a quarter of the way: 4.8 rad/s
/// let hip = model.velocities_of(model.body("thigh")?).start;
/// let (found, deviation) = (motion.frames[12].v[hip], motion.frames[12].deviations.velocities[hip]);
/// let rate = std::f64::consts::PI * (std::f64::consts::TAU * 0.24).sin() * (pike[hip] - straight[hip]);
/// assert!((found - rate).abs() < 4.0 * deviation && deviation < 0.1 * rate.abs());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone)]
pub struct MotionSmoother {
    model: Model,
    markers: MarkerSet,
    options: SmoothingOptions,
}

/// Frames that a motion has, at least.
const LEAST_FRAMES: usize = 10;
/// The least time between frames, s.
const LEAST_SPACING: f64 = 1e-4;
/// Numbers that the factors of all frames may have together: 1 GB.
const MAX_NUMBERS: f64 = 1.25e8;
/// The time over which residuals are tested by themselves, s, and standard deviations up to which they are by chance.
const STRETCH: f64 = 0.2;
const CHANCE: f64 = 5.0;
/// Standard deviations up to which a disturbance of a number in a step is by chance, and the fraction of points that may be outliers.
const MAX_DISTURBANCE: f64 = 10.0;
const OUTLIERS: f64 = 0.05;
/// What χ² of a stretch may differ from 1 by, whatever the noise is.
const TOLERANCE: f64 = 0.3;

impl MotionSmoother {
    /// The motions of `model` with `markers`.
    pub fn try_new(
        model: &Model,
        markers: MarkerSet,
        options: SmoothingOptions,
    ) -> Result<Self, SmoothingError> {
        options.validate()?;
        Ok(Self { model: model.clone(), markers, options })
    }

    /// Its choices.
    pub fn options(&self) -> &SmoothingOptions {
        &self.options
    }

    /// The model.
    pub fn model(&self) -> &Model {
        &self.model
    }

    /// Its markers.
    pub fn markers(&self) -> &MarkerSet {
        &self.markers
    }

    /// The smooth motion nearest to a recording. Markers of the recording that the model has not are ignored, those that the recording has
    /// not are missing; frames without markers at both ends are left out.
    pub fn smooth(&self, recording: &MarkerRecording) -> Result<SmoothedMotion, SmoothingError> {
        self.smooth_cancellable(recording, &CancellationToken::new())
    }

    /// As [`smooth`](Self::smooth), and ends with [`FitError::Interrupted`](crate::fit::FitError::Interrupted) within a step over all frames
    /// of the cancellation.
    pub fn smooth_cancellable(
        &self,
        recording: &MarkerRecording,
        token: &CancellationToken,
    ) -> Result<SmoothedMotion, SmoothingError> {
        let Self { model, markers, options } = self;
        let fit = MarkerFit::try_new(model, markers.clone(), FitOptions::default())?;
        // fails without a common marker
        fit.targets(recording)?;
        let all = (f64::NEG_INFINITY, f64::INFINITY);
        let (range, found) = frames_between(markers, recording, all);
        if found < LEAST_FRAMES {
            return Err(SmoothingError::TooFewFrames { least: LEAST_FRAMES, found });
        }
        let recording = recording.part(range)?;
        let times = recording.times();
        let spacing = times.windows(2).map(|pair| pair[1] - pair[0]).fold(f64::INFINITY, f64::min);
        expect_range("time between frames", spacing, "at least 1e-4 s", |x| x >= LEAST_SPACING)?;
        self.expect_room(times.len())?;
        let fits = FrameFits::try_new(model, markers, options.scale, &recording, token)?;
        let targets = fit.targets(&recording)?;
        let (points, weights) = points_and_weights(&targets);
        let axes = axes_of(model);
        let frame_noise = fits.noise(model, markers, &axes, &points, &weights)?;
        let channels = Channels::new(model, &fits.seen(model.n_velocities()));
        let size = options.noise.map(|noise| noise.size).or(frame_noise.map(|noise| noise.size));
        let (scale, scale_prior) = match options.scale {
            BodyScale::Known(size) => (size, None),
            BodyScale::Sought { mean, deviation } => (fits.scale(), Some((mean, deviation))),
        };
        let states = self.start(&fits, &channels, times.len());
        let mut search = Search {
            model,
            markers,
            channels: &channels,
            times,
            points: &points,
            recorded: &weights,
            trust: weights.clone(),
            axes: &axes,
            scale_prior,
            threshold: options.threshold,
            freedom: options.freedom,
            start: states[0].q.clone(),
            states,
            scale,
            noise: options.noise.unwrap_or(MarkerNoise::white(size.unwrap_or(UNKNOWN_NOISE))),
            roughness: vec![ROUGHNESS; channels.n()],
            activity: vec![vec![1.0; channels.n()]; times.len() - 1],
            damping: DAMPING,
            token,
            iterations: 0,
        };
        let status = search.settle(options.noise.is_some(), options.max_iterations)?;
        let posterior = search.posterior(search.noise)?;
        self.judge(&search, status, posterior, frame_noise)
    }

    /// Fails where the factors take too much memory.
    fn expect_room(&self, n_frames: usize) -> Result<(), SmoothingError> {
        let n = 3 * self.model.n_velocities()
            + if self.options.noise.is_some_and(|noise| noise.correlated == 0.0) {
                0
            } else {
                axes_of(&self.model).len() * self.markers.markers().len()
            };
        let limit = (MAX_NUMBERS / (n as f64).powi(2).max(1.0)) as usize;
        if n_frames > limit {
            return Err(SmoothingError::TooManyFrames { found: n_frames, limit });
        }
        Ok(())
    }

    /// The fits of all frames, at rest; angles that count whole turns follow the frame before.
    fn start(&self, fits: &FrameFits, channels: &Channels, n_frames: usize) -> Vec<State> {
        let n = channels.n();
        let mut states: Vec<State> = Vec::with_capacity(n_frames);
        for i in 0..n_frames {
            let mut q = fits.configuration(i).to_vec();
            if let Some(before) = states.last() {
                for part in channels.parts.iter().filter(|part| !part.is_rotation) {
                    let from = before.q[part.position];
                    let is_turn = channels.counts_turns(&self.model, part);
                    let value = &mut q[part.position];
                    if is_turn && (*value - from).abs() > PI {
                        *value += TAU * ((from - *value) / TAU).round();
                    }
                }
                // what no marker sees rests
                channels.keep_unseen(&self.model, &before.q, &mut q);
            }
            states.push(State { q, rates: vec![0.0; n], accelerations: vec![0.0; n], errors: Vec::new() });
        }
        states
    }

    /// The motion at the minimum, and what is wrong with it.
    fn judge(
        &self,
        search: &Search<'_>,
        mut status: SmoothingStatus,
        posterior: Option<Posterior>,
        frame_noise: Option<FrameNoise>,
    ) -> Result<SmoothedMotion, SmoothingError> {
        let Self { model, options, .. } = self;
        let is_determined = posterior.is_some();
        let placed = search.place(&search.states, search.scale, false)?;
        let posterior =
            posterior.unwrap_or_else(|| Posterior::unknown(search.times.len(), model.n_velocities()));
        let frames: Vec<SmoothedFrame> = search
            .states
            .iter()
            .zip(placed)
            .zip(search.times.iter().zip(posterior.deviations))
            .map(|((state, placed), (time, deviations))| {
                let [v, a] = search.channels.motion(state);
                let residuals = placed.residuals.iter().map(|r| r.map(|r| r.norm())).collect();
                SmoothedFrame { time: *time, q: state.q.clone(), v, a, deviations, residuals }
            })
            .collect();
        let sum = |numbers: &[f64]| numbers.iter().sum::<f64>();
        let chi_squared_of = |squares: f64, n_over: f64| {
            chi_squared(options.noise, frame_noise, search.noise, search.times, squares, n_over, 0.0)
        };
        let (whole, chi_squared_range) = chi_squared_of(sum(&posterior.squares), sum(&posterior.n_over));
        let of_stretch = |squares: f64, n_over: f64| chi_squared_of(squares, n_over).0;
        let worst =
            worst_stretch(search.times, search.noise, &posterior.squares, &posterior.n_over, &of_stretch);
        let (disturbance, step) = posterior.disturbance;
        let n_points = search.points.iter().flatten().flatten().count();
        let unseen = search.channels.unseen();
        let beyond_limits = BeyondLimit::of(model, frames.len(), |i, at, rate| {
            let frame = &frames[i];
            (frame.time, frame.q[at], frame.deviations.positions[rate])
        });
        if status == SmoothingStatus::Converged {
            let is_within = whole.is_none_or(|x| (chi_squared_range[0]..=chi_squared_range[1]).contains(&x));
            if !is_determined
                || carry_much(model, &unseen)
                || unseen.iter().any(|k| model.velocities_of(0).contains(k))
            {
                status = SmoothingStatus::Undetermined;
            } else if !is_within
                || worst.is_beyond()
                || disturbance > MAX_DISTURBANCE
                || posterior.n_outliers as f64 > OUTLIERS * n_points as f64
                || beyond_limits.iter().any(BeyondLimit::is_far)
            {
                status = SmoothingStatus::Misfit;
            }
        }
        Ok(SmoothedMotion {
            status,
            frames,
            scale: [search.scale, posterior.scale_deviation],
            noise: search.noise,
            chi_squared: whole,
            chi_squared_range,
            worst: worst.found,
            worst_limit: worst.limit,
            worst_time: worst.time,
            disturbance,
            disturbance_limit: MAX_DISTURBANCE,
            disturbance_time: search.times[step],
            n_outliers: posterior.n_outliers,
            unseen,
            beyond_limits,
            iterations: search.iterations,
        })
    }
}

/// The fifth of a second whose residuals are largest against what chance allows.
struct Stretch {
    /// χ² per degree of freedom; none where nothing was measured beyond what the unknowns follow.
    found: Option<f64>,
    limit: f64,
    time: f64,
}

impl Stretch {
    fn is_beyond(&self) -> bool {
        self.found.is_some_and(|found| found > self.limit)
    }
}

/// The worst of the stretches that begin at each frame; of all frames where they last less.
fn worst_stretch(
    times: &[f64],
    noise: MarkerNoise,
    squares: &[f64],
    n_over: &[f64],
    chi_squared_of: &dyn Fn(f64, f64) -> Option<f64>,
) -> Stretch {
    let mut worst = Stretch { found: None, limit: f64::INFINITY, time: times[0] };
    let mut excess = f64::NEG_INFINITY;
    for (i, &time) in
        times.iter().enumerate().take_while(|(i, t)| *i == 0 || *t + STRETCH <= times[times.len() - 1])
    {
        let end = times.partition_point(|t| *t <= time + STRETCH);
        let over: f64 = n_over[i..end].iter().sum();
        if over < 1.0 {
            continue;
        }
        let spacing = (times[end - 1] - time) / (end - i).max(2) as f64;
        let repeats = 1.0 + noise.correlated.powi(2) * noise.time / spacing.max(1e-6);
        let limit = chi_squared_quantile((over / repeats).max(1.0) as usize, CHANCE) + TOLERANCE;
        let found = chi_squared_of(squares[i..end].iter().sum(), over);
        if let Some(x) = found
            && x - limit > excess
        {
            excess = x - limit;
            worst = Stretch { found, limit, time };
        }
    }
    worst
}
