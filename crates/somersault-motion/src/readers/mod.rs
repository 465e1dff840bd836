//! Files with recorded motions.
//!
//! | Format | Here | Gives |
//! |---|---|---|
//! | BVH | [`bvh`] | skeleton |
//! | motions of DeepMimic (JSON) | [`joint_motion`] | skeleton |
//! | C3D, point data | [`c3d`] | markers |
//! | TRC | [`trc`] | markers |
//! | CSV | [`csv`] | markers |
//!
//! [`read_file`] takes a path and finds the reader by its ending; [`FORMATS`] has a row for each. Readers take text or bytes,
//! [`load`] a path and a reader. Files may come from anywhere: what a file declares is checked
//! against what it has before memory is allocated, so that a reader uses a bounded multiple of the file's
//! length; nesting costs no stack. Every error has the line or the byte, what was found and what is allowed.

pub mod bvh;
pub mod c3d;
pub mod csv;
mod format;
pub mod joint_motion;
pub mod trc;

pub use format::{Format, ReadOptions, Recording, RecordingFile};

use crate::recording::{Convention, RecordingError};
use format::Choices;
use somersault_multibody::ModelError;
use std::fmt;
use std::path::{Path, PathBuf};

/// Where in a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Place {
    /// Line, from 1.
    Line(usize),
    /// Byte, from 0.
    Byte(usize),
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Line(line) => write!(f, "line {line}"),
            Self::Byte(byte) => write!(f, "byte {byte}"),
        }
    }
}

/// Why a file is not a recording.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ReadError {
    /// Something else stands where the format wants something.
    #[error("{place}: found `{found}`, allowed is {allowed}")]
    Unexpected {
        /// Where.
        place: Place,
        /// What is there, shortened.
        found: String,
        /// What may be there.
        allowed: String,
    },
    /// What stands there contradicts the format, for a reason that says what is allowed.
    #[error("{place}: {reason} (column {column})")]
    Malformed {
        /// Where.
        place: Place,
        /// Column of the line, from 1.
        column: usize,
        /// What is there, and what may be.
        reason: String,
    },
    /// The file ends too early.
    #[error("{place}: the file ends where there must be {allowed}")]
    Truncated {
        /// Its end.
        place: Place,
        /// What is missing.
        allowed: String,
    },
    /// The file declares a number that is not that of what it has.
    #[error("{place}: {declared} {quantity} are declared, found are {found}")]
    Misdeclared {
        /// Where it is declared.
        place: Place,
        /// What is counted.
        quantity: &'static str,
        /// Number declared.
        declared: u64,
        /// Number found.
        found: u64,
    },
    /// A number is NaN or infinite.
    #[error("{place}: {quantity} must be finite, found `{found}`")]
    NonFinite {
        /// Where.
        place: Place,
        /// What the number is.
        quantity: &'static str,
        /// What is there.
        found: String,
    },
    /// There is no frame in the file.
    #[error("{place}: the file has no frames, at least one is needed")]
    NoFrames {
        /// Where the frames should begin.
        place: Place,
    },
    /// The file is not text.
    #[error("{place}: not UTF-8")]
    Encoding {
        /// The first byte that is not.
        place: Place,
    },
    /// The numbers can be read, but are no recording.
    #[error("{place}: {source}")]
    Recording {
        /// The frame, or else where what is wrong is declared.
        place: Place,
        /// Why.
        source: RecordingError,
    },
    /// Neither the file nor the caller says in which unit lengths are.
    #[error("`unit` must be given, since {format} has none")]
    NoUnit {
        /// Name of the format.
        format: &'static str,
    },
    /// The axes that the caller names are invalid.
    #[error(transparent)]
    Axes(RecordingError),
    /// The body whose lengths a motion takes is invalid.
    #[error("`diver`: {0}")]
    Diver(#[from] ModelError),
}

impl ReadError {
    /// Where in the file; nowhere if the fault is not the file's.
    pub fn place(&self) -> Option<Place> {
        match self {
            Self::Unexpected { place, .. }
            | Self::Malformed { place, .. }
            | Self::Truncated { place, .. }
            | Self::Misdeclared { place, .. }
            | Self::NonFinite { place, .. }
            | Self::NoFrames { place }
            | Self::Encoding { place }
            | Self::Recording { place, .. } => Some(*place),
            Self::NoUnit { .. } | Self::Axes(_) | Self::Diver(_) => None,
        }
    }

    /// An error of a recording, at its frame or, where it is in none, at the `head` of the file.
    fn recording(source: RecordingError, head: Place, place_of: impl FnOnce(usize) -> Option<Place>) -> Self {
        let place = source.frame().and_then(place_of).unwrap_or(head);
        Self::Recording { place, source }
    }
}

/// Why a path has no recording.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum LoadError {
    /// The file cannot be opened or read.
    #[error("`{}` cannot be read: {reason}", path.display())]
    Io {
        /// The path.
        path: PathBuf,
        /// What the operating system says.
        reason: String,
    },
    /// The ending of its name is that of no format.
    #[error("`{}` must end in {}", path.display(), endings())]
    UnknownFormat {
        /// The path.
        path: PathBuf,
    },
    /// The file is not what it should be.
    #[error("`{}`: {source}", path.display())]
    Read {
        /// The path.
        path: PathBuf,
        /// What is wrong.
        source: ReadError,
    },
}

