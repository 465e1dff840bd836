//! Heights of a recording whose body is not known.

use super::PhaseError;
use crate::recording::MarkerRecording;

/// Gaps that are closed, s.
const CLOSED: f64 = 0.2;
/// Fraction of the frames that a marker must have to count.
const USUAL: f64 = 0.8;

/// The height of the mean of the markers in each frame, m: of those that most frames have, gaps of up to 0.2 s closed. None where one of
/// them is missing, since the mean of the others is elsewhere.
pub fn mean_heights(recording: &MarkerRecording) -> Result<Vec<Option<f64>>, PhaseError> {
    let filled = recording.fill_gaps(CLOSED)?;
    let present: Vec<usize> =
        (0..filled.n_markers()).map(|k| filled.frames().filter(|frame| frame[k].is_some()).count()).collect();
    let most = present.iter().copied().max().unwrap_or(0);
    let kept: Vec<usize> =
        (0..present.len()).filter(|k| present[*k] > 0 && present[*k] as f64 >= USUAL * most as f64).collect();
    let mean = |frame: &[Option<nalgebra::Vector3<f64>>]| {
        let sum = kept.iter().map(|k| frame[*k].map(|point| point.z)).sum::<Option<f64>>();
        sum.filter(|_| !kept.is_empty()).map(|sum| sum / kept.len() as f64)
    };
    Ok(filled.frames().map(mean).collect())
}
