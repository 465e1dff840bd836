//! Sets of judged motions that users provide: a list of files with scores.
//!
//! ```text
//! # comment
//! motion,score,athlete,synthetic,height
//! monday/dive_01.c3d,7.5,Ann,false,1.52
//! monday/dive_02.c3d,6.0,Bea,false,1.47
//! ```
//! The list is comma-separated text. Its first line names the columns, in any order: `motion`, a file relative
//! to the list and below its folder, listed once; `score`, a number; `athlete`, which may be left out, a name: the motions of an athlete
//! are left out together ([`Groups`]); `synthetic`, which may be left out, `true`
//! or `false`: whether motion or score are synthetic; all other columns are numbers that serve as single
//! features, as baselines of [`validate`](crate::scoring::validate). Blank lines and lines that begin with `#`
//! are ignored.
//!
//! Files are read by their ending: `.csv`, `.trc` and `.c3d` have markers; of `.bvh`, and of `.json` and
//! `.txt`, which are motions of DeepMimic, the joint centres are taken for markers. All must have the markers
//! of the first one; others are ignored.
//!
//! [`Groups`]: crate::scoring::Groups

use crate::readers::csv::Rows;
use crate::readers::{
    LoadError, Place, ReadError, ReadOptions, RecordingFile, Repair, format_names, load, number, read_file,
    text, unexpected,
};
use crate::recording::{Convention, LengthUnit, MarkerRecording, RecordingError};
use crate::scoring::{Performance, ScoringError};
use crate::writers::{self, WriteError};
use ::csv::StringRecord;
use somersault_multibody::models::Diver;
use std::path::{Component, Path, PathBuf};

/// The name of the list in a folder that [`JudgedSet::save`] writes.
const LIST: &str = "judged.csv";

/// A line of the list.
#[derive(Debug, Clone, PartialEq)]
pub struct JudgedMotion {
    /// The file, relative to the list.
    pub file: String,
    /// Its score.
    pub score: f64,
    /// Whose it is, where the list says so.
    pub athlete: Option<String>,
    /// Whether motion or score are synthetic.
    pub synthetic: bool,
    /// Single features, in the order of their names.
    pub features: Vec<f64>,
    /// Line in the list, from 1.
    pub line: usize,
}

/// The list.
#[derive(Debug, Clone, PartialEq)]
pub struct JudgedList {
    /// Names of the features.
    pub feature_names: Vec<String>,
    /// Its lines.
    pub motions: Vec<JudgedMotion>,
}

/// How the files of a list are read.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct JudgedOptions {
    /// Axes, and the unit where a file has none.
    pub convention: Convention,
    /// Whether NaN in files of markers is a gap.
    pub nan_is_gap: bool,
    /// The longest gap that is filled, s, or 0 for none. Gaps that are left are errors.
    pub longest_gap: f64,
    /// Whose lengths the motions of DeepMimic have.
    pub diver: Diver,
}

impl Default for JudgedOptions {
    /// z up, in m; gaps of up to 0.1 s are filled; the spatial diver.
    fn default() -> Self {
        let convention = Convention::z_up(LengthUnit::Metre);
        Self { convention, nan_is_gap: false, longest_gap: 0.1, diver: Diver::spatial() }
    }
}

/// A list with its motions: markers of the same names without gaps.
#[derive(Debug, Clone, PartialEq)]
pub struct JudgedSet {
    /// The list.
    pub list: JudgedList,
    /// The motion of each line.
    pub recordings: Vec<MarkerRecording>,
    /// What was repaired in files, and the line of each; of sets that were not read, nothing.
    pub repairs: Vec<(usize, Repair)>,
}

