//! Files with recorded motions.
//!
//! | Format | Here | Gives |
//! |---|---|---|
//! | BVH | [`bvh`] | skeleton |
//! | motions of DeepMimic (JSON) | [`joint_motion`] | skeleton |
//! | C3D | [`c3d`] | markers; channels, force plates and events |
//! | TRC | [`trc`] | markers |
//! | MOT and STO of OpenSim | [`mot`] | channels |
//! | CSV and TSV, also of Motive, Nexus and QTM | [`csv`] | markers or channels |
//! | key points of pose estimators (JSON) | [`pose`] | key points |
//!
//! Beside recordings there are tables of judges' [`awards`].
//!
//! [`read_file`] takes a path and finds the reader by what the file has; [`FORMATS`] has a row for each. Readers take text or
//! bytes, [`load`] a path and a reader. Files may come from anywhere: what a file declares is checked
//! against what it has before memory is allocated, so that a reader uses a bounded multiple of the file's
//! length; nesting costs no stack. Every error has the line or the byte, what was found and what is allowed.
//!
//! Programs write their formats in many ways. Unless [`ReadOptions::strict`] is set, what has one meaning only is read, and
//! what was put right is listed as [`Repair`]s of the [`RecordingFile`]. The functions `read` of single formats are strict,
//! `read_repaired` are tolerant.

pub mod awards;
pub mod bvh;
pub mod c3d;
pub mod csv;
mod decoding;
mod format;
pub mod joint_motion;
pub mod mot;
pub mod pose;
mod repair;

pub mod trc;
mod vertical;

pub use format::{Format, ReadOptions, Recording, RecordingFile};
pub use repair::{Repair, Repairs};

use crate::recording::{Convention, RecordingError};
use decoding::{beginning, decoded};
use format::{Choices, Parsed};
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
    #[error("{place}: {declared} {quantity} are declared, found {found}")]
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
    /// Neither the file nor the caller says when the frames were.
    #[error("`rate`, frames a second, must be given, since files of {format} have no times")]
    NoRate {
        /// Name of the format.
        format: &'static str,
    },
    /// A number of frames a second is not positive or not finite.
    #[error("`rate` must be positive and finite, found {found}")]
    Rate {
        /// Number found.
        found: f64,
    },
    /// There is no such person in any frame.
    #[error("`person` must be below {n_people}, the number of people in a frame, found {found}")]
    Person {
        /// Number found.
        found: usize,
        /// The greatest number of people in a frame.
        n_people: usize,
    },
    /// The file needs a repair, and a strict reader makes none.
    #[error("{place}: {what}; this is repaired unless `strict` is set")]
    Repairable {
        /// Where.
        place: Place,
        /// What is to be repaired.
        what: String,
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
            | Self::Repairable { place, .. }
            | Self::Recording { place, .. } => Some(*place),
            Self::NoUnit { .. }
            | Self::NoRate { .. }
            | Self::Rate { .. }
            | Self::Person { .. }
            | Self::Axes(_)
            | Self::Diver(_) => None,
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
    /// The file is empty.
    #[error("`{}` is empty", path.display())]
    Empty {
        /// The path.
        path: PathBuf,
    },
    /// The folder has no frames.
    #[error("`{}` is a folder without frames of key points, whose files end in .json", path.display())]
    NoFrames {
        /// The path.
        path: PathBuf,
    },
    /// Neither what the file has nor the ending of its name is of a format.
    #[error("`{}` begins with `{found}` and has none of the known formats: {}", path.display(), format_names())]
    UnknownFormat {
        /// The path.
        path: PathBuf,
        /// The beginning of the file, shortened.
        found: String,
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

/// The formats, in the order in which a file is compared with them.
pub const FORMATS: [&Format; 7] = [
    &c3d::FORMAT,
    &trc::FORMAT,
    &bvh::FORMAT,
    &joint_motion::FORMAT,
    &pose::FORMAT,
    &mot::FORMAT,
    &csv::FORMAT,
];

/// The format whose files end so, in any case and without the dot; of two formats the first of the table.
pub fn format_of(ending: &str) -> Option<&'static Format> {
    let ending = ending.to_ascii_lowercase();
    FORMATS.into_iter().find(|format| format.endings.contains(&ending.as_str()))
}

/// The format whose files end so; of several that share the ending that which the file is of, and else the first.
pub fn format_of_ending(ending: &str, bytes: &[u8]) -> Option<&'static Format> {
    let ending = ending.trim_start_matches('.').to_ascii_lowercase();
    let beginning = beginning(bytes);
    let named = |format: &&Format| format.endings.contains(&ending.as_str());
    let knows = |format: &&'static Format| named(format) && (format.knows)(bytes, &beginning);
    FORMATS.into_iter().find(knows).or_else(|| FORMATS.into_iter().find(named))
}

/// The format of a file by what it has.
pub fn format_of_content(bytes: &[u8]) -> Option<&'static Format> {
    let beginning = beginning(bytes);
    FORMATS.into_iter().find(|format| (format.knows)(bytes, &beginning))
}

