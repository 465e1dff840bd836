//! Named numbers over time: coordinates of a model, forces, excitations, voltages.

use super::{RecordingError, expect_times, expect_unique};
use somersault_core::argument::expect_length;

/// Channels by name, frames by time, and the number of each channel in each frame, NaN where a value is missing.
#[derive(Debug, Clone)]
pub struct ChannelRecording {
    names: Vec<String>,
    units: Vec<String>,
    times: Vec<f64>,
    values: Vec<f64>,
}

impl PartialEq for ChannelRecording {
    /// NaN in the same places is the same.
    fn eq(&self, other: &Self) -> bool {
        let same = |(a, b): (&f64, &f64)| a == b || (a.is_nan() && b.is_nan());
        self.names == other.names
            && self.units == other.units
            && self.times == other.times
            && self.values.iter().zip(&other.values).all(same)
    }
}

impl ChannelRecording {
    /// `values` frame by frame: channel k in frame i is entry i · (number of channels) + k. They may be NaN, not infinite.
    pub fn try_new(names: Vec<String>, times: Vec<f64>, values: Vec<f64>) -> Result<Self, RecordingError> {
        if names.is_empty() {
            return Err(RecordingError::Empty { argument: "channels" });
        }
        expect_unique(names.iter().map(String::as_str))?;
        expect_times(&times)?;
        expect_length("values", values.len(), names.len().saturating_mul(times.len()))?;
        if let Some(k) = values.iter().position(|x| x.is_infinite()) {
            return Err(RecordingError::NonFinite { argument: "values", frame: k / names.len() });
        }
        let units = vec![String::new(); names.len()];
        Ok(Self { names, units, times, values })
    }

    /// The same with a unit for each channel, empty where it is not known.
    pub fn with_units(self, units: Vec<String>) -> Result<Self, RecordingError> {
        expect_length("units", units.len(), self.names.len())?;
        Ok(Self { units, ..self })
    }

    /// Names of the channels.
    pub fn names(&self) -> &[String] {
        &self.names
    }

    /// Units of the channels, empty where they are not known.
    pub fn units(&self) -> &[String] {
        &self.units
    }

    /// Times of the frames, s.
    pub fn times(&self) -> &[f64] {
        &self.times
    }

    /// Number of channels.
    pub fn n_channels(&self) -> usize {
        self.names.len()
    }

    /// Number of frames.
    pub fn n_frames(&self) -> usize {
        self.times.len()
    }

    /// All channels in frame `i`, in the order of the names, if there is such a frame.
    pub fn frame(&self, i: usize) -> Option<&[f64]> {
        (i < self.n_frames()).then(|| &self.values[i * self.n_channels()..(i + 1) * self.n_channels()])
    }

    /// The frames in turn.
    pub fn frames(&self) -> impl ExactSizeIterator<Item = &[f64]> {
        self.values.chunks_exact(self.n_channels())
    }

    /// The number of the channel of this name.
    pub fn channel(&self, name: &str) -> Result<usize, RecordingError> {
        let number = self.names.iter().position(|n| n == name);
        number.ok_or_else(|| RecordingError::UnknownName { name: name.to_owned() })
    }

    /// The channel of this name over all frames.
    pub fn track(&self, name: &str) -> Result<impl ExactSizeIterator<Item = f64>, RecordingError> {
        let k = self.channel(name)?;
        Ok(self.values.iter().skip(k).step_by(self.n_channels()).copied())
    }

    /// The channels of these names, in this order.
    pub fn select<S: AsRef<str>>(&self, names: &[S]) -> Result<Self, RecordingError> {
        let numbers = names.iter().map(|n| self.channel(n.as_ref())).collect::<Result<Vec<_>, _>>()?;
        let values = self.frames().flat_map(|frame| numbers.iter().map(|&k| frame[k])).collect();
        let units = numbers.iter().map(|&k| self.units[k].clone()).collect();
        let names = names.iter().map(|n| n.as_ref().to_owned()).collect();
        Self::try_new(names, self.times.clone(), values)?.with_units(units)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn channels_are_selected_and_what_is_none_is_refused() {
        let names = |all: &[&str]| all.iter().map(|n| (*n).to_owned()).collect::<Vec<_>>();
        let values = vec![1.0, f64::NAN, 3.0, 4.0];
        let recording =
            ChannelRecording::try_new(names(&["a", "b"]), vec![0.0, 0.1], values.clone()).unwrap();
        assert_eq!(recording.track("a").unwrap().collect::<Vec<_>>(), [1.0, 3.0]);
        assert_eq!(recording.select(&["b", "a"]).unwrap().frame(1), Some(&[4.0, 3.0][..]));
        assert!(matches!(recording.track("c").map(|_| ()), Err(RecordingError::UnknownName { .. })));
        let twice = ChannelRecording::try_new(names(&["a", "a"]), vec![0.0, 0.1], values.clone());
        assert_eq!(twice, Err(RecordingError::DuplicateName { name: "a".into() }));
        let infinite = vec![1.0, 2.0, f64::INFINITY, 4.0];
        let found = ChannelRecording::try_new(names(&["a", "b"]), vec![0.0, 0.1], infinite);
        assert_eq!(found, Err(RecordingError::NonFinite { argument: "values", frame: 1 }));
        let found = ChannelRecording::try_new(names(&["a", "b"]), vec![0.0], values);
        assert!(matches!(found, Err(RecordingError::Argument(_))));
    }
}
