//! What a format of recordings is: how its files are known, what they leave open, and their reader.

use super::vertical::upright;
use super::{Place, ReadError, Repair, Repairs};
use crate::recording::{
    Axis, ChannelRecording, Convention, KeypointRecording, LengthUnit, MarkerRecording, RecordingError,
    SkeletonRecording,
};
use somersault_multibody::models::Diver;

/// What a file of any kind has.
#[derive(Debug, Clone, PartialEq)]
pub enum Recording {
    /// Positions of markers.
    Markers(MarkerRecording),
    /// A tree of joints and how they turned.
    Skeleton(SkeletonRecording),
    /// Key points with weights.
    Keypoints(KeypointRecording),
    /// Named numbers.
    Channels(ChannelRecording),
}

impl Recording {
    /// The markers; for those of a skeleton the centres of its joints are taken.
    pub fn into_markers(self) -> Result<MarkerRecording, RecordingError> {
        match self {
            Self::Markers(recording) => Ok(recording),
            Self::Skeleton(recording) => recording.joint_centres(),
            Self::Keypoints(_) => Err(RecordingError::NoPositions { found: "key points without a scale" }),
            Self::Channels(_) => Err(RecordingError::NoPositions { found: "channels" }),
        }
    }
}

/// A file that was read.
#[derive(Debug, Clone, PartialEq)]
pub struct RecordingFile {
    /// What it has.
    pub recording: Recording,
    /// What was put right in it, or decided where it leaves it open.
    pub repairs: Vec<Repair>,
}

/// What a file of any format may leave open. Where it says so itself, its own counts.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ReadOptions {
    /// Whether a file that needs a repair is refused.
    pub strict: bool,
    /// Unit of length; none for that of the format.
    pub unit: Option<LengthUnit>,
    /// The axis of the file that points up; none for the one that markers show, or else that of the format.
    pub up: Option<Axis>,
    /// The axis of the file that points forward; none for that of the format.
    pub forward: Option<Axis>,
    /// Whether a marker with all three coordinates NaN is missing, which a strict reader refuses otherwise and others list
    /// as a repair.
    pub nan_is_gap: bool,
    /// Frames a second of files that have no times, and of key points in any case.
    pub rate: Option<f64>,
    /// Which person of those in each frame, from 0; none for the one who is seen best in the first frame and is followed.
    pub person: Option<usize>,
    /// Whose lengths a motion without any has.
    pub diver: Diver,
}

impl Default for ReadOptions {
    /// What each format has by itself, with repairs; the spatial diver.
    fn default() -> Self {
        Self {
            strict: false,
            unit: None,
            up: None,
            forward: None,
            nan_is_gap: false,
            rate: None,
            person: None,
            diver: Diver::spatial(),
        }
    }
}

/// The same for one format.
#[derive(Clone, Copy)]
pub(super) struct Choices {
    /// What the caller says, and in its place what the format does.
    pub(super) convention: Convention,
    /// What the caller says.
    pub(super) given: ReadOptions,
}

impl Choices {
    /// The same for a dialect of the format in which this axis points up.
    pub(super) fn convention_with(&self, up: Axis) -> Result<Convention, ReadError> {
        self.given.convention(self.convention.unit(), up, self.convention.forward())
    }
}

impl ReadOptions {
    fn convention(&self, unit: LengthUnit, up: Axis, forward: Axis) -> Result<Convention, ReadError> {
        let (up, forward) = (self.up.unwrap_or(up), self.forward.unwrap_or(forward));
        Convention::try_new(self.unit.unwrap_or(unit), up, forward).map_err(ReadError::Axes)
    }
}

/// What a reader returns.
pub(super) struct Parsed {
    recording: Recording,
    /// How the axes of markers were read.
    convention: Option<Convention>,
}

impl Parsed {
    /// Markers whose vertical is that of a convention, unless they show another.
    pub(super) fn markers(recording: MarkerRecording, convention: Convention) -> Self {
        Self { recording: Recording::Markers(recording), convention: Some(convention) }
    }
}

impl From<Recording> for Parsed {
    fn from(recording: Recording) -> Self {
        Self { recording, convention: None }
    }
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
    /// The axis that points up where neither the caller nor the markers say one.
    pub up: Axis,
    /// The axis that points forward where the caller says none.
    pub forward: Axis,
    /// Whether a file is of this format, by its bytes and the beginning of its text.
    pub(super) knows: fn(&[u8], &str) -> bool,
    /// Its reader.
    pub(super) parse: fn(&[u8], &Choices, &mut Repairs) -> Result<Parsed, ReadError>,
}

impl Format {
    /// Reads the bytes of a file.
    pub fn read(&self, bytes: &[u8], options: &ReadOptions) -> Result<RecordingFile, ReadError> {
        let unit = options.unit.or(self.unit).ok_or(ReadError::NoUnit { format: self.name })?;
        if let Some(found) = options.rate.filter(|rate| !(*rate > 0.0 && rate.is_finite())) {
            return Err(ReadError::Rate { found });
        }
        let read = |given: &ReadOptions| {
            let mut repairs = if given.strict { Repairs::refused() } else { Repairs::allowed() };
            let convention = given.convention(unit, self.up, self.forward)?;
            let found = (self.parse)(bytes, &Choices { convention, given: *given }, &mut repairs)?;
            Ok::<_, ReadError>((found, repairs))
        };
        let (Parsed { recording, convention }, mut repairs) = read(options)?;
        if let (Recording::Markers(markers), Some(usual), false, None) =
            (&recording, convention, options.strict, options.up)
        {
            let shown = upright(markers, &usual);
            let usual_up = usual.up();
            match shown {
                Some((up, reason)) if up != usual_up => {
                    let open = |axis: &Axis| axis.number() != up.number();
                    let forward = [usual.forward(), Axis::PlusX, Axis::PlusY].into_iter().find(open);
                    if options.forward.as_ref().is_none_or(open) {
                        let forward = options.forward.or(forward);
                        let given = ReadOptions { up: Some(up), forward, ..*options };
                        let (Parsed { recording, .. }, mut repairs) = read(&given)?;
                        let what = format!(
                            "{up} is taken to be up, since {reason}, and not {usual_up}; `up` decides"
                        );
                        repairs.decide(Place::Byte(0), what);
                        return Ok(RecordingFile { recording, repairs: repairs.into_list() });
                    }
                }
                Some(_) => {}
                None => repairs.decide(
                    Place::Byte(0),
                    format!(
                        "{usual_up} is taken to be up, as is usual: the markers do not show it; `up` decides"
                    ),
                ),
            }
        }
        Ok(RecordingFile { recording, repairs: repairs.into_list() })
    }
}