/// The format of the file of this name, and a repair where its name says another. What the file has decides; the name does
/// where that is of no format, so that the reader says what is wrong with it: of formats that share an ending the last of the table,
/// whose files differ most.
fn format_of_file(name: &Path, bytes: &[u8]) -> Option<(&'static Format, Option<Repair>)> {
    let ending = name.extension().and_then(|ending| ending.to_str()).unwrap_or_default();
    let Some(found) = format_of_content(bytes) else {
        let named = |format: &&Format| format.endings.contains(&ending.to_ascii_lowercase().as_str());
        return FORMATS.into_iter().rev().find(named).map(|named| (named, None));
    };
    let other = format_of(ending).filter(|_| !found.endings.contains(&ending.to_ascii_lowercase().as_str()));
    let what =
        other.map(|named| format!("the name is that of {}, but the file is {}", named.name, found.name));
    Some((
        found,
        what.map(|what| Repair { is_decision: false, place: Place::Byte(0), what: what.into(), count: 1 }),
    ))
}

/// Reads the bytes of a file of this name, in the format that they are of.
pub fn read_named(
    name: impl AsRef<Path>,
    bytes: &[u8],
    options: &ReadOptions,
) -> Result<RecordingFile, LoadError> {
    let path = name.as_ref().to_owned();
    if bytes.is_empty() {
        return Err(LoadError::Empty { path });
    }
    let Some((format, repair)) = format_of_file(&path, bytes) else {
        let beginning = beginning(bytes);
        let line = beginning.lines().find(|line| !line.trim().is_empty());
        let found = shorten(line.unwrap_or_default(), LONGEST);
        return Err(LoadError::UnknownFormat { path, found });
    };
    if let Some(Repair { place, what, .. }) = repair.clone().filter(|_| options.strict) {
        let source = ReadError::Repairable { place, what: what.into_owned() };
        return Err(LoadError::Read { path, source });
    }
    let found = format.read(bytes, options).map_err(|source| LoadError::Read { path, source })?;
    let repairs = repair.into_iter().chain(found.repairs).collect();
    Ok(RecordingFile { repairs, ..found })
}

/// All names of [`FORMATS`], for a message.
pub fn format_names() -> String {
    listed(FORMATS.iter().map(|format| format.name.to_owned()).collect(), "and")
}

/// All endings of [`FORMATS`], for a message.
pub fn endings() -> String {
    let mut all: Vec<String> =
        FORMATS.iter().flat_map(|format| format.endings).map(|ending| format!(".{ending}")).collect();
    let mut seen = std::collections::HashSet::new();
    all.retain(|ending| seen.insert(ending.clone()));
    listed(all, "or")
}

fn listed(all: Vec<String>, conjunction: &str) -> String {
    match all.split_last() {
        Some((last, others)) if !others.is_empty() => format!("{} {conjunction} {last}", others.join(", ")),
        Some(_) | None => all.concat(),
    }
}

/// Reads the file at `path`, in the format that it is of, or a folder of OpenPose with a file for each frame.
///
/// ```no_run
/// use somersault_motion::readers::{ReadOptions, read_file};
///
/// let gait = read_file("gait.c3d", &ReadOptions::default())?.recording.into_markers()?;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn read_file(path: impl AsRef<Path>, options: &ReadOptions) -> Result<RecordingFile, LoadError> {
    let path = path.as_ref();
    let bytes = if path.is_dir() { pose::frames_in(path)? } else { bytes_at(path)? };
    read_named(path, &bytes, options)
}

