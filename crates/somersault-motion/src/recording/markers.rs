//! Positions of markers over time.

use super::{CubicSpline, RecordingError, expect_times, expect_unique, expect_within};
use nalgebra::Vector3;
use somersault_core::argument::{ArgumentError, expect_length};

/// Markers by name, frames by time, and where each marker was in each frame: in m, z up, `None` in a gap. Each point has a weight in
/// (0, 1], which is 1 unless [`with_weights`](Self::with_weights) says otherwise.
#[derive(Debug, Clone, PartialEq)]
pub struct MarkerRecording {
    names: Vec<String>,
    times: Vec<f64>,
    points: Vec<Option<Vector3<f64>>>,
    /// None where all are 1.
    weights: Option<Vec<f64>>,
}

impl MarkerRecording {
    /// `points` frame by frame: the position of marker k in frame i is entry i · (number of markers) + k.
    pub fn try_new(
        names: Vec<String>,
        times: Vec<f64>,
        points: Vec<Option<Vector3<f64>>>,
    ) -> Result<Self, RecordingError> {
        if names.is_empty() {
            return Err(RecordingError::Empty { argument: "markers" });
        }
        expect_unique(names.iter().map(String::as_str))?;
        expect_times(&times)?;
        expect_length("points", points.len(), names.len().saturating_mul(times.len()))?;
        let bad = |p: &Option<Vector3<f64>>| p.is_some_and(|p| !p.iter().all(|x| x.is_finite()));
        if let Some(k) = points.iter().position(bad) {
            return Err(RecordingError::NonFinite { argument: "points", frame: k / names.len() });
        }
        Ok(Self { names, times, points, weights: None })
    }

    /// The same with the weight of each point of each frame, by which fits and reconstructions count its squared distance: σ²/w is
    /// the variance of its noise where that of a point of weight 1 is σ². Those of points that are missing do not count.
    pub fn with_weights(self, weights: Vec<f64>) -> Result<Self, RecordingError> {
        expect_length("weights", weights.len(), self.points.len())?;
        let is_bad = |(w, point): (&f64, &Option<_>)| point.is_some() && !(*w > 0.0 && *w <= 1.0);
        if let Some(k) = weights.iter().zip(&self.points).position(is_bad) {
            let (frame, allowed) = (k / self.n_markers(), "above 0 and at most 1");
            return Err(RecordingError::Weight { frame, allowed, found: weights[k] });
        }
        let is_one = |(w, point): (&f64, &Option<_>)| point.is_none() || *w == 1.0;
        let all_are_one = weights.iter().zip(&self.points).all(is_one);
        Ok(Self { weights: (!all_are_one).then_some(weights), ..self })
    }

    /// Names of the markers.
    pub fn names(&self) -> &[String] {
        &self.names
    }

    /// Times of the frames, s.
    pub fn times(&self) -> &[f64] {
        &self.times
    }

    /// Number of markers.
    pub fn n_markers(&self) -> usize {
        self.names.len()
    }

    /// Number of frames.
    pub fn n_frames(&self) -> usize {
        self.times.len()
    }

    /// All markers in frame `i`, in the order of the names, if there is such a frame.
    pub fn frame(&self, i: usize) -> Option<&[Option<Vector3<f64>>]> {
        (i < self.n_frames()).then(|| &self.points[i * self.n_markers()..(i + 1) * self.n_markers()])
    }

    /// The weights of the points of frame `i`, in the order of the names.
    pub fn weights(&self, i: usize) -> impl Iterator<Item = f64> {
        let first = i * self.n_markers();
        (first..first + self.n_markers()).map(|k| self.weight(k))
    }

    /// Whether some point has another weight than 1.
    pub fn is_weighted(&self) -> bool {
        self.weights.is_some()
    }

    /// The weight of entry `k` of all points.
    fn weight(&self, k: usize) -> f64 {
        self.weights.as_ref().and_then(|weights| weights.get(k)).copied().unwrap_or(1.0)
    }

