//! Key points of a person in pictures: what pose estimators find, each with a confidence.

use super::{Convention, MarkerRecording, RecordingError, expect_times, expect_unique};
use nalgebra::Vector3;
use somersault_core::argument::{ArgumentError, expect_length};

/// Key points by name, frames by time: two or three coordinates in the unit of the estimator, and a weight of 0 or more, which is 0
/// where a point was not found.
#[derive(Debug, Clone, PartialEq)]
pub struct KeypointRecording {
    names: Vec<String>,
    times: Vec<f64>,
    n_dims: usize,
    points: Vec<f64>,
    weights: Vec<f64>,
}

impl KeypointRecording {
    /// `points` has n_dims numbers, and `weights` one, for each point of each frame, frame by frame.
    pub fn try_new(
        names: Vec<String>,
        times: Vec<f64>,
        n_dims: usize,
        points: Vec<f64>,
        weights: Vec<f64>,
    ) -> Result<Self, RecordingError> {
        if names.is_empty() {
            return Err(RecordingError::Empty { argument: "keypoints" });
        }
        if n_dims != 2 && n_dims != 3 {
            return Err(RecordingError::Dimensions { found: n_dims });
        }
        expect_unique(names.iter().map(String::as_str))?;
        expect_times(&times)?;
        let n = names.len().saturating_mul(times.len());
        expect_length("points", points.len(), n.saturating_mul(n_dims))?;
        expect_length("weights", weights.len(), n)?;
        if let Some(k) = points.iter().position(|x| !x.is_finite()) {
            return Err(RecordingError::NonFinite { argument: "points", frame: k / n_dims / names.len() });
        }
        if let Some(k) = weights.iter().position(|w| !(*w >= 0.0 && w.is_finite())) {
            let (frame, allowed) = (k / names.len(), "finite and at least 0");
            return Err(RecordingError::Weight { frame, allowed, found: weights[k] });
        }
        Ok(Self { names, times, n_dims, points, weights })
    }

    /// Names of the key points.
    pub fn names(&self) -> &[String] {
        &self.names
    }

    /// Times of the frames, s.
    pub fn times(&self) -> &[f64] {
        &self.times
    }

    /// Number of key points.
    pub fn n_keypoints(&self) -> usize {
        self.names.len()
    }

    /// Number of frames.
    pub fn n_frames(&self) -> usize {
        self.times.len()
    }

    /// Number of coordinates of a point, 2 or 3.
    pub fn n_dims(&self) -> usize {
        self.n_dims
    }

    /// All coordinates, frame by frame and point by point.
    pub fn points(&self) -> &[f64] {
        &self.points
    }

    /// The weight of each point of each frame.
    pub fn weights(&self) -> &[f64] {
        &self.weights
    }

    /// The points as markers: coordinates times `scale`, m of their unit along each axis, in the axes of a convention, whose unit
    /// is not used. Points of a picture get a third coordinate of 0. Those of a weight of `threshold` or less are missing; the others have
    /// their weight as a fraction of the largest.
    pub fn markers(
        &self,
        scale: [f64; 3],
        axes: &Convention,
        threshold: f64,
    ) -> Result<MarkerRecording, RecordingError> {
        if let Some(&found) = scale.iter().find(|s| !(**s > 0.0 && s.is_finite())) {
            return Err(ArgumentError::NotPositive { argument: "scale", found }.into());
        }
        let axes = axes.with_unit(super::LengthUnit::Metre);
        let rows = self.points.chunks_exact(self.n_dims).zip(&self.weights);
        let point = |(x, weight): (&[f64], &f64)| {
            let coordinate = |i: usize| x.get(i).map_or(0.0, |x| x * scale[i]);
            (*weight > threshold).then(|| axes.position(&Vector3::from_fn(|i, _| coordinate(i))))
        };
        let largest = self.weights.iter().copied().fold(f64::MIN_POSITIVE, f64::max);
        let weights = self.weights.iter().map(|weight| (weight / largest).max(f64::MIN_POSITIVE)).collect();
        MarkerRecording::try_new(self.names.clone(), self.times.clone(), rows.map(point).collect())?
            .with_weights(weights)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::recording::{Axis, LengthUnit};

    #[test]
    fn points_of_a_picture_stand_upright_as_markers() {
        let names = vec!["nose".to_owned(), "toe".to_owned()];
        let points = vec![100.0, 50.0, 110.0, 250.0];
        let recording = KeypointRecording::try_new(names, vec![0.0], 2, points, vec![0.9, 0.2]).unwrap();
        let axes = Convention::try_new(LengthUnit::Metre, Axis::MinusY, Axis::PlusX).unwrap();
        let all = recording.markers([0.01; 3], &axes, 0.0).unwrap();
        let toe = all.frame(0).unwrap()[1].unwrap();
        assert!((toe - Vector3::new(1.1, 0.0, -2.5)).norm() < 1e-14, "down in the picture is down: {toe}");
        let sure = recording.markers([0.01; 3], &axes, 0.5).unwrap();
        assert_eq!(sure.frame(0).unwrap()[1], None);
        let weights: Vec<f64> = all.weights(0).collect();
        assert!(weights[0] == 1.0 && (weights[1] - 2.0 / 9.0).abs() < 1e-15 && !sure.is_weighted());
        let found = recording.markers([0.0; 3], &axes, 0.5);
        assert!(matches!(found, Err(RecordingError::Argument(ArgumentError::NotPositive { .. }))));
    }

    #[test]
    fn what_is_no_recording_of_points_is_refused() {
        let one = || vec!["nose".to_owned()];
        let found = KeypointRecording::try_new(one(), vec![0.0], 4, vec![0.0; 4], vec![1.0]);
        assert_eq!(found, Err(RecordingError::Dimensions { found: 4 }));
        let found = KeypointRecording::try_new(one(), vec![0.0], 2, vec![0.0; 2], vec![-1.0]);
        let allowed = "finite and at least 0";
        assert_eq!(found, Err(RecordingError::Weight { frame: 0, allowed, found: -1.0 }));
        let found = KeypointRecording::try_new(one(), vec![0.0], 2, vec![0.0, f64::NAN], vec![1.0]);
        assert_eq!(found, Err(RecordingError::NonFinite { argument: "points", frame: 0 }));
    }
}
