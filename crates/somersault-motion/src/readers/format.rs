//! What a format of recordings is: the endings of its files, what they leave open, and their reader.

use super::ReadError;
use super::c3d::Contradiction;
use crate::recording::{Axis, Convention, LengthUnit, MarkerRecording, RecordingError, SkeletonRecording};
use somersault_multibody::models::Diver;

/// What a file of either kind has.
#[derive(Debug, Clone, PartialEq)]
pub enum Recording {
    /// Positions of markers.
    Markers(MarkerRecording),
    /// A tree of joints and how they turned.
    Skeleton(SkeletonRecording),
}

impl Recording {
    /// The markers; for those of a skeleton the centres of its joints are taken.
    pub fn into_markers(self) -> Result<MarkerRecording, RecordingError> {
        match self {
            Self::Markers(recording) => Ok(recording),
            Self::Skeleton(recording) => recording.joint_centres(),
        }
    }
}

/// A file that was read.
#[derive(Debug, Clone, PartialEq)]
pub struct RecordingFile {
    /// What it has.
    pub recording: Recording,
    /// What it declares differently in two places.
    pub contradictions: Vec<Contradiction>,
}

impl From<MarkerRecording> for RecordingFile {
    fn from(recording: MarkerRecording) -> Self {
        Self { recording: Recording::Markers(recording), contradictions: Vec::new() }
    }
}

impl From<SkeletonRecording> for RecordingFile {
    fn from(recording: SkeletonRecording) -> Self {
        Self { recording: Recording::Skeleton(recording), contradictions: Vec::new() }
    }
}

/// What a file of any format may leave open. Where it says so itself, its own counts.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ReadOptions {
    /// Unit of length; none for that of the format.
    pub unit: Option<LengthUnit>,
    /// The axis of the file that points up; none for that of the format.
    pub up: Option<Axis>,
    /// The axis of the file that points forward; none for that of the format.
    pub forward: Option<Axis>,
    /// Whether a marker with all three coordinates NaN is missing rather than an error.
    pub nan_is_gap: bool,
    /// Whose lengths a motion without any has.
    pub diver: Diver,
}

impl Default for ReadOptions {
    /// What each format has by itself; NaN is an error; the spatial diver.
    fn default() -> Self {
        Self { unit: None, up: None, forward: None, nan_is_gap: false, diver: Diver::spatial() }
    }
}

/// The same for one format.
pub(super) struct Choices {
    pub(super) convention: Convention,
    pub(super) nan_is_gap: bool,
    pub(super) diver: Diver,
}

/// A format of files: a row of [`FORMATS`](super::FORMATS).
#[derive(Debug, Clone, Copy)]
pub struct Format {
    /// What it is called.
    pub name: &'static str,
    /// How names of its files end, in lower case and without the dot.
    pub endings: &'static [&'static str],
    /// Unit of length where neither the file nor the caller says one; none where the caller must.
    pub unit: Option<LengthUnit>,
    /// The axis that points up where the caller says none.
    pub up: Axis,
    /// The axis that points forward where the caller says none.
    pub forward: Axis,
    /// Its reader.
    pub(super) parse: fn(&[u8], &Choices) -> Result<RecordingFile, ReadError>,
}

impl Format {
    /// Reads the bytes of a file.
    pub fn read(&self, bytes: &[u8], options: &ReadOptions) -> Result<RecordingFile, ReadError> {
        let ReadOptions { unit, up, forward, nan_is_gap, diver } = *options;
        let unit = unit.or(self.unit).ok_or(ReadError::NoUnit { format: self.name })?;
        let (up, forward) = (up.unwrap_or(self.up), forward.unwrap_or(self.forward));
        let convention = Convention::try_new(unit, up, forward).map_err(ReadError::Axes)?;
        (self.parse)(bytes, &Choices { convention, nan_is_gap, diver })
    }
}