    /// The same points with the weights of these entries of `of`.
    fn weighted_as(self, of: &Self, entries: impl Iterator<Item = usize>) -> Result<Self, RecordingError> {
        if of.is_weighted() { self.with_weights(entries.map(|k| of.weight(k)).collect()) } else { Ok(self) }
    }

    /// The frames in turn.
    pub fn frames(&self) -> impl ExactSizeIterator<Item = &[Option<Vector3<f64>>]> {
        self.points.chunks_exact(self.n_markers())
    }

    /// The number of the marker of this name.
    pub fn marker(&self, name: &str) -> Result<usize, RecordingError> {
        let number = self.names.iter().position(|n| n == name);
        number.ok_or_else(|| RecordingError::UnknownName { name: name.to_owned() })
    }

    /// The marker of this name over all frames.
    pub fn track(
        &self,
        name: &str,
    ) -> Result<impl ExactSizeIterator<Item = Option<Vector3<f64>>>, RecordingError> {
        self.marker(name).map(|k| self.column(k))
    }

    /// Marker `k` over all frames.
    fn column(&self, k: usize) -> impl ExactSizeIterator<Item = Option<Vector3<f64>>> {
        self.points.iter().skip(k).step_by(self.n_markers()).copied()
    }

    /// Positions that are missing, over all markers and frames.
    pub fn n_missing(&self) -> usize {
        self.points.iter().filter(|p| p.is_none()).count()
    }

    /// The markers of these names, in this order.
    pub fn select<S: AsRef<str>>(&self, names: &[S]) -> Result<Self, RecordingError> {
        let numbers = names.iter().map(|n| self.marker(n.as_ref())).collect::<Result<Vec<_>, _>>()?;
        let points = self.frames().flat_map(|frame| numbers.iter().map(|&k| frame[k])).collect();
        let names = names.iter().map(|n| n.as_ref().to_owned()).collect();
        let entries =
            (0..self.n_frames()).flat_map(|i| numbers.iter().map(move |k| i * self.n_markers() + k));
        Self::try_new(names, self.times.clone(), points)?.weighted_as(self, entries)
    }

    /// The frames of a range, of which there must be one.
    pub fn part(&self, frames: std::ops::Range<usize>) -> Result<Self, RecordingError> {
        let end = frames.end.min(self.n_frames());
        let frames = frames.start.min(end)..end;
        let entries = frames.start * self.n_markers()..frames.end * self.n_markers();
        let points = self.points[entries.clone()].to_vec();
        Self::try_new(self.names.clone(), self.times[frames].to_vec(), points)?.weighted_as(self, entries)
    }

    /// The frames of these numbers, in this order.
    pub(crate) fn chosen(&self, frames: &[usize]) -> Result<Self, RecordingError> {
        let width = self.n_markers();
        let entries = || frames.iter().flat_map(|i| i * width..(i + 1) * width);
        let points = entries().map(|k| self.points[k]).collect();
        let times = frames.iter().map(|i| self.times[*i]).collect();
        Self::try_new(self.names.clone(), times, points)?.weighted_as(self, entries())
    }

    /// The same motion at other times, by a cubic spline through each marker's unbroken stretches.
    ///
    /// What lies in a gap stays missing: between two neighbouring frames of which one lacks the marker. The weight of a point is the lesser of
    /// those of the frames beside it.
    pub fn resample(&self, times: &[f64]) -> Result<Self, RecordingError> {
        expect_times(times)?;
        expect_within(&self.times, times)?;
        let mut points = vec![None; times.len() * self.n_markers()];
        let mut weights = vec![1.0; points.len()];
        for k in 0..self.n_markers() {
            for (from, to) in self.stretches(k) {
                let spline = self.spline(k, from..to)?;
                let (first, last) = (self.times[from], self.times[to - 1]);
                let inside = times.iter().enumerate().filter(|(_, t)| (first..=last).contains(*t));
                for (i, &t) in inside {
                    let at = i * self.n_markers() + k;
                    points[at] = Some(spline.evaluate(t));
                    let after = self.times.partition_point(|time| *time < t);
                    let before = if self.times[after] == t { after } else { after - 1 };
                    weights[at] = self.lesser_weight(k, [before, after]);
                }
            }
        }
        Self::try_new(self.names.clone(), times.to_vec(), points)?.with_weights(weights)
    }