/// Why there is no judged set.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum JudgedError {
    /// The list cannot be read.
    #[error(transparent)]
    List(LoadError),
    /// A motion of it cannot.
    #[error("line {line} of the list: {source}")]
    Motion {
        /// Line in the list, from 1.
        line: usize,
        /// Why.
        source: LoadError,
    },
    /// A file is listed twice, under two names.
    #[error(
        "line {line} of the list: `{file}` is the file of line {before}; each motion must be listed once"
    )]
    Twice {
        /// Line in the list, from 1.
        line: usize,
        /// The file.
        file: String,
        /// The line that has it too.
        before: usize,
    },
    /// A file has no known ending.
    #[error("line {line} of the list: `{file}` has none of the known formats: {}", format_names())]
    UnknownFormat {
        /// Line in the list, from 1.
        line: usize,
        /// The file.
        file: String,
    },
    /// A motion cannot be saved under its name.
    #[error("line {line} of the list: `{file}` must end in .csv to be saved")]
    NotCsv {
        /// Line in the list, from 1.
        line: usize,
        /// The file.
        file: String,
    },
    /// A motion lacks a marker that the first one has, or its gaps cannot be filled.
    #[error("line {line} of the list: `{file}` does not suit the others: {source}")]
    Recording {
        /// Line in the list, from 1.
        line: usize,
        /// The file.
        file: String,
        /// Why.
        source: RecordingError,
    },
    /// A gap is longer than what is filled, or at an end.
    #[error("line {line} of the list: `{marker}` of `{file}` has a gap in frame {frame} that is not filled")]
    Gap {
        /// Line in the list, from 1.
        line: usize,
        /// The file.
        file: String,
        /// The marker.
        marker: String,
        /// Frame, from 0.
        frame: usize,
    },
    /// The longest gap is no length of time.
    #[error("`longest_gap` must be finite and not negative, found {found}")]
    LongestGap {
        /// What was given, s.
        found: f64,
    },
    /// A motion cannot be scored.
    #[error("line {line} of the list: {source}")]
    Scoring {
        /// Line in the list, from 1.
        line: usize,
        /// Why.
        source: ScoringError,
    },
    /// A set cannot be written.
    #[error(transparent)]
    Write(#[from] WriteError),
    /// A path cannot be written to.
    #[error("`{}` cannot be written: {reason}", path.display())]
    Io {
        /// The path.
        path: PathBuf,
        /// What the operating system says.
        reason: String,
    },
}

/// What a column holds.
#[derive(Clone, Copy, PartialEq)]
enum Column {
    Motion,
    Score,
    Athlete,
    Synthetic,
    Feature,
}

/// The list in `text`.
pub fn read(text: &str) -> Result<JudgedList, ReadError> {
    let mut rows = Rows::new(text);
    let mut record = StringRecord::new();
    let Some(head) = rows.next(&mut record) else {
        let allowed = "the names of columns".to_owned();
        return Err(ReadError::Truncated { place: Place::Line(1), allowed });
    };
    let (columns, feature_names) = columns(head, &record)?;
    let mut motions: Vec<JudgedMotion> = Vec::new();
    let mut seen = std::collections::HashSet::new();
    while let Some(place) = rows.next(&mut record) {
        if record.len() != columns.len() {
            let found = format!("{} cells", record.len());
            return Err(unexpected(place, &found, format!("{} cells, as many as names", columns.len())));
        }
        let mut motion = JudgedMotion {
            file: String::new(),
            score: 0.0,
            athlete: None,
            synthetic: false,
            features: Vec::new(),
            line: if let Place::Line(line) = place { line } else { 0 },
        };
        for (column, cell) in columns.iter().zip(&record) {
            match column {
                Column::Motion => motion.file = file(place, cell)?,
                Column::Score => motion.score = number(place, cell, "a score")?,
                Column::Athlete if cell.is_empty() => {
                    return Err(unexpected(place, cell, "the name of an athlete"));
                }
                Column::Athlete => motion.athlete = Some(cell.to_owned()),
                Column::Synthetic => {
                    motion.synthetic = cell.parse().map_err(|_| unexpected(place, cell, "true or false"))?;
                }
                Column::Feature => motion.features.push(number(place, cell, "a feature")?),
            }
        }
        // a motion that is left out must not be learnt from in another line
        if !seen.insert(parts(&motion.file)) {
            return Err(unexpected(place, &motion.file, "a motion that is not in the list already"));
        }
        motions.push(motion);
    }
    if motions.is_empty() {
        return Err(ReadError::Truncated { place: head, allowed: "at least one motion after it".to_owned() });
    }
    Ok(JudgedList { feature_names, motions })
}

fn columns(place: Place, header: &StringRecord) -> Result<(Vec<Column>, Vec<String>), ReadError> {
    let mut names = std::collections::HashSet::new();
    let (mut columns, mut features) = (Vec::new(), Vec::new());
    for name in header {
        if name.is_empty() || !names.insert(name) {
            return Err(unexpected(place, name, "names of columns that differ"));
        }
        columns.push(match name {
            "motion" => Column::Motion,
            "score" => Column::Score,
            "athlete" => Column::Athlete,
            "synthetic" => Column::Synthetic,
            _ => {
                features.push(name.to_owned());
                Column::Feature
            }
        });
    }
    match [Column::Motion, Column::Score].iter().all(|c| columns.contains(c)) {
        true => Ok((columns, features)),
        false => {
            let found = header.iter().collect::<Vec<_>>().join(",");
            Err(unexpected(place, &found, "columns with motion and score among them"))
        }
    }
}

