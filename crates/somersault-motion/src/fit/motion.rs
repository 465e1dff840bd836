//! A whole motion: frame after frame, or with one scale for all.

use super::frame::{FitStatus, FrameFit, FrameFitter, rms_of_markers};
use super::problem::{Targets, expect_not_cancelled};
use super::starts::Starts;
use super::{FitError, MarkerFit, Scale, minima};
use crate::recording::MarkerRecording;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use somersault_core::cancel::CancellationToken;

/// A fitted motion.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Parts")]
pub struct MotionFit {
    /// Times of the frames, s.
    pub times: Vec<f64>,
    /// The frames.
    pub frames: Vec<FrameFit>,
    /// Whether a scale common to all frames has converged too; true where each frame has its own.
    pub scale_converged: bool,
}

/// A fitted motion as files hold it.
#[derive(Deserialize)]
struct Parts {
    times: Vec<f64>,
    frames: Vec<FrameFit>,
    scale_converged: bool,
}

impl TryFrom<Parts> for MotionFit {
    type Error = &'static str;

    fn try_from(Parts { times, frames, scale_converged }: Parts) -> Result<Self, Self::Error> {
        if times.len() != frames.len() {
            return Err("`times` and `frames` must be as many as each other");
        }
        Ok(Self { times, frames, scale_converged })
    }
}

impl MotionFit {
    /// Root mean square of all residuals, m; none without markers.
    pub fn rms(&self) -> Option<f64> {
        let all = || self.frames.iter().flat_map(|f| &f.residuals).flatten();
        let n = all().count();
        (n > 0).then(|| (all().map(|r| r * r).sum::<f64>() / n as f64).sqrt())
    }

    /// Root mean square of the residuals of each marker over the frames that have it, m.
    pub fn rms_of_markers(&self) -> Vec<Option<f64>> {
        rms_of_markers(self.frames.iter().map(|f| f.residuals.as_slice()))
    }

    /// Whether the search of every frame that has markers came to a minimum, and there is one. Whether the minimum determines
    /// the motion is another question: [`success`](Self::success).
    pub fn converged(&self) -> bool {
        let is_minimum = |f: &FrameFit| match f.status {
            FitStatus::Converged | FitStatus::Mirrored | FitStatus::Misfit => true,
            FitStatus::IterationLimit | FitStatus::NoProgress | FitStatus::NoMarkers => false,
        };
        let done = |f: &FrameFit| is_minimum(f) || f.status == FitStatus::NoMarkers;
        self.scale_converged && self.frames.iter().any(is_minimum) && self.frames.iter().all(done)
    }

    /// Whether every frame is a success: it has markers, its search converged, the markers determine every unknown, and neither
    /// limits nor mirrored axes nor the noise contradict them ([`FrameFit::success`]).
    pub fn success(&self) -> bool {
        self.scale_converged && !self.frames.is_empty() && self.frames.iter().all(FrameFit::success)
    }
}

/// Rounds of the search for a common scale, at most.
const MAX_ROUNDS: usize = 50;

impl MarkerFit {
    /// Fits all frames. Markers of the recording that the model has not are ignored, those that the recording
    /// has not are missing.
    pub fn fit(&self, recording: &MarkerRecording) -> Result<MotionFit, FitError> {
        self.fit_cancellable(recording, &CancellationToken::new())
    }

    /// As [`fit`](Self::fit), and ends with [`FitError::Interrupted`] within a frame of the cancellation.
    pub fn fit_cancellable(
        &self,
        recording: &MarkerRecording,
        token: &CancellationToken,
    ) -> Result<MotionFit, FitError> {
        let targets = self.targets(recording)?;
        let mut fitter = FrameFitter::new(&self.model, &self.markers, &self.options);
        let starts = Starts::new(&self.model, &self.options, &fitter.unknowns);
        let mut estimate = fitter.unknowns.start(&self.model, None);
        if let Some(first) = targets.iter().find(|t| t.iter().any(Option::is_some)) {
            let start = starts.best(&mut fitter, first, f64::INFINITY)?.unwrap_or(estimate);
            let mut found = fitter.fit(first, &start)?;
            minima::turn_joints(&mut fitter, first, &mut found)?;
            estimate = found.estimate;
        }
        let mut frames = Vec::with_capacity(targets.len());
        for frame in &targets {
            expect_not_cancelled(token)?;
            let found = fitter.fit(frame, &estimate)?;
            estimate.clone_from(&found.estimate);
            frames.push(found);
        }
        minima::lower(self, &starts, &targets, &mut frames, token)?;
        minima::find_mirrored(self, &starts, &targets, &mut frames, token)?;
        for i in 1..frames.len() {
            if frames[i].status == FitStatus::NoMarkers {
                frames[i].estimate = frames[i - 1].estimate.clone();
            }
        }
        let mut motion = MotionFit { times: recording.times().to_vec(), frames, scale_converged: true };
        if let Scale::Common { lower, upper } = self.options.scale {
            self.share_scale(&targets, &mut motion, [lower, upper], token)?;
        }
        Ok(motion)
    }

    /// Makes the scale of all frames one: Newton's method on the sum of the frames' minima, a function of the scale
    /// alone. By the theorem of the envelope its slope is that at the fixed scale.
    fn share_scale(
        &self,
        targets: &[Targets],
        motion: &mut MotionFit,
        [lower, upper]: [f64; 2],
        token: &CancellationToken,
    ) -> Result<(), FitError> {
        let seen = |f: &&FrameFit| f.status != FitStatus::NoMarkers;
        let scales: Vec<f64> = motion.frames.iter().filter(seen).map(|f| f.estimate.scale).collect();
        if scales.is_empty() {
            return Ok(());
        }
        let mut scale = scales.iter().sum::<f64>() / scales.len() as f64;
        motion.scale_converged = false;
        for _ in 0..MAX_ROUNDS {
            let fit_at = |fitter: &mut FrameFitter, (frame, fit): (&Targets, &mut FrameFit)| {
                expect_not_cancelled(token)?;
                fitter.fix_scale(scale);
                let mut start = fit.estimate.clone();
                start.scale = scale;
                let was_mirrored = fit.status == FitStatus::Mirrored;
                *fit = fitter.fit(frame, &start)?;
                if was_mirrored && fit.status != FitStatus::NoMarkers {
                    fit.status = FitStatus::Mirrored;
                }
                Ok::<_, FitError>(fitter.derivatives_by_scale(frame, &fit.estimate)?)
            };
            let derivatives: Vec<[f64; 2]> = targets
                .par_iter()
                .zip(&mut motion.frames)
                .map_init(|| FrameFitter::new(&self.model, &self.markers, &self.options), fit_at)
                .collect::<Result<_, _>>()?;
            // in the order of the frames, whatever the threads did
            let [slope, curvature] = derivatives.iter().fold([0.0; 2], |[a, b], [x, y]| [a + x, b + y]);
            if motion.scale_converged || curvature <= 0.0 {
                break;
            }
            let next = (scale - slope / curvature).clamp(lower, upper);
            motion.scale_converged = (next - scale).abs() <= self.options.step_tol;
            scale = next;
        }
        Ok(())
    }
}