/// The formats.
pub const FORMATS: [&Format; 5] =
    [&csv::FORMAT, &trc::FORMAT, &c3d::FORMAT, &bvh::FORMAT, &joint_motion::FORMAT];

/// The format whose files end so, in any case and without the dot.
pub fn format_of(ending: &str) -> Option<&'static Format> {
    let ending = ending.to_ascii_lowercase();
    FORMATS.into_iter().find(|format| format.endings.contains(&ending.as_str()))
}

/// All endings of [`FORMATS`], for a message.
pub fn endings() -> String {
    let all: Vec<String> =
        FORMATS.iter().flat_map(|format| format.endings).map(|ending| format!(".{ending}")).collect();
    match all.split_last() {
        Some((last, others)) if !others.is_empty() => format!("{} or {last}", others.join(", ")),
        Some(_) | None => all.concat(),
    }
}

/// Reads the file at `path`, which is of the format that its ending says.
///
/// ```no_run
/// use somersault_motion::readers::{ReadOptions, read_file};
///
/// let gait = read_file("gait.c3d", &ReadOptions::default())?.recording.into_markers()?;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn read_file(path: impl AsRef<Path>, options: &ReadOptions) -> Result<RecordingFile, LoadError> {
    let path = path.as_ref();
    let ending = path.extension().and_then(|ending| ending.to_str());
    match ending.and_then(format_of) {
        Some(format) => load(path, |bytes| format.read(bytes, options)),
        None => Err(LoadError::UnknownFormat { path: path.to_owned() }),
    }
}

/// Reads the file at `path` with one of the readers.
///
/// ```no_run
/// use somersault_motion::readers::{load, c3d, text, trc, MarkerOptions};
///
/// let gait = load("gait.c3d", |bytes| c3d::read(bytes, &c3d::C3dOptions::default()))?;
/// let jump = load("jump.trc", |bytes| trc::read(text(bytes)?, &MarkerOptions::default()))?;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn load<T>(
    path: impl AsRef<Path>,
    reader: impl FnOnce(&[u8]) -> Result<T, ReadError>,
) -> Result<T, LoadError> {
    let path = path.as_ref().to_owned();
    match std::fs::read(&path) {
        Ok(bytes) => reader(&bytes).map_err(|source| LoadError::Read { path, source }),
        Err(error) => Err(LoadError::Io { path, reason: error.to_string() }),
    }
}

/// The text of a file; a byte order mark is left out.
pub fn text(bytes: &[u8]) -> Result<&str, ReadError> {
    let text = std::str::from_utf8(bytes)
        .map_err(|error| ReadError::Encoding { place: Place::Byte(error.valid_up_to()) })?;
    Ok(text.strip_prefix('\u{feff}').unwrap_or(text))
}

/// What a text file of markers does not say.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MarkerOptions {
    /// Axes, and the unit where the file has none.
    pub convention: Convention,
    /// Whether a marker with all three coordinates `NaN` is missing, as some programs write it, rather than an
    /// error. Empty cells always are.
    pub nan_is_gap: bool,
}

impl Default for MarkerOptions {
    /// z up, in m; NaN is an error.
    fn default() -> Self {
        Self { convention: Convention::z_up(crate::recording::LengthUnit::Metre), nan_is_gap: false }
    }
}

/// What was found, for a message: its end is marked by … where it is cut.
fn shorten(found: &str, longest: usize) -> String {
    match found.char_indices().nth(longest) {
        Some((end, _)) => format!("{}…", &found[..end]),
        None => found.to_owned(),
    }
}

/// Characters of a word that a message repeats.
const LONGEST: usize = 40;

pub(crate) fn unexpected(place: Place, found: &str, allowed: impl Into<String>) -> ReadError {
    ReadError::Unexpected { place, found: shorten(found, LONGEST), allowed: allowed.into() }
}

/// A finite number.
pub(crate) fn number(place: Place, text: &str, quantity: &'static str) -> Result<f64, ReadError> {
    match text.parse::<f64>() {
        Ok(x) if x.is_finite() => Ok(x),
        Ok(_) => Err(ReadError::NonFinite { place, quantity, found: shorten(text, LONGEST) }),
        Err(_) => Err(unexpected(place, text, format!("{quantity}, a number"))),
    }
}

/// A marker's three cells: all empty is a gap.
fn point(
    place: Place,
    cells: [&str; 3],
    options: &MarkerOptions,
) -> Result<Option<nalgebra::Vector3<f64>>, ReadError> {
    let nan = |cell: &str| options.nan_is_gap && cell.eq_ignore_ascii_case("nan");
    if cells.iter().all(|cell| cell.is_empty()) || cells.iter().all(|cell| nan(cell)) {
        return Ok(None);
    }
    let mut x = nalgebra::Vector3::zeros();
    for (coordinate, cell) in x.iter_mut().zip(cells) {
        *coordinate = number(place, cell, "a coordinate")?;
    }
    Ok(Some(options.convention.position(&x)))
}