/// A path below the folder of the list: nothing else on the machine is opened for what a list says.
fn file(place: Place, cell: &str) -> Result<String, ReadError> {
    let inside = Path::new(cell).components().all(|c| matches!(c, Component::Normal(_)));
    if cell.is_empty() || !inside || cell.contains('\\') {
        return Err(unexpected(place, cell, "a file below the folder of the list, its parts joined by /"));
    }
    Ok(cell.to_owned())
}

/// What a file below the folder is called, whatever stands between the parts of its name.
fn parts(file: &str) -> PathBuf {
    Path::new(file).components().collect()
}

/// The list at `path` and its motions.
pub fn load_set(path: impl AsRef<Path>, options: &JudgedOptions) -> Result<JudgedSet, JudgedError> {
    let path = path.as_ref();
    if !(options.longest_gap >= 0.0 && options.longest_gap.is_finite()) {
        return Err(JudgedError::LongestGap { found: options.longest_gap });
    }
    let list = load(path, |bytes| read(text(bytes)?)).map_err(JudgedError::List)?;
    let folder = path.parent().unwrap_or(Path::new(""));
    let mut recordings: Vec<MarkerRecording> = Vec::with_capacity(list.motions.len());
    let mut repairs = Vec::new();
    let mut seen = std::collections::HashMap::new();
    for motion in &list.motions {
        let (found, repaired) = recording(folder, motion, options)?;
        repairs.extend(repaired.into_iter().map(|repair| (motion.line, repair)));
        // two names of one file; where there is no such name of it, its own will do
        let path = folder.join(&motion.file);
        if let Some(before) = seen.insert(path.canonicalize().unwrap_or(path), motion.line) {
            return Err(JudgedError::Twice { line: motion.line, file: motion.file.clone(), before });
        }
        let (line, file) = (motion.line, motion.file.clone());
        let unsuited = |source| JudgedError::Recording { line, file: file.clone(), source };
        let found = match recordings.first() {
            Some(first) => found.select(first.names()).map_err(unsuited)?,
            None => found,
        };
        let found = if found.n_missing() > 0 && options.longest_gap > 0.0 {
            found.fill_gaps(options.longest_gap).map_err(unsuited)?
        } else {
            found
        };
        for (frame, points) in found.frames().enumerate() {
            if let Some(k) = points.iter().position(Option::is_none) {
                return Err(JudgedError::Gap { line, file, marker: found.names()[k].clone(), frame });
            }
        }
        recordings.push(found);
    }
    Ok(JudgedSet { list, recordings, repairs })
}

fn recording(
    folder: &Path,
    motion: &JudgedMotion,
    options: &JudgedOptions,
) -> Result<(MarkerRecording, Vec<Repair>), JudgedError> {
    let JudgedOptions { convention, nan_is_gap, diver, .. } = *options;
    let options = ReadOptions {
        unit: Some(convention.unit()),
        up: Some(convention.up()),
        forward: Some(convention.forward()),
        nan_is_gap,
        diver,
        ..ReadOptions::default()
    };
    let (line, file) = (motion.line, motion.file.clone());
    match read_file(folder.join(&motion.file), &options) {
        Ok(RecordingFile { recording, repairs }) => match recording.into_markers() {
            Ok(recording) => Ok((recording, repairs)),
            Err(source) => Err(JudgedError::Recording { line, file, source }),
        },
        Err(LoadError::UnknownFormat { .. }) => Err(JudgedError::UnknownFormat { line, file }),
        Err(source) => Err(JudgedError::Motion { line, source }),
    }
}

/// The list as text that [`read`] reads; lines that are synthetic are labelled SYNTHETIC, and so is the list.
///
/// Fails where `read` would: a file that is listed twice or is not below the folder, a score or feature that
/// is not finite, another number of features than names.
pub fn write(list: &JudgedList) -> Result<String, WriteError> {
    const ALLOWED: &str = "names without comma, quote, number sign, line break or blanks around them";
    expect_list(list)?;
    let mut out = String::new();
    if list.motions.iter().any(|m| m.synthetic) {
        out.push_str("# SYNTHETIC: motions or scores are synthetic\n");
    }
    let has_athletes = list.motions.iter().any(|motion| motion.athlete.is_some());
    out.push_str(if has_athletes { "motion,score,synthetic,athlete" } else { "motion,score,synthetic" });
    for name in &list.feature_names {
        writers::expect_name(name, &[',', '"'], ALLOWED)?;
        out.push(',');
        out.push_str(name);
    }
    out.push('\n');
    for motion in &list.motions {
        writers::expect_name(&motion.file, &[',', '"', '#'], ALLOWED)?;
        out.push_str(&format!("{},{},{}", motion.file, motion.score, motion.synthetic));
        if let Some(athlete) = &motion.athlete {
            writers::expect_name(athlete, &[',', '"'], ALLOWED)?;
            out.push(',');
            out.push_str(athlete);
        }
        motion.features.iter().for_each(|x| out.push_str(&format!(",{x}")));
        out.push('\n');
    }
    Ok(out)
}