/// The bytes of a file.
fn bytes_at(path: &Path) -> Result<Vec<u8>, LoadError> {
    std::fs::read(path).map_err(|error| LoadError::Io { path: path.to_owned(), reason: error.to_string() })
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
    let path = path.as_ref();
    reader(&bytes_at(path)?).map_err(|source| LoadError::Read { path: path.to_owned(), source })
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

/// What was found, for a message: its end is marked by … where it is cut, and control characters are written as in Rust.
fn shorten(found: &str, longest: usize) -> String {
    let plain = |part: &str| -> String {
        part.chars().map(|c| if c.is_control() { c.escape_default().to_string() } else { c.into() }).collect()
    };
    match found.char_indices().nth(longest) {
        Some((end, _)) => format!("{}…", plain(&found[..end])),
        None => plain(found),
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

/// Whether a cell stands for a number that is not there.
fn is_nan(cell: &str) -> bool {
    let bare = cell.trim_start_matches(['-', '+']);
    // as C's library of Windows prints them too
    ["nan", "nan(ind)", "1.#ind", "1.#qnan", "null", "none", "n/a", "na"].iter().any(|name| {
        bare.eq_ignore_ascii_case(name)
            || bare.strip_suffix("00").is_some_and(|b| b.eq_ignore_ascii_case(name))
    })
}

/// A finite number of a table, with a decimal point or, where that is repaired, a decimal comma.
fn number_of_cell(
    place: Place,
    cell: &str,
    quantity: &'static str,
    repairs: &mut Repairs,
) -> Result<f64, ReadError> {
    match number(place, cell, quantity) {
        Err(error) if cell.contains(',') && !cell.contains('.') => {
            let number = number(place, &cell.replacen(',', ".", 1), quantity)?;
            repairs.instead_of(error, "numbers have a decimal comma")?;
            Ok(number)
        }
        found => found,
    }
}

/// A marker's three cells: all empty is a gap, and so are those with NaN or with a part empty where this is repaired.
fn point(
    place: Place,
    cells: [&str; 3],
    options: &MarkerOptions,
    repairs: &mut Repairs,
) -> Result<Option<nalgebra::Vector3<f64>>, ReadError> {
    const COORDINATE: &str = "a coordinate";
    if cells.iter().all(|cell| cell.is_empty()) {
        return Ok(None);
    }
    if cells.iter().all(|cell| is_nan(cell)) {
        if !options.nan_is_gap {
            let quantity = "a coordinate, unless `nan_is_gap` makes NaN a gap,";
            let found = shorten(cells[0], LONGEST);
            let error = ReadError::NonFinite { place, quantity, found };
            repairs.instead_of(error, "a marker at NaN is taken to be missing, as `nan_is_gap` says")?;
        }
        return Ok(None);
    }
    if let Some(cell) = cells.into_iter().find(|cell| cell.is_empty() || is_nan(cell)) {
        let error = match number(place, cell, COORDINATE) {
            Err(error) => error,
            Ok(_) => unexpected(place, cell, "a coordinate, a number"),
        };
        repairs.instead_of(error, "a marker that lacks a coordinate is missing")?;
        return Ok(None);
    }
    let mut x = nalgebra::Vector3::zeros();
    for (coordinate, cell) in x.iter_mut().zip(cells) {
        *coordinate = number_of_cell(place, cell, COORDINATE, repairs)?;
    }
    Ok(Some(options.convention.position(&x)))
}

/// Names that differ: of several that are equal, and of those that are empty, all but the first get a number.
fn distinct(
    names: Vec<String>,
    kind: &str,
    place: Place,
    repairs: &mut Repairs,
) -> Result<Vec<String>, ReadError> {
    let mut seen: std::collections::HashSet<String> =
        names.iter().filter(|name| !name.is_empty()).cloned().collect();
    let mut used = std::collections::HashSet::new();
    let mut out = Vec::with_capacity(names.len());
    for (k, name) in names.into_iter().enumerate() {
        if !name.is_empty() && used.insert(name.clone()) {
            out.push(name);
            continue;
        }
        if name.is_empty() {
            repairs.make(place, format!("{kind}s without a name are numbered"))?;
        } else {
            let source = RecordingError::DuplicateName { name: name.clone() };
            repairs.instead_of(
                ReadError::Recording { place, source },
                format!("{kind}s of the same name are numbered"),
            )?;
        }
        let stem = if name.is_empty() { kind.to_owned() } else { name };
        let mut numbered = format!("{stem} {}", k + 1);
        while !seen.insert(numbered.clone()) {
            numbered.push('\'');
        }
        used.insert(numbered.clone());
        out.push(numbered);
    }
    Ok(out)
}

/// Times of all frames, s: those of the file where it has them and they grow, and otherwise equal steps at the rate that the
/// file or the caller says.
fn times_at_rate(
    times: Vec<Option<f64>>,
    places: &[Place],
    rate: Option<f64>,
    repairs: &mut Repairs,
) -> Result<Vec<f64>, ReadError> {
    let (Some(first), Some(&head)) = (times.first().copied(), places.first()) else { return Ok(Vec::new()) };
    let missing = times.iter().position(Option::is_none);
    let known: Vec<f64> = times.iter().flatten().copied().collect();
    let stuck = known.windows(2).position(|pair| pair[1] <= pair[0]);
    let rate = rate.filter(|rate| *rate > 0.0 && rate.is_finite());
    let (error, what) = match (missing, stuck, rate) {
        (None, None, _) => return Ok(known),
        (Some(frame), _, Some(_)) => {
            let place = places.get(frame).copied().unwrap_or(head);
            (unexpected(place, "", "a time, a number"), "frames without a time are at equal distances")
        }
        (None, Some(i), Some(_)) => {
            let source =
                RecordingError::TimesNotGrowing { frame: i + 1, found: known[i + 1], before: known[i] };
            let place = places.get(i + 1).copied().unwrap_or(head);
            (
                ReadError::Recording { place, source },
                "times do not rise; frames are at equal distances by the rate",
            )
        }
        (Some(frame), _, None) => {
            return Err(unexpected(places.get(frame).copied().unwrap_or(head), "", "a time, a number"));
        }
        // the recording refuses them
        (None, Some(_), None) => return Ok(known),
    };
    let start = first.unwrap_or(0.0);
    let Some(rate) = rate else { return Err(error) };
    repairs.instead_of(error, what)?;
    Ok((0..times.len()).map(|i| start + i as f64 / rate).collect())
}