    /// Fills each gap that lasts at most `longest`, s, from the frame before to the frame after it, by a cubic
    /// spline through all the frames that have the marker, with the lesser of the weights of these two frames. Gaps at the start or the
    /// end stay.
    pub fn fill_gaps(&self, longest: f64) -> Result<Self, RecordingError> {
        if !(longest > 0.0 && longest.is_finite()) {
            return Err(ArgumentError::NotPositive { argument: "longest", found: longest }.into());
        }
        let mut filled = self.points.clone();
        let mut weights: Vec<f64> = (0..filled.len()).map(|k| self.weight(k)).collect();
        for k in 0..self.n_markers() {
            let stretches = self.stretches(k);
            let mut spline = None;
            for pair in stretches.windows(2) {
                let (before, after) = (pair[0].1 - 1, pair[1].0);
                if self.times[after] - self.times[before] > longest {
                    continue;
                }
                let spline = match &mut spline {
                    Some(spline) => spline,
                    empty => empty.insert(self.spline(k, 0..self.n_frames())?),
                };
                for i in before + 1..after {
                    let at = i * self.n_markers() + k;
                    filled[at] = Some(spline.evaluate(self.times[i]));
                    weights[at] = self.lesser_weight(k, [before, after]);
                }
            }
        }
        // between far points a spline may go beyond all numbers
        Self::try_new(self.names.clone(), self.times.clone(), filled)?.with_weights(weights)
    }

    /// The lesser of the weights of marker `k` in two frames.
    fn lesser_weight(&self, k: usize, frames: [usize; 2]) -> f64 {
        let [a, b] = frames.map(|i| self.weight(i * self.n_markers() + k));
        a.min(b)
    }

    /// The unbroken stretches of marker `k`: first frame, and the frame after the last.
    fn stretches(&self, k: usize) -> Vec<(usize, usize)> {
        let mut stretches: Vec<(usize, usize)> = Vec::new();
        for (i, point) in self.column(k).enumerate() {
            match stretches.last_mut() {
                _ if point.is_none() => {}
                Some((_, end)) if *end == i => *end += 1,
                _ => stretches.push((i, i + 1)),
            }
        }
        stretches
    }