fn expect_list(list: &JudgedList) -> Result<(), WriteError> {
    let name = |name: &String, allowed| Err(WriteError::Name { name: name.clone(), allowed });
    let mut seen = std::collections::HashSet::new();
    for column in &list.feature_names {
        if ["motion", "score", "athlete", "synthetic"].contains(&column.as_str()) || !seen.insert(column) {
            return name(column, "features other than motion, score, athlete and synthetic, each once");
        }
    }
    let without = |motion: &&JudgedMotion| motion.athlete.is_none();
    if let (Some(motion), true) =
        (list.motions.iter().find(without), !list.motions.iter().all(|m| without(&m)))
    {
        return name(&motion.file, "files of athletes with a name, all or none");
    }
    let mut seen = std::collections::HashSet::new();
    for (k, motion) in list.motions.iter().enumerate() {
        if file(Place::Line(motion.line), &motion.file).is_err() || !seen.insert(parts(&motion.file)) {
            return name(&motion.file, "files below the folder of the list, each once");
        }
        let (expected, found) = (list.feature_names.len(), motion.features.len());
        if found != expected {
            return Err(WriteError::Features { motion: k, expected, found });
        }
        if let Some(&found) = [motion.score].iter().chain(&motion.features).find(|x| !x.is_finite()) {
            return Err(WriteError::NonFinite { motion: k, found });
        }
    }
    Ok(())
}

impl JudgedSet {
    /// The scores, in the order of the list.
    pub fn scores(&self) -> Vec<f64> {
        self.list.motions.iter().map(|m| m.score).collect()
    }

    /// The athlete of each motion, in the order of the list, where it says so; the labels of [`Groups`](crate::scoring::Groups).
    pub fn athletes(&self) -> Option<Vec<&str>> {
        self.list.motions.iter().map(|motion| motion.athlete.as_deref()).collect()
    }

    /// Each feature with its numbers, in the order of the list.
    pub fn features(&self) -> Vec<(String, Vec<f64>)> {
        let names = self.list.feature_names.iter().enumerate();
        names
            .map(|(k, name)| (name.clone(), self.list.motions.iter().map(|m| m.features[k]).collect()))
            .collect()
    }

    /// The motions to be scored, those that are synthetic labelled so.
    pub fn performances(&self) -> Result<Vec<Performance>, JudgedError> {
        let performance = |(motion, recording): (&JudgedMotion, &MarkerRecording)| {
            let found = Performance::from_markers(recording)
                .map_err(|source| JudgedError::Scoring { line: motion.line, source })?;
            Ok(if motion.synthetic { found.labelled_synthetic() } else { found })
        };
        self.list.motions.iter().zip(&self.recordings).map(performance).collect()
    }

    /// Writes the list as `judged.csv` and its motions into `folder`, under the names that the list has: they
    /// end in `.csv`, and are markers in m, z up. Files of motions that are synthetic begin with a comment that
    /// says SYNTHETIC. Nothing is written where the list or a motion cannot be.
    pub fn save(&self, folder: impl AsRef<Path>) -> Result<(), JudgedError> {
        let folder = folder.as_ref();
        let put = |name: &str, content: String| {
            let path = folder.join(name);
            let made = path.parent().map_or(Ok(()), std::fs::create_dir_all);
            let written = made.and_then(|()| std::fs::write(&path, content));
            written.map_err(|error| JudgedError::Io { path, reason: error.to_string() })
        };
        let metres = Convention::z_up(LengthUnit::Metre);
        let (expected, found) = (self.list.motions.len(), self.recordings.len());
        if found != expected {
            return Err(WriteError::Recordings { expected, found }.into());
        }
        let list = write(&self.list)?;
        let mut files = Vec::with_capacity(found);
        for (motion, recording) in self.list.motions.iter().zip(&self.recordings) {
            if !motion.file.ends_with(".csv") {
                return Err(JudgedError::NotCsv { line: motion.line, file: motion.file.clone() });
            }
            // some file systems do not know case
            if motion.file.eq_ignore_ascii_case(LIST) {
                let allowed = "names other than judged.csv, which is that of the list";
                return Err(WriteError::Name { name: motion.file.clone(), allowed }.into());
            }
            let label =
                if motion.synthetic { "# SYNTHETIC: this motion or its score is synthetic\n" } else { "" };
            files.push((&motion.file, label.to_owned() + &writers::csv::write(recording, &metres)?));
        }
        files.into_iter().try_for_each(|(name, content)| put(name, content))?;
        put(LIST, list)
    }
}
