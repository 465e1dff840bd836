//! Heights over time, without gaps and at no more frames than a search needs.

use super::PhaseError;
use crate::recording::expect_times;
use somersault_core::argument::{expect_finite, expect_length};

/// Frames with heights, the mean of times 0.
#[derive(Debug, Clone)]
pub(super) struct Record {
    /// s, from `origin`.
    pub(super) times: Vec<f64>,
    /// m.
    pub(super) heights: Vec<f64>,
    pub(super) origin: f64,
}

/// Fewest frames in which a flight is sought.
pub(super) const LEAST_FRAMES: usize = 10;
/// Most frames.
const MOST_FRAMES: usize = 1_000_000;
/// And how many are searched, after those of fast cameras were taken together.
const MOST_SEARCHED: usize = 20_000;
/// Frames in a second that a search needs.
const RATE: f64 = 120.0;

impl Record {
    /// The frames that have heights; several neighbours as their mean where there are more than 120 in a second. Their mean lies on the
    /// same parabola, but for less than a micrometre.
    pub(super) fn try_new(times: &[f64], heights: &[Option<f64>]) -> Result<Self, PhaseError> {
        expect_times(times)?;
        expect_length("heights", heights.len(), times.len())?;
        expect_finite("heights", heights.iter().flatten())?;
        if times.len() > MOST_FRAMES {
            return Err(PhaseError::TooManyFrames { limit: MOST_FRAMES, found: times.len() });
        }
        let known: Vec<(f64, f64)> =
            times.iter().zip(heights).filter_map(|(t, z)| Some((*t, (*z)?))).collect();
        if known.len() < LEAST_FRAMES {
            return Err(PhaseError::TooFewFrames { least: LEAST_FRAMES, found: known.len() });
        }
        let mut spacings: Vec<f64> = known.windows(2).map(|pair| pair[1].0 - pair[0].0).collect();
        spacings.sort_unstable_by(f64::total_cmp);
        let spacing = spacings[spacings.len() / 2];
        let together = ((1.0 / (RATE * spacing)) as usize).clamp(1, known.len() / LEAST_FRAMES);
        let origin = known.iter().map(|(t, _)| t).sum::<f64>() / known.len() as f64;
        let (mut times, mut heights) = (Vec::new(), Vec::new());
        for group in known.chunks(together) {
            let n = group.len() as f64;
            times.push(group.iter().map(|(t, _)| t - origin).sum::<f64>() / n);
            heights.push(group.iter().map(|(_, z)| z).sum::<f64>() / n);
        }
        if times.len() > MOST_SEARCHED {
            return Err(PhaseError::TooManyFrames {
                limit: MOST_SEARCHED * together,
                found: times.len() * together,
            });
        }
        Ok(Self { times, heights, origin })
    }

    /// Middle time between frames, s.
    pub(super) fn spacing(&self) -> f64 {
        let mut spacings: Vec<f64> = self.times.windows(2).map(|pair| pair[1] - pair[0]).collect();
        spacings.sort_unstable_by(f64::total_cmp);
        spacings[spacings.len() / 2]
    }
}