    /// The spline through marker `k` where it is present.
    fn spline(&self, k: usize, frames: std::ops::Range<usize>) -> Result<CubicSpline<3>, RecordingError> {
        let present = frames.filter_map(|i| Some((self.times[i], self.points[i * self.n_markers() + k]?)));
        let (times, values) = present.unzip();
        CubicSpline::try_new(times, values)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cubic(t: f64) -> Vector3<f64> {
        Vector3::new(t, 1.0 - t * t, t * t * t - 2.0 * t)
    }

    /// A marker on a cubic, missing in frames 3, 4 and 9, and one that is only there in frames 2 to 5.
    fn gapped() -> MarkerRecording {
        let times: Vec<f64> = (0..12).map(|i| 0.1 * f64::from(i)).collect();
        let points = times.iter().enumerate().flat_map(|(i, &t)| {
            [(![3, 4, 9].contains(&i)).then(|| cubic(t)), (2..=5).contains(&i).then(|| -cubic(t))]
        });
        MarkerRecording::try_new(vec!["a".into(), "b".into()], times.clone(), points.collect()).unwrap()
    }

    #[test]
    fn resampling_is_exact_for_cubics_and_keeps_gaps() {
        let recording = gapped();
        let asked: Vec<f64> = (0..=110).map(|i| 0.01 * f64::from(i)).collect();
        let found = recording.resample(&asked).unwrap();
        for (i, &t) in asked.iter().enumerate() {
            let gap = (t > 0.2 && t < 0.5 - 1e-12) || (t > 0.8 + 1e-12 && t < 1.0 - 1e-12);
            // three frames make a parabola and two a line, which leaves h²/8 max‖f″‖ at most
            match found.frame(i).unwrap()[0] {
                None => assert!(gap, "at {t}"),
                Some(p) if (0.5..=0.8).contains(&t) => assert!((p - cubic(t)).norm() < 1e-13, "at {t}"),
                Some(p) => assert!(!gap && (p - cubic(t)).norm() < 0.01 / 8.0 * 7.0, "at {t}"),
            }
            assert_eq!(found.frame(i).unwrap()[1].is_some(), (0.2..=0.5).contains(&t), "at {t}");
        }
    }

    #[test]
    fn gaps_are_filled_up_to_the_longest_allowed() {
        let recording = gapped();
        assert_eq!(recording.n_missing(), 3 + 8);
        let short = recording.fill_gaps(0.21).unwrap();
        assert_eq!(short.column(0).map(|p| p.is_none()).collect::<Vec<_>>()[3..5], [true, true]);
        assert!((short.frame(9).unwrap()[0].unwrap() - cubic(0.9)).norm() < 1e-14);
        let all = recording.fill_gaps(0.31).unwrap();
        for (i, &t) in recording.times().iter().enumerate() {
            assert!((all.frame(i).unwrap()[0].unwrap() - cubic(t)).norm() < 1e-14);
        }
        assert_eq!(all.n_missing(), 8, "no marker is extrapolated before its first or after its last frame");
    }

    #[test]
    fn what_a_spline_makes_up_beyond_all_numbers_is_refused() {
        let heights = [Some(1.7e308), None, Some(-1.7e308), Some(1.7e308), Some(-1.7e308)];
        let points = heights.map(|z| z.map(|z| Vector3::new(0.0, 0.0, z))).to_vec();
        let times = vec![0.0, 1.0, 2.0, 3.0, 4.0];
        let recording = MarkerRecording::try_new(vec!["a".into()], times, points).unwrap();
        let found = recording.fill_gaps(10.0);
        assert_eq!(found, Err(RecordingError::NonFinite { argument: "points", frame: 1 }));
    }

    #[test]
    fn what_is_no_recording_is_refused() {
        let one = |name: &str| vec![name.to_owned()];
        let p = Some(Vector3::zeros());
        let make = |names, times: &[f64], points| MarkerRecording::try_new(names, times.to_vec(), points);
        assert_eq!(make(vec![], &[0.0], vec![]), Err(RecordingError::Empty { argument: "markers" }));
        assert_eq!(make(one("a"), &[], vec![]), Err(RecordingError::Empty { argument: "frames" }));
        let found = make(one("a"), &[0.0, 0.0], vec![p, p]);
        assert_eq!(found, Err(RecordingError::TimesNotGrowing { frame: 1, found: 0.0, before: 0.0 }));
        let found = make(one("a"), &[0.0, 1.0], vec![p]);
        assert_eq!(
            found,
            Err(RecordingError::Argument(ArgumentError::Length {
                argument: "points",
                expected: 2,
                found: 1
            }))
        );
        let nan = Some(Vector3::new(0.0, f64::NAN, 0.0));
        let found = make(one("a"), &[0.0, 1.0], vec![p, nan]);
        assert_eq!(found, Err(RecordingError::NonFinite { argument: "points", frame: 1 }));
        let found = make(vec!["a".into(), "a".into()], &[0.0], vec![p, p]);
        assert_eq!(found, Err(RecordingError::DuplicateName { name: "a".into() }));
        let found = gapped().resample(&[0.5, 1.2]);
        assert!(matches!(found, Err(RecordingError::OutsideOfRecording { found: 1.2, .. })));
        assert!(matches!(
            gapped().fill_gaps(0.0),
            Err(RecordingError::Argument(ArgumentError::NotPositive { .. }))
        ));
        assert!(matches!(gapped().select(&["c"]), Err(RecordingError::UnknownName { .. })));
    }
}
